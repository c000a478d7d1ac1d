"""From the robot's frame to the odometry frame, and directions there."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.geometry import F64, Point
from bug_gym.view import View


def turn_matrix(angle: float) -> F64:
    """The matrix (2, 2) by which points (m, 2) are multiplied to turn them by an angle [rad]: points @ matrix."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, sin], [-sin, cos]])


def in_odometry(pose: tuple[float, float, float], points: F64) -> F64:
    """Points (m, 2) of the robot's frame in the odometry frame [m]."""
    placed: F64 = points @ turn_matrix(pose[2]) + np.array(pose[:2])
    return placed


def direction_to(view: View, place: Point | F64) -> float:
    """Direction of a place (2,) of the odometry frame from the robot [rad]."""
    return math.atan2(place[1] - view.position[1], place[0] - view.position[0])
