"""Velocity obstacle: head for the goal with the velocity nearest to the straight one that leads to no contact.

Source: Fiorini and Shiller (1998), as in Sellers et al. (2026), section 5, with its goal as the sub-goal. Sensing
assumed: the scan; movers through the tracker (agents/tracking). Memory kept: the tracks. States: navigating. Guarantee:
none; a wall across the way holds it for ever. Length: no bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bug_gym.agents.local.navigator import Navigator, NavigatorParameters, in_robot_frame
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory
from bug_gym.geometry import F64, velocity_along
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

SHOWN = 1.0
"""Length of the arrows of movers in a picture [s]."""


@dataclass
class VelocityObstacleMemory(Memory):
    """Memory of the navigator."""

    tracker: TrackerMemory | None = None
    """The tracks."""
    steps: int = 0
    """Decisions so far."""
    movers: F64 | None = None
    """Movers as they were last seen (n, 5), odometry frame."""


@dataclass(frozen=True)
class VelocityObstacleParameters(NavigatorParameters):
    """Parameters of the policy."""


class VelocityObstacle(ScriptedPolicy):
    """The navigator by itself.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown avoidance, a horizon or margin that cannot be.
    """

    Parameters = VelocityObstacleParameters
    parameters: VelocityObstacleParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.navigator = Navigator(sensors, self.parameters)
        self.tracker = Tracker(sensors)

    def start(self) -> VelocityObstacleMemory:
        """Memory of a new episode."""
        return VelocityObstacleMemory(mode="navigating", tracker=self.tracker.start())

    def act(self, view: View, memory: VelocityObstacleMemory) -> Velocity:
        """One decision."""
        assert memory.tracker is not None
        tracks = self.tracker.update(memory.tracker, view, memory.steps * self.sensors.drive.step)
        memory.steps += 1
        moving = tracks.moving
        position, velocity, radius = tracks.position[moving], tracks.velocity[moving], tracks.radius[moving]
        memory.movers = np.column_stack([position, velocity, radius])
        speed = min(self.sensors.drive.max_speed, view.goal_distance / self.sensors.drive.step)
        wish = velocity_along(view.goal_bearing, speed)
        return self.navigator.velocity(view, wish, view.goal_distance, in_robot_frame(view, position, velocity, radius))

    def draw(self, memory: VelocityObstacleMemory) -> Drawing:
        """The movers, each with the way that it will go in a second."""
        if memory.movers is None:
            return Drawing()
        segments = [(x, y, x + SHOWN * vx, y + SHOWN * vy, "mover") for x, y, vx, vy, _ in memory.movers.tolist()]
        return Drawing(areas=[(ring_of(*mover), "mover") for mover in memory.movers.tolist()], segments=segments)


def ring_of(x: float, y: float, vx: float, vy: float, radius: float) -> F64:
    """The outline (k, 2) of a mover's disc [m]."""
    angle = 2.0 * math.pi * np.arange(24) / 24
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)
