"""Compiled code of the world: move, collide, judge, cast rays, place obstacles.

A kernel works on one row (one world) at a time. A row is two flat arrays, `floats` (Wf,) float64 and `ints` (Wi,)
int64; `spec` (one record of `SPEC`) says where each named array begins in them and holds the constants of the scenario.
World index first, always; a row never reads another row, so results depend neither on the batch nor on the threads.

All kernels live in this file: numba's cache does not notice a change of a compiled callee in another file.
No fastmath: the same arithmetic in a batch of one and of thousands, bit for bit.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.core import cgutils as numba_cgutils

from bug_gym.compiling import called, inlined, kernel, vectors

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Ranges = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]
Record = Any  # of SPEC or FIELD; numba reads its fields as attributes


def is_compiled() -> bool:
    """Whether the kernels are ready: compiled in this process, or kept on disk by numba's cache."""
    dispatcher: Any = step_rows
    return bool(dispatcher.signatures) or any(Path(dispatcher.stats.cache_path).glob("kernels.step_rows-*.nbi"))


# ---------------------------------------------------------------------------------------------- codes

RUNNING, SUCCESS, COLLISION, TIMEOUT = 0, 1, 2, 3
HOLONOMIC, DIFFERENTIAL = 0, 1
STILL, BOUNCE, WAYPOINTS, RANDOM_WALK, CROWD, EVADE, REPLAY = 0, 1, 2, 3, 4, 5, 6
TERMS = 6  # progress, goal, collision, step, clearance, smoothness
BORDER = -1  # polygon number of the border's wall segments
MAX_VERTICES = 7  # of a polygon made by place_field
TERRAIN_HEADINGS, TERRAIN_RINGS, TERRAIN_STEP = 32, 16, 0.25  # samples of the ground: bearings, and distances [m]

# Streams of the counter-based random numbers: one for each use, so that none shares numbers with another.
STREAM_WORLD, STREAM_RANGES, STREAM_ODOMETRY, STREAM_WALK, STREAM_POLICY = 1, 2, 3, 4, 5
STREAM_CROWD, STREAM_SIDESTEP, STREAM_EVADE = 6, 7, 8

# Arrays with one number a body in worlds where some look before each step, and none in the others.
STEERED_ARRAYS = ("body_goal_x", "body_goal_y", "body_patience", "body_foresight", "body_calm")

# The record that describes a row. Fields named like an array of the row hold the index where that array begins.
FLOAT_ARRAYS = (
    "time",
    "fastest",
    "pose",
    "velocity",
    "next_pose",
    "odometry",
    "origin",
    "command",
    "goal_distance",
    "path_length",
    "clearance",
    "min_clearance",
    "reward",
    "terms",
    "body_x",
    "body_y",
    "body_vx",
    "body_vy",
    "body_radius",
    "body_event",
    "body_turned",
    "last_x",
    "last_y",
    "body_nx",
    "body_ny",
    "body_speed",
    "leg_min",
    "leg_max",
    "way_x",
    "way_y",
    "way_time",
    "wall",
    *STEERED_ARRAYS,
)
INT_ARRAYS = (
    "seed",
    "episode",
    "steps",
    "disc_count",
    "moving_disc_count",
    "polygon_count",
    "moving_polygon_count",
    "wall_count",
    "moving_wall_count",
    "steered_count",
    "outcome",
    "goal_body",
    "body_law",
    "body_leg",
    "way_first",
    "way_count",
    "way_next",
    "way_loops",
    "polygon_first",
    "polygon_walls",
    "polygon_side",
    "border_first",
    "border_walls",
)
COUNTS = ("robots", "discs", "polygons", "goals", "bodies", "walls", "ways", "beams", "footprint", "width")
INT_CONSTANTS = ("kinematics", "limit_steps", "goal_by_odometry", "regions")
FLOAT_CONSTANTS = (
    "step",
    "max_speed",
    "max_reverse",
    "max_turn_rate",
    "max_acceleration",
    "body_reach",
    "goal_radius",
    "reach",
    "min_range",
    "first_angle",
    "angle_step",
    "range_noise",
    "dropout",
    "translation_noise",
    "rotation_noise",
    "translation_bias",
    "rotation_bias",
    "clearance_scale",
    "span",
    "weight_progress",
    "weight_goal",
    "weight_collision",
    "weight_step",
    "weight_clearance",
    "weight_smoothness",
)
SPEC = np.dtype(
    [(name, np.int64) for name in FLOAT_ARRAYS + INT_ARRAYS + COUNTS + INT_CONSTANTS]
    + [(name, np.float64) for name in FLOAT_CONSTANTS]
)

# What `place_fields` needs to know of a `field` scenario.
FIELD = np.dtype(
    [
        (name, np.int64)
        for name in (
            "discs",
            "moving_discs",
            "pedestrians",
            "polygons",
            "moving_polygons",
            "squares",
            "laws",
            "target_law",
        )
    ]
    + [
        (name, np.float64)
        for name in (
            "xmin",
            "ymin",
            "xmax",
            "ymax",
            "size_min",
            "size_max",
            "speed_min",
            "speed_max",
            "gap",
            "separation",
            "start_clearance",
            "goal_clearance",
            "start_xmin",
            "start_ymin",
            "start_xmax",
            "start_ymax",
            "start_heading",
            "goal_xmin",
            "goal_ymin",
            "goal_xmax",
            "goal_ymax",
            "target_speed",
            "target_vx",
            "target_vy",
            "leg_min",
            "leg_max",
            "pedestrian_radius",
            "pedestrian_speed_min",
            "pedestrian_speed_max",
            "horizon",
            "target_foresight",
            "target_calm",
        )
    ]
)

# ---------------------------------------------------------------------------------------------- plane geometry

TWO_PI = 2.0 * math.pi
HALF_PI = 0.5 * math.pi

# pi / 2 in three parts, the first two with so few bits that their multiples are exact, and 1.5 * 2^52, to which adding
# a number rounds it.
HALF_PI_HIGH, HALF_PI_MIDDLE, HALF_PI_LOW = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
ROUNDING = 6755399441055744.0
SINE_3, SINE_5, SINE_7, SINE_9, SINE_11, SINE_13, SINE_15, SINE_17 = (
    (-1.0) ** (n // 2) / math.factorial(n) for n in range(3, 18, 2)
)
COSINE_4, COSINE_6, COSINE_8, COSINE_10, COSINE_12, COSINE_14, COSINE_16 = (
    (-1.0) ** (n // 2) / math.factorial(n) for n in range(4, 17, 2)
)


@inlined
def sin_cos(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad] of up to a thousand turns, within 2 units in the last place.

    Taylor's series on an eighth of a turn. Both at once, copied into the caller, and the same on every machine:
    libraries differ in the last place.
    """
    quarter = angle * (2.0 / math.pi) + ROUNDING - ROUNDING
    turned = np.int64(quarter)
    x = ((angle - quarter * HALF_PI_HIGH) - quarter * HALF_PI_MIDDLE) - quarter * HALF_PI_LOW
    z = x * x
    tail = z * (SINE_9 + z * (SINE_11 + z * (SINE_13 + z * (SINE_15 + z * SINE_17))))
    small_sin = x + x * z * (SINE_3 + z * (SINE_5 + z * (SINE_7 + tail)))
    tail = z * (COSINE_10 + z * (COSINE_12 + z * (COSINE_14 + z * COSINE_16)))
    small_cos = 1.0 - (0.5 * z - z * z * (COSINE_4 + z * (COSINE_6 + z * (COSINE_8 + tail))))
    sin = small_cos if turned & 1 else small_sin
    cos = small_sin if turned & 1 else small_cos
    return -sin if turned & 2 else sin, -cos if (turned + 1) & 2 else cos


@inlined
def length(x: float, y: float) -> float:
    """Length of a vector. Lengths here are far from where a square overflows."""
    return math.sqrt(x * x + y * y)


# ---------------------------------------------------------------------------------------------- random numbers


# splitmix64 of Steele, Lea and Flood (2014): a Weyl sequence and a mixing of 64 bits.
WEYL = np.uint64(0x9E3779B97F4A7C15)


@inlined
def _mix64(x: np.uint64) -> np.uint64:
    x = np.uint64(x)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel
def hash64(seed: int, episode: int, time: int, stream: int) -> np.uint64:
    """Key of all that is drawn for `stream` at this time of this episode; four int64 -> uint64."""
    key = _mix64(np.uint64(seed) + WEYL)
    key = _mix64((key ^ np.uint64(episode)) + WEYL)
    key = _mix64((key ^ np.uint64(time)) + WEYL)
    return _mix64((key ^ np.uint64(stream)) + WEYL)


@kernel
def uniform(key: np.uint64, index: int) -> float:
    """Number `index` of `key`, uniform in [0, 1), 53 bits."""
    return np.float64(_mix64(np.uint64(key) + (np.uint64(index) + np.uint64(1)) * WEYL) >> np.uint64(11)) * 2.0**-53


@inlined
def between(key: np.uint64, draw: int, low: float, high: float) -> float:
    """Draw number `draw` of the stream, uniform in [low, high)."""
    return low + (high - low) * uniform(key, draw)


@called
def normal(key: np.uint64, index: int) -> float:
    """Number `index` of `key`, of the standard normal distribution (Box-Muller). Independent of `uniform`'s numbers."""
    own_key = _mix64(np.uint64(key) ^ np.uint64(0xD1B54A32D192ED03))
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(own_key, 2 * index)))
    return radius * math.cos(TWO_PI * uniform(own_key, 2 * index + 1))


# ---------------------------------------------------------------------------------------------- contact on chords
# "Chord" is the straight way of one step, as a fraction from 0 to 1. Everything is tested in the frame of one of the
# two bodies, so that one moving thing is left. NEVER means: no contact on this chord.

NEVER = 2.0


@called
def disc_contact(dx: float, dy: float, ex: float, ey: float, distance: float) -> float:
    """First fraction at which a point from (dx, dy) along (ex, ey) comes within `distance` of the origin, or NEVER."""
    a = ex * ex + ey * ey
    b = dx * ex + dy * ey
    c = dx * dx + dy * dy - distance * distance
    if b >= 0.0:
        return NEVER  # moving away, or standing
    if c <= 0.0:
        return 0.0
    root = b * b - a * c
    if root < 0.0:
        return NEVER
    fraction = c / (-b + math.sqrt(root))
    return fraction if fraction <= 1.0 else NEVER


@inlined
def chord_square(dx: float, dy: float, ex: float, ey: float, end: float) -> float:
    """Square of `nearest_on_chord`."""
    a = ex * ex + ey * ey
    fraction = 0.0
    if a > 0.0:
        fraction = min(max(-(dx * ex + dy * ey) / a, 0.0), end)
    x, y = dx + fraction * ex, dy + fraction * ey
    return x * x + y * y


@called
def nearest_on_chord(dx: float, dy: float, ex: float, ey: float, end: float) -> float:
    """Smallest distance from the origin of a point going from (dx, dy) along (ex, ey) up to the fraction `end`."""
    return math.sqrt(chord_square(dx, dy, ex, ey, end))


@called
def wall_contact(
    px: float, py: float, ex: float, ey: float, x1: float, y1: float, x2: float, y2: float, distance: float
) -> float:
    """First fraction at which a point from (px, py) along (ex, ey) comes within `distance` of a segment, or NEVER."""
    ux, uy = x2 - x1, y2 - y1
    extent = length(ux, uy)
    if extent > 0.0:
        ux, uy = ux / extent, uy / extent
        height = (px - x1) * -uy + (py - y1) * ux  # signed distance to the line
        rate = ex * -uy + ey * ux
        if height < 0.0:
            height, rate = -height, -rate
        # The line is touched no later than the ends.
        if rate >= 0.0:
            if height >= distance:
                return NEVER
        else:
            fraction = max((height - distance) / -rate, 0.0)
            if fraction > 1.0:
                return NEVER
            along = (px + fraction * ex - x1) * ux + (py + fraction * ey - y1) * uy
            if 0.0 <= along <= extent:
                return fraction
    return min(
        disc_contact(px - x1, py - y1, ex, ey, distance),
        disc_contact(px - x2, py - y2, ex, ey, distance),
    )


