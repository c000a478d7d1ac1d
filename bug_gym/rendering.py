"""Pictures of a world: a row of a Simulation as it is now. Reads only.

A frame is painted at PAINT times its size on surfaces in memory and averaged down: edges come out smooth, and no
display is needed. What does not move is painted once an episode.
"""

from __future__ import annotations

import logging
import math
import os
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bug_gym import kernels
from bug_gym.policy import Drawing
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES
from bug_gym.world import World, is_full_circle

if TYPE_CHECKING:
    import pygame

logger = logging.getLogger("bug_gym")

Frame = NDArray[np.uint8]
Color = tuple[int, int, int]
Pixel = tuple[float, float]

PAINT = 2
"""Pixels that are painted for one of the frame, along each side."""

VELOCITY_HORIZON = 1.5
"""An arrow reaches from the rim of a mover as far as it comes in this time [s]."""

SPARSE_BEAMS = math.radians(12.0)
"""Angle between two beams from which on a scan is drawn as rays: an area would claim what lies between them."""

# ---------------------------------------------------------------------------------------------- colours

PAGE: Color = (255, 255, 255)
FLOOR: Color = (250, 250, 247)
INK: Color = (45, 52, 64)
FAINT: Color = (138, 145, 156)
STILL, STILL_RIM = (128, 139, 154), (84, 94, 110)
MOVING, MOVING_RIM = (243, 167, 83), (178, 98, 22)
GOAL: Color = (28, 150, 92)
KEY: Color = (255, 0, 255)  # stands for "nothing here" on the surface of still things

ROBOTS: tuple[Color, ...] = (
    (32, 96, 200),
    (193, 42, 120),
    (16, 140, 150),
    (120, 72, 190),
    (150, 110, 20),
    (70, 110, 50),
)
"""Colours of the robots, in turn."""

OUTCOME_COLORS: dict[str, Color] = {
    "running": FAINT,
    "success": GOAL,
    "collision": (208, 44, 44),
    "timeout": (196, 128, 0),
}

LABEL_COLORS: dict[str, Color] = {
    "hit": (208, 44, 44),
    "leave": (28, 150, 92),
    "candidate": (120, 72, 190),
    "target": (193, 42, 120),
    "waypoint": (16, 140, 150),
    "nearest": (196, 128, 0),
    "m_line": (120, 120, 130),
    "path": (120, 72, 190),
    "plan": (120, 72, 190),
    "light": (245, 205, 60),
    "shadow": (70, 80, 110),
}
"""Colours of the labels in a policy's Drawing; other labels take one of the robots' colours, always the same."""

DASHED = {"m_line"}
"""Labels whose segments are drawn dashed."""


def mixed(color: Color, ground: Color, share: float) -> Color:
    """A colour laid over a ground, with this share of its own."""
    red, green, blue = (round(share * c + (1.0 - share) * g) for c, g in zip(color, ground, strict=True))
    return red, green, blue


def label_color(label: str) -> Color:
    """The colour of a label in a Drawing."""
    return LABEL_COLORS.get(label) or ROBOTS[zlib.crc32(label.encode()) % len(ROBOTS)]


