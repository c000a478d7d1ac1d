"""What both D2T policies share: obstacles to clusters to triangles to a way, planned anew as it goes or when blocked.

Source: Sellers, Lei, Luo, Bi and Jan (2026), section 4.4. The whole is in triangulated.py, the following in vo_follower.py.

With `known=False` nobody tells the map: what the scans have hit so far (seen_ground.py) is joined to obstacles and planned
among, and what has not been seen counts as free. What regions cost is not counted: a way here is short in metres.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import shapely

from bug_gym.agents.local.navigator import Avoidance, NavigatorParameters
from bug_gym.agents.parameters import AtMost, Length
from bug_gym.agents.planning.ants import Colony
from bug_gym.agents.planning.follow import FollowerName, Scene
from bug_gym.agents.planning.grid_planner import GridParameters
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.planner import (
    Plan,
    PlannerMemory,
    PlannerParameters,
    Room,
    exact_way,
    live_of,
    mover_discs,
    no_way,
    start_in_obstacle,
)
from bug_gym.agents.planning.seen_ground import SeeingPlanner, SeenGround, border_about, drive_in_seen
from bug_gym.agents.planning.triangulated import Manner, Optimiser, Task, Way, find_way
from bug_gym.agents.planning.vo_follower import VelocityObstacleFollower
from bug_gym.geometry import F64
from bug_gym.policy import Drawing, Velocity
from bug_gym.view import Sensors, View

Replan = Literal["blocked", "horizon"]
REPLAN_EVERY = 0.5
"""Time between two plans that are made as it goes [s]."""
Count = Annotated[int, AtMost(10_000)]

JOINED = 0.3
"""Points of scans nearer to one another than this are of one obstacle [m]: a cell of 0.1 m remembers one of its points."""
AROUND = 0.02
"""How far beyond its points such an obstacle goes [m]."""
ROUGH = 0.01
"""By how much its outline may be smoothed [m]; less than AROUND, so that it holds its points."""
BEYOND = 10.0
"""Unknown ground that is planned on beside what has been seen, the robot and the goal [m]."""


@dataclass
class D2TMemory(PlannerMemory):
    """Memory of the D2T planners."""

    way: Way | None = None
    """What was found last, and in what."""
    due: float = 0.0
    """Time until the next plan that is made as it goes [s]."""
    seen: SeenGround | None = None
    """What has been seen, where the map is not given."""


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
    known: bool = True
    """Whether the map is given; else it is planned in what has been seen so far, and the policy is not privileged."""
    clip: bool = False
    """As printed: obstacles are not grown, and each edge is crossed no nearer to its ends than the body and the margin.
    That does not keep clear of obstacles."""

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


class D2TPlanner(SeeingPlanner):
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
            self.follower = VelocityObstacleFollower(self.sensors, navigation(own))
        self.manner = Manner(
            optimiser=self._optimiser(),
            margin=own.margin,
            threshold=own.threshold,
            use_clusters=own.use_clusters,
            samples=own.samples,
            horizon=math.inf if own.horizon is None else own.horizon,
            facets=own.facets,
            clip=own.clip,
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
        if self.privileged:
            return super().act(view, memory)
        if memory.seen is None:
            memory.seen = SeenGround(GridParameters(margin=self.parameters.margin), self.rooms)
        return drive_in_seen(self, memory.seen, view, memory)

    def reads_map(self) -> bool:
        """Whether the map is given."""
        return self.parameters.known

    def _goes_on_planning(self) -> bool:
        """Whether it plans as it goes; within a horizon it must."""
        return self.parameters.replan == "horizon" or self.parameters.horizon is not None

    def plan(self, scene: Scene, memory: Any) -> Plan:
        """The way through triangles."""
        memory.due = REPLAN_EVERY
        seen: SeenGround | None = memory.seen
        if seen is None and (inside := start_in_obstacle(live_of(memory).still, scene, self.sensors)):
            return Plan(None, reason=inside, verdict="unreachable")
        memory.way = way = find_way(self._task(scene, memory), self.manner, seed=self._seed())
        if way is not None:
            if seen is not None:
                is_narrow = way.by == "shortest path"
                seen.room = Room(self.sensors.radius if is_narrow else self.rooms[0].radius, way.margin)
            return Plan(way.path, way.margin)
        if scene.moving is not None or self.parameters.horizon is not None:
            return Plan(None, reason=self._why_not(scene, memory))
        exact = self._exact_way(scene, memory) if seen is None else None
        return exact or Plan(None, reason=self._why_not(scene, memory), verdict="unreachable")

    def _exact_way(self, scene: Scene, memory: Any) -> Plan | None:
        """The shortest way with as much room as there is: between round obstacles their polygons may have closed it."""
        for radius, margin in (*self.rooms, Room(self.sensors.radius, 0.0)):
            places = exact_way(
                live_of(memory).still,
                scene.pose[:2],
                scene.goal,
                radius=radius + margin,
                goal_radius=self.sensors.goal_radius,
            )
            if places is not None:
                return Plan(places, margin)
        return None

    def _why_not(self, scene: Scene, memory: Any) -> str:
        """Why there is no way."""
        if memory.seen is None:
            return no_way(live_of(memory).still, scene, self.sensors)
        return f"what has been seen leaves no way from here to the goal for a body of radius {self.sensors.radius:g} m"

    def _task(self, scene: Scene, memory: Any) -> Task:
        """What is planned for: among what stands and moves, or among what has been seen of both."""
        if memory.seen is not None:
            obstacles, border = seen_obstacles(memory.seen.points.points(), scene)
            movers = []
        else:
            still = live_of(memory).still
            obstacles, border = list(still.shapes()), still.border
            movers = [] if scene.moving is None else list(PlanningMap(border, mover_discs(scene.moving)).shapes())
        return Task(
            obstacles=obstacles,
            border=border,
            start=scene.pose[:2],
            goal=scene.goal,
            radius=self.rooms[0].radius,
            movers=movers,
            body=self.sensors.radius,
            goal_radius=self.sensors.goal_radius,
        )

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


def seen_obstacles(points: F64, scene: Scene) -> tuple[list[shapely.Polygon], F64]:
    """What scans have hit as obstacles, and a border (4, 2) about all that matters, which no wall has been seen of.

    Args:
        points: (k, 2) [m].
        scene: where the robot and its goal are.
    """
    border = border_about(points.reshape(-1, 2), scene, BEYOND)
    if len(points) == 0:
        return [], border
    wide = shapely.union_all(shapely.buffer(shapely.points(points), 0.5 * JOINED, quad_segs=4))
    joined = shapely.simplify(shapely.buffer(wide, AROUND - 0.5 * JOINED), ROUGH)
    return [part for part in shapely.get_parts(joined) if part.area > 0.0], border
