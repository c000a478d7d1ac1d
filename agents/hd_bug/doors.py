"""Doors: where the light about a place borders on the dark, and how the disc gets from the one into the other.

A door is a pair of places: v in the light, q beside it in the dark. They lie along each jump of the light from one heading
to the next, behind the end of what is nearer, and where the light ends because the beams do.

              wall     . q  door
    p  R - - - - - x- - v - - - - - |
             light                far

Source: Hasibuzzaman, Jan and Wu, Procedure 3 and Table 1 ("vertices" of obstacles; the end point of a beam that hits
nothing). All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math

from bug_gym.agents.hd_bug.light import light_toward
from bug_gym.compiling import kernel
from bug_gym.kernels.layout import Flags, Floats

LEAST_JUMP = 0.3
"""Smallest change of the light from one heading to the next that can hide a door [m]."""

DOOR_STEP = 1.1
"""From v to q, in clearances."""

DOOR_WIDTH = 0.95
"""Room about the segment from v to q, in clearances."""

MOST_DOORS = 4000
"""Doors of one place that are looked at."""


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
    for k in range(count):
        for side in (-1, 1):
            far_k = (k + side) % count
            near, far = light[k], light[far_k]
            if far - near <= LEAST_JUMP:
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
    if found < len(doors) and light_toward(light, toward, True) >= reach - 1e-6:
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
def room_along(px: Floats, py: Floats, ax: float, ay: float, bx: float, by: float) -> float:
    """Distance of the nearest of some points from the segment from a to b [m]; infinite without one."""
    dx, dy = bx - ax, by - ay
    square = max(dx * dx + dy * dy, 1e-12)
    least = math.inf
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
