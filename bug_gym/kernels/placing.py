"""Placing the obstacles, start and goal of a `field` world."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.geometry import length, sin_cos
from bug_gym.kernels.layout import (
    BOUNCE,
    BOUNCE_BIT,
    CROWD,
    CROWD_BIT,
    RANDOM_WALK,
    STILL,
    STREAM_WORLD,
    WALK_BIT,
    Floats,
    Integers,
    Record,
)
from bug_gym.kernels.randomness import between, hash64, uniform

TRIES = 1000  # for one obstacle
ATTEMPTS = 20  # at a whole world
PLACED = frozenset(
    [
        *("seed", "episode", "pose", "goal_body", "corner", "wall_next", "border_first", "border_walls"),
        *("body_x", "body_y", "body_radius", "body_vx", "body_vy", "body_speed", "body_law", "body_leg"),
        *("leg_min", "leg_max", "body_foresight", "body_calm"),
        *("polygon_first", "polygon_walls", "polygon_side", "polygon_count", "moving_polygon_count"),
        *("disc_count", "moving_disc_count", "wall_count", "moving_wall_count"),
    ]
)
"""The arrays of a row that are written here (seed and episode by who asks for a world)."""


@called
def place_start_and_goal(f: Floats, s: Record, p: Record, key: np.uint64, draw: int) -> int:
    """Draw the robots' starts (side by side, 2 m apart) and the goal; returns the next draw, or -1 where none fits."""
    goal = s.discs + s.polygons
    side = s.robots - 1.0  # the outermost robot stands this far from the middle [m]
    room = s.body_reach + p.start_edge
    for _ in range(TRIES):
        x = between(key, draw, p.start_xmin, p.start_xmax)
        y = between(key, draw + 1, p.start_ymin, p.start_ymax)
        heading = p.start_heading
        if math.isnan(heading):
            heading = between(key, draw + 2, -math.pi, math.pi)
        gx = between(key, draw + 3, p.goal_xmin, p.goal_xmax)
        gy = between(key, draw + 4, p.goal_ymin, p.goal_ymax)
        draw += 5
        clear = min(min(gx - p.xmin, p.xmax - gx), min(gy - p.ymin, p.ymax - gy)) >= p.goal_edge
        sin, cos = sin_cos(heading)
        for r in range(s.robots):
            offset = 2.0 * r - side
            rx, ry = x - offset * sin, y + offset * cos
            clear &= min(min(rx - p.xmin, p.xmax - rx), min(ry - p.ymin, p.ymax - ry)) >= room
            clear &= length(rx - gx, ry - gy) >= p.separation
            f[s.pose + 3 * r] = rx
            f[s.pose + 3 * r + 1] = ry
            f[s.pose + 3 * r + 2] = heading
        if clear:
            f[s.body_x + goal] = gx
            f[s.body_y + goal] = gy
            return draw
    return -1


@inlined
def is_taken(f: Floats, s: Record, begin: int, end: int, x: float, y: float, room: float) -> bool:
    """Whether one of the bodies begin ... end - 1 comes nearer to (x, y) than `room`."""
    for b in range(begin, end):
        dx, dy = x - f[s.body_x + b], y - f[s.body_y + b]
        limit = room + f[s.body_radius + b]
        if dx * dx + dy * dy < limit * limit:
            return True
    return False


@called
def is_free(f: Floats, k: Integers, s: Record, p: Record, x: float, y: float, radius: float, moves: bool) -> bool:
    """Whether an obstacle of this bounding radius may stand at (x, y), given what has been placed before."""
    goal = s.discs + s.polygons
    if length(x - f[s.body_x + goal], y - f[s.body_y + goal]) < radius + p.goal_clearance:
        return False
    room = radius + s.body_reach + p.start_clearance
    for r in range(s.robots):
        if length(x - f[s.pose + 3 * r], y - f[s.pose + 3 * r + 1]) < room:
            return False
    gap = 0.0 if moves else p.gap
    if gap < 0.0:
        return True  # still obstacles may overlap
    return not (
        is_taken(f, s, p.moving_discs, k[s.disc_count], x, y, radius + gap)
        or is_taken(f, s, s.discs + p.moving_polygons, s.discs + k[s.polygon_count], x, y, radius + gap)
    )


@inlined
def is_pedestrian(p: Record, b: int) -> bool:
    """Whether body b is one of the pedestrians, the last of the moving discs."""
    return bool(p.moving_discs - p.pedestrians <= b < p.moving_discs)


@called
def is_crowded(f: Floats, s: Record, p: Record, b: int, x: float, y: float, radius: float) -> bool:
    """Whether a mover of this bounding radius at (x, y) overlaps one of those placed before body b."""
    return is_taken(f, s, 0, min(b, p.moving_discs), x, y, radius) or is_taken(f, s, s.discs, b, x, y, radius)


