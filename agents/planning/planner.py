"""What all map planners share: plan as an episode begins, follow the way, plan anew when it is blocked or the goal moves.

A planner writes one method, `plan`: the way from here to there, or why there is none. Short means short in metres: what
regions cost is not counted, but by planners over cells that have the parameter `terrain` (terrain.py) and are asked to.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from bug_gym.agents.mapping.goal_watch import GoalWatch
from bug_gym.agents.parameters import Length
from bug_gym.agents.planning.clear_step import clear_velocity
from bug_gym.agents.planning.follow import FollowerName, Scene, make_follower, pose_to_be
from bug_gym.agents.planning.gaps import narrow_places, pushed_off
from bug_gym.agents.planning.growth import TOUCHING
from bug_gym.agents.planning.known_scan import put_right
from bug_gym.agents.planning.live import LiveMap, Maps, Moving
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.map_policy import MapMemory, MapPolicy
from bug_gym.agents.planning.route import Route, distances_to_chain
from bug_gym.agents.planning.smoothing import Solids
from bug_gym.geometry import F32, F64, Point
from bug_gym.inertia import needs_care
from bug_gym.policy import Drawing, Velocity, braking_radius
from bug_gym.view import Sensors, View

GOAL_MOVED = 0.2
"""A goal farther than this from where it was is planned for anew [m]."""

STRAYED = 0.5
"""Farther than this from its way the robot plans anew [m]."""

WATCHED = 3.0
"""How far ahead a way is watched for movers that stand in it [m]."""

NEAR = 5.0
"""Movers up to this far from the robot are planned round [m]."""

SLOW = 0.1
"""What moves less than this stands [m/s]."""

DISC_SEGMENTS = 16
"""Sides of a quarter of the polygon about the places that are near enough to a goal."""

PAUSE = 0.5
"""Time between two plans round movers [s]."""

CLOSED = 0.01
"""Radius of the discs that close a gap to the next plan, where the robot does not go through it [m]."""

DETOURS = 8
"""How often another way is looked for instead of one through such gaps."""


class Room(NamedTuple):
    """What a way is planned for."""

    radius: float
    """Of the disc that the body is taken for [m]."""
    margin: float
    """What the way keeps from obstacles beside it [m]."""

    @property
    def growth(self) -> float:
        """By how much obstacles grow [m]."""
        return self.radius + self.margin


def rooms_for(sensors: Sensors, margin: float) -> tuple[Room, ...]:
    """What ways are planned for in turn, until there is one: the last with hardly more than the body itself.

    A differential robot is cut short by its brake (`policy.brake`) nearer to things than its braking radius.
    """
    body, braking = sensors.radius, braking_radius(sensors)
    rooms = [Room(braking, margin), Room(braking, TOUCHING * margin), Room(body, TOUCHING * margin)]
    return tuple(dict.fromkeys(rooms))


class Plan(NamedTuple):
    """What a search has found."""

    places: F64 | None
    """The way (k, 2) from where the robot is to the goal [m]; None: there is none."""
    margin: float = 0.0
    """What it keeps from obstacles beside the body [m]."""
    reason: str = ""
    """Why there is none, in a sentence."""
    verdict: str = ""
    """What follows from that: "unreachable" where there is no way for certain, "stuck" where the planner finds none, whatever
    it tries again; "" where it may be tried again."""


@dataclass
class PlannerMemory(MapMemory):
    """Memory of a map planner."""

    route: Route | None = None
    """The way that is followed."""
    planned_for: Point = (math.inf, math.inf)
    """Where the goal was when it was planned [m]."""
    pause: float = 0.0
    """Time until the next plan round movers [s]."""
    plans: int = 0
    """How often the way was planned."""
    goal_watch: GoalWatch = field(default_factory=GoalWatch)
    """Whether the goal goes elsewhere."""
    solids: Solids | None = None
    """What stands, as ways are measured by it."""


@dataclass(frozen=True)
class PlannerParameters:
    """Parameters of every map planner."""

    margin: Length = 0.05
    """What a way keeps from obstacles beside the body [m]; where that leaves no way, a tenth of it."""
    follower: FollowerName = "pure_pursuit"
    """What drives along the way."""

    def __post_init__(self) -> None:
        if not (self.margin >= 1e-3 and math.isfinite(self.margin)):
            raise ValueError(f"margin must be finite and at least 0.001 m, got {self.margin!r}")


class MapPlanner(MapPolicy):
    """A policy that plans on the map and follows the way.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a margin below a millimetre, an unknown follower.
    """

    Parameters: ClassVar[type[Any]] = PlannerParameters
    memory_type: ClassVar[type[MapMemory]] = PlannerMemory
    parameters: Any

    def __init__(
        self, sensors: Sensors, *, discrete: bool = False, maps: Maps | None = None, **parameters: Any
    ) -> None:
        super().__init__(sensors, discrete=discrete, maps=maps, **parameters)
        self.noise = sensors.range_noise if self.privileged and self.is_round else 0.0
        """Standard deviation of what a scan shows of the map [m], put right before it is looked at; 0: nothing is to do."""
        if self.noise > 0.0:
            sensors = replace(sensors, range_noise=0.0)
            super().__init__(sensors, discrete=discrete, maps=maps, **parameters)
        self.follower = make_follower(self.parameters.follower, sensors)
        self.rooms = rooms_for(sensors, self.parameters.margin)

    @property
    def keeps_to_map(self) -> bool:
        """Whether it stays on a way that was planned on the whole map; one that gets out of movers' way leaves it."""
        return self.privileged and not self.follower.avoids_movers

    def decide(self, flat: F32, memories: Sequence[Any]) -> list[NDArray[Any]]:
        """The actions for what several robots see, each as of its row alone."""
        if self.noise > 0.0:
            flat = np.array([self.known(row, memory) for row, memory in zip(flat, memories, strict=True)])
        return super().decide(flat, memories)

    def _action(self, view: View, memory: Any) -> NDArray[Any]:
        """The action for what one robot sees."""
        return super()._action(View(self.known(view.flat, memory), self.sensors) if self.noise > 0.0 else view, memory)

    def known(self, flat: F32, memory: Any) -> F32:
        """An observation (D,) whose scan is put right by the map."""
        places, known = self.sensors.always_seen[0], flat.copy()
        solids, pose = self.solids(memory), live_of(memory).pose
        known[places] = put_right(flat[places].astype(np.float64), self.sensors, pose, solids, self.noise)
        return known

    @abstractmethod
    def plan(self, scene: Scene, memory: Any) -> Plan:
        """The way from where the robot is to the goal.

        Args:
            scene: where both are; with movers where they are to be planned round as they stand now, else without.
            memory: of the episode; `memory.live` is the map.
        """

    def act(self, view: View, memory: PlannerMemory) -> Velocity:
        """One decision."""
        scene = self.look(view, memory)
        memory.pause -= view.sensors.drive.step
        memory.goal_watch.look(scene.goal, view.sensors.drive.step)
        away = math.inf if memory.route is None else memory.route.advance(*pose_to_be(view, scene.pose)[:2])
        is_due = memory.route is None or away > STRAYED or math.dist(memory.planned_for, scene.goal) > GOAL_MOVED
        if memory.pause <= 0.0:
            round_these = self.planned_round(scene)
            if is_due:
                self.replace_route(scene._replace(moving=None), memory)
            elif memory.route is not None and self.is_blocked(memory.route, round_these):
                self.replace_route(scene._replace(moving=near(round_these)), memory)
        if memory.route is None:
            return 0.0, 0.0
        velocity = self.follower.follow(memory.route, view, scene)
        return self.cleared(velocity, view, memory) if self.is_cleared else velocity

    @property
    def is_cleared(self) -> bool:
        """Whether velocities are looked at on the map: of one that has it, leaves its way, and does at once what it is told."""
        return self.privileged and self.follower.avoids_movers and self.sensors.drive.latency == 0

    def cleared(self, velocity: Velocity, view: View, memory: PlannerMemory) -> Velocity:
        """As much of a velocity as touches nothing that stands; where that is not all, the way is planned anew from here."""
        live = live_of(memory)
        radius, drive = self.sensors.radius, self.sensors.drive
        clear = clear_velocity(live.still, live.pose, view.own_velocity, velocity, drive, radius)
        if clear != velocity:
            memory.planned_for = (math.inf, math.inf)
        return clear

    def look(self, view: View, memory: PlannerMemory) -> Scene:
        """Where the robot and its goal are, and what moves."""
        live = live_of(memory)
        return Scene(live.pose, live.goal, live.movers() if live.has_movers else None)

    def planned_round(self, scene: Scene) -> Scene:
        """The scene with the movers that ways are planned round: all, or those that stand where the follower avoids."""
        if scene.moving is None or not self.follower.avoids_movers:
            return scene
        return scene._replace(moving=scene.moving.select(np.hypot(*scene.moving.velocities.T) < SLOW))

    def is_blocked(self, route: Route, scene: Scene) -> bool:
        """Whether a mover stands in the way where the robot comes next."""
        if scene.moving is None or len(scene.moving.discs) == 0:
            return False
        discs = scene.moving.discs
        away = distances_to_chain(route.ahead(WATCHED), discs[:, :2])
        return bool((away <= discs[:, 2] + self.sensors.radius).any())

    def replace_route(self, scene: Scene, memory: PlannerMemory) -> None:
        """Replace the way; where none is found round movers the old one stays, on which the robot waits.

        Nor does it end where there is none to a goal that moves, which may come to where there is one.
        """
        found = self.drivable(scene, memory)
        if found.verdict:
            found = self.planned_beside(scene, memory, found)
        if not memory.goal_watch.has_settled:
            found = found._replace(verdict="")
        memory.plans += 1
        memory.pause = PAUSE
        memory.reason, memory.verdict = found.reason, found.verdict
        if found.places is not None:
            memory.route = Route(found.places, margin=found.margin)
            memory.planned_for = scene.goal
        elif scene.moving is None:
            memory.route = None
        memory.mode = "following" if found.places is not None else "waiting"

    def drivable(self, scene: Scene, memory: PlannerMemory) -> Plan:
        """A way on which no brake holds a robot beside things that the body alone would pass (gaps.py).

        Where there is not the whole margin everywhere, such a robot keeps in the middle. Gaps that are too narrow for it are
        closed to the next plan. Where all ways lead through one, none is told.
        """
        found = self.plan(scene, memory)
        if not (self.privileged and self.is_round and (self.is_braked or needs_care(self.sensors))):
            return found
        radius, margin = braking_radius(self.sensors), self.parameters.margin
        still, solids = live_of(memory).still, self.solids(memory).with_growth(radius)
        reach = self.sensors.goal_radius if scene.reach is None else scene.reach
        around = scene
        for _ in range(DETOURS):
            if found.places is None:
                return found if around is scene else self.held(scene, memory)
            if found.margin >= margin and still.is_clear(found.places, radius):
                return found
            places = pushed_off(found.places, solids.with_growth(radius + margin))
            narrow = narrow_places(places, solids)
            narrow = narrow[np.hypot(*(narrow - scene.goal).T) > reach]
            if len(narrow) == 0 or not self.is_braked:
                return Plan(places, found.margin)
            discs = np.column_stack([narrow, np.full(len(narrow), CLOSED)])
            around = around._replace(moving=standing_discs(discs, around.moving))
            found = self.plan(around, memory)
        return self.held(scene, memory)

    def solids(self, memory: PlannerMemory) -> Solids:
        """What stands, made once an episode."""
        if memory.solids is None:
            memory.solids = Solids.of(live_of(memory).still, self.sensors.radius)
        return memory.solids

    def gives_up(self, scene: Scene, memory: PlannerMemory) -> bool:
        """Whether another plan would find no more: what moves may be gone by then."""
        return scene.moving is None

    def held(self, scene: Scene, memory: PlannerMemory) -> Plan:
        """That no way was found on which the brake does not hold the robot."""
        width = 2.0 * braking_radius(self.sensors)
        reason = f"all ways found lead through gaps narrower than {width:.3g} m, before which the robot brakes"
        return Plan(None, reason=reason, verdict="stuck" if self.gives_up(scene, memory) else "")

    @property
    def is_round(self) -> bool:
        """Whether the body is a disc; one about a longer body says little of where that passes."""
        return len(self.sensors.footprint) == 1

    @property
    def is_braked(self) -> bool:
        """Whether the robot is held before what its disc with room to brake would touch (`policy.brake`)."""
        drive = self.sensors.drive
        return drive.kinematics == "differential" and drive.latency == 0

    def planned_beside(self, scene: Scene, memory: PlannerMemory, found: Plan) -> Plan:
        """Where no way was found to the goal or the free place nearest to it: one to where within its radius most room is.

        The nearest one may be shut off from that. Where the body can come to none, "unreachable" is certain.
        """
        plan, radius = self.standing(scene, memory)
        end = end_within_reach(plan, scene.pose[:2], scene.goal, radius=radius, goal_radius=self.sensors.goal_radius)
        if end is None:
            return found._replace(verdict="unreachable")
        # From the place that is planned for, no further than the goal's radius still lets it be.
        reach = max(self.sensors.goal_radius - math.dist(end, scene.goal), 0.0)
        beside = self.drivable(scene._replace(goal=end, reach=reach), memory)
        return found._replace(verdict="stuck") if beside.places is None else beside

    def standing(self, scene: Scene, memory: Any) -> tuple[PlanningMap, float]:
        """What is known to stand, and the radius [m] of what certainly does not pass where that leaves no way for it."""
        return live_of(memory).still, self.sensors.radius

    def draw(self, memory: PlannerMemory) -> Drawing:
        """The way that is followed, and its bends."""
        if memory.route is None:
            return Drawing()
        places = memory.route.places
        segments = [(*a, *b, "path") for a, b in zip(places[:-1].tolist(), places[1:].tolist(), strict=True)]
        return Drawing(points=[(x, y, "node") for x, y in places[1:-1].tolist()], segments=segments)


