"""What both D2T policies share: obstacles to clusters to triangles to a way, planned anew as it goes or when blocked.

Source: Sellers, Lei, Luo, Bi and Jan (2026), section 4.4. The whole is in triangulated.py, the following in vo_follower.py.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from bug_gym.agents.local.navigator import Avoidance, NavigatorParameters
from bug_gym.agents.parameters import AtMost, Length
from bug_gym.agents.planning.ants import Colony
from bug_gym.agents.planning.follow import FollowerName, Scene
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.planner import MapPlanner, Plan, PlannerMemory, PlannerParameters, live_of, mover_discs
from bug_gym.agents.planning.triangulated import Manner, Optimiser, Task, Way, find_way
from bug_gym.agents.planning.vo_follower import VelocityObstacleFollower
from bug_gym.policy import Drawing, Velocity
from bug_gym.view import Sensors, View

Replan = Literal["blocked", "horizon"]
REPLAN_EVERY = 0.5
"""Time between two plans that are made as it goes [s]."""
Count = Annotated[int, AtMost(10_000)]


@dataclass
class D2TMemory(PlannerMemory):
    """Memory of the D2T planners."""

    way: Way | None = None
    """What was found last, and in what."""
    due: float = 0.0
    """Time until the next plan that is made as it goes [s]."""


@dataclass(frozen=True)
class D2TParameters(PlannerParameters):
    """Parameters of the D2T planners."""

    follower: FollowerName = "velocity_obstacle"
    """What drives along the way."""
    avoidance: Avoidance = "vo"
    """How the follower "velocity_obstacle" avoids movers: "vo", or "rvo" and "orca" where they do half of it."""
    mover_horizon: Length = 3.0
    """tau of that follower: how far ahead contact with movers counts [s]."""
    mover_margin: Length = 0.2
    """What that follower keeps from movers beside the bodies [m]; less where that leaves no velocity."""
    replan: Replan = "blocked"
    """When to plan anew: "blocked": where something stands in the way; "horizon": twice a second too."""
    threshold: Length | None = None
    """Psi: gaps between obstacles below it are closed [m]; None: a little over the robot's diameter."""
    use_clusters: bool = True
    """Whether to cluster obstacles."""
    samples: Count = 0
    """Points sampled in free space as further corners of triangles."""
    horizon: Length | None = None
    """D_s: what is farther away is not looked at, and a goal beyond it is replaced [m]; None: all is looked at."""
    facets: Count = 1
    """Sides of the corner of a grown obstacle, a quarter turn: the more, the more edges the way crosses."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.mover_horizon > 0.0:
            raise ValueError(f"mover_horizon must be above 0 s, got {self.mover_horizon!r}")
        navigation(self)
        if self.threshold is not None and not self.threshold > 0.0:
            raise ValueError(f"threshold must be above 0 m, got {self.threshold!r}")
        if self.horizon is not None and not self.horizon > 0.0:
            raise ValueError(f"horizon must be above 0 m, got {self.horizon!r}")
        if self.samples < 0:
            raise ValueError(f"samples must not be negative, got {self.samples!r}")
        if self.facets < 1:
            raise ValueError(f"facets must be at least 1, got {self.facets!r}")


def navigation(parameters: D2TParameters) -> NavigatorParameters:
    """The navigator's part of some parameters; the way keeps off what stands.

    Raises:
        ValueError: an unknown avoidance, a horizon that is not above 0, a negative margin.
    """
    return NavigatorParameters(
        avoidance=parameters.avoidance,
        horizon=parameters.mover_horizon,
        still_horizon=0.0,
        mover_margin=parameters.mover_margin,
    )


class D2TPlanner(MapPlanner):
    """What both D2T planners share.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a parameter that cannot be.
    """

    Parameters = D2TParameters
    memory_type = D2TMemory
    parameters: D2TParameters

    def __init__(
        self, sensors: Sensors, *, discrete: bool = False, maps: Maps | None = None, **parameters: Any
    ) -> None:
        super().__init__(sensors, discrete=discrete, maps=maps, **parameters)
        own = self.parameters
        if own.follower == "velocity_obstacle":
            self.follower = VelocityObstacleFollower(sensors, navigation(own))
        self.manner = Manner(
            optimiser=self._optimiser(),
            margin=own.margin,
            threshold=own.threshold,
            use_clusters=own.use_clusters,
            samples=own.samples,
            horizon=math.inf if own.horizon is None else own.horizon,
            facets=own.facets,
            colony=self._colony(),
        )

    @abstractmethod
    def _optimiser(self) -> Optimiser:
        """How the way is pulled taut."""

    def _colony(self) -> Colony:
        """The ants, where there are any."""
        return Colony()

    def _seed(self) -> int:
        """Of what is drawn."""
        return 0

    def act(self, view: View, memory: Any) -> Velocity:
        """One decision."""
        memory.due -= view.sensors.drive.step
        if self._goes_on_planning() and memory.route is not None and memory.due <= 1e-9:
            memory.planned_for = (math.inf, math.inf)
        return super().act(view, memory)

    def _goes_on_planning(self) -> bool:
        """Whether it plans as it goes; within a horizon it must."""
        return self.parameters.replan == "horizon" or self.parameters.horizon is not None

    def plan(self, scene: Scene, memory: Any) -> Plan:
        """The way through triangles."""
        still = live_of(memory).still
        movers = [] if scene.moving is None else list(PlanningMap(still.border, mover_discs(scene.moving)).shapes())
        memory.due = REPLAN_EVERY
        task = Task(
            obstacles=list(still.shapes()),
            border=still.border,
            start=scene.pose[:2],
            goal=scene.goal,
            radius=self.rooms[0].radius,
            movers=movers,
            body=self.sensors.radius,
            goal_radius=self.sensors.goal_radius,
        )
        memory.way = find_way(task, self.manner, seed=self._seed())
        if memory.way is not None:
            return Plan(memory.way.path, memory.way.margin)
        reason = f"no way leads from here to the goal for a body of radius {self.sensors.radius:g} m"
        is_shut_in = scene.moving is None and self.parameters.horizon is None
        return Plan(None, reason=reason, verdict="unreachable" if is_shut_in else "")

    def draw(self, memory: Any) -> Drawing:
        """The way, the sleeve that it was pulled taut in, and what was kept off."""
        drawing = super().draw(memory)
        if memory.way is None:
            return drawing
        segments = list(drawing.segments)
        if memory.way.sleeve is not None:
            sleeve = memory.way.sleeve
            segments += [(*a, *b, "edge") for a, b in zip(sleeve.left.tolist(), sleeve.right.tolist(), strict=True)]
        areas = [(np.array(one.exterior.coords), "cluster") for one in memory.way.shapes if not one.interiors]
        return Drawing(points=drawing.points, segments=segments, areas=areas)