@inlined
def point_wall_square(px: float, py: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Square of `point_wall_distance`."""
    ux, uy = x2 - x1, y2 - y1
    square = ux * ux + uy * uy
    along = 0.0
    if square > 0.0:
        along = min(max(((px - x1) * ux + (py - y1) * uy) / square, 0.0), 1.0)
    x, y = px - x1 - along * ux, py - y1 - along * uy
    return x * x + y * y


@kernel
def point_wall_distance(px: float, py: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Distance of a point to a segment."""
    return math.sqrt(point_wall_square(px, py, x1, y1, x2, y2))


@called
def nearest_to_wall(
    px: float, py: float, ex: float, ey: float, x1: float, y1: float, x2: float, y2: float, end: float
) -> float:
    """Smallest distance to a segment of a point going from (px, py) along (ex, ey) up to the fraction `end`.

    Only called where there is no contact, so the chord and the segment don't cross and an end point is nearest.
    """
    square = min(
        min(
            point_wall_square(px, py, x1, y1, x2, y2),
            point_wall_square(px + end * ex, py + end * ey, x1, y1, x2, y2),
        ),
        min(
            chord_square(px - x1, py - y1, ex, ey, end),
            chord_square(px - x2, py - y2, ex, ey, end),
        ),
    )
    return math.sqrt(square)


# ---------------------------------------------------------------------------------------------- moving obstacles
# A body moves straight until its next event: it touches something still, reaches a way-point, or takes a new heading.
# Event times are computed once a leg, so a step costs an addition a body however many obstacles there are.


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
        x1, y1 = f[s.wall + 4 * w], f[s.wall + 4 * w + 1]
        x2, y2 = f[s.wall + 4 * w + 2], f[s.wall + 4 * w + 3]
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


@called
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


@called
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


MAX_EVENTS = 32  # of one body in one step; a body wedged in a corner waits until the next step and goes on then


@called
def move_body(f: Floats, k: Integers, s: Record, b: int, start: float, end: float) -> None:
    """Bring body b from its place at `start` to its place at `end`, through all its events between."""
    f[s.last_x + b] = f[s.body_x + b]
    f[s.last_y + b] = f[s.body_y + b]
    f[s.body_turned + b] = end
    now = start
    for _ in range(MAX_EVENTS):
        event = f[s.body_event + b]
        if event > end:
            f[s.body_x + b] += f[s.body_vx + b] * (end - now)
            f[s.body_y + b] += f[s.body_vy + b] * (end - now)
            return
        event = max(event, now)
        f[s.body_x + b] += f[s.body_vx + b] * (event - now)
        f[s.body_y + b] += f[s.body_vy + b] * (event - now)
        now = event
        handle_event(f, k, s, b, now)
    f[s.body_event + b] += end - now


@inlined
def move_range(f: Floats, k: Integers, s: Record, first: int, count: int, start: float, end: float) -> None:
    """Advance the bodies `first` ... `first + count - 1`."""
    x, y = f[s.body_x + first : s.body_x + first + count], f[s.body_y + first : s.body_y + first + count]
    vx, vy = f[s.body_vx + first : s.body_vx + first + count], f[s.body_vy + first : s.body_vy + first + count]
    events = f[s.body_event + first : s.body_event + first + count]
    step = end - start
    due = 0
    for b in range(count):  # apart from the rest, so that it is vectorised
        is_due = events[b] <= end
        time = 0.0 if is_due else step
        x[b] += vx[b] * time
        y[b] += vy[b] * time
        due += int(is_due)
    if due > 0:
        for b in range(count):
            if events[b] <= end:
                move_body(f, k, s, first + b, start, end)


@inlined
def move_bodies(f: Floats, k: Integers, s: Record, start: float, end: float) -> None:
    """Advance discs, polygons and goals from `start` to `end` [s]. Still discs and polygons never change place.

    The walls of a moving polygon are kept relative to its place, so they need no work.
    """
    if k[s.moving_disc_count] > 0:
        move_range(f, k, s, 0, k[s.moving_disc_count], start, end)
    if k[s.moving_polygon_count] > 0:
        move_range(f, k, s, s.discs, k[s.moving_polygon_count], start, end)
    for g in range(s.discs + s.polygons, s.discs + s.polygons + s.goals):
        if f[s.body_event + g] <= end:
            move_body(f, k, s, g, start, end)
        else:
            f[s.body_x + g] += f[s.body_vx + g] * (end - start)
            f[s.body_y + g] += f[s.body_vy + g] * (end - start)


@inlined
def body_motion(f: Floats, s: Record, b: int) -> tuple[float, float]:
    """The way of a moving body in this step, along its chord [m]."""
    if f[s.body_turned + b] == f[s.time]:
        return f[s.body_x + b] - f[s.last_x + b], f[s.body_y + b] - f[s.last_y + b]
    return f[s.body_vx + b] * s.step, f[s.body_vy + b] * s.step


# ---------------------------------------------------------------------------------------------- bodies that look
# Under the laws crowd, evade and replay a body takes a velocity at the start of each step and keeps it to its end, so
# it has no events. A velocity is chosen within half planes n . v >= c, kept as triples (nx, ny, c) in scratch: those of
# still things and of bodies about to touch hold always and let at least v = 0 through; those of the crowd law give way
# where they leave nothing.

WALL_HORIZON = 0.5  # a body comes no nearer to a still thing than would bring it there in this time [s]
SKIN = 0.02  # room that bodies of a crowd leave between them and to robots [m]
PATIENCE, DETOUR = 5.0, 2.0  # a goal is given up after this time [s] and so many times that of the straight way
MAX_SIDESTEP = 1.5  # how far at most a body of a crowd that is held up turns to its right [rad]
SIDESTEP_LEG = 1.0  # for how long it keeps to the angle it has drawn [s]
GOAL_TRIES = 64  # for one goal
WANDER_LEG = 2.0  # time between the headings of an evader that sees no robot [s]
CORNERED = -0.25  # an evader stops rather than run toward a robot more than this (cosine)
AWAY = 1e6  # x and y of a body that isn't there [m]: out of any sensor's and any robot's reach
SAME_SPEED = 1e-9  # [m/s]
SAME_INSTANT = 1e-9  # [s]


def steering_floats(walls: int, bodies: int, circles: int) -> int:
    """Length of the scratch that `steer_bodies` needs; `circles` is how many make up all robots."""
    return 2 * bodies + 6 * (walls + 2 * bodies + 2 * circles)


@called
def edge_range(lines: Floats, i: int, count: int, speed: float) -> tuple[float, float]:
    """The part of half plane i's edge that half planes 0 ... count - 1 and the greatest speed leave: low and high.

    They are positions along (-ny, nx) from the edge's point nearest to v = 0; nothing is left where low > high.
    """
    nx, ny, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
    room = speed * speed - c * c
    if room < 0.0:
        return 1.0, -1.0
    high = math.sqrt(room)
    low = -high
    for j in range(count):
        mx, my = lines[3 * j], lines[3 * j + 1]
        rise = nx * my - ny * mx
        need = lines[3 * j + 2] - c * (nx * mx + ny * my)
        if abs(rise) < 1e-12:  # parallel
            if need > SAME_SPEED:
                return 1.0, -1.0
        elif rise > 0.0:
            low = max(low, need / rise)
        else:
            high = min(high, need / rise)
    if high < low <= high + SAME_SPEED:  # edges that meet in a point, but for rounding
        low = high
    return low, high


@called
def nearest_velocity(lines: Floats, count: int, speed: float, wish_x: float, wish_y: float) -> tuple[float, float, int]:
    """The velocity nearest to a wish within `count` half planes and the greatest speed, by an incremental programme.

    Half planes are taken one after the other; where one cuts off the best velocity so far, the new best one lies on
    its edge.

    Args:
        lines: nx, ny, c of each half plane, one after the other.
        count: how many half planes.
        speed: greatest speed [m/s].
        wish_x: wish [m/s].
        wish_y: wish [m/s].

    Returns:
        vx, vy, and the number of the first half plane that leaves nothing of those before it (`count`: none does).
    """
    norm = length(wish_x, wish_y)
    share = speed / norm if norm > speed else 1.0
    vx, vy = share * wish_x, share * wish_y
    for i in range(count):
        nx, ny, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
        if nx * vx + ny * vy >= c:
            continue
        low, high = edge_range(lines, i, i, speed)
        if low > high:
            return vx, vy, i
        along = min(max(nx * wish_y - ny * wish_x, low), high)
        vx, vy = c * nx - along * ny, c * ny + along * nx
    return vx, vy, count


@called
def farthest_velocity(lines: Floats, count: int, speed: float, nx: float, ny: float) -> tuple[float, float, bool]:
    """The velocity farthest along a unit vector within half planes and the greatest speed; and whether there is one."""
    vx, vy = speed * nx, speed * ny
    for i in range(count):
        mx, my, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
        if mx * vx + my * vy >= c:
            continue
        low, high = edge_range(lines, i, i, speed)
        if low > high:
            return vx, vy, False
        along = high if mx * ny - my * nx > 0.0 else low
        vx, vy = c * mx - along * my, c * my + along * mx
    return vx, vy, True


@called
def least_violation(
    lines: Floats, hard: int, first: int, count: int, speed: float, vx: float, vy: float, spare: Floats
) -> tuple[float, float]:
    """The velocity for which the half planes from `hard` on are missed by the least, the worst of them counted.

    Again one after the other: where one is missed by more than the worst before it, the new best velocity is the one
    farthest along its normal among those for which none before it is missed by more.

    Args:
        lines: nx, ny, c of each half plane.
        hard: how many of them hold always.
        first: number of the first one that could not be kept.
        count: how many half planes.
        speed: greatest speed [m/s].
        vx: a velocity that keeps all before `first` [m/s].
        vy: the same.
        spare: room for as many half planes.
    """
    for j in range(3 * hard):
        spare[j] = lines[j]
    worst = 0.0
    for i in range(first, count):
        nx, ny, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
        if c - nx * vx - ny * vy <= worst:
            continue
        kept = hard
        for j in range(hard, i):
            dx, dy = lines[3 * j] - nx, lines[3 * j + 1] - ny
            apart = length(dx, dy)
            if apart > 1e-12:  # else it is the same normal, and this one asks for more
                kept = add_half_plane(spare, kept, dx / apart, dy / apart, (lines[3 * j + 2] - c) / apart)
        new_x, new_y, found = farthest_velocity(spare, kept, speed, nx, ny)
        if found:
            vx, vy = new_x, new_y
        worst = max(worst, c - nx * vx - ny * vy)
    return vx, vy


@inlined
def add_half_plane(lines: Floats, count: int, nx: float, ny: float, c: float) -> int:
    """Append n . v >= c; returns the new number of half planes."""
    lines[3 * count] = nx
    lines[3 * count + 1] = ny
    lines[3 * count + 2] = c
    return count + 1


@called
def add_wall_half_planes(
    f: Floats,
    s: Record,
    first: int,
    walls: int,
    x: float,
    y: float,
    radius: float,
    near: float,
    horizon: float,
    lines: Floats,
    count: int,
) -> int:
    """Half planes that keep a disc off a range of still walls; returns the new number of half planes."""
    for w in range(first, first + walls):
        x1, y1 = f[s.wall + 4 * w], f[s.wall + 4 * w + 1]
        ux, uy = f[s.wall + 4 * w + 2] - x1, f[s.wall + 4 * w + 3] - y1
        square = ux * ux + uy * uy
        along = min(max(((x - x1) * ux + (y - y1) * uy) / square, 0.0), 1.0)
        dx, dy = x - x1 - along * ux, y - y1 - along * uy
        away = dx * dx + dy * dy
        if away >= near * near:
            continue
        distance = math.sqrt(away)
        gap = max(distance - radius, 0.0)
        if distance == 0.0:
            dx, dy, distance = -uy, ux, math.sqrt(square)
        count = add_half_plane(lines, count, dx / distance, dy / distance, -gap / horizon)
    return count


@called
def add_still_half_planes(f: Floats, k: Integers, s: Record, b: int, lines: Floats) -> int:
    """Half planes that keep body b off still discs, still polygons and the border; returns how many.

    A still thing is a convex piece, a disc or a wall, that lies behind the line through its nearest point square to
    the way there. A body that comes no nearer to that line than the gap never enters it; one that begins too near
    goes no deeper.
    """
    x, y, radius, speed = f[s.body_x + b], f[s.body_y + b], f[s.body_radius + b], f[s.body_speed + b]
    horizon = max(WALL_HORIZON, s.step)
    near = radius + speed * horizon
    count = 0
    for m in range(k[s.moving_disc_count], k[s.disc_count]):
        dx, dy = x - f[s.body_x + m], y - f[s.body_y + m]
        limit = near + f[s.body_radius + m]
        square = dx * dx + dy * dy
        if 0.0 < square < limit * limit:
            distance = math.sqrt(square)
            gap = max(distance - radius - f[s.body_radius + m], 0.0)
            count = add_half_plane(lines, count, dx / distance, dy / distance, -gap / horizon)
    count = add_wall_half_planes(f, s, k[s.border_first], k[s.border_walls], x, y, radius, near, horizon, lines, count)
    for number in range(k[s.moving_polygon_count], k[s.polygon_count]):
        p = s.discs + number
        dx, dy, limit = x - f[s.body_x + p], y - f[s.body_y + p], near + f[s.body_radius + p]
        if dx * dx + dy * dy < limit * limit:
            count = add_wall_half_planes(
                f,
                s,
                k[s.polygon_first + number],
                k[s.polygon_walls + number],
                x,
                y,
                radius,
                near,
                horizon,
                lines,
                count,
            )
    return count


# Crowd: optimal reciprocal collision avoidance of van den Berg, Guy, Lin and Manocha (2011).


@called
def escape_velocity(
    px: float, py: float, vx: float, vy: float, together: float, horizon: float, step: float
) -> tuple[float, float, float, float]:
    """The smallest change u of a relative velocity that avoids contact, and the direction n in which to go on avoiding.

    Args:
        px: place of the other body, seen from this one [m].
        py: the same.
        vx: velocity of this body, seen from the other one [m/s].
        vy: the same.
        together: sum of the radii [m].
        horizon: for so long there is to be no contact [s].
        step: time in which bodies that overlap are to come apart [s].

    Returns:
        ux, uy, nx, ny; n is a unit vector square to the nearest edge of the velocities that lead to contact.
    """
    square = px * px + py * py
    overlap = square <= together * together
    # Velocities that lead to contact: a cone from v = 0 on about p, cut off by the disc of those that do just in time.
    time = step if overlap else horizon
    wx, wy = vx - px / time, vy - py / time
    along = wx * px + wy * py
    norm = length(wx, wy)
    if overlap or (along < 0.0 and along * along > together * together * norm * norm):
        if norm == 0.0:
            wx, wy, norm = -px, -py, math.sqrt(square)
        nx, ny = wx / norm, wy / norm
        short = together / time - norm
        return short * nx, short * ny, nx, ny
    leg = math.sqrt(square - together * together)
    if px * wy - py * wx > 0.0:
        ex, ey = (px * leg - py * together) / square, (px * together + py * leg) / square
    else:
        ex, ey = -(px * leg + py * together) / square, (px * together - py * leg) / square
    along = vx * ex + vy * ey
    return along * ex - vx, along * ey - vy, -ey, ex


@called
def add_avoidance(
    f: Floats,
    s: Record,
    b: int,
    px: float,
    py: float,
    ox: float,
    oy: float,
    together: float,
    share: float,
    lines: Floats,
    hard: int,
    spare: Floats,
    soft: int,
) -> tuple[int, int]:
    """Half planes of body b because of another disc: one that holds always into `lines`, one that may give way `spare`.

    Args:
        f: the row's floats.
        s: the row's record.
        b: the body.
        px: place of the other disc, seen from the body [m].
        py: the same.
        ox: velocity of the other disc [m/s].
        oy: the same.
        together: sum of the radii and the skin [m].
        share: of the avoidance that is this body's: a half where the other does the same, else 1.
        lines: half planes.
        hard: how many there are.
        spare: half planes.
        soft: how many there are.

    Returns:
        The new `hard` and `soft`.
    """
    vx, vy, speed, horizon = f[s.body_vx + b], f[s.body_vy + b], f[s.body_speed + b], f[s.body_foresight + b]
    reach = together + (speed + length(ox, oy)) * horizon
    square = px * px + py * py
    if square >= reach * reach:
        return hard, soft
    distance = math.sqrt(square)
    # Each goes at most its share of the gap this step, so that two never touch however little room a crowd leaves.
    most = share * max(distance - together, 0.0) / s.step
    if most < speed:
        hard = add_half_plane(lines, hard, -px / distance, -py / distance, -most)
    ux, uy, nx, ny = escape_velocity(px, py, vx - ox, vy - oy, together, horizon, s.step)
    soft = add_half_plane(spare, soft, nx, ny, nx * (vx + share * ux) + ny * (vy + share * uy))
    return hard, soft


@called
def add_robots(
    f: Floats, k: Integers, s: Record, footprint: Floats, b: int, lines: Floats, hard: int, spare: Floats, soft: int
) -> tuple[int, int]:
    """Half planes of body b because of the robots, which avoid nobody; returns the new `hard` and `soft`."""
    x, y = f[s.body_x + b], f[s.body_y + b]
    for r in range(s.robots):
        vx, vy = 0.0, 0.0
        if k[s.outcome + r] == RUNNING:
            ahead, left = f[s.velocity + 2 * r], f[s.velocity + 2 * r + 1]
            if s.kinematics == DIFFERENTIAL:
                left = 0.0
            sin, cos = sin_cos(f[s.pose + 3 * r + 2])
            vx, vy = cos * ahead - sin * left, sin * ahead + cos * left
        for c in range(s.footprint):
            cx, cy = body_circle(f, s, footprint, s.pose, r, c)
            if cx != x or cy != y:
                together = f[s.body_radius + b] + footprint[c, 2] + SKIN
                hard, soft = add_avoidance(f, s, b, cx - x, cy - y, vx, vy, together, 1.0, lines, hard, spare, soft)
    return hard, soft


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

    Bodies beyond reach within b's horizon are left out. A goal is no obstacle to the robots, nor are they to it.
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
        hard, soft = add_avoidance(f, s, b, px, py, vx, vy, together, 0.5, lines, hard, spare, soft)
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
def is_inside(f: Floats, s: Record, first: int, walls: int, x: float, y: float) -> bool:
    """Whether a point lies within the rings that a range of walls makes (even-odd rule)."""
    inside = False
    for w in range(first, first + walls):
        x1, y1 = f[s.wall + 4 * w], f[s.wall + 4 * w + 1]
        x2, y2 = f[s.wall + 4 * w + 2], f[s.wall + 4 * w + 3]
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            inside = not inside
    return inside


@called
def has_room(f: Floats, s: Record, first: int, walls: int, x: float, y: float, room: float) -> bool:
    """Whether a range of walls keeps this distance from a point."""
    for w in range(first, first + walls):
        x1, y1 = f[s.wall + 4 * w], f[s.wall + 4 * w + 1]
        if point_wall_square(x, y, x1, y1, f[s.wall + 4 * w + 2], f[s.wall + 4 * w + 3]) < room * room:
            return False
    return True


@called
def is_open(f: Floats, k: Integers, s: Record, x: float, y: float, room: float) -> bool:
    """Whether a point lies within the border and keeps this distance from it and from still obstacles."""
    first, walls = k[s.border_first], k[s.border_walls]
    if not is_inside(f, s, first, walls, x, y) or not has_room(f, s, first, walls, x, y, room):
        return False
    if is_taken(f, s, k[s.moving_disc_count], k[s.disc_count], x, y, room):
        return False
    for number in range(k[s.moving_polygon_count], k[s.polygon_count]):
        first, walls = k[s.polygon_first + number], k[s.polygon_walls + number]
        if is_inside(f, s, first, walls, x, y) or not has_room(f, s, first, walls, x, y, room):
            return False
    return True


@called
def draw_free_goal(f: Floats, k: Integers, s: Record, b: int) -> None:
    """Put body b's goal to a place that is free for it, or to its own where none is found."""
    xmin, ymin, xmax, ymax = math.inf, math.inf, -math.inf, -math.inf
    for w in range(k[s.border_first], k[s.border_first] + k[s.border_walls]):
        x, y = f[s.wall + 4 * w], f[s.wall + 4 * w + 1]
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


# ---------------------------------------------------------------------------------------------- ground
# `regions` holds one after another, for each region: its factor, the centre and the radius of a disc that holds it, the
# number of its edges, and their ends x1, y1, x2, y2. One without edges is that disc.

REGION_HEAD = 5  # numbers before the edges


@inlined
def _samples_before(distance: float) -> np.int64:
    """Bits of the samples at 0, TERRAIN_STEP ... TERRAIN_RINGS * TERRAIN_STEP that are nearer than a distance."""
    count = min(max(math.ceil(distance / TERRAIN_STEP), 0), TERRAIN_RINGS + 1)
    return (np.int64(1) << np.int64(count)) - np.int64(1)


@called
def samples_inside(regions: Floats, at: int, x: float, y: float, cos: float, sin: float) -> np.int64:
    """Bits of the samples along a ray from (x, y) that lie in the region at `regions[at]`; bit 0 is (x, y) itself.

    A point is inside where an odd number of edges crosses the ray beyond it. An end on the ray counts as below it.
    """
    edges = int(regions[at + 4])
    if edges == 0:
        dx, dy, radius = regions[at + 1] - x, regions[at + 2] - y, regions[at + 3]
        along, height = cos * dx + sin * dy, cos * dy - sin * dx
        square = radius * radius - height * height
        half = math.sqrt(max(square, 0.0))
        return _samples_before(along + half) ^ _samples_before(along - half)
    inside = np.int64(0)
    for edge in range(edges):
        first = at + REGION_HEAD + 4 * edge
        ax, ay = regions[first] - x, regions[first + 1] - y
        bx, by = regions[first + 2] - x, regions[first + 3] - y
        a, b = cos * ay - sin * ax, cos * by - sin * bx
        if (a > 0.0) != (b > 0.0):
            near, far = cos * ax + sin * ay, cos * bx + sin * by
            inside ^= _samples_before(near + a / (a - b) * (far - near))
    return inside


@inlined
def factor_at(s: Record, regions: Floats, x: float, y: float) -> float:
    """The largest factor of the regions that hold a point, 1 where none does."""
    factor, at = 1.0, 0
    for _ in range(s.regions):
        dx, dy, radius = regions[at + 1] - x, regions[at + 2] - y, regions[at + 3]
        is_near = regions[at] > factor and dx * dx + dy * dy <= radius * radius
        if is_near and samples_inside(regions, at, x, y, 1.0, 0.0) & 1:
            factor = regions[at]
        at += REGION_HEAD + 4 * int(regions[at + 4])
    return factor


@inlined
def sample_ground(s: Record, regions: Floats, ground: Ranges, x: float, y: float, heading: float) -> None:
    """Fill `ground` (TERRAIN_HEADINGS * TERRAIN_RINGS,) with the factors about a pose, ring by ring in each heading."""
    ground[:] = 1.0
    at = 0
    for _ in range(s.regions):
        factor = np.float32(regions[at])
        dx, dy, reach = regions[at + 1] - x, regions[at + 2] - y, regions[at + 3] + TERRAIN_RINGS * TERRAIN_STEP
        if dx * dx + dy * dy < reach * reach:
            for i in range(TERRAIN_HEADINGS):
                sin, cos = sin_cos(heading + i * (TWO_PI / TERRAIN_HEADINGS))
                inside = samples_inside(regions, at, x, y, cos, sin) >> 1
                for j in range(TERRAIN_RINGS):
                    if inside >> j & 1:
                        ground[TERRAIN_RINGS * i + j] = max(ground[TERRAIN_RINGS * i + j], factor)
        at += REGION_HEAD + 4 * int(regions[at + 4])


# ---------------------------------------------------------------------------------------------- robots


@inlined
def drive(f: Floats, s: Record, regions: Floats, r: int, first: float, second: float) -> None:
    """Turn robot r's action into its velocity and into the pose where this step would bring it (next_pose).

    The ground where its centre is now divides its greatest speeds: it enters a region as slow as that lets it be.
    """
    step = s.step
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    max_speed, max_reverse = s.max_speed, s.max_reverse
    if s.regions > 0:
        factor = factor_at(s, regions, x, y)
        max_speed, max_reverse = max_speed / factor, max_reverse / factor
        slow_down(f, s, r, max_speed, max_reverse)
    if s.kinematics == HOLONOMIC:
        norm = max(length(first, second), 1.0)
        vx, vy = first / norm * max_speed, second / norm * max_speed
        dvx, dvy = vx - f[s.velocity + 2 * r], vy - f[s.velocity + 2 * r + 1]
        change = length(dvx, dvy)
        if change > s.max_acceleration * step:
            share = s.max_acceleration * step / change
            vx, vy = f[s.velocity + 2 * r] + share * dvx, f[s.velocity + 2 * r + 1] + share * dvy
        sin, cos = sin_cos(heading)
        f[s.next_pose + 3 * r] = x + (cos * vx - sin * vy) * step
        f[s.next_pose + 3 * r + 1] = y + (sin * vx + cos * vy) * step
        f[s.next_pose + 3 * r + 2] = heading
        f[s.velocity + 2 * r] = vx
        f[s.velocity + 2 * r + 1] = vy
        return
    speed = -max_reverse + 0.5 * (first + 1.0) * (max_speed + max_reverse)
    limit = s.max_acceleration * step
    speed = min(max(speed, f[s.velocity + 2 * r] - limit), f[s.velocity + 2 * r] + limit)
    rate = second * s.max_turn_rate
    half = 0.5 * rate * step
    # The chord of an arc of angle 2 half: its length over the arc's is sin(half)/half.
    half_sin, _half_cos = sin_cos(half)
    shrink = half_sin / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0
    chord = speed * step * shrink
    sin, cos = sin_cos(heading + half)
    f[s.next_pose + 3 * r] = x + chord * cos
    f[s.next_pose + 3 * r + 1] = y + chord * sin
    f[s.next_pose + 3 * r + 2] = heading + 2.0 * half
    f[s.velocity + 2 * r] = speed
    f[s.velocity + 2 * r + 1] = rate


@inlined
def slow_down(f: Floats, s: Record, r: int, max_speed: float, max_reverse: float) -> None:
    """Cut robot r's velocity of the last step to what the ground under it allows."""
    if s.kinematics == HOLONOMIC:
        speed = length(f[s.velocity + 2 * r], f[s.velocity + 2 * r + 1])
        share = max_speed / speed if speed > max_speed else 1.0
        f[s.velocity + 2 * r] *= share
        f[s.velocity + 2 * r + 1] *= share
    else:
        f[s.velocity + 2 * r] = clip(f[s.velocity + 2 * r], -max_reverse, max_speed)


@inlined
def body_circle(f: Floats, s: Record, footprint: Floats, at: int, r: int, c: int) -> tuple[float, float]:
    """Centre of circle c of robot r's body at the pose stored at `at` (s.pose or s.next_pose)."""
    x, y = f[at + 3 * r], f[at + 3 * r + 1]
    ox, oy = footprint[c, 0], footprint[c, 1]
    if ox == 0.0 and oy == 0.0:
        return x, y
    sin, cos = sin_cos(f[at + 3 * r + 2])
    return x + cos * ox - sin * oy, y + sin * ox + cos * oy


@inlined
def is_beside(footprint: Floats, c: int) -> bool:
    """Whether circle c of the body lies beside the robot's origin: a turn moves it."""
    return bool(footprint[c, 0] != 0.0 or footprint[c, 1] != 0.0)


NO_WALL = -1
SWING = 1e-5  # a circle beside the robot's origin leaves the chords that stand for its way by no more than this [m]


@inlined
def swing(f: Floats, s: Record, footprint: Floats, r: int, c: int) -> tuple[int, float]:
    """How many chords stand for the way of circle c of robot r's body in this step, and how far it leaves them [m].

    While the robot goes straight and turns evenly, a circle beside its origin runs along an arc of a cycloid. Contact is
    tested on the chords with that much more radius: none is missed, and none comes more than SWING too early.
    """
    offset = length(footprint[c, 0], footprint[c, 1])
    turn = abs(f[s.next_pose + 3 * r + 2] - f[s.pose + 3 * r + 2])
    pieces = max(1, math.ceil(turn * math.sqrt(0.125 * offset / SWING)))
    turn /= pieces
    return pieces, 0.125 * offset * turn * turn


@inlined
def swung_circle(f: Floats, s: Record, footprint: Floats, r: int, c: int, share: float) -> tuple[float, float]:
    """Centre of circle c of robot r's body after a share of this step's motion."""
    if share == 0.0:
        return body_circle(f, s, footprint, s.pose, r, c)
    if share == 1.0:
        return body_circle(f, s, footprint, s.next_pose, r, c)
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    x += share * (f[s.next_pose + 3 * r] - x)
    y += share * (f[s.next_pose + 3 * r + 1] - y)
    sin, cos = sin_cos(heading + share * (f[s.next_pose + 3 * r + 2] - heading))
    ox, oy = footprint[c, 0], footprint[c, 1]
    return x + cos * ox - sin * oy, y + sin * ox + cos * oy


@called
def swing_contact(
    f: Floats,
    s: Record,
    footprint: Floats,
    r: int,
    c: int,
    x: float,
    y: float,
    mx: float,
    my: float,
    reach: float,
    w: int,
    end: float,
) -> tuple[float, float]:
    """First contact of circle c of robot r's body with what comes to (x, y) from (x - mx, y - my).

    Args:
        f: the row's floats.
        s: the row's record.
        footprint: circles of the body.
        r: the robot.
        c: the circle, one beside the robot's origin.
        x: place of the disc, or that from which wall w is measured [m].
        y: the same.
        mx: its way in this step [m].
        my: the same.
        reach: distance at which they touch [m].
        w: number of the wall, or NO_WALL: it is a disc.
        end: fraction of the step up to which it counts.

    Returns:
        Fraction of the step or NEVER, and clearance [m].
    """
    first, clearance = NEVER, math.inf
    pieces, margin = swing(f, s, footprint, r, c)
    x0, y0 = body_circle(f, s, footprint, s.pose, r, c)
    for piece in range(pieces):
        finish = min(end * pieces - piece, 1.0)
        if finish < 0.0:
            break
        x1, y1 = swung_circle(f, s, footprint, r, c, (piece + 1) / pieces)
        left = 1.0 - piece / pieces
        px, py = x0 - x + mx * left, y0 - y + my * left
        ex, ey = x1 - x0 - mx / pieces, y1 - y0 - my / pieces
        if w == NO_WALL:
            fraction = disc_contact(px, py, ex, ey, reach + margin)
            gap = nearest_on_chord(px, py, ex, ey, finish)
        else:
            ax, ay, bx, by = f[s.wall + 4 * w], f[s.wall + 4 * w + 1], f[s.wall + 4 * w + 2], f[s.wall + 4 * w + 3]
            fraction = wall_contact(px, py, ex, ey, ax, ay, bx, by, reach + margin)
            gap = nearest_to_wall(px, py, ex, ey, ax, ay, bx, by, finish)
        if fraction <= finish:
            first = min(first, (piece + fraction) / pieces)
        clearance = min(clearance, gap - reach)
        x0, y0 = x1, y1
    return first, clearance


@inlined
def goal_contact(f: Floats, k: Integers, s: Record, r: int) -> float:
    """Fraction of the step at which robot r's centre comes within the goal radius of its goal, or NEVER."""
    g = k[s.goal_body + r]
    mx, my = body_motion(f, s, g)
    dx = f[s.pose + 3 * r] - (f[s.body_x + g] - mx)
    dy = f[s.pose + 3 * r + 1] - (f[s.body_y + g] - my)
    if dx * dx + dy * dy <= s.goal_radius * s.goal_radius:
        return 0.0
    ex = f[s.next_pose + 3 * r] - f[s.pose + 3 * r] - mx
    ey = f[s.next_pose + 3 * r + 1] - f[s.pose + 3 * r + 1] - my
    return disc_contact(dx, dy, ex, ey, s.goal_radius)


@inlined
def disc_contacts(
    f: Floats, k: Integers, s: Record, footprint: Floats, r: int, need: float, end: float, index: Integers
) -> tuple[float, float]:
    """First contact of robot r with discs on its chord up to `end`, and the smallest clearance to them."""
    x0, y0 = f[s.pose + 3 * r], f[s.pose + 3 * r + 1]
    nx, ny = f[s.next_pose + 3 * r], f[s.next_pose + 3 * r + 1]
    moving, count = k[s.moving_disc_count], k[s.disc_count]
    first, clearance = NEVER, math.inf
    near = _find_near_discs(
        f[s.body_x : s.body_x + count],
        f[s.body_y : s.body_y + count],
        f[s.body_radius : s.body_radius + count],
        count,
        nx,
        ny,
        need,
        index,
    )
    for j in range(near):
        m = index[np.uint64(NEAR) + j]
        x, y = f[s.body_x + m], f[s.body_y + m]
        mx, my = 0.0, 0.0
        if m < moving:
            mx, my = body_motion(f, s, m)
        for c in range(s.footprint):
            reach = f[s.body_radius + m] + footprint[c, 2]
            if is_beside(footprint, c):
                fraction, gap = swing_contact(f, s, footprint, r, c, x, y, mx, my, reach, NO_WALL, end)
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
    s: Record,
    footprint: Floats,
    r: int,
    begin: int,
    count: int,
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
        x1, y1 = f[s.wall + 4 * w], f[s.wall + 4 * w + 1]
        x2, y2 = f[s.wall + 4 * w + 2], f[s.wall + 4 * w + 3]
        gap_x = max(max(min(x1, x2) - nx, nx - max(x1, x2)), 0.0)
        gap_y = max(max(min(y1, y2) - ny, ny - max(y1, y2)), 0.0)
        if gap_x * gap_x + gap_y * gap_y >= need * need:
            continue
        for c in range(s.footprint):
            radius = footprint[c, 2]
            if is_beside(footprint, c):
                fraction, gap = swing_contact(f, s, footprint, r, c, bx, by, mx, my, radius, w, end)
                first, clearance = min(first, fraction), min(clearance, gap)
                continue
            fraction = wall_contact(px, py, ex, ey, x1, y1, x2, y2, radius)
            if fraction <= end:
                first = min(first, fraction)
            clearance = min(clearance, nearest_to_wall(px, py, ex, ey, x1, y1, x2, y2, end) - radius)
    return first, clearance


@inlined
def find_near_polygons(
    f: Floats, s: Record, polygons: int, x: float, y: float, reach: float, index: Integers
) -> np.uint64:
    """Lists in index[NEAR:] the polygons whose disc comes within `reach` of (x, y); returns how many."""
    begin = s.body_x + s.discs
    at_y, at_radius = s.body_y + s.discs, s.body_radius + s.discs
    return _find_near_discs(
        f[begin : begin + polygons],
        f[at_y : at_y + polygons],
        f[at_radius : at_radius + polygons],
        polygons,
        x,
        y,
        reach,
        index,
    )


@inlined
def obstacle_contact(
    f: Floats, k: Integers, s: Record, footprint: Floats, r: int, end: float, index: Integers
) -> tuple[float, float]:
    """First contact of robot r with discs and walls on its chord up to `end`, and the smallest clearance.

    Returns (fraction or NEVER, clearance [m]); the clearance is exact where it is below both the episode's smallest
    so far and the reward's scale, else no smaller than those (the caller takes minima only).
    """
    nx, ny = f[s.next_pose + 3 * r], f[s.next_pose + 3 * r + 1]
    turn = abs(f[s.next_pose + 3 * r + 2] - f[s.pose + 3 * r + 2])
    way = length(nx - f[s.pose + 3 * r], ny - f[s.pose + 3 * r + 1])
    slack = way + turn * s.body_reach + f[s.fastest] * s.step
    need = max(f[s.min_clearance + r], s.clearance_scale) + s.body_reach + slack
    first, clearance = NEVER, math.inf
    if k[s.disc_count] > 0:
        first, clearance = disc_contacts(f, k, s, footprint, r, need, end, index)
    contact, gap = wall_contacts(
        f, s, footprint, r, k[s.border_first], k[s.border_walls], 0.0, 0.0, 0.0, 0.0, need, end
    )
    first, clearance = min(first, contact), min(clearance, gap)
    moving, polygons = k[s.moving_polygon_count], k[s.polygon_count]
    if polygons == 0:
        return first, clearance
    near = find_near_polygons(f, s, polygons, nx, ny, need, index)
    for j in range(near):
        number = index[np.uint64(NEAR) + j]
        x, y, mx, my = 0.0, 0.0, 0.0, 0.0  # the walls of a still polygon are kept where they stand
        if number < moving:
            x, y = f[s.body_x + s.discs + number], f[s.body_y + s.discs + number]
            mx, my = body_motion(f, s, s.discs + number)
        contact, gap = wall_contacts(
            f, s, footprint, r, k[s.polygon_first + number], k[s.polygon_walls + number], x, y, mx, my, need, end
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
        a_pieces, a_margin = swing(f, s, footprint, a, ca)
        for cb in range(s.footprint):
            b_pieces, b_margin = swing(f, s, footprint, b, cb)
            pieces, reach = max(a_pieces, b_pieces), footprint[ca, 2] + footprint[cb, 2]
            ax, ay = body_circle(f, s, footprint, s.pose, a, ca)
            bx, by = body_circle(f, s, footprint, s.pose, b, cb)
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
                    ax, ay = swung_circle(f, s, footprint, a, ca, min(now, stops[a]))
                    bx, by = swung_circle(f, s, footprint, b, cb, min(now, stops[b]))
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
    footprint: Floats,
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
        goal = goal_contact(f, k, s, r)
        end = min(goal, 1.0)
        contact, clearance = obstacle_contact(f, k, s, footprint, r, end, index)
        stops[r] = end
        verdicts[r] = SUCCESS if goal <= 1.0 else RUNNING
        if contact <= end:
            stops[r] = contact
            verdicts[r] = COLLISION
            clearance = 0.0
        f[s.clearance + r] = clearance
    if s.robots > 1:
        settle_among_robots(f, k, s, footprint, stops, verdicts)


@called
def settle_among_robots(
    f: Floats, k: Integers, s: Record, footprint: Floats, stops: Floats, verdicts: Integers
) -> None:
    """Stop robots that touch one another, the earliest contact first, and take their clearances to one another."""
    robots = s.robots
    for _ in range(robots):
        earliest = NEVER
        for a in range(robots):
            for b in range(a + 1, robots):
                contact, _clearance = robots_contact(f, s, footprint, stops, a, b, max(stops[a], stops[b]))
                # A contact settled before comes out again a rounding error earlier: that is no new one.
                later = contact + SAME_TIME
                touched = (k[s.outcome + a] == RUNNING and later < stops[a]) or (
                    k[s.outcome + b] == RUNNING and later < stops[b]
                )
                if touched and contact < earliest:
                    earliest = contact
                    first, second = a, b
        if earliest == NEVER:
            break
        for r in (first, second):
            if k[s.outcome + r] == RUNNING and earliest <= stops[r]:
                stops[r] = earliest
                verdicts[r] = COLLISION
                f[s.clearance + r] = 0.0
    for a in range(robots):
        for b in range(robots):
            if a != b and k[s.outcome + a] == RUNNING and verdicts[a] != COLLISION:
                _contact, clearance = robots_contact(f, s, footprint, stops, a, b, stops[a])
                f[s.clearance + a] = min(f[s.clearance + a], clearance)


@inlined
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@inlined
def track_odometry(f: Floats, k: Integers, s: Record, r: int, dx: float, dy: float, turn: float) -> None:
    """Advance robot r's own estimate of its pose by a motion (dx, dy) in its frame before the step, and a turn."""
    distance = length(dx, dy)
    scale = 1.0
    if distance > 0.0:
        scale += s.translation_bias
        turn += s.rotation_bias * distance
        if s.translation_noise > 0.0 or s.rotation_noise > 0.0:
            key = hash64(k[s.seed], k[s.episode], k[s.steps], STREAM_ODOMETRY)
            scale += s.translation_noise * normal(key, 2 * r) / math.sqrt(distance)
            turn += s.rotation_noise * normal(key, 2 * r + 1) * math.sqrt(distance)
    heading = f[s.odometry + 3 * r + 2]
    sin, cos = sin_cos(heading)
    f[s.odometry + 3 * r] += scale * (cos * dx - sin * dy)
    f[s.odometry + 3 * r + 1] += scale * (sin * dx + cos * dy)
    f[s.odometry + 3 * r + 2] = wrap(heading + turn)


@inlined
def apply_motion(f: Floats, k: Integers, s: Record, r: int, fraction: float) -> None:
    """Move robot r along its chord to the fraction where its step ends."""
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    wx, wy = fraction * (f[s.next_pose + 3 * r] - x), fraction * (f[s.next_pose + 3 * r + 1] - y)
    turn = fraction * (f[s.next_pose + 3 * r + 2] - heading)
    sin, cos = sin_cos(heading)
    track_odometry(f, k, s, r, cos * wx + sin * wy, cos * wy - sin * wx, turn)
    f[s.pose + 3 * r] = x + wx
    f[s.pose + 3 * r + 1] = y + wy
    f[s.pose + 3 * r + 2] = wrap(heading + turn)
    f[s.path_length + r] += length(wx, wy)


@inlined
def judge(f: Floats, k: Integers, s: Record, r: int, verdict: int, first: float, second: float) -> None:
    """Outcome, reward terms (in the order of TERMS) and their weighted sum for robot r after its motion."""
    g = k[s.goal_body + r]
    distance = length(f[s.body_x + g] - f[s.pose + 3 * r], f[s.body_y + g] - f[s.pose + 3 * r + 1])
    clearance = max(f[s.clearance + r], 0.0)
    f[s.min_clearance + r] = min(f[s.min_clearance + r], clearance)
    if verdict == RUNNING and k[s.steps] >= s.limit_steps:
        verdict = TIMEOUT
    k[s.outcome + r] = verdict
    if verdict in (SUCCESS, COLLISION):  # out of time it would go on, and what learns from it needs that
        f[s.velocity + 2 * r] = 0.0
        f[s.velocity + 2 * r + 1] = 0.0
    t = s.terms + TERMS * r
    d1, d2 = first - f[s.command + 2 * r], second - f[s.command + 2 * r + 1]
    f[t] = s.weight_progress * (f[s.goal_distance + r] - distance)
    f[t + 1] = s.weight_goal if verdict == SUCCESS else 0.0
    f[t + 2] = s.weight_collision if verdict == COLLISION else 0.0
    f[t + 3] = s.weight_step
    f[t + 4] = s.weight_clearance * max(0.0, 1.0 - clearance / s.clearance_scale)
    f[t + 5] = s.weight_smoothness * (d1 * d1 + d2 * d2)
    f[s.reward + r] = f[t] + f[t + 1] + f[t + 2] + f[t + 3] + f[t + 4] + f[t + 5]
    f[s.goal_distance + r] = distance
    f[s.command + 2 * r] = first
    f[s.command + 2 * r + 1] = second


@inlined
def clip(value: float, low: float, high: float) -> float:
    """The value limited to [low, high]."""
    return min(max(value, low), high)


@inlined
def step_row(
    f: Floats,
    k: Integers,
    observation: Ranges,
    s: Record,
    beams: Floats,
    footprint: Floats,
    regions: Floats,
    scratch: Floats,
    scratch_int: Integers,
    actions: Floats,
) -> None:
    """One step of one world; `actions` (R, 2) in [-1, 1], `observation` (R, D) is filled."""
    k[s.steps] += 1
    start = f[s.time]
    end = k[s.steps] * s.step
    f[s.time] = end
    if k[s.steered_count] > 0:
        steer_bodies(f, k, s, footprint, start, end, scratch, scratch_int)
    move_bodies(f, k, s, start, end)
    robots = s.robots
    for r in range(robots):
        if k[s.outcome + r] == RUNNING:
            drive(f, s, regions, r, clip(actions[r, 0], -1.0, 1.0), clip(actions[r, 1], -1.0, 1.0))
        else:
            for i in range(3):
                f[s.next_pose + 3 * r + i] = f[s.pose + 3 * r + i]
    stops, verdicts = scratch[:robots], scratch_int[:robots]
    settle_robots(f, k, s, footprint, stops, verdicts, scratch_int[robots:])
    for r in range(robots):
        if k[s.outcome + r] == RUNNING:
            apply_motion(f, k, s, r, stops[r])
            judge(f, k, s, r, verdicts[r], clip(actions[r, 0], -1.0, 1.0), clip(actions[r, 1], -1.0, 1.0))
        else:
            f[s.reward + r] = 0.0
            for i in range(TERMS):
                f[s.terms + TERMS * r + i] = 0.0
    for r in range(robots):
        observe(f, k, observation[r], s, beams, footprint, regions, scratch, scratch_int, r)


# Rows of many walls don't stay in the processor's cache, and which walls a step needs is known only when the places of
# the obstacles have come. So the places of the row after next are asked for before a row is worked on, and the near
# walls of the next one.
MANY_WALLS, MANY_ROWS = 128, 16


@inlined
def fetch_row(f: Floats, k: Integers, s: Record) -> None:
    """Asks for what a step reads of every row."""
    for line in range(0, s.body_turned, 8):
        _prefetch(f, line)
    for line in range(0, s.goal_body, 8):
        _prefetch(k, line)
    for line in range(s.polygon_first, s.border_first, 8):
        _prefetch(k, line)


@inlined
def fetch_near_walls(f: Floats, k: Integers, s: Record, index: Integers) -> None:
    """Asks for the walls of the polygons near the first robot."""
    near = find_near_polygons(f, s, k[s.polygon_count], f[s.pose], f[s.pose + 1], s.reach, index)
    for j in range(near):
        number = index[np.uint64(NEAR) + j]
        first = s.wall + 4 * k[s.polygon_first + number]
        for line in range(first, first + 4 * k[s.polygon_walls + number], 8):
            _prefetch(f, line)


@kernel
def step_rows(
    floats: Floats,
    ints: Integers,
    observation: Ranges,
    spec: Record,
    beams: Floats,
    footprint: Floats,
    regions: Floats,
    scratch: Floats,
    scratch_int: Integers,
    actions: Floats,
    rows: Integers,
) -> None:
    """Step the worlds `rows` (n,) with `actions` (n, R, 2); everything else is (N, ...) and changed in place."""
    s = spec[0]
    ahead = s.walls >= MANY_WALLS and rows.size >= MANY_ROWS
    for i in range(-2, rows.size):
        if ahead and i + 2 < rows.size:
            fetch_row(floats[rows[i + 2]], ints[rows[i + 2]], s)
        if ahead and 0 <= i + 1 < rows.size:
            fetch_near_walls(floats[rows[i + 1]], ints[rows[i + 1]], s, scratch_int)
        if i >= 0:
            n = rows[i]
            step_row(floats[n], ints[n], observation[n], s, beams, footprint, regions, scratch, scratch_int, actions[i])


# ---------------------------------------------------------------------------------------------- rays
# The scan works obstacle by obstacle. Far obstacles are dropped; for each near one the interval of beams that can meet
# it is estimated, and every beam of the interval is tested exactly, eight at a time. Estimates only ever widen the
# interval, so that they cost time and never exactness.
#
# LLVM is given vectors of eight numbers by hand (the functions marked @vectors) where its own vectoriser fails: numba
# switches off vectorising of straight code, and loops of eight are unrolled before they are looked at. A vector of
# eight is lowered to what the processor has. Nothing is fused or reordered.

cgutils: Any = numba_cgutils  # without types upstream
LANES = 8
TILE = 64  # near obstacles prepared together; a column of scratch is this long
ANGLE_MARGIN = 2e-4  # [rad] more than the errors of arc_tangent (8.2e-5) and half_angle (3.9e-5) together
OVERLAP = 1e-9  # each wall is longer by this part of its length at both ends, so that no beam slips through a corner
TOUCH = 1e-9  # [m] an origin this near to a wall stands in it

# scratch_f: four columns of obstacle data, then the best value of each beam.
BEST = 4 * TILE
# scratch_i: four columns of beam blocks, the queue (a tile's two pieces of at most four blocks each), near obstacles.
QUEUE = 4 * TILE
NEAR = 13 * TILE


def scratch_floats(beams: int) -> int:
    """Length of `scratch_f` that `cast_rays` needs."""
    return BEST + beams + 2 * LANES


def scratch_integers(obstacles: int) -> int:
    """Length of `scratch_i` that `cast_rays` needs; `obstacles` is the larger of the numbers of discs and walls."""
    return NEAR + obstacles + 2 * LANES


def beam_table(beams: int, first_angle: float, angle_step: float) -> tuple[Floats, Floats]:
    """Cosines and sines of the beams in the robot's frame, (beams + 8,) each: a block may start at the last beam."""
    angle = first_angle + angle_step * np.arange(beams)
    padding = (0, LANES)
    return np.pad(np.cos(angle), padding), np.pad(np.sin(angle), padding)


# Vectors of eight, written in LLVM's terms.

FLOATS = ir.VectorType(ir.DoubleType(), LANES)
INTEGERS = ir.VectorType(ir.IntType(64), LANES)
ZEROS = ir.Constant(FLOATS, [0.0] * LANES)


def _int64(value: int) -> Any:
    return ir.Constant(ir.IntType(64), value)


def _splat(builder: Any, value: Any) -> Any:
    kind = ir.VectorType(value.type, LANES)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    same = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), same)