def load_pygame() -> ModuleType:
    """Import pygame, without its greeting.

    Raises:
        ImportError: it is not installed; the message names the extra.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
        import pygame.font
    except ImportError as error:
        raise ImportError("drawing needs pygame-ce: pip install 'bug-gym[render]'") from error
    return pygame


# ---------------------------------------------------------------------------------------------- brush


@dataclass(frozen=True)
class Projection:
    """From places in the world [m] to pixels: x to the right, y up."""

    scale: float
    """Pixels a metre."""
    left: float
    """Column of x = 0."""
    top: float
    """Row of y = 0."""

    def pixel(self, x: float, y: float) -> Pixel:
        """Column and row of a place."""
        return self.left + self.scale * x, self.top - self.scale * y

    def pixels(self, places: NDArray[np.float64]) -> list[Pixel]:
        """Columns and rows of places (k, 2)."""
        columns = self.left + self.scale * places[:, 0]
        rows = self.top - self.scale * places[:, 1]
        return list(zip(columns.tolist(), rows.tolist(), strict=True))

    def enlarged(self, factor: int) -> Projection:
        """The same view with `factor` times as many pixels along each side."""
        return Projection(factor * self.scale, factor * self.left, factor * self.top)


class Brush:
    """Paints shapes on a surface.

    Args:
        surface: what to paint on.
        view: where places of the world are on it.
        unit: width of a fine line [pixels].
    """

    def __init__(self, surface: pygame.Surface, view: Projection, unit: float) -> None:
        self.pygame = load_pygame()
        self.surface = surface
        self.view = view
        self.unit = unit

    def width(self, units: float) -> int:
        """Units as whole pixels, at least one."""
        return max(1, round(units * self.unit))

    def disc(self, at: Pixel, radius: float, color: Color, rim: Color | None = None, rim_units: float = 1.0) -> None:
        """A filled circle, with a rim inside its edge."""
        self.discs([at], [radius], color, rim, rim_units)

    def discs(
        self,
        centers: Sequence[Pixel],
        radii: Sequence[float],
        color: Color,
        rim: Color | None = None,
        rim_units: float = 1.0,
    ) -> None:
        """Filled circles, with a rim inside their edges; each is at least a dot."""
        surface, circle, width = self.surface, self.pygame.draw.circle, self.width(rim_units)
        for at, radius in zip(centers, radii, strict=True):
            if rim is None:
                circle(surface, color, at, max(radius, 1.0))
            else:
                circle(surface, rim, at, max(radius, 1.0))
                circle(surface, color, at, max(radius - width, 1.0))

    def ring(self, at: Pixel, radius: float, color: Color, units: float) -> None:
        """A circle that is not filled."""
        self.pygame.draw.circle(self.surface, color, at, radius, self.width(units))

    def area(self, pixels: Sequence[Pixel], color: Color, rim: Color | None = None, rim_units: float = 1.0) -> None:
        """A filled polygon, with a rim along its edge."""
        self.pygame.draw.polygon(self.surface, color, pixels)
        if rim is not None:
            self.line([*pixels, pixels[0]], rim, rim_units)

    def line(self, pixels: Sequence[Pixel], color: Color, units: float) -> None:
        """A line through pixels, round at its corners where it is wide."""
        width = self.width(units)
        self.pygame.draw.lines(self.surface, color, False, pixels, width)
        if width > 3:
            for at in pixels:
                self.pygame.draw.circle(self.surface, color, at, 0.5 * width)

    def veil(self, pixels: Sequence[Pixel], tint: Color) -> None:
        """A filled polygon of coloured glass: what lies beneath it is multiplied by the tint."""
        corners = np.array(pixels)
        low = np.maximum(np.floor(corners.min(axis=0)), 0.0).astype(int)
        high = np.minimum(np.ceil(corners.max(axis=0)) + 1.0, self.surface.get_size()).astype(int)
        if len(pixels) < 3 or (high <= low).any():
            return
        glass = self.pygame.Surface((high - low).tolist(), 0, 32)
        glass.fill(PAGE)
        self.pygame.draw.polygon(glass, tint, (corners - low).tolist())
        self.surface.blit(glass, low.tolist(), special_flags=self.pygame.BLEND_RGB_MULT)

    def dashes(self, start: Pixel, end: Pixel, color: Color, units: float) -> None:
        """A dashed line."""
        length, dash = math.dist(start, end), 5.0 * self.unit
        count = max(1, math.ceil(length / (2.0 * dash)))
        for number in range(count):
            first = min(2.0 * number * dash / max(length, 1e-9), 1.0)
            last = min((2.0 * number + 1.0) * dash / max(length, 1e-9), 1.0)
            self.line([between(start, end, first), between(start, end, last)], color, units)


def between(start: Pixel, end: Pixel, share: float) -> Pixel:
    """The pixel at a share of the way."""
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


# ---------------------------------------------------------------------------------------------- parts of a picture


def paint_still(brush: Brush, world: World, row: int) -> None:
    """Page, border and still obstacles; the floor is left in KEY."""
    layout = world.layout(row)
    border = brush.view.pixels(layout.border)
    brush.surface.fill(KEY)
    # The larger first: what stands in the hole of a polygon has a smaller shell than that polygon.
    for rings in sorted(layout.polygons, key=lambda rings: -shell_extent(rings[0])):
        brush.area(brush.view.pixels(rings[0]), STILL, STILL_RIM)
        for hole in rings[1:]:
            brush.area(brush.view.pixels(hole), KEY, STILL_RIM)
    radii = (brush.view.scale * layout.circles[:, 2]).tolist()
    brush.discs(brush.view.pixels(layout.circles), radii, STILL, STILL_RIM)
    page = brush.surface.copy()  # over what sticks out of the border
    page.fill(PAGE)
    brush.pygame.draw.polygon(page, KEY, border)
    page.set_colorkey(KEY)
    brush.surface.blit(page, (0, 0))
    brush.line([*border, border[0]], INK, 2.5)


def shell_extent(ring: NDArray[np.float64]) -> float:
    """Area of the box around a ring (k, 2) [m^2]."""
    width, height = np.ptp(ring, axis=0)
    return float(width * height)


def scan_ends(view: Projection, world: World, row: int, robot: int) -> list[Pixel]:
    """Where the beams of a robot's last scan end (B)."""
    x, y, heading = world.pose[row, robot].tolist()
    cos, sin = math.cos(heading), math.sin(heading)
    ahead, left = world.beams[:, : world.ranges.shape[2]] * world.ranges[row, robot].astype(np.float64)
    return view.pixels(np.column_stack([x + cos * ahead - sin * left, y + sin * ahead + cos * left]))


