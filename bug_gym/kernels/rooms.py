"""The draws and the walls of a world of family `rooms`; what they are is said in `bug_gym/worlds/rooms.py`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.generator import Words, drawn_below, drawn_between
from bug_gym.kernels.layout import Flags, Floats, Integers

USED = np.iinfo(np.int64).min  # of a point that a ring has
SLIVER = 1e-6  # what is left of a wall beside a door, if it is not more, is left to others [m]


class WallsAndDoors(NamedTuple):
    """Where walls and doors are."""

    x: Floats
    """The walls' places along x (columns + 1,) [m]."""
    y: Floats
    """The walls' places along y (rows + 1,) [m]."""
    right: Floats
    """Where the doors to the right begin along y (columns - 1, rows) [m]; NaN where there is none."""
    up: Floats
    """Where the doors upwards begin along x (columns, rows - 1) [m]; NaN where there is none."""


@called
def carve_rooms(g: Words, right: Flags, up: Flags, loops: float, trail: Integers, seen: Flags) -> None:
    """As `grid.carve`: which rooms are open to their right (columns - 1, rows) and upper (columns, rows - 1) ones."""
    columns, rows = seen.shape
    cell = drawn_below(g, columns) * rows
    cell += drawn_below(g, rows)
    trail[0] = cell
    seen[cell // rows, cell % rows] = True
    last = 0
    while last >= 0:
        x, y = trail[last] // rows, trail[last] % rows
        is_way = (
            x + 1 < columns and not seen[x + 1, y],
            x > 0 and not seen[x - 1, y],
            y + 1 < rows and not seen[x, y + 1],
            y > 0 and not seen[x, y - 1],
        )
        ways = 0
        for way in range(4):
            ways += int(is_way[way])
        if ways == 0:
            last -= 1
            continue
        chosen = drawn_below(g, ways)
        way = 0
        while not is_way[way] or chosen > 0:
            chosen -= int(is_way[way])
            way += 1
        u, v = x + int(way == 0) - int(way == 1), y + int(way == 2) - int(way == 3)
        if v == y:
            right[min(x, u), y] = True
        else:
            up[x, min(y, v)] = True
        seen[u, v] = True
        last += 1
        trail[last] = u * rows + v
    open_some(g, right, loops)
    open_some(g, up, loops)


@called
def open_some(g: Words, doors: Flags, loops: float) -> None:
    """Open a share of the walls, whether they are open already or not."""
    for i in range(doors.shape[0]):
        for j in range(doors.shape[1]):
            doors[i, j] |= drawn_between(g, 0.0, 1.0) < loops


@called
def draw_lines(g: Words, lines: Floats, low: float, high: float, half: float, unevenness: float) -> int:
    """Places (n + 1,) of lines that cut a length into n parts, as `uneven_lines`; how they lie about its middle.

    Lines before the middle count 1 each, those in it n each.
    """
    count = lines.size - 1
    pitch = (high - low) / count
    middle, lie = (low - half) + (high + half), 0
    lines[0], lines[count] = low, high
    for i in range(1, count):
        lines[i] = low + pitch * i + 0.5 * unevenness * pitch * drawn_between(g, -1.0, 1.0)
        doubled = (lines[i] - half) + (lines[i] + half)
        lie += int(doubled < middle) + count * int(doubled == middle)
    return lie


@inlined
def draw_door(g: Words, lines: Floats, place: int, half: float, door: float) -> float:
    """Where a door between two lines begins [m]; NaN where it leaves next to nothing of the wall beside it."""
    low, high = lines[place] + half, lines[place + 1] - half
    begin = drawn_between(g, low, high - door)
    return begin if begin - low > SLIVER and high - (begin + door) > SLIVER else math.nan


@kernel
def draw_rooms(
    g: Words,
    bounds: tuple[float, float, float, float],
    half: float,
    door: float,
    loops: float,
    unevenness: float,
    drawn: WallsAndDoors,
    open_right: Flags,
    open_up: Flags,
    seen: Flags,
    trail: Integers,
) -> int:
    """Draw walls and doors, in the order of `RoomsWorld.layout` and `room_walls`.

    Args:
        g: the generator.
        bounds: xmin, ymin, xmax, ymax [m].
        half: half a wall [m].
        door: width of doors [m].
        loops: share of walls that have a door without need.
        unevenness: of the walls' places.
        drawn: to write.
        open_right: False, (columns - 1, rows).
        open_up: False, (columns, rows - 1).
        seen: False, (columns, rows).
        trail: scratch (columns * rows,).

    Returns:
        How the walls lie about the middle, a number for each way; -1 where slivers are left beside doors.
    """
    x, y, right, up = drawn
    columns, rows = seen.shape
    carve_rooms(g, open_right, open_up, loops, trail, seen)
    lie = draw_lines(g, x, bounds[0], bounds[2], half, unevenness) * (rows + 1) ** 2
    lie += draw_lines(g, y, bounds[1], bounds[3], half, unevenness)
    is_clean = min(half, door) > SLIVER
    for column in range(columns - 1):
        for row in range(rows):
            right[column, row] = math.nan
            if open_right[column, row]:
                right[column, row] = draw_door(g, y, row, half, door)
                is_clean &= not math.isnan(right[column, row])
    for column in range(columns):
        for row in range(rows - 1):
            up[column, row] = math.nan
            if open_up[column, row]:
                up[column, row] = draw_door(g, x, column, half, door)
                is_clean &= not math.isnan(up[column, row])
    return lie if is_clean else -1


@inlined
def face(lines: Floats, number: int, half: float) -> float:
    """Place of a face: the border's outer one, the lower and the upper one of each wall, the border's upper one [m]."""
    line, last = (number + 1) // 2, lines.size - 1
    is_upper = line == last or (number % 2 == 0 and line > 0)
    return float(lines[line] + half if is_upper else lines[line] - half)


@inlined
def door_of(i: int, j: int, next_i: int, next_j: int, right: Floats, up: Floats) -> tuple[float, int]:
    """Where the door in a side of the walls' rings begins [m], NaN where it has none, and the door's number.

    A side leads from where faces i (along x) and j (along y) meet to where the next two do.
    """
    is_upright = i == next_i
    low = min(j, next_j) if is_upright else min(i, next_i)
    if low % 2 == 1:  # the end of a wall, beyond the border; the others are sides of rooms
        return math.nan, 0
    if is_upright:
        column, row = (i + 1) // 2 - 1, low // 2
        return right[column, row], column * right.shape[1] + row
    column, row = low // 2, (j + 1) // 2 - 1
    return up[column, row], right.size + column * up.shape[1] + row


@called
def walk_along(
    faces: Integers,
    ring_firsts: Integers,
    drawn: WallsAndDoors,
    half: float,
    door: float,
    walk: Floats,
    after: Integers,
    begins: Integers,
) -> int:
    """Walk along the rings of whole walls, over what doors leave of them; the arguments are those of `cut_doors`.

    Writes the points to `walk`, and to `after` the number of each one's next point on this face of the wall, or -1 - jamb
    where a door breaks it off: a jamb is one of the two sides of a door. The face behind begins at the point that `begins`
    has for that jamb. Returns how many points there are.
    """
    x, y, right, up = drawn
    points = 0
    for ring in range(ring_firsts.size - 1):
        first, begin, end = points, ring_firsts[ring], ring_firsts[ring + 1]
        for corner in range(begin, end):
            following = corner + 1 if corner + 1 < end else begin
            i, j, next_i, next_j = faces[corner, 0], faces[corner, 1], faces[following, 0], faces[following, 1]
            here_x, here_y = face(x, i, half), face(y, j, half)
            walk[points, 0], walk[points, 1] = here_x, here_y
            after[points] = points + 1
            points += 1
            near, number = door_of(i, j, next_i, next_j, right, up)
            if math.isnan(near):
                continue
            goes_up = next_i > i or next_j > j
            for side in range(2):
                is_far = (side == 1) == goes_up
                place = near + door if is_far else near
                walk[points, 0] = here_x if i == next_i else place
                walk[points, 1] = place if i == next_i else here_y
                jamb = 2 * number + int(is_far)
                if side == 0:
                    after[points] = -1 - jamb
                else:
                    after[points] = points + 1
                    begins[jamb] = points
                points += 1
        after[points - 1] = first
    return points


@inlined
def next_point(point: int, after: Integers, begins: Integers) -> int:
    """The point that follows: on this face of the wall, or across a door's jamb."""
    way = after[point]
    return int(way if way >= 0 else begins[-1 - way])


@kernel
def cut_doors(
    faces: Integers,
    ring_firsts: Integers,
    drawn: WallsAndDoors,
    half: float,
    door: float,
    walk: Floats,
    after: Integers,
    begins: Integers,
    corners: Floats,
    firsts: Integers,
) -> int:
    """Cut doors out of walls: the rings of what is left, behind that of the border.

    The rings of whole walls are walked along. A door breaks them off; the way goes on along its jamb, on the other face of
    the wall. Each ring that comes of it begins one corner after that where the walk first met it, as those of GEOS do.

    Args:
        faces: (n, 2), the faces that meet at each corner of whole walls, the solid on the right of each ring.
        ring_firsts: (rings + 1,), where each of those rings begins.
        drawn: where walls and doors are.
        half: half a wall [m].
        door: width of doors [m].
        walk: scratch (m, 2), m = n + 4 for each door.
        after: scratch (m,).
        begins: scratch (2,) for each door.
        corners: (m + 4, 2) to write: the border, then the rings [m].
        firsts: (m + 2,) to write: where each of them begins, and the end of the last.

    Returns:
        How many rings there are, the border among them.
    """
    x, y = drawn.x, drawn.y
    points = walk_along(faces, ring_firsts, drawn, half, door, walk, after, begins)
    for corner in range(4):
        corners[corner, 0] = x[x.size - 1] if 0 < corner < 3 else x[0]
        corners[corner, 1] = y[y.size - 1] if corner > 1 else y[0]
    firsts[0], firsts[1] = 0, 4
    rings, size = 1, 4
    for met in range(points):
        if after[met] == USED:
            continue
        point = next_point(met, after, begins)
        while after[point] != USED:
            corners[size, 0], corners[size, 1] = walk[point, 0], walk[point, 1]
            size += 1
            following = next_point(point, after, begins)
            after[point] = USED
            point = following
        rings += 1
        firsts[rings] = size
    return rings
