"""Kinematics of a robot seen from its driver: a desired velocity -> the action of its kinematics, and back.

The motion itself is compiled (kernels.drive.drive); this is the inverse that scripted policies and discrete actions use.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

TURN_GAIN = 4.0
"""Turn rate per radian of heading error [1/s]: the error is gone in about four time constants, one second."""

TURN_IN_PLACE = math.radians(30.0)
"""Heading error [rad] beyond which a differential robot stands while it turns."""


@dataclass(frozen=True)
class Drive:
    """What a driver knows of the robot's motion."""

    kinematics: str
    """"holonomic" or "differential"."""
    max_speed: float
    """Largest forward speed [m/s]."""
    max_reverse: float
    """Largest backward speed [m/s]; differential only."""
    max_turn_rate: float
    """Largest turn rate [rad/s]; differential only."""
    step: float
    """Time between two actions [s]."""
    max_acceleration: float = math.inf
    """Largest change of speed [m/s^2]."""
    latency: int = 0
    """Steps from an action to the one in which it acts."""


def steering(drive: Drive, velocity: tuple[float, float] | NDArray[np.float64]) -> NDArray[np.float32]:
    """The action that comes nearest to a desired velocity.

    Args:
        drive: kinematics and limits of the robot.
        velocity: (2,) desired velocity in the robot's frame [m/s], x ahead, y left.

    Returns:
        (2,) float32 action in [-1, 1]. A holonomic robot drives the velocity as it is (cut to its top speed). A
        differential robot turns toward it, slows down by the cosine of the heading error and stands while the error
        is above 30 degrees; it turns no further in one step than it needs to.
    """
    vx, vy = float(velocity[0]), float(velocity[1])
    speed = math.hypot(vx, vy)
    if drive.kinematics == "holonomic":
        scale = 1.0 / max(drive.max_speed, speed)
        return np.array([vx * scale, vy * scale], dtype=np.float32)
    return differential_action(drive, *turning(drive, (vx, vy)))


def turning(drive: Drive, velocity: tuple[float, float]) -> tuple[float, float]:
    """Forward speed [m/s] and turn rate [rad/s] of a differential robot that desires a velocity, as `steering` says."""
    speed = math.hypot(*velocity)
    error = math.atan2(velocity[1], velocity[0]) if speed > 0.0 else 0.0
    rate = turn_rate(drive, error)
    ahead = min(speed, drive.max_speed) * math.cos(error) if abs(error) <= TURN_IN_PLACE else 0.0
    return ahead, rate


def turn_rate(drive: Drive, error: float) -> float:
    """How fast a differential robot turns at a heading error [rad], in rad/s."""
    return min(max(min(TURN_GAIN, 1.0 / drive.step) * error, -drive.max_turn_rate), drive.max_turn_rate)


def differential_action(drive: Drive, speed: float, turn_rate: float) -> NDArray[np.float32]:
    """The action (2,) of a forward speed [m/s] and a turn rate [rad/s], cut to the robot's limits."""
    span = drive.max_speed + drive.max_reverse
    forward = 2.0 * (min(max(speed, -drive.max_reverse), drive.max_speed) + drive.max_reverse) / span - 1.0
    turn = min(max(turn_rate / drive.max_turn_rate, -1.0), 1.0) if drive.max_turn_rate > 0.0 else 0.0
    return np.array([forward, turn], dtype=np.float32)


def asked_velocity(drive: Drive, action: ArrayLike) -> tuple[float, float]:
    """What an action (2,) asks for: ahead and to the left [m/s], or ahead [m/s] and a turn rate [rad/s]."""
    first, second = map(float, np.asarray(action))
    if drive.kinematics == "holonomic":
        scale = drive.max_speed / max(math.hypot(first, second), 1.0)
        return scale * first, scale * second
    return 0.5 * (first + 1.0) * (drive.max_speed + drive.max_reverse) - drive.max_reverse, second * drive.max_turn_rate


DISCRETE_HEADINGS = 32
DISCRETE_SPEEDS = 4


def discrete_velocities(drive: Drive) -> NDArray[np.float64]:
    """Desired velocities (128, 2) [m/s] of the discrete actions: heading i // 4 of 32, speed (i % 4 + 1) / 4 of top."""
    index = np.arange(DISCRETE_HEADINGS * DISCRETE_SPEEDS)
    angle = 2.0 * np.pi * (index // DISCRETE_SPEEDS) / DISCRETE_HEADINGS
    speed = drive.max_speed * (index % DISCRETE_SPEEDS + 1) / DISCRETE_SPEEDS
    return np.stack([speed * np.cos(angle), speed * np.sin(angle)], axis=1)


def discrete_actions(drive: Drive) -> NDArray[np.float32]:
    """Continuous actions (128, 2) of the discrete ones, through `steering`."""
    return np.stack([steering(drive, velocity) for velocity in discrete_velocities(drive)])
