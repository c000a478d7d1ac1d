"""CriticalPointBug: from critical point to critical point, each the sub-goal in sight that is nearest to the goal.

Source: Dutta, Debnath and Das (2016); sub-goals as in Das, Dutta and Debnath (2020), whose algorithm for moving
obstacles grew out of it. Sensing assumed: a scan all round; goal, own position. Memory kept: the corners visited.
States: motion_to_goal, motion_to_sub_goal, corner_rounding. Each open point of the scan gives a sub-goal; where
something is in the way to the goal the critical point is the sub-goal with the least distance to the goal among those
not visited. Unlike E-Bug it does not count the way to the sub-goal. Guarantee: none; with no sub-goal left it stops as
"stuck". Length bound: none.
"""

from __future__ import annotations

from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity

from .boundary_following import LeaveRule, Turn, side_of
from .open_points import OpenPoint, SubGoalMemory, SubGoals, cheapest, goal_distance_of


class CriticalPointBug(ScriptedPolicy):
    """CriticalPointBug.

    Args:
        sensors: what a driver knows of the robot.
        clearance: corner to sub-goal and centre to wall [m]; None: body radius and one step.
        turn: which of two equally near sub-goals to take, seen from the line to the goal.
        leave_rule: "any" or "front", see SubGoals.
        jump: change of the reading that makes an open point [m]; None: 0.5, for small robots less.
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
        point = cheapest(points, lambda point: self._distance_left(view, point), self.side)
        if point is None:
            return self.sub_goals.give_up(memory, "stuck")
        return self.sub_goals.set_out(view, memory, profile, point)

    def _distance_left(self, view: View, point: OpenPoint) -> float:
        """Distance from the sub-goal of an open point to the goal [m]."""
        return goal_distance_of(view, point.sub_goal(self.sub_goals.boundary.clearance))

    def draw(self, memory: SubGoalMemory) -> Drawing:
        """Sub-goals and the present corner."""
        return self.sub_goals.draw(memory)
