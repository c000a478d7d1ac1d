"""Whether a robot that has inertia can still stop before what its scan shows, and how much of a wish leaves it so.

For policies, as `free_way`: `px`, `py` (k,) are points in the robot's frame. Nothing here sees the world.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.chords import NEVER, chord_square, wall_contact
from bug_gym.kernels.layout import Flags, Floats, Integers, Ranges
from bug_gym.kernels.levers import levers, turning

EASED = 1e-3
"""By how much a body may come nearer [m] to a point that is nearer than the margin already."""

EASED_SHARE = 0.05
"""The same as a share of its way, where that is less: else who creeps comes nearer with every step until it touches."""


ROUNDING = 1e-9
"""Slack of lengths [m]."""

FAST = 0.5
"""Share of a wish above which more is to keep clear where few beams show where a thing ends."""


@kernel
def stopping_way(speed: float, acceleration: float, step: float) -> float:
    """Way [m] of a robot that drives a step at `speed` [m/s] and brakes from the next on, that step not counted."""
    if math.isinf(acceleration) or speed == 0.0:
        return 0.0
    loss = acceleration * step
    steps = math.floor(speed / loss)
    return step * (steps * speed - loss * 0.5 * steps * (steps + 1.0))


@kernel
def arc_and_stop(
    speed: float, asked_speed: float, asked_rate: float, keeps_arc: bool, acceleration: float, step: float
) -> tuple[float, float, float, float, float]:
    """A step of a robot that turns, and the straight way on which it then comes to stand: x, y, turn, way x, way y.

    Args:
        speed: its own now [m/s].
        asked_speed: the one that it asks for [m/s].
        asked_rate: the turn rate beside it [rad/s].
        keeps_arc: whether it keeps the arc that was asked for where its speed is another (ackermann), not the rate.
        acceleration: the greatest [m/s^2].
        step: of time [s].
    """
    limit = acceleration * step
    driven = min(max(asked_speed, speed - limit), speed + limit)
    turn = rate_at(driven, asked_speed, asked_rate, keeps_arc) * step
    half = 0.5 * turn
    chord = driven * step * (math.sin(half) / half if half != 0.0 else 1.0)
    way = math.copysign(stopping_way(abs(driven), acceleration, step), driven)
    return chord * math.cos(half), chord * math.sin(half), turn, way * math.cos(turn), way * math.sin(turn)


@kernel
def rate_at(speed: float, asked_speed: float, asked_rate: float, keeps_arc: bool) -> float:
    """The turn rate [rad/s] at a speed [m/s] of a robot that asks for another."""
    if not keeps_arc:
        return asked_rate
    return asked_rate * speed / asked_speed if asked_speed != 0.0 else 0.0


@kernel
def clear_part(
    px: Floats,
    py: Floats,
    circles: Floats,
    speed: float,
    wished_speed: float,
    wished_rate: float,
    keeps_arc: bool,
    acceleration: float,
    step: float,
    margin: float,
    gap: float,
    wide: int,
    fast_gap: float,
    parts: int,
) -> int:
    """How many of the equal parts of a wished speed can be driven so that the robot can still stop in time; -1: not even none.

    Args:
        px, py, circles, margin, gap, wide: see `keeps_clear`.
        speed, keeps_arc, acceleration, step: see `arc_and_stop`; an arc is cut with the speed, a turn rate is not.
        wished_speed: [m/s].
        wished_rate: the turn rate wished beside it [rad/s].
        fast_gap: the gap [rad] that counts where more than FAST of the wish is driven.
        parts: of the wish.
    """
    for part in range(parts, -1, -1):
        share = part / parts
        asked_rate = share * wished_rate if keeps_arc else wished_rate
        x, y, turn, wx, wy = arc_and_stop(speed, share * wished_speed, asked_rate, keeps_arc, acceleration, step)
        if keeps_clear(px, py, circles, x, y, turn, wx, wy, margin, fast_gap if share > FAST else gap, wide):
            return part
    return -1


@kernel
def stoppable_levers(
    points: Floats,
    counts: Integers,
    rows: Integers,
    circles: Floats,
    wishes: Floats,
    limits: Floats,
    margin: float,
    gap: float,
    fast_gap: float,
    parts: int,
    actions: Ranges,
    cut: Integers,
) -> None:
    """The actions with which k differential robots that are alike can still stop in time, for what each wishes.

    Args:
        points: what each of n robots sees now (n, 2, B), of each the first ones [m].
        counts: how many of each (n,).
        rows: which of them are asked for (k,).
        circles, margin, gap, fast_gap, parts: see `clear_part`.
        wishes: the own speed [m/s], the desired one and its heading error [rad] (k, 3).
        limits: of each, see `Drive.limits`.
        actions: filled (k, 2).
        cut: filled (k,): `clear_part`; where that is -1 the action means nothing.
    """
    fastest, reverse, most, acceleration, step = limits
    for r in range(rows.size):
        row, speed = rows[r], wishes[r, 0]
        count = counts[row]
        px, py = points[row, 0, :count], points[row, 1, :count]
        fast, rate = turning(wishes[r, 1], wishes[r, 2], fastest, step, most)
        cut[r] = clear_part(
            px, py, circles, speed, fast, rate, False, acceleration, step, margin, gap, count, fast_gap, parts
        )
        actions[r, 0], actions[r, 1] = levers(cut[r] / parts * fast, rate, fastest, reverse, most)


@inlined
def way_of_middle(cx: float, cy: float, x: float, y: float, cos: float, sin: float) -> tuple[float, float]:
    """From where a circle's middle is to where a step to (x, y) brings it, with a turn of that cosine and sine [m]."""
    return x + cos * cx - sin * cy - cx, y + sin * cx + cos * cy - cy


