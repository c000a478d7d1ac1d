"""CriticalPointBug: from critical point to critical point, each the sub-goal in sight that is nearest to the goal.

Source: Dutta, Debnath and Das (2016); sub-goals as in Das, Dutta and Debnath (2020), whose algorithm for moving
obstacles grew out of it. Sensing assumed: a scan all round; goal, own position. Memory kept: the corners visited.
States: motion_to_goal, motion_to_sub_goal, corner_rounding. Each open point of the scan gives a sub-goal; where
something is in the way to the goal the critical point is the sub-goal with the least distance to the goal among those
not visited. Unlike E-Bug it does not count the way to the sub-goal. Guarantee: none, it can cycle (then "looping");
with no sub-goal left it stops as "stuck". Length bound: none.

Reported, by the later paper: better than other bugs, in one figure without numbers. Found: so against bugs that follow
walls, not always against TangentBug: in a scene in the manner of that figure it goes 11.81 m, TangentBug 12.39 m, Bug2
16.90 m and Bug1 37.51 m, in 200 worlds with few obstacles 12.50, 12.29, 13.92 and 19.41 m. Its sub-goals are the repaired
ones of OperativeCriticalPointBug, one formula for all bearings, so that the first one before the slab that is told of there
is no more inside. Numbers: docs/results/operative-critical-points.md.
"""

from __future__ import annotations

from bug_gym.agents.walls.open_points import OpenPoint, Profile, cheapest, goal_distance_of
from bug_gym.agents.walls.sub_goal_bug import SubGoalBug
from bug_gym.agents.walls.sub_goals import SubGoalMemory
from bug_gym.view import View


class CriticalPointBug(SubGoalBug):
    """CriticalPointBug; its parameters are those of SubGoalBug."""

    def choose(self, view: View, memory: SubGoalMemory, profile: Profile) -> OpenPoint | None:
        """The open point not yet visited whose sub-goal is nearest to the goal."""
        points = self.sub_goals.new_points(view, memory, profile)
        return cheapest(points, lambda point: self._distance_left(view, point), self.side)

    def _distance_left(self, view: View, point: OpenPoint) -> float:
        """Distance from the sub-goal of an open point to the goal [m]."""
        return goal_distance_of(view, point.sub_goal(self.sub_goals.boundary.clearance))
