"""Pictures of a world: a row of a Simulation as it is now. Reads only.

A frame is painted at PAINT times its size on surfaces in memory and averaged down: edges come out smooth, and no display
is needed. What does not move is painted once an episode. All lengths of the painting are pixels of the large surface.
"""

from __future__ import annotations

import logging
import math
import os
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
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

VELOCITY_HORIZON = 1.0
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
        circle = self.pygame.draw.circle
        if rim is None:
            circle(self.surface, color, at, radius)
            return
        circle(self.surface, rim, at, radius)
        circle(self.surface, color, at, max(radius - self.width(rim_units), 1.0))

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

    def dashes(self, start: Pixel, end: Pixel, color: Color, units: float) -> None:
        """A dashed line."""
        length, dash = math.dist(start, end), 5.0 * self.unit
        count = max(1, math.ceil(length / (2.0 * dash)))
        for number in range(count):
            first = min(2.0 * number * dash / max(length, 1e-9), 1.0)
            last = min((2.0 * number + 1.0) * dash / max(length, 1e-9), 1.0)
            self.line([between(start, end, first), between(start, end, last)], color, units)

    def arrow(self, start: Pixel, end: Pixel, color: Color, units: float) -> None:
        """A line with a head at its end."""
        length = math.dist(start, end)
        if length < self.unit:
            return
        ahead = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
        head = min(5.0 * self.unit, max(0.7 * length, 3.0 * self.unit))
        neck = (end[0] - head * ahead[0], end[1] - head * ahead[1])
        half = (-0.5 * head * ahead[1], 0.5 * head * ahead[0])
        self.pygame.draw.line(self.surface, color, start, neck, self.width(units))
        corners = [end, (neck[0] + half[0], neck[1] + half[1]), (neck[0] - half[0], neck[1] - half[1])]
        self.pygame.draw.polygon(self.surface, color, corners)


def between(start: Pixel, end: Pixel, share: float) -> Pixel:
    """The pixel at a share of the way."""
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


# ---------------------------------------------------------------------------------------------- parts of a picture


def paint_still(brush: Brush, world: World, row: int) -> None:
    """Page, border and still obstacles; the floor is left in KEY."""
    layout = world.layout(row)
    border = brush.view.pixels(layout.border)
    brush.surface.fill(PAGE)
    brush.area(border, KEY)
    # The larger first: what stands in the hole of a polygon has a smaller shell than that polygon.
    for rings in sorted(layout.polygons, key=lambda rings: -shell_extent(rings[0])):
        brush.area(brush.view.pixels(rings[0]), STILL, STILL_RIM)
        for hole in rings[1:]:
            brush.area(brush.view.pixels(hole), KEY, STILL_RIM)
    for at, radius in zip(brush.view.pixels(layout.circles), layout.circles[:, 2].tolist(), strict=True):
        brush.disc(at, radius * brush.view.scale, STILL, STILL_RIM)
    brush.line([*border, border[0]], INK, 2.5)


def shell_extent(ring: NDArray[np.float64]) -> float:
    """Area of the box around a ring (k, 2) [m^2]."""
    width, height = np.ptp(ring, axis=0)
    return float(width * height)


def paint_scan(brush: Brush, world: World, row: int, robot: int, floor: Color) -> None:
    """What the LIDAR sees: the free area (or the rays, where they are few) and a dot where a beam ended on something."""
    x, y, heading = world.pose[row, robot].tolist()
    ranges = world.ranges[row, robot].astype(np.float64)
    cos, sin = math.cos(heading), math.sin(heading)
    ahead, left = world.beams * ranges
    ends = brush.view.pixels(np.column_stack([x + cos * ahead - sin * left, y + sin * ahead + cos * left]))
    color, at = ROBOTS[robot % len(ROBOTS)], brush.view.pixel(x, y)
    if float(world.spec["angle_step"][0]) > SPARSE_BEAMS or len(ends) < 3:
        for end in ends:
            brush.line([at, end], mixed(color, floor, 0.35), 0.5)
    else:
        corners = ends if is_full_circle(world.scenario) else [at, *ends]
        brush.area(corners, mixed(color, floor, 0.13), mixed(color, floor, 0.3), 0.5)
    dot, dot_color = 0.9 * brush.unit, mixed(color, floor, 0.8)
    for index in np.flatnonzero(ranges < world.scenario.lidar.range).tolist():
        brush.disc(ends[index], dot, dot_color)


