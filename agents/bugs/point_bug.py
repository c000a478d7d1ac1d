"""PointBug: from sudden point to sudden point, taking the first that a turning range sensor meets.

Source: Buniyamin, Ngah, Wan Ngah and Mohamad (2011). Sensing assumed: a range sensor that turns with the robot, long or
unlimited; goal. Memory kept: where it set out, the side it turns to. States: motion_to_goal, motion_to_sub_goal,
corner_rounding. The robot faces the goal; where something is in the way it turns until the reading jumps, goes there, and
begins again. It turns to that side of the line to the goal on which the last sudden point lay, and ignores what is
straight behind. A full turn without a sudden point is "unreachable" by definition; here only where no two neighbouring beams
end so far apart that the body passes between, else "stuck": few beams may miss a narrow way.
Guarantee: none, it can cycle (then "looping"). Length bound: none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bug_gym.agents.walls.boundary import Turn
from bug_gym.agents.walls.open_points import OpenPoint, Profile, rotation_to
from bug_gym.agents.walls.sub_goal_bug import SubGoalBug, SubGoalParameters
from bug_gym.agents.walls.sub_goals import SubGoalMemory
from bug_gym.geometry import wrap
from bug_gym.view import Sensors, View

BEHIND = math.radians(10.0)
"""Half width of the sector behind the robot in which a sudden point is the one it comes from [rad]."""


@dataclass
class PointBugMemory(SubGoalMemory):
    """Memory of PointBug."""

    turning_side: int = 0
    """Side to which the robot turns from the goal: +1 left, -1 right; 0 before the first sudden point. That is all that
    the source makes of its d_min, the line from the last sudden point to the goal."""


@dataclass(frozen=True)
class PointBugParameters(SubGoalParameters):
    """Parameters of PointBug."""

    turn: Turn = "right"
    """Which way the robot turns to find its first sudden point."""


class PointBug(SubGoalBug):
    """PointBug."""

    Parameters = PointBugParameters
    parameters: PointBugParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.passes = 2.0 * self.sub_goals.lookout.radius
        """Width of the gaps that it would go through [m]."""

    def start(self) -> PointBugMemory:
        """Memory of a new episode."""
        return PointBugMemory(mode="motion_to_goal")

    def choose(self, view: View, memory: PointBugMemory, profile: Profile) -> OpenPoint | None:
        """The first sudden point met when turning from the goal."""
        point = self._first_met(view, memory, profile)
        if point is not None:
            memory.turning_side = 1 if point.rotation < math.pi else -1
        return point

    def verdict(self, profile: Profile) -> str:
        """A full turn without a sudden point, and no gap between two beams: the robot is shut in, without its goal."""
        is_shut_in = not profile.open_points and profile.link.all() and self._widest_gap(profile) <= self.passes
        return "unreachable" if is_shut_in else "stuck"

    def _widest_gap(self, profile: Profile) -> float:
        """The greatest distance between what two neighbouring beams met [m]: a wall goes on between them, or seems to."""
        one, other = profile.ranges, np.roll(profile.ranges, -1)
        across = 4.0 * one * other * math.sin(0.5 * self.sub_goals.lookout.spacing) ** 2
        return float(np.sqrt((one - other) ** 2 + across).max())

    def _first_met(self, view: View, memory: PointBugMemory, profile: Profile) -> OpenPoint | None:
        """The first sudden point met when turning from the goal, one straight behind left out."""
        others = self.sub_goals.other_points(view, memory, profile)
        points = [point for point in others if not self._is_behind(view, memory, point)]
        side = memory.turning_side or self.side
        return min(points, key=lambda point: rotation_to(point, side), default=None)

    def _is_behind(self, view: View, memory: PointBugMemory, point: OpenPoint) -> bool:
        """Whether a sudden point lies where the robot comes from."""
        if memory.came_from is None:
            return False
        x, y = view.to_robot(*memory.came_from)
        back = wrap(math.atan2(y, x) - view.goal_bearing)
        return abs(wrap(point.rotation - back)) <= BEHIND
