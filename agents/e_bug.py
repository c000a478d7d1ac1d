"""E-Bug: from vertex to vertex, each time the one with the shortest way over it to the goal.

Source: Meddah and Dib (2015), after PointBug; as reported by Hasibuzzaman, Jan and Wu. Sensing assumed: a scan all
round; goal, own position. Memory kept: the vertices visited. States: motion_to_goal, motion_to_sub_goal,
corner_rounding. Where the goal is in sight the robot goes there; elsewhere to the vertex V in sight and not yet visited
that makes |x V| + |V goal| least. Guarantee: none; with no vertex left it stops as "stuck". Length bound: none.
"""

from __future__ import annotations

import math

from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity

from .boundary_following import LeaveRule, Turn, side_of
from .open_points import OpenPoint, SubGoalMemory, SubGoals, cheapest, goal_distance_of


class EBug(ScriptedPolicy):
    """E-Bug.

    Args:
        sensors: what a driver knows of the robot.
        clearance: corner to sub-goal and centre to wall [m]; None: body radius and one step.
        turn: which of two equally good vertices to take, seen from the line to the goal.
        leave_rule: "any" or "front", see SubGoals.
        jump: change of the reading that makes a vertex [m]; None: 0.5, for small robots less.
        discrete: whether actions are numbers of the discrete table.

    Raises:
        ValueError: a clearance not above the radius, an unknown turn or rule, a jump not above 0.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        turn: Turn = "left",
        leave_rule: LeaveRule = "any",
        jump: float | None = None,
        discrete: bool = False,
    ) -> None:
        super().__init__(sensors, discrete=discrete)
        self.sub_goals = SubGoals(sensors, clearance=clearance, leave_rule=leave_rule, jump=jump)
        self.side = side_of(turn)

    def start(self) -> SubGoalMemory:
        """Memory of a new episode."""
        return SubGoalMemory(mode="motion_to_goal")

    def act(self, view: View, memory: SubGoalMemory) -> Velocity:
        """One decision."""
        profile = self.sub_goals.look(view)
        velocity = self.sub_goals.go_on(view, memory, profile)
        if velocity is not None:
            return velocity
        points = self.sub_goals.new_points(view, memory, profile)
        point = cheapest(points, lambda point: self._way_over(view, point), self.side)
        if point is None:
            return self.sub_goals.give_up(memory, "stuck")
        return self.sub_goals.set_out(view, memory, profile, point)

    def _way_over(self, view: View, point: OpenPoint) -> float:
        """Length of the way over a vertex to the goal, as far as it can be known from here [m]."""
        place = point.sub_goal(self.sub_goals.boundary.clearance)
        return math.hypot(*place) + goal_distance_of(view, place)

    def draw(self, memory: SubGoalMemory) -> Drawing:
        """Sub-goals and the present corner."""
        return self.sub_goals.draw(memory)
