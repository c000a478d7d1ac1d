"""How a robot is driven: an action becomes a motion, and the odometry an estimate of it."""

from __future__ import annotations

import math

from bug_gym.compiling import inlined
from bug_gym.kernels.body import place_after
from bug_gym.kernels.geometry import chord_of, clip, length, sin_cos, wrap
from bug_gym.kernels.ground import factor_at
from bug_gym.kernels.layout import ACKERMANN, HOLONOMIC, STREAM_ODOMETRY, Floats, Integers, Record, Regions
from bug_gym.kernels.randomness import hash64, normal


@inlined
def exchange_pending(f: Floats, k: Integers, s: Record, r: int, first: float, second: float) -> tuple[float, float]:
    """Put robot r's action at the end of those that have yet to act, and take the one that acts in this step."""
    slot = s.pending + 2 * (s.latency * r + k[s.steps] % s.latency)
    due = f[slot], f[slot + 1]
    f[slot], f[slot + 1] = first, second
    return due


@inlined
def clear_pending(f: Floats, s: Record, r: int) -> None:
    """Have robot r stand until its first action acts."""
    standing = 0.0
    if s.kinematics != HOLONOMIC:
        standing = 2.0 * s.full_reverse / (s.full_speed + s.full_reverse) - 1.0
    for i in range(s.latency):
        f[s.pending + 2 * (s.latency * r + i)] = standing
        f[s.pending + 2 * (s.latency * r + i) + 1] = 0.0


@inlined
def drive(f: Floats, s: Record, regions: Regions, r: int, first: float, second: float) -> None:
    """Turn robot r's action into its velocity and into the pose where this step would bring it (next_pose).

    Actions are shares of what any robot of the scenario can do (full_speed and the like); this one cuts them to its own.
    The ground where its centre is now divides its greatest speeds: it enters a region as slow as that lets it be.
    """
    step = s.step
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    max_speed, max_reverse = s.max_speed, s.max_reverse
    full_speed, full_reverse = s.full_speed, s.full_reverse
    if regions is not None:
        factor = factor_at(s, regions, x, y)
        max_speed, max_reverse = max_speed / factor, max_reverse / factor
        full_speed, full_reverse = full_speed / factor, full_reverse / factor
        slow_down(f, s, r, max_speed, max_reverse)
    if s.kinematics == HOLONOMIC:
        norm = max(length(first, second), 1.0)
        vx, vy = first / norm * full_speed, second / norm * full_speed
        if full_speed > max_speed:
            speed = length(vx, vy)
            share = max_speed / speed if speed > max_speed else 1.0
            vx, vy = share * vx, share * vy
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
    speed = -full_reverse + 0.5 * (first + 1.0) * (full_speed + full_reverse)
    if full_speed > max_speed or full_reverse > max_reverse:
        speed = clip(speed, -max_reverse, max_speed)
    limit = s.max_acceleration * step
    speed = min(max(speed, f[s.velocity + 2 * r] - limit), f[s.velocity + 2 * r] + limit)
    if s.kinematics == ACKERMANN:
        # The bicycle's: heading' = v tan(steering) / wheelbase about the rear axle (LaValle 2006, section 13.1.2.1).
        steering_sin, steering_cos = sin_cos(clip(second * s.full_steering, -s.max_steering, s.max_steering))
        rate = speed * (steering_sin / steering_cos) / s.wheelbase
    else:
        rate = clip(second * s.full_turn_rate, -s.max_turn_rate, s.max_turn_rate)
    half = 0.5 * rate * step
    chord = chord_of(speed * step, half)
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
def track_odometry(
    f: Floats, k: Integers, s: Record, r: int, dx: float, dy: float, turn: float, distance: float
) -> None:
    """Advance robot r's own estimate of its pose by a motion (dx, dy) in its frame before the step, and a turn."""
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
    """Move robot r along its chord, or its arc, to the fraction where its step ends."""
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    wx, wy = fraction * (f[s.next_pose + 3 * r] - x), fraction * (f[s.next_pose + 3 * r + 1] - y)
    turn = fraction * (f[s.next_pose + 3 * r + 2] - heading)
    if s.arcs != 0:
        end_x, end_y = place_after(f, s, r, fraction)
        wx, wy = end_x - x, end_y - y
    way = length(wx, wy)
    sin, cos = sin_cos(heading)
    dx, dy = cos * wx + sin * wy, cos * wy - sin * wx
    distance = length(dx, dy)
    if s.arcs != 0:
        way = distance = fraction * abs(f[s.velocity + 2 * r]) * s.step
    track_odometry(f, k, s, r, dx, dy, turn, distance)
    f[s.pose + 3 * r] = x + wx
    f[s.pose + 3 * r + 1] = y + wy
    f[s.pose + 3 * r + 2] = wrap(heading + turn)
    f[s.path_length + r] += way
