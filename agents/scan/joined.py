"""Scan points joined to chains, and what of the plane is seen free (VisBug)."""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.free_way import free_distance
from bug_gym.kernels.layout import Floats


@inlined
def next_beam(i: int, way: int, beams: int, is_round: bool) -> int:
    """Number of the beam beside beam i, after it (way 1) or before it (-1); -1: none."""
    j = i + way
    if 0 <= j < beams:
        return j
    return j % beams if is_round else -1


@kernel
def join_scan(
    ranges: Floats,
    cos: Floats,
    sin: Floats,
    reach: float,
    is_round: bool,
    gap: float,
    spacing: float,
    px: Floats,
    py: Floats,
) -> tuple[int, int]:
    """Scan points, and between neighbours at most `gap` apart points of the straight line that joins them.

    After them come, for each point beside which the scan sees past its wall, the place in the neighbouring beam up to
    which that wall may go on unseen.

    Args:
        ranges: ranges (b,) of the beams in their order [m].
        cos: of the beams' angles (b,).
        sin: of the beams' angles (b,).
        reach: range that means "nothing" [m].
        is_round: whether the last beam is the first one's neighbour.
        gap: what is nearer together is one wall [m].
        spacing: largest distance between points of one wall [m].
        px: result, points' x in the robot's frame [m]; room for b (3 + gap / spacing).
        py: result, points' y [m].

    Returns:
        How many points of walls there are, and how many with the places after them.
    """
    count = 0
    for i in range(ranges.size):
        if ranges[i] >= reach:
            continue
        px[count], py[count] = ranges[i] * cos[i], ranges[i] * sin[i]
        count += 1
        j = next_beam(i, 1, ranges.size, is_round)
        if j < 0 or ranges[j] >= reach:
            continue
        x, y = px[count - 1], py[count - 1]
        dx, dy = ranges[j] * cos[j] - x, ranges[j] * sin[j] - y
        length = math.hypot(dx, dy)
        if length > gap:
            continue
        pieces = int(length / spacing) + 1
        for k in range(1, pieces):
            px[count], py[count] = x + k * dx / pieces, y + k * dy / pieces
            count += 1
    total = count
    for i in range(ranges.size):
        for way in (-1, 1):
            j = next_beam(i, way, ranges.size, is_round)
            if j < 0 or ranges[j] <= ranges[i]:
                continue
            dx, dy = ranges[j] * cos[j] - ranges[i] * cos[i], ranges[j] * sin[j] - ranges[i] * sin[i]
            if ranges[j] >= reach or math.hypot(dx, dy) > gap:
                px[total], py[total] = ranges[i] * cos[j], ranges[i] * sin[j]
                total += 1
    return count, total


@called
def is_seen_free(
    x: float,
    y: float,
    ranges: Floats,
    first_angle: float,
    angle_step: float,
    is_round: bool,
    px: Floats,
    py: Floats,
    radius: float,
) -> bool:
    """Whether a disc of `radius` can go straight to a place (robot's frame) through space that the scan has seen.

    `px`, `py` are the points in its way. Both beams beside the place must reach as far as it: a disc may fit between
    two points of a wall seen at a low angle.
    """
    distance = math.hypot(x, y)
    angle = math.atan2(y, x)
    beam = ((angle - first_angle) % (2.0 * math.pi)) / angle_step
    i = int(beam)
    j = i + 1
    if is_round:
        i, j = i % ranges.size, j % ranges.size
    elif j >= ranges.size:
        return False
    if min(ranges[i], ranges[j]) < distance:
        return False
    return free_distance(px, py, angle, radius, distance) >= distance


@kernel
def first_seen_free(
    place: tuple[float, float],
    stride: tuple[float, float],
    count: int,
    reach: float,
    ranges: Floats,
    first_angle: float,
    angle_step: float,
    is_round: bool,
    px: Floats,
    py: Floats,
    radius: float,
) -> int:
    """Number k of the first of `count` places, `place` + k `stride`, within `reach` that `is_seen_free`, or -1."""
    for k in range(count):
        ex, ey = place[0] + k * stride[0], place[1] + k * stride[1]
        if math.hypot(ex, ey) <= reach and is_seen_free(
            ex, ey, ranges, first_angle, angle_step, is_round, px, py, radius
        ):
            return k
    return -1