def live_of(memory: MapMemory) -> LiveMap:
    """The world of an episode."""
    assert memory.live is not None, "a planner's memory is made by `begin`"
    return memory.live


def end_in_obstacle(plan: PlanningMap, scene: Scene, sensors: Sensors) -> str:
    """That the body fits nowhere where a way is to begin or to end, in a sentence; nothing where it does.

    Args:
        plan: what stands.
        scene: where both are.
        sensors: radius of the body, and how near to the goal it has to come.
    """
    return start_in_obstacle(plan, scene, sensors) or _in_obstacle(
        "goal", plan, scene.goal, sensors, sensors.goal_radius
    )


def start_in_obstacle(plan: PlanningMap, scene: Scene, sensors: Sensors) -> str:
    """The same of where a way is to begin alone."""
    return _in_obstacle("start", plan, scene.pose[:2], sensors, 2.0 * sensors.radius)


def _in_obstacle(name: str, plan: PlanningMap, place: Point, sensors: Sensors, reach: float) -> str:
    """The same of a place, with a name, as far as one beside it will do [m]."""
    if plan.free_place_near(place, radius=sensors.radius, reach=reach) is not None:
        return ""
    where = f"the {name} ({place[0]:.3g}, {place[1]:.3g}) lies in an obstacle"
    return f"{where}, or nearer to one than a body of radius {sensors.radius:g} m can come"


