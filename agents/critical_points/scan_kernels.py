"""Compiled reading of a scan for critical points: dropouts, legs and gaps, turns, and capsules cast into the scan."""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.free_way import way_to_point
from bug_gym.kernels.layout import Floats, Integers


@kernel
def bridge_dropouts(ranges: Floats, reach: float, jump: float, most: int, wraps: bool, filled: Floats) -> None:
    """Fill in beams without a return where at most `most` in a row lie between hits of like range [m].

    Args:
        ranges: the scan (B,) [m].
        reach: range that means "nothing seen" [m].
        jump: hits whose ranges differ by less may be of one surface [m].
        most: beams in a row.
        wraps: whether the last beam is the first one's neighbour.
        filled: result (B,) [m].
    """
    n = ranges.size
    for i in range(n):
        filled[i] = ranges[i]
    for i in range(n):
        if ranges[i] >= reach or ranges[(i + 1) % n] < reach:
            continue
        count = 1
        while count <= most and ranges[(i + count) % n] >= reach:
            count += 1
        if count > most + 1 or (not wraps and i + count >= n):
            continue
        after = ranges[(i + count) % n]
        if after >= reach or abs(after - ranges[i]) > jump:
            continue
        for k in range(1, count):
            filled[(i + k) % n] = ranges[i] + (after - ranges[i]) * k / count


@inlined
def least_gap_across(
    px: Floats,
    py: Floats,
    x: float,
    y: float,
    cos: float,
    sin: float,
    length: float,
    width: float,
    left: Integers,
    right: Integers,
) -> float:
    """The least distance, below `width`, of a point to the left and one to the right whose chord crosses the leg [m]."""
    gap = width
    for a in range(left.size):
        i = left[a]
        along = (px[i] - x) * cos + (py[i] - y) * sin
        beside = (py[i] - y) * cos - (px[i] - x) * sin
        for b in range(right.size):
            j = right[b]
            dx, dy = px[j] - px[i], py[j] - py[i]
            if dx * dx + dy * dy >= gap * gap:
                continue
            share = beside / (dx * sin - dy * cos)
            crossing = along + share * (dx * cos + dy * sin)
            if 0.0 <= crossing <= length:
                gap = math.sqrt(dx * dx + dy * dy)
    return gap


@kernel
def sweep_leg(
    px: Floats,
    py: Floats,
    x: float,
    y: float,
    heading: float,
    length: float,
    radius: float,
    width: float,
    left: Integers,
    right: Integers,
) -> tuple[float, float, int]:
    """How far a disc gets along a leg [m], the least gap across the leg [m], and the point that ends the way.

    The gap S_d is the least distance of two points, one to each side, whose chord crosses the leg.

    Args:
        px: scan points' x (k,) [m].
        py: scan points' y (k,) [m].
        x: where the leg begins [m].
        y: the same [m].
        heading: of the leg [rad].
        length: of the leg [m].
        radius: of the disc [m].
        width: gaps of this and more are not looked for [m].
        left: scratch (k,).
        right: scratch (k,).

    Returns:
        The free way, infinite where nothing is touched; the gap, infinite where it is not below `width`; the number of
        the point that is touched first, -1 for none.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    free, touched, lefts, rights = math.inf, -1, 0, 0
    for i in range(px.size):
        along = (px[i] - x) * cos + (py[i] - y) * sin
        beside = (py[i] - y) * cos - (px[i] - x) * sin
        way = way_to_point(along, beside, radius)
        if way < free:
            free, touched = way, i
        if abs(beside) >= width or along <= -width or along >= length + width:
            continue
        if beside > 0.0:
            left[lefts] = i
            lefts += 1
        elif beside < 0.0:
            right[rights] = i
            rights += 1
    gap = least_gap_across(px, py, x, y, cos, sin, length, width, left[:lefts], right[:rights])
    return free, gap if gap < width else math.inf, touched


@kernel
def can_turn(px: Floats, py: Floats, ahead: float, left: float, heading: float, radius: float) -> bool:
    """Whether a disc about (ahead, left) may swing about the origin by `heading` [rad].

    A point that the disc holds or nears already does not bar it from turning away.
    """
    arm, first = math.hypot(ahead, left), math.atan2(left, ahead)
    low, high = min(heading, 0.0), max(heading, 0.0)
    for i in range(px.size):
        distance = math.hypot(px[i], py[i])
        if distance >= arm + radius:
            continue
        turned = (math.atan2(py[i], px[i]) - first + math.pi) % (2.0 * math.pi) - math.pi
        now = math.hypot(px[i] - ahead, py[i] - left)
        least = now
        for shift in (-2.0 * math.pi, 0.0, 2.0 * math.pi):
            if low <= turned + shift <= high:
                least = min(least, abs(distance - arm))
        cos, sin = math.cos(heading), math.sin(heading)
        at_end = math.hypot(px[i] - (cos * ahead - sin * left), py[i] - (sin * ahead + cos * left))
        least = min(least, at_end)
        if least < radius and least < now - 1e-6:
            return False
    return True


@inlined
def way_to_disc(cos: float, sin: float, x: float, y: float, radius: float) -> float:
    """How far a ray goes until it meets a disc from outside [m]; infinite where it does not."""
    along = x * cos + y * sin
    room = radius * radius - (x * x + y * y - along * along)
    if along <= 0.0 or room <= 0.0:
        return math.inf
    way = along - math.sqrt(room)
    return way if way >= 0.0 else math.inf


@inlined
def way_to_side(cos: float, sin: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """How far a ray goes until it crosses a straight line between two places [m]; infinite where it does not."""
    dx, dy = x1 - x0, y1 - y0
    across = cos * dy - sin * dx
    if across == 0.0:
        return math.inf
    way, share = (x0 * dy - y0 * dx) / across, (x0 * sin - y0 * cos) / across
    return way if way >= 0.0 and 0.0 <= share <= 1.0 else math.inf


@called
def way_to_capsule(cos: float, sin: float, x0: float, y0: float, x1: float, y1: float, radius: float) -> float:
    """How far a ray from outside goes until it meets all that is nearer than `radius` to a straight line [m]."""
    way = min(way_to_disc(cos, sin, x0, y0, radius), way_to_disc(cos, sin, x1, y1, radius))
    length = math.hypot(x1 - x0, y1 - y0)
    if length > 0.0:
        nx, ny = -radius * (y1 - y0) / length, radius * (x1 - x0) / length
        way = min(way, way_to_side(cos, sin, x0 + nx, y0 + ny, x1 + nx, y1 + ny))
        way = min(way, way_to_side(cos, sin, x0 - nx, y0 - ny, x1 - nx, y1 - ny))
    return way


@kernel
def cast_capsule(
    cos: Floats,
    sin: Floats,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    radius: float,
    number: int,
    ranges: Floats,
    owner: Integers,
) -> None:
    """Put a capsule, all that is nearer than `radius` [m] to a straight line, into a scan.

    Args:
        cos: directions of the beams (B,).
        sin: the same.
        x0: where the line begins, robot's frame [m].
        y0: the same [m].
        x1: where it ends [m].
        y1: the same [m].
        radius: of the capsule [m].
        number: of the capsule.
        ranges: the scan (B,) [m], shortened in place.
        owner: `number` where a beam now ends at the capsule (B,), in place.
    """
    for i in range(ranges.size):
        way = way_to_capsule(cos[i], sin[i], x0, y0, x1, y1, radius)
        if way < ranges[i]:
            ranges[i], owner[i] = way, number
