"""A brush, and the parts of a picture of a world that it paints: what stands, what moves, what a robot sees, its mind."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bug_gym import kernels
from bug_gym.drawing.brush import (
    AREA_SHARE,
    DASHED,
    FAINT,
    GOAL,
    GROUND,
    INK,
    KEY,
    OUTCOME_COLORS,
    PAGE,
    ROBOTS,
    Brush,
    Color,
    Pixel,
    Projection,
    label_color,
    mixed,
)
from bug_gym.policy import Drawing
from bug_gym.schema.polygons import WeightedRegion
from bug_gym.task import OUTCOMES
from bug_gym.world import World

if TYPE_CHECKING:
    import pygame

VELOCITY_HORIZON = 1.5
"""A dart reaches from the rim of a mover as far as it comes in this time [s]."""

SPARSE_BEAMS = math.radians(12.0)
"""Angle between two beams from which on a scan is drawn as rays: an area would claim what lies between them."""
STILL, STILL_RIM = (128, 139, 154), (84, 94, 110)
MOVING, MOVING_RIM = (243, 167, 83), (178, 98, 22)


# ---------------------------------------------------------------------------------------------- parts of a picture


def outlines_of(world: World, row: int) -> tuple[bytes, ...]:
    """All that `paint_still` and `mover_sprites` paint of a row, to be compared: the same as long as they paint the same."""
    counts = [world.array(name)[row, 0] for name in ("moving_disc_count", "disc_count", "moving_polygon_count")]
    counts += [world.array(name)[row, 0] for name in ("polygon_count", "border_walls", "wall_count")]
    still, walls = slice(counts[0], counts[1]), int(counts[-1])
    parts = [np.array(counts), *(world.array(name)[row, still] for name in ("body_x", "body_y"))]
    parts += [world.array("body_radius")[row], world.array("corner")[row, : 2 * walls]]
    return tuple(part.tobytes() for part in [*parts, world.array("wall_next")[row, :walls]])


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


def paint_around(brush: Brush, box: tuple[float, float, float, float]) -> None:
    """Page around a box of the world [m], which is all that is shown of it."""
    (left, bottom), (right, top) = brush.view.pixel(*box[:2]), brush.view.pixel(*box[2:])
    width, height = brush.surface.get_size()
    strips = ((0, 0, width, top), (0, bottom, width, height), (0, 0, left, height), (right, 0, width, height))
    for strip in strips:
        brush.surface.fill(PAGE, strip)
    brush.line([(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], FAINT, 1.0)


def shell_extent(ring: NDArray[np.float64]) -> float:
    """Area of the box around a ring (k, 2) [m^2]."""
    width, height = np.ptp(ring, axis=0)
    return float(width * height)


def ground_tint(factor: float) -> Color:
    """The glass over ground of this factor: the larger it is, the darker in every colour."""
    return mixed(GROUND, PAGE, 0.55 * (1.0 - 1.0 / factor))


def paint_ground(brush: Brush, regions: Sequence[WeightedRegion]) -> None:
    """Weighted regions as coloured glass that covers the surface, each with its factor; the darkest pane counts."""
    pane = brush.surface.copy()
    brush.surface.fill(PAGE)
    for region in regions:
        pane.fill(PAGE)
        paint_region(Brush(pane, brush.view, brush.unit), region, ground_tint(region.factor))
        brush.surface.blit(pane, (0, 0), special_flags=brush.pygame.BLEND_RGB_MIN)
    brush.pygame.font.init()
    font = brush.pygame.font.Font(None, round(17.0 * brush.unit))
    for region in regions:
        place = label_place(region, regions)
        if place is not None:
            text = font.render(f"× {region.factor:g}", True, mixed(GROUND, INK, 0.7))
            column, line = brush.view.pixel(*place)
            brush.surface.blit(text, (column - 0.5 * text.get_width(), line - 0.5 * text.get_height()))


def paint_region(brush: Brush, region: WeightedRegion, tint: Color) -> None:
    """One region, its rim a little darker."""
    outline, rim = region.geometry(), mixed(GROUND, tint, 0.35)
    brush.area(brush.view.pixels(np.array(outline.exterior.coords)), tint, rim)
    for hole in outline.interiors:
        brush.area(brush.view.pixels(np.array(hole.coords)), PAGE, rim)


def label_place(region: WeightedRegion, regions: Sequence[WeightedRegion]) -> tuple[float, float] | None:
    """Where a region's factor is written: amid the widest part where no larger one counts, None where there is none."""
    import shapely

    above = [other.geometry() for other in regions if other.factor > region.factor]
    seen = region.geometry().difference(shapely.union_all(above))
    if seen.area == 0.0:
        return None
    x, y = shapely.maximum_inscribed_circle(seen).coords[0]
    return x, y


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
    corners = ends if world.scenario.lidar.is_full_circle else [at, *ends]
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


