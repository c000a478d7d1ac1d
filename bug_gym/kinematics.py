"""Kinematics of a robot seen from its driver: a desired velocity -> the action of its kinematics, and back.

The motion itself is compiled (kernels.drive.drive); this is the inverse that scripted policies and discrete actions use.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bug_gym import kernels
from bug_gym.kernels.levers import TURN_GAIN as TURN_GAIN
from bug_gym.kernels.levers import TURN_IN_PLACE as TURN_IN_PLACE


@dataclass(frozen=True)
class Drive:
    """What a driver knows of the robot's motion."""

    kinematics: str
    """"holonomic", "differential" or "ackermann"."""
    max_speed: float
    """Largest forward speed [m/s]."""
    max_reverse: float
    """Largest backward speed [m/s]; not of a holonomic robot."""
    max_turn_rate: float
    """Largest turn rate [rad/s]; an ackermann robot's at full speed, a holonomic one does not turn."""
    step: float
    """Time between two actions [s]."""
    max_acceleration: float = math.inf
    """Largest change of speed [m/s^2]."""
    latency: int = 0
    """Steps from an action to the one in which it acts."""
    wheelbase: float = 0.0
    """Between the axles [m]; ackermann only."""
    max_steering: float = 0.0
    """Greatest steering angle [rad]; ackermann only."""

    @cached_property
    def fast_bend(self) -> float:
        """Radius of the sharpest arc at full speed [m]; not of a holonomic robot."""
        return self.max_speed / max(self.max_turn_rate, 1e-3)

    @cached_property
    def has_inertia(self) -> bool:
        """Whether the robot cannot change its speed at once."""
        return math.isfinite(self.max_acceleration) or self.latency > 0

    @cached_property
    def limits(self) -> NDArray[np.float64]:
        """Top speed, top speed back [m/s], greatest turn rate [rad/s] and acceleration [m/s^2], and the step [s]."""
        return np.array([self.max_speed, self.max_reverse, self.max_turn_rate, self.max_acceleration, self.step])

    @property
    def least_bend(self) -> float:
        """Radius of the sharpest arc that it can drive [m]; 0: it turns on the spot, or need not turn."""
        return self.wheelbase / math.tan(self.max_steering) if self.kinematics == "ackermann" else 0.0


def steering(drive: Drive, velocity: tuple[float, float] | NDArray[np.float64]) -> NDArray[np.float32]:
    """The action that comes nearest to a desired velocity.

    Args:
        drive: kinematics and limits of the robot.
        velocity: (2,) desired velocity in the robot's frame [m/s], x ahead, y left.

    Returns:
        (2,) float32 action in [-1, 1]. A holonomic robot drives the velocity as it is (cut to its top speed). A
        differential robot turns toward it, slows down by the cosine of the heading error and stands while the error
        is above 30 degrees; it turns no further in one step than it needs to. An ackermann robot never stands: it goes
        on while it turns, at least at half the speed, so that it may come round in an arc.
    """
    vx, vy = float(velocity[0]), float(velocity[1])
    speed = math.hypot(vx, vy)
    if drive.kinematics == "holonomic":
        scale = 1.0 / max(drive.max_speed, speed)
        return np.array([vx * scale, vy * scale], dtype=np.float32)
    return differential_action(drive, *turning(drive, (vx, vy)))


def turning(drive: Drive, velocity: tuple[float, float]) -> tuple[float, float]:
    """Forward speed [m/s] and turn rate [rad/s] of a robot that turns and desires a velocity, as `steering` says."""
    speed, error = speed_and_error(velocity)
    if drive.kinematics == "ackermann":
        rate = turn_rate(drive, error)
        ahead = min(speed, drive.max_speed) * max(math.cos(error), 0.5)
        fastest = ahead / drive.least_bend
        return ahead, min(max(rate, -fastest), fastest)
    return kernels.turning(speed, error, drive.max_speed, drive.step, drive.max_turn_rate)


def speed_and_error(velocity: tuple[float, float]) -> tuple[float, float]:
    """A desired speed [m/s], and how far to turn toward it [rad]."""
    speed = math.hypot(*velocity)
    return speed, math.atan2(velocity[1], velocity[0]) if speed > 0.0 else 0.0


def turn_rate(drive: Drive, error: float) -> float:
    """How fast a robot turns at a heading error [rad], in rad/s."""
    return kernels.turn_rate(error, drive.step, drive.max_turn_rate)


