"""What stands in drawn worlds: the walls of corridors, rooms and blocks, scattered circles, irregular polygons.

Pure functions from the parameters of a family and random numbers to polygons and circles; start, goal and robots are
the business of scenarios.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bug_gym.config import CorridorWorld, CrossingWorld, RoomsWorld, UrbanWorld, Waypoints
from bug_gym.geometry import F64
from bug_gym.world import SAME_POINT, Mover, Rings

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Rng = np.random.Generator
TRIES = 1000

Rectangle = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax [m]."""


def rings_of(polygon: object) -> Rings:
    """Shell and holes of a shapely polygon as open rings (k, 2), without points on straight lines."""
    import shapely

    simple = shapely.simplify(polygon, SAME_POINT)
    rings = [simple.exterior, *simple.interiors]
    return tuple(np.asarray(shapely.get_coordinates(ring)[:-1], dtype=np.float64) for ring in rings)


def as_polygons(solid: BaseGeometry) -> tuple[Rings, ...]:
    """The polygons of a shapely geometry."""
    import shapely

    return tuple(rings_of(piece) for piece in shapely.get_parts(solid) if piece.area > 0.0)


def boxes(rectangles: Sequence[Rectangle]) -> BaseGeometry:
    """The union of rectangles."""
    import shapely

    return shapely.union_all([shapely.box(*rectangle) for rectangle in rectangles])


# ---------------------------------------------------------------------------------------------- corridor


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


# ---------------------------------------------------------------------------------------------- rooms


def uneven_lines(low: float, high: float, count: int, unevenness: float, rng: Rng) -> F64:
    """Places (count + 1,) of lines that cut a length into `count` parts, the ends among them [m]."""
    pitch = (high - low) / count
    lines: F64 = low + pitch * np.arange(count + 1.0)
    lines[1:-1] += 0.5 * unevenness * pitch * rng.uniform(-1.0, 1.0, count - 1)
    lines[-1] = high
    return lines


def room_walls(world: RoomsWorld, open_right: F64, open_up: F64, rng: Rng) -> tuple[Rings, ...]:
    """The walls between rooms, with a door wherever a room is open to the next (see `scenarios.carve`)."""
    xmin, ymin, xmax, ymax = world.bounds
    half = 0.5 * world.wall
    x = uneven_lines(xmin, xmax, world.columns, world.unevenness, rng)
    y = uneven_lines(ymin, ymax, world.rows, world.unevenness, rng)

    def door(low: float, high: float) -> tuple[float, float]:
        begin = float(rng.uniform(low + half, high - half - world.door))
        return begin, begin + world.door

    # Walls go on a little beyond the border, so that no beam slips between the two.
    walls = [(line - half, ymin - half, line + half, ymax + half) for line in x[1:-1].tolist()]
    walls += [(xmin - half, line - half, xmax + half, line + half) for line in y[1:-1].tolist()]
    doors: list[Rectangle] = []
    for column, row in np.argwhere(open_right).tolist():
        low, high = door(y[row], y[row + 1])
        doors.append((x[column + 1] - world.wall, low, x[column + 1] + world.wall, high))
    for column, row in np.argwhere(open_up).tolist():
        low, high = door(x[column], x[column + 1])
        doors.append((low, y[row + 1] - world.wall, high, y[row + 1] + world.wall))
    return as_polygons(boxes(walls).difference(boxes(doors)))


# ---------------------------------------------------------------------------------------------- blocks


def city_buildings(world: UrbanWorld, rng: Rng) -> tuple[Rings, ...]:
    """A building in each block that is no square: a rectangle, or one with a courtyard, with or without a gateway."""
    xmin, ymin, _, _ = world.bounds
    width, height = world.block
    buildings = []
    for column in range(world.columns):
        for row in range(world.rows):
            is_square, has_courtyard, has_gateway = rng.random(3) < (world.squares, world.courtyards, world.gateways)
            left = xmin + world.street + column * (width + world.street)
            low = ymin + world.street + row * (height + world.street)
            rectangle = _set_back((left, low, left + width, low + height), world.unevenness, rng)
            side = int(rng.integers(4))
            if is_square:
                continue
            courtyard = _courtyard(rectangle, world, side, rng, has_gateway=bool(has_gateway))
            solid = boxes([rectangle])
            buildings.append(solid.difference(courtyard) if has_courtyard else solid)
    return tuple(rings_of(building) for building in buildings)


def _set_back(block: Rectangle, unevenness: float, rng: Rng) -> Rectangle:
    """The rectangle of a building in its block, up to `unevenness` of each side left free."""
    left, low, right, high = block
    free = rng.uniform(0.0, unevenness, 2) * (right - left, high - low)
    x, y = (left, low) + rng.random(2) * free
    return float(x), float(y), float(x + right - left - free[0]), float(y + high - low - free[1])


