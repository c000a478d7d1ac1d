"""Who touches what, and when: the first contact of each robot on its way in a step, while all else goes on its chord."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined
from bug_gym.kernels.body import (
    NO_WALL,
    circle_radius,
    is_beside,
    point_at,
    swing,
    swing_contact,
    swung_point,
    way_of,
)
from bug_gym.kernels.chords import NEVER, disc_contact, nearest_on_chord, nearest_to_wall, wall_contact
from bug_gym.kernels.layout import COLLISION, RUNNING, SUCCESS, Floats, Footprint, Integers, Record
from bug_gym.kernels.neighbours import Near, listed_walls, near_motion
from bug_gym.kernels.rays import Discs, find_near_discs
from bug_gym.kernels.vectors import NEAR
from bug_gym.kernels.walls import next_wall, room_about, wall_between


@inlined
def is_bent(s: Record, footprint: Floats, c: int) -> bool:
    """Whether circle c of a robot's body goes on several chords in a step."""
    return bool(s.arcs != 0 or is_beside(footprint, c))


@inlined
def goal_contact(f: Floats, s: Record, footprint: Footprint, r: int) -> float:
    """Fraction of the step at which robot r's centre comes within the goal radius of its goal, or NEVER."""
    mx, my = f[s.goal_way + 2 * r], f[s.goal_way + 2 * r + 1]
    dx = f[s.pose + 3 * r] - (f[s.goal_place + 2 * r] - mx)
    dy = f[s.pose + 3 * r + 1] - (f[s.goal_place + 2 * r + 1] - my)
    if dx * dx + dy * dy <= s.goal_radius * s.goal_radius:
        return 0.0
    if footprint is not None and s.arcs != 0:
        x, y = f[s.goal_place + 2 * r], f[s.goal_place + 2 * r + 1]
        fraction, _gap = swing_contact(f, s, r, 0.0, 0.0, x, y, mx, my, s.goal_radius, NO_WALL, NO_WALL, 1.0)
        return fraction
    ex = f[s.next_pose + 3 * r] - f[s.pose + 3 * r] - mx
    ey = f[s.next_pose + 3 * r + 1] - f[s.pose + 3 * r + 1] - my
    return disc_contact(dx, dy, ex, ey, s.goal_radius)


@inlined
def disc_contacts(
    f: Floats,
    k: Integers,
    s: Record,
    footprint: Footprint,
    discs: Discs,
    r: int,
    need: float,
    end: float,
    index: Integers,
) -> tuple[float, float]:
    """First contact of robot r with discs up to the fraction `end`, and the smallest clearance to them."""
    x0, y0 = f[s.pose + 3 * r], f[s.pose + 3 * r + 1]
    nx, ny = f[s.next_pose + 3 * r], f[s.next_pose + 3 * r + 1]
    moving = k[s.moving_disc_count]
    first, clearance = NEVER, math.inf
    near = find_near_discs(discs, nx, ny, need, index)
    for j in range(near):
        at = np.uint64(index[np.uint64(NEAR) + j])
        x, y = discs.x[at], discs.y[at]
        mx, my = near_motion(f, k, s, 0, moving, at)
        for c in range(s.footprint):
            reach = discs.radius[at] + circle_radius(s, footprint, c)
            if footprint is not None and is_bent(s, footprint, c):
                ox, oy = footprint[c, 0], footprint[c, 1]
                fraction, gap = swing_contact(f, s, r, ox, oy, x, y, mx, my, reach, NO_WALL, NO_WALL, end)
                first, clearance = min(first, fraction), min(clearance, gap)
                continue
            px, py, ex, ey = x0 - x + mx, y0 - y + my, nx - x0 - mx, ny - y0 - my
            fraction = disc_contact(px, py, ex, ey, reach)
            if fraction <= end:
                first = min(first, fraction)
            clearance = min(clearance, nearest_on_chord(px, py, ex, ey, end) - reach)
    return first, clearance


