"""Bodies that look before each step: the crowd, evaders, and those that follow a record.

Under these laws a body takes a velocity at the start of each step and keeps it to its end, so it has no events.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called
from bug_gym.kernels.avoidance import (
    SAME_SPEED,
    SKIN,
    Disc,
    add_avoidance,
    add_robots,
    add_still_half_planes,
    least_violation,
    nearest_velocity,
)
from bug_gym.kernels.chords import point_wall_square
from bug_gym.kernels.geometry import length, sin_cos
from bug_gym.kernels.layout import (
    CROWD,
    EVADE,
    REPLAY,
    STREAM_CROWD,
    STREAM_EVADE,
    STREAM_SIDESTEP,
    Floats,
    Integers,
    Record,
)
from bug_gym.kernels.motion import walker_number
from bug_gym.kernels.placing import is_taken
from bug_gym.kernels.randomness import between, hash64, uniform
from bug_gym.kernels.walls import wall_ends

PATIENCE, DETOUR = 5.0, 2.0  # a goal is given up after this time [s] and so many times that of the straight way
MAX_SIDESTEP = 1.5  # how far at most a body of a crowd that is held up turns to its right [rad]
SIDESTEP_LEG = 1.0  # for how long it keeps to the angle it has drawn [s]
GOAL_TRIES = 64  # for one goal
WANDER_LEG = 2.0  # time between the headings of an evader that sees no robot [s]
CORNERED = -0.25  # an evader stops rather than run toward a robot more than this (cosine)
AWAY = 1e6  # x and y of a body that isn't there [m]: out of any sensor's and any robot's reach
SAME_INSTANT = 1e-9  # [s]


@called
def wish_of(f: Floats, k: Integers, s: Record, b: int, start: float) -> tuple[float, float]:
    """The velocity that body b of a crowd would like: straight to its goal, or past what holds it up, on its right.

    Who turns to the right together passes one another, where by symmetry both would stop for ever; and as no two turn
    by the same angle, so does a ring of many.
    """
    dx, dy = f[s.body_goal_x + b] - f[s.body_x + b], f[s.body_goal_y + b] - f[s.body_y + b]
    distance = length(dx, dy)
    speed = min(f[s.body_speed + b], distance / s.step)
    if speed == 0.0:
        return 0.0, 0.0
    dx, dy = dx / distance, dy / distance
    held_up = 1.0 - max(f[s.body_vx + b] * dx + f[s.body_vy + b] * dy, 0.0) / speed
    if held_up < SAME_SPEED:
        return speed * dx, speed * dy
    key = hash64(k[s.seed], k[s.episode], int(math.floor(start / SIDESTEP_LEG + SAME_INSTANT)), STREAM_SIDESTEP)
    sin, cos = sin_cos(-MAX_SIDESTEP * held_up * uniform(key, walker_number(s, b)))
    return speed * (cos * dx - sin * dy), speed * (sin * dx + cos * dy)


@called
def crowd_velocity(
    f: Floats,
    k: Integers,
    s: Record,
    footprint: Floats,
    members: Integers,
    count: int,
    b: int,
    start: float,
    lines: Floats,
    spare: Floats,
) -> tuple[float, float]:
    """The velocity of body b of a crowd for this step; `members` are the numbers of the `count` bodies that look.

    Bodies beyond reach within b's horizon and this step are left out. A goal is no obstacle to the robots, nor are they to it.
    """
    hard, soft = add_still_half_planes(f, k, s, b, lines), 0
    x, y = f[s.body_x + b], f[s.body_y + b]
    for i in range(count):
        other = members[i]
        if other == b or k[s.body_law + other] != CROWD:
            continue
        px, py = f[s.body_x + other] - x, f[s.body_y + other] - y
        if px == 0.0 and py == 0.0:
            px = SKIN if b < other else -SKIN  # one upon the other: each knows its side
        together = f[s.body_radius + b] + f[s.body_radius + other] + SKIN
        vx, vy = f[s.body_vx + other], f[s.body_vy + other]
        hard, soft = add_avoidance(f, s, b, Disc(px, py, vx, vy, together), 0.5, lines, hard, spare, soft)
    if b < s.discs + s.polygons:
        hard, soft = add_robots(f, k, s, footprint, b, lines, hard, spare, soft)
    for j in range(3 * soft):
        lines[3 * hard + j] = spare[j]
    wish_x, wish_y = wish_of(f, k, s, b, start)
    speed = f[s.body_speed + b]
    vx, vy, failed = nearest_velocity(lines, hard + soft, speed, wish_x, wish_y)
    if failed < hard:
        return 0.0, 0.0  # by rounding: to stand always keeps those
    if failed < hard + soft:
        vx, vy = least_violation(lines, hard, failed, hard + soft, speed, vx, vy, spare)
    return vx, vy


@called
def is_inside(f: Floats, k: Integers, s: Record, first: int, walls: int, x: float, y: float) -> bool:
    """Whether a point lies within the rings that a range of walls makes (even-odd rule)."""
    inside = False
    for w in range(first, first + walls):
        x1, y1, x2, y2 = wall_ends(f, k, s, w)
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            inside = not inside
    return inside


@called
def has_room(f: Floats, k: Integers, s: Record, first: int, walls: int, x: float, y: float, room: float) -> bool:
    """Whether a range of walls keeps this distance from a point."""
    for w in range(first, first + walls):
        x1, y1, x2, y2 = wall_ends(f, k, s, w)
        if point_wall_square(x, y, x1, y1, x2, y2) < room * room:
            return False
    return True


@called
def is_open(f: Floats, k: Integers, s: Record, x: float, y: float, room: float) -> bool:
    """Whether a point lies within the border and keeps this distance from it and from still obstacles."""
    first, walls = k[s.border_first], k[s.border_walls]
    if not is_inside(f, k, s, first, walls, x, y) or not has_room(f, k, s, first, walls, x, y, room):
        return False
    if is_taken(f, s, k[s.moving_disc_count], k[s.disc_count], x, y, room):
        return False
    for number in range(k[s.moving_polygon_count], k[s.polygon_count]):
        first, walls = k[s.polygon_first + number], k[s.polygon_walls + number]
        if is_inside(f, k, s, first, walls, x, y) or not has_room(f, k, s, first, walls, x, y, room):
            return False
    return True


@called
def draw_free_goal(f: Floats, k: Integers, s: Record, b: int) -> None:
    """Put body b's goal to a place that is free for it, or to its own where none is found."""
    xmin, ymin, xmax, ymax = math.inf, math.inf, -math.inf, -math.inf
    for w in range(k[s.border_first], k[s.border_first] + k[s.border_walls]):
        x, y = f[s.corner + 2 * w], f[s.corner + 2 * w + 1]
        xmin, ymin, xmax, ymax = min(xmin, x), min(ymin, y), max(xmax, x), max(ymax, y)
    key = hash64(k[s.seed], k[s.episode], k[s.body_leg + b], STREAM_CROWD)
    k[s.body_leg + b] += 1
    first = 2 * GOAL_TRIES * walker_number(s, b)
    f[s.body_goal_x + b], f[s.body_goal_y + b] = f[s.body_x + b], f[s.body_y + b]
    for i in range(GOAL_TRIES):
        x, y = between(key, first + 2 * i, xmin, xmax), between(key, first + 2 * i + 1, ymin, ymax)
        if is_open(f, k, s, x, y, f[s.body_radius + b]):
            f[s.body_goal_x + b], f[s.body_goal_y + b] = x, y
            return