def _data(context: Any, builder: Any, array_type: Any, array: Any) -> Any:
    return context.make_array(array_type)(context, builder, array).data


def _lanes(builder: Any, data: Any, start: Any, kind: Any) -> Any:
    """Address of the eight numbers of `data` from `start` on."""
    return builder.bitcast(builder.gep(data, [start]), kind.as_pointer())


def _load(builder: Any, data: Any, start: Any, kind: Any = FLOATS) -> Any:
    return builder.load(_lanes(builder, data, start, kind), align=8)


def _store(builder: Any, value: Any, data: Any, start: Any) -> None:
    builder.store(value, _lanes(builder, data, start, value.type), align=8)


def _columns(builder: Any, data: Any, row: Any, count: int) -> list[Any]:
    """Numbers of obstacle `row` of the tile, each repeated in all lanes."""
    places = [builder.add(row, _int64(column * TILE)) for column in range(count)]
    return [_splat(builder, builder.load(builder.gep(data, [place]))) for place in places]


@vectors
def _prefetch(typingctx: Any, array: Any, start: Any) -> Any:
    """Asks for the cache line of array[start], which is needed soon."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, start = arguments
        data = _data(context, builder, signature.args[0], array)
        place = builder.bitcast(builder.gep(data, [start]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, number, number, number])
        prefetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(prefetch, [place, ir.Constant(number, 0), ir.Constant(number, 3), ir.Constant(number, 1)])
        return context.get_dummy_value()

    return types.void(array, types.int64), codegen


@vectors
def _append_near(typingctx: Any, index: Any, j: Any, end: Any) -> Any:
    """Writes those of j ... j + 7 whose mark index[NEAR + j] isn't 0 to index[end ...]; returns the new end.

    Branch-free: eight numbers are always written, the end moves by as many as count.
    """
    positions = [[bit for bit in range(8) if mask >> bit & 1] for mask in range(256)]
    table = np.array([row + [0] * (8 - len(row)) for row in positions], np.uint8)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, j, end = arguments
        data = _data(context, builder, signature.args[0], array)
        marks = _load(builder, data, builder.add(j, _int64(NEAR)), INTEGERS)
        lanes = builder.icmp_unsigned("!=", marks, ir.Constant(INTEGERS, [0] * LANES))
        mask = builder.zext(builder.bitcast(lanes, ir.IntType(8)), ir.IntType(64))
        bytes_ = ir.Constant(ir.ArrayType(ir.IntType(8), table.size), bytearray(table.tobytes()))
        rows = cgutils.global_constant(builder, "positions_of_bits", bytes_)
        row = builder.gep(rows, [_int64(0), builder.mul(mask, _int64(LANES))])
        small = ir.VectorType(ir.IntType(8), LANES)
        chosen = builder.load(builder.bitcast(row, small.as_pointer()), align=1)
        _store(builder, builder.add(builder.zext(chosen, INTEGERS), _splat(builder, j)), data, end)
        return builder.add(end, builder.ctpop(mask))

    return types.uint64(index, types.uint64, types.uint64), codegen


@vectors
def _gather(typingctx: Any, scratch: Any, k: Any, source: Any, index: Any, start: Any, origin: Any) -> Any:
    """scratch[k ... k + 7] = source[index[start ... start + 7]] - origin.

    Loads of one vector follow soon; written one by one, the processor couldn't forward them to it.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        scratch, k, source, index, start, origin = arguments
        target = _data(context, builder, signature.args[0], scratch)
        source = _data(context, builder, signature.args[2], source)
        index = _data(context, builder, signature.args[3], index)
        values = ir.Constant(FLOATS, ir.Undefined)
        for lane in range(LANES):
            j = builder.load(builder.gep(index, [builder.add(start, _int64(lane))]))
            value = builder.load(builder.gep(source, [j]))
            values = builder.insert_element(values, value, ir.Constant(ir.IntType(32), lane))
        _store(builder, builder.fsub(values, _splat(builder, origin)), target, k)
        return context.get_dummy_value()

    return types.void(scratch, types.uint64, source, index, types.uint64, types.float64), codegen


