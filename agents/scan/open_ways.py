"""Corners of what is in sight and the open ways past them (PointBug and its kin)."""

from __future__ import annotations

import math

from bug_gym.agents.scan.pieces import bend_of
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.free_way import way_to_point
from bug_gym.kernels.geometry import sin_cos
from bug_gym.kernels.layout import Flags, Floats, Integers


@inlined
def is_foretold(px: Floats, py: Floats, slack: float, noise: float, first: int, second: int, beam: int) -> bool:
    """Whether `beam` meets the straight line through the points of the two neighbours before it, see `bend_of`."""
    bend, error = bend_of(px, py, slack, noise, first, second, beam)
    return abs(bend) <= error


@called
def goes_on_straight(
    px: Floats, py: Floats, ranges: Floats, reach: float, jump: float, noise: float, i: int, way: int
) -> bool:
    """Whether the wall seen by beam i and those before it, counted in the direction `way`, foretells the next range."""
    n = ranges.size
    ahead, before, earlier = (i + way) % n, (i - way) % n, (i - 2 * way) % n
    straight = 0.2 * jump
    if ranges[before] >= reach:
        return False
    # After a jump those two must lie on a line with a third.
    is_jump = abs(ranges[i] - ranges[before]) > jump
    if is_jump and (ranges[earlier] >= reach or not is_foretold(px, py, straight, noise, earlier, before, i)):
        return False
    return is_foretold(px, py, straight, noise, before, i, ahead)


@called
def meet_in_corner(px: Floats, py: Floats, ranges: Floats, reach: float, i: int, j: int) -> bool:
    """Whether the walls seen before beam i and after its neighbour j run into each other between the two beams.

    Each goes on straight there for at most one and a half times the length seen between its last two points. Not where
    the beams meet a wall at too small an angle to tell its end from its meeting with the next.
    """
    n = ranges.size
    before, after = (i - 1) % n, (j + 1) % n
    if ranges[before] >= reach or ranges[after] >= reach:
        return False
    ax, ay, bx, by = px[i] - px[before], py[i] - py[before], px[j] - px[after], py[j] - py[after]
    if 9.0 * (ax * ax + ay * ay) > ranges[i] * ranges[i] or 9.0 * (bx * bx + by * by) > ranges[j] * ranges[j]:
        return False
    across = ax * by - ay * bx
    dx, dy = px[j] - px[i], py[j] - py[i]
    first, second = (dx * by - dy * bx) / across, (dx * ay - dy * ax) / across
    return bool(0.0 <= first <= 1.5 and 0.0 <= second <= 1.5)


@kernel
def link_beams(
    px: Floats,
    py: Floats,
    ranges: Floats,
    reach: float,
    jump: float,
    gap: float,
    noise: float,
    wraps: bool,
    link: Flags,
) -> None:
    """Which beams see one surface together with their next neighbour, into `link` (B,).

    They do when their ranges differ by at most `jump`, when nothing passes between their points, or when the walls
    beside them go on straight, to the other point or into a corner: at a small angle to a wall the ranges of neighbours
    differ by any amount.

    Args:
        px: points' x (B,) in the robot's frame [m], one for each beam.
        py: points' y (B,) [m].
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        jump: change of range that is one [m].
        gap: a distance that no disc passes [m].
        noise: standard deviation of the ranges [m].
        wraps: whether the last beam is the first one's neighbour.
        link: result (B,), whether beam i and beam i + 1 see one surface.
    """
    n = ranges.size
    for i in range(n):
        j = (i + 1) % n
        link[i] = False
        if ranges[i] >= reach or ranges[j] >= reach or (j == 0 and not wraps):
            continue
        if abs(ranges[i] - ranges[j]) <= jump or math.hypot(px[i] - px[j], py[i] - py[j]) <= gap:
            link[i] = True
        else:
            link[i] = (
                goes_on_straight(px, py, ranges, reach, jump, noise, i, 1)
                or goes_on_straight(px, py, ranges, reach, jump, noise, j, -1)
                or meet_in_corner(px, py, ranges, reach, i, j)
            )


