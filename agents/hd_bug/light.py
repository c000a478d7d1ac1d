"""Light and shadow: which ground a scan lights up for the robot's disc, and where light borders on the dark.

The light area of a place is a star: how far the disc can go along each of HEADINGS headings, and no farther than both
beams that bracket the heading saw, else few beams see through walls at small angles. What no light area of the list
holds is shadow. A *door* is a pair of places: v in the light, q beside it in the dark.

              wall     . q  door
    p  R - - - - - x- - v - - - - - |
             light                far

Source: Hasibuzzaman, Jan and Wu, Procedure 2 (a beam that hits leaves shadow behind it, the end of one that doesn't is
light) and section 5 ("past navigated areas are stored in a double-linked list"). A point of a beam as "area" makes the
test of Procedure 3 meaningless; the star is the local safe region of Oriolo, Vendittelli, Freda and Troso's SRT method.
All coordinates are in the odometry frame [m], headings counter-clockwise from its x axis.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import kernel
from bug_gym.geometry import F64
from bug_gym.kernels.free_way import free_distance
from bug_gym.kernels.layout import Flags, Floats, Integers

HEADINGS = 180
"""Headings along which a light area is measured."""

ANGLES: F64 = np.arange(HEADINGS, dtype=np.float64) * (2.0 * math.pi / HEADINGS)
"""These headings [rad]."""

SLACK = 0.08
"""How far beyond a light area a place still counts as lit [m]: more closes real doors, less leaves doors to nowhere."""

LEAST_JUMP = 0.3
"""Smallest change of the light from one heading to the next that can hide a door [m]."""

DOOR_STEP = 1.1
"""From v to q, in clearances."""

DOOR_WIDTH = 0.95
"""Room about the segment from v to q, in clearances."""

MOST_DOORS = 4000
"""Doors of one place that are looked at."""


@kernel
def fill_walls(
    px: Floats, py: Floats, piece: Integers, is_still: Flags, spacing: float, x: Floats, y: Floats, still: Flags
) -> int:
    """Points of the straight lines that join neighbouring scan points of one wall, after each of them.

    At a small angle to a wall the beams meet it so far apart that the disc seems to pass between two of them.

    Args:
        px: scan points (k,) in the order of their beams [m].
        py: the same.
        piece: (k,) number of each one's wall, see scan.pieces.
        is_still: (k,) whether it is of something still.
        spacing: largest distance between points of one wall [m].
        x: points (m,) [m]; is written, as far as there is room.
        y: the same.
        still: (m,) whether it is of something still; is written.

    Returns:
        How many there are.
    """
    count = 0
    for i in range(px.size):
        j = i + 1 if i + 1 < px.size else 0
        dx, dy = px[j] - px[i], py[j] - py[i]
        parts = 1
        if piece[i] == piece[j]:
            parts = max(int(math.ceil(math.hypot(dx, dy) / spacing)), 1)
        for k in range(min(parts, x.size - count)):
            x[count], y[count] = px[i] + k / parts * dx, py[i] + k / parts * dy
            still[count] = is_still[i] and (k == 0 or is_still[j])
            count += 1
    return count


@kernel
def measure_light(
    x: Floats, y: Floats, ranges: Floats, first: float, spacing: float, heading: float, radius: float, reach: float,
    light: Floats,
) -> None:  # fmt: skip
    """The light area (K,) of a scan, how far a disc can go along each heading [m].

    Args:
        x: points of walls (k,) in the robot's frame [m].
        y: the same.
        ranges: (B,) of all beams [m].
        first: bearing of the first beam [rad].
        spacing: angle between beams [rad].
        heading: of the robot [rad].
        radius: of the disc [m].
        reach: range that means "nothing seen" [m].
        light: is written.
    """
    beams, count = ranges.size, light.size
    is_round = spacing * beams > 2.0 * math.pi - 0.5 * spacing
    for k in range(count):
        bearing = 2.0 * math.pi * k / count - heading
        turned = (bearing - first) % (2.0 * math.pi) / spacing
        before = int(turned)
        if not is_round and before >= beams - 1:
            light[k] = 0.0
            continue
        before = before % beams
        seen = min(ranges[before], ranges[(before + 1) % beams])
        light[k] = min(free_distance(x, y, bearing, radius, reach), seen)


@kernel
def light_toward(light: Floats, angle: float, is_strict: bool) -> float:
    """How far a light area (K,) reaches toward an angle [rad]: by the farther of two headings, strictly the nearer."""
    count = light.size
    turned = angle / (2.0 * math.pi) * count % count
    before = int(turned) % count
    one, other = light[before], light[(before + 1) % count]
    return float(min(one, other) if is_strict else max(one, other))


@kernel
def are_lit(places: Floats, lights: Floats, farthest: Floats, points: Floats, slack: float, result: Flags) -> None:
    """Which of some points (m, 2) lie in light areas: set in `result` (m,).

    Args:
        places: of the light areas (n, 2) [m].
        lights: the light areas (n, K) [m].
        farthest: how far each reaches at most (n,) [m].
        points: (m, 2) [m].
        slack: how far beyond the light still counts [m].
        result: (m,) becomes True where it is light; the rest is left as it is.
    """
    for i in range(len(points)):
        for j in range(len(places) - 1, -1, -1):
            dx, dy = points[i, 0] - places[j, 0], points[i, 1] - places[j, 1]
            square = dx * dx + dy * dy
            if square > (farthest[j] + slack) ** 2:
                continue
            if math.sqrt(square) <= light_toward(lights[j], math.atan2(dy, dx), False) + slack:
                result[i] = True
                break


@kernel
def are_before_walls(places: Floats, lights: Floats, points: Floats, reach: float, slack: float, result: Flags) -> None:
    """Which of some points (m, 2) lie at most `slack` [m] behind where a light area ends at something.

    Args:
        places: of the light areas (n, 2) [m].
        lights: the light areas (n, K) [m].
        points: (m, 2) [m].
        reach: range that means "nothing seen" [m].
        slack: [m].
        result: (m,) becomes True where it is so; the rest is left as it is.
    """
    for i in range(len(points)):
        for j in range(len(places) - 1, -1, -1):
            dx, dy = points[i, 0] - places[j, 0], points[i, 1] - places[j, 1]
            square = dx * dx + dy * dy
            if square > (reach + slack) ** 2:
                continue
            way = light_toward(lights[j], math.atan2(dy, dx), False)
            if way < reach - 1e-6 and math.sqrt(square) <= way + slack:
                result[i] = True
                break


@kernel
def are_in_sight(places: Floats, lights: Floats, last: int, result: Flags) -> None:
    """Which of the places (n, 2) one can go to straight from place `last`, by either's light area; (n,) is written."""
    for j in range(len(places)):
        dx, dy = places[j, 0] - places[last, 0], places[j, 1] - places[last, 1]
        away, angle = math.hypot(dx, dy), math.atan2(dy, dx)
        is_there = away <= light_toward(lights[last], angle, True)
        result[j] = is_there or away <= light_toward(lights[j], angle + math.pi, True)