def _load_block(context: Any, builder: Any, signature: Any, arguments: Any, count: int) -> tuple[Any, ...]:
    """What `_test_disc` and `_test_wall` read.

    Returns the data of scratch, `count` columns of the obstacle, cosines and sines of the beams, their best values and
    the place of these.
    """
    scratch, row, beam, beam_cos, beam_sin = arguments
    data = _data(context, builder, signature.args[0], scratch)
    columns = _columns(builder, data, row, count)
    cos = _load(builder, _data(context, builder, signature.args[3], beam_cos), beam)
    sin = _load(builder, _data(context, builder, signature.args[4], beam_sin), beam)
    place = builder.add(beam, _int64(BEST))
    return data, columns, cos, sin, _load(builder, data, place), place


@vectors
def _test_disc(typingctx: Any, scratch: Any, row: Any, beam: Any, beam_cos: Any, beam_sin: Any) -> Any:
    """Ranges of beams beam ... beam + 7 to disc `row` (columns x, y, radius squared); the smaller one stays."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data, (x, y, radius2), cos, sin, best, place = _load_block(context, builder, signature, arguments, 3)
        along = builder.fadd(builder.fmul(x, cos), builder.fmul(y, sin))
        aside = builder.fsub(builder.fmul(x, sin), builder.fmul(y, cos))
        # The root of a negative number, a miss, is NaN and loses each comparison.
        kind = ir.FunctionType(FLOATS, [FLOATS])
        root = cgutils.get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{LANES}f64")
        half_chord = builder.call(root, [builder.fsub(radius2, builder.fmul(aside, aside))])
        distance = builder.fsub(along, half_chord)
        ahead = builder.fcmp_ordered(">", along, ZEROS)
        nearer = builder.and_(ahead, builder.fcmp_ordered("<", distance, best))
        _store(builder, builder.select(nearer, distance, best), data, place)
        return context.get_dummy_value()

    return types.void(scratch, types.uint64, types.uint64, beam_cos, beam_sin), codegen


@vectors
def _test_wall(typingctx: Any, scratch: Any, row: Any, beam: Any, beam_cos: Any, beam_sin: Any) -> Any:
    """Inverse ranges of beams beam ... beam + 7 to wall `row` (columns x, y of both ends); the larger one stays.

    The ends a, b are divided by a x b, which makes the inverse range the linear a x d + d x b: no division a beam.
    The beam d passes between the ends where both terms are positive, as a, b stand counter-clockwise.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data, (ax, ay, bx, by), cos, sin, best, place = _load_block(context, builder, signature, arguments, 4)
        past_a = builder.fsub(builder.fmul(ax, sin), builder.fmul(ay, cos))
        before_b = builder.fsub(builder.fmul(by, cos), builder.fmul(bx, sin))
        inverse = builder.fadd(past_a, before_b)
        between = builder.and_(builder.fcmp_ordered(">=", past_a, ZEROS), builder.fcmp_ordered(">=", before_b, ZEROS))
        nearer = builder.and_(between, builder.fcmp_ordered(">", inverse, best))
        _store(builder, builder.select(nearer, inverse, best), data, place)
        return context.get_dummy_value()

    return types.void(scratch, types.uint64, types.uint64, beam_cos, beam_sin), codegen


