"""The contour ahead: where a robot that follows a wall will come, as its present scan shows the wall.

The rule of boundary following (walls.headings), step by step on one scan: from the last heading turned toward the wall, away
from it until a step ends at the clearance.
"""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.free_way import nearest_point
from bug_gym.kernels.layout import Floats

TRIED = math.radians(8.0)
"""Angle between the headings tried [rad]; the first open one is refined."""

REFINED = 4
"""How often it is halved."""

MOST_INWARD = math.radians(110.0)
"""Turning toward the wall after which the contour ahead is only guessed: the wall there is out of sight [rad]."""

APART = 0.5
"""Two points no farther apart than this, in halves of the width of a gap, and a step are of one wall."""

TURNED_ASIDE = math.radians(60.0)
"""Turn in one step at which the contour may pass a gap that is just too narrow (walls.headings) [rad]."""


@inlined
def is_clear(px: Floats, py: Floats, x: float, y: float, square: float) -> bool:
    """Whether no point lies nearer to a place than the root of `square`."""
    for i in range(px.size):
        dx, dy = px[i] - x, py[i] - y
        if dx * dx + dy * dy < square:
            return False
    return True


FACING = math.cos(math.radians(150.0))
"""Cosine of the angle from which on two points stand on either side of a place."""


@inlined
def is_tight(px: Floats, py: Floats, x: float, y: float, nearest: int, reach: float) -> bool:
    """Whether things stand on either side of a place, both within `reach` of it [m]: the nearest one, and one facing it."""
    if nearest < 0:
        return False
    nx, ny = px[nearest] - x, py[nearest] - y
    least = nx * nx + ny * ny
    if least >= reach * reach:
        return False
    for i in range(px.size):
        dx, dy = px[i] - x, py[i] - y
        square = dx * dx + dy * dy
        if square < reach * reach and nx * dx + ny * dy < FACING * math.sqrt(least * square):
            return True
    return False


@inlined
def turn_until_clear(
    px: Floats, py: Floats, x: float, y: float, heading: float, side: int, step: float, back: float, square: float
) -> float:
    """Turning away from the wall, from `-back` on, after which a step from (x, y) ends clear; above pi: none does."""
    low, high = -back, -back
    while high < math.pi:
        angle = heading + side * high
        if is_clear(px, py, x + step * math.cos(angle), y + step * math.sin(angle), square):
            break
        low, high = high, high + TRIED
    if low < high < math.pi:
        for _ in range(REFINED):
            middle = 0.5 * (low + high)
            angle = heading + side * middle
            if is_clear(px, py, x + step * math.cos(angle), y + step * math.sin(angle), square):
                high = middle
            else:
                low = middle
    return high


@inlined
def are_joined(px: Floats, py: Floats, one: int, other: int, near: float, apart: float) -> bool:
    """Whether two points are of one wall, as far as is seen: near [m], or with no gap so far apart [m] between them."""
    if one < 0 or other < 0 or math.hypot(px[other] - px[one], py[other] - py[one]) <= near:
        return True
    for way in (1, -1):
        i = one
        while i != other:
            j = (i + way) % px.size
            if math.hypot(px[j] - px[i], py[j] - py[i]) > apart:
                break
            i = j
        if i == other:
            return True
    return False


@kernel
def contour_ahead(
    px: Floats,
    py: Floats,
    start: tuple[float, float, float],
    side: int,
    step: float,
    clearance: float,
    inner: float,
    places: Floats,
) -> int:
    """Places along the contour, the first of them where it starts, into `places` (m, 3); how many there are.

    Args:
        px, py: the scan's points (k,) in the robot's frame [m].
        start: where the contour is gone along from [m], and the heading there [rad].
        side: +1 with the wall on the right, -1 on the left.
        step: length of a step [m].
        clearance: distance to the wall at which a step ends [m].
        inner: half the width of gaps that count [m]: before one that is narrower than twice the clearance it ends, as before
            every passage that is hardly wider, where which of its sides the hand is on must not be in doubt; and where the
            hand comes to what stands apart from the wall that it is on, however narrow the gap between them is.
        places: (m, 3) x, y [m] and the heading there [rad].
    """
    x, y, heading = start
    hand = nearest_point(px, py, x, y)
    places[0, 0], places[0, 1], places[0, 2] = x, y, heading
    # Round a point a step turns by so much.
    back = 2.0 * math.asin(min(0.5 * step / clearance, 1.0))
    inward = 0.0
    for count in range(1, len(places)):
        turn = turn_until_clear(px, py, x, y, heading, side, step, back, clearance * clearance)
        if turn > TURNED_ASIDE:
            narrow = turn_until_clear(px, py, x, y, heading, side, step, back, inner * inner)
            if turn >= math.pi or turn - narrow > TURNED_ASIDE:
                return count
        heading += side * turn
        inward -= turn
        if inward > MOST_INWARD:
            return count
        x, y = x + step * math.cos(heading), y + step * math.sin(heading)
        after = nearest_point(px, py, x, y)
        if is_tight(px, py, x, y, after, clearance + step):
            return count
        if not are_joined(px, py, hand, after, APART * inner + step, 2.0 * inner):
            return count
        hand = after
        places[count, 0], places[count, 1], places[count, 2] = x, y, heading
    return len(places)