class Sprites(NamedTuple):
    """Movers on surfaces of their own: they don't turn, so they are painted once an episode. First circles, then polygons."""

    surfaces: list[pygame.Surface]
    places: NDArray[np.float64]
    """Column and line (k, 2) of each mover's place on its surface."""


def mover_sprites(brush: Brush, world: World, row: int) -> Sprites:
    """A sprite of each mover of a row."""
    sprites = [mover_sprite(brush, mover.outline) for mover in world.layout(row).movers]
    return Sprites([surface for surface, _ in sprites], np.array([place for _, place in sprites]).reshape(-1, 2))


def mover_sprite(brush: Brush, outline: float | NDArray[np.float64]) -> tuple[pygame.Surface, Pixel]:
    """A circle of a radius [m], or a polygon with corners (k, 2) about its place [m], and where its place is."""
    scale, edge = brush.view.scale, 2.0 * brush.unit
    corners = np.asarray(outline) if np.ndim(outline) else np.array([[-outline, -outline], [outline, outline]])
    left, top = edge - scale * float(corners[:, 0].min()), edge + scale * float(corners[:, 1].max())
    size = np.ceil(scale * np.ptp(corners, axis=0) + 2.0 * edge).tolist()
    surface = brush.pygame.Surface(size, 0, 32)
    surface.fill(KEY)
    own = Brush(surface, Projection(scale, left, top), brush.unit)
    if np.ndim(outline):
        own.area(own.view.pixels(corners), MOVING, MOVING_RIM)
    else:
        own.disc((left, top), scale * float(outline), MOVING, MOVING_RIM)
    surface.set_colorkey(KEY, brush.pygame.RLEACCEL)
    return surface, (left, top)


def paint_movers(brush: Brush, world: World, row: int, sprites: Sprites) -> None:
    """Moving circles and polygons, each with a dart along its velocity."""
    discs, polygons = (int(world.array(name)[row, 0]) for name in ("moving_disc_count", "moving_polygon_count"))
    bodies = np.concatenate([np.arange(discs), int(world.spec["discs"][0]) + np.arange(polygons)])
    paint_velocities(brush, world, row, bodies, MOVING_RIM)
    x, y = (world.array(name)[row, bodies] for name in ("body_x", "body_y"))
    pixels = np.column_stack([brush.view.left + brush.view.scale * x, brush.view.top - brush.view.scale * y])
    corners = np.rint(pixels - sprites.places).astype(np.int64).tolist()
    brush.surface.fblits(list(zip(sprites.surfaces, corners, strict=True)))