# Unsigned numbers as index below: a signed one makes numba ask each time whether it counts from the end.


@inlined
def _arc_tangent(y: float, x: float) -> float:
    """Direction of (x, y) [rad], within 8.2e-5."""
    across, up = abs(x), abs(y)
    steep = up > across
    slope = (across if steep else up) / (up if steep else across)
    square = slope * slope
    angle = slope * (0.9992138 + square * (-0.3211749 + square * (0.1462644 + square * -0.0389865)))
    angle = HALF_PI - angle if steep else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@inlined
def _half_angle(sine: float) -> float:
    """Arc sine [rad] of a number from 0 to 1, within 3.9e-5."""
    shape = 1.5707584 + sine * (-0.2128756 + sine * (0.0768984 + sine * -0.0208927))
    return HALF_PI - math.sqrt(1.0 - sine) * shape


@inlined
def _clamp(value: float, low: float, high: float) -> float:
    value = value if value > low else low
    return value if value < high else high


@inlined
def _store_blocks(index: Integers, k: int, low: float, high: float, period: float, last: float) -> None:
    """Beams within [low, high] (real numbers of beams) as first beam and number of blocks of eight, in two pieces.

    The second piece is what lies beyond the end of the fan and comes in again at its other side.
    """
    shift = period if low < 0.0 else -period
    first = np.int64(_clamp(low, -1.0, last) + 1.0)
    first_2 = np.int64(_clamp(low + shift, -1.0, last) + 1.0)
    count = np.int64(_clamp(high, -1.0, last) + 1.0) - first
    count_2 = np.int64(_clamp(high + shift, -1.0, last) + 1.0) - first_2
    index[k] = first
    index[k + np.uint64(TILE)] = (count + 7) >> 3 if count > 0 else 0
    index[k + np.uint64(2 * TILE)] = first_2
    index[k + np.uint64(3 * TILE)] = (count_2 + 7) >> 3 if count_2 > 0 else 0


@inlined
def _compact(index: Integers, obstacles: int) -> np.uint64:
    """Turns marks index[NEAR:] into the list of marked obstacles; returns its length."""
    start = np.uint64(NEAR)
    count = np.uint64(obstacles)
    for lane in range(np.uint64(LANES)):
        index[start + count + lane] = 0
    end: np.uint64 = start
    for j in range(np.uint64(0), count, np.uint64(LANES)):
        end = _append_near(index, j, end)
    # Tiles are worked on in eights: the last eight is filled up with an obstacle that exists.
    fill = index[start]
    for lane in range(np.uint64(LANES)):
        index[end + lane] = fill
    return end - start


@inlined
def _find_near_discs(
    disc_x: Floats, disc_y: Floats, disc_radius: Floats, discs: int, x: float, y: float, reach: float, index: Integers
) -> np.uint64:
    """Lists in index[NEAR:] the discs that reach into the scan's circle; returns how many."""
    for j in range(np.uint64(discs)):
        dx = disc_x[j] - x
        dy = disc_y[j] - y
        far = reach + disc_radius[j]
        index[j + np.uint64(NEAR)] = np.int64(dx * dx + dy * dy < far * far)
    return _compact(index, discs)


@inlined
def _find_near_walls(
    wall_x1: Floats,
    wall_y1: Floats,
    wall_x2: Floats,
    wall_y2: Floats,
    walls: int,
    x: float,
    y: float,
    reach: float,
    index: Integers,
) -> np.uint64:
    """Lists in index[NEAR:] the walls near the scan's circle; returns how many.

    Near is what has a bounding box within reach: exact for walls along an axis, nearly so for short ones.
    """
    for j in range(np.uint64(walls)):
        ax = wall_x1[j] - x
        ay = wall_y1[j] - y
        bx = wall_x2[j] - x
        by = wall_y2[j] - y
        gap_x = max(ax if ax < bx else bx, -(ax if ax > bx else bx))
        gap_y = max(ay if ay < by else by, -(ay if ay > by else by))
        gap_x = gap_x if gap_x > 0.0 else 0.0
        gap_y = gap_y if gap_y > 0.0 else 0.0
        index[j + np.uint64(NEAR)] = np.int64(gap_x * gap_x + gap_y * gap_y < reach * reach)
    return _compact(index, walls)


@inlined
def _padded(count: np.uint64) -> np.uint64:
    """The multiple of eight that holds so many."""
    return (count + np.uint64(LANES - 1)) // np.uint64(LANES) * np.uint64(LANES)


@inlined
def _invert(f: Floats, padded: np.uint64) -> None:
    for i in range(padded):
        f[i + np.uint64(BEST)] = 1.0 / f[i + np.uint64(BEST)]


@inlined
def _prepare_discs(
    f: Floats,
    index: Integers,
    padded: np.uint64,
    cos: float,
    sin: float,
    first_angle: float,
    beams_per_rad: float,
    last: float,
) -> np.int64:
    """Turns a tile of discs (x, y, radius) into the robot's frame and finds their beams; returns how many hold it."""
    around = np.int64(0)
    margin = ANGLE_MARGIN * beams_per_rad
    for k in range(padded):
        dx = f[k]
        dy = f[k + np.uint64(TILE)]
        radius = f[k + np.uint64(2 * TILE)]
        x = dx * cos + dy * sin
        y = dy * cos - dx * sin
        distance2 = dx * dx + dy * dy
        around += np.int64(distance2 <= radius * radius)
        sine = radius / math.sqrt(distance2)
        half = _half_angle(sine if sine < 1.0 else 1.0) * beams_per_rad + margin
        angle = _arc_tangent(y, x) - first_angle
        middle = (angle + TWO_PI if angle < 0.0 else angle) * beams_per_rad
        f[k] = x
        f[k + np.uint64(TILE)] = y
        f[k + np.uint64(2 * TILE)] = radius * radius
        _store_blocks(index, k, middle - half, middle + half, TWO_PI * beams_per_rad, last)
    return around


@inlined
def _prepare_walls(
    f: Floats,
    index: Integers,
    padded: np.uint64,
    cos: float,
    sin: float,
    first_angle: float,
    beams_per_rad: float,
    last: float,
) -> np.int64:
    """Turns a tile of walls into columns for `_test_wall` and finds their beams; returns how many the robot touches."""
    touched = np.int64(0)
    margin = ANGLE_MARGIN * beams_per_rad
    for k in range(padded):
        x1 = f[k]
        y1 = f[k + np.uint64(TILE)]
        x2 = f[k + np.uint64(2 * TILE)]
        y2 = f[k + np.uint64(3 * TILE)]
        dx = x2 - x1
        dy = y2 - y1
        cross = x1 * y2 - y1 * x2
        beside = x1 * dx + y1 * dy <= 0.0 and x2 * dx + y2 * dy >= 0.0
        touched += np.int64(beside and cross * cross <= TOUCH * TOUCH * (dx * dx + dy * dy))
        x1 -= OVERLAP * dx
        y1 -= OVERLAP * dy
        x2 += OVERLAP * dx
        y2 += OVERLAP * dy
        clockwise = cross < 0.0
        ax = (x2 if clockwise else x1) * cos + (y2 if clockwise else y1) * sin
        ay = (y2 if clockwise else y1) * cos - (x2 if clockwise else x1) * sin
        bx = (x1 if clockwise else x2) * cos + (y1 if clockwise else y2) * sin
        by = (y1 if clockwise else y2) * cos - (x1 if clockwise else x2) * sin
        low = _arc_tangent(ay, ax) - first_angle
        high = _arc_tangent(by, bx) - first_angle
        low = low + TWO_PI if low < 0.0 else low
        high = high + TWO_PI if high < 0.0 else high
        # A wall seen edge-on has low and high within the error of the angles: not a whole turn apart.
        high = high + TWO_PI if high < low - 1.0 else high
        cross = ax * by - ay * bx
        scale = 1.0 / (cross if cross > 1e-12 else 1e-12)
        f[k] = ax * scale
        f[k + np.uint64(TILE)] = ay * scale
        f[k + np.uint64(2 * TILE)] = bx * scale
        f[k + np.uint64(3 * TILE)] = by * scale
        low = low * beams_per_rad - margin
        _store_blocks(index, k, low, high * beams_per_rad + margin, TWO_PI * beams_per_rad, last)
    return touched


@inlined
def _test_block(f: Floats, is_wall: bool, k: np.uint64, beam: np.uint64, beam_cos: Floats, beam_sin: Floats) -> None:
    """Tests eight beams against obstacle k of the tile. Which kind it is is known where this is copied to."""
    if is_wall:
        _test_wall(f, k, beam, beam_cos, beam_sin)
    else:
        _test_disc(f, k, beam, beam_cos, beam_sin)


@inlined
def _queue_blocks(
    f: Floats, index: Integers, is_wall: bool, k: np.uint64, end: np.uint64, beam_cos: Floats, beam_sin: Floats
) -> np.uint64:
    """Appends the blocks of obstacle k to the queue, or tests those of a piece of more than four; returns the new end.

    Branch-free up to four, like `_append_near`. Obstacles have one, two or three blocks in no order that a processor
    foresees, and each wrong guess at the end of a loop over them costs more than the tests themselves.
    """
    for piece in range(np.uint64(0), np.uint64(4 * TILE), np.uint64(2 * TILE)):
        first = index[k + piece]
        blocks = np.uint64(index[k + piece + np.uint64(TILE)])
        if blocks <= np.uint64(4):
            if piece == np.uint64(0) or blocks > np.uint64(0):
                block = first | (np.int64(k) << 32)
                index[end] = block
                index[end + np.uint64(1)] = block + 8
                index[end + np.uint64(2)] = block + 16
                index[end + np.uint64(3)] = block + 24
                end += blocks
        else:
            for number in range(blocks):
                _test_block(f, is_wall, k, np.uint64(first) + np.uint64(LANES) * number, beam_cos, beam_sin)
    return end


@inlined
def _test_queued(f: Floats, index: Integers, is_wall: bool, end: np.uint64, beam_cos: Floats, beam_sin: Floats) -> None:
    """Tests all blocks of the queue."""
    for m in range(np.uint64(QUEUE), end):
        block = index[m]
        _test_block(f, is_wall, np.uint64(block >> 32), np.uint64(block & 0xFFFFFFFF), beam_cos, beam_sin)


@inlined
def _cast_discs(
    disc_x: Floats,
    disc_y: Floats,
    disc_radius: Floats,
    x: float,
    y: float,
    cos: float,
    sin: float,
    beam_cos: Floats,
    beam_sin: Floats,
    first_angle: float,
    beams_per_rad: float,
    last: float,
    near: np.uint64,
    f: Floats,
    index: Integers,
) -> bool:
    """Lowers the beams' ranges f[BEST:] to those of the near discs; True if one of them holds the robot."""
    tile = np.uint64(TILE)
    for start in range(np.uint64(0), near, tile):
        count = min(near - start, tile)
        for k in range(np.uint64(0), count, np.uint64(LANES)):
            at = np.uint64(NEAR) + start + k
            _gather(f, k, disc_x, index, at, x)
            _gather(f, k + tile, disc_y, index, at, y)
            _gather(f, k + np.uint64(2 * TILE), disc_radius, index, at, 0.0)
        if _prepare_discs(f, index, _padded(count), cos, sin, first_angle, beams_per_rad, last) > 0:
            return True
        end = np.uint64(QUEUE)
        for k in range(count):
            end = _queue_blocks(f, index, False, np.uint64(k), end, beam_cos, beam_sin)
        _test_queued(f, index, False, end, beam_cos, beam_sin)
    return False


@inlined
def _cast_walls(
    wall_x1: Floats,
    wall_y1: Floats,
    wall_x2: Floats,
    wall_y2: Floats,
    x: float,
    y: float,
    cos: float,
    sin: float,
    beam_cos: Floats,
    beam_sin: Floats,
    first_angle: float,
    beams_per_rad: float,
    last: float,
    near: np.uint64,
    f: Floats,
    index: Integers,
) -> bool:
    """Raises the beams' inverse ranges f[BEST:] to those of the near walls; True if the robot stands in one."""
    tile = np.uint64(TILE)
    for start in range(np.uint64(0), near, tile):
        count = min(near - start, tile)
        for k in range(np.uint64(0), count, np.uint64(LANES)):
            at = np.uint64(NEAR) + start + k
            _gather(f, k, wall_x1, index, at, x)
            _gather(f, k + tile, wall_y1, index, at, y)
            _gather(f, k + np.uint64(2 * TILE), wall_x2, index, at, x)
            _gather(f, k + np.uint64(3 * TILE), wall_y2, index, at, y)
        if _prepare_walls(f, index, _padded(count), cos, sin, first_angle, beams_per_rad, last) > 0:
            return True
        end = np.uint64(QUEUE)
        # Sides of one polygon share beams: worked on in a row, each would wait for the other's result.
        for side in range(np.uint64(4)):
            for k in range(side, count, np.uint64(4)):
                end = _queue_blocks(f, index, True, np.uint64(k), end, beam_cos, beam_sin)
        _test_queued(f, index, True, end, beam_cos, beam_sin)
    return False