def paint_free_area(brush: Brush, world: World, row: int, robot: int, ends: list[Pixel], floor: Color) -> None:
    """What a robot's LIDAR sees to be free: an area, or rays where the beams are few."""
    x, y, _ = world.pose[row, robot].tolist()
    color, at = ROBOTS[robot % len(ROBOTS)], brush.view.pixel(x, y)
    if float(world.spec["angle_step"][0]) > SPARSE_BEAMS or len(ends) < 3:
        for end in ends:
            brush.line([at, end], mixed(color, floor, 0.5), 0.5)
        return
    corners = ends if is_full_circle(world.scenario) else [at, *ends]
    if robot == 0:  # only floor lies below the first, and glass is slow
        brush.area(corners, mixed(color, floor, 0.13))
    else:
        brush.veil(corners, mixed(color, PAGE, 0.13))
    brush.line([*corners, corners[0]], mixed(color, floor, 0.3), 0.5)


def paint_returns(brush: Brush, world: World, row: int, robot: int, ends: list[Pixel]) -> None:
    """A dot where a beam ended on something."""
    color = mixed(ROBOTS[robot % len(ROBOTS)], PAGE, 0.8)
    seen = [ends[index] for index in np.flatnonzero(world.ranges[row, robot] < world.scenario.lidar.range)]
    brush.discs(seen, [1.25 * brush.unit] * len(seen), color)


def paint_movers(brush: Brush, world: World, row: int) -> None:
    """Moving circles and polygons, each with an arrow along its velocity."""
    counts = ("moving_disc_count", "moving_polygon_count", "moving_wall_count")
    discs, count, walls = (int(world.array(name)[row, 0]) for name in counts)
    polygons, firsts = np.arange(count), world.array("polygon_first")[row, :count]
    paint_velocities(brush, world, row, np.concatenate([np.arange(discs), int(world.spec["discs"][0]) + polygons]), MOVING_RIM)

    centers = brush.view.pixels(world.disc_position[row, :discs])
    radii = (brush.view.scale * world.disc_radius[row, :discs]).tolist()
    brush.discs(centers, radii, MOVING, MOVING_RIM)
    corners = brush.view.pixels(world.wall[row, :walls, :2])
    for first, end in pairwise([*firsts.tolist(), walls]):
        brush.area(corners[first:end], MOVING, MOVING_RIM)


def paint_velocities(
    brush: Brush, world: World, row: int, bodies: NDArray[np.int64], color: Color, radius: float | None = None
) -> None:
    """Arrows along the velocities of bodies (k,), to be painted over by the bodies.

    Each is one polygon that begins in the body's centre and reaches over its radius, or over one in pixels:

    ```
                   2
    0--------------1 \
    |       rim       3    corners 4 to 6 mirror 0 to 2
    ```
    """
    names = ("body_x", "body_y", "body_vx", "body_vy", "body_radius")
    x, y, vx, vy, own = (world.array(name)[row, bodies] for name in names)
    speed = np.hypot(vx, vy)
    moving = speed > 0.0
    x, y, vx, vy, own, speed = (values[moving] for values in (x, y, vx, vy, own, speed))
    scale, unit = brush.view.scale, brush.unit
    rim = scale * own if radius is None else np.full(len(x), radius)
    tip = rim + VELOCITY_HORIZON * scale * speed
    center, neck, half, barb = np.zeros(len(x)), np.maximum(tip - 5.0 * unit, rim), 0.7 * unit, 2.5 * unit
    ahead = np.stack([center, neck, neck, tip, neck, neck, center], axis=1)
    side = np.array([half, half, barb, 0.0, -barb, -half, -half])
    cos, sin = (vx / speed)[:, None], (vy / speed)[:, None]
    columns = brush.view.left + scale * x[:, None] + cos * ahead - sin * side
    rows = brush.view.top - scale * y[:, None] - sin * ahead - cos * side
    for corner_columns, corner_rows in zip(columns.tolist(), rows.tolist(), strict=True):
        brush.area(list(zip(corner_columns, corner_rows, strict=True)), color)


def goal_color(world: World, robot: int) -> Color:
    """Robots that share a goal see it in green, a goal of one's own has the robot's colour."""
    return GOAL if world.goals == 1 else ROBOTS[robot % len(ROBOTS)]


def paint_goal_areas(brush: Brush, world: World, row: int, floor: Color) -> None:
    """The discs within which the goals are reached."""
    radius = world.scenario.goal.radius * brush.view.scale
    for robot, (x, y) in enumerate(world.goal[row, : world.goals].tolist()):
        color = goal_color(world, robot)
        brush.disc(brush.view.pixel(x, y), radius, mixed(color, floor, 0.35), color)