def exact_way(plan: PlanningMap, start: Point, goal: Point, *, radius: float, goal_radius: float) -> F64 | None:
    """The shortest way (k, 2) of a disc [m], None where there is none.

    Its ends may lie nearer to obstacles than its radius, if there is room beside.

    Args:
        plan: what stands.
        start: where from [m].
        goal: where to [m].
        radius: of the disc [m].
        goal_radius: how far from the goal it may end [m].
    """
    inner = plan.free_place_near(start, radius=radius, reach=2.0 * radius)
    outer = plan.free_place_near(goal, radius=radius, reach=goal_radius)
    if inner is None or outer is None:
        return None
    path = plan.shortest_path(inner, outer, radius=radius)
    return np.concatenate([[start], path.points]) if math.isfinite(path.length) else None


def end_within_reach(
    plan: PlanningMap, start: Point, goal: Point, *, radius: float, goal_radius: float
) -> Point | None:
    """The roomiest place so near to a goal as counts that a disc can come to; None: it can come to none, for certain.

    Args:
        plan: what stands.
        start: where the robot is [m].
        goal: where to [m].
        radius: of the disc [m].
        goal_radius: how near to the goal it has to come [m].
    """
    part = plan.free_part(start, radius=radius, reach=2.0 * radius)
    within = shapely.Point(goal).buffer(goal_radius / math.cos(0.25 * math.pi / DISC_SEGMENTS), quad_segs=DISC_SEGMENTS)
    places = shapely.get_parts(shapely.intersection(part, within))
    rooms = [shapely.maximum_inscribed_circle(one) for one in places if one.area > 0.0]
    if not rooms:
        return None
    x, y = max(rooms, key=shapely.length).coords[0]
    return x, y


