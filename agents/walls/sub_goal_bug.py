"""What bugs that go from corner to corner share: their parameters and their decision, but for the next corner."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

from bug_gym.agents.parameters import Length
from bug_gym.agents.walls.boundary import LeaveRule, Turn, side_of
from bug_gym.agents.walls.boundary_bug import BoundaryParameters
from bug_gym.agents.walls.open_points import OpenPoint, Profile
from bug_gym.agents.walls.sub_goals import SubGoalMemory, SubGoals
from bug_gym.policy import STANDING, Drawing, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View


@dataclass(frozen=True)
class SubGoalParameters(BoundaryParameters):
    """Parameters of bugs that go from corner to corner."""

    clearance: Length | None = None
    """Distance from a corner to its sub-goal, and from the robot's centre to a wall [m]; None: the body's radius and one
    step, or what a differential robot's brake needs if that is more."""
    turn: Turn = "left"
    """Which of two equally good corners to take, seen from the line to the goal."""
    leave_rule: LeaveRule = "any"
    """Where a goal may lie that is open only as far as the scan reaches: "any" everywhere, "front" within 90 degrees of
    the direction of travel."""
    jump: Length | None = None
    """Change of the reading that makes an open point [m]; None: 0.5, for small robots less."""


class SubGoalBug(ScriptedPolicy):
    """What bugs that go from corner to corner share; each chooses the next corner by a rule of its own.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a clearance not above the radius, an unknown turn or rule, a jump not above 0.
    """

    looks_while_turning = False
    Parameters = SubGoalParameters
    parameters: SubGoalParameters
    foresight = True

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        settings: dict[str, Any] = {"clearance": own.clearance, "leave_rule": own.leave_rule, "jump": own.jump}
        self.sub_goals = SubGoals(sensors, **settings, foresees=self.foresees)
        self.side = side_of(own.turn)

    def start(self) -> SubGoalMemory:
        """Memory of a new episode."""
        return SubGoalMemory(mode="motion_to_goal")

    def act(self, view: View, memory: Any) -> Velocity:
        """One decision."""
        profile = self.sub_goals.look(view)
        velocity = self.sub_goals.go_on(view, memory, profile)
        if velocity is not None:
            return velocity
        if self.sub_goals.looks_again(view, memory, profile):
            return STANDING
        point = self.choose(view, memory, profile)
        if point is None:
            return self.sub_goals.give_up(memory, self.verdict(profile))
        return self.sub_goals.set_out(view, memory, profile, point)

    @abstractmethod
    def choose(self, view: View, memory: Any, profile: Profile) -> OpenPoint | None:
        """The open point to go to next; None where there is none."""

    def verdict(self, profile: Profile) -> str:
        """What it means that there is none."""
        return "stuck"

    def draw(self, memory: Any) -> Drawing:
        """Sub-goals and the present corner."""
        return self.sub_goals.draw(memory)