@kernel
def keeps_clear(
    px: Floats,
    py: Floats,
    circles: Floats,
    x: float,
    y: float,
    turn: float,
    wx: float,
    wy: float,
    margin: float,
    gap: float,
    wide: int,
) -> bool:
    """Whether a body stays clear of points on a step to (x, y) with a turn, and on a straight way after it.

    Args:
        px, py: the points (k,), in the frame in which the body stands at the origin and looks along x [m].
        circles: the body as x, y, radius (c, 3) [m].
        x, y: where its origin is after the step [m].
        turn: how far it turns meanwhile [rad].
        wx, wy: the way after it [m].
        margin: what is kept about the body [m].
        gap: half the angle between two beams [rad]: what a point belongs to may reach so far beside it, unseen.
        wide: of how many points that holds, the first ones; the others are known to be where they are, no more.

    A point that is nearer already than that may not come nearer.
    """
    cos, sin = math.cos(turn), math.sin(turn)
    reach = math.hypot(x, y) + math.hypot(wx, wy)
    eased = min(EASED, EASED_SHARE * reach)
    for c in range(circles.shape[0]):
        cx, cy, radius = circles[c, 0], circles[c, 1], circles[c, 2]
        ex, ey = way_of_middle(cx, cy, x, y, cos, sin)
        for i in range(px.size):
            dx, dy = cx - px[i], cy - py[i]
            square = dx * dx + dy * dy
            beside = gap * math.sqrt(px[i] * px[i] + py[i] * py[i]) if i < wide else 0.0
            least = radius + margin + beside
            far = reach + least + abs(turn) * math.hypot(cx, cy)
            if square > far * far:
                continue
            if square < least * least:
                least = math.sqrt(square) - eased - ROUNDING
                if least <= 0.0:
                    continue
            if chord_square(dx, dy, ex, ey, 1.0) < least * least:
                return False
            if chord_square(dx + ex, dy + ey, wx, wy, 1.0) < least * least:
                return False
    return True


@inlined
def meeting(ax: float, ay: float, ux: float, uy: float, bx: float, by: float, vx: float, vy: float) -> float:
    """How far from a along u, as a share of it, two lines meet that go on from a along u and from b along v; -1: nowhere."""
    cross = ux * vy - uy * vx
    first = (bx - ax) * vy - (by - ay) * vx
    second = (bx - ax) * uy - (by - ay) * ux
    return first / cross if cross * first > 0.0 and cross * second > 0.0 else -1.0


@inlined
def are_of_one(ax: float, ay: float, bx: float, by: float, most: float, apart: float) -> bool:
    """Whether the second point, counter-clockwise of the first, is so near to it that both are taken for one thing's."""
    angle = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    return math.hypot(bx - ax, by - ay) <= most and 0.0 < angle <= apart


@kernel
def are_between(px: Floats, py: Floats, most: float, apart: float, between: Flags) -> None:
    """Write of which points (k,) both neighbours are taken for ones of the same thing: so what is beside them shows.

    See `passes_corners`, which asks for what may lie between two such points all the same.
    """
    count = px.size
    for i in range(count):
        j, before = (i + 1) % count, (i - 1 + count) % count
        is_first = are_of_one(px[before], py[before], px[i], py[i], most, apart)
        between[i] = is_first and are_of_one(px[i], py[i], px[j], py[j], most, apart)


