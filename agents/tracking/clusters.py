"""A scan cut into clusters: runs of neighbouring hits on one surface, and what ends each of them."""

from __future__ import annotations

import math

from bug_gym.agents.tracking.layout import ANGLE_STEP, IS_FULL_CIRCLE, NOISE, RANGE, Hits, Scan
from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Flags, Floats, Integers

JUMP = 0.1  # ranges that differ by more, for their noise and spacing, are of two surfaces [m]
CUSP, CUSP_NOISES = 0.05, 2.0  # so far behind its neighbours, and noises of a range, lies where two things meet [m]
NEIGHBOURS = 0.4  # which these are: as far as this from it [m]
BULGE = 0.03  # by how much of its length a round thing stands out toward the scanner
LEAST_PIECE = 3  # hits
OPEN_END = 0.3  # a cluster that ends this near to the end of what is in range may go on there [m]


@inlined
def is_one_surface(ranges: Floats, is_hit: Flags, i: int, settings: Floats) -> bool:
    """Whether beam i and the one before it saw the same surface.

    They did where their ranges differ little for their distance from one another, or where the line through the two
    hits on one side leads to the hit on the other: on a line, 1 / range is a sinusoid of the angle.
    """
    beams = len(ranges)
    h = i - 1 if i > 0 else beams - 1
    if not (is_hit[i] and is_hit[h]):
        return False
    near = min(ranges[i], ranges[h])
    spacing = near * settings[ANGLE_STEP]
    if abs(ranges[i] - ranges[h]) <= JUMP + 3.0 * settings[NOISE] + spacing:
        return True
    slack = JUMP + 3.0 * settings[NOISE] + 0.5 * spacing
    g = h - 1 if h > 0 else beams - 1
    j = i + 1 if i + 1 < beams else 0
    twice = 2.0 * math.cos(settings[ANGLE_STEP])
    if is_hit[g] and ranges[g] > 0.0 and ranges[h] > 0.0:
        inverse = twice / ranges[h] - 1.0 / ranges[g]
        if inverse > 0.0 and abs(1.0 / inverse - ranges[i]) <= slack:
            return True
    if is_hit[j] and ranges[j] > 0.0 and ranges[i] > 0.0:
        inverse = twice / ranges[i] - 1.0 / ranges[j]
        if inverse > 0.0 and abs(1.0 / inverse - ranges[h]) <= slack:
            return True
    return False


@inlined
def first_cut(scan: Scan) -> int:
    """A beam at which a full circle may begin so that no cluster is cut by its first beam; 0 where there is none."""
    beams = len(scan.ranges)
    for i in range(beams):
        h = i - 1 if i > 0 else beams - 1
        if scan.owner[i] < 0 and scan.owner[h] < 0 and not is_one_surface(scan.ranges, scan.is_hit, i, scan.settings):
            return i
    return 0


@called
def cut_clusters(scan: Scan, members: Integers, begins: Integers) -> int:
    """Cut the unclaimed hits into clusters; returns how many.

    Cluster k is beams members[begins[k] : begins[k + 1]], counter-clockwise.
    """
    ranges, is_hit, owner, settings = scan.ranges, scan.is_hit, scan.owner, scan.settings
    beams = len(ranges)
    is_full = settings[IS_FULL_CIRCLE] > 0.0
    first = first_cut(scan) if is_full else 0
    clusters, filled = 0, 0
    begins[0] = 0
    for step in range(beams):
        i = first + step if first + step < beams else first + step - beams
        if not is_hit[i] or owner[i] >= 0:
            continue
        h = i - 1 if i > 0 else beams - 1
        joins = filled > begins[clusters] and step > 0 and (i > 0 or is_full)
        if joins and members[filled - 1] == h and is_one_surface(ranges, is_hit, i, settings):
            members[filled] = i
            filled += 1
            continue
        if filled > begins[clusters]:
            clusters += 1
            begins[clusters] = filled
        members[filled] = i
        filled += 1
    if filled > begins[clusters]:
        clusters += 1
        begins[clusters] = filled
    return clusters