@called
def take_goal(f: Floats, k: Integers, s: Record, b: int, now: float) -> None:
    """Give body b of a crowd the goal whose turn it is, and the time when it gives that up."""
    count = k[s.way_count + b]
    if count > 0:
        w = k[s.way_first + b] + k[s.way_next + b]
        f[s.body_goal_x + b], f[s.body_goal_y + b] = f[s.way_x + w], f[s.way_y + w]
    else:
        draw_free_goal(f, k, s, b)
    distance = length(f[s.body_goal_x + b] - f[s.body_x + b], f[s.body_goal_y + b] - f[s.body_y + b])
    speed = f[s.body_speed + b]
    f[s.body_patience + b] = now + PATIENCE + DETOUR * distance / speed if speed > 0.0 else math.inf


@called
def go_on_from_goal(f: Floats, k: Integers, s: Record, b: int, now: float) -> None:
    """Take the next goal where body b of a crowd has reached its own, or has tried for too long."""
    if k[s.way_count + b] == 1:
        return  # the way ends there
    distance = length(f[s.body_goal_x + b] - f[s.body_x + b], f[s.body_goal_y + b] - f[s.body_y + b])
    reached = distance <= max(f[s.body_radius + b], f[s.body_speed + b] * s.step)
    if reached or now >= f[s.body_patience + b]:
        if k[s.way_count + b] > 0:
            k[s.way_next + b] = (k[s.way_next + b] + 1) % k[s.way_count + b]
        take_goal(f, k, s, b, now)