@inlined
def passes_point(dx: float, dy: float, ex: float, ey: float, least: float, eased: float) -> bool:
    """Whether who goes from (dx, dy) along (ex, ey) keeps `least` from 0; who is nearer comes no nearer but for `eased`."""
    if dx * dx + dy * dy < least * least:
        least = math.hypot(dx, dy) - eased - ROUNDING
    return chord_square(dx, dy, ex, ey, 1.0) >= least * least


@called
def passes_side(
    cx: float, cy: float, ex: float, ey: float, ax: float, ay: float, bx: float, by: float, least: float, eased: float
) -> bool:
    """The same of all points of a side, for who goes from c along e: `passes_point` asked of each [m].

    Args:
        cx, cy, ex, ey: a middle, and its way in a step.
        ax, ay, bx, by: the ends of the side.
        least, eased: see `passes_point`.
    """
    ux, uy = bx - ax, by - ay
    square = ux * ux + uy * uy
    across = (cx - ax) * uy - (cy - ay) * ux
    near = least * least * square - across * across  # of the line, what lies within `least` of c: half of it, squared
    if near > 0.0:
        middle, half = (cx - ax) * ux + (cy - ay) * uy, math.sqrt(near)
        first, last = max(middle - half, 0.0) / square, min(middle + half, square) / square
        if first < last:
            # Who comes no nearer to two points comes no nearer to those between, and stays before the tangents at the two,
            # beyond which the rest lies.
            is_first = passes_point(cx - ax - first * ux, cy - ay - first * uy, ex, ey, least, eased)
            return is_first and passes_point(cx - ax - last * ux, cy - ay - last * uy, ex, ey, least, eased)
    return wall_contact(cx, cy, ex, ey, ax, ay, bx, by, least - ROUNDING) == NEVER


@kernel
def passes_corners(
    px: Floats,
    py: Floats,
    circles: Floats,
    x: float,
    y: float,
    turn: float,
    most: float,
    apart: float,
    margin: float,
    is_exact: bool,
) -> bool:
    """Whether a body stays clear, on a step, of corners that may lie unseen between two beams that both meet something.

    Two points of one thing show how a side runs, and it may run on until it meets the other side, or the next beam, which
    would show it. Where no side is known a corner of a right angle, or of a blunter one, lies in the circle that has the two
    points for a diameter (Thales). A body that is too near to that already may not come nearer.

    Args:
        px, py: the points (k,) that beams meet one after the other, counter-clockwise, robot's frame [m].
        circles, x, y, turn: see `keeps_clear`.
        most: up to how far from one another [m] two points are taken for ones of the same thing,
        apart: and up to what angle, as the robot sees them [rad].
        margin: what is kept about the body before a corner at the end of a side [m].
        is_exact: whether points scatter too little to spoil the direction of a side.
    """
    cos, sin = math.cos(turn), math.sin(turn)
    eased = 0.0 if is_exact else min(EASED, EASED_SHARE * math.hypot(x, y))
    count = px.size
    for i in range(count):
        j = (i + 1) % count
        half_x, half_y = 0.5 * (px[j] - px[i]), 0.5 * (py[j] - py[i])
        corner_x, corner_y, about = px[i] + half_x, py[i] + half_y, math.hypot(half_x, half_y)
        before, behind = (i - 1 + count) % count, (j + 1) % count
        if not are_of_one(px[i], py[i], px[j], py[j], most, apart):
            continue
        ux, uy = px[i] - px[before], py[i] - py[before]
        vx, vy = px[j] - px[behind], py[j] - py[behind]
        is_first = is_exact and are_of_one(px[before], py[before], px[i], py[i], most, apart)
        is_second = is_exact and are_of_one(px[j], py[j], px[behind], py[behind], most, apart)
        if is_first or is_second:
            if not is_first:
                ux, uy = -px[i], -py[i]  # along the beam, toward the robot
            if not is_second:
                vx, vy = -px[j], -py[j]
            share = meeting(px[i], py[i], ux, uy, px[j], py[j], vx, vy)
            if share < 0.0:
                continue  # one side goes on in the other, or they leave a hollow
            corner_x, corner_y, about = px[i] + share * ux, py[i] + share * uy, margin
        for c in range(circles.shape[0]):
            cx, cy, radius = circles[c, 0], circles[c, 1], circles[c, 2]
            ex, ey = way_of_middle(cx, cy, x, y, cos, sin)
            if not passes_point(cx - corner_x, cy - corner_y, ex, ey, radius + about, eased):
                return False
            if is_first and not passes_side(cx, cy, ex, ey, px[i], py[i], corner_x, corner_y, radius, eased):
                return False
            if is_second and not passes_side(cx, cy, ex, ey, px[j], py[j], corner_x, corner_y, radius, eased):
                return False
    return True
