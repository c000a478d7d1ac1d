"""HD-BUG: candidates in the light area, a cost, a list of the path, and prediction of what moves.

Source: Hasibuzzaman, Jan and Wu, "Dynamic Path Planning in the Unknown Environment with Mobile Target and Obstacles".
Sensing assumed: ranges all round, goal, own position; the terrain around where the scenario has regions. Memory kept:
points of still obstacles (point_map), the double linked list of the path (path_list), tracks of what moves. States:
direct, candidates, backtracking, avoidance, emergency, turning, waiting. Guarantee: among still obstacles it reaches the
goal or declares it unreachable, for every way with the clearance (see point_map); the paper gives none.

Where the paper contradicts itself or is silent, this module decides:

1. Light and shadow (Procedure 2). A point is in the light area when a disc of the robot's clearance can go there
   straight, nearer than the detection radius r'; in the shadow area when it lies within r' and out of sight.
2. Detection radius (eq. 6, Table 1). One ladder r' = r 2^k, k = 0 to 3, so r'_max = 8 r. Density is the share of beams
   shorter than r'. Dense for three steps: k + 1, count2 + 1; sparse for ten: k - 1, count1 + 1; it begins at k = 2,
   where the grid of Procedure 3 (four radii of 0.5 m) is met exactly. r' bounds candidates, risk and horizon; what lies
   farther is still remembered.
3. Candidates (eq. 7, Procedure 3, Table 1). 32 headings x 4 radii j r'/4; vertices: where the disc just passes the end of
   a cluster of scan points; centres: the middle of the gap between the ends of neighbouring clusters (the mean of an
   obstacle's vertices, as printed, lies inside it); and the next node of the planned path. Delta of the half-plane
   filter is the direction of that node.
4. Cost (eq. 8 and Table 1). J(v) = alpha (C(s, v) + D(v, g)) + beta risk(v). The straight distance for D drives into
   every wall, so D(v, g) is what is left over the planned path: a straight way to one of its nodes, and on along it.
   C counts terrain. Among movers C is left out and v is where the robot would be after one horizon, as in eq. (8), so
   that slower is dearer.
5. Global and local path (HDPathPlanner). The global path is the shortest one among all remembered points, planned again
   when it is blocked, soon after points were taken away, and every fifty steps. Dead ends are left by it: the nodes of the path
   list between the dead end and where the new path leaves the old are closed, the state is "backtracking".
6. No way. The goal is unreachable when the remembered points close it off, at the least clearance the body allows, for
   `patience` decisions in a row, and nothing moved meanwhile. Else the robot waits, and forgets what may have moved.
7. Velocity (eq. 9). v_max where the next node is in the light; v_base where an obstacle is nearer than a step of the
   detection radius in that direction; v_min in a passage narrower than two bodies; never faster than it can stop in
   the free way.
8. Two-phase avoidance. Phase 1: each candidate is a velocity, rolled out with the robot's kinematics against the
   predicted tracks; near misses cost. Phase 2: when the best one meets something within `reaction` seconds, the one that
   meets it last is taken, whatever it costs: that is the tangential circumnavigation. While movers are near, the edges
   of shadows count as near misses too: another may come out of them. A differential robot may also back out.
9. Moving target. Its velocity is that of the last half second; the goal is the point where the robot can meet it, led by
   no longer than its velocity has foretold where it went. The goal radius grows with what it moves in a step.
10. Deep reinforcement learning (mentioned in the conclusion): a predictor beside "none", "constant_velocity" and
   "kalman"; see prediction.py.
11. Weighted regions. Factors seen are remembered; ground beyond the field's reach is supposed to go on as it is seen for
   as far again, so that a wide region is not entered because only its near edge is known.
12. Long bodies (section 3.1). The way is planned for the disc about the body, which can turn anywhere; where there is
   none, poses are planned (pose_planner) until there is room again.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.kinematics import TURN_IN_PLACE, differential_action
from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity

from .light_area import LightArea
from .path_list import PathList
from .point_map import PointMap, Search, Way
from .pose_planner import find_poses, is_open, turn_to
from .prediction import Predictor, make_predictor
from .roll_out import RollOut, roll_out
from .tracking import Tracker, TrackerMemory, Tracks

Point = tuple[float, float]
F64 = NDArray[np.float64]

HEADINGS, RINGS = 32, 4
"""Headings and radii of the grid of candidates (Procedure 3)."""

CONFIRM = 5
"""Where there was no way, every how many decisions one is looked for again."""

REPLAN, REPLAN_FREED, REPLAN_TERRAIN = 50, 10, 5
"""Steps after which the way is planned again in any case, where remembered points were taken away, and over terrain."""

LEFT_NODE = 0.05
"""Nearer than this to a node of the way it is passed, in robot radii."""


@dataclass(frozen=True)
class HDBugParameters:
    """Parameters of HD-BUG; the paper's values where it gives them."""

    predictor: str = "kalman"
    """How tracks are predicted: see `prediction.predictor_names()`."""
    clearance: float | None = None
    """Centre to wall that a way keeps [m]; None: the radius, a quarter of it, and twice the range noise."""
    r_base: float = 0.5
    """Base detection radius r [m], also the pace of the path list (eq. 6, Table 1)."""
    alpha: float = 1.0
    """Weight of the distances in the cost (eq. 8)."""
    beta: float = 0.5
    """Weight of the risk in the cost (eq. 8)."""
    v_max: float = 1.0
    """Speed with a clear way, as a share of the robot's top speed (eq. 9)."""
    v_base: float = 0.5
    """Speed near an obstacle ahead, as a share of the top speed (Table 1: base 0.5, max 1.0)."""
    v_min: float = 0.25
    """Speed in a narrow passage, as a share of the top speed; the paper gives none."""
    horizon: float = 3.0
    """How far ahead movers are predicted [s]."""
    margin: float = 0.3
    """Passing a mover nearer than this is risky [m]."""
    spread: float = 0.08
    """How fast the predicted discs of movers grow [m/s]: they don't keep their course."""
    reaction: float = 1.5
    """A predicted contact sooner than this starts the second phase of avoidance [s]."""
    patience: int = 20
    """Decisions in a row without any way before the goal counts as unreachable."""
    lead: bool = True
    """Whether a moving goal is met where it will be; else the robot heads for where it is: pure pursuit."""
    use_shadow: bool = True
    """Whether movers are expected to come out of the shadow."""
    adapt_radius: bool = True
    """Whether the detection radius adapts; else it is 4 r_base."""
    backtrack: bool = True
    """Whether anything is remembered; else the way is planned in the present scan alone."""

    def __post_init__(self) -> None:
        for name in ("r_base", "alpha", "v_max", "v_base", "v_min", "horizon", "margin", "reaction"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive, got {value!r}")
        for name in ("beta", "spread"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value!r}")
        for name in ("v_max", "v_base", "v_min"):
            if getattr(self, name) > 1.0:
                raise ValueError(f"{name} is a share of the top speed, at most 1, got {getattr(self, name)!r}")
        if self.patience < 1:
            raise ValueError(f"patience must be at least 1, got {self.patience!r}")


@dataclass
class Ladder:
    """The detection radius r' = r 2^k and its two counters (Table 1)."""

    k: int = 2
    reductions: int = 0
    """count1: how often r' was reduced."""
    enlargements: int = 0
    """count2: how often it was enlarged."""
    dense: int = 0
    """Steps in a row with many short beams."""
    sparse: int = 0
    """Steps in a row with few."""

    DENSE, SPARSE = 0.4, 0.15
    DENSE_STEPS, SPARSE_STEPS = 3, 10

    def update(self, density: float) -> None:
        """Climb after three dense steps, descend after ten sparse ones; density: share of short beams."""
        self.dense = self.dense + 1 if density > self.DENSE else 0
        self.sparse = self.sparse + 1 if density < self.SPARSE else 0
        if self.dense >= self.DENSE_STEPS and self.k < 3:
            self.k, self.enlargements, self.dense = self.k + 1, self.enlargements + 1, 0
        elif self.sparse >= self.SPARSE_STEPS and self.k > 0:
            self.k, self.reductions, self.sparse = self.k - 1, self.reductions + 1, 0


@dataclass
class Target:
    """A goal that may move: its velocity, and how far ahead it has kept its velocity so far."""

    places: deque[Point] = field(default_factory=deque)
    """Its last places, odometry frame [m]."""
    step: float = 0.1
    """Time between them [s]."""
    velocity: Point = (0.0, 0.0)
    """Over the last LOOK_BACK seconds [m/s]."""
    errors: dict[float, tuple[float, float]] = field(default_factory=dict)
    """Lead [s] -> by how much a prediction of that lead failed, and how far the goal had moved [m]; fading means."""

    LEADS = (0.5, 1.0, 2.0, 4.0, 8.0)
    LOOK_BACK = 0.5
    STANDS = 0.02
    KEEP = 0.95

    def update(self, place: Point, step: float) -> None:
        """Take in where it is now, `step` seconds after the last place."""
        self.step = step
        self.places.append(place)
        look_back = max(round(self.LOOK_BACK / step), 1)
        while len(self.places) > round(self.LEADS[-1] / step) + look_back + 1:
            self.places.popleft()
        newest = len(self.places) - 1
        self.velocity = self._velocity_at(newest, look_back)
        if not self.errors and math.dist(place, self.places[0]) < self.STANDS:
            return
        for lead in self.LEADS:
            then = newest - round(lead / step)
            if then < look_back:
                break
            vx, vy = self._velocity_at(then, look_back)
            x, y = self.places[then]
            failed = math.dist(place, (x + vx * lead, y + vy * lead))
            before = self.errors.get(lead, (failed, math.dist(place, (x, y))))
            keep = self.KEEP
            self.errors[lead] = (
                keep * before[0] + (1.0 - keep) * failed,
                keep * before[1] + (1.0 - keep) * math.dist(place, (x, y)),
            )

    def _velocity_at(self, index: int, look_back: int) -> Point:
        """Velocity [m/s] when it was at one of the places."""
        first = max(index - look_back, 0)
        if first == index:
            return 0.0, 0.0
        elapsed = (index - first) * self.step
        (x0, y0), (x1, y1) = self.places[first], self.places[index]
        return (x1 - x0) / elapsed, (y1 - y0) / elapsed

    def trusted_lead(self) -> float:
        """The longest time [s] for which its velocity has foretold where it goes; leads not yet tried are trusted."""
        trusted = 0.5 * self.LEADS[0]
        for lead in self.LEADS:
            failed, moved = self.errors.get(lead, (0.0, 1.0))
            if failed > SKILL * moved:
                return trusted
            trusted = lead
        return LONGEST_LEAD


@dataclass
class HDBugMemory(Memory):
    """Memory of HD-BUG."""

    map: PointMap | None = None
    """Remembered points of still obstacles."""
    way: Way | None = None
    """The planned path: from the robot to the goal, odometry frame [m]."""
    path: PathList | None = None
    """Where it has been."""
    ladder: Ladder = field(default_factory=Ladder)
    tracker: TrackerMemory | None = None
    tracks: Tracks | None = None
    """What it sees moving."""
    steps: int = 0
    """Decisions so far."""
    planned_at: int = 0
    """Decision at which the way was planned."""
    removed_then: int = 0
    """Points taken away from the map until then."""
    body_map: PointMap | None = None
    """The same points at the clearance of the circles of a long body; None for a round one."""
    poses: F64 | None = None
    """Poses (k, 3) that lead a long body through where it has to turn; None elsewhere."""
    posed_at: int = 0
    """Decision at which these were planned."""
    odometer: float = 0.0
    """Way travelled [m]."""
    before: Point | None = None
    """Place at the last decision, odometry frame [m]."""
    closed_off: int = 0
    """Decisions in a row without any way."""
    moved_at: int = -(10**9)
    """Decision at which something was last seen moving or gone."""
    backtracking_to: Point | None = None
    """Node of the path list that it returns to, odometry frame [m]."""
    target: Target = field(default_factory=Target)
    """How the goal moves."""
    goal: Point = (0.0, 0.0)
    """Where to: the goal or where it can be met, odometry frame [m]."""
    goal_radius: float = 0.0
    """Adaptive goal radius [m]."""
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose at this decision."""
    light: LightArea | None = None
    """Light and shadow at this decision."""
    candidates: F64 = field(default_factory=lambda: np.empty((0, 2)))
    """Candidates (m, 2) of this decision, odometry frame [m]."""
    costs: F64 = field(default_factory=lambda: np.empty(0))
    """Their costs (m,) [m]."""
    chosen: Point = (0.0, 0.0)
    """The one that was chosen."""
    direction: float = 0.0
    """Direction of the last velocity, odometry frame [rad]."""
    is_backing: bool = False
    """Whether it drives straight back."""
    forecast: F64 = field(default_factory=lambda: np.empty((0, 0, 2)))
    """Predicted places (T, K, 2) of the movers, odometry frame [m]."""


class HDBug(ScriptedPolicy):
    """HD-BUG.

    Args:
        sensors: what a driver knows of the robot.
        discrete: whether actions are numbers of the discrete table.
        **parameters: see HDBugParameters.

    Raises:
        ValueError: an unknown predictor, a clearance not above the radius, a parameter that cannot be.
    """

    Parameters = HDBugParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: object) -> None:
        super().__init__(sensors, discrete=discrete)
        self.parameters = HDBugParameters(**parameters)  # type: ignore[arg-type]
        self.predictor: Predictor = make_predictor(self.parameters.predictor, sensors)
        self.tracker = Tracker(sensors)
        self.radius = sensors.radius
        clearance = self.parameters.clearance
        self.clearance = 1.25 * self.radius + 2.0 * sensors.range_noise if clearance is None else clearance
        if not self.clearance > self.radius:
            raise ValueError(f"clearance must be above the robot's radius of {self.radius:g} m, got {clearance!r}")
        self.tight = self.radius + 0.1 * (self.clearance - self.radius)
        """The least clearance that a way is tried at [m]."""
        self.footprint: F64 = np.array(sensors.footprint, dtype=np.float64).reshape(-1, 3)
        self.is_long = len(self.footprint) > 1 and sensors.drive.kinematics == "differential"
        """Whether the body is more than a disc, and so has to turn where it is narrow."""
        self.cell = min(max(self.radius / 2.0, 0.05), 0.4)
        self.search = Search()
        self.headings: F64 = np.linspace(0.0, 2.0 * math.pi, HEADINGS, endpoint=False)
        self.rings: F64 = np.tile(np.arange(1.0, RINGS + 1.0) / RINGS, HEADINGS)
        turned = np.repeat(self.headings, RINGS)
        self.grid: F64 = self.rings[:, None] * np.column_stack([np.cos(turned), np.sin(turned)])
        self.has_terrain = any(field.name == "terrain" for field in sensors.fields)
        step = sensors.drive.step
        self.spacing = max(0.1, step)
        count = max(round(self.parameters.horizon / self.spacing), 2)
        self.times: F64 = self.spacing * np.arange(1, count + 1, dtype=np.float64)
        self.top = self.parameters.v_max * sensors.drive.max_speed

    def start(self) -> HDBugMemory:
        """Memory of a new episode."""
        return HDBugMemory(mode="direct", tracker=self.tracker.start())

    def act(self, view: View, memory: HDBugMemory) -> Velocity:
        """One decision."""
        self._perceive(view, memory)
        self._aim(view, memory)
        if memory.poses is not None:
            velocity = self._turn_through(view, memory)
            if velocity is not None:
                return velocity
        if not self._plan(view, memory):
            return self._wait(view, memory)
        if memory.poses is not None:
            return self._turn_through(view, memory) or (0.0, 0.0)
        assert memory.tracks is not None and memory.light is not None
        memory.is_backing = False
        near = self._near_movers(memory)
        if len(near):
            direction, speed = self._avoid(view, memory, near)
        else:
            direction, speed = self._choose(view, memory)
        memory.direction = direction
        bearing = direction - view.heading
        return speed * math.cos(bearing), speed * math.sin(bearing)

    def _wait(self, view: View, memory: HDBugMemory) -> Velocity:
        """Stand, but for movers that come near: there is no way now."""
        near = self._near_movers(memory)
        if memory.verdict or len(near) == 0:
            return 0.0, 0.0
        gap = math.dist(view.position, memory.goal)
        memory.way = Way(np.array([view.position, memory.goal]), np.array([gap, 0.0]))
        direction, speed = self._avoid(view, memory, near)
        memory.way, memory.mode = None, "waiting"
        bearing = direction - view.heading
        return speed * math.cos(bearing), speed * math.sin(bearing)

    # ------------------------------------------------------------------------------------------- perception

    def _perceive(self, view: View, memory: HDBugMemory) -> None:
        """Track what moves, remember what stands, adapt the detection radius."""
        if memory.map is None:
            goal = view.goal_position
            span = 0.5 * max(abs(goal[0]), abs(goal[1])) + self.sensors.range + 4.0
            memory.map = PointMap(
                (0.5 * goal[0], 0.5 * goal[1]),
                span,
                self.cell,
                self.clearance,
                self.search,
                is_weighted=self.has_terrain,
            )
            memory.path = PathList(self.parameters.r_base)
            memory.before = view.position
        assert memory.tracker is not None and memory.path is not None and memory.before is not None
        memory.steps += 1
        memory.pose = view.pose
        memory.odometer += math.dist(view.position, memory.before)
        memory.before = view.position
        memory.path.append(view.position, memory.odometer)
        tracks = self.tracker.update(memory.tracker, view, memory.steps * self.sensors.drive.step)
        memory.tracks = tracks
        owner = tracks.beam_track
        is_still = np.ones(len(owner), dtype=np.bool_)
        if tracks.moving.any():
            memory.moved_at = memory.steps
            is_still = ~((owner >= 0) & tracks.moving[np.maximum(owner, 0)])
        grid = memory.map
        if self.is_long:
            self._remember_for_body(view, memory, is_still)
        if not self.parameters.backtrack:
            grid.forget_all()
        removed = grid.removed
        grid.add_scan(
            view.position,
            view.heading,
            self.sensors.angles,
            view.ranges,
            self.sensors.range,
            self.sensors.range_noise,
            is_still,
        )
        if grid.removed - removed > 3:
            memory.moved_at = memory.steps
        for index in np.flatnonzero(tracks.moving):
            # What was remembered of it before it was known to move.
            x, y = tracks.position[index].tolist()
            grid.forget(x, y, float(tracks.radius[index]) + 0.1)
            if tracks.age[index] < 2.0:
                for place in tracks.history[index]:
                    grid.forget(float(place[0]), float(place[1]), float(tracks.radius[index]) + 0.1)
        if self.has_terrain:
            grid.add_terrain(view.position, view.heading, view.field("terrain"), TERRAIN_SPACING)
        reach = self.parameters.r_base * 2.0**memory.ladder.k
        if self.parameters.adapt_radius:
            memory.ladder.update(float(np.count_nonzero(view.ranges < reach)) / len(view.ranges))
            reach = self.parameters.r_base * 2.0**memory.ladder.k
        memory.light = LightArea(
            self.sensors.angles,
            view.ranges,
            self.sensors.range,
            self._body(view),
            reach,
            is_still,
            trusts_blind=self.sensors.drive.kinematics != "holonomic",
        )

    def _remember_for_body(self, view: View, memory: HDBugMemory, is_still: NDArray[np.bool_]) -> None:
        """Keep the map in which a long body turns."""
        assert memory.map is not None
        if memory.body_map is None:
            clearance = float(self.footprint[:, 2].max()) + BODY_MARGIN + 2.0 * self.sensors.range_noise
            cell = min(self.cell, 0.25 * clearance)
            rows, columns = memory.map.holds.shape
            side = 0.5 * self.cell * max(rows, columns)
            center = memory.map.x + 0.5 * self.cell * columns, memory.map.y + 0.5 * self.cell * rows
            memory.body_map = PointMap(center, side, cell, clearance + 0.5 * cell, self.search)
        sensors = self.sensors
        memory.body_map.add_scan(
            view.position, view.heading, sensors.angles, view.ranges, sensors.range, sensors.range_noise, is_still
        )

    def _body(self, view: View) -> float:
        """Radius of the disc that looks for free ways [m]: never more than what is free about the robot now."""
        nearest = float(view.ranges.min())
        margin = BODY_MARGIN + 2.0 * self.sensors.range_noise
        return min(self.radius + margin, max(nearest - 1e-3, 0.9 * self.radius))

    # --------------------------------------------------------------------------------------------- the goal

    def _aim(self, view: View, memory: HDBugMemory) -> None:
        """Where to: the goal, or where a moving one can be met."""
        goal = view.goal_position
        radius = max(self.sensors.goal_radius, 1e-3)
        memory.goal, memory.goal_radius = goal, 0.8 * radius
        memory.target.update(goal, self.sensors.drive.step)
        velocity = memory.target.velocity
        if not self.parameters.lead or math.hypot(*velocity) < GOAL_STANDS:
            return
        time = min(meeting_time(view.position, goal, velocity, self.top, 0.5 * radius), memory.target.trusted_lead())
        assert memory.map is not None
        for _ in range(LEADS_TRIED):
            memory.goal = goal[0] + velocity[0] * time, goal[1] + velocity[1] * time
            if memory.map.is_open(goal, memory.goal):
                break
            # It will have to turn before it gets there.
            time *= 0.5
        memory.goal_radius = max(0.8 * radius, 2.0 * math.hypot(*velocity) * self.sensors.drive.step)

    # ------------------------------------------------------------------------------------------- global path

    def _plan(self, view: View, memory: HDBugMemory) -> bool:
        """Keep the planned path, or plan it again; whether there is one."""
        grid, position, way = memory.map, view.position, memory.way
        assert grid is not None
        if way is not None:
            way.places[0] = position
            while len(way.places) > 2 and (
                math.dist(position, way.places[1]) < LEFT_NODE * self.radius
                or (not self.has_terrain and grid.is_open(position, (float(way.places[2, 0]), float(way.places[2, 1]))))
            ):
                way.places, way.rest = way.places[1:], way.rest[1:]
                way.places[0] = position
            moved = math.dist(memory.goal, way.places[-1])
            since = memory.steps - memory.planned_at
            stale = since >= REPLAN or (since >= REPLAN_FREED and grid.removed != memory.removed_then)
            # New ground is seen with every step.
            stale = stale or (self.has_terrain and since >= REPLAN_TERRAIN)
            if moved <= 0.1 and not stale and self._is_way_open(memory, way):
                return True
        elif memory.closed_off % CONFIRM:
            return self._no_way(memory)
        memory.planned_at, memory.removed_then = memory.steps, grid.removed
        found = grid.find_way(position, memory.goal, max(memory.goal_radius, 0.5 * self.cell))
        if found is None and memory.goal != view.goal_position:
            found = grid.find_way(position, view.goal_position, max(memory.goal_radius, 0.5 * self.cell))
        if found is None and self.is_long and memory.body_map is not None:
            radius = max(memory.goal_radius, memory.body_map.cell)
            memory.poses = find_poses(memory.body_map, self.footprint, view.pose, memory.goal, radius)
            memory.posed_at = memory.steps
            if memory.poses is not None:
                memory.closed_off = 0
                memory.way = pose_way(memory.poses)
                return True
        elif found is None and grid.clearance > self.tight:
            grid.set_clearance(self.tight)
            found = grid.find_way(position, view.goal_position, max(memory.goal_radius, 0.5 * self.cell))
        if found is None:
            return self._no_way(memory)
        memory.closed_off = 0
        memory.way = found
        self._note_backtracking(memory, found)
        return True

    def _turn_through(self, view: View, memory: HDBugMemory) -> Velocity | None:
        """Follow the poses of a long body; None where it has room again, or they no longer lead on."""
        grid, poses = memory.map, memory.poses
        assert grid is not None and poses is not None and memory.body_map is not None
        memory.mode = "turning"
        x, y, heading = view.pose
        since = memory.steps - memory.posed_at
        if since >= REPLAN_POSES and since % REPLAN_POSES == 0:
            column, row = int((x - grid.x) / grid.cell), int((y - grid.y) / grid.cell)
            radius = max(memory.goal_radius, 0.5 * self.cell)
            if not grid.blocked[row, column] and grid.find_way(view.position, memory.goal, radius) is not None:
                memory.poses = memory.way = None
                return None
            ahead_of_me = np.concatenate([[(x, y, heading)], poses[1:]])
            if not is_open(memory.body_map, self.footprint, ahead_of_me):
                memory.poses = memory.way = None
                return None
        while len(poses) > 1:
            gap = math.dist((x, y), poses[1, :2])
            turn = turn_to(heading, float(poses[1, 2]))
            if gap > ARRIVED or abs(turn) > ALIGNED:
                break
            poses = poses[1:]
        memory.poses = poses
        if len(poses) < 2:
            memory.poses = memory.way = None
            return None
        memory.way = pose_way(poses)
        gap = math.dist((x, y), poses[1, :2])
        bearing = float(poses[1, 2]) - heading
        if gap > ARRIVED and abs(turn_to(heading, float(poses[1, 2]))) <= ALIGNED:
            ahead, left = view.to_robot(*poses[1, :2].tolist())
            along = float(poses[1, 2])
            beside = math.cos(along) * (y - float(poses[0, 1])) - math.sin(along) * (x - float(poses[0, 0]))
            if ahead <= 0.0 or abs(beside) > ASTRAY:
                memory.poses = memory.way = None
                return None
            bearing = math.atan2(left, max(ahead, 4.0 * ARRIVED))
            speed = min(self.parameters.v_min / self.parameters.v_max * self.top, ahead / self.sensors.drive.step)
            return speed * math.cos(bearing), speed * math.sin(bearing)
        return 1e-6 * math.cos(bearing), 1e-6 * math.sin(bearing)

    def _is_way_open(self, memory: HDBugMemory, way: Way) -> bool:
        """Whether nothing new stands in the planned path."""
        grid = memory.map
        assert grid is not None
        places = way.places.tolist()
        last = len(places) - 2
        return all(
            grid.is_open(tuple(places[i]), tuple(places[i + 1]), memory.goal_radius if i == last else 0.0)
            for i in range(last + 1)
        )

    def _no_way(self, memory: HDBugMemory) -> bool:
        """The remembered points close the goal off: wait, forget, or say so."""
        memory.way = None
        memory.closed_off += 1
        memory.mode = "waiting"
        if memory.closed_off < self.parameters.patience:
            return False
        assert memory.map is not None
        if memory.steps - memory.moved_at > STILL_FOR / self.sensors.drive.step:
            memory.verdict = "unreachable"
        else:
            memory.map.forget_all()
            memory.closed_off = 0
        return False

    def _note_backtracking(self, memory: HDBugMemory, way: Way) -> None:
        """Close the dead end when the new path leads back over the list."""
        path = memory.path
        assert path is not None
        first, second = way.places[0], way.places[1]
        length = math.dist(first, second)
        memory.backtracking_to = None
        if length < 2.0 * path.pace or path.last is None:
            return
        ahead = first + (second - first) * min(1.0, 3.0 * path.pace / length)
        node = path.near((float(ahead[0]), float(ahead[1])))
        if node is not None and memory.odometer - node.odometer > 2.0 * path.pace:
            path.back_to(node)
            memory.backtracking_to = node.place

    # -------------------------------------------------------------------------------------------- local path

    def _choose(self, view: View, memory: HDBugMemory) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] toward the cheapest candidate, where nothing moves."""
        way, light, grid = memory.way, memory.light, memory.map
        assert way is not None and light is not None and grid is not None
        position = np.array(view.position)
        node = way.places[1]
        gap = math.dist(position, node)
        is_last = len(way.places) == 2
        memory.mode = "direct" if is_last else "candidates"
        if self._is_turning(view, memory, light):
            # What looks best may change with what the beams meet while it turns on the spot: finish the turn.
            return self._drive(view, memory, memory.direction, gap, is_last)
        if memory.backtracking_to is not None:
            memory.mode = "backtracking"
        cost = float(way.rest[1]) + float(grid.costs_to(view.position, node[None])[0])
        found = self._candidates(view, memory, cost) if not is_last else np.empty((0, 2))
        if len(found):
            away = np.hypot(*(found - position).T)
            total = self.parameters.alpha * (grid.costs_to(view.position, found) + grid.rest_distances(found, way))
            total += self.parameters.beta * self._risk(light, view, found)
            total[np.hypot(*(found - np.array(memory.chosen)).T) < 1e-6] -= HOLD
            memory.candidates, memory.costs = found, total
            best = int(total.argmin())
            if total[best] < self.parameters.alpha * cost - 1e-9:
                node = found[best]
                gap = float(away[best])
        else:
            memory.candidates, memory.costs = np.array([node]), np.array([cost])
        memory.chosen = float(node[0]), float(node[1])
        direction = math.atan2(node[1] - position[1], node[0] - position[0])
        return self._drive(view, memory, direction, gap, is_last)

    def _is_turning(self, view: View, memory: HDBugMemory, light: LightArea) -> bool:
        """Whether a differential robot still turns on the spot toward the last direction, which is free."""
        drive = self.sensors.drive
        if drive.kinematics == "holonomic" or memory.steps == 1:
            return False
        bearing = memory.direction - view.heading
        if abs(math.atan2(math.sin(bearing), math.cos(bearing))) <= TURN_IN_PLACE:
            return False
        return bool(light.free(np.array([bearing]))[0] >= self.top * drive.step)

    def _candidates(self, view: View, memory: HDBugMemory, most: float) -> F64:
        """Candidates (m, 2) that could cost less than `most`, odometry frame [m]."""
        light, way = memory.light, memory.way
        assert light is not None and way is not None
        goal = np.array(view.goal)
        cos, sin = math.cos(view.heading), math.sin(view.heading)
        # The grid doesn't turn with the robot: what looked best before it turned still does afterwards.
        grid = light.reach * (self.grid @ np.array([[cos, -sin], [sin, cos]]))
        used = np.hypot(*(grid - goal).T) <= most - self.rings * light.reach
        grid = grid[used]
        if len(grid):
            # Grid candidates are in the light where their heading is free as far as they lie.
            index = np.flatnonzero(used) // RINGS
            free = light.free(self.headings - view.heading)
            grid = grid[self.rings[used] * light.reach <= np.minimum(free[index], light.reach)]
        vertices, centres = light.vertices_and_centres()
        others = np.concatenate([vertices, centres, [view.to_robot(*memory.chosen)]])
        others = others[np.hypot(*others.T) > self.radius]
        others = others[np.hypot(*others.T) + np.hypot(*(others - goal).T) <= most]
        if len(others):
            others = others[light.is_light(others)]
        points = np.concatenate([grid, others])
        # Half-plane filter about the next node.
        ahead = view.to_robot(*way.places[1].tolist())
        points = points[points @ np.array(ahead) > 0.0]
        placed: F64 = points @ np.array([[cos, sin], [-sin, cos]]) + np.array(view.position)
        return placed

    def _risk(self, light: LightArea, view: View, places: F64) -> F64:
        """Risk (m,) of places in the odometry frame: how much nearer to a wall than the clearance they are."""
        if len(light.x) == 0:
            return np.zeros(len(places))
        cos, sin = math.cos(view.heading), math.sin(view.heading)
        points = (places - np.array(view.position)) @ np.array([[cos, -sin], [sin, cos]])
        gaps = np.hypot(points[:, :1] - light.x[None, :], points[:, 1:] - light.y[None, :]).min(axis=1)
        risk: F64 = np.clip(1.0 - (gaps - self.radius) / (self.clearance - self.radius), 0.0, 1.0) ** 2
        return risk

    def _drive(
        self, view: View, memory: HDBugMemory, direction: float, gap: float, is_last: bool
    ) -> tuple[float, float]:
        """Direction and speed that lead along a direction, past what stands in the first steps."""
        light, drive = memory.light, self.sensors.drive
        assert light is not None
        need = min(self.top * drive.step, gap)
        direction, free = self._slide(view, memory, direction, need)
        speed = self.top
        if free < min(gap, light.reach):
            speed = (
                self.parameters.v_base / self.parameters.v_max * self.top if free < self.parameters.r_base else speed
            )
            sides = light.free(
                np.array([direction - view.heading + 0.5 * math.pi, direction - view.heading - 0.5 * math.pi])
            )
            if float(sides.sum()) + 2.0 * self.radius < 4.0 * self.radius:
                speed = min(speed, self.parameters.v_min / self.parameters.v_max * self.top)
        if math.isfinite(drive.max_acceleration):
            speed = min(speed, math.sqrt(2.0 * drive.max_acceleration * max(free - speed * drive.step, 0.0)))
        speed = min(speed, free / drive.step)
        if not is_last:
            speed = min(speed, max(gap, 1e-3) / drive.step)
        return direction, max(speed, 1e-6)

    def _slide(self, view: View, memory: HDBugMemory, direction: float, need: float) -> tuple[float, float]:
        """The direction nearest to the desired one with a free way of `need` [m], and that way [m].

        Without any, that of an emergency point.
        """
        light, heading = memory.light, view.heading
        assert light is not None
        free = light.free(np.array([direction - heading]))
        if free[0] >= need:
            return direction, float(free[0])
        found = light.free(direction - heading + OFFSETS)
        good = np.flatnonzero(found >= need)
        if len(good):
            return direction + float(OFFSETS[good[0]]), float(found[good[0]])
        return self._emergency_point(view, memory, light)

    def _emergency_point(self, view: View, memory: HDBugMemory, light: LightArea) -> tuple[float, float]:
        """Direction and way to the emergency point that is farthest from everything seen (Procedure 3, line 17)."""
        memory.mode = "emergency"
        bearings = self.headings - view.heading
        ways = np.minimum(light.free(bearings), light.reach)
        places = ways[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
        gaps = np.full(len(places), np.inf)
        if len(light.x):
            gaps = np.hypot(places[:, :1] - light.x[None, :], places[:, 1:] - light.y[None, :]).min(axis=1)
        # Among points equally far from everything, the one with the longest way.
        best = int(np.lexsort((-ways, -gaps))[0]) if ways.max() > 0.0 else 0
        return float(self.headings[best]), float(ways[best])

    # --------------------------------------------------------------------------------------------- avoidance

    def _near_movers(self, memory: HDBugMemory) -> NDArray[np.int64]:
        """Indices of the movers that could be met within the horizon."""
        tracks = memory.tracks
        assert tracks is not None
        if not tracks.moving.any():
            return np.empty(0, dtype=np.int64)
        gaps = np.hypot(*(tracks.position - np.array(memory.pose[:2])).T) - tracks.radius - self.radius
        closing = (np.hypot(*tracks.velocity.T) + self.top) * self.parameters.horizon + self.parameters.margin
        return np.flatnonzero(tracks.moving & (gaps < closing))

    def _avoid(self, view: View, memory: HDBugMemory, near: NDArray[np.int64]) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] of the candidate velocity that costs least among movers."""
        way, light, grid, tracks = memory.way, memory.light, memory.map, memory.tracks
        assert way is not None and light is not None and grid is not None and tracks is not None
        chosen = tracks.select(near)
        forecast = self.predictor.predict(chosen, self.times)
        memory.forecast = forecast.places
        radii = chosen.radius[:, None] + self.parameters.spread * self.times[None, :]
        node = way.places[1]
        position = view.position
        toward = math.atan2(node[1] - position[1], node[0] - position[0])
        directions = toward + self.headings
        free = np.maximum(light.free(directions - view.heading), 0.0)
        speeds = self.top * np.arange(1, RINGS + 1) / RINGS
        all_directions = np.concatenate([np.repeat(directions, RINGS), [memory.direction]])
        all_speeds = np.concatenate([np.tile(speeds, HEADINGS), [0.0]])
        all_free = np.concatenate([np.repeat(free, RINGS), [0.0]])
        compare = min(max(round(light.reach / self.top / self.spacing), 3), len(self.times)) - 1
        result = roll_out(
            self.sensors.drive,
            view.pose,
            all_directions,
            all_speeds,
            all_free,
            self.radius,
            self.times,
            forecast.places,
            radii,
            self.parameters.margin,
            FADING,
            compare,
        )
        back = self._back_out(view, light, forecast.places, radii, compare)
        if back is not None:
            result = RollOut(*(np.concatenate(pair) for pair in zip(result, back, strict=True)))
            all_directions = np.append(all_directions, view.heading + math.pi)
            all_speeds = np.append(all_speeds, self.sensors.drive.max_reverse)
            all_free = np.append(all_free, np.inf)
        rest = np.minimum(
            grid.rest_distances(result.end, way), np.hypot(*(result.end - position).T) + float(way.rest[0])
        )
        turned = np.abs(np.angle(np.exp(1j * (all_directions - memory.direction))))
        cost = self.parameters.alpha * rest + self.parameters.beta * (RISK * result.nearness + HABIT * turned)
        soon = np.where(np.isfinite(result.contact), self.parameters.horizon - result.contact, 0.0)
        cost += CONTACT * soon
        if self.parameters.use_shadow:
            cost += (
                self.parameters.beta
                * SHADOW_RISK
                * self._shadow_risk(view, light, all_directions, all_speeds, all_free)
            )
        best = int(cost.argmin())
        memory.mode = "avoidance"
        if result.contact[best] < self.parameters.reaction:
            # Phase 2: whatever is met last.
            late = np.minimum(result.contact, self.parameters.horizon)
            best = int(np.lexsort((cost, -late))[0])
        memory.is_backing = back is not None and best == len(cost) - 1
        memory.candidates, memory.costs = result.end, cost
        memory.chosen = float(result.end[best, 0]), float(result.end[best, 1])
        speed = min(float(all_speeds[best]), float(all_free[best]) / self.sensors.drive.step)
        return float(all_directions[best]), max(speed, 1e-6)

    def _back_out(self, view: View, light: LightArea, places: F64, radii: F64, compare: int) -> RollOut | None:
        """What comes of driving straight back; None for a robot that doesn't, or has no room to."""
        drive = self.sensors.drive
        if drive.kinematics == "holonomic" or drive.max_reverse <= 0.0:
            return None
        direction = np.array([view.heading + math.pi])
        free = light.free(direction - view.heading)
        if free[0] < drive.max_reverse * drive.step:
            return None
        straight = replace(drive, kinematics="holonomic")
        return roll_out(
            straight, view.pose, direction, np.array([drive.max_reverse]), free, self.radius, self.times, places, radii,
            self.parameters.margin, FADING, compare,
        )  # fmt: skip

    def _action(self, flat: NDArray[np.float32], memory: Memory) -> NDArray[Any]:
        action = super()._action(flat, memory)
        if isinstance(memory, HDBugMemory) and memory.is_backing and not memory.verdict and not self.discrete:
            return differential_action(self.sensors.drive, -self.sensors.drive.max_reverse, 0.0)
        return action

    def _shadow_risk(self, view: View, light: LightArea, directions: F64, speeds: F64, free: F64) -> F64:
        """Nearness (m,) to movers that could come out of the shadow beside the ends of what is seen."""
        edges, _ = light.vertices_and_centres()
        edges = edges[np.hypot(*edges.T) < light.reach]
        if len(edges) == 0:
            return np.zeros(len(directions))
        cos, sin = math.cos(view.heading), math.sin(view.heading)
        places = edges @ np.array([[cos, sin], [-sin, cos]]) + np.array(view.position)
        times = self.times[:SHADOW_STEPS]
        radii = np.tile(SHADOW_SPEED * times, (len(edges), 1))
        held = np.repeat(places[:, None], len(times), axis=1)
        found = roll_out(
            self.sensors.drive, view.pose, directions, speeds, free, self.radius, times, held, radii,
            self.parameters.margin, FADING, 0,
        )  # fmt: skip
        return found.nearness

    # ----------------------------------------------------------------------------------------------- drawing

    def draw(self, memory: HDBugMemory) -> Drawing:
        """Light and shadow areas, candidates by cost, the planned path and the list of the passed one, tracks."""
        if memory.light is None or memory.path is None:
            return Drawing()
        x, y, heading = memory.pose
        turn = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
        place = np.array([x, y])
        areas = [(memory.light.light_ring() @ turn + place, "light")]
        areas += [(ring @ turn + place, "shadow") for ring in memory.light.shadow_rings()]
        points: list[tuple[float, float, str]] = []
        finite = memory.costs[np.isfinite(memory.costs)]
        if len(finite):
            low, high = float(finite.min()), float(finite.max())
            for (px, py), cost in zip(memory.candidates.tolist(), memory.costs.tolist(), strict=True):
                share = (cost - low) / (high - low) if high > low and math.isfinite(cost) else 1.0
                points.append((px, py, "cheap" if share < 0.25 else "candidate" if share < 0.6 else "dear"))
        points += [(*node.place, "closed") for node in memory.path if node.is_closed]
        points.append((*memory.chosen, "chosen"))
        segments: list[tuple[float, float, float, float, str]] = []
        if memory.way is not None:
            places = memory.way.places.tolist()
            segments += [(*a, *b, "way") for a, b in zip(places, places[1:], strict=False)]
        for future in memory.forecast:
            segments += [
                (*a, *b, "forecast") for a, b in zip(future[:-1:4].tolist(), future[4::4].tolist(), strict=False)
            ]
        return Drawing(points=points, segments=segments, areas=areas)


OFFSETS: F64 = np.radians(np.stack([np.arange(3.0, 177.0, 3.0), -np.arange(3.0, 177.0, 3.0)], axis=1).ravel())
"""Turns away from a direction that are tried, the smallest first [rad]."""

TERRAIN_SPACING = 0.25
"""Distance between the rings of the terrain field [m]."""

STILL_FOR = 10.0
"""Nothing may have moved for so long before a goal counts as unreachable [s]."""

GOAL_STANDS = 0.02
"""A goal slower than this stands [m/s]."""

LEADS_TRIED = 5
"""How often the lead is halved until nothing stands in the goal's way."""

REPLAN_POSES = 10
"""Steps between two looks for a way without turns."""

ARRIVED, ALIGNED, ASTRAY = 0.03, math.radians(2.0), 0.05
"""How near to a pose [m, rad] is there, and how far beside the straight line to it [m] is lost."""

HOLD = 0.02
"""How much cheaper another candidate must be than the one chosen last [m]."""

BODY_MARGIN = 0.025
"""Kept about the body beside twice the range noise [m]: a little more than the last brake asks for (policy.brake)."""

SKILL = 0.5
"""A prediction is trusted where it fails by less than this share of what the goal has moved."""

LONGEST_LEAD = 10.0
"""A goal is never led by more than this [s]."""

FADING = 1.5
"""Time constant with which a near miss ahead fades [s]."""

SHADOW_RISK, SHADOW_SPEED, SHADOW_STEPS = 0.5, 0.3, 10
"""Weight of what may come out of the shadow [m], how fast it comes [m/s], and for how many steps it is feared."""

RISK, HABIT, CONTACT = 6.0, 0.1, 2.0
"""Weights of a near miss [m], of a turn [m/rad], and of a contact, for each second that it comes sooner [m/s]."""


def pose_way(poses: F64) -> Way:
    """Poses (k, 3) as a way over their places."""
    lengths = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    return Way(poses[:, :2].copy(), np.append(np.cumsum(lengths[::-1])[::-1], 0.0))


def meeting_time(position: Point, goal: Point, velocity: Point, speed: float, radius: float) -> float:
    """Time until a robot that goes straight can first be within `radius` [m] of a goal that keeps its velocity [s].

    Infinite where it never can. (Interception in closed form: |goal + velocity t - position| = speed t + radius.)
    """
    dx, dy = goal[0] - position[0], goal[1] - position[1]
    a = velocity[0] ** 2 + velocity[1] ** 2 - speed * speed
    b = dx * velocity[0] + dy * velocity[1] - speed * radius
    c = dx * dx + dy * dy - radius * radius
    if c <= 0.0:
        return 0.0
    if abs(a) < 1e-12:
        return -0.5 * c / b if b < 0.0 else math.inf
    root = b * b - a * c
    if root < 0.0:
        return math.inf
    # The smallest positive root, in the form that takes no difference of near numbers apart from -b.
    below = (-b + math.sqrt(root), -b - math.sqrt(root))
    return min((c / part for part in below if part > 0.0), default=math.inf)