# Evade.


@called
def keeps(lines: Floats, count: int, vx: float, vy: float) -> bool:
    """Whether a velocity lies within half planes."""
    for i in range(count):
        if lines[3 * i] * vx + lines[3 * i + 1] * vy < lines[3 * i + 2] - SAME_SPEED:
            return False
    return True


@called
def slide(lines: Floats, count: int, wish_x: float, wish_y: float, vx: float, vy: float) -> tuple[float, float]:
    """The velocity of the wish's speed nearest in direction to it within half planes that let v = 0 through.

    Of two that are as near the one ahead of (vx, vy) is taken. Where all would lead back it is the nearest velocity of
    any speed.
    """
    if keeps(lines, count, wish_x, wish_y):
        return wish_x, wish_y
    square = wish_x * wish_x + wish_y * wish_y
    best, best_x, best_y = -math.inf, 0.0, 0.0
    for i in range(count):
        nx, ny, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
        room = square - c * c
        if room <= 0.0:
            continue
        for side in (-1.0, 1.0):
            along = side * math.sqrt(room)
            x, y = c * nx - along * ny, c * ny + along * nx
            score = x * wish_x + y * wish_y
            if score < CORNERED * square or not keeps(lines, count, x, y):
                continue
            score += 0.1 * (x * vx + y * vy)
            if score > best:
                best, best_x, best_y = score, x, y
    if best > -math.inf:
        return best_x, best_y
    x, y, failed = nearest_velocity(lines, count, math.sqrt(square), wish_x, wish_y)
    return (x, y) if failed == count else (0.0, 0.0)


@called
def evade_velocity(f: Floats, k: Integers, s: Record, b: int, start: float, lines: Floats) -> tuple[float, float]:
    """The velocity of body b, which flees the nearest robot in sight and else wanders at its calm speed."""
    x, y = f[s.body_x + b], f[s.body_y + b]
    nearest, wish_x, wish_y = math.inf, 0.0, 0.0
    for r in range(s.robots):
        dx, dy = x - f[s.pose + 3 * r], y - f[s.pose + 3 * r + 1]
        distance = length(dx, dy)
        if 0.0 < distance < nearest:
            nearest, wish_x, wish_y = distance, dx / distance, dy / distance
    speed = f[s.body_speed + b]
    if nearest > f[s.body_foresight + b]:
        speed = f[s.body_calm + b]
        leg = int(math.floor(start / WANDER_LEG + SAME_INSTANT))
        key = hash64(k[s.seed], k[s.episode], leg, STREAM_EVADE)
        wish_y, wish_x = sin_cos(2.0 * math.pi * uniform(key, walker_number(s, b)))
    if speed == 0.0:
        return 0.0, 0.0
    count = add_still_half_planes(f, k, s, b, lines)
    return slide(lines, count, speed * wish_x, speed * wish_y, f[s.body_vx + b], f[s.body_vy + b])


# Replay.


@called
def is_there(f: Floats, k: Integers, s: Record, b: int, time: float) -> bool:
    """Whether body b is in the world at a time: a mover from its first to its last record, a goal always."""
    first = k[s.way_first + b]
    last = first + k[s.way_count + b] - 1
    begin: float = f[s.way_time + first] - SAME_INSTANT
    end: float = f[s.way_time + last] + SAME_INSTANT
    first_goal: int = s.discs + s.polygons
    return b >= first_goal or begin <= time <= end


