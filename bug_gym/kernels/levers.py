"""What a robot that turns is told, so that it comes to drive at a desired velocity: the inverse of `drive`.

For policies. Nothing here sees the world.
"""

from __future__ import annotations

import math

from bug_gym.compiling import kernel

TURN_GAIN = 4.0
"""Turn rate per radian of heading error [1/s]: the error is gone in about four time constants, one second."""

TURN_IN_PLACE = math.radians(30.0)
"""Heading error [rad] beyond which a differential robot stands while it turns."""


@kernel
def turn_rate(error: float, step: float, most: float) -> float:
    """How fast a robot turns at a heading error [rad], in rad/s and at most so fast; no further in a step than it needs to."""
    return min(max(min(TURN_GAIN, 1.0 / step) * error, -most), most)


@kernel
def turning(speed: float, error: float, fastest: float, step: float, most: float) -> tuple[float, float]:
    """Speed ahead [m/s] and turn rate [rad/s] of a differential robot that desires a speed at a heading error [rad].

    Args:
        fastest: its top speed [m/s].
        step: of time [s].
        most: its greatest turn rate [rad/s].
    """
    ahead = min(speed, fastest) * math.cos(error) if abs(error) <= TURN_IN_PLACE else 0.0
    return ahead, turn_rate(error, step, most)


@kernel
def speed_lever(speed: float, fastest: float, reverse: float) -> float:
    """The first number of an action, in [-1, 1], for a speed [m/s] cut to the greatest ahead and back [m/s]."""
    return 2.0 * (min(max(speed, -reverse), fastest) + reverse) / (fastest + reverse) - 1.0


@kernel
def levers(speed: float, rate: float, fastest: float, reverse: float, most: float) -> tuple[float, float]:
    """The action of a differential robot for a speed [m/s] and a turn rate [rad/s], each cut to what it can do."""
    turn = rate / most if most > 0.0 else 0.0
    return speed_lever(speed, fastest, reverse), min(max(turn, -1.0), 1.0)