@inlined
def cast_rays(
    disc_x: Floats,
    disc_y: Floats,
    disc_radius: Floats,
    discs: int,
    wall_x1: Floats,
    wall_y1: Floats,
    wall_x2: Floats,
    wall_y2: Floats,
    walls: int,
    x: float,
    y: float,
    heading: float,
    beam_cos: Floats,
    beam_sin: Floats,
    first_angle: float,
    angle_step: float,
    reach: float,
    scratch_f: Floats,
    scratch_i: Integers,
    ranges: Ranges,
) -> None:
    """Exact ranges from (x, y) to the nearest disc or wall along each beam.

    A beam without return reads `reach`. All beams read 0 where the origin lies in a disc or on a wall (within TOUCH).
    A fan of any width up to a full circle: a beam beyond one end comes in again at the other where the turn is full.

    It is copied into each caller: handing over sixty words of array headers costs a third of a small scan. So call it
    in one place, on rows cut out there.

    Args:
        disc_x: (M,) f8 [m], one world's row, as those below.
        disc_y: (M,) f8 [m].
        disc_radius: (M,) f8 [m].
        discs: How many of them count.
        wall_x1: (S,) f8 [m], one end of each wall. Sides of a polygon share their ends bit for bit.
        wall_y1: (S,) f8 [m].
        wall_x2: (S,) f8 [m], the other end.
        wall_y2: (S,) f8 [m].
        walls: How many of them count.
        x: Origin [m].
        y: Origin [m].
        heading: Of the robot [rad].
        beam_cos: (B + 8,) f8 from `beam_table`.
        beam_sin: (B + 8,) f8 from `beam_table`.
        first_angle: Beam 0 in the robot's frame, from -pi to pi [rad].
        angle_step: From beam to beam, positive, also if there is but one [rad].
        reach: Largest range [m].
        scratch_f: (scratch_floats(B),) f8, overwritten; what it held doesn't matter.
        scratch_i: (scratch_integers(max(M, S)),) i8, likewise.
        ranges: (B,) f4 [m], the result.
    """
    beams = np.uint64(ranges.size)
    beams_per_rad = 1.0 / angle_step
    last = np.float64(beams) - 1.0
    sin, cos = sin_cos(heading)
    padded = (beams // np.uint64(LANES) + np.uint64(2)) * np.uint64(LANES)
    for i in range(padded):
        scratch_f[i + np.uint64(BEST)] = reach
    inside = False
    near = _find_near_discs(disc_x, disc_y, disc_radius, discs, x, y, reach, scratch_i)
    if near > np.uint64(0):
        inside = _cast_discs(
            disc_x,
            disc_y,
            disc_radius,
            x,
            y,
            cos,
            sin,
            beam_cos,
            beam_sin,
            first_angle,
            beams_per_rad,
            last,
            near,
            scratch_f,
            scratch_i,
        )
    near = _find_near_walls(wall_x1, wall_y1, wall_x2, wall_y2, walls, x, y, reach, scratch_i)
    if near > np.uint64(0) and not inside:
        _invert(scratch_f, padded)
        inside = _cast_walls(
            wall_x1,
            wall_y1,
            wall_x2,
            wall_y2,
            x,
            y,
            cos,
            sin,
            beam_cos,
            beam_sin,
            first_angle,
            beams_per_rad,
            last,
            near,
            scratch_f,
            scratch_i,
        )
        _invert(scratch_f, padded)
    for i in range(beams):
        distance = scratch_f[i + np.uint64(BEST)]
        # Inverting twice may end one bit off, which mustn't turn a beam without return into one with.
        distance = distance if distance < reach * (1.0 - 1e-15) else reach
        ranges[i] = np.float32(0.0 if inside else distance)


# ---------------------------------------------------------------------------------------------- noise
# Every number is a function of a key and an index, so it can be drawn in any order, by any thread, again.

LN_2 = np.float32(math.log(2.0))
ROOT_2_BITS = np.int32(0x3F3504F3)  # sqrt(1/2) as the bits of a float32
SIN_1, SIN_3, SIN_5, SIN_7, SIN_9 = (
    np.float32(c) for c in (3.14159258, -5.16770689, 2.55003138, -0.59804517, 0.07722013)
)
LOG_3, LOG_4, LOG_5, LOG_6, LOG_7, LOG_8, LOG_9 = (
    np.float32(c) for c in (0.33334166, -0.25001699, 0.19954873, -0.16564417, 0.14978013, -0.14379083, 0.08672227)
)
HALF_32 = np.float32(0.5)
TWO_32 = np.float32(2.0)
BEAM_STEP = np.uint32(0x9E3779B9)  # odd: beams of one key never share a state
SECOND = np.uint32(0x68BC21EB)
THIRD = np.uint32(0x02E5BE93)


@inlined
def _mix(x: np.uint32) -> np.uint32:
    """Bijection of 32 bits, each output bit depending on each input bit (lowbias32 of C. Wellons' hash prospector)."""
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x7FEB352D))
    x = np.uint32(x ^ (x >> np.uint32(15)))
    x = np.uint32(x * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))


@inlined
def _minus_log(u: np.float32) -> np.float32:
    """-ln u of a float32 in (0, 1), within 2e-7 of its size."""
    bits = np.int32(np.float32(u).view(np.int32) - ROOT_2_BITS)
    exponent = np.int32(bits >> np.int32(23))
    fraction = np.int32((bits & np.int32(0x007FFFFF)) + ROOT_2_BITS).view(np.float32)
    m = np.float32(fraction - np.float32(1.0))
    tail = LOG_3 + m * (LOG_4 + m * (LOG_5 + m * (LOG_6 + m * (LOG_7 + m * (LOG_8 + m * LOG_9)))))
    return -(np.float32(exponent) * LN_2 + (m + m * m * (m * tail - HALF_32)))


@inlined
def _cos_pi(t: np.float32) -> np.float32:
    """cos(pi t) of a float32 in [-1, 1], within 2.1e-7."""
    z = HALF_32 - abs(t)
    square = z * z
    return z * (SIN_1 + square * (SIN_3 + square * (SIN_5 + square * (SIN_7 + square * SIN_9))))


@called
def _drop_beams(
    ranges: Ranges, beams: int, far: np.float32, lost_below: np.int32, low: np.uint32, high: np.uint32
) -> None:
    """Sets each beam to `far` with probability lost_below / 2^24, on hashes of its own."""
    for i in range(beams):
        draw = _mix(np.uint32(_mix(np.uint32(high - np.uint32(i) * BEAM_STEP)) + low + THIRD))
        ranges[i] = far if np.int32(draw >> np.uint32(8)) < lost_below else ranges[i]


@called
def add_noise(
    ranges: Ranges, beams: int, reach: float, min_range: float, sigma: float, dropout: float, key: np.uint64
) -> None:
    """Adds Gaussian noise to a scan and drops beams.

    A beam without return keeps reading `reach`. Noise is a pure function of (key, beam): Box-Muller on two 32-bit
    hashes, the whole bell up to 5.7 sigma.

    Args:
        ranges: (B,) f4 [m], changed in place.
        beams: How many of them count.
        reach: Largest range [m].
        min_range: Smallest range [m].
        sigma: Standard deviation [m].
        dropout: Probability that a beam reads `reach` whatever it met, in steps of 2^-24.
        key: uint64 from `hash64`.
    """
    if sigma == 0.0 and dropout == 0.0 and min_range == 0.0:
        return
    key = np.uint64(key)
    low = np.uint32(key & np.uint64(0xFFFFFFFF))
    high = np.uint32(key >> np.uint64(32))
    scale = np.float32(sigma)
    far = np.float32(reach)
    near = np.float32(min_range)
    for i in range(beams):
        state = np.uint32(_mix(np.uint32(low + np.uint32(i) * BEAM_STEP)) + high)
        first = _mix(state)
        second = _mix(np.uint32(state + SECOND))
        # 23 bits and a half: a number in (0, 1) that float32 holds exactly.
        u = np.float32((np.float32(np.int32(first >> np.uint32(9))) + HALF_32) * np.float32(2.0**-23))
        t = np.float32(np.float32(np.int32(second)) * np.float32(2.0**-31))
        radius = np.float32(math.sqrt(np.float32(TWO_32 * _minus_log(u))))
        distance = ranges[i]
        noisy = np.float32(distance + scale * np.float32(radius * _cos_pi(t)))
        noisy = noisy if noisy > near else near
        noisy = noisy if noisy < far else far
        ranges[i] = far if distance >= far else noisy
    if dropout > 0.0:
        _drop_beams(ranges, beams, far, np.int32(dropout * 16777216.0 + 0.5), low, high)


# ---------------------------------------------------------------------------------------------- sensing


@inlined
def gather_walls(
    f: Floats, k: Integers, s: Record, x: float, y: float, scratch: Floats, index: Integers
) -> tuple[Floats, Floats, Floats, Floats, int]:
    """Walls of the border and of the polygons that reach into the scan's circle round (x, y), where they stand.

    From outside a polygon only those are taken that face (x, y): the others lie behind them. They are written to the
    end of `scratch`. Returns x1, y1, x2, y2 (S,) and how many of them count.
    """
    room = s.walls
    begin = scratch.size - 4 * room
    x1, y1 = scratch[begin : begin + room], scratch[begin + room : begin + 2 * room]
    x2, y2 = scratch[begin + 2 * room : begin + 3 * room], scratch[begin + 3 * room : begin + 4 * room]
    count = 0
    for w in range(k[s.border_first], k[s.border_first] + k[s.border_walls]):
        x1[count] = f[s.wall + 4 * w]
        y1[count] = f[s.wall + 4 * w + 1]
        x2[count] = f[s.wall + 4 * w + 2]
        y2[count] = f[s.wall + 4 * w + 3]
        count += 1
    polygons, moving = k[s.polygon_count], k[s.moving_polygon_count]
    if polygons == 0:
        return x1, y1, x2, y2, count
    near = find_near_polygons(f, s, polygons, x, y, s.reach, index)
    for j in range(near):
        number = index[np.uint64(NEAR) + j]
        b = s.discs + number
        bx, by, radius = f[s.body_x + b], f[s.body_y + b], f[s.body_radius + b]
        dx, dy = x - bx, y - by
        side = 0.0 if dx * dx + dy * dy <= radius * radius else np.float64(k[s.polygon_side + number])
        if number >= moving:
            bx, by = 0.0, 0.0
        first = k[s.polygon_first + number]
        for w in range(first, first + k[s.polygon_walls + number]):
            ax, ay = f[s.wall + 4 * w] + bx, f[s.wall + 4 * w + 1] + by
            cx, cy = f[s.wall + 4 * w + 2] + bx, f[s.wall + 4 * w + 3] + by
            x1[count] = ax
            y1[count] = ay
            x2[count] = cx
            y2[count] = cy
            count += int(side * ((ax - x) * (cy - y) - (ay - y) * (cx - x)) <= 0.0)
    return x1, y1, x2, y2, count


@inlined
def observe(
    f: Floats,
    k: Integers,
    observation: Ranges,
    s: Record,
    beams: Floats,
    footprint: Floats,
    regions: Floats,
    scratch: Floats,
    scratch_int: Integers,
    r: int,
) -> None:
    """Fill robot r's observation (D,): ranges, goal, pose, velocity, terrain, peers, as observation.fields says."""
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    sin, cos = sin_cos(heading)
    discs = k[s.disc_count]
    # The other robots are discs too while this one looks; they lie behind the world's own.
    for other in range(s.robots):
        if other != r:
            for c in range(s.footprint):
                cx, cy = body_circle(f, s, footprint, s.pose, other, c)
                f[s.body_x + discs] = cx
                f[s.body_y + discs] = cy
                f[s.body_radius + discs] = footprint[c, 2]
                discs += 1
    near_x1, near_y1, near_x2, near_y2, walls = gather_walls(f, k, s, x, y, scratch, scratch_int)
    ranges = observation[: s.beams]
    cast_rays(
        f[s.body_x : s.body_x + discs],
        f[s.body_y : s.body_y + discs],
        f[s.body_radius : s.body_radius + discs],
        discs,
        near_x1,
        near_y1,
        near_x2,
        near_y2,
        walls,
        x,
        y,
        heading,
        beams[0],
        beams[1],
        s.first_angle,
        s.angle_step,
        s.reach,
        scratch,
        scratch_int,
        ranges,
    )
    if s.range_noise > 0.0 or s.dropout > 0.0 or s.min_range > 0.0:
        key = hash64(k[s.seed], k[s.episode], k[s.steps] * s.robots + r, STREAM_RANGES)
        add_noise(ranges, s.beams, s.reach, s.min_range, s.range_noise, s.dropout, key)
    at = s.beams
    g = k[s.goal_body + r]
    ex, ey, eh = f[s.odometry + 3 * r], f[s.odometry + 3 * r + 1], f[s.odometry + 3 * r + 2]
    goal_sin, goal_cos = sin, cos
    gx, gy = f[s.body_x + g] - x, f[s.body_y + g] - y
    if s.goal_by_odometry:
        wx, wy = f[s.body_x + g] - f[s.origin + 3 * r], f[s.body_y + g] - f[s.origin + 3 * r + 1]
        origin_sin, origin_cos = sin_cos(f[s.origin + 3 * r + 2])
        gx, gy = origin_cos * wx + origin_sin * wy - ex, origin_cos * wy - origin_sin * wx - ey
        goal_sin, goal_cos = sin_cos(eh)
    observation[at] = clip(goal_cos * gx + goal_sin * gy, -s.span, s.span)
    observation[at + 1] = clip(goal_cos * gy - goal_sin * gx, -s.span, s.span)
    observation[at + 2] = clip(ex, -2.0 * s.span, 2.0 * s.span)
    observation[at + 3] = clip(ey, -2.0 * s.span, 2.0 * s.span)
    observation[at + 4] = eh
    observation[at + 5] = f[s.velocity + 2 * r]
    observation[at + 6] = f[s.velocity + 2 * r + 1]
    at += 7
    if s.regions > 0:
        samples = TERRAIN_HEADINGS * TERRAIN_RINGS
        sample_ground(s, regions, observation[at : at + samples], x, y, heading)
        at += samples
    for other in range(s.robots):
        if other != r:
            dx, dy = f[s.pose + 3 * other] - x, f[s.pose + 3 * other + 1] - y
            vx, vy = f[s.velocity + 2 * other], f[s.velocity + 2 * other + 1]
            turn_sin, turn_cos = sin_cos(f[s.pose + 3 * other + 2] - heading)
            if s.kinematics == DIFFERENTIAL:
                vy = 0.0
            observation[at] = clip(cos * dx + sin * dy, -s.span, s.span)
            observation[at + 1] = clip(cos * dy - sin * dx, -s.span, s.span)
            observation[at + 2] = turn_cos * vx - turn_sin * vy
            observation[at + 3] = turn_sin * vx + turn_cos * vy
            at += 4


@inlined
def wall_gap(f: Floats, s: Record, w: int, x: float, y: float) -> float:
    """Distance of a point to wall w, both in the frame in which the wall is kept."""
    at = s.wall + 4 * w
    return point_wall_distance(x, y, f[at], f[at + 1], f[at + 2], f[at + 3])


@called
def clearance_at(f: Floats, k: Integers, s: Record, footprint: Floats, r: int) -> float:
    """Distance from robot r's body to the nearest obstacle, border and other robot [m], at its present pose."""
    nearest = math.inf
    for c in range(s.footprint):
        x, y = body_circle(f, s, footprint, s.pose, r, c)
        radius = footprint[c, 2]
        for w in range(k[s.border_first], k[s.border_first] + k[s.border_walls]):
            nearest = min(nearest, wall_gap(f, s, w, x, y) - radius)
        for m in range(k[s.disc_count]):
            dx, dy = x - f[s.body_x + m], y - f[s.body_y + m]
            reach = radius + f[s.body_radius + m]
            if dx * dx + dy * dy < (nearest + reach) * (nearest + reach):
                nearest = min(nearest, length(dx, dy) - reach)
        for number in range(k[s.polygon_count]):
            b = s.discs + number
            bx, by = f[s.body_x + b], f[s.body_y + b]
            reach = nearest + radius + f[s.body_radius + b]
            if (x - bx) * (x - bx) + (y - by) * (y - by) >= reach * reach:
                continue
            if number >= k[s.moving_polygon_count]:
                bx, by = 0.0, 0.0
            first = k[s.polygon_first + number]
            for w in range(first, first + k[s.polygon_walls + number]):
                nearest = min(nearest, wall_gap(f, s, w, x - bx, y - by) - radius)
        for other in range(s.robots):
            if other != r:
                for d in range(s.footprint):
                    ox, oy = body_circle(f, s, footprint, s.pose, other, d)
                    nearest = min(nearest, length(x - ox, y - oy) - radius - footprint[d, 2])
    return nearest


