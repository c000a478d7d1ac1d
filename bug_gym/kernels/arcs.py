"""How far a disc can turn along an arc among the points of a scan.

For policies, as `free_way`: `px`, `py` (k,) are the scan's points in the robot's frame. Nothing here sees the world.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Floats


@inlined
def arc_to(along: float, beside: float) -> tuple[float, float]:
    """Radius [m] and turn [rad] of the arc that begins along x and leads to a place, so far ahead and so far to the left.

    Straight on is an arc of a large radius, whose length is the way there: bend times turn. `beside` is not negative (an
    arc to the right is one to the left, mirrored), and the place is not where the arc begins.
    """
    square = along * along + beside * beside
    off = max(beside, 1e-6 * square)
    return 0.5 * square / off, 2.0 * math.atan2(off, along)


@inlined
def turn_to_point(along: float, beside: float, bend: float, radius: float) -> float:
    """How far a disc turns on a left arc about (0, bend) until it touches a point [rad]; infinite: it never does.

    A point that it touches already blocks it unless it goes away from it, as on a straight way (free_way.way_to_point).
    """
    if along * along + beside * beside <= radius * radius:
        return 0.0 if along > 0.0 or beside > bend else math.inf
    away = math.hypot(along, beside - bend)
    if abs(away - bend) >= radius or away == 0.0:
        return math.inf
    # The arc's centre, the point and the disc's centre at contact: a triangle of sides `away`, `bend` and `radius`.
    spread = math.acos(min(max((away * away + bend * bend - radius * radius) / (2.0 * away * bend), -1.0), 1.0))
    place = math.atan2(along, bend - beside)
    turn = place - spread
    return turn if turn >= 0.0 else turn + 2.0 * math.pi


@kernel
def free_turn(px: Floats, py: Floats, bend: float, side: int, radius: float, most: float) -> float:
    """How far a disc can turn on an arc before it touches a scan point, at most `most` [rad].

    Args:
        px, py: the points (k,) [m]; the disc's centre is at the origin and goes ahead along x.
        bend: radius of the arc [m], above 0.
        side: +1 to the left, -1 to the right.
        radius: of the disc [m].
        most: the turn that is asked for [rad].
    """
    free = most
    # A point farther from the arc's centre or nearer to it is passed without looking at its bearing.
    inner, outer = max(bend - radius, 0.0), bend + radius
    inner, outer = inner * inner, outer * outer
    for i in range(px.size):
        beside = side * py[i]
        square = px[i] * px[i] + (beside - bend) * (beside - bend)
        if square <= inner or square >= outer:
            continue
        free = min(free, turn_to_point(px[i], beside, bend, radius))
    return free


@called
def sample_chain(chain: Floats, spacing: float, samples: Floats) -> int:
    """Places every `spacing` metres along a chain of places (k, 2), into `samples` (m, 2); how many there are."""
    count, left = 0, spacing
    for i in range(len(chain) - 1):
        ax, ay = chain[i, 0], chain[i, 1]
        dx, dy = chain[i + 1, 0] - ax, chain[i + 1, 1] - ay
        length = math.hypot(dx, dy)
        while left <= length and count < len(samples):
            share = left / length
            samples[count, 0], samples[count, 1] = ax + share * dx, ay + share * dy
            count += 1
            left += spacing
        left -= length
    if count < len(samples):
        last = len(chain) - 1  # kernels' indices do not count from the end
        samples[count, 0], samples[count, 1] = chain[last, 0], chain[last, 1]
        count += 1
    return count


@inlined
def is_beside(samples: Floats, count: int, bend: float, side: int, aside: float) -> bool:
    """Whether so many samples lie no farther than `aside` [m] from an arc."""
    for i in range(count):
        if abs(math.hypot(samples[i, 0], side * samples[i, 1] - bend) - bend) > aside:
            return False
    return True


@kernel
def pursue(
    px: Floats,
    py: Floats,
    chain: Floats,
    spacing: float,
    samples: Floats,
    speed: float,
    turn_rate: float,
    radius: float,
    aside: float,
    least_bend: float,
) -> tuple[float, float]:
    """The speed [m/s] and the signed bend [m] of the fastest free arc to a place of the chain; speed 0: there is none.

    Pure pursuit (Coulter 1992), the place looked ahead to chosen anew each time: of those to which the arc is free and
    close to the chain, the farthest that can be driven to at full speed, else the one that can be fastest.

    Args:
        px, py: the scan's points (k,) in the robot's frame [m].
        chain: places (k, 2) to come, the robot's own first [m].
        spacing: of the places tried along it [m].
        samples: (m, 2) room for them.
        speed: the greatest [m/s].
        turn_rate: the greatest [rad/s].
        radius: of the disc that must not touch a point [m].
        aside: how far the chain may lie beside the arc [m].
        least_bend: radius of the sharpest arc [m].
    """
    count = sample_chain(chain, spacing, samples)
    best, best_bend = 0.0, math.inf
    for i in range(count - 1, -1, -1):
        x, y = samples[i, 0], samples[i, 1]
        if x <= 0.0:
            continue
        side = 1 if y >= 0.0 else -1
        bend, turn = arc_to(x, abs(y))
        fastest = min(speed, turn_rate * bend)
        if fastest <= best or bend < least_bend or not is_beside(samples, i, bend, side, aside):
            continue
        if free_turn(px, py, bend, side, radius, turn) < turn:
            continue
        best, best_bend = fastest, side * bend
        if best == speed:
            break
    return best, best_bend


@inlined
def angle_between(first: float, second: float) -> float:
    """How far two directions lie apart [rad]."""
    apart = abs(first - second) % (2.0 * math.pi)
    return min(apart, 2.0 * math.pi - apart)


@inlined
def is_arc_free(
    px: Floats,
    py: Floats,
    x: float,
    y: float,
    cos: float,
    sin: float,
    bend: float,
    side: int,
    radius: float,
    turn: float,
) -> bool:
    """Whether a disc turns on an arc from (x, y) along (cos, sin) without touching a point; see free_turn."""
    inner, outer = max(bend - radius, 0.0), bend + radius
    inner, outer = inner * inner, outer * outer
    for i in range(px.size):
        dx, dy = px[i] - x, py[i] - y
        along, beside = cos * dx + sin * dy, side * (cos * dy - sin * dx)
        square = along * along + (beside - bend) * (beside - bend)
        if inner < square < outer and turn_to_point(along, beside, bend, radius) < turn:
            return False
    return True


@inlined
def place_before(samples: Floats, index: int) -> tuple[float, float]:
    """The place of a chain before another; before the first one the robot's own."""
    if index > 0:
        return samples[index - 1, 0], samples[index - 1, 1]
    return 0.0, 0.0


