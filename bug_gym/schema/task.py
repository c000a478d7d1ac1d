"""The task: clock, goal and reward."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from bug_gym.schema.errors import wrong
from bug_gym.schema.values import Duration, Part, Positive, StepTime, Weight


class Time(Part):
    """The clock."""

    step: StepTime = 0.1
    """Time from one action to the next [s]."""
    limit: Duration = 120.0
    """Time after which an episode is cut off [s]: after the whole number of steps that comes nearest to it."""

    @model_validator(mode="after")
    def _holds_a_step(self) -> Self:
        if self.limit < self.step:
            raise wrong(f"got {self.limit}, expected at least step ({self.step})", "limit")
        return self

    @property
    def steps(self) -> int:
        """Most steps of an episode."""
        return round(self.limit / self.step)


class GoalSettings(Part):
    """When the goal is reached and how the robot knows where it is."""

    radius: Positive = 0.3
    """Distance from the goal to the robot's origin within which it is reached [m]."""
    sensing: Literal["beacon", "odometry"] = "beacon"
    """Sensed as a beacon, or computed from odometry."""


class Reward(Part):
    """Weights of the reward's terms; their sum is the reward of a step."""

    progress: Weight = 1.0
    """For each metre nearer to the goal [1/m]."""
    goal: Weight = 10.0
    """Once, on reaching the goal [1]."""
    collision: Weight = -10.0
    """Once, on touching something [1]."""
    step: Weight = -0.01
    """For each step [1]."""
    clearance: Weight = 0.0
    """For nearness to obstacles [1]."""
    smoothness: Weight = 0.0
    """For a change of the action [1]."""