def _courtyard(rectangle: Rectangle, world: UrbanWorld, side: int, rng: Rng, *, has_gateway: bool) -> BaseGeometry:
    """The courtyard of a building and the gateway that leads into it from one of its sides, if it has one."""
    left, low, right, high = rectangle
    depth = world.depth
    inner = (left + depth, low + depth, right - depth, high - depth)
    if not has_gateway:
        return boxes([inner])
    begin = float(rng.uniform(inner[side % 2], inner[side % 2 + 2] - world.gateway))
    end = begin + world.gateway
    # A little longer than the building is deep, so that nothing is left standing at either end.
    gateways = (
        (begin, low - depth, end, low + 1.5 * depth),
        (left - depth, begin, left + 1.5 * depth, end),
        (begin, high - 1.5 * depth, end, high + depth),
        (right - 1.5 * depth, begin, right + depth, end),
    )
    return boxes([inner, gateways[side]])


# ---------------------------------------------------------------------------------------------- scattered


def scatter(
    count: int,
    sizes: tuple[float, float],
    box: Rectangle,
    is_free: Callable[[float, float, float], bool],
    rng: Rng,
    *,
    gap: float | None,
) -> F64:
    """Circles (k, 3) at random, each at least `gap` [m] from the others (None: they may overlap).

    Args:
        count: how many are wanted; k is less where no more found a place.
        sizes: least and greatest radius [m].
        box: where their middles are drawn.
        is_free: whether a circle x, y, radius may stand there, for all the function knows of other things.
        rng: random numbers.
        gap: least distance between two circles' rims [m].
    """
    xmin, ymin, xmax, ymax = box
    circles = np.zeros((count, 3))
    for number in range(count):
        for _ in range(TRIES):
            radius, x, y = float(rng.uniform(*sizes)), float(rng.uniform(xmin, xmax)), float(rng.uniform(ymin, ymax))
            if gap is not None:
                apart = np.hypot(circles[:number, 0] - x, circles[:number, 1] - y) - circles[:number, 2]
                if number and apart.min() < radius + gap:
                    continue
            if is_free(x, y, radius):
                circles[number] = x, y, radius
                break
        else:
            return circles[:number]
    return circles


def irregular_polygon(x: float, y: float, radius: float, corners: tuple[int, int], rng: Rng) -> F64:
    """A star-shaped polygon (k, 2) within a circle, its first corner on it [m].

    A corner lies in each equal sector, at most 0.4 of a sector off its middle: neighbours are less than half a turn
    apart, so the polygon is simple.
    """
    count = int(rng.integers(corners[0], corners[1] + 1))
    angle = rng.uniform(-math.pi, math.pi) + 2.0 * math.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count
    reach = radius * rng.uniform(0.5, 1.0, count)
    reach[0] = radius
    return np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])


# ---------------------------------------------------------------------------------------------- streams


def streams(world: CrossingWorld, rng: Rng) -> tuple[Mover, ...]:
    """Movers evenly spaced on rectangles beside one another, each rectangle with a speed and a sense of its own."""
    xmin, ymin, _, ymax = world.bounds
    low, high = ymin + world.turn_room, ymax - world.turn_room
    length = 2.0 * (world.lane + high - low)
    count = max(math.floor(length / (2.0 * world.radius + world.gap)), 1)
    movers = []
    for number in range(world.streams):
        middle = xmin + world.apron + (number + 0.5) * world.stream_width
        left, right = middle - 0.5 * world.lane, middle + 0.5 * world.lane
        corners = [(left, low), (right, low), (right, high), (left, high)]
        if rng.random() < 0.5:
            corners.reverse()
        speed, phase = float(rng.uniform(*world.speeds)), float(rng.random())
        for mover in range(count):
            at, points = _on_loop(corners, (mover + phase) * length / count)
            movers.append(Mover(world.radius, at, Waypoints(law="waypoints", points=points, speed=speed)))
    return tuple(movers)


def _on_loop(
    corners: Sequence[tuple[float, float]], way: float
) -> tuple[tuple[float, float], tuple[tuple[float, float], ...]]:
    """The place after some way [m] along a closed line from its first corner, and the corners from there on."""
    for index, (x, y) in enumerate(corners):
        after = corners[(index + 1) % len(corners)]
        side = math.dist((x, y), after)
        if way < side:
            share = way / side
            ahead = [*corners[index + 1 :], *corners[: index + 1]]
            return (x + share * (after[0] - x), y + share * (after[1] - y)), tuple(ahead)
        way -= side
    return _on_loop(corners, max(way, 0.0))