@called
def place_body(f: Floats, k: Integers, s: Record, p: Record, b: int, moves: bool, key: np.uint64, draw: int) -> int:
    """Draw size and place of body b; returns the next draw, or -1 where nothing is free."""
    crowded = moves and (p.laws & CROWD_BIT != 0 or p.pedestrians > 0)
    size_min, size_max = p.size_min, p.size_max
    if is_pedestrian(p, b):
        size_min, size_max = p.pedestrian_radius, p.pedestrian_radius
    for _ in range(TRIES):
        radius = between(key, draw, size_min, size_max)
        edge = radius if moves else radius + max(p.gap, 0.0)
        x = between(key, draw + 1, p.xmin + edge, p.xmax - edge)
        y = between(key, draw + 2, p.ymin + edge, p.ymax - edge)
        draw += 3
        if p.xmax - p.xmin < 2.0 * edge or p.ymax - p.ymin < 2.0 * edge:
            continue
        if is_free(f, k, s, p, x, y, radius, moves) and not (crowded and is_crowded(f, s, p, b, x, y, radius)):
            f[s.body_x + b] = x
            f[s.body_y + b] = y
            f[s.body_radius + b] = radius
            k[s.body_law + b] = STILL
            return draw
    return -1


@called
def law_in_turn(laws: int, number: int) -> int:
    """The law of mover number `number`, where the laws of these bits take turns."""
    bits = (laws & 1) + (laws >> 1 & 1) + (laws >> 2 & 1)
    turn = number % 3 if bits == 3 else number & (bits - 1)  # number % bits would divide, for each mover of each world
    if laws & BOUNCE_BIT:
        if turn == 0:
            return BOUNCE
        turn -= 1
    return RANDOM_WALK if laws & WALK_BIT and turn == 0 else CROWD


@called
def set_motion(f: Floats, k: Integers, s: Record, p: Record, b: int, number: int, key: np.uint64, draw: int) -> int:
    """Give mover number `number` its law and speed; returns the next draw, after that of its heading (`set_headings`)."""
    if is_pedestrian(p, b):
        k[s.body_law + b] = CROWD
        speed = between(key, draw, p.pedestrian_speed_min, p.pedestrian_speed_max)
    else:
        k[s.body_law + b] = law_in_turn(p.laws, number)
        speed = between(key, draw, p.speed_min, p.speed_max)
    k[s.body_leg + b] = draw + 1
    f[s.body_speed + b] = speed
    f[s.leg_min + b] = p.leg_min
    f[s.leg_max + b] = p.leg_max
    if k[s.body_law + b] == CROWD:
        f[s.body_foresight + b] = p.horizon
    return draw + 2


@called
def set_headings(f: Floats, k: Integers, s: Record, begin: int, count: int, key: np.uint64) -> None:
    """Send movers begin ... begin + count - 1 off, each by the draw that `set_motion` has left for it in `body_leg`.

    All at once and apart from what may be drawn in vain, as processors turn several angles into sines at a time.
    """
    leg, speed = np.uint64(s.body_leg + begin), np.uint64(s.body_speed + begin)
    vx, vy = np.uint64(s.body_vx + begin), np.uint64(s.body_vy + begin)
    for j in range(np.uint64(count)):
        sin, cos = sin_cos(between(key, k[leg + j], -math.pi, math.pi))
        k[leg + j] = 0
        f[vx + j] = f[speed + j] * cos
        f[vy + j] = f[speed + j] * sin


@inlined
def add_wall(f: Floats, k: Integers, s: Record, w: int, x: float, y: float, after: int) -> None:
    """Write wall w, which begins at (x, y) and ends where wall `after` begins."""
    f[s.corner + 2 * w] = x
    f[s.corner + 2 * w + 1] = y
    k[s.wall_next + w] = after


@called
def shape_polygon(f: Floats, k: Integers, s: Record, p: Record, number: int, key: np.uint64, draw: int) -> int:
    """Give polygon `number` its corners, star-shaped round its place; returns the next draw.

    A corner lies in each equal sector, at most 0.4 of a sector off its middle: neighbours are less than half a turn
    apart, so the polygon is simple; the first corner lies on the bounding circle.
    """
    b = s.discs + number
    radius = f[s.body_radius + b]
    corners = 4 if p.squares else 3 + int(uniform(key, draw) * 5.0)
    turn = between(key, draw + 1, -math.pi, math.pi)
    draw += 2
    x0, y0 = 0.0, 0.0  # the walls of a moving polygon are kept relative to its place
    if number >= p.moving_polygons:
        x0, y0 = f[s.body_x + b], f[s.body_y + b]
    shift = 0.0 if p.squares else between(key, draw, -0.2, 0.2)
    sin, cos = sin_cos(turn + 2.0 * math.pi * shift / corners)
    first = k[s.wall_count]
    last = first + corners - 1
    add_wall(f, k, s, first, x0 + radius * cos, y0 + radius * sin, first + 1)
    for i in range(1, corners):
        reach = radius
        if p.squares:
            sin, cos = cos, -sin
        else:
            sin, cos = sin_cos(turn + 2.0 * math.pi * (i + between(key, draw + 2 * i, -0.2, 0.2)) / corners)
            reach = radius * between(key, draw + 2 * i + 1, 0.6, 1.0)
        after = first + i + 1 if first + i < last else first
        add_wall(f, k, s, first + i, x0 + reach * cos, y0 + reach * sin, after)
    k[s.polygon_first + number] = first
    k[s.polygon_walls + number] = corners
    k[s.polygon_side + number] = 1
    k[s.wall_count] = first + corners
    return draw + 2 * corners


