"""Obstacles at random, the family that agents train in.

Its worlds are placed by compiled code (kernels.place_fields), because new ones are needed at hundreds of thousands a
minute; `field_record` says how.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import Motion
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import (
    Box,
    Goal,
    NotNegative,
    Obstacles,
    Positive,
    Region,
    Share,
    Sizes,
    Speeds,
    Start,
    StartRegion,
)
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
    as wide, and as much is free around start and goal. None: no such promise."""
    separation: NotNegative = 8.0
    """Least distance from start to goal [m]; unless it is said, points that are said may lie nearer."""
    start_clearance: NotNegative = 1.0
    """Free space around the robot's body at the start [m]; one that is said may lie nearer to the border."""
    goal_clearance: NotNegative = 0.5
    """Free space around the goal [m]; one that is said may lie nearer to the border."""
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere."""
    target_motion: Motion | None = None
    """How the goal moves; none: it stands."""

    def motions(self) -> Iterator[tuple[str, Motion]]:
        """Of the goal."""
        if self.target_motion is not None:
            yield "target_motion", self.target_motion

    def check(self, robot: Robot) -> None:
        """The promised gaps let this robot through, and start and goal fit into the bounds."""
        if self.moving > 0.0 and not self.laws:
            raise wrong("got [], expected at least one of 'bounce', 'random_walk', 'crowd'", "laws")
        self.check_clearance(self.solvable, robot, "solvable")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)
        self.check_separation(self.separation, self.start, self.goal)
        if isinstance(self.start, StartRegion):
            self._check_edge(self.start.region, robot.reach + self.start_room(robot.reach), "start")
        if isinstance(self.goal, Region):
            self._check_edge(self.goal.region, self.goal_room, "goal")
        if self.target_motion is not None:
            self.check_motion(self.target_motion, "target_motion")

    def start_room(self, reach: float) -> float:
        """Free space at the start beyond the reach of a robot [m]: as much as is said, or what `solvable` needs."""
        return max(self.start_clearance, (self.solvable or 0.0) - reach)

    @property
    def goal_room(self) -> float:
        """Free space around the goal [m]: as much as is said, or what `solvable` needs."""
        return max(self.goal_clearance, self.solvable or 0.0)

    def _check_edge(self, region: tuple[float, float, float, float], room: float, place: str) -> None:
        """Raises where all of a region to draw from lies nearer to the border than a place keeps from it [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        inside = max(region[0], xmin + room) <= min(region[2], xmax - room)
        if not (inside and max(region[1], ymin + room) <= min(region[3], ymax - room)):
            expected = f"expected one that reaches places {room:g} m from the border (world.{place}_clearance)"
            raise wrong(f"got {list(region)}, {expected}", f"{place}.region")
