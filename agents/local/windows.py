"""Dynamic windows, compiled: how far a disc can drive along circles, and what each velocity of a window is worth."""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.free_way import first_contact
from bug_gym.kernels.geometry import clip, length, wrap
from bug_gym.kernels.layout import Floats

STRAIGHT = 1e-6
"""Turn rates below this are none [rad/s]."""


class Window(NamedTuple):
    """What can be driven next, and how it is weighed."""

    radius: float
    """Of the body and what is kept beside it [m]."""
    max_speed: float
    """[m/s]"""
    step: float
    """Time of a decision [s]."""
    acceleration: float
    """Largest, to brake with too [m/s^2]; infinite: none."""
    turn_rate: float
    """Largest at which it still drives ahead [rad/s]."""
    gain: float
    """Turn rate that a radian of heading error is steered with [1/s]; a robot that turns goes ahead by its cosine."""
    look: float
    """Free ways beyond this are all the same [m]."""
    heading_weight: float
    """alpha."""
    distance_weight: float
    """beta."""
    speed_weight: float
    """gamma."""
    is_holonomic: bool
    """Whether the second number of a velocity is a direction [rad] instead of a turn rate [rad/s]."""
    is_steered: bool = False
    """Whether it is a curvature [1/m], as a robot has that cannot turn on the spot."""


@called
def arc_distance(px: Floats, py: Floats, speed: float, rate: float, radius: float, look: float) -> float:
    """How far a disc drives along a circle until it touches a point [m], at most `look` or once round.

    Points that it overlaps count only ahead of it.

    Args:
        px: points (k,) in the robot's frame [m].
        py: the same.
        speed: above 0 [m/s].
        rate: turn rate [rad/s].
        radius: of the disc [m].
        look: [m].
    """
    if abs(rate) < STRAIGHT:
        return first_contact(px, py, 0.0, radius, look)[0]
    bend = speed / abs(rate)
    side = 1.0 if rate > 0.0 else -1.0
    far = min(look, 2.0 * math.pi * bend)
    inner, outer = max(bend - radius, 0.0), bend + radius
    for i in range(px.size):
        # Seen from the centre of the circle, turned so that the robot starts at angle 0 and goes on to larger ones.
        x, y = bend - side * py[i], px[i]
        square = x * x + y * y
        if square <= inner * inner or square >= outer * outer:
            continue
        away = math.sqrt(square)
        angle = math.atan2(y, x)
        half = math.acos(clip((bend * bend + square - radius * radius) / (2.0 * bend * away), -1.0, 1.0))
        begin = angle - half
        if begin < 0.0 < angle + half:
            if y > 0.0:
                return 0.0
            continue
        way = bend * (begin if begin >= 0.0 else begin + 2.0 * math.pi)
        far = min(far, way)
    return far


@inlined
def way_to_stop(window: Window, speed: float) -> float:
    """How far the robot comes in this step and while it brakes after it [m]."""
    return speed * window.step + 0.5 * speed * speed / window.acceleration


@called
def driven_speed(window: Window, speed: float, second: float) -> float:
    """How fast the robot goes that steers at a speed so as to turn at a rate [m/s]."""
    return speed if window.is_holonomic or window.is_steered else speed * math.cos(second / window.gain)


@called
def heading_error(window: Window, gx: float, gy: float, speed: float, second: float) -> float:
    """Angle of the goal from the heading where the robot comes to a stop, or from the direction of travel [rad]."""
    if window.is_holonomic:
        return abs(wrap(math.atan2(gy, gx) - second))
    # While it brakes it goes on turning: the time that the way at this speed would take.
    time = window.step + 0.5 * speed / window.acceleration
    turned = second * time
    if abs(second) < STRAIGHT:
        x, y = speed * time, 0.0
    else:
        x, y = speed / second * math.sin(turned), speed / second * (1.0 - math.cos(turned))
    return abs(wrap(math.atan2(gy - y, gx - x) - turned))


@kernel
def weigh_window(
    window: Window,
    speeds: Floats,
    seconds: Floats,
    px: Floats,
    py: Floats,
    gx: float,
    gy: float,
    scores: Floats,
) -> None:
    """The score of each velocity of a window that can be stopped in time; minus infinity of the others.

    Args:
        window: limits and weights.
        speeds: (v,) [m/s], from 0 up; of a robot that turns they are those that it is steered with.
        seconds: (w,) turn rates [rad/s], curvatures [1/m] or directions [rad].
        px: scan points (k,) in the robot's frame [m].
        py: the same.
        gx: goal in the robot's frame [m].
        gy: the same.
        scores: (v, w), written here.
    """
    goal = length(gx, gy)
    for i in range(speeds.size):
        for j in range(seconds.size):
            second = seconds[j] * speeds[i] if window.is_steered else seconds[j]
            speed = driven_speed(window, speeds[i], second)
            if window.is_holonomic or speed == 0.0:  # who stands, looks along the heading after the decision
                bearing = second if window.is_holonomic else second * window.step
                free = first_contact(px, py, bearing, window.radius, window.look)[0]
            else:
                free = arc_distance(px, py, speed, second, window.radius, window.look)
            if way_to_stop(window, speed) > free:
                scores[i, j] = -math.inf
                continue
            toward = 1.0 - heading_error(window, gx, gy, speed, second) / math.pi
            # What lies behind the goal is in nobody's way.
            room = 1.0 if free >= goal else free / window.look
            scores[i, j] = (
                window.heading_weight * toward
                + window.distance_weight * room
                + window.speed_weight * speed / window.max_speed
            )