@kernel
def room_along(px: Floats, py: Floats, ax: float, ay: float, bx: float, by: float) -> float:
    """Distance of the nearest of some points from the segment from a to b [m]; infinite without one."""
    dx, dy = bx - ax, by - ay
    square = max(dx * dx + dy * dy, 1e-12)
    least = np.inf
    for i in range(px.size):
        share = min(max(((px[i] - ax) * dx + (py[i] - ay) * dy) / square, 0.0), 1.0)
        ex, ey = px[i] - ax - share * dx, py[i] - ay - share * dy
        least = min(least, ex * ex + ey * ey)
    return math.sqrt(least)


@kernel
def rooms_along(px: Floats, py: Floats, segments: Floats, result: Floats) -> None:
    """`room_along` of segments (m, 4) ax, ay, bx, by; `result` (m,) is written."""
    for i in range(len(segments)):
        result[i] = room_along(px, py, segments[i, 0], segments[i, 1], segments[i, 2], segments[i, 3])


@kernel
def are_near(places: Floats, others: Floats, limit: float, result: Flags) -> None:
    """Which places (m, 2) lie nearer than a limit [m] to one of the others (n, 2); `result` (m,) becomes True there."""
    for i in range(len(places)):
        for j in range(len(others)):
            if math.hypot(places[i, 0] - others[j, 0], places[i, 1] - others[j, 1]) < limit:
                result[i] = True
                break


@kernel
def thin_out(places: Floats, apart: float, dropped: Flags) -> None:
    """Drop, in order, each of the places (m, 2) that lies nearer than `apart` [m] to one that is kept."""
    for i in range(len(places)):
        for j in range(i):
            if dropped[i] or dropped[j]:
                continue
            if math.hypot(places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]) < apart:
                dropped[i] = True