@called
def place_border(f: Floats, k: Integers, s: Record, p: Record) -> None:
    """Append the four walls of the bounds."""
    w = k[s.wall_count]
    add_wall(f, k, s, w, p.xmin, p.ymin, w + 1)
    add_wall(f, k, s, w + 1, p.xmax, p.ymin, w + 2)
    add_wall(f, k, s, w + 2, p.xmax, p.ymax, w + 3)
    add_wall(f, k, s, w + 3, p.xmin, p.ymax, w)
    k[s.border_first] = w
    k[s.border_walls] = 4
    k[s.wall_count] = w + 4


@called
def place_obstacles(f: Floats, k: Integers, s: Record, p: Record, key: np.uint64, draw: int) -> int:
    """Place all obstacles, the still ones first; returns the next draw, or -1 - (how many found a place)."""
    placed = 0
    k[s.disc_count] = p.moving_discs
    k[s.polygon_count] = p.moving_polygons
    for b in range(s.discs + p.polygons):
        f[s.body_radius + b] = 0.0  # what finds no place covers nothing
    for m in range(p.moving_discs, p.discs):
        draw = place_body(f, k, s, p, m, False, key, draw)
        if draw < 0:
            return -1 - placed
        k[s.disc_count] = m + 1
        placed += 1
    for number in range(p.moving_polygons, p.polygons):
        draw = place_body(f, k, s, p, s.discs + number, False, key, draw)
        if draw < 0:
            return -1 - placed
        k[s.polygon_count] = number + 1
        placed += 1
    for m in range(p.moving_discs):
        draw = place_body(f, k, s, p, m, True, key, draw)
        if draw < 0:
            return -1 - placed
        draw = set_motion(f, k, s, p, m, m, key, draw)
        placed += 1
    for number in range(p.moving_polygons):
        b = s.discs + number
        draw = place_body(f, k, s, p, b, True, key, draw)
        if draw < 0:
            return -1 - placed
        draw = set_motion(f, k, s, p, b, p.moving_discs + number, key, draw)
        placed += 1
    set_headings(f, k, s, 0, p.moving_discs, key)
    set_headings(f, k, s, s.discs, p.moving_polygons, key)
    return draw


@called
def place_field(f: Floats, k: Integers, s: Record, p: Record) -> int:
    """Draw the whole world of a row from its seed and episode.

    Returns the number of obstacles that found a place in the best attempt: all of them, or the row is unusable; -1
    where even start and goal did not fit.
    """
    key = hash64(k[s.seed], k[s.episode], 0, STREAM_WORLD)
    goal = s.discs + s.polygons
    for r in range(s.robots):
        k[s.goal_body + r] = goal
    draw = 0
    best = -1
    for _ in range(ATTEMPTS):
        start = place_start_and_goal(f, s, p, key, draw)
        if start < 0:
            return best
        result = place_obstacles(f, k, s, p, key, start)
        if result >= 0:
            draw = result
            best = p.discs + p.polygons
            break
        best = max(best, -1 - result)
        draw = start + 3 * TRIES * (1 - result)  # fresh numbers for the next attempt
    if best < p.discs + p.polygons:
        return best
    k[s.moving_disc_count] = p.moving_discs
    k[s.moving_polygon_count] = p.moving_polygons
    k[s.wall_count] = 0
    for number in range(p.moving_polygons):
        draw = shape_polygon(f, k, s, p, number, key, draw)
    k[s.moving_wall_count] = k[s.wall_count]
    place_border(f, k, s, p)
    for number in range(p.moving_polygons, p.polygons):
        draw = shape_polygon(f, k, s, p, number, key, draw)
    f[s.body_radius + goal] = max(p.goal_clearance, max(s.goal_radius, s.body_reach))
    k[s.body_law + goal] = p.target_law
    k[s.body_leg + goal] = 0
    f[s.body_speed + goal] = p.target_speed
    f[s.body_vx + goal] = p.target_vx
    f[s.body_vy + goal] = p.target_vy
    if p.target_law == BOUNCE and math.isnan(p.target_vx):
        angle = between(key, draw, -math.pi, math.pi)
        f[s.body_vx + goal] = p.target_speed * math.cos(angle)
        f[s.body_vy + goal] = p.target_speed * math.sin(angle)
    f[s.leg_min + goal] = p.leg_min
    f[s.leg_max + goal] = p.leg_max
    if p.target_law >= CROWD:
        f[s.body_foresight + goal] = p.target_foresight
        f[s.body_calm + goal] = p.target_calm
    return best


@kernel
def place_fields(floats: Floats, ints: Integers, spec: Record, field: Record, rows: Integers, placed: Integers) -> None:
    """Draw the worlds `rows` (n,); `placed` (n,) says how many obstacles found a place in each."""
    s = spec[0]
    p = field[0]
    for i in range(rows.size):
        n = rows[i]
        placed[i] = place_field(floats[n], ints[n], s, p)