def paint_goals(brush: Brush, world: World, row: int) -> None:
    """A flag on each goal that stands; a bull's eye and an arrow on each that moves."""
    for robot, (x, y) in enumerate(world.goal[row, : world.goals].tolist()):
        at, color, body = brush.view.pixel(x, y), goal_color(world, robot), int(world.array("goal_body")[row, robot])
        if world.array("body_law")[row, body] == kernels.STILL:
            paint_flag(brush, at, color)
            continue
        paint_velocities(brush, world, row, np.array([body]), color, radius=6.5 * brush.unit)
        for units, ring_color in ((6.5, PAGE), (5.5, color), (3.5, PAGE), (1.8, color)):
            brush.disc(at, units * brush.unit, ring_color)


def paint_flag(brush: Brush, at: Pixel, color: Color) -> None:
    """A flag whose pole stands on a place."""
    (x, y), u = at, brush.unit
    brush.line([(x, y), (x, y - 15.0 * u)], PAGE, 3.0)
    brush.area([(x, y - 16.0 * u), (x + 12.0 * u, y - 11.5 * u), (x, y - 7.0 * u)], color, PAGE)
    brush.line([(x, y), (x, y - 15.5 * u)], color, 1.5)
    brush.disc(at, 1.8 * u, color)


def paint_trail(brush: Brush, trail: Sequence[Pixel], color: Color) -> None:
    """The way so far, with a light edge that lifts it off the scan."""
    if len(trail) < 2:
        return
    pygame = brush.pygame
    pygame.draw.lines(brush.surface, PAGE, False, trail, brush.width(3.5))
    pygame.draw.lines(brush.surface, color, False, trail, brush.width(1.75))


def paint_robot(brush: Brush, world: World, row: int, robot: int) -> None:
    """Footprint with heading; a ring in the outcome's colour when it is out of play, a burst where it hit something."""
    x, y, heading = world.pose[row, robot].tolist()
    cos, sin, scale, unit = math.cos(heading), math.sin(heading), brush.view.scale, brush.unit
    color, at = ROBOTS[robot % len(ROBOTS)], brush.view.pixel(x, y)
    reach = max(world.scenario.robot.reach * scale, 4.0 * unit)
    outcome = OUTCOMES[int(world.outcome[row, robot])]
    if outcome == "collision":
        brush.area(star(at, reach + 8.0 * unit), OUTCOME_COLORS[outcome], PAGE)
    elif outcome != "running":
        brush.ring(at, reach + 5.0 * unit, OUTCOME_COLORS[outcome], 2.5)

    body = world.footprint
    places = np.column_stack([x + cos * body[:, 0] - sin * body[:, 1], y + sin * body[:, 0] + cos * body[:, 1]])
    centers, radii = brush.view.pixels(places), np.maximum(scale * body[:, 2], 3.0 * unit).tolist()
    rim = mixed(color, INK, 0.6)
    nose = [(reach + 5.0 * unit, 0.0), (0.3 * reach, 0.75 * reach), (0.3 * reach, -0.75 * reach)]
    corners = [(at[0] + cos * ahead + sin * side, at[1] - sin * ahead + cos * side) for ahead, side in nose]
    brush.discs(centers, [radius + 1.5 * unit for radius in radii], PAGE)
    brush.area(corners, rim, PAGE, 1.25)
    brush.discs(centers, radii, rim)
    brush.discs(centers, [radius - unit for radius in radii], color)


def star(at: Pixel, radius: float) -> list[Pixel]:
    """A star with ten rays."""
    result = []
    for index in range(20):
        angle, reach = math.pi * index / 10.0, radius if index % 2 == 0 else 0.6 * radius
        result.append((at[0] + reach * math.cos(angle), at[1] + reach * math.sin(angle)))
    return result


# ---------------------------------------------------------------------------------------------- a policy's own drawing


