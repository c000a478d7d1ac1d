"""E-Bug: from vertex to vertex, each time the one with the shortest way over it to the goal.

Source: Meddah and Dib (2015), after PointBug; as reported by Hasibuzzaman, Jan and Wu. Sensing assumed: a scan all
round; goal, own position. Memory kept: the vertices visited. States: motion_to_goal, motion_to_sub_goal,
corner_rounding. Where the goal is in sight the robot goes there; elsewhere to the vertex V in sight and not yet
visited that makes |x V| + |V goal| least. Guarantee: none, it can cycle (then "looping"); with no vertex left it
stops as "stuck". Length bound: none.
"""

from __future__ import annotations

import math

from bug_gym.agents.walls.open_points import OpenPoint, Profile, cheapest, goal_distance_of
from bug_gym.agents.walls.sub_goal_bug import SubGoalBug
from bug_gym.agents.walls.sub_goals import SubGoalMemory
from bug_gym.view import View


class EBug(SubGoalBug):
    """E-Bug; its parameters are those of SubGoalBug."""

    def choose(self, view: View, memory: SubGoalMemory, profile: Profile) -> OpenPoint | None:
        """The vertex not yet visited with the shortest way over it to the goal."""
        points = self.sub_goals.new_points(view, memory, profile)
        return cheapest(points, lambda point: self._way_over(view, point), self.side)

    def _way_over(self, view: View, point: OpenPoint) -> float:
        """Length of the way over a vertex to the goal, as far as it can be known from here [m]."""
        place = point.sub_goal(self.sub_goals.boundary.clearance)
        return math.hypot(*place) + goal_distance_of(view, place)