@called
def begin_robot(f: Floats, k: Integers, s: Record, footprint: Floats, r: int) -> None:
    """Start the run of robot r at the pose that it has."""
    g = k[s.goal_body + r]
    k[s.outcome + r] = RUNNING
    for i in range(3):
        f[s.origin + 3 * r + i] = f[s.pose + 3 * r + i]
        f[s.odometry + 3 * r + i] = 0.0
    for i in range(2):
        f[s.velocity + 2 * r + i] = 0.0
        f[s.command + 2 * r + i] = 0.0
    f[s.path_length + r] = 0.0
    f[s.reward + r] = 0.0
    for i in range(TERMS):
        f[s.terms + TERMS * r + i] = 0.0
    f[s.goal_distance + r] = length(f[s.body_x + g] - f[s.pose + 3 * r], f[s.body_y + g] - f[s.pose + 3 * r + 1])
    f[s.clearance + r] = clearance_at(f, k, s, footprint, r)
    f[s.min_clearance + r] = f[s.clearance + r]


@called
def begin_world(f: Floats, k: Integers, s: Record, footprint: Floats) -> None:
    """Start the episode of a row whose obstacles, poses and goals have been placed, but for what the robots see."""
    f[s.time] = 0.0
    k[s.steps] = 0
    fastest, steered = 0.0, 0
    for b in range(s.bodies):
        f[s.body_turned + b] = -1.0
        law = k[s.body_law + b]
        if law == STILL or (k[s.disc_count] <= b < s.discs):
            f[s.body_event + b] = math.inf
            continue
        fastest = max(fastest, f[s.body_speed + b])
        if law >= CROWD:
            steered += 1
            begin_steered(f, k, s, b)
            continue
        if law == RANDOM_WALK:
            f[s.body_event + b] = take_heading(f, k, s, b)
        plan_body(f, k, s, b, 0.0)
    f[s.fastest] = fastest
    k[s.steered_count] = steered
    for r in range(s.robots):
        begin_robot(f, k, s, footprint, r)


@kernel
def begin_rows(
    floats: Floats,
    ints: Integers,
    observation: Ranges,
    spec: Record,
    beams: Floats,
    footprint: Floats,
    regions: Floats,
    scratch: Floats,
    scratch_int: Integers,
    rows: Integers,
) -> None:
    """Start the episodes of the worlds `rows` (n,)."""
    s = spec[0]
    for i in range(rows.size):
        n = rows[i]
        f, k = floats[n], ints[n]
        begin_world(f, k, s, footprint)
        for r in range(s.robots):
            observe(f, k, observation[n, r], s, beams, footprint, regions, scratch, scratch_int, r)


@kernel
def restart_robots(
    floats: Floats,
    ints: Integers,
    observation: Ranges,
    spec: Record,
    beams: Floats,
    footprint: Floats,
    regions: Floats,
    scratch: Floats,
    scratch_int: Integers,
    starts: Floats,
    rows: Integers,
) -> None:
    """Put robots of the worlds `rows` (n,) whose runs have ended back to `starts` (n, R, 3), where those are free."""
    s = spec[0]
    for i in range(rows.size):
        n = rows[i]
        f, k = floats[n], ints[n]
        for r in range(s.robots):
            if k[s.outcome + r] == RUNNING:
                continue
            x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
            for j in range(3):
                f[s.pose + 3 * r + j] = starts[i, r, j]
            if clearance_at(f, k, s, footprint, r) > 0.0:
                begin_robot(f, k, s, footprint, r)
            else:
                f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2] = x, y, heading
        for r in range(s.robots):
            observe(f, k, observation[n, r], s, beams, footprint, regions, scratch, scratch_int, r)


FARES = 5  # numbers of a robot besides its reward terms: reward, path_length, time, min_clearance, goal_distance


@kernel
def read_fares(
    floats: Floats, ints: Integers, spec: Record, rows: Integers, numbers: Floats, outcome: Integers
) -> None:
    """Copy how the robots of the worlds `rows` (n,) fare, in one pass: `numbers` (FARES + TERMS, n, R), `outcome` (n, R)."""
    s = spec[0]
    for i in range(rows.size):
        f, k = floats[rows[i]], ints[rows[i]]
        for r in range(s.robots):
            outcome[i, r] = k[s.outcome + r]
            numbers[0, i, r] = f[s.reward + r]
            numbers[1, i, r] = f[s.path_length + r]
            numbers[2, i, r] = f[s.time]
            numbers[3, i, r] = f[s.min_clearance + r]
            numbers[4, i, r] = f[s.goal_distance + r]
            for term in range(TERMS):
                numbers[FARES + term, i, r] = f[s.terms + TERMS * r + term]


# ---------------------------------------------------------------------------------------------- placing obstacles

TRIES = 1000  # for one obstacle
ATTEMPTS = 20  # at a whole world
BOUNCE_BIT, WALK_BIT, CROWD_BIT = 1, 2, 4  # of FIELD.laws


@called
def place_start_and_goal(f: Floats, k: Integers, s: Record, p: Record, key: np.uint64, draw: int) -> int:
    """Draw the robots' starts (side by side, 2 m apart) and the goal; returns the next draw, or -1 where none fits."""
    goal = s.discs + s.polygons
    side = s.robots - 1.0  # the outermost robot stands this far from the middle [m]
    room = s.body_reach + p.start_clearance
    for _ in range(TRIES):
        x = between(key, draw, p.start_xmin, p.start_xmax)
        y = between(key, draw + 1, p.start_ymin, p.start_ymax)
        heading = p.start_heading
        if math.isnan(heading):
            heading = between(key, draw + 2, -math.pi, math.pi)
        gx = between(key, draw + 3, p.goal_xmin, p.goal_xmax)
        gy = between(key, draw + 4, p.goal_ymin, p.goal_ymax)
        draw += 5
        clear = min(min(gx - p.xmin, p.xmax - gx), min(gy - p.ymin, p.ymax - gy)) >= p.goal_clearance
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
    """Give mover number `number` its law and speed; returns the next draw."""
    if is_pedestrian(p, b):
        k[s.body_law + b] = CROWD
        speed = between(key, draw, p.pedestrian_speed_min, p.pedestrian_speed_max)
    else:
        k[s.body_law + b] = law_in_turn(p.laws, number)
        speed = between(key, draw, p.speed_min, p.speed_max)
    sin, cos = sin_cos(between(key, draw + 1, -math.pi, math.pi))
    k[s.body_leg + b] = 0
    f[s.body_speed + b] = speed
    f[s.body_vx + b] = speed * cos
    f[s.body_vy + b] = speed * sin
    f[s.leg_min + b] = p.leg_min
    f[s.leg_max + b] = p.leg_max
    if k[s.body_law + b] == CROWD:
        f[s.body_foresight + b] = p.horizon
    return draw + 2


@inlined
def add_wall(f: Floats, s: Record, w: int, x1: float, y1: float, x2: float, y2: float) -> None:
    """Write wall segment w."""
    f[s.wall + 4 * w] = x1
    f[s.wall + 4 * w + 1] = y1
    f[s.wall + 4 * w + 2] = x2
    f[s.wall + 4 * w + 3] = y2


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
    first_x, first_y = x0 + radius * cos, y0 + radius * sin
    x, y = first_x, first_y
    for i in range(1, corners + 1):
        reach = radius
        if p.squares:
            sin, cos = cos, -sin
        elif i < corners:
            sin, cos = sin_cos(turn + 2.0 * math.pi * (i + between(key, draw + 2 * i, -0.2, 0.2)) / corners)
            reach = radius * between(key, draw + 2 * i + 1, 0.6, 1.0)
        next_x, next_y = x0 + reach * cos, y0 + reach * sin
        if i == corners:
            next_x, next_y = first_x, first_y
        add_wall(f, s, first + i - 1, x, y, next_x, next_y)
        x, y = next_x, next_y
    k[s.polygon_first + number] = first
    k[s.polygon_walls + number] = corners
    k[s.polygon_side + number] = 1
    k[s.wall_count] = first + corners
    return draw + 2 * corners


@called
def place_border(f: Floats, k: Integers, s: Record, p: Record) -> None:
    """Append the four walls of the bounds."""
    w = k[s.wall_count]
    add_wall(f, s, w, p.xmin, p.ymin, p.xmax, p.ymin)
    add_wall(f, s, w + 1, p.xmax, p.ymin, p.xmax, p.ymax)
    add_wall(f, s, w + 2, p.xmax, p.ymax, p.xmin, p.ymax)
    add_wall(f, s, w + 3, p.xmin, p.ymax, p.xmin, p.ymin)
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
    mover = 0
    for m in range(p.moving_discs):
        draw = place_body(f, k, s, p, m, True, key, draw)
        if draw < 0:
            return -1 - placed
        draw = set_motion(f, k, s, p, m, mover, key, draw)
        mover += 1
        placed += 1
    for number in range(p.moving_polygons):
        draw = place_body(f, k, s, p, s.discs + number, True, key, draw)
        if draw < 0:
            return -1 - placed
        draw = set_motion(f, k, s, p, s.discs + number, mover, key, draw)
        mover += 1
        placed += 1
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
        start = place_start_and_goal(f, k, s, p, key, draw)
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


# ---------------------------------------------------------------------------------------------- reading a scan
# For scripted policies: `px`, `py` (k,) are the scan's points in the robot's frame. They see no world.


@inlined
def way_to_point(along: float, beside: float, radius: float) -> float:
    """How far a disc goes until it touches a point, so far ahead and so far to the side [m]; infinite: it passes."""
    room = radius * radius - beside * beside
    if along <= 0.0 or room <= 0.0:
        return math.inf
    return max(along - math.sqrt(room), 0.0)


@called
def first_contact(px: Floats, py: Floats, angle: float, radius: float, reach: float) -> tuple[float, int]:
    """`free_distance` along `angle`, and the number of the scan point that the disc touches there, -1 for none."""
    cos, sin = math.cos(angle), math.sin(angle)
    free, contact = reach, -1
    for i in range(px.size):
        way = way_to_point(px[i] * cos + py[i] * sin, py[i] * cos - px[i] * sin, radius)
        if way < free:
            free, contact = way, i
    return free, contact


@kernel
def free_distance(px: Floats, py: Floats, angle: float, radius: float, reach: float) -> float:
    """How far a disc of `radius` can travel along `angle` before it touches a scan point, at most `reach` [m].

    Points beside or behind the disc's centre never block, so a robot nearer to a wall than `radius` can leave it.
    """
    free, _contact = first_contact(px, py, angle, radius, reach)
    return free


@kernel
def free_distances(px: Floats, py: Floats, angles: Floats, radius: float, reach: float, result: Floats) -> None:
    """`free_distance` for each of `angles` (m,), into `result` (m,)."""
    for j in range(angles.size):
        result[j] = free_distance(px, py, angles[j], radius, reach)


@inlined
def bend_of(px: Floats, py: Floats, slack: float, noise: float, g: int, h: int, i: int) -> tuple[float, float]:
    """By how much point i lies before the straight line through the points g and h, neighbours, in inverse ranges.

    On a line the inverse ranges of three neighbours have no second difference, and at a small angle to a wall the nearer
    two foretell the third badly.

    Returns:
        The bend [1/m], positive where i is nearer than the line; infinite where noise leaves it open whether that line is
        met at all. And how much of it `slack` [m] and three times what noise makes of the ranges account for.
    """
    ax, ay = px[h] - px[g], py[h] - py[g]
    u, v, w = 1.0 / math.hypot(px[g], py[g]), 1.0 / math.hypot(px[h], py[h]), 1.0 / math.hypot(px[i], py[i])
    foretold = (px[i] * ay - py[i] * ax) * w / (px[h] * ay - py[h] * ax)
    spread = u**4 + 4.0 * v**4
    if not foretold > 3.0 * noise * math.sqrt(spread):
        return math.inf, 0.0
    return w - foretold, slack * w * foretold + 3.0 * noise * math.sqrt(spread + w**4)


@inlined
def continues(px: Floats, py: Floats, gap: float, noise: float, g: int, h: int, i: int) -> bool:
    """Whether the wall through the scan points g and h, neighbours, goes on to the next one i.

    Their chords are in line within 15 degrees, and the second is not over two and a half times as long. Nor is i nearer
    to the robot than the line through g and h by more than `gap` [m] and three times what noise makes of the ranges: that
    is something behind the end of the wall. It may be farther away, for walls bend away. Where noise leaves it open
    whether the line is met at all, the wall ends.
    """
    ax, ay, bx, by = px[h] - px[g], py[h] - py[g], px[i] - px[h], py[i] - py[h]
    first, second = ax * ax + ay * ay, bx * bx + by * by
    along = ax * bx + ay * by
    if not (along > 0.0 and along * along > 0.933 * first * second and second < 6.25 * first):
        return False
    bend, error = bend_of(px, py, gap, noise, g, h, i)
    return bend <= error


@kernel
def find_pieces(px: Floats, py: Floats, gap: float, growth: float, noise: float, piece: Integers) -> None:
    """Scan points, in the order of their beams around the full circle, cut into pieces of wall that hang together.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        gap: neighbours not farther apart than this hang together [m].
        growth: nor those not farther apart than this share of their distance from the robot; beyond that only those
            in line with the points beside them: a wall that the beams meet at a small angle.
        noise: standard deviation of the ranges [m].
        piece: result (k,), number of each point's piece.
    """
    n = px.size
    first = -1  # the first point that does not hang together with the one before it
    for i in range(n):
        h = i - 1 if i > 0 else n - 1
        x, y = px[i] - px[h], py[i] - py[h]
        away = max(math.hypot(px[h], py[h]), math.hypot(px[i], py[i]))
        piece[i] = 0
        if x * x + y * y <= max(gap, growth * away) ** 2:
            continue
        g = h - 1 if h > 0 else n - 1
        j = i + 1 if i + 1 < n else 0
        if continues(px, py, gap, noise, g, h, i) or continues(px, py, gap, noise, j, i, h):
            continue
        piece[i] = 1
        first = i if first < 0 else first
    if first < 0:
        return
    number = -1
    for k in range(n):
        i = first + k if first + k < n else first + k - n
        number += piece[i]
        piece[i] = number


@inlined
def is_joined(px: Floats, py: Floats, piece: Integers, first: int, second: int, gap: float) -> bool:
    """Whether two contacts (-1: none) are of one obstacle: on one piece of wall, or too near for the disc to pass."""
    if first < 0 or second < 0:
        return False
    if piece[first] == piece[second]:
        return True
    x, y = px[first] - px[second], py[first] - py[second]
    return bool(x * x + y * y <= gap * gap)


@kernel
def find_border(
    px: Floats,
    py: Floats,
    piece: Integers,
    low: float,
    high: float,
    low_contact: int,
    high_contact: int,
    radius: float,
    reach: float,
    gap: float,
) -> tuple[bool, int, int]:
    """Where between two headings an obstacle ends, by bisection.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        piece: number of each point's piece of wall (k,).
        low: the one heading [rad].
        high: the other [rad].
        low_contact: number of the point that the one ends at.
        high_contact: number of the point that the other ends at.
        radius: of the disc [m].
        reach: free way that means "nothing" [m].
        gap: a distance between two points that the disc does not pass [m].

    Returns:
        Whether an obstacle ends there; the last contact on the side of `low`, and the first one on that of `high`.
    """
    for _ in range(10):
        if is_joined(px, py, piece, low_contact, high_contact, gap):
            return False, low_contact, high_contact
        middle = 0.5 * (low + high)
        _, contact = first_contact(px, py, middle, radius, reach)
        if contact == low_contact or is_joined(px, py, piece, low_contact, contact, gap):
            low, low_contact = middle, contact
        else:
            high, high_contact = middle, contact
    return True, low_contact, high_contact


@kernel
def find_runs(
    px: Floats,
    py: Floats,
    piece: Integers,
    angles: Floats,
    radius: float,
    reach: float,
    gap: float,
    free: Floats,
    contact: Integers,
    run: Integers,
) -> None:
    """The profile of free ways over a full circle of headings, cut into runs: neighbours that end at one obstacle.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        piece: number of each point's piece of wall (k,).
        angles: headings (m,), rising by equal angles around the full circle [rad].
        radius: of the disc [m].
        reach: free way that means "nothing" [m].
        gap: a distance between two points that the disc does not pass [m].
        free: result (m,), free way along each heading [m].
        contact: result (m,), number of the point touched there, -1 for none.
        run: result (m,), number of the run that each heading belongs to, -1 for none.
    """
    count = 0
    last = angles.size - 1
    for j in range(angles.size):
        free[j], contact[j] = first_contact(px, py, angles[j], radius, reach)
    for j in range(angles.size):
        run[j] = -1
        if contact[j] < 0:
            continue
        if j > 0 and contact[j - 1] >= 0:
            ends, _, _ = find_border(
                px, py, piece, angles[j - 1], angles[j], contact[j - 1], contact[j], radius, reach, gap
            )
            if not ends:
                run[j] = run[j - 1]
                continue
        run[j] = count
        count += 1
    if run[last] > run[0] >= 0:
        high = angles[last] + angles[1] - angles[0]
        ends, _, _ = find_border(px, py, piece, angles[last], high, contact[last], contact[0], radius, reach, gap)
        if not ends:
            number = run[last]
            for j in range(last, -1, -1):
                if run[j] != number:
                    break
                run[j] = run[0]