@inlined
def is_arc_beside(
    samples: Floats,
    first: int,
    end: int,
    x: float,
    y: float,
    cos: float,
    sin: float,
    bend: float,
    side: int,
    off: float,
) -> bool:
    """Whether the places from one to before another lie no farther than that beside the arc from (x, y)."""
    for i in range(first, end):
        dx, dy = samples[i, 0] - x, samples[i, 1] - y
        ahead, beside = cos * dx + sin * dy, side * (cos * dy - sin * dx)
        if abs(math.hypot(ahead, beside - bend) - bend) > off:
            return False
    return True


@kernel
def round_corners(
    px: Floats,
    py: Floats,
    chain: Floats,
    spacing: float,
    samples: Floats,
    speed: float,
    turn_rate: float,
    radius: float,
    aside: float,
    toward: float,
    hand: int,
) -> tuple[float, float]:
    """The speed [m/s] and the signed bend [m] of the free arc with which the whole chain is gone in the least time.

    As `pursue`, but the chain is gone from place to place, straight with turns on the spot or on free arcs, in the least
    time in all; what is driven now is the first of these arcs. So a slow arc is begun where it saves most, in a dead end, say.
    Speed 0: that begins with a turn on the spot.

    Args:
        px, py, chain, spacing, speed, turn_rate, radius: see `pursue`.
        samples: (m, 3) room for places and, from each of them on, heading there as the chain comes, the time to the end [s].
        aside: how far the chain may lie beside an arc [m],
        toward: and beside one that turns toward the hand [m].
        hand: +1: the hand is on a wall to the right; -1: to the left.
    """
    count = sample_chain(chain, spacing, samples)
    samples[count - 1, 2] = 0.0
    best, best_bend = 0.0, math.inf
    for start in range(count - 2, -2, -1):
        x, y, cos, sin = 0.0, 0.0, 1.0, 0.0
        if start >= 0:
            x, y = samples[start, 0], samples[start, 1]
            before_x, before_y = place_before(samples, start)
            length = math.hypot(x - before_x, y - before_y)
            if length < 1e-9:
                samples[start, 2] = samples[start + 1, 2]
                continue
            cos, sin = (x - before_x) / length, (y - before_y) / length
        dx, dy = samples[start + 1, 0] - x, samples[start + 1, 1] - y
        spot = abs(math.atan2(cos * dy - sin * dx, cos * dx + sin * dy))
        least = spot / turn_rate + math.hypot(dx, dy) / speed + samples[start + 1, 2]
        if start < 0 and spot < 1e-9:
            least = math.inf  # straight on is an arc of endless radius, and is looked at as one
        for goal in range(count - 1, start, -1):
            dx, dy = samples[goal, 0] - x, samples[goal, 1] - y
            along, left = cos * dx + sin * dy, cos * dy - sin * dx
            if along <= 0.0:
                continue
            side = 1 if left >= 0.0 else -1
            bend, turn = arc_to(along, abs(left))
            fastest = min(speed, turn_rate * bend)
            time = bend * turn / fastest + samples[goal, 2]
            # It arrives with another heading than one that comes along the chain.
            end_x, end_y = place_before(samples, goal)
            inward = math.atan2(samples[goal, 1] - end_y, samples[goal, 0] - end_x)
            time += angle_between(math.atan2(sin, cos) + side * turn, inward) / turn_rate
            if time >= least:
                continue
            off = toward if side == -hand else aside
            is_near = is_arc_beside(samples, start + 1, goal, x, y, cos, sin, bend, side, off)
            if is_near and is_arc_free(px, py, x, y, cos, sin, bend, side, radius, turn):
                least = time
                if start < 0:
                    best, best_bend = fastest, side * bend
        if start >= 0:
            samples[start, 2] = least
    return best, best_bend
