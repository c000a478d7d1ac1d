"""Sub-goals beside open points: the printed four cases, and the one formula that they stand for.

The sub-goal lies at the circle's radius from the open point P, square to the line of sight, away from the obstacle.
Source: Das, Dutta and Debnath (2020), equations (3) to (5). Their angle psi = beta mod 180 degrees loses the sign for
bearings of 180 degrees and more (all their points lie in the first quadrant), and (5) has cos gamma in both lines.
"""

from __future__ import annotations

import math

from bug_gym.geometry import Point


def perpendicular_sub_goal(point: Point, bearing: float, side: int, radius: float) -> Point:
    """The sub-goal of an open point [m].

    Args:
        point: the open point P [m].
        bearing: of the line of sight from the sensor to P, in the same frame [rad].
        side: +1 where P is the left end of an obstacle, -1 the right one.
        radius: distance from P [m].
    """
    return point[0] - side * radius * math.sin(bearing), point[1] + side * radius * math.cos(bearing)


def printed_sub_goal(point: Point, bearing: float, side: int, radius: float) -> Point:
    """The sub-goal as equations (3) to (5) are printed [m]; `bearing` in the world's frame, see above."""
    psi = math.degrees(bearing) % 180.0
    gamma = math.radians(psi - 90.0 if psi > 90.0 else 90.0 - psi)
    is_obstacle_before = side > 0
    if psi > 90.0:
        sign_x, sign_y = (-1.0, -1.0) if is_obstacle_before else (1.0, 1.0)
    else:
        sign_x, sign_y = (-1.0, 1.0) if is_obstacle_before else (1.0, -1.0)
    return point[0] + sign_x * radius * math.cos(gamma), point[1] + sign_y * radius * math.cos(gamma)
