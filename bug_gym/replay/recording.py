"""A row of a Simulation, taken down frame by frame: what stands, what moves, what is seen, and what a policy thinks of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.drawing.parts import from_odometry, label_place, outlines_of
from bug_gym.policy import Drawing
from bug_gym.replay.packing import CENTI, MILLI, changes, packed, runs, whole
from bug_gym.replay.page import framed, page_of
from bug_gym.schema.polygons import WeightedRegion
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES
from bug_gym.worlds.layout import Layout

POINT, SEGMENT, AREA = 0, 1, 2
"""What a shape of a drawing is."""


_Part = tuple[int, str, Any]
"""Kind, label and places (k, 2) of a part of a drawing: a tuple of pairs, or a ring as an array."""


@dataclass(frozen=True)
class Episode:
    """An episode to be looked at again; `bug_gym.show` plays it, and a notebook by itself."""

    data: dict[str, Any]
    """What the player reads, plain: see `Recorder.episode`."""

    @property
    def title(self) -> str:
        """Whose episode it is."""
        return str(self.data["title"])

    @property
    def frames(self) -> int:
        """How many frames it has, T."""
        return int(self.data["frames"])

    @property
    def step(self) -> float:
        """Time from one frame to the next [s]."""
        return float(self.data["step"])

    @cached_property
    def packed(self) -> str:
        """The episode as letters, for a page."""
        return packed(self.data)

    def __repr__(self) -> str:
        """Whose it is and how long; all that it holds would fill pages."""
        return f"Episode({self.title!r}, {self.frames} frames)"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return framed(page_of([self.title], [self.packed]))


class Recorder:
    """Takes down one row of a Simulation, frame by frame.

    Args:
        simulation: the worlds.
        row: which of them.
        title: whose episode it is, such as the policy's name.
        every: steps from one frame to the next.
    """

    def __init__(self, simulation: Simulation, *, row: int = 0, title: str = "", every: int = 1) -> None:
        self.simulation, self.row, self.title, self.every = simulation, row, title, every
        self._still: dict[str, Any] = {}
        self._bodies: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._frames: dict[str, list[NDArray[Any]]] = {}
        self._notes: dict[str, int] = {}
        self._labels: dict[str, int] = {}
        self._shapes: dict[tuple[int, ...], int] = {}
        self._came: dict[tuple[Any, ...], int] = {}
        self._shown: list[list[int]] = []
        self._recorded = (-1, -1, -1)
        self._standing: tuple[bytes, ...] = ()

    def record(self, drawings: Drawing | Sequence[Drawing | None] | None = None, *, note: str = "") -> None:
        """Add the row as it is now.

        Args:
            drawings: what the policy shows of its mind, in the frame of its robot's start; a sequence has one for each
                robot.
            note: what is told beside it, such as the policy's state or verdict.

        Raises:
            ValueError: the row has not been reset yet, it has begun another episode since, or a drawing holds places that are
                not finite.
        """
        world, row = self.simulation.world, self.row
        if world.wall_count[row] == 0:
            raise ValueError(f"row {row} holds no world yet: reset the simulation before recording")
        present = (int(world.seed[row]), int(world.episode[row]), int(world.steps[row]))
        standing = outlines_of(world, row)
        if not self._still:
            self._standing = standing
            self._begin()
        elif present[:2] != self._recorded[:2] or present[2] < self._recorded[2] or standing != self._standing:
            raise ValueError(f"row {row} has begun another episode: a Recorder takes down one, make one for each")
        self._recorded = present
        frame = {
            "times": world.time[row],
            "poses": world.pose[row],
            "goals": world.goal[row, : world.goals],
            "places": np.stack([world.array(name)[row, self._bodies] for name in ("body_x", "body_y")], axis=1),
            "velocities": np.stack([world.array(name)[row, self._bodies] for name in ("body_vx", "body_vy")], axis=1),
            "ranges": world.ranges[row],
            "outcomes": world.outcome[row],
            "notes": np.array(self._notes.setdefault(note, len(self._notes))),
        }
        for name, values in frame.items():
            self._frames.setdefault(name, []).append(np.array(values, dtype=np.float64))
        self._shown.append(self._drawn(drawings))

    def _begin(self) -> None:
        """What stays as it is all the time."""
        world, row = self.simulation.world, self.row
        discs, polygons = (int(world.array(name)[row, 0]) for name in ("moving_disc_count", "moving_polygon_count"))
        self._bodies = np.concatenate([np.arange(discs), int(world.spec["discs"][0]) + np.arange(polygons)])
        scenario = world.scenario
        self._still = {
            "title": self.title,
            "scenario": scenario.name,
            "seed": str(world.seed[row]),  # beyond 2^53 a number of JavaScript is not every whole number
            "step": scenario.time.step * self.every,
            "robots": world.robots,
            "goalRadius": scenario.goal.radius,
            "footprint": world.body(row).tolist(),
            "angles": whole(np.arctan2(world.beams[1], world.beams[0])[: scenario.lidar.beams], MILLI),
            "isFullCircle": scenario.lidar.is_full_circle,
            "range": scenario.lidar.range,
            "outcomeNames": list(OUTCOMES),
            "regions": [_region(region, scenario.world.regions) for region in scenario.world.regions],
            **_standing(world.layout(row), scenario.world.box),
        }

    def _drawn(self, drawings: Drawing | Sequence[Drawing | None] | None) -> list[int]:
        """The numbers of the shapes that drawings consist of; each shape is kept once."""
        each = [drawings] if drawings is None or isinstance(drawings, Drawing) else drawings
        origins = self.simulation.world.array("origin")[self.row].reshape(-1, 3)
        return [
            self._number(part, origins[robot])
            for robot, drawing in enumerate(each)
            if drawing is not None
            for part in _parts(drawing)
        ]

    def _number(self, part: _Part, origin: NDArray[np.float64]) -> int:
        """The number of a shape told in the frame of a start; most stay from frame to frame, and are looked up as they came."""
        kind, label, places = part
        came = (origin.tobytes(), kind, label, places if isinstance(places, tuple) else places.tobytes())
        if came not in self._came:
            named = self._labels.setdefault(str(label), len(self._labels))
            shape = (kind, named, *changes(list(from_odometry(places, origin)), CENTI))
            self._came[came] = self._shapes.setdefault(shape, len(self._shapes))
        return self._came[came]

    def episode(self) -> Episode:
        """What was taken down, as plain data.

        Places are whole millimetres, headings milliradians, ranges and drawings centimetres, velocities centimetres a
        second; what is kept of each frame stands as `changes` from frame to frame. `shown` tells the numbers of the shapes
        of each frame as `runs`, 0 where they are those of the frame before.

        Raises:
            ValueError: nothing was recorded.
        """
        if not self._shown:
            raise ValueError("an episode needs at least one frame, got none: call record()")
        units = {"ranges": CENTI, "velocities": CENTI, "outcomes": 1.0, "notes": 1.0}
        frames = {name: changes(values, units.get(name, MILLI)) for name, values in self._frames.items()}
        shown = [
            0 if number and numbers == self._shown[number - 1] else runs(numbers)
            for number, numbers in enumerate(self._shown)
        ]
        drawn = {"labels": list(self._labels), "shapes": list(map(list, self._shapes)), "shown": shown}
        return Episode(
            {**self._still, "frames": len(self._shown), "noteTexts": list(self._notes), **frames, **drawn},
        )


def _parts(drawing: Drawing) -> list[_Part]:
    """What a drawing consists of: areas first, so that the rest lies above them."""
    return [
        *((AREA, label, np.asarray(ring, dtype=np.float64)) for ring, label in drawing.areas),
        *((SEGMENT, label, ((x1, y1), (x2, y2))) for x1, y1, x2, y2, label in drawing.segments),
        *((POINT, label, ((x, y),)) for x, y, label in drawing.points),
    ]


def _standing(layout: Layout, box: tuple[float, float, float, float]) -> dict[str, Any]:
    """What stands, and the outlines of what moves: a radius, or a ring about its place."""
    return {
        "box": list(box),
        "border": whole(layout.border, MILLI),
        "polygons": [[whole(ring, MILLI) for ring in rings] for rings in layout.polygons],
        "circles": whole(layout.circles, MILLI),
        "movers": [whole(mover.outline, MILLI) for mover in layout.movers],
    }


def _region(region: WeightedRegion, regions: Sequence[WeightedRegion]) -> dict[str, Any]:
    """A weighted region: its factor, its rings, and where the factor is written."""
    outline = region.geometry()
    rings = [np.array(ring.coords) for ring in (outline.exterior, *outline.interiors)]
    return {
        "factor": region.factor,
        "rings": [whole(ring, MILLI) for ring in rings],
        "place": label_place(region, regions),
    }
