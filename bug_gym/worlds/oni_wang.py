"""The spiral of Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments", Fig. 1."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import finish

ONI_WANG_POLYGON = (
    (5.0, 4.0),
    (6.0, 4.0),
    (6.0, -9.0),
    (22.0, -9.0),
    (22.0, 7.0),
    (14.0, 7.0),
    (14.0, -2.0),
    (13.0, -2.0),
    (13.0, 8.0),
    (23.0, 8.0),
    (23.0, -10.0),
    (5.0, -10.0),
)
"""Corners x, y [m] of the obstacle of `OniWangWorld`."""

ONI_WANG_PLACES = {"A": (0.0, 0.0), "B": (10.0, 0.0), "C": (17.0, 0.0), "D": (27.0, 0.0)}
"""Places x, y [m] of `OniWangWorld`."""


class OniWangWorld(Family):
    """The map of Fig. 1 in Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments".

    One spiral obstacle with walls 1 m thick; its four places lie on the line y = 0.
    """

    family: Literal["oni_wang"]
    bounds: Box = (-15.0, -26.0, 42.0, 24.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    start: Literal["A", "B", "C", "D"] = "A"
    """The place where the robot starts, heading for the goal."""
    goal: Literal["A", "B", "C", "D"] = "D"
    """The place it goes to."""

    def check(self, robot: Robot) -> None:
        """Start and goal differ, and the map lies within the bounds."""
        if self.start == self.goal:
            raise wrong(f"got {self.goal!r}, expected another place than start", "goal")
        for corner in (*ONI_WANG_POLYGON, *ONI_WANG_PLACES.values()):
            if self.obstruction(((*corner, robot.reach),)):
                raise wrong(f"got {list(self.bounds)}, expected bounds that hold the map: {corner} too", "bounds")

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """The map of Fig. 1 in Oni and Wang; start and goal by letter."""
        (x, y), goal = ONI_WANG_PLACES[self.start], ONI_WANG_PLACES[self.goal]
        heading = math.atan2(goal[1] - y, goal[0] - x)
        return finish(crew, self, (x, y, heading), goal, polygons=((np.array(ONI_WANG_POLYGON),),))