@kernel
def fill_in(
    ranges: Floats, reach: float, spacing: float, error: float, gap: float, wraps: bool, filled: Floats
) -> None:
    """Ranges as they would be if beams that alone got no return from a wall had one.

    No disc passes between the points of such a beam's neighbours, or those and the next ones lie on one line. On a line
    the inverse ranges of three neighbours have no second difference, but for the curvature of the cosine.

    Args:
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        spacing: angle between two neighbouring beams [rad].
        error: how much a range may be off a line [m].
        gap: a distance that no disc passes [m].
        wraps: whether the last beam is the first one's neighbour.
        filled: result (B,) [m].
    """
    n, bend, twice = ranges.size, 2.0 * math.cos(spacing), math.cos(2.0 * spacing)
    for i in range(n):
        filled[i] = ranges[i]
        if ranges[i] < reach:
            continue
        before, after = max(ranges[(i - 1) % n], 1e-9), max(ranges[(i + 1) % n], 1e-9)
        if max(before, after) >= reach:
            continue
        between = bend * before * after / (before + after)
        is_end = i == 0 or i == n - 1
        apart = before * before + after * after - 2.0 * before * after * twice
        is_wall = apart <= gap * gap and (wraps or not is_end)
        if not is_wall and (wraps or 2 <= i < n - 2):
            earlier, later = max(ranges[(i - 2) % n], 1e-9), max(ranges[(i + 2) % n], 1e-9)
            is_wall = is_straight(before, earlier, between, bend, reach, error) and is_straight(
                after, later, between, bend, reach, error
            )
        if is_wall:
            filled[i] = between


@inlined
def is_straight(near: float, far: float, between: float, bend: float, reach: float, error: float) -> bool:
    """Whether three ranges, each a beam from the next, are of one line: `near` is the middle one."""
    return far < reach and abs(1.0 / far + 1.0 / between - bend / near) <= error / (near * between)


@inlined
def way_to_wall(along1: float, beside1: float, along2: float, beside2: float, radius: float) -> tuple[float, float]:
    """How far a disc goes until it touches the inside of a straight wall, and the share of the wall before that point.

    The ends of the wall are points of their own. The way is infinite where the disc touches them first, or nothing.
    """
    dx, dy = along2 - along1, beside2 - beside1
    length = math.hypot(dx, dy)
    # (nx, ny) is square to the wall and points ahead; `away` is the distance of the wall's line, negative behind.
    nx, ny = -dy / length, dx / length
    if nx < 0.0:
        nx, ny = -nx, -ny
    away = nx * along1 + ny * beside1
    way, reached = max((away - radius) / nx, 0.0), min(away, radius)
    share = ((way + reached * nx - along1) * dx + (reached * ny - beside1) * dy) / (length * length)
    if not (away > 0.0 and 0.0 < share < 1.0):
        return math.inf, share
    return way, share


@kernel
def tell_long_walls(px: Floats, py: Floats, link: Flags, radius: float, is_long: Flags) -> None:
    """Write whether each beam and the next (B,) see a wall so long between them that a disc could sink into it visibly."""
    for i in range(link.size):
        j = i + 1 if i + 1 < link.size else 0
        dx, dy = px[j] - px[i], py[j] - py[i]
        is_long[i] = link[i] and dx * dx + dy * dy > 0.0625 * radius * radius


@kernel
def sweep_disc(
    px: Floats,
    py: Floats,
    ranges: Floats,
    reach: float,
    is_long: Flags,
    radius: float,
    first: float,
    cos: Floats,
    sin: Floats,
    free: Floats,
    beam: Integers,
) -> None:
    """The scan in configuration space: how far a disc gets along each of the headings of a full circle.

    A wall goes on straight between linked beams, so that no disc slips through where the beams are sparse.

    Args:
        px: points' x (B,) in the robot's frame [m], one for each beam.
        py: points' y (B,) [m].
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        is_long: (B,) from `tell_long_walls`.
        radius: of the disc [m].
        first: heading 0, the others follow counter-clockwise [rad].
        cos: of each heading (m,).
        sin: of each heading (m,).
        free: result (m,), free way along each heading [m]; infinite where the disc touches nothing.
        beam: result (m,), the beam that saw what is touched, -1 for none.
    """
    n, m = ranges.size, free.size
    increment = 2.0 * math.pi / m
    free[:] = math.inf
    beam[:] = -1
    for i in range(n):
        if ranges[i] >= reach:
            continue
        x, y = px[i], py[i]
        half = math.asin(radius / ranges[i]) if ranges[i] > radius else 0.5 * math.pi
        middle = math.atan2(y, x) - first
        low, high = math.ceil((middle - half) / increment), math.floor((middle + half) / increment)
        k = low % m - 1
        for _ in range(high - low + 1):
            k = k + 1 if k + 1 < m else 0
            way = way_to_point(x * cos[k] + y * sin[k], y * cos[k] - x * sin[k], radius)
            if way < free[k]:
                free[k], beam[k] = way, i
        if not is_long[i]:
            continue
        j = (i + 1) % n
        u, v = px[j], py[j]
        half = max(half, math.asin(radius / ranges[j]) if ranges[j] > radius else 0.5 * math.pi)
        turn = math.atan2(x * v - y * u, x * u + y * v)
        low = math.ceil((middle + min(turn, 0.0) - half) / increment)
        high = math.floor((middle + max(turn, 0.0) + half) / increment)
        k = low % m - 1
        for _ in range(high - low + 1):
            k = k + 1 if k + 1 < m else 0
            along, beside = x * cos[k] + y * sin[k], y * cos[k] - x * sin[k]
            way, share = way_to_wall(along, beside, u * cos[k] + v * sin[k], v * cos[k] - u * sin[k], radius)
            if way < free[k]:
                free[k], beam[k] = way, i if share < 0.5 else j