@kernel
def find_doors(
    light: Floats, x: float, y: float, px: Floats, py: Floats, clearance: float, reach: float, toward: float,
    doors: Floats,
) -> tuple[int, int]:  # fmt: skip
    """The doors of one light area: along each jump of the light, and where nothing was seen.

    Args:
        light: the light area (K,) [m].
        x: its place [m].
        y: the same.
        px: scan points (k,) [m].
        py: the same.
        clearance: radius of the disc that is to pass [m].
        reach: range that means "nothing seen" [m].
        toward: direction of the goal, along which there is a door in any case where nothing is seen [rad].
        doors: (D, 5) v, q, and the room about the way from v to q [m]; is written.

    Returns:
        How many there are beside jumps, which come first, and how many in all.
    """
    count, found = light.size, 0
    step = 2.0 * math.pi / count
    jump = max(LEAST_JUMP, 1.2 * clearance)
    for k in range(count):
        for side in (-1, 1):
            far_k = (k + side) % count
            near, far = light[k], light[far_k]
            if far - near <= jump:
                continue
            angle = far_k * step
            beside = angle - side * 0.5 * math.pi
            along = near + 1.5 * clearance
            while along <= far + 1e-9 and found < len(doors):
                vx, vy = x + along * math.cos(angle), y + along * math.sin(angle)
                qx = vx + DOOR_STEP * clearance * math.cos(beside)
                qy = vy + DOOR_STEP * clearance * math.sin(beside)
                found += _add_door(vx, vy, qx, qy, px, py, clearance, doors, found)
                along += clearance
    jumps = found
    if light_toward(light, toward, True) >= reach - 1e-6:
        found += _add_end(x, y, toward, px, py, clearance, reach, doors, found)
    return jumps, _find_ends_of_sight(light, x, y, px, py, clearance, reach, doors, found)


@kernel
def _add_door(
    vx: float, vy: float, qx: float, qy: float, px: Floats, py: Floats, clearance: float, doors: Floats, found: int
) -> int:
    """Note a door where there is room for it; 1 where there is."""
    room = room_along(px, py, vx, vy, qx, qy)
    if room < DOOR_WIDTH * clearance:
        return 0
    doors[found, 0], doors[found, 1], doors[found, 2], doors[found, 3], doors[found, 4] = vx, vy, qx, qy, room
    return 1


@kernel
def _add_end(
    x: float, y: float, angle: float, px: Floats, py: Floats, clearance: float, reach: float, doors: Floats, found: int
) -> int:
    """Note a door where sight ends along an angle [rad]; 1 where there is room for it."""
    cos, sin = math.cos(angle), math.sin(angle)
    end = reach + DOOR_STEP * clearance
    return _add_door(x + reach * cos, y + reach * sin, x + end * cos, y + end * sin, px, py, clearance, doors, found)


@kernel
def _find_ends_of_sight(
    light: Floats, x: float, y: float, px: Floats, py: Floats, clearance: float, reach: float, doors: Floats, found: int
) -> int:
    """Doors every metre where the light ends because the beams do, and in the middle of each such run."""
    count = light.size
    step = 2.0 * math.pi / count
    stride = max(int(1.0 / (reach * step)), 1)
    begin = 0
    while begin < count and light[begin] >= reach - 1e-6:
        begin += 1
    begin = begin % count  # the first heading that ends at something, or 0 where none does
    run = 0
    for i in range(1, count + 1):
        k = (begin + i) % count
        if light[k] >= reach - 1e-6:
            run += 1
            if i < count:
                continue
        first = begin + i - run if light[k] < reach - 1e-6 else begin + i - run + 1
        for j in range(run):
            is_chosen = j == run // 2 or (run * reach * step > 1.0 and (j % stride == 0 or j == run - 1))
            if not is_chosen or found >= len(doors):
                continue
            found += _add_end(x, y, (first + j) * step, px, py, clearance, reach, doors, found)
        run = 0
    return found


@kernel
def least_ways(places: Floats, links: Flags, start: int, done: Flags, length: Floats, before: Floats) -> None:
    """Least ways from one place to all over links: Dijkstra's, over arrays.

    Args:
        places: (n, 2) [m].
        links: (m, m) of at least n; which places one can go between straight.
        start: where from.
        done: (n,) False; is written.
        length: (n,) [m] is written; infinite where there is no way.
        before: (n,) number of the place before each on its way, -1: none; is written.
    """
    count = len(places)
    length[:] = np.inf
    before[:] = -1.0
    length[start] = 0.0
    for _ in range(count):
        best, least = -1, np.inf
        for j in range(count):
            if not done[j] and length[j] < least:
                best, least = j, length[j]
        if best < 0:
            break
        done[best] = True
        for j in range(count):
            if done[j] or not links[best, j]:
                continue
            way = least + math.hypot(places[j, 0] - places[best, 0], places[j, 1] - places[best, 1])
            if way < length[j]:
                length[j], before[j] = way, best
