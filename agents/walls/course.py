"""The course of a bug over free ground: straight on."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.geometry import velocity_along
from bug_gym.kinematics import Drive
from bug_gym.policy import Velocity
from bug_gym.steering import Course, corner_cut, look_ahead


def straight_on(drive: Drive, velocity: Velocity) -> Course | None:
    """Straight along a velocity [m/s] of the robot's frame, the line taken up in an arc; None for a robot that stands."""
    if velocity == (0.0, 0.0):
        return None
    places = np.zeros((2, 2))
    places[1, 0], places[1, 1] = velocity_along(math.atan2(velocity[1], velocity[0]), look_ahead(drive))
    return Course(places, corner_cut(drive))