def differential_action(drive: Drive, speed: float, turn_rate: float) -> NDArray[np.float32]:
    """The action (2,) of a forward speed [m/s] and a turn rate [rad/s], cut to the limits of any robot that turns.

    An ackermann robot keeps the arc where its speed is cut; one that is to stand holds its wheels straight.
    """
    action = np.empty(2, dtype=np.float32)  # np.array takes twice the time
    if drive.kinematics == "ackermann":
        angle = math.atan(drive.wheelbase * turn_rate / speed) if speed != 0.0 else 0.0
        action[0] = kernels.speed_lever(speed, drive.max_speed, drive.max_reverse)
        action[1] = min(max(angle / drive.max_steering, -1.0), 1.0)
    else:
        most = drive.max_turn_rate
        action[0], action[1] = kernels.levers(speed, turn_rate, drive.max_speed, drive.max_reverse, most)
    return action


def asked_velocity(drive: Drive, action: ArrayLike) -> tuple[float, float]:
    """What an action (2,) asks for: ahead and to the left [m/s], or ahead [m/s] and a turn rate [rad/s]."""
    first, second = map(float, np.asarray(action))
    if drive.kinematics == "holonomic":
        scale = drive.max_speed / max(math.hypot(first, second), 1.0)
        return scale * first, scale * second
    speed = 0.5 * (first + 1.0) * (drive.max_speed + drive.max_reverse) - drive.max_reverse
    if drive.kinematics == "ackermann":
        return speed, speed * math.tan(second * drive.max_steering) / drive.wheelbase
    return speed, second * drive.max_turn_rate


DISCRETE_HEADINGS = 32
DISCRETE_SPEEDS = 4


def discrete_velocities(drive: Drive) -> NDArray[np.float64]:
    """Desired velocities (128, 2) [m/s] of the discrete actions: heading i // 4 of 32, speed (i % 4 + 1) / 4 of top."""
    index = np.arange(DISCRETE_HEADINGS * DISCRETE_SPEEDS)
    angle = 2.0 * np.pi * (index // DISCRETE_SPEEDS) / DISCRETE_HEADINGS
    speed = drive.max_speed * (index % DISCRETE_SPEEDS + 1) / DISCRETE_SPEEDS
    return np.stack([speed * np.cos(angle), speed * np.sin(angle)], axis=1)


def discrete_choices(drive: Drive) -> NDArray[np.float64]:
    """What a driver compares discrete actions by (128, 2): velocities [m/s], or an ackermann robot's actions."""
    if drive.kinematics == "ackermann":
        return discrete_actions(drive).astype(np.float64)
    return discrete_velocities(drive)


STEERED_AHEAD = DISCRETE_HEADINGS // 4
"""Of the headings of discrete actions so many to either side of straight ahead are driven ahead by an ackermann robot, the
rest backwards."""


def discrete_actions(drive: Drive) -> NDArray[np.float32]:
    """Continuous actions (128, 2) of the discrete ones, through `steering`; of an ackermann robot as `steered_table` says."""
    if drive.kinematics == "ackermann":
        return steered_table(drive)
    return np.stack([steering(drive, velocity) for velocity in discrete_velocities(drive)])


def steered_table(drive: Drive) -> NDArray[np.float32]:
    """Actions (128, 2) of an ackermann robot's discrete ones: action i goes toward heading i // 4 of 32, as a car does.

    Headings 0 to 8 and 24 to 31 go ahead, the wheels turned in proportion to the heading, at 90 degrees as far as they
    go; 9 to 23 go back, likewise about straight back, the tail toward the heading. The speed is (i % 4 + 1) / 4 of the
    greatest ahead or back.
    """
    index = np.arange(DISCRETE_HEADINGS * DISCRETE_SPEEDS)
    heading = index // DISCRETE_SPEEDS
    share = (index % DISCRETE_SPEEDS + 1) / DISCRETE_SPEEDS
    aside = np.where(heading > DISCRETE_HEADINGS // 2, heading - DISCRETE_HEADINGS, heading)
    is_ahead = np.abs(aside) <= STEERED_AHEAD
    back = np.sign(aside) * (DISCRETE_HEADINGS // 2 - np.abs(aside))
    wheels = np.where(is_ahead, aside / STEERED_AHEAD, back / (STEERED_AHEAD - 1))
    speed = share * np.where(is_ahead, drive.max_speed, -drive.max_reverse)
    forward = 2.0 * (speed + drive.max_reverse) / (drive.max_speed + drive.max_reverse) - 1.0
    return np.stack([forward, wheels], axis=1).astype(np.float32)
