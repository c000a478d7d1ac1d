"""The course of a bug: straight on over free ground, and exactly as the rule says along walls."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.geometry import velocity_along
from bug_gym.kinematics import Drive
from bug_gym.policy import Velocity
from bug_gym.steering import Course, corner_cut, look_ahead


def straight_on(drive: Drive, velocity: Velocity, *, is_bound: bool) -> Course | None:
    """Straight along a velocity [m/s]; None for a robot that stands.

    Args:
        drive: of the robot.
        velocity: desired now, robot's frame [m/s].
        is_bound: whether the robot must go exactly where the velocity leads: a wall's contour, whose laps must close,
            and a way back. Elsewhere it takes up its line in an arc.
    """
    if velocity == (0.0, 0.0):
        return None
    end = velocity_along(math.atan2(velocity[1], velocity[0]), look_ahead(drive))
    return Course(np.array([(0.0, 0.0), end]), 0.0 if is_bound else corner_cut(drive))