def from_odometry(places: ArrayLike, origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (k, 2) in the frame of a start pose `origin` (3,), in the world's frame [m].

    Raises:
        ValueError: not (k, 2), or not finite.
    """
    array = np.asarray(places, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 2 or not np.isfinite(array).all():
        raise ValueError(f"a drawing takes finite places (k, 2), got {array.tolist()}")
    cos, sin = math.cos(origin[2]), math.sin(origin[2])
    return np.asarray(origin[:2] + array @ np.array([[cos, sin], [-sin, cos]]))


def paint_areas(brush: Brush, drawing: Drawing, origin: NDArray[np.float64]) -> None:
    """The areas of a drawing; what lies beneath them shows through."""
    for ring, label in drawing.areas:
        brush.veil(brush.view.pixels(from_odometry(ring, origin)), mixed(label_color(label), PAGE, 0.3))


def paint_segments(brush: Brush, drawing: Drawing, origin: NDArray[np.float64]) -> None:
    """The segments of a drawing."""
    for x1, y1, x2, y2, label in drawing.segments:
        start, end = brush.view.pixels(from_odometry([(x1, y1), (x2, y2)], origin))
        if label in DASHED:
            brush.dashes(start, end, label_color(label), 1.25)
        else:
            brush.line([start, end], label_color(label), 1.5)


def paint_points(brush: Brush, drawing: Drawing, origin: NDArray[np.float64]) -> None:
    """The points of a drawing."""
    for x, y, label in drawing.points:
        (at,) = brush.view.pixels(from_odometry([(x, y)], origin))
        brush.disc(at, 4.5 * brush.unit, PAGE)
        brush.disc(at, 3.5 * brush.unit, label_color(label))


def labels_of(drawings: Iterable[Drawing]) -> list[str]:
    """The labels that occur, each once, in order."""
    parts = [part for drawing in drawings for part in (drawing.areas, drawing.segments, drawing.points)]
    return list(dict.fromkeys(str(item[-1]) for part in parts for item in part))


# ---------------------------------------------------------------------------------------------- canvas


class Canvas:
    """Draws one row of a Simulation.

    It also remembers the poses that it has seen in this episode: each `draw` and each `record` adds the present ones to
    the path that is drawn. The path begins anew when the row's seed or episode changes or its time goes back.

    Args:
        simulation: the worlds.
        size: longer side of the frame [pixels]; the bounds keep their proportions.
        row: which world.
        title: put before the scenario's name in the caption, such as the policy's name.

    Raises:
        ImportError: pygame-ce is not installed.
        ValueError: a size below 100 pixels, or no such row.
    """

    def __init__(self, simulation: Simulation, *, size: int = 600, row: int = 0, title: str = "") -> None:
        load_pygame()
        if size < 100:
            raise ValueError(f"size must be at least 100 pixels, got {size}")
        if not 0 <= row < simulation.count:
            raise ValueError(f"row must be from 0 to {simulation.count - 1}, got {row}")
        self.simulation = simulation
        self.row = row
        self.title = title
        self.unit = size / 600.0
        xmin, ymin, xmax, ymax = simulation.scenario.world.box
        margin = 24.0 * max(self.unit, 0.8)
        scale = (size - 2.0 * margin) / max(xmax - xmin, ymax - ymin)
        # Even sides, because video codecs want them; wide enough for the caption.
        self.width = max(even(scale * (xmax - xmin) + 2.0 * margin), even(0.4 * size))
        self.height = even(scale * (ymax - ymin) + 2.0 * margin)
        self.margin = margin
        self.view = Projection(
            scale, 0.5 * self.width - scale * 0.5 * (xmin + xmax), 0.5 * self.height + scale * 0.5 * (ymin + ymax)
        )
        self._trails: list[list[Pixel]] = [[] for _ in range(simulation.robots)]
        self._goal_trails: list[list[Pixel]] = [[] for _ in range(simulation.world.goals)]
        self._recorded = (-1, -1, -1)
        self._still: pygame.Surface | None = None
        self._still_of: tuple[int, ...] = ()
        self._large: pygame.Surface | None = None
        self._font: pygame.font.Font | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Surfaces can't be pickled; they are painted anew."""
        return {**self.__dict__, "_still": None, "_still_of": (), "_large": None, "_font": None}

    # ------------------------------------------------------------------------------------------ the path so far

    def record(self) -> None:
        """Add the present poses to the path that `draw` shows."""
        world, row = self.simulation.world, self.row
        present = (int(world.seed[row]), int(world.episode[row]), int(world.steps[row]))
        if present[:2] != self._recorded[:2] or present[2] < self._recorded[2]:
            self._clear()
        elif present == self._recorded:
            return
        places = [*world.pose[row].tolist(), *world.goal[row, : world.goals].tolist()]
        view = self.view.enlarged(PAINT)
        for trail, (x, y, *_) in zip([*self._trails, *self._goal_trails], places, strict=True):
            pixel = view.pixel(x, y)
            if not trail or trail[-1] != pixel:
                trail.append(pixel)
        self._recorded = present

    def _clear(self) -> None:
        for trail in (*self._trails, *self._goal_trails):
            trail.clear()

    def follow(self, poses: ArrayLike) -> None:
        """Take poses (T, R, 3) of the row's present episode, or places (T, R, 2), as the path so far.

        Raises:
            ValueError: another shape.
        """
        array = np.asarray(poses, dtype=np.float64)
        if array.ndim != 3 or array.shape[1] != self.simulation.robots or array.shape[2] not in (2, 3):
            raise ValueError(f"poses have shape {array.shape}, expected (T, {self.simulation.robots}, 2 or 3)")
        self._clear()
        self._recorded = (-1, -1, -1)
        self.record()
        view = self.view.enlarged(PAINT)
        for robot, trail in enumerate(self._trails):
            trail[:0] = view.pixels(array[:, robot, :2])

    # ------------------------------------------------------------------------------------------ drawing

    def draw(
        self,
        drawing: Drawing | Sequence[Drawing | None] | None = None,
        *,
        trail: bool = True,
        scan: bool = True,
        note: str = "",
    ) -> Frame:
        """The row as it is now.

        Args:
            drawing: what a policy adds, in the frame of its robot's start; a sequence has one for each robot.
            trail: whether to draw the path so far.
            scan: whether to draw the LIDAR's scan.
            note: put behind the outcome, such as a policy's verdict.

        Returns:
            RGB pixels (H, W, 3) uint8, a fresh array.

        Raises:
            ValueError: the row has not been reset yet, or a drawing for another number of robots or with places that
                are not finite.
        """
        world, row = self.simulation.world, self.row
        if world.wall_count[row] == 0:
            raise ValueError(f"row {row} holds no world yet: reset the simulation before drawing")
        drawings = self._drawings(drawing)
        self.record()
        floor = self._floor()
        brush = self._brush(floor)
        scans = {robot: scan_ends(brush.view, world, row, robot) for robot in range(world.robots) if scan}
        for robot, ends in scans.items():
            paint_free_area(brush, world, row, robot, ends, floor)
        origins = world.array("origin")[row].reshape(world.robots, 3)
        for robot, item in drawings.items():
            paint_areas(brush, item, origins[robot])
        paint_goal_areas(brush, world, row, floor)
        brush.surface.blit(self._still_surface(), (0, 0))
        paint_movers(brush, world, row)
        for robot, ends in scans.items():
            paint_returns(brush, world, row, robot, ends)
        for robot, item in drawings.items():
            paint_segments(brush, item, origins[robot])
        if trail:
            self._paint_trails(brush)
        for robot, item in drawings.items():
            paint_points(brush, item, origins[robot])
        paint_goals(brush, world, row)
        for robot in range(world.robots):
            paint_robot(brush, world, row, robot)
        return self._finish(brush.surface, labels_of(drawings.values()), note)

    def _drawings(self, drawing: Drawing | Sequence[Drawing | None] | None) -> dict[int, Drawing]:
        """Drawings by robot."""
        if drawing is None or isinstance(drawing, Drawing):
            drawing = [drawing]
        if len(drawing) > self.simulation.robots:
            raise ValueError(f"got {len(drawing)} drawings for {self.simulation.robots} robots")
        return {robot: item for robot, item in enumerate(drawing) if item is not None}

    def _outcome(self) -> str:
        """The outcome of all robots: the worst of them, running while one is."""
        names = {OUTCOMES[code] for code in self.simulation.world.outcome[self.row].tolist()}
        return next(name for name in ("running", "collision", "timeout", "success") if name in names)

    def _floor(self) -> Color:
        outcome = self._outcome()
        return FLOOR if outcome == "running" else mixed(OUTCOME_COLORS[outcome], FLOOR, 0.09)

    def _brush(self, floor: Color) -> Brush:
        """A brush on the large surface, which is all floor."""
        if self._large is None:
            self._large = load_pygame().Surface((PAINT * self.width, PAINT * self.height), 0, 32)
        self._large.fill(floor)
        return Brush(self._large, self.view.enlarged(PAINT), PAINT * self.unit)

    def _still_surface(self) -> pygame.Surface:
        """Page, border and still obstacles of this episode, painted when they are first asked for."""
        world, row = self.simulation.world, self.row
        counts = (int(world.disc_count[row]), int(world.wall_count[row]))
        key = (int(world.seed[row]), int(world.episode[row]), *counts)
        if self._still is None or key != self._still_of:
            pygame = load_pygame()
            self._still = pygame.Surface((PAINT * self.width, PAINT * self.height), 0, 32)
            paint_still(Brush(self._still, self.view.enlarged(PAINT), PAINT * self.unit), world, row)
            self._still.set_colorkey(KEY, pygame.RLEACCEL)
            self._still_of = key
        return self._still

    def _paint_trails(self, brush: Brush) -> None:
        world = self.simulation.world
        for goal, trail in enumerate(self._goal_trails):
            paint_trail(brush, trail, mixed(goal_color(world, goal), FLOOR, 0.5))
        for robot, trail in enumerate(self._trails):
            color = ROBOTS[robot % len(ROBOTS)]
            paint_trail(brush, trail, color)
            x, y, _ = world.array("origin")[self.row, 3 * robot : 3 * robot + 3].tolist()
            brush.disc(brush.view.pixel(x, y), 4.0 * brush.unit, PAGE, color, 1.75)

    # ------------------------------------------------------------------------------------------ text

    def _finish(self, large: pygame.Surface, labels: Sequence[str], note: str) -> Frame:
        """Average the large surface down, write around it and read the pixels."""
        pygame = load_pygame()
        small = pygame.transform.smoothscale(large, (self.width, self.height))
        self._write_caption(small, note)
        self._write_legend(small, labels)
        pixels = bytearray(pygame.image.tobytes(small, "RGB"))
        return np.frombuffer(pixels, dtype=np.uint8).reshape(self.height, self.width, 3)

    def _write_caption(self, small: pygame.Surface, note: str) -> None:
        """Above the world: whose episode it is on the left; time, outcome and note on the right."""
        world, row, outcome = self.simulation.world, self.row, self._outcome()
        name = " · ".join(filter(None, [self.title, self.simulation.scenario.name, f"seed {world.seed[row]}"]))
        state = [f"{world.time[row]:.1f} s", outcome if outcome != "running" else "", note]
        right = self._text(" · ".join(filter(None, state)), INK if outcome == "running" else OUTCOME_COLORS[outcome])
        left = self._text(name, INK)
        room = self.width - 2.0 * self.margin
        top = 0.5 * (self.margin - left.get_height())
        # On a narrow frame the name gives way.
        shown = (0, 0, max(0.0, room - right.get_width() - self.margin), left.get_height())
        small.blit(left, (self.margin, top), shown)
        small.blit(right, (self.margin + room - right.get_width(), top))

    def _write_legend(self, small: pygame.Surface, labels: Sequence[str]) -> None:
        """Below the world: the labels of a drawing on the left, a bar for scale on the right."""
        draw, column, middle = load_pygame().draw, self.margin, self.height - 0.5 * self.margin
        for label in labels:
            text, radius = self._text(label, INK), 0.17 * self.margin
            draw.circle(small, label_color(label), (column + radius, middle), radius)
            small.blit(text, (column + 3.0 * radius, middle - 0.5 * text.get_height()))
            column += 5.0 * radius + text.get_width()
        metres = round_length(0.15 * self.width / self.view.scale)
        text, right = self._text(f"{metres:g} m", FAINT), self.width - self.margin
        left = right - metres * self.view.scale
        draw.line(small, FAINT, (left, middle), (right, middle), max(1, round(2.0 * self.unit)))
        small.blit(text, (left - text.get_width() - 0.25 * self.margin, middle - 0.5 * text.get_height()))

    def _text(self, text: str, color: Color) -> pygame.Surface:
        """Text on a surface of its own."""
        pygame = load_pygame()
        if self._font is not None:
            try:
                return self._font.render(text, True, color)
            except pygame.error:  # somebody called pygame.quit(), which takes all fonts along
                self._font = None
        pygame.font.init()
        self._font = pygame.font.Font(None, round(0.75 * self.margin))
        return self._font.render(text, True, color)


def even(length: float) -> int:
    """The nearest even number of pixels."""
    return 2 * round(0.5 * length)


def round_length(length: float) -> float:
    """The largest of 1, 2, 5, 10, ... (and their tenths) that is at most a length [m]."""
    power = 10.0 ** math.floor(math.log10(length))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= length)