@inlined
def behind(hits: Hits, first: int, k: int, last: int) -> float:
    """How far hit k lies behind the line from hit `first` to hit `last`, as the scanner sees it [m]; before it: below 0."""
    x, y, members = hits.x, hits.y, hits.members
    ax, ay = x[members[first]], y[members[first]]
    dx, dy = x[members[last]] - ax, y[members[last]] - ay
    length = math.hypot(dx, dy)
    if length < 1e-6:
        return 0.0
    aside = (dx * (y[members[k]] - ay) - dy * (x[members[k]] - ax)) / length
    scanner = (dy * ax - dx * ay) / length
    return float(-aside if scanner > 0.0 else aside)


@inlined
def is_round(hits: Hits, begin: int, end: int) -> bool:
    """Whether hits bulge toward the scanner, as those on a round thing do."""
    x, y, members = hits.x, hits.y, hits.members
    first, last = members[begin], members[end - 1]
    length = math.hypot(x[last] - x[first], y[last] - y[first])
    total = 0.0
    for k in range(begin + 1, end - 1):
        total -= behind(hits, begin, k, end - 1)
    return total / max(end - begin - 2, 1) >= BULGE * length


@inlined
def cusp_of(hits: Hits, begin: int, end: int) -> int:
    """Where two round things meet in a cluster: the hit that lies farthest behind its neighbours; -1: nowhere."""
    x, y, members = hits.x, hits.y, hits.members
    deepest, place = CUSP + CUSP_NOISES * hits.settings[NOISE], -1
    first, last = begin, begin
    for k in range(begin + LEAST_PIECE - 1, end - LEAST_PIECE + 1):
        px, py = x[members[k]], y[members[k]]
        while first < k - 1 and math.hypot(x[members[first + 1]] - px, y[members[first + 1]] - py) >= NEIGHBOURS:
            first += 1
        last = max(last, k + 1)
        while last < end - 1 and math.hypot(x[members[last]] - px, y[members[last]] - py) < NEIGHBOURS:
            last += 1
        depth = behind(hits, first, k, last)
        if depth > deepest:
            deepest, place = depth, k
    if place >= 0 and is_round(hits, begin, place + 1) and is_round(hits, place, end):
        return place
    return -1


@called
def split_clusters(hits: Hits, begins: Integers, count: int) -> int:
    """Cut clusters of several round things that touch where these meet; returns how many there are now."""
    c = 0
    while c < count:
        place = cusp_of(hits, begins[c], begins[c + 1])
        if place < 0:
            c += 1
            continue
        for k in range(count, c, -1):
            begins[k + 1] = begins[k]
        begins[c + 1] = place
        count += 1
    return count


@inlined
def extent_of(hits: Hits, begin: int, end: int) -> float:
    """Diagonal of the box about a cluster's hits [m]."""
    x, y, members = hits.x, hits.y, hits.members
    left, right = x[members[begin]], x[members[begin]]
    low, high = y[members[begin]], y[members[begin]]
    for k in range(begin + 1, end):
        left, right = min(left, x[members[k]]), max(right, x[members[k]])
        low, high = min(low, y[members[k]]), max(high, y[members[k]])
    return math.hypot(right - left, high - low)


@inlined
def edge_kind(ranges: Floats, beam: int, step: int, settings: Floats) -> int:
    """What ends a cluster at `beam`: 1 its own outline, 0 another thing before it, -1 the end of what is in range."""
    beams = len(ranges)
    after = beam + step
    if after < 0 or after >= beams:
        if settings[IS_FULL_CIRCLE] == 0.0:
            return -1
        after = after % beams
    if ranges[after] >= settings[RANGE]:
        return 1 if ranges[beam] < settings[RANGE] - OPEN_END else -1
    return 1 if ranges[after] > ranges[beam] + JUMP else 0


@inlined
def edges_of(hits: Hits, begin: int, end: int) -> tuple[int, int]:
    """`edge_kind` of the last and of the first beam of a cluster: what ends it on its left and on its right."""
    left = edge_kind(hits.ranges, hits.members[end - 1], 1, hits.settings)
    return left, edge_kind(hits.ranges, hits.members[begin], -1, hits.settings)
