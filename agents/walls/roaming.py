"""Roaming: a robot without a proof goes on and on over the same ground, and has to say so some time.

Bugs that go from corner to corner remember corners, to end where all are visited. But where sight ends on a long wall, or
noise cuts it in two, there is always one more corner. So a robot that has gone further than the straight way to its goal
and twice round all the ground it has been on calls itself looping.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.geometry import Point

ROUNDS = 2.0
"""How often it may go the way round the box about all places where it has been."""

LEAST = 20.0
"""Way that is no roaming, however small the box [m]."""


@dataclass
class Roaming:
    """How far a robot has gone, and over what ground; the box about all its places, odometry frame."""

    begun: float = 0.0
    """Length of the way when the goal was where it is [m]."""
    goal_distance: float = 0.0
    """Distance to the goal then [m]."""
    least_x: float = math.inf
    """Least x of its places [m]."""
    least_y: float = math.inf
    """Least y [m]."""
    most_x: float = -math.inf
    """Greatest x [m]."""
    most_y: float = -math.inf
    """Greatest y [m]."""

    def begin(self, goal_distance: float, odometer: float) -> None:
        """The goal is new, or elsewhere: a distance away [m], after so long a way [m]."""
        self.begun, self.goal_distance = odometer, goal_distance

    def goes_on(self, place: Point, odometer: float) -> bool:
        """Take in where the robot is; returns whether it roams.

        Args:
            place: own place, odometry frame [m].
            odometer: length of the way so far [m].
        """
        self.least_x, self.most_x = min(self.least_x, place[0]), max(self.most_x, place[0])
        self.least_y, self.most_y = min(self.least_y, place[1]), max(self.most_y, place[1])
        round_way = 2.0 * (self.most_x - self.least_x + self.most_y - self.least_y)
        return odometer - self.begun > max(LEAST, self.goal_distance + ROUNDS * round_way)
