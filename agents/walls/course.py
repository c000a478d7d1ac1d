"""The course of a bug over free ground: straight on."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.geometry import Point, velocity_along
from bug_gym.kinematics import Drive
from bug_gym.policy import Velocity
from bug_gym.steering import Course, corner_cut, look_ahead

STRAIGHT = 1e-3
"""Sine of the angle to the goal below which a velocity leads there."""


def straight_on(drive: Drive, velocity: Velocity, goal: Point, goal_radius: float) -> Course | None:
    """Straight on along a velocity, the line taken up in an arc; None for a robot that stands.

    Not beyond a goal that lies within the robot's turning circle: else it would go round it for ever.

    Args:
        drive: what the robot can do.
        velocity: in its frame [m/s].
        goal: in its frame [m].
        goal_radius: how near to it the robot has arrived [m].
    """
    if velocity == (0.0, 0.0):
        return None
    length = look_ahead(drive)
    if leads_to(velocity, goal) and is_turned_about(drive, math.hypot(*velocity), goal, goal_radius):
        length = min(length, math.hypot(*goal))
    places = np.zeros((2, 2))
    places[1, 0], places[1, 1] = velocity_along(math.atan2(velocity[1], velocity[0]), length)
    return Course(places, corner_cut(drive))


def leads_to(velocity: Velocity, goal: Point) -> bool:
    """Whether a velocity points at the goal."""
    ahead, beside = velocity[0] * goal[0] + velocity[1] * goal[1], velocity[0] * goal[1] - velocity[1] * goal[0]
    return ahead > 0.0 and abs(beside) <= STRAIGHT * ahead


def is_turned_about(drive: Drive, speed: float, goal: Point, goal_radius: float) -> bool:
    """Whether a robot that turns as sharply as it can at a speed [m/s] goes round the goal without coming near enough."""
    bend = min(speed, drive.max_speed) / drive.max_turn_rate if drive.max_turn_rate > 0.0 else 0.0
    return math.hypot(goal[0], abs(goal[1]) - bend) < bend - goal_radius