@called
def wall_contacts(
    f: Floats,
    k: Integers,
    s: Record,
    footprint: Footprint,
    r: int,
    begin: int,
    count: int,
    is_ring: bool,
    bx: float,
    by: float,
    mx: float,
    my: float,
    need: float,
    end: float,
) -> tuple[float, float]:
    """First contact of robot r with a range of walls that stand at (bx, by) and came from (bx - mx, by - my).

    Returns (fraction or NEVER, clearance [m]) as `obstacle_contact` does.
    """
    x0, y0 = f[s.pose + 3 * r], f[s.pose + 3 * r + 1]
    x3, y3 = f[s.next_pose + 3 * r], f[s.next_pose + 3 * r + 1]
    nx, ny = x3 - bx, y3 - by
    px, py, ex, ey = x0 - bx + mx, y0 - by + my, x3 - x0 - mx, y3 - y0 - my
    first, clearance = NEVER, math.inf
    for w in range(begin, begin + count):
        after = next_wall(k, s, w, begin, count, is_ring)
        x1, y1, x2, y2 = wall_between(f, s, w, after)
        gap_x = max(max(min(x1, x2) - nx, nx - max(x1, x2)), 0.0)
        gap_y = max(max(min(y1, y2) - ny, ny - max(y1, y2)), 0.0)
        if gap_x * gap_x + gap_y * gap_y >= need * need:
            continue
        for c in range(s.footprint):
            radius = circle_radius(s, footprint, c)
            if footprint is not None and is_bent(s, footprint, c):
                ox, oy = footprint[c, 0], footprint[c, 1]
                fraction, gap = swing_contact(f, s, r, ox, oy, bx, by, mx, my, radius, w, after, end)
                first, clearance = min(first, fraction), min(clearance, gap)
                continue
            fraction = wall_contact(px, py, ex, ey, x1, y1, x2, y2, radius)
            if fraction <= end:
                first = min(first, fraction)
            clearance = min(clearance, nearest_to_wall(px, py, ex, ey, x1, y1, x2, y2, end) - radius)
    return first, clearance


@inlined
def obstacle_contact(
    f: Floats, k: Integers, s: Record, footprint: Footprint, near: Near, r: int, end: float, index: Integers
) -> tuple[float, float]:
    """First contact of robot r with discs and walls up to the fraction `end`, and the smallest clearance.

    Returns (fraction or NEVER, clearance [m]); the clearance is exact where it is below the episode's smallest so far or
    below `clearance_reach`, else no smaller than those, as whoever takes minima only needs it.
    """
    nx, ny = f[s.next_pose + 3 * r], f[s.next_pose + 3 * r + 1]
    turn = abs(f[s.next_pose + 3 * r + 2] - f[s.pose + 3 * r + 2])
    slack = way_of(f, s, r) + turn * s.body_reach + f[s.fastest] * s.step
    need = max(f[s.min_clearance + r], s.clearance_reach) + s.body_reach + slack
    first, clearance = NEVER, math.inf
    if near.discs.total > 0:
        first, clearance = disc_contacts(f, k, s, footprint, near.discs, r, need, end, index)
    room = room_about(f, k, s, nx, ny)
    if not room.holds or room.nearest < need:
        contact, gap = wall_contacts(
            f, k, s, footprint, r, k[s.border_first], k[s.border_walls], True, 0.0, 0.0, 0.0, 0.0, need, end
        )
        first, clearance = min(first, contact), min(clearance, gap)
    if near.polygons.total == 0:
        return first, clearance
    count = find_near_discs(near.polygons, nx, ny, need, index)
    for j in range(count):
        at = np.uint64(index[np.uint64(NEAR) + j])
        walls = listed_walls(k, s, at)
        x, y, mx, my = 0.0, 0.0, 0.0, 0.0  # the walls of a still polygon are kept where they stand
        if walls.moves:
            x, y = near.polygons.x[at], near.polygons.y[at]
            mx, my = near_motion(f, k, s, s.discs, k[s.moving_polygon_count], np.uint64(s.disc_room) + at)
        contact, gap = wall_contacts(
            f, k, s, footprint, r, walls.first, walls.total, walls.is_ring, x, y, mx, my, need, end
        )
        first, clearance = min(first, contact), min(clearance, gap)
    return first, clearance


