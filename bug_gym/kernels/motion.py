"""Moving obstacles that do not look: straight ways with reflections, way-points and random walks, event by event."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import apart, called, inlined
from bug_gym.kernels.chords import NEVER, disc_contact, point_wall_distance, wall_contact
from bug_gym.kernels.geometry import length, sin_cos
from bug_gym.kernels.layout import BOUNCE, CROWD, RANDOM_WALK, STILL, STREAM_WALK, WAYPOINTS, Floats, Integers, Record
from bug_gym.kernels.randomness import between, hash64, uniform
from bug_gym.kernels.walls import wall_ends

# A body moves straight until its next event: it touches something still, reaches a way-point, or takes a new heading.
# Event times are computed once a leg. Between events it is at line + velocity * time, whoever asks and whenever: so a step
# moves only what is near (`neighbours`), and a body is brought through its events when somebody asks for it. body_x, body_y
# is the place of a body that looks, of a goal and of what stands; that of others is of when they were last asked for.

SOONER = 1.0 - 1e-9  # so much earlier what is earlier is by more than rounding
UNPLANNED = -1.0  # event of a body that nobody has asked for in this episode


@called
def plan_reflection(f: Floats, k: Integers, s: Record, b: int, now: float) -> float:
    """Time and normal of body b's next contact with a still obstacle or the border, from its place at `now`.

    A polygon counts as the disc about its place that holds it. What begins too near to something goes no deeper.
    """
    x, y = f[s.body_x + b], f[s.body_y + b]
    vx, vy = f[s.body_vx + b], f[s.body_vy + b]
    radius = f[s.body_radius + b]
    speed = length(vx, vy)
    f[s.body_nx + b] = 0.0
    f[s.body_ny + b] = 0.0
    if speed == 0.0:
        return math.inf
    far: float = 2.0 * s.span  # longer than any straight way inside the border
    ex, ey = vx / speed * far, vy / speed * far
    best = NEVER
    for m in range(k[s.moving_disc_count], k[s.disc_count]):
        dx, dy = x - f[s.body_x + m], y - f[s.body_y + m]
        distance = min(radius + f[s.body_radius + m], length(dx, dy))
        fraction = disc_contact(dx, dy, ex, ey, distance)
        if fraction < best:
            best = fraction
            f[s.body_nx + b] = (dx + fraction * ex) / distance
            f[s.body_ny + b] = (dy + fraction * ey) / distance
    for w in range(k[s.moving_wall_count], k[s.wall_count]):
        x1, y1, x2, y2 = wall_ends(f, k, s, w)
        ux, uy = x2 - x1, y2 - y1
        square = ux * ux + uy * uy
        beside, drift = (y - y1) * ux - (x - x1) * uy, vy * ux - vx * uy
        distance = radius
        if beside * beside < radius * radius * square:
            distance = min(radius, point_wall_distance(x, y, x1, y1, x2, y2))
        elif beside * drift >= 0.0:
            continue  # off the wall's line, and not towards it
        fraction = wall_contact(x, y, ex, ey, x1, y1, x2, y2, distance)
        if fraction < best:
            best = fraction
            cx, cy = x + fraction * ex, y + fraction * ey
            along = min(max(((cx - x1) * ux + (cy - y1) * uy) / max(square, 1e-300), 0.0), 1.0)
            nx, ny = cx - x1 - along * ux, cy - y1 - along * uy
            norm = length(nx, ny)
            if norm == 0.0:
                # A body without extent touches at distance 0: the wall's own normal, against the motion.
                nx, ny = -uy, ux
                if nx * vx + ny * vy > 0.0:
                    nx, ny = -nx, -ny
                norm = length(nx, ny)
            f[s.body_nx + b] = nx / norm
            f[s.body_ny + b] = ny / norm
    if best == NEVER:
        return math.inf
    return now + best * far / speed


@called
def quiet_until(f: Floats, k: Integers, s: Record, b: int) -> float:
    """A time before which body b, from its place at time 0, certainly touches nothing still; much cheaper than when it does.

    It comes no nearer to a still disc than its way is long, and to a wall not before it comes to the line through it.
    """
    x, y = f[s.body_x + b], f[s.body_y + b]
    vx, vy = f[s.body_vx + b], f[s.body_vy + b]
    radius = f[s.body_radius + b]
    until = math.inf
    if k[s.disc_count] > k[s.moving_disc_count]:
        gap = math.inf
        for m in range(k[s.moving_disc_count], k[s.disc_count]):
            gap = min(gap, length(x - f[s.body_x + m], y - f[s.body_y + m]) - f[s.body_radius + m])
        until = max(gap - radius, 0.0) / max(length(vx, vy), 1e-300)
    for w in range(k[s.moving_wall_count], k[s.wall_count]):
        x1, y1, x2, y2 = wall_ends(f, k, s, w)
        ux, uy = x2 - x1, y2 - y1
        beside, drift = (y - y1) * ux - (x - x1) * uy, vy * ux - vx * uy
        gap = abs(beside) - radius * (abs(ux) + abs(uy))  # no wall is longer than both its sides
        if gap <= 0.0:
            return 0.0
        if beside * drift < 0.0:
            until = min(until, gap / abs(drift))
    return until * SOONER


@called
def plan_quiet(f: Floats, k: Integers, s: Record, first: int, count: int) -> None:
    """What `quiet_until` returns for each of so many bodies from `first` on, where no disc stands still: all at once."""
    xs, ys, radii = np.uint64(s.body_x + first), np.uint64(s.body_y + first), np.uint64(s.body_radius + first)
    vxs, vys, quiet = np.uint64(s.body_vx + first), np.uint64(s.body_vy + first), np.uint64(s.body_quiet + first)
    for j in range(np.uint64(count)):
        f[quiet + j] = math.inf
    for w in range(k[s.moving_wall_count], k[s.wall_count]):
        x1, y1, x2, y2 = wall_ends(f, k, s, w)
        ux, uy = x2 - x1, y2 - y1
        longest = abs(ux) + abs(uy)
        for j in range(np.uint64(count)):
            beside = (f[ys + j] - y1) * ux - (f[xs + j] - x1) * uy
            drift = f[vys + j] * ux - f[vxs + j] * uy
            gap = abs(beside) - f[radii + j] * longest
            until = gap / abs(drift)
            until = until if beside * drift < 0.0 else math.inf
            until = until if gap > 0.0 else 0.0
            before = f[quiet + j]
            f[quiet + j] = until if until < before else before
    for j in range(np.uint64(count)):
        f[quiet + j] *= SOONER


@called
def walker_number(s: Record, b: int) -> int:
    """A number for body b that does not depend on how much room its row has for other bodies."""
    first_polygon: int = s.discs
    first_goal: int = s.discs + s.polygons
    if b < first_polygon:
        return 3 * b
    if b < first_goal:
        return 3 * (b - first_polygon) + 1
    return 3 * (b - first_goal) + 2


@called
def take_heading(f: Floats, k: Integers, s: Record, b: int) -> float:
    """Give a random walker its next heading and return how long it keeps it [s]."""
    key = hash64(k[s.seed], k[s.episode], k[s.body_leg + b], STREAM_WALK)
    sin, cos = sin_cos(2.0 * math.pi * uniform(key, 2 * walker_number(s, b)))
    f[s.body_vx + b] = f[s.body_speed + b] * cos
    f[s.body_vy + b] = f[s.body_speed + b] * sin
    k[s.body_leg + b] += 1
    low: float = f[s.leg_min + b]
    high: float = f[s.leg_max + b]
    return between(key, 2 * walker_number(s, b) + 1, low, high)


@called
def head_for_way_point(f: Floats, k: Integers, s: Record, b: int, now: float) -> float:
    """Point body b at its next way-point; returns the time of arrival, infinite where it stays for ever."""
    count = k[s.way_count + b]
    if k[s.way_next + b] >= count:
        if k[s.way_loops + b] == 0:
            f[s.body_vx + b] = 0.0
            f[s.body_vy + b] = 0.0
            return math.inf
        k[s.way_next + b] = 0
    w = k[s.way_first + b] + k[s.way_next + b]
    dx, dy = f[s.way_x + w] - f[s.body_x + b], f[s.way_y + w] - f[s.body_y + b]
    distance = length(dx, dy)
    speed: float = f[s.body_speed + b]
    if distance == 0.0 or speed == 0.0:
        f[s.body_vx + b] = 0.0
        f[s.body_vy + b] = 0.0
        return now if speed > 0.0 and count > 1 else math.inf
    f[s.body_vx + b] = speed * dx / distance
    f[s.body_vy + b] = speed * dy / distance
    return now + distance / speed


@apart
def plan_body(f: Floats, k: Integers, s: Record, b: int, now: float) -> None:
    """Set the next event of a body that has just been placed or has just had one."""
    law = k[s.body_law + b]
    if law == STILL:
        f[s.body_event + b] = math.inf
    elif law == BOUNCE:
        f[s.body_event + b] = plan_reflection(f, k, s, b, now)
    elif law == WAYPOINTS:
        f[s.body_event + b] = head_for_way_point(f, k, s, b, now)
    else:
        turn = f[s.body_event + b]  # a random walker's new heading is due then; a reflection may come first
        contact = plan_reflection(f, k, s, b, now)
        if contact < turn:
            f[s.body_event + b] = contact
        else:
            f[s.body_nx + b] = 0.0
            f[s.body_ny + b] = 0.0


@apart
def handle_event(f: Floats, k: Integers, s: Record, b: int, now: float) -> None:
    """Reflect, turn or take the next way-point: body b stands at the place of its event, at time `now`."""
    law = k[s.body_law + b]
    nx, ny = f[s.body_nx + b], f[s.body_ny + b]
    if law == WAYPOINTS:
        w = k[s.way_first + b] + k[s.way_next + b]
        f[s.body_x + b] = f[s.way_x + w]  # without the rounding of the way there
        f[s.body_y + b] = f[s.way_y + w]
        k[s.way_next + b] += 1
    elif nx != 0.0 or ny != 0.0:
        inward = f[s.body_vx + b] * nx + f[s.body_vy + b] * ny
        if inward < 0.0:
            f[s.body_vx + b] -= 2.0 * inward * nx
            f[s.body_vy + b] -= 2.0 * inward * ny
        if law == RANDOM_WALK:
            # The heading after a reflection is kept for a leg of its own.
            key = hash64(k[s.seed], k[s.episode], k[s.body_leg + b], STREAM_WALK)
            k[s.body_leg + b] += 1
            leg = between(key, 2 * walker_number(s, b) + 1, f[s.leg_min + b], f[s.leg_max + b])
            f[s.body_event + b] = now + leg
    elif law == RANDOM_WALK:
        f[s.body_event + b] = now + take_heading(f, k, s, b)
    plan_body(f, k, s, b, now)
    set_line(f, s, b, now)


@inlined
def set_line(f: Floats, s: Record, b: int, now: float) -> None:
    """The line on which body b goes on from its place at `now`."""
    f[s.line_x + b] = f[s.body_x + b] - f[s.body_vx + b] * now
    f[s.line_y + b] = f[s.body_y + b] - f[s.body_vy + b] * now


@inlined
def place_on_line(f: Floats, s: Record, b: int, time: float) -> None:
    """Put body b to where its line has it at a time."""
    f[s.body_x + b] = f[s.line_x + b] + f[s.body_vx + b] * time
    f[s.body_y + b] = f[s.line_y + b] + f[s.body_vy + b] * time


@called
def begin_motion(f: Floats, k: Integers, s: Record, b: int) -> None:
    """Plan the first event of body b, which is still where it was placed."""
    f[s.body_turned + b] = -1.0
    if k[s.body_law + b] == RANDOM_WALK:
        f[s.body_event + b] = take_heading(f, k, s, b)
    plan_body(f, k, s, b, 0.0)
    set_line(f, s, b, 0.0)


MAX_STALLS = 32  # events one upon the other; a body wedged in a corner waits until the next step and goes on then
SHORTEST = 1e-6  # of a step: events nearer to one another are one upon the other; others there are a million at most


@called
def move_body(f: Floats, k: Integers, s: Record, b: int, start: float, end: float) -> None:
    """Bring body b through all its events between `start` and `end` of a step.

    It stands until `end` where more of them lie one upon the other than a tour of its way-points has.
    """
    place_on_line(f, s, b, start)
    f[s.last_x + b] = f[s.body_x + b]
    f[s.last_y + b] = f[s.body_y + b]
    f[s.body_turned + b] = end
    now, stalls, most = start, 0, max(MAX_STALLS, k[s.way_count + b])
    while f[s.body_event + b] <= end:
        event = max(f[s.body_event + b], now)
        stalls = stalls + 1 if event - now < SHORTEST * s.step else 1
        if stalls > most:
            f[s.body_event + b] += end - now
            set_line(f, s, b, end)
            return
        now = event
        place_on_line(f, s, b, now)
        handle_event(f, k, s, b, now)


@apart
def bring_forward(f: Floats, k: Integers, s: Record, b: int, time: float) -> None:
    """Bring body b, which looks at nothing, to its place at a time, the end of a step, through all its events so far.

    They are met step by step, so it is the same whoever asked for it before, and when.
    """
    if f[s.body_event + b] == UNPLANNED:
        begin_motion(f, k, s, b)
    while f[s.body_event + b] <= time:
        number = int(max(f[s.body_event + b], f[s.body_turned + b]) / s.step)
        # The first step that ends at the event or later, and after the last one in which it had one.
        while number * s.step < f[s.body_event + b] or number * s.step <= max(f[s.body_turned + b], 0.0):
            number += 1
        if number * s.step > time:
            break
        move_body(f, k, s, b, (number - 1) * s.step, number * s.step)
    place_on_line(f, s, b, time)


@called
def move_looker(f: Floats, s: Record, b: int, start: float, end: float) -> None:
    """Move body b, which has taken a velocity for this step."""
    f[s.body_x + b] += f[s.body_vx + b] * (end - start)
    f[s.body_y + b] += f[s.body_vy + b] * (end - start)
    set_line(f, s, b, end)


@inlined
def body_motion(f: Floats, s: Record, b: int) -> tuple[float, float]:
    """The way of a moving body in this step, along its chord [m]."""
    if f[s.body_turned + b] == f[s.time]:
        return f[s.body_x + b] - f[s.last_x + b], f[s.body_y + b] - f[s.last_y + b]
    return f[s.body_vx + b] * s.step, f[s.body_vy + b] * s.step


@inlined
def follow_goal(f: Floats, k: Integers, s: Record, r: int) -> None:
    """Keep the place of robot r's goal where every step reads it."""
    g = k[s.goal_body + r]
    f[s.goal_place + 2 * r], f[s.goal_place + 2 * r + 1] = f[s.body_x + g], f[s.body_y + g]


@called
def move_goals(f: Floats, k: Integers, s: Record, end: float) -> None:
    """Bring the goals to `end`; those that look have gone there."""
    for g in range(s.discs + s.polygons, s.discs + s.polygons + s.goals):
        if k[s.body_law + g] < CROWD:
            bring_forward(f, k, s, g, end)
    for r in range(s.robots):
        follow_goal(f, k, s, r)
        f[s.goal_way + 2 * r], f[s.goal_way + 2 * r + 1] = body_motion(f, s, k[s.goal_body + r])