def episode_picture(
    simulation: Simulation,
    poses: ArrayLike,
    drawing: Drawing | Sequence[Drawing | None] | None = None,
    *,
    row: int = 0,
    size: int = 600,
    title: str = "",
    note: str = "",
) -> Frame:
    """The row as it is now with the whole path of its episode, without the scan.

    Args:
        simulation: the worlds; the row still stands where the episode has ended.
        poses: poses (T, R, 3) or places (T, R, 2) of the robots since the start.
        drawing: what a policy adds, see `Canvas.draw`.
        row: which world.
        size: longer side [pixels].
        title: put before the scenario's name, such as the policy's name.
        note: put behind the outcome, such as a policy's verdict.

    Returns:
        RGB pixels (H, W, 3) uint8.
    """
    canvas = Canvas(simulation, size=size, row=row, title=title)
    canvas.follow(poses)
    return canvas.draw(drawing, scan=False, note=note)


# ---------------------------------------------------------------------------------------------- window


class Window:
    """Shows a Canvas on the screen, at most `fps` frames a second; without a screen it shows nothing and goes on.

    Args:
        canvas: what to show.
        fps: frames a second of real time.

    Raises:
        ValueError: fps that is not positive.
    """

    def __init__(self, canvas: Canvas, fps: float) -> None:
        if not fps > 0.0:
            raise ValueError(f"fps must be positive, got {fps}")
        self.canvas = canvas
        self.fps = fps
        self.is_open = True
        """False once somebody has closed it; then `update` does nothing."""
        self._clock = load_pygame().time.Clock()
        self._screen: pygame.Surface | None = None

    def update(self, drawing: Drawing | Sequence[Drawing | None] | None = None, *, note: str = "") -> None:
        """Draw the row, show it, answer the window's events and wait until the frame's time is over."""
        pygame = load_pygame()
        if not self.is_open:
            return
        # Another program part may have shut the display down.
        if self._screen is None or not pygame.display.get_init():
            self._screen = open_screen((self.canvas.width, self.canvas.height))
        frame = self.canvas.draw(drawing, note=note)
        self._screen.blit(pygame.image.frombuffer(frame, (self.canvas.width, self.canvas.height), "RGB"), (0, 0))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
        self._clock.tick(self.fps)

    def close(self) -> None:
        """Take the window off the screen."""
        pygame = load_pygame()
        if self._screen is not None and pygame.display.get_init():
            pygame.display.quit()
        self._screen = None
        self.is_open = False


