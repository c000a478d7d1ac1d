"""Obstacles at random, the family that agents train in.

Its worlds are placed by compiled code (kernels.place_fields), because new ones are needed at hundreds of thousands a
minute; `field_record` says how.
"""

from __future__ import annotations

from typing import Literal

from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import Motion
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, Goal, NotNegative, Obstacles, Positive, Share, Sizes, Speeds, Start
from bug_gym.worlds.family import Family


class FieldWorld(Family):
    """Obstacles at random, some of them moving."""

    family: Literal["field"]
    bounds: Box = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    obstacles: Obstacles = 20
    """How many, still and moving together."""
    shapes: Literal["circles", "polygons", "squares", "mixed"] = "mixed"
    """What they are; mixed: circles and polygons."""
    sizes: Sizes = (0.3, 1.0)
    """Least and greatest radius, of a polygon that of the circle about it [m]."""
    moving: Share = 0.0
    """Share of the obstacles that move, 0 to 1."""
    speeds: Speeds = (0.1, 0.5)
    """Least and greatest speed of those [m/s]."""
    laws: tuple[Literal["bounce", "random_walk", "crowd"], ...] = ("bounce", "random_walk")
    """Their motion laws, in equal parts."""
    pedestrians: Obstacles = 0
    """How many round bodies walk among the obstacles under the crowd law."""
    pedestrian_radius: Positive = 0.3
    """Radius of these [m]."""
    pedestrian_speeds: Speeds = (0.6, 1.2)
    """Least and greatest of their speeds [m/s]."""
    solvable: Positive | None = None
    """Clearance [m] at which a path is certain: gaps between still obstacles, and to the border, are at least twice
    as wide. None: no such promise."""
    separation: NotNegative = 8.0
    """Least distance from start to goal [m]; unless it is said, points that are said may lie nearer."""
    start_clearance: NotNegative = 1.0
    """Free space around the robot's body at the start [m]."""
    goal_clearance: NotNegative = 0.5
    """Free space around the goal [m]."""
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere."""
    target_motion: Motion | None = None
    """How the goal moves; none: it stands."""

    def check(self, robot: Robot) -> None:
        """The promised gaps let this robot through, and start and goal fit into the bounds."""
        if self.moving > 0.0 and not self.laws:
            raise wrong("got [], expected at least one of 'bounce', 'random_walk', 'crowd'", "laws")
        self.check_clearance(self.solvable, robot, "solvable")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)
        self.check_separation(self.separation, self.start, self.goal)
        if self.target_motion is not None:
            self.check_motion(self.target_motion, "target_motion")