@called
def beams_between(
    px: Floats,
    py: Floats,
    ranges: Floats,
    reach: float,
    is_long: Flags,
    radius: float,
    low: float,
    high: float,
    chosen: Integers,
) -> int:
    """Numbers of the beams whose points or walls a disc may touch along the headings from `low` to `high`.

    Args:
        px: points' x (B,) in the robot's frame [m], one for each beam.
        py: points' y (B,) [m].
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        is_long: (B,) from `tell_long_walls`.
        radius: of the disc [m].
        low: heading [rad].
        high: heading, a few degrees further at most [rad].
        chosen: result, as many numbers as are returned; room for (B,).
    """
    low_x, low_y, high_x, high_y = math.cos(low), math.sin(low), math.cos(high), math.sin(high)
    count = 0
    for i in range(ranges.size):
        if ranges[i] >= reach:
            continue
        above, below = py[i] * low_x - px[i] * low_y, py[i] * high_x - px[i] * high_y
        if is_long[i]:
            j = i + 1 if i + 1 < ranges.size else 0
            above = max(above, py[j] * low_x - px[j] * low_y)
            below = min(below, py[j] * high_x - px[j] * high_y)
        if above > -radius and below < radius:
            chosen[count] = i
            count += 1
    return count


@called
def touch_along(
    px: Floats, py: Floats, is_long: Flags, radius: float, angle: float, chosen: Integers, count: int
) -> tuple[float, int, float, float]:
    """What a disc touches first along a heading: free way, beam that saw it (-1 for none), x and y of the point.

    Only the first `count` beams of `chosen`, from `beams_between`, are looked at.
    """
    cos, sin = math.cos(angle), math.sin(angle)
    free, beam, x, y = math.inf, -1, 0.0, 0.0
    for c in range(count):
        i = chosen[c]
        along, beside = px[i] * cos + py[i] * sin, py[i] * cos - px[i] * sin
        way = way_to_point(along, beside, radius)
        if way < free:
            free, beam, x, y = way, i, px[i], py[i]
        if is_long[i]:
            j = i + 1 if i + 1 < px.size else 0
            way, share = way_to_wall(along, beside, px[j] * cos + py[j] * sin, py[j] * cos - px[j] * sin, radius)
            if way < free:
                free, beam = way, i if share < 0.5 else j
                x, y = px[i] + share * (px[j] - px[i]), py[i] + share * (py[j] - py[i])
    return free, beam, x, y


@called
def is_one_surface(link: Flags, i: int, j: int) -> bool:
    """Whether beams i and j see one surface: all neighbours between them, the shorter way round, are linked."""
    n = link.size
    if i < 0 or j < 0:
        return False
    ahead = (j - i) % n
    begin, count = (i, ahead) if 2 * ahead <= n else (j, n - ahead)
    linked = 0
    while linked < count and link[(begin + linked) % n]:
        linked += 1
    return bool(linked == count)


@called
def farthest_end(
    px: Floats, py: Floats, ranges: Floats, link: Flags, noise: float, wraps: bool, last: int, way: int
) -> tuple[float, float]:
    """Up to where a wall may go on unseen whose last point in sight is that of a beam, counted in the direction `way`.

    That is where it would meet the next beam, which has missed it: at a small angle to a wall, far away. As far as three
    times the noise of the two ranges that foretell it.
    """
    n = ranges.size
    before, after = (last - way) % n, (last + way) % n
    behind, ahead = (before, last) if way > 0 else (last, after)
    is_edge = not wraps and not 0 <= last + way < n
    if is_edge or link[ahead] or not link[behind]:
        return px[last], py[last]
    u, v = 1.0 / ranges[before], 1.0 / ranges[last]
    bend = 2.0 * (px[before] * px[last] + py[before] * py[last]) * u * v
    least = bend * v - u - 3.0 * noise * math.sqrt(u**4 + 4.0 * v**4)
    share = 1.0 / max(least * ranges[after], 1.0)
    return share * px[after], share * py[after]