def paint_movers(brush: Brush, world: World, row: int) -> None:
    """Moving circles and polygons, each with an arrow along its velocity."""
    discs, scale = int(world.array("moving_disc_count")[row, 0]), brush.view.scale
    at = brush.view.pixels(world.disc_position[row, :discs])
    radii = (scale * world.disc_radius[row, :discs]).tolist()
    for center, radius in zip(at, radii, strict=True):
        brush.disc(center, radius, MOVING, MOVING_RIM)
    arrows = list(zip(at, radii, world.disc_velocity[row, :discs].tolist(), strict=True))

    walls = int(world.array("moving_wall_count")[row, 0])
    corners = brush.view.pixels(world.wall[row, :walls, :2])
    bodies = world.array("wall_body")[row, :walls]
    for body in np.unique(bodies).tolist():
        first, end = np.searchsorted(bodies, [body, body + 1]).tolist()
        brush.area(corners[first:end], MOVING, MOVING_RIM)
        x, y, vx, vy = (float(world.array(name)[row, body]) for name in ("body_x", "body_y", "body_vx", "body_vy"))
        center = brush.view.pixel(x, y)
        radius = sum(math.dist(center, corner) for corner in corners[first:end]) / (end - first)
        arrows.append((center, radius, [vx, vy]))
    for center, radius, velocity in arrows:
        paint_velocity(brush, center, radius, velocity, MOVING_RIM)


def paint_velocity(brush: Brush, center: Pixel, radius: float, velocity: Sequence[float], color: Color) -> None:
    """An arrow from the rim of a round body along its velocity [m/s]."""
    speed = math.hypot(*velocity)
    if speed <= 0.0:
        return
    ahead = (velocity[0] / speed, -velocity[1] / speed)
    reach = radius + VELOCITY_HORIZON * brush.view.scale * speed
    start = (center[0] + radius * ahead[0], center[1] + radius * ahead[1])
    brush.arrow(start, (center[0] + reach * ahead[0], center[1] + reach * ahead[1]), color, 1.5)


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
        for units, ring_color in ((6.5, PAGE), (5.5, color), (3.5, PAGE), (1.8, color)):
            brush.disc(at, units * brush.unit, ring_color)
        velocity = [float(world.array(name)[row, body]) for name in ("body_vx", "body_vy")]
        paint_velocity(brush, at, 6.5 * brush.unit, velocity, color)


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

    circles = [
        (brush.view.pixel(x + cos * cx - sin * cy, y + sin * cx + cos * cy), max(radius * scale, 2.5 * unit))
        for cx, cy, radius in world.footprint.tolist()
    ]
    for center, radius in circles:
        brush.disc(center, radius + 1.5 * unit, PAGE)
    for center, radius in circles:
        brush.disc(center, radius, mixed(color, INK, 0.7))
    for center, radius in circles:
        brush.disc(center, max(radius - unit, 1.0), color)
    # The heading sticks out of a small body, so that it can be read.
    nose, tail = max(reach + 2.0 * unit, 7.0 * unit), 0.4 * reach
    corners = [(nose, 0.0), (tail, 0.55 * reach), (tail, -0.55 * reach)]
    brush.area([(at[0] + cos * a + sin * b, at[1] - sin * a + cos * b) for a, b in corners], PAGE, color)


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
    """The areas of a drawing, translucent."""
    pygame = brush.pygame
    for ring, label in drawing.areas:
        pixels = np.array(brush.view.pixels(from_odometry(ring, origin)))
        low = np.maximum(np.floor(pixels.min(axis=0)), 0.0).astype(int)
        high = np.minimum(np.ceil(pixels.max(axis=0)) + 1.0, brush.surface.get_size()).astype(int)
        if len(pixels) < 3 or (high <= low).any():
            continue
        veil = pygame.Surface((high - low).tolist(), pygame.SRCALPHA, 32)
        pygame.draw.polygon(veil, (*label_color(label), 70), (pixels - low).tolist())
        brush.surface.blit(veil, low.tolist())


