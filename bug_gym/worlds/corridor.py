"""A passage with shifts at right angles."""

from __future__ import annotations

from typing import Literal

import numpy as np

from bug_gym.geometry import F64
from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, Obstacles, Positive
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout, Rings
from bug_gym.worlds.places import finish
from bug_gym.worlds.polygons import as_polygons, boxes


class CorridorWorld(Family):
    """A passage of one width from side to side that shifts sideways at right angles, drawn anew for each seed.

    +--------------------------+
    |##########           goal |
    |##########    ############|
    | start        ############|
    |##########################|
    +--------------------------+

    The robot starts at the left end and heads along it; the goal lies at the right end.
    """

    family: Literal["corridor"]
    bounds: Box = (-15.0, -8.0, 15.0, 8.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    width: Positive = 2.0
    """Width of the passage [m]."""
    shifts: Obstacles = 3
    """How often it shifts sideways; each shift is two right angles."""
    wall: Positive = 0.5
    """Least thickness of what lies between two of its legs, and between a leg and the border [m]."""

    @property
    def spare(self) -> tuple[float, float]:
        """Way left over along x for the places of the shifts, and along y for the levels of the legs [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        across = self.shifts * self.width + max(self.shifts - 1, 0) * self.wall + 2.0 * self.width
        return xmax - xmin - across, ymax - ymin - self.width - 2.0 * self.wall

    def check(self, robot: Robot) -> None:
        """The robot fits through, and the passage into the bounds."""
        self.check_width(self.width, robot, "width")
        along, sideways = self.spare
        if along < 0.0:
            raise wrong(f"got {self.shifts}, expected fewer: there is no room along x for so many", "shifts")
        # Wherever the last leg is, the next one finds a level.
        most = 2.0 * (self.width + self.wall) if self.shifts else 0.0
        if sideways < most:
            raise wrong(f"got {self.width:g}, expected less: legs must fit beside one another along y", "width")

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A passage that shifts sideways; start and goal at its ends."""
        places, levels = corridor_legs(self, rng)
        xmin, _, xmax, _ = self.bounds
        half = 0.5 * self.width
        start, goal = (xmin + half, float(levels[0]), 0.0), (xmax - half, float(levels[-1]))
        return finish(crew, self, start, goal, polygons=corridor_walls(self, places, levels))


def corridor_legs(world: CorridorWorld, rng: Rng) -> tuple[F64, F64]:
    """Where a passage shifts sideways x (n,), and the levels y (n + 1,) of its legs [m]."""
    xmin, ymin, xmax, ymax = world.bounds
    pitch, half = world.width + world.wall, 0.5 * world.width
    spare, _ = world.spare
    order = np.arange(world.shifts)
    places = xmin + world.width + half + np.sort(rng.uniform(0.0, spare, world.shifts)) + order * pitch
    low, high = ymin + world.wall + half, ymax - world.wall - half
    levels = [float(rng.uniform(low, high))]
    for _ in order:
        # Below or above the last leg, evenly over what is left there.
        below, above = max(levels[-1] - pitch - low, 0.0), max(high - levels[-1] - pitch, 0.0)
        draw = float(rng.uniform(0.0, below + above))
        levels.append(low + draw if draw < below else levels[-1] + pitch + draw - below)
    return places, np.array(levels)


def corridor_walls(world: CorridorWorld, places: F64, levels: F64) -> tuple[Rings, ...]:
    """All that is not passage, a little beyond the border too, so that no beam slips between the two."""
    xmin, ymin, xmax, ymax = world.bounds
    half, thick = 0.5 * world.width, world.wall
    ends = [xmin - thick - half, *places.tolist(), xmax + thick + half]
    legs = [(a - half, y - half, b + half, y + half) for a, b, y in zip(ends[:-1], ends[1:], levels, strict=True)]
    shifts = [
        (x - half, min(one, other) - half, x + half, max(one, other) + half)
        for x, one, other in zip(places.tolist(), levels[:-1], levels[1:], strict=True)
    ]
    frame = boxes([(xmin - thick, ymin - thick, xmax + thick, ymax + thick)])
    return as_polygons(frame.difference(boxes([*legs, *shifts])))