@called
def recorded_place(f: Floats, k: Integers, s: Record, b: int, time: float) -> tuple[float, float]:
    """Where body b is at a time, straight between two records; times may only rise from call to call."""
    first, count = k[s.way_first + b], k[s.way_count + b]
    while k[s.way_next + b] + 1 < count and f[s.way_time + first + k[s.way_next + b] + 1] <= time:
        k[s.way_next + b] += 1
    w = first + k[s.way_next + b]
    x, y, since = f[s.way_x + w], f[s.way_y + w], time - f[s.way_time + w]
    if w + 1 == first + count or since <= 0.0:
        return x, y
    share = since / (f[s.way_time + w + 1] - f[s.way_time + w])
    return x + share * (f[s.way_x + w + 1] - x), y + share * (f[s.way_y + w + 1] - y)


@called
def follow_record(f: Floats, k: Integers, s: Record, b: int, start: float, end: float) -> None:
    """Bring body b to where it is at `start`, or where it appears, with the velocity to where it is at `end`.

    It is there in this step if it is there at the step's end.
    """
    if is_there(f, k, s, b, end):
        f[s.body_x + b], f[s.body_y + b] = recorded_place(f, k, s, b, start)
        x, y = recorded_place(f, k, s, b, end)
        f[s.body_vx + b] = (x - f[s.body_x + b]) / (end - start)
        f[s.body_vy + b] = (y - f[s.body_y + b]) / (end - start)
    else:
        f[s.body_x + b], f[s.body_y + b] = AWAY, AWAY
        f[s.body_vx + b], f[s.body_vy + b] = 0.0, 0.0


# All three.


@called
def begin_steered(f: Floats, k: Integers, s: Record, b: int) -> None:
    """Start the episode of a body that looks."""
    f[s.body_event + b] = math.inf
    f[s.body_vx + b], f[s.body_vy + b] = 0.0, 0.0
    k[s.way_next + b] = 0
    law = k[s.body_law + b]
    if law == CROWD:
        take_goal(f, k, s, b, 0.0)
        dx, dy = f[s.body_goal_x + b] - f[s.body_x + b], f[s.body_goal_y + b] - f[s.body_y + b]
        distance = length(dx, dy)
        if distance > 0.0:
            f[s.body_vx + b] = f[s.body_speed + b] * dx / distance
            f[s.body_vy + b] = f[s.body_speed + b] * dy / distance
    elif law == REPLAY:
        if is_there(f, k, s, b, 0.0):
            f[s.body_x + b], f[s.body_y + b] = recorded_place(f, k, s, b, 0.0)
            x, y = recorded_place(f, k, s, b, s.step)
            f[s.body_vx + b], f[s.body_vy + b] = (x - f[s.body_x + b]) / s.step, (y - f[s.body_y + b]) / s.step
            k[s.way_next + b] = 0
        else:
            f[s.body_x + b], f[s.body_y + b] = AWAY, AWAY


@called
def steer_bodies(
    f: Floats,
    k: Integers,
    s: Record,
    footprint: Floats,
    start: float,
    end: float,
    scratch: Floats,
    scratch_int: Integers,
) -> None:
    """Give each body that looks its velocity from `start` to `end`; all of them look before the first one goes."""
    count = 0
    for b in range(s.bodies):
        if k[s.body_law + b] >= CROWD:
            scratch_int[count] = b
            count += 1
    chosen = scratch[: 2 * count]
    room = (scratch.size - 2 * count) // 6 * 3
    lines = scratch[2 * count : 2 * count + room]
    spare = scratch[2 * count + room : 2 * count + 2 * room]
    for i in range(count):
        b = scratch_int[i]
        law = k[s.body_law + b]
        if law == REPLAY:
            follow_record(f, k, s, b, start, end)
            chosen[2 * i], chosen[2 * i + 1] = f[s.body_vx + b], f[s.body_vy + b]
        elif law == EVADE:
            chosen[2 * i], chosen[2 * i + 1] = evade_velocity(f, k, s, b, start, lines)
        else:
            go_on_from_goal(f, k, s, b, start)
            chosen[2 * i], chosen[2 * i + 1] = crowd_velocity(
                f, k, s, footprint, scratch_int, count, b, start, lines, spare
            )
    for i in range(count):
        b = scratch_int[i]
        f[s.body_vx + b], f[s.body_vy + b] = chosen[2 * i], chosen[2 * i + 1]