def paint_drawing(brush: Brush, drawing: Drawing, origin: NDArray[np.float64]) -> None:
    """The segments and points of a drawing."""
    for x1, y1, x2, y2, label in drawing.segments:
        start, end = brush.view.pixels(from_odometry([(x1, y1), (x2, y2)], origin))
        if label in DASHED:
            brush.dashes(start, end, label_color(label), 1.25)
        else:
            brush.line([start, end], label_color(label), 1.5)
    for x, y, label in drawing.points:
        (at,) = brush.view.pixels(from_odometry([(x, y)], origin))
        brush.disc(at, 4.5 * brush.unit, PAGE)
        brush.disc(at, 3.5 * brush.unit, label_color(label))


def labels_of(drawings: Iterable[Drawing]) -> list[str]:
    """The labels that occur, each once, in order."""
    found = [item[-1] for drawing in drawings for part in (drawing.areas, drawing.segments, drawing.points) for item in part]
    return [str(label) for label in dict.fromkeys(found)]


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
        xmin, ymin, xmax, ymax = simulation.scenario.world.bounds
        margin = 24.0 * max(self.unit, 0.6)
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
        self._forget_surfaces()

    def _forget_surfaces(self) -> None:
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
        if scan:
            for robot in range(world.robots):
                paint_scan(brush, world, row, robot, floor)
        origins = world.array("origin")[row].reshape(world.robots, 3)
        for robot, item in drawings.items():
            paint_areas(brush, item, origins[robot])
        paint_goal_areas(brush, world, row, floor)
        brush.surface.blit(self._still_surface(), (0, 0))
        paint_movers(brush, world, row)
        if trail:
            self._paint_trails(brush)
        for robot, item in drawings.items():
            paint_drawing(brush, item, origins[robot])
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
    pygame = load_pygame()
    try:
        pygame.display.init()
    except pygame.error as error:
        logger.warning("no screen to draw on (%s): the window stays invisible", error)
        os.environ["SDL_VIDEODRIVER"] = "dummy"
        pygame.display.init()
    pygame.display.set_caption("bug_gym")
    return pygame.display.set_mode(size)


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
    """Write frames as an endless GIF, in the 256 colours that suit its first, middle and last frame.

    Raises:
        ValueError: no frame, frames of different sizes, or fps that is not positive.
    """
    pillow = load_pillow()
    clip = list(same_size(frames, fps))
    sample = pillow.fromarray(np.concatenate([clip[0], clip[len(clip) // 2], clip[-1]]))
    palette = sample.quantize(256)
    images = [pillow.fromarray(frame).quantize(palette=palette, dither=pillow.Dither.NONE) for frame in clip]
    with replaced_when_done(path) as partial:
        images[0].save(
            partial, format="GIF", save_all=True, append_images=images[1:], duration=1000.0 / fps, loop=0, disposal=1
        )


def save_mp4(path: str | Path, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as H.264 in MP4; an odd side gets one more line of pixels.

    Raises:
        ValueError: no frame, frames of different sizes, or fps that is not positive.
    """
    try:
        import imageio_ffmpeg  # type: ignore[import-untyped]  # comes with moviepy, publishes no types
    except ImportError as error:
        raise ImportError("writing MP4 needs moviepy: pip install 'bug-gym[render]'") from error
    with replaced_when_done(path) as partial:
        writer = None
        for frame in same_size(frames, fps):
            height, width, _ = frame.shape
            whole = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
            if writer is None:
                size = (whole.shape[1], whole.shape[0])
                writer = imageio_ffmpeg.write_frames(str(partial), size, fps=fps, quality=8, macro_block_size=2)
                writer.send(None)
            writer.send(np.ascontiguousarray(whole))
        if writer is not None:
            writer.close()


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
