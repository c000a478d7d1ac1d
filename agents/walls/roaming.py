"""Roaming: a robot without a proof goes on and on without coming nearer to its goal, and has to say so some time.

Bugs that go from corner to corner remember corners, to end where all are visited. But where sight ends on a long wall, or
noise cuts it in two, there is always one more corner. So a robot that has not come nearer for so long that it could have
gone round all the ground it has been on twice calls itself looping.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.geometry import Point

ROUNDS = 2.0
"""How often it could have gone round the box about all places where it has been."""

LEAST = 20.0
"""Way without coming nearer that is no roaming, however small the box [m]."""

NEARER = 0.5
"""By how much nearer is nearer [m]."""


@dataclass
class Roaming:
    """How far a robot has gone since it was nearest to its goal, and over what ground."""

    nearest: float = math.inf
    """Least distance to the goal so far [m]."""
    since: float = 0.0
    """Length of the way then [m]."""
    least_x: float = math.inf
    """The box about all places so far, odometry frame [m]."""
    least_y: float = math.inf
    """[m]."""
    most_x: float = -math.inf
    """[m]."""
    most_y: float = -math.inf
    """[m]."""

    def goes_on(self, place: Point, goal_distance: float, odometer: float) -> bool:
        """Take in where the robot is; returns whether it roams.

        Args:
            place: own place, odometry frame [m].
            goal_distance: from there to the goal [m].
            odometer: length of the way so far [m].
        """
        self.least_x, self.most_x = min(self.least_x, place[0]), max(self.most_x, place[0])
        self.least_y, self.most_y = min(self.least_y, place[1]), max(self.most_y, place[1])
        if goal_distance < self.nearest - NEARER:
            self.nearest, self.since = goal_distance, odometer
        round_way = 2.0 * (self.most_x - self.least_x + self.most_y - self.least_y)
        return odometer - self.since > max(LEAST, ROUNDS * round_way)

    def forget_goal(self, odometer: float) -> None:
        """The goal is elsewhere: nearer begins anew. `odometer` is the length of the way so far [m]."""
        self.nearest, self.since = math.inf, odometer