def is_shut_in(plan: PlanningMap, start: Point, goal: Point, sensors: Sensors) -> bool:
    """Whether there is no way to a goal for certain, not even for the body alone.

    Args:
        plan: what stands.
        start: where the robot is [m].
        goal: where to [m].
        sensors: radius of the body, and how near to the goal it has to come.
    """
    end = end_within_reach(plan, start, goal, radius=sensors.radius, goal_radius=sensors.goal_radius)
    return end is None


def no_way(plan: PlanningMap, scene: Scene, sensors: Sensors, *, beside: float = 0.0) -> str:
    """What is said where there is no way to a goal.

    Args:
        plan: what stands.
        scene: where from and where to.
        sensors: radius of the body, and how near to the goal it has to come.
        beside: what a way was to keep beside the body [m]; 0: there is none for the body alone.
    """
    kept = f" and {beside:g} m beside it" if beside > 0.0 else ""
    told = f"no way leads from here to the goal for a body of radius {sensors.radius:g} m{kept}"
    return end_in_obstacle(plan, scene, sensors) or told


def near(scene: Scene) -> Moving:
    """What moves near the robot; what is far will be elsewhere when the robot comes there."""
    assert scene.moving is not None
    discs = scene.moving.discs
    x, y, _ = scene.pose
    return scene.moving.select(np.hypot(discs[:, 0] - x, discs[:, 1] - y) <= NEAR + discs[:, 2])


def standing_discs(discs: F64, moving: Moving | None) -> Moving:
    """Discs (n, 3) x, y, radius [m] that stand, and what moves."""
    still = Moving(discs, np.zeros((len(discs), 2)), (), np.ones(len(discs), dtype=bool))
    if moving is None:
        return still
    return Moving(
        np.concatenate([moving.discs, still.discs]),
        np.concatenate([moving.velocities, still.velocities]),
        moving.polygons,
        np.concatenate([moving.is_round, still.is_round]),
    )


def mover_discs(moving: Moving | None) -> F64:
    """Discs (n, 3) about what moves: x, y, radius [m]; none where nothing is told."""
    return np.zeros((0, 3)) if moving is None else moving.discs
