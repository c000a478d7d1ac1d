"""Straight to the goal, stopping in front of whatever is in the way: the floor of every comparison."""

from __future__ import annotations

from bug_gym.geometry import velocity_along
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.view import View


class GoToGoal(ScriptedPolicy):
    """Drives along the goal's bearing and stands while that is blocked; something that moves may go away."""

    def start(self) -> Memory:
        """Memory of a new episode."""
        return Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Memory) -> Velocity:
        """One decision."""
        margin = 2.0 * self.sensors.range_noise + 0.02
        bearing, distance = view.goal_bearing, view.goal_distance
        free = view.free_distance(bearing, self.sensors.radius + margin) - margin
        speed = min(self.sensors.drive.max_speed, min(free, distance) / self.sensors.drive.step)
        speed = max(speed, 0.0)
        return velocity_along(bearing, speed)
