"""Velocity obstacle: head for the goal with the velocity nearest to the straight one that leads to no contact.

Source: Fiorini and Shiller (1998), as in Sellers et al. (2026), section 5, with its goal as the sub-goal. Sensing
assumed: the scan; movers through the tracker (agents/tracking), or with `privileged` as they truly are. Memory kept: the
tracks. States: navigating. Guarantee: none; a wall across the way holds it for ever. Length: no bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from bug_gym.agents.local.navigator import Navigator, NavigatorParameters, in_robot_frame
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.map_policy import MapMemory, MapPolicy
from bug_gym.agents.planning.planner import live_of
from bug_gym.agents.planning.vo_follower import movers_seen
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory
from bug_gym.geometry import F64, velocity_along
from bug_gym.policy import Drawing, Velocity
from bug_gym.view import Sensors, View

SHOWN = 1.0
"""Length of the arrows of movers in a picture [s]."""


@dataclass
class VelocityObstacleMemory(MapMemory):
    """Memory of the navigator."""

    tracker: TrackerMemory | None = None
    """The tracks."""
    steps: int = 0
    """Decisions so far."""
    movers: F64 | None = None
    """Movers as they were last seen (n, 5): x, y, vx, vy, radius; odometry frame."""


@dataclass(frozen=True)
class VelocityObstacleParameters(NavigatorParameters):
    """Parameters of the policy."""

    privileged: bool = False
    """Whether movers are told as they truly are, beyond the scan and behind walls too, instead of tracked."""


class VelocityObstacle(MapPolicy):
    """The navigator by itself.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown avoidance, a horizon or margin that cannot be.
    """

    Parameters = VelocityObstacleParameters
    privileged: bool = False
    memory_type: ClassVar[type[MapMemory]] = VelocityObstacleMemory
    parameters: VelocityObstacleParameters

    def __init__(
        self, sensors: Sensors, *, discrete: bool = False, maps: Maps | None = None, **parameters: Any
    ) -> None:
        super().__init__(sensors, discrete=discrete, maps=maps, **parameters)
        self.navigator = Navigator(sensors, self.parameters)
        self.tracker = Tracker(sensors)

    def start(self) -> VelocityObstacleMemory:
        """Memory of a new episode."""
        return VelocityObstacleMemory(mode="navigating", tracker=self.tracker.start())

    def reads_map(self) -> bool:
        """Whether it is told what moves."""
        return self.parameters.privileged

    def act(self, view: View, memory: VelocityObstacleMemory) -> Velocity:
        """One decision."""
        movers = self._told(memory) if self.privileged else self._tracked(view, memory)
        speed = min(self.sensors.drive.max_speed, view.goal_distance / self.sensors.drive.step)
        wish = velocity_along(view.goal_bearing, speed)
        return self.navigator.velocity(view, wish, view.goal_distance, movers)

    def _tracked(self, view: View, memory: VelocityObstacleMemory) -> F64:
        """Movers (n, 5) in the robot's frame, as the tracker has them."""
        assert memory.tracker is not None
        tracks = self.tracker.update(memory.tracker, view, memory.steps * self.sensors.drive.step)
        memory.steps += 1
        moving = tracks.moving
        position, velocity, radius = tracks.position[moving], tracks.velocity[moving], tracks.radius[moving]
        memory.movers = np.column_stack([position, velocity, radius])
        return in_robot_frame(view, position, velocity, radius)

    def _told(self, memory: VelocityObstacleMemory) -> F64:
        """The same, as they truly are."""
        live = live_of(memory)
        moving = live.movers()
        memory.movers = np.column_stack([moving.discs[:, :2], moving.velocities, moving.discs[:, 2]])
        return movers_seen(moving, live.pose)

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