@called
def robots_contact(
    f: Floats, s: Record, footprint: Floats, stops: Floats, a: int, b: int, end: float
) -> tuple[float, float]:
    """First contact of robots a and b up to the fraction `end`, and their smallest clearance.

    `stops` (R,) is the fraction at which a robot has come to rest; a robot at rest since before the step has 0.
    """
    first = NEVER
    clearance = math.inf
    for ca in range(s.footprint):
        aox, aoy = footprint[ca, 0], footprint[ca, 1]
        a_pieces, a_margin = swing(f, s, a, aox, aoy)
        for cb in range(s.footprint):
            box, boy = footprint[cb, 0], footprint[cb, 1]
            b_pieces, b_margin = swing(f, s, b, box, boy)
            pieces, reach = max(a_pieces, b_pieces), footprint[ca, 2] + footprint[cb, 2]
            ax, ay = point_at(f, s.pose, a, aox, aoy)
            bx, by = point_at(f, s.pose, b, box, boy)
            px, py = ax - bx, ay - by
            # Both move until one has stopped, then the other one does.
            begin = 0.0
            for stretch in range(2):
                finish = min(end, min(stops[a], stops[b])) if stretch == 0 else min(end, max(stops[a], stops[b]))
                if finish <= begin and stretch == 1:
                    continue
                share = (finish - begin) / pieces
                for piece in range(pieces):
                    now = finish if piece == pieces - 1 else begin + (piece + 1) * share
                    ax, ay = swung_point(f, s, a, aox, aoy, min(now, stops[a]))
                    bx, by = swung_point(f, s, b, box, boy, min(now, stops[b]))
                    ex, ey = ax - bx - px, ay - by - py
                    fraction = disc_contact(px, py, ex, ey, reach + a_margin + b_margin)
                    if fraction <= 1.0:
                        first = min(first, begin + (piece + fraction) * share)
                    clearance = min(clearance, nearest_on_chord(px, py, ex, ey, 1.0) - reach)
                    px, py = ax - bx, ay - by
                begin = finish
    return first, clearance


SAME_TIME = 1e-12  # as a fraction of the step


@inlined
def settle_robots(
    f: Floats,
    k: Integers,
    s: Record,
    footprint: Footprint,
    near: Near,
    stops: Floats,
    verdicts: Integers,
    index: Integers,
) -> None:
    """Find where each active robot's step ends and why; `stops` and `verdicts` (R,) are filled.

    Contacts with the world come first; then, among robots, the earliest event stops its robot and the others are
    looked at again, until no event is left.
    """
    for r in range(s.robots):
        stops[r] = 0.0
        verdicts[r] = k[s.outcome + r]
        if verdicts[r] != RUNNING:
            continue
        goal = goal_contact(f, s, footprint, r)
        end = min(goal, 1.0)
        contact, clearance = obstacle_contact(f, k, s, footprint, near, r, end, index)
        stops[r] = end
        verdicts[r] = SUCCESS if goal <= 1.0 else RUNNING
        if contact <= end:
            stops[r] = contact
            verdicts[r] = COLLISION
            clearance = 0.0
        f[s.clearance + r] = clearance
    if footprint is not None and s.robots > 1:
        settle_among_robots(f, k, s, footprint, stops, verdicts, index)


@called
def settle_among_robots(
    f: Floats, k: Integers, s: Record, footprint: Floats, stops: Floats, verdicts: Integers, moves: Integers
) -> None:
    """Stop robots that touch one another, the earliest contact first, and take their clearances to one another.

    In `moves` (R,) is kept whom an earlier contact may still stop. Who has been stopped by another robot has met his first
    one; found again, on the shorter way that is left of the step, it would come a little earlier, as the chords lie elsewhere.
    """
    robots = s.robots
    for r in range(robots):
        moves[r] = int(k[s.outcome + r] == RUNNING)
    for _ in range(robots):
        earliest = NEVER
        for a in range(robots):
            for b in range(a + 1, robots):
                if moves[a] == 0 and moves[b] == 0:
                    continue
                contact, _clearance = robots_contact(f, s, footprint, stops, a, b, max(stops[a], stops[b]))
                later = contact + SAME_TIME
                touched = (moves[a] != 0 and later < stops[a]) or (moves[b] != 0 and later < stops[b])
                if touched and contact < earliest:
                    earliest = contact
                    first, second = a, b
        if earliest == NEVER:
            break
        for r in (first, second):
            if moves[r] != 0 and earliest <= stops[r]:
                moves[r] = 0
                stops[r] = earliest
                verdicts[r] = COLLISION
                f[s.clearance + r] = 0.0
    for a in range(robots):
        for b in range(robots):
            if a != b and k[s.outcome + a] == RUNNING and verdicts[a] != COLLISION:
                _contact, clearance = robots_contact(f, s, footprint, stops, a, b, stops[a])
                f[s.clearance + a] = min(f[s.clearance + a], clearance)