@kernel
def gap_after_step(px: Floats, py: Floats, angle: float, step: float) -> float:
    """Distance from the end of a straight step to the nearest scan point [m]."""
    ex, ey = step * math.cos(angle), step * math.sin(angle)
    nearest = math.inf
    for i in range(px.size):
        dx, dy = px[i] - ex, py[i] - ey
        square = dx * dx + dy * dy
        nearest = square if square < nearest else nearest
    return math.sqrt(nearest)


@kernel
def first_open_heading(
    px: Floats, py: Floats, wall_angle: float, side: int, step: float, clearance: float, radius: float, increment: float
) -> float:
    """First heading, turning away from the wall, along which a step ends at `clearance` or more from every point.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        wall_angle: bearing of the wall where the search begins [rad].
        side: +1 turns counter-clockwise (wall on the right), -1 clockwise.
        step: length of the step [m].
        clearance: distance to keep at its end [m].
        radius: the whole step must be free for a disc of this radius [m].
        increment: angle between headings tried [rad]; the first open one is refined by bisection.

    Returns:
        The angle turned from `wall_angle` [rad], or -1 where no heading is open.
    """
    last = 0.0
    for j in range(int(2.0 * math.pi / increment) + 1):
        turned = j * increment
        angle = wall_angle + side * turned
        if gap_after_step(px, py, angle, step) >= clearance and free_distance(px, py, angle, radius, step) >= step:
            if j == 0:
                return 0.0
            for _ in range(12):
                middle = 0.5 * (last + turned)
                angle = wall_angle + side * middle
                if (
                    gap_after_step(px, py, angle, step) >= clearance
                    and free_distance(px, py, angle, radius, step) >= step
                ):
                    turned = middle
                else:
                    last = middle
            return turned
        last = turned
    return -1.0


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
    x: float,
    y: float,
    dx: float,
    dy: float,
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
    """Number of the first of `count` places (x, y) + k (dx, dy) within `reach` that `is_seen_free`, or -1."""
    for k in range(count):
        ex, ey = x + k * dx, y + k * dy
        if math.hypot(ex, ey) <= reach and is_seen_free(
            ex, ey, ranges, first_angle, angle_step, is_round, px, py, radius
        ):
            return k
    return -1


@inlined
def is_foretold(px: Floats, py: Floats, slack: float, noise: float, first: int, second: int, beam: int) -> bool:
    """Whether `beam` meets the straight line through the points of the two neighbours before it, see `bend_of`."""
    bend, error = bend_of(px, py, slack, noise, first, second, beam)
    return abs(bend) <= error


@called
def goes_on_straight(
    px: Floats, py: Floats, ranges: Floats, reach: float, jump: float, noise: float, i: int, way: int
) -> bool:
    """Whether the wall seen by beam i and those before it, counted in the direction `way`, foretells the next range."""
    n = ranges.size
    ahead, before, earlier = (i + way) % n, (i - way) % n, (i - 2 * way) % n
    straight = 0.2 * jump
    if ranges[before] >= reach:
        return False
    # After a jump those two must lie on a line with a third.
    is_jump = abs(ranges[i] - ranges[before]) > jump
    if is_jump and (ranges[earlier] >= reach or not is_foretold(px, py, straight, noise, earlier, before, i)):
        return False
    return is_foretold(px, py, straight, noise, before, i, ahead)


@called
def meet_in_corner(px: Floats, py: Floats, ranges: Floats, reach: float, i: int, j: int) -> bool:
    """Whether the walls seen before beam i and after its neighbour j run into each other between the two beams.

    Each goes on straight there for at most one and a half times the length seen between its last two points. Not where
    the beams meet a wall at too small an angle to tell its end from its meeting with the next.
    """
    n = ranges.size
    before, after = (i - 1) % n, (j + 1) % n
    if ranges[before] >= reach or ranges[after] >= reach:
        return False
    ax, ay, bx, by = px[i] - px[before], py[i] - py[before], px[j] - px[after], py[j] - py[after]
    if 9.0 * (ax * ax + ay * ay) > ranges[i] * ranges[i] or 9.0 * (bx * bx + by * by) > ranges[j] * ranges[j]:
        return False
    across = ax * by - ay * bx
    dx, dy = px[j] - px[i], py[j] - py[i]
    first, second = (dx * by - dy * bx) / across, (dx * ay - dy * ax) / across
    return bool(0.0 <= first <= 1.5 and 0.0 <= second <= 1.5)


@kernel
def link_beams(
    px: Floats,
    py: Floats,
    ranges: Floats,
    reach: float,
    jump: float,
    gap: float,
    noise: float,
    wraps: bool,
    link: Flags,
) -> None:
    """Which beams see one surface together with their next neighbour, into `link` (B,).

    They do when their ranges differ by at most `jump`, when nothing passes between their points, or when the walls
    beside them go on straight, to the other point or into a corner: at a small angle to a wall the ranges of neighbours
    differ by any amount.

    Args:
        px: points' x (B,) in the robot's frame [m], one for each beam.
        py: points' y (B,) [m].
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        jump: change of range that is one [m].
        gap: a distance that no disc passes [m].
        noise: standard deviation of the ranges [m].
        wraps: whether the last beam is the first one's neighbour.
        link: result (B,), whether beam i and beam i + 1 see one surface.
    """
    n = ranges.size
    for i in range(n):
        j = (i + 1) % n
        link[i] = False
        if ranges[i] >= reach or ranges[j] >= reach or (j == 0 and not wraps):
            continue
        if abs(ranges[i] - ranges[j]) <= jump or math.hypot(px[i] - px[j], py[i] - py[j]) <= gap:
            link[i] = True
        else:
            link[i] = (
                goes_on_straight(px, py, ranges, reach, jump, noise, i, 1)
                or goes_on_straight(px, py, ranges, reach, jump, noise, j, -1)
                or meet_in_corner(px, py, ranges, reach, i, j)
            )


@inlined
def way_to_wall(along1: float, beside1: float, along2: float, beside2: float, radius: float) -> tuple[float, float]:
    """How far a disc goes until it touches the inside of a straight wall, and the share of the wall before that point.

    The ends of the wall are points of their own. The way is infinite where the disc touches them first, or nothing.
    """
    dx, dy = along2 - along1, beside2 - beside1
    length = math.hypot(dx, dy)
    # (nx, ny) is square to the wall and points ahead; `away` is the distance of the wall's line, negative behind.
    nx, ny = -dy / length, dx / length
    if nx < 0.0:
        nx, ny = -nx, -ny
    away = nx * along1 + ny * beside1
    way, reached = max((away - radius) / nx, 0.0), min(away, radius)
    share = ((way + reached * nx - along1) * dx + (reached * ny - beside1) * dy) / (length * length)
    if not (away > 0.0 and 0.0 < share < 1.0):
        return math.inf, share
    return way, share


@inlined
def is_long_wall(px: Floats, py: Floats, link: Flags, radius: float, i: int) -> bool:
    """Whether beam i and the next see a wall so long between them that a disc could sink into it visibly."""
    if not link[i]:
        return False
    j = i + 1 if i + 1 < link.size else 0
    dx, dy = px[j] - px[i], py[j] - py[i]
    return bool(dx * dx + dy * dy > 0.0625 * radius * radius)


@kernel
def sweep_disc(
    px: Floats,
    py: Floats,
    ranges: Floats,
    reach: float,
    link: Flags,
    radius: float,
    first: float,
    cos: Floats,
    sin: Floats,
    free: Floats,
    beam: Integers,
) -> None:
    """The scan in configuration space: how far a disc gets along each of the headings of a full circle.

    A wall goes on straight between linked beams, so that no disc slips through where the beams are sparse.

    Args:
        px: points' x (B,) in the robot's frame [m], one for each beam.
        py: points' y (B,) [m].
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        link: (B,) from `link_beams`.
        radius: of the disc [m].
        first: heading 0, the others follow counter-clockwise [rad].
        cos: of each heading (m,).
        sin: of each heading (m,).
        free: result (m,), free way along each heading [m]; infinite where the disc touches nothing.
        beam: result (m,), the beam that saw what is touched, -1 for none.
    """
    n, m = ranges.size, free.size
    increment = 2.0 * math.pi / m
    free[:] = math.inf
    beam[:] = -1
    for i in range(n):
        if ranges[i] >= reach:
            continue
        x, y = px[i], py[i]
        half = math.asin(radius / ranges[i]) if ranges[i] > radius else 0.5 * math.pi
        middle = math.atan2(y, x) - first
        for heading in range(math.ceil((middle - half) / increment), math.floor((middle + half) / increment) + 1):
            k = heading % m
            way = way_to_point(x * cos[k] + y * sin[k], y * cos[k] - x * sin[k], radius)
            if way < free[k]:
                free[k], beam[k] = way, i
        if not is_long_wall(px, py, link, radius, i):
            continue
        j = (i + 1) % n
        u, v = px[j], py[j]
        half = max(half, math.asin(radius / ranges[j]) if ranges[j] > radius else 0.5 * math.pi)
        turn = math.atan2(x * v - y * u, x * u + y * v)
        low, high = middle + min(turn, 0.0) - half, middle + max(turn, 0.0) + half
        for heading in range(math.ceil(low / increment), math.floor(high / increment) + 1):
            k = heading % m
            along, beside = x * cos[k] + y * sin[k], y * cos[k] - x * sin[k]
            way, share = way_to_wall(along, beside, u * cos[k] + v * sin[k], v * cos[k] - u * sin[k], radius)
            if way < free[k]:
                free[k], beam[k] = way, i if share < 0.5 else j


@called
def beams_between(
    px: Floats,
    py: Floats,
    ranges: Floats,
    reach: float,
    link: Flags,
    radius: float,
    low: float,
    high: float,
    chosen: Integers,
) -> int:
    """Numbers of the beams whose points or walls a disc may touch along the headings from `low` to `high`.

    Args:
        px: points' x (B,) in the robot's frame [m], one for each beam.
        py: points' y (B,) [m].
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        link: (B,) from `link_beams`.
        radius: of the disc [m].
        low: heading [rad].
        high: heading, a few degrees further at most [rad].
        chosen: result, as many numbers as are returned; room for (B,).
    """
    low_x, low_y, high_x, high_y = math.cos(low), math.sin(low), math.cos(high), math.sin(high)
    count = 0
    for i in range(ranges.size):
        if ranges[i] >= reach:
            continue
        above, below = py[i] * low_x - px[i] * low_y, py[i] * high_x - px[i] * high_y
        if is_long_wall(px, py, link, radius, i):
            j = i + 1 if i + 1 < link.size else 0
            above = max(above, py[j] * low_x - px[j] * low_y)
            below = min(below, py[j] * high_x - px[j] * high_y)
        if above > -radius and below < radius:
            chosen[count] = i
            count += 1
    return count


@called
def touch_along(
    px: Floats, py: Floats, link: Flags, radius: float, angle: float, chosen: Integers, count: int
) -> tuple[float, int, float, float]:
    """What a disc touches first along a heading: free way, beam that saw it (-1 for none), x and y of the point.

    Only the first `count` beams of `chosen`, from `beams_between`, are looked at.
    """
    cos, sin = math.cos(angle), math.sin(angle)
    free, beam, x, y = math.inf, -1, 0.0, 0.0
    for c in range(count):
        i = chosen[c]
        along, beside = px[i] * cos + py[i] * sin, py[i] * cos - px[i] * sin
        way = way_to_point(along, beside, radius)
        if way < free:
            free, beam, x, y = way, i, px[i], py[i]
        if is_long_wall(px, py, link, radius, i):
            j = i + 1 if i + 1 < link.size else 0
            way, share = way_to_wall(along, beside, px[j] * cos + py[j] * sin, py[j] * cos - px[j] * sin, radius)
            if way < free:
                free, beam = way, i if share < 0.5 else j
                x, y = px[i] + share * (px[j] - px[i]), py[i] + share * (py[j] - py[i])
    return free, beam, x, y


@called
def is_one_surface(link: Flags, i: int, j: int) -> bool:
    """Whether beams i and j see one surface: all neighbours between them, the shorter way round, are linked."""
    n = link.size
    if i < 0 or j < 0:
        return False
    ahead = (j - i) % n
    begin, count = (i, ahead) if 2 * ahead <= n else (j, n - ahead)
    linked = 0
    while linked < count and link[(begin + linked) % n]:
        linked += 1
    return bool(linked == count)


@called
def farthest_end(
    px: Floats, py: Floats, ranges: Floats, link: Flags, noise: float, wraps: bool, last: int, way: int
) -> tuple[float, float]:
    """Up to where a wall may go on unseen whose last point in sight is that of a beam, counted in the direction `way`.

    That is where it would meet the next beam, which has missed it: at a small angle to a wall, far away. As far as three
    times the noise of the two ranges that foretell it.
    """
    n = ranges.size
    before, after = (last - way) % n, (last + way) % n
    behind, ahead = (before, last) if way > 0 else (last, after)
    is_edge = not wraps and not 0 <= last + way < n
    if is_edge or link[ahead] or not link[behind]:
        return px[last], py[last]
    u, v = 1.0 / ranges[before], 1.0 / ranges[last]
    bend = 2.0 * (px[before] * px[last] + py[before] * py[last]) * u * v
    least = bend * v - u - 3.0 * noise * math.sqrt(u**4 + 4.0 * v**4)
    share = 1.0 / max(least * ranges[after], 1.0)
    return share * px[after], share * py[after]


@kernel
def find_open_points(
    px: Floats,
    py: Floats,
    ranges: Floats,
    reach: float,
    link: Flags,
    radius: float,
    first: float,
    free: Floats,
    beam: Integers,
    jump: float,
    noise: float,
    wraps: bool,
    chosen: Integers,
    found: Floats,
    side: Integers,
) -> int:
    """Where the free way of a disc jumps between neighbouring headings, from one surface to another or to none.

    Args:
        px: points' x (B,) in the robot's frame [m], one for each beam.
        py: points' y (B,) [m].
        ranges: (B,) [m].
        reach: range that means "nothing seen" [m].
        link: (B,) from `link_beams`.
        radius: of the disc [m].
        first: heading 0 [rad].
        free: free way along each heading (m,) [m], from `sweep_disc`.
        beam: the beam that saw what ends it (m,), from `sweep_disc`.
        jump: change of the free way that is one [m].
        noise: standard deviation of the ranges [m].
        wraps: whether the last beam is the first one's neighbour.
        chosen: scratch (B,).
        found: result (m, 5): the heading where the nearer surface ends, counted from heading 0 [rad], x and y of the
            point touched there, and of the `farthest_end` [m].
        side: result (m,), +1 where the nearer surface ends counter-clockwise, -1 where it ends clockwise.

    Returns:
        How many there are, in the order of the headings.
    """
    count = 0
    increment = 2.0 * math.pi / free.size
    for k in range(free.size):
        after = (k + 1) % free.size
        change = free[after] - free[k]
        if not abs(change) > jump or is_one_surface(link, beam[k], beam[after]):
            continue
        inside, outside = k * increment, (k + 1) * increment
        seen = beams_between(px, py, ranges, reach, link, radius, first + inside, first + outside, chosen)
        surface = beam[k]
        if change < 0.0:
            inside, outside, surface = outside, inside, beam[after]
        _, last, x, y = touch_along(px, py, link, radius, first + inside, chosen, seen)
        # Headings are coarse: at a small angle to a wall the disc touches it far before its end.
        for _ in range(8):
            middle = 0.5 * (inside + outside)
            _, touched, touched_x, touched_y = touch_along(px, py, link, radius, first + middle, chosen, seen)
            if is_one_surface(link, surface, touched):
                inside, last, x, y = middle, touched, touched_x, touched_y
            else:
                outside = middle
        side[count] = 1 if change > 0.0 else -1
        found[count, 0], found[count, 1], found[count, 2] = inside, x, y
        found[count, 3], found[count, 4] = x, y
        if last >= 0:
            found[count, 3:] = farthest_end(px, py, ranges, link, noise, wraps, last, side[count])
        count += 1
    return count