def open_screen(size: tuple[int, int]) -> pygame.Surface:
    """A window of this size, on SDL's dummy driver where there is no screen."""
    module = load_pygame()
    try:
        module.display.init()
    except module.error as error:
        logger.warning("no screen to draw on (%s): the window stays invisible", error)
        os.environ["SDL_VIDEODRIVER"] = "dummy"
        module.display.init()
    module.display.set_caption("bug_gym")
    screen: pygame.Surface = module.display.set_mode(size)
    return screen


# ---------------------------------------------------------------------------------------------- files


def side_by_side(frames: Sequence[Frame]) -> Frame:
    """Frames (H, W, 3) in a row, the lower ones filled up with white.

    Raises:
        ValueError: no frame.
    """
    if not frames:
        raise ValueError("side_by_side needs at least one frame")
    height = max(len(frame) for frame in frames)
    filled = [np.pad(frame, ((0, height - len(frame)), (0, 0), (0, 0)), constant_values=255) for frame in frames]
    return np.concatenate(filled, axis=1)


def save_png(path: str | Path, frame: Frame) -> None:
    """Write a frame as PNG."""
    image = load_pillow().fromarray(frame)
    with replaced_when_done(path) as partial:
        image.save(partial, format="PNG", optimize=True)


def save_gif(path: str | Path, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as an endless GIF, in the 256 most frequent colours of its first, middle and last frame.

    Raises:
        ValueError: no frame, frames of different sizes, or fps that is not positive.
    """
    pillow = load_pillow()
    clip = list(same_size(frames, fps))
    colors, counts = np.unique(packed(np.stack([clip[0], clip[len(clip) // 2], clip[-1]])), return_counts=True)
    palette = unpacked(colors[np.argsort(-counts, kind="stable")[:256]])
    images = [pillow.fromarray(in_palette(frame, palette)) for frame in clip]
    for image in images:
        image.putpalette(palette.astype(np.uint8).tobytes())
    with replaced_when_done(path) as partial:
        images[0].save(partial, format="GIF", save_all=True, append_images=images[1:], duration=1000.0 / fps, loop=0)


def packed(frames: Frame) -> NDArray[np.int64]:
    """Colours (..., 3) as one number each."""
    return np.asarray(frames.astype(np.int64) @ np.array([65536, 256, 1]))


def unpacked(colors: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers (k,) as colours (k, 3)."""
    return np.stack([colors >> 16, colors >> 8 & 255, colors & 255], axis=1)


def in_palette(frame: Frame, palette: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Number (H, W) of the colour of a palette (k, 3) that comes nearest to each pixel.

    Pillow's own search puts neighbouring colours together: page and floor would become one.
    """
    colors, where = np.unique(packed(frame), return_inverse=True)
    gaps = np.square(unpacked(colors)[:, None] - palette[None]).sum(axis=2)
    nearest: NDArray[np.uint8] = gaps.argmin(axis=1).astype(np.uint8)
    return nearest[where].reshape(frame.shape[:2])


def save_mp4(path: str | Path, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as H.264 in MP4; an odd side gets one more line of pixels.

    Raises:
        ValueError: no frame, frames of different sizes, or fps that is not positive.
    """
    try:
        import imageio_ffmpeg  # type: ignore[import-untyped]  # comes with moviepy, publishes no types
    except ImportError as error:
        raise ImportError("writing MP4 needs moviepy: pip install 'bug-gym[render]'") from error
    checked = same_size(frames, fps)
    first = even_sided(next(checked))
    with replaced_when_done(path) as partial:
        writer = imageio_ffmpeg.write_frames(
            str(partial), (first.shape[1], first.shape[0]), fps=fps, quality=8, macro_block_size=2
        )
        with closing(writer):  # which lets ffmpeg end before the file gets its name, or goes
            writer.send(None)
            for frame in chain([first], map(even_sided, checked)):
                writer.send(frame)


def even_sided(frame: Frame) -> Frame:
    """The frame, its last line and column doubled where their number is odd: video codecs take nothing else."""
    height, width, _ = frame.shape
    return np.ascontiguousarray(np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge"))


def same_size(frames: Iterable[Frame], fps: float) -> Iterator[Frame]:
    """The frames, checked on their way."""
    if not fps > 0.0:
        raise ValueError(f"fps must be positive, got {fps}")
    shape: tuple[int, ...] | None = None
    for number, frame in enumerate(frames):
        shape = shape or frame.shape
        if frame.shape != shape:
            raise ValueError(f"frame {number} has shape {frame.shape}, the first one {shape}")
        yield frame
    if shape is None:
        raise ValueError("a clip needs at least one frame")


def load_pillow() -> ModuleType:
    """Import pillow's Image.

    Raises:
        ImportError: it is not installed; the message names the extra.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise ImportError("writing pictures needs pillow: pip install 'bug-gym[render]'") from error
    return Image


@contextmanager
def replaced_when_done(path: str | Path) -> Iterator[Path]:
    """A place to write a file to, which takes its name once it is whole; a failure leaves nothing behind."""
    target = Path(path)
    partial = target.with_name(f"{target.stem}.partial{target.suffix}")
    try:
        yield partial
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