@kernel
def find_open_points(  # plain tuples: records handed over from Python cost as much as a tenth of the work
    scan: tuple[Floats, Floats, Floats, Flags, Flags],
    reach: float,
    noise: float,
    wraps: bool,
    radius: float,
    first: float,
    swept: tuple[Floats, Integers],
    jump: float,
    chosen: Integers,
    found: Floats,
    side: Integers,
) -> int:
    """Where the free way of a disc jumps between neighbouring headings, from one surface to another or to none.

    Args:
        scan: of each beam (B,) the point's x and y in the robot's frame [m], the range [m], the link of `link_beams` and
            what `tell_long_walls` says.
        reach: range that means "nothing seen" [m].
        noise: standard deviation of the ranges [m].
        wraps: whether the last beam is the first one's neighbour.
        radius: of the disc [m].
        first: heading 0 [rad].
        swept: from `sweep_disc`, the free way along each heading (m,) [m] and the beam that saw what ends it (m,).
        jump: change of the free way that is one [m].
        chosen: scratch (B,).
        found: result (m, 5): the heading where the nearer surface ends, counted from heading 0 [rad], x and y of the
            point touched there, and of the `farthest_end` [m].
        side: result (m,), +1 where the nearer surface ends counter-clockwise, -1 where it ends clockwise.

    Returns:
        How many there are, in the order of the headings.
    """
    px, py, ranges, link, is_long = scan
    free, beam = swept
    count = 0
    increment = 2.0 * math.pi / free.size
    for k in range(free.size):
        after = (k + 1) % free.size
        change = free[after] - free[k]
        if not abs(change) > jump or is_one_surface(link, beam[k], beam[after]):
            continue
        inside, outside = k * increment, (k + 1) * increment
        seen = beams_between(px, py, ranges, reach, is_long, radius, first + inside, first + outside, chosen)
        surface = beam[k]
        if change < 0.0:
            inside, outside, surface = outside, inside, beam[after]
        _, last, x, y = touch_along(px, py, is_long, radius, first + inside, chosen, seen)
        # Headings are coarse: at a small angle to a wall the disc touches it far before its end.
        for _ in range(8):
            middle = 0.5 * (inside + outside)
            _, touched, touched_x, touched_y = touch_along(px, py, is_long, radius, first + middle, chosen, seen)
            if is_one_surface(link, surface, touched):
                inside, last, x, y = middle, touched, touched_x, touched_y
            else:
                outside = middle
        side[count] = 1 if change > 0.0 else -1
        found[count, 0], found[count, 1], found[count, 2] = inside, x, y
        found[count, 3], found[count, 4] = x, y
        if last >= 0:
            found[count, 3:] = farthest_end(px, py, ranges, link, noise, wraps, last, side[count])
        count += 1
    return count


@kernel
def look_round(
    seen: Floats,
    directions: Floats,
    scanner: tuple[float, float, float, bool],
    disc: tuple[float, float, float],
    axes: tuple[Floats, Floats],
    scan: tuple[Floats, Floats, Floats, Flags, Flags],
    swept: tuple[Floats, Integers],
    chosen: Integers,
    found: Floats,
    side: Integers,
) -> int:
    """The open points of a scan, beams that alone got no return filled in, in one call.

    Args:
        seen: ranges (B,) [m].
        directions: of the beams (2, B).
        scanner: range that means "nothing seen" [m], standard deviation of the ranges [m], angle between two neighbouring
            beams [rad], whether the last is the first one's neighbour.
        disc: its radius [m], the change that is a jump [m], and heading 0 [rad].
        axes: scratch for the cosine and sine of each heading (m,).
        scan: result, see `find_open_points`.
        swept: result, of `sweep_disc`.
        chosen, found, side: see `find_open_points`.

    Returns:
        How many there are.
    """
    reach, noise, spacing, wraps = scanner
    radius, jump, first = disc
    x, y, ranges, link, is_long = scan
    fill_in(seen, reach, spacing, 3.0 * noise + 0.2 * jump, 2.0 * radius, wraps, ranges)
    for i in range(ranges.size):
        x[i], y[i] = directions[0, i] * ranges[i], directions[1, i] * ranges[i]
    link_beams(x, y, ranges, reach, jump, 2.0 * radius, noise, wraps, link)
    tell_long_walls(x, y, link, radius, is_long)
    for k in range(axes[0].size):
        axes[1][k], axes[0][k] = sin_cos(first + k * (2.0 * math.pi / axes[0].size))
    sweep_disc(x, y, ranges, reach, is_long, radius, first, axes[0], axes[1], swept[0], swept[1])
    return find_open_points(scan, reach, noise, wraps, radius, first, swept, jump, chosen, found, side)