def paint_velocities(
    brush: Brush, world: World, row: int, bodies: NDArray[np.int64], color: Color, radius: float | None = None
) -> None:
    """Darts along the velocities of bodies (k,), to be painted over by the bodies.

    Each begins in the body's centre and reaches over its radius, or over one in pixels, as far as VELOCITY_HORIZON says:

    ```
                 .1.
    0 ......-----'   2
             -----.3'
    ```
    """
    names = ("body_x", "body_y", "body_vx", "body_vy", "body_radius")
    x, y, vx, vy, own = (world.array(name)[row, bodies] for name in names)
    speed = np.hypot(vx, vy)
    moving = speed > 0.0
    x, y, vx, vy, own, speed = (values[moving] for values in (x, y, vx, vy, own, speed))
    scale, unit = brush.view.scale, brush.unit
    rim = scale * own if radius is None else radius
    tip = rim + VELOCITY_HORIZON * scale * speed
    root, neck = np.zeros(len(x)), np.maximum(tip - 6.0 * unit, rim)
    cos, sin = vx / speed, -vy / speed  # lines count downward
    column, line = brush.view.left + scale * x, brush.view.top - scale * y
    darts = np.empty((len(x), 4, 2))
    for corner, (ahead, side) in enumerate(((root, 0.0), (neck, 2.5 * unit), (tip, 0.0), (neck, -2.5 * unit))):
        darts[:, corner, 0] = column + ahead * cos - side * sin
        darts[:, corner, 1] = line + ahead * sin + side * cos
    draw, surface = brush.pygame.draw.polygon, brush.surface
    for dart in darts.tolist():
        draw(surface, color, dart)


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
    """A flag on each goal that stands; a bull's eye and a dart on each that moves."""
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
    reach = max(world.own(row, "body_reach") * scale, 4.0 * unit)
    outcome = OUTCOMES[int(world.outcome[row, robot])]
    if outcome == "collision":
        brush.area(star(at, reach + 8.0 * unit), OUTCOME_COLORS[outcome], PAGE)
    elif outcome != "running":
        brush.ring(at, reach + 5.0 * unit, OUTCOME_COLORS[outcome], 2.5)

    body = world.body(row)
    places = np.column_stack([x + cos * body[:, 0] - sin * body[:, 1], y + sin * body[:, 0] + cos * body[:, 1]])
    centers, radii = brush.view.pixels(places), np.maximum(scale * body[:, 2], 3.0 * unit).tolist()
    rim = mixed(color, INK, 0.6)
    front = int((body[:, 0] + body[:, 2]).argmax())  # the nose is that of the foremost circle
    (left, top), own = centers[front], max(scale * float(body[front, 2]), 4.0 * unit)
    nose = [(own + 5.0 * unit, 0.0), (0.3 * own, 0.75 * own), (0.3 * own, -0.75 * own)]
    corners = [(left + cos * ahead + sin * side, top - sin * ahead + cos * side) for ahead, side in nose]
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
    """The areas of a drawing, those of a label as one; what lies beneath them shows through."""
    rings: dict[str, list[list[Pixel]]] = {}
    for ring, label in drawing.areas:
        rings.setdefault(label, []).append(brush.view.pixels(from_odometry(ring, origin)))
    for label, each in rings.items():
        brush.veils(each, mixed(label_color(label), PAGE, AREA_SHARE))


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
        brush.mark(at, label, 3.5 * brush.unit)


class Sample(NamedTuple):
    """What a label stands for in some drawings."""

    label: str
    """The label."""
    has_area: bool
    """Whether areas bear it."""
    has_segment: bool
    """Whether segments bear it."""
    has_point: bool
    """Whether points bear it."""


def samples_of(drawings: Iterable[Drawing]) -> list[Sample]:
    """The labels that occur, each once, in order, with what bears them."""
    labels: list[dict[str, None]] = [{}, {}, {}]
    for drawing in drawings:
        for kind, part in enumerate((drawing.areas, drawing.segments, drawing.points)):
            labels[kind].update((str(item[-1]), None) for item in part)
    areas, segments, points = labels
    return [Sample(one, one in areas, one in segments, one in points) for one in {**areas, **segments, **points}]


def paint_sample(brush: Brush, sample: Sample, left: float, middle: float, width: float, height: float) -> None:
    """What a legend shows before a label: the area, the segment and the point as they are drawn in the picture."""
    color, right = label_color(sample.label), left + width
    if sample.has_area:
        top, bottom = middle - 0.5 * height, middle + 0.5 * height
        corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
        brush.area(corners, mixed(color, PAGE, AREA_SHARE), FAINT, 0.75)
    if sample.has_segment:
        if sample.label in DASHED:
            brush.dashes((left, middle), (right, middle), color, 1.25)
        else:
            brush.line([(left, middle), (right, middle)], color, 1.5)
    if sample.has_point:
        brush.mark((0.5 * (left + right), middle), sample.label, 0.45 * height)
