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
   as far again, so that a wide region is not entered because only its near edge is known. What is seen or supposed from
   nearer counts, else it would change with the heading, and the side to go round a region with it.
12. Long bodies (section 3.1). The way is planned for the disc about the body, which can turn anywhere; where there is
   none, poses are planned (pose_planner) until there is room again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.light_area import Ladder, LightArea, density
from bug_gym.agents.hd_bug.moving_goal import MovingGoal, meeting_time
from bug_gym.agents.hd_bug.path_list import PathList
from bug_gym.agents.hd_bug.poses import TURNING, Turns, find_poses
from bug_gym.agents.hd_bug.roll_out import Movers, RollOut, Velocities, roll_out
from bug_gym.agents.mapping.lazy_theta import Search
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.prediction import make_predictor
from bug_gym.agents.prediction.predictor import Predictor
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory, Tracks
from bug_gym.geometry import F64, Point
from bug_gym.kinematics import TURN_IN_PLACE, differential_action
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

HEADINGS, RINGS = 32, 4
"""Headings and radii of the grid of candidates (Procedure 3)."""

CONFIRM = 5
"""Where there was no way, every how many decisions one is looked for again."""

REPLAN, REPLAN_FREED, REPLAN_TERRAIN, REPLAN_POSES = 50, 10, 5, 10
"""Steps after which the way is planned again in any case, where remembered points were taken away, and where ground was
revised; and between two looks of a long body for a way without turns."""

LEFT_NODE = 0.05
"""Nearer than this to a node of the way it is passed, in robot radii."""

OFFSETS: F64 = np.radians(np.stack([np.arange(3.0, 177.0, 3.0), -np.arange(3.0, 177.0, 3.0)], axis=1).ravel())
"""Turns away from a direction that are tried, the smallest first [rad]."""

TERRAIN_SPACING = 0.25
"""Distance between the rings of the terrain field [m]."""

STILL_FOR = 10.0
"""Nothing may have moved for so long before a goal counts as unreachable [s]."""

VANISHED = 3
"""More points than this taken away by one scan say that something moved."""

GOAL_STANDS = 0.02
"""A goal slower than this stands [m/s]."""

LEADS_TRIED = 5
"""How often the lead is halved until nothing stands in the goal's way."""

HOLD = 0.02
"""How much cheaper another candidate must be than the one chosen last [m]."""

BODY_MARGIN = 0.025
"""Kept about the body beside twice the range noise [m]: a little more than the last brake asks for (policy.brake)."""

SHADOW_RISK, SHADOW_SPEED, SHADOW_STEPS = 0.5, 0.3, 10
"""Weight of what may come out of the shadow [m], how fast it comes [m/s], and for how many steps it is feared."""

RISK, HABIT, CONTACT = 6.0, 0.1, 2.0
"""Weights of a near miss [m], of a turn [m/rad], and of a contact, for each second that it comes sooner [m/s]."""


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


@dataclass(kw_only=True)
class HDBugMemory(Memory):
    """Memory of HD-BUG."""

    tracker: TrackerMemory
    path: PathList
    """Where it has been."""
    map: PointMap | None = None
    """Remembered points of still obstacles; None before the first decision."""
    body_map: PointMap | None = None
    """The same points at the clearance of the circles of a long body; None for a round one."""
    way: Way | None = None
    """The planned path: from the robot to the goal, odometry frame [m]."""
    turns: Turns | None = None
    """What leads a long body through where it has to turn; None elsewhere."""
    ladder: Ladder = field(default_factory=Ladder)
    steps: int = 0
    """Decisions so far."""
    planned_at: int = 0
    """Decision at which the way was planned."""
    removed_then: int = 0
    """Points taken away from the map until then."""
    revised_then: int = 0
    """Cells of the map whose ground had been revised until then."""
    odometer: float = 0.0
    """Way travelled [m]."""
    closed_off: int = 0
    """Decisions in a row without any way."""
    moved_at: int = -(10**9)
    """Decision at which something was last seen moving or gone."""
    backtracking_to: Point | None = None
    """Node of the path list that it returns to, odometry frame [m]."""
    moving_goal: MovingGoal = field(default_factory=MovingGoal)
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


class Scene(NamedTuple):
    """What one decision rests on."""

    view: View
    grid: PointMap
    """Remembered points of still obstacles."""
    light: LightArea
    tracks: Tracks
    """What it sees, and what of it moves."""


class HDBug(ScriptedPolicy):
    """HD-BUG.

    Args:
        sensors: what a driver knows of the robot.
        discrete: whether actions are numbers of the discrete table.
        **parameters: see HDBugParameters.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown predictor, a clearance not above the radius, a parameter that cannot be.
    """

    Parameters = HDBugParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete)
        self.parameters = HDBugParameters(**parameters)
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
        turned, rings = np.repeat(self.headings, RINGS), np.tile(np.arange(1.0, RINGS + 1.0) / RINGS, HEADINGS)
        self.grid: F64 = rings[:, None] * np.column_stack([np.cos(turned), np.sin(turned)])
        """Grid of candidates (HEADINGS * RINGS, 2) in units of the detection radius."""
        self.has_terrain = any(field.name == "terrain" for field in sensors.fields)
        drive = sensors.drive
        self.spacing = max(0.1, drive.step)
        count = max(round(self.parameters.horizon / self.spacing), 2)
        self.times: F64 = self.spacing * np.arange(1, count + 1, dtype=np.float64)
        shares = self.parameters.v_max, self.parameters.v_base, self.parameters.v_min
        self.top, self.base, self.slow = (share * drive.max_speed for share in shares)
        """Speeds of eq. 9 [m/s]."""
        self.speeds: F64 = np.tile(self.top * np.arange(1, RINGS + 1) / RINGS, HEADINGS)
        self.reverse = drive.max_reverse
        self.backward = replace(drive, kinematics="holonomic")
        """The robot as it drives straight back."""

    def start(self) -> HDBugMemory:
        """Memory of a new episode."""
        return HDBugMemory(mode="direct", tracker=self.tracker.start(), path=PathList(self.parameters.r_base))

    def act(self, view: View, memory: HDBugMemory) -> Velocity:
        """One decision."""
        scene = self._perceive(view, memory)
        self._aim(scene, memory)
        if memory.turns is not None:
            velocity = self._turn_through(scene, memory, memory.turns)
            if velocity is not None:
                return velocity
        way = self._plan(scene, memory)
        if way is None:
            return self._wait(scene, memory)
        if memory.turns is not None:
            return self._turn_through(scene, memory, memory.turns) or (0.0, 0.0)
        memory.is_backing = False
        near = self._near_movers(scene)
        if len(near):
            direction, speed = self._avoid(scene, memory, way, near)
        else:
            direction, speed = self._choose(scene, memory, way)
        memory.direction = direction
        return velocity_along(direction - view.heading, speed)

    def _wait(self, scene: Scene, memory: HDBugMemory) -> Velocity:
        """Stand, but for movers that come near: there is no way now."""
        view, near = scene.view, self._near_movers(scene)
        if memory.verdict or len(near) == 0:
            return 0.0, 0.0
        gap = math.dist(view.position, memory.goal)
        straight = Way(np.array([view.position, memory.goal]), np.array([gap, 0.0]))
        direction, speed = self._avoid(scene, memory, straight, near)
        memory.mode = "waiting"
        return velocity_along(direction - view.heading, speed)

    # ------------------------------------------------------------------------------------------- perception

    def _perceive(self, view: View, memory: HDBugMemory) -> Scene:
        """Track what moves, remember what stands, adapt the detection radius."""
        if memory.steps:
            memory.odometer += math.dist(view.position, memory.pose[:2])
        memory.steps += 1
        memory.pose = view.pose
        memory.path.append(view.position, memory.odometer)
        tracks = self.tracker.update(memory.tracker, view, memory.steps * self.sensors.drive.step)
        owner = tracks.beam_track
        is_still = np.ones(len(owner), dtype=np.bool_)
        if tracks.moving.any():
            memory.moved_at = memory.steps
            is_still = ~((owner >= 0) & tracks.moving[np.maximum(owner, 0)])
        grid = self._remember(view, memory, tracks, is_still)
        if self.parameters.adapt_radius:
            memory.ladder.update(density(view.ranges, self._detection_radius(memory.ladder)))
        light = LightArea(
            self.sensors.angles,
            view.ranges,
            self.sensors.range,
            self._body(view),
            self._detection_radius(memory.ladder),
            is_still,
            trusts_blind=self.sensors.drive.kinematics != "holonomic",
        )
        memory.light = light
        return Scene(view, grid, light, tracks)

    def _detection_radius(self, ladder: Ladder) -> float:
        """How far candidates, risk and horizon reach [m]."""
        return min(self.parameters.r_base * 2.0**ladder.k, self.sensors.range)

    def _remember(self, view: View, memory: HDBugMemory, tracks: Tracks, is_still: NDArray[np.bool_]) -> PointMap:
        """Take the scan into the map; what moves is left out, and forgotten where it was remembered before."""
        if memory.map is None:
            goal = view.goal_position
            middle, span = (0.5 * goal[0], 0.5 * goal[1]), 0.5 * max(abs(goal[0]), abs(goal[1]))
            span += self.sensors.range + 4.0
            memory.map = PointMap(middle, span, self.cell, self.clearance, self.search, is_weighted=self.has_terrain)
            if self.is_long:
                memory.body_map = self._map_for_body(memory.map)
        grid, removed = memory.map, memory.map.removed
        if not self.parameters.backtrack:
            grid.forget_all()
        sensors = self.sensors
        scan = (view.position, view.heading, sensors.angles, view.ranges, sensors.range, sensors.range_noise, is_still)
        grid.add_scan(*scan)
        if memory.body_map is not None:
            memory.body_map.add_scan(*scan)
        if grid.removed - removed > VANISHED:
            memory.moved_at = memory.steps
        for index in np.flatnonzero(tracks.moving):
            # What was remembered of it before it was known to move.
            radius = float(tracks.radius[index]) + 0.1
            places = [tracks.position[index], *(tracks.history[index] if tracks.age[index] < 2.0 else ())]
            for x, y in places:
                grid.forget(float(x), float(y), radius)
        if self.has_terrain:
            grid.add_terrain(view.position, view.heading, view.field("terrain"), TERRAIN_SPACING)
        return grid

    def _map_for_body(self, grid: PointMap) -> PointMap:
        """An empty map in which a long body turns, over the same ground."""
        clearance = float(self.footprint[:, 2].max()) + BODY_MARGIN + 2.0 * self.sensors.range_noise
        cell = min(self.cell, 0.25 * clearance)
        rows, columns = grid.cells.holds.shape
        side = 0.5 * self.cell * max(rows, columns)
        center = grid.cells.x + 0.5 * self.cell * columns, grid.cells.y + 0.5 * self.cell * rows
        return PointMap(center, side, cell, clearance + 0.5 * cell, self.search)

    def _body(self, view: View) -> float:
        """Radius of the disc that looks for free ways [m]: never more than what is free about the robot now."""
        nearest = float(view.ranges.min())
        margin = BODY_MARGIN + 2.0 * self.sensors.range_noise
        return min(self.radius + margin, max(nearest - 1e-3, 0.9 * self.radius))

    # --------------------------------------------------------------------------------------------- the goal

    def _aim(self, scene: Scene, memory: HDBugMemory) -> None:
        """Where to: the goal, or where a moving one can be met."""
        view, step = scene.view, self.sensors.drive.step
        goal = view.goal_position
        radius = max(self.sensors.goal_radius, 1e-3)
        memory.goal, memory.goal_radius = goal, 0.8 * radius
        memory.moving_goal.update(goal, step)
        velocity = memory.moving_goal.velocity
        if not self.parameters.lead or math.hypot(*velocity) < GOAL_STANDS:
            return
        met = meeting_time(view.position, goal, velocity, self.top, 0.5 * radius)
        lead = min(met, memory.moving_goal.trusted_lead())
        for _ in range(LEADS_TRIED):
            memory.goal = goal[0] + velocity[0] * lead, goal[1] + velocity[1] * lead
            if scene.grid.is_open(goal, memory.goal):
                break
            # It will have to turn before it gets there.
            lead *= 0.5
        memory.goal_radius = max(0.8 * radius, 2.0 * math.hypot(*velocity) * step)

    # ------------------------------------------------------------------------------------------- global path

    def _plan(self, scene: Scene, memory: HDBugMemory) -> Way | None:
        """The planned path: the one there is, or a new one; None where there is none."""
        if memory.way is not None:
            scene.grid.pass_nodes(memory.way, scene.view.position, LEFT_NODE * self.radius, cuts=not self.has_terrain)
            if self._is_good(scene, memory, memory.way):
                return memory.way
        may_look = memory.way is not None or memory.closed_off % CONFIRM == 0
        memory.way = self._find_way(scene, memory) if may_look else None
        if memory.way is None:
            self._no_way(scene, memory)
            return None
        memory.closed_off = 0
        if memory.turns is None:
            self._note_backtracking(memory, memory.way)
        return memory.way

    def _is_good(self, scene: Scene, memory: HDBugMemory, way: Way) -> bool:
        """Whether the path still leads to the goal, is not too old, and nothing new stands in it."""
        grid = scene.grid
        if math.dist(memory.goal, way.places[-1]) > 0.1:
            return False
        since = memory.steps - memory.planned_at
        if since >= REPLAN or (since >= REPLAN_TERRAIN and grid.revised != memory.revised_then):
            return False
        if since >= REPLAN_FREED and grid.removed != memory.removed_then:
            return False
        return grid.is_way_open(way, memory.goal_radius)

    def _find_way(self, scene: Scene, memory: HDBugMemory) -> Way | None:
        """A new path: to where the goal can be met, else to the goal, else over poses, else at the least clearance."""
        view, grid = scene.view, scene.grid
        position, goal = view.position, view.goal_position
        memory.planned_at, memory.removed_then, memory.revised_then = memory.steps, grid.removed, grid.revised
        radius = max(memory.goal_radius, 0.5 * self.cell)
        found = grid.find_way(position, memory.goal, radius)
        if found is None and memory.goal != goal:
            found = grid.find_way(position, goal, radius)
        if found is not None:
            return found
        if memory.body_map is not None:
            radius = max(memory.goal_radius, memory.body_map.cells.size)
            poses = find_poses(memory.body_map, self.footprint, view.pose, memory.goal, radius)
            memory.turns = None if poses is None else Turns(poses, memory.body_map, memory.steps)
            return None if memory.turns is None else memory.turns.way
        if grid.cells.clearance > self.tight:
            grid.set_clearance(self.tight)
            return grid.find_way(position, goal, radius)
        return None

    def _turn_through(self, scene: Scene, memory: HDBugMemory, turns: Turns) -> Velocity | None:
        """Follow the poses of a long body; None where it has room again, or they no longer lead on."""
        view, grid = scene.view, scene.grid
        memory.mode = "turning"
        since = memory.steps - turns.planned_at
        velocity = None
        if not (since and since % REPLAN_POSES == 0) or self._has_to_turn(view, grid, memory, turns):
            velocity = turns.lead_on(view, self.slow)
        if velocity is None:
            memory.turns = memory.way = None
        else:
            memory.way = turns.way
        return velocity

    def _has_to_turn(self, view: View, grid: PointMap, memory: HDBugMemory, turns: Turns) -> bool:
        """Whether a long body has no room to go as a disc, and its poses are still open."""
        radius = max(memory.goal_radius, 0.5 * self.cell)
        if not grid.is_blocked(view.position) and grid.find_way(view.position, memory.goal, radius) is not None:
            return False
        return turns.is_open(self.footprint, view.pose)

    def _no_way(self, scene: Scene, memory: HDBugMemory) -> None:
        """The remembered points close the goal off: wait, forget, or say so."""
        memory.closed_off += 1
        memory.mode = "waiting"
        if memory.closed_off < self.parameters.patience:
            return
        if memory.steps - memory.moved_at > STILL_FOR / self.sensors.drive.step:
            memory.verdict = "unreachable"
        else:
            scene.grid.forget_all()
            memory.closed_off = 0

    def _note_backtracking(self, memory: HDBugMemory, way: Way) -> None:
        """Close the dead end when the new path leads back over the list."""
        path = memory.path
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

    def _choose(self, scene: Scene, memory: HDBugMemory, way: Way) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] toward the cheapest candidate, where nothing moves."""
        view, grid = scene.view, scene.grid
        position = np.array(view.position)
        node = way.places[1]
        gap = math.dist(position, node)
        is_last = len(way.places) == 2
        memory.mode = "direct" if is_last else "candidates"
        if self._is_turning(scene, memory):
            # What looks best may change with what the beams meet while it turns on the spot: finish the turn.
            return self._drive(scene, memory, memory.direction, gap, is_last)
        if memory.backtracking_to is not None:
            memory.mode = "backtracking"
        cost = float(way.rest[1]) + float(grid.costs_to(view.position, node[None])[0])
        found = self._candidates(scene, memory, way, cost) if not is_last else np.empty((0, 2))
        if len(found):
            total = self.parameters.alpha * (grid.costs_to(view.position, found) + grid.rest_distances(found, way))
            total += self.parameters.beta * self._risk(scene, found)
            total[np.hypot(*(found - np.array(memory.chosen)).T) < 1e-6] -= HOLD
            memory.candidates, memory.costs = found, total
            best = int(total.argmin())
            if total[best] < self.parameters.alpha * cost - 1e-9:
                node = found[best]
                gap = float(np.hypot(*(node - position)))
        else:
            memory.candidates, memory.costs = np.array([node]), np.array([cost])
        memory.chosen = float(node[0]), float(node[1])
        return self._drive(scene, memory, direction_to(view, memory.chosen), gap, is_last)

    def _is_turning(self, scene: Scene, memory: HDBugMemory) -> bool:
        """Whether a differential robot still turns on the spot toward the last direction, which is free."""
        drive = self.sensors.drive
        if drive.kinematics == "holonomic" or memory.steps == 1:
            return False
        bearing = memory.direction - scene.view.heading
        if abs(math.atan2(math.sin(bearing), math.cos(bearing))) <= TURN_IN_PLACE:
            return False
        return bool(scene.light.free(np.array([bearing]))[0] >= self.top * drive.step)

    def _candidates(self, scene: Scene, memory: HDBugMemory, way: Way, most: float) -> F64:
        """Candidates (m, 2) that could cost less than `most`, odometry frame [m]."""
        view, light = scene.view, scene.light
        # The grid doesn't turn with the robot: what looked best before it turned still does afterwards.
        grid = light.reach * (self.grid @ turn_matrix(-view.heading))
        # Half-plane filter about the next node.
        ahead, chosen = view.to_robot(*way.places[1].tolist()), view.to_robot(*memory.chosen)
        bearings = self.headings - view.heading
        found = light.candidates(grid, bearings, chosen, view.goal, ahead, self.radius, most)
        return in_odometry(view.pose, found)

    def _risk(self, scene: Scene, places: F64) -> F64:
        """Risk (m,) of places in the odometry frame: how much nearer to a wall than the clearance they are."""
        points = (places - np.array(scene.view.position)) @ turn_matrix(-scene.view.heading)
        short = (scene.light.gaps(points) - self.radius) / (self.clearance - self.radius)
        risk: F64 = np.clip(1.0 - short, 0.0, 1.0) ** 2
        return risk

    def _drive(
        self, scene: Scene, memory: HDBugMemory, direction: float, gap: float, is_last: bool
    ) -> tuple[float, float]:
        """Direction and speed that lead along a direction, past what stands in the first steps."""
        light, drive = scene.light, self.sensors.drive
        direction, free = self._slide(scene, memory, direction, min(self.top * drive.step, gap))
        speed = self.top
        if free < min(gap, light.reach):
            speed = self.base if free < self.parameters.r_base else speed
            sideways = direction - scene.view.heading + 0.5 * math.pi * np.array([1.0, -1.0])
            if float(light.free(sideways).sum()) < 2.0 * self.radius:
                speed = min(speed, self.slow)
        if math.isfinite(drive.max_acceleration):
            speed = min(speed, math.sqrt(2.0 * drive.max_acceleration * max(free - speed * drive.step, 0.0)))
        speed = min(speed, free / drive.step)
        if not is_last:
            speed = min(speed, max(gap, 1e-3) / drive.step)
        return direction, max(speed, TURNING)

    def _slide(self, scene: Scene, memory: HDBugMemory, direction: float, need: float) -> tuple[float, float]:
        """The direction nearest to the desired one with a free way of `need` [m], and that way [m].

        Without any, that of an emergency point.
        """
        light, heading = scene.light, scene.view.heading
        free = light.free(np.array([direction - heading]))
        if free[0] >= need:
            return direction, float(free[0])
        found = light.free(direction - heading + OFFSETS)
        good = np.flatnonzero(found >= need)
        if len(good):
            return direction + float(OFFSETS[good[0]]), float(found[good[0]])
        return self._emergency_point(scene, memory)

    def _emergency_point(self, scene: Scene, memory: HDBugMemory) -> tuple[float, float]:
        """Direction and way to the emergency point that is farthest from everything seen (Procedure 3, line 17)."""
        memory.mode = "emergency"
        light, bearings = scene.light, self.headings - scene.view.heading
        ways = np.minimum(light.free(bearings), light.reach)
        gaps = light.gaps(ways[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)]))
        # Among points equally far from everything, the one with the longest way.
        best = int(np.lexsort((-ways, -gaps))[0]) if ways.max() > 0.0 else 0
        return float(self.headings[best]), float(ways[best])

    # --------------------------------------------------------------------------------------------- avoidance

    def _near_movers(self, scene: Scene) -> NDArray[np.int64]:
        """Indices of the movers that could be met within the horizon."""
        tracks = scene.tracks
        if not tracks.moving.any():
            return np.empty(0, dtype=np.int64)
        gaps = np.hypot(*(tracks.position - np.array(scene.view.position)).T) - tracks.radius - self.radius
        closing = (np.hypot(*tracks.velocity.T) + self.top) * self.parameters.horizon + self.parameters.margin
        return np.flatnonzero(tracks.moving & (gaps < closing))

    def _avoid(self, scene: Scene, memory: HDBugMemory, way: Way, near: NDArray[np.int64]) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] of the candidate velocity that costs least among movers."""
        view, light, parameters = scene.view, scene.light, self.parameters
        chosen = scene.tracks.select(near)
        memory.forecast = self.predictor.predict(chosen, self.times).places
        radii = chosen.radius[:, None] + parameters.spread * self.times[None, :]
        movers = Movers(memory.forecast, radii, parameters.margin)
        velocities = self._velocity_candidates(scene, memory, way)
        compare = min(max(round(light.reach / self.top / self.spacing), 3), len(self.times)) - 1
        result = roll_out(self.sensors.drive, view.pose, self.radius, velocities, movers, self.times, compare)
        back = self._back_out(scene, movers, compare)
        if back is not None:
            behind = Velocities(*(np.array([number]) for number in (view.heading + math.pi, self.reverse, np.inf)))
            velocities = Velocities(*map(np.concatenate, zip(velocities, behind, strict=True)))
            result = RollOut(*map(np.concatenate, zip(result, back, strict=True)))
        cost = self._costs_among_movers(scene, memory, way, velocities, result)
        best = int(cost.argmin())
        memory.mode = "avoidance"
        if result.contact[best] < parameters.reaction:
            # Phase 2: whatever is met last.
            late = np.minimum(result.contact, parameters.horizon)
            best = int(np.lexsort((cost, -late))[0])
        memory.is_backing = back is not None and best == len(cost) - 1
        memory.candidates, memory.costs = result.end, cost
        memory.chosen = float(result.end[best, 0]), float(result.end[best, 1])
        speed = min(float(velocities.speeds[best]), float(velocities.free[best]) / self.sensors.drive.step)
        return float(velocities.directions[best]), max(speed, TURNING)

    def _velocity_candidates(self, scene: Scene, memory: HDBugMemory, way: Way) -> Velocities:
        """The candidates among movers: headings about the next node at each speed, and to stand."""
        directions = direction_to(scene.view, way.places[1]) + self.headings
        free = np.maximum(scene.light.free(directions - scene.view.heading), 0.0)
        return Velocities(
            np.append(np.repeat(directions, RINGS), memory.direction),
            np.append(self.speeds, 0.0),
            np.append(np.repeat(free, RINGS), 0.0),
        )

    def _costs_among_movers(
        self, scene: Scene, memory: HDBugMemory, way: Way, velocities: Velocities, result: RollOut
    ) -> F64:
        """Costs (m,) of the candidate velocities: what is left to go, and the risk [m]."""
        parameters, ends = self.parameters, result.end
        straight_on = np.hypot(*(ends - scene.view.position).T) + float(way.rest[0])
        rest = np.minimum(scene.grid.rest_distances(ends, way), straight_on)
        turned = np.abs(np.angle(np.exp(1j * (velocities.directions - memory.direction))))
        cost: F64 = parameters.alpha * rest + parameters.beta * (RISK * result.nearness + HABIT * turned)
        cost += CONTACT * np.where(np.isfinite(result.contact), parameters.horizon - result.contact, 0.0)
        if parameters.use_shadow:
            cost += parameters.beta * SHADOW_RISK * self._shadow_risk(scene, velocities)
        return cost

    def _back_out(self, scene: Scene, movers: Movers, compare: int) -> RollOut | None:
        """What comes of driving straight back; None for a robot that doesn't, or has no room to."""
        if self.sensors.drive.kinematics == "holonomic" or self.reverse <= 0.0:
            return None
        direction = np.array([scene.view.heading + math.pi])
        free = scene.light.free(direction - scene.view.heading)
        if free[0] < self.reverse * self.sensors.drive.step:
            return None
        velocities = Velocities(direction, np.array([self.reverse]), free)
        return roll_out(self.backward, scene.view.pose, self.radius, velocities, movers, self.times, compare)

    def _action(self, flat: NDArray[np.float32], memory: Memory) -> NDArray[Any]:
        action = super()._action(flat, memory)
        if isinstance(memory, HDBugMemory) and memory.is_backing and not memory.verdict and not self.discrete:
            return differential_action(self.sensors.drive, -self.reverse, 0.0)
        return action

    def _shadow_risk(self, scene: Scene, velocities: Velocities) -> F64:
        """Nearness (m,) to movers that could come out of the shadow beside the ends of what is seen."""
        view, light = scene.view, scene.light
        edges, _ = light.vertices_and_centres()
        edges = edges[np.hypot(*edges.T) < light.reach]
        if len(edges) == 0:
            return np.zeros(len(velocities.directions))
        times = self.times[:SHADOW_STEPS]
        places = np.repeat(in_odometry(view.pose, edges)[:, None], len(times), axis=1)
        radii = np.tile(SHADOW_SPEED * times, (len(edges), 1))
        hidden = Movers(places, radii, self.parameters.margin)
        return roll_out(self.sensors.drive, view.pose, self.radius, velocities, hidden, times, 0).nearness

    # ----------------------------------------------------------------------------------------------- drawing

    def draw(self, memory: HDBugMemory) -> Drawing:
        """Light and shadow areas, candidates by cost, the planned path and the list of the passed one, tracks."""
        if memory.light is None:
            return Drawing()
        areas = [(in_odometry(memory.pose, memory.light.light_ring()), "light")]
        areas += [(in_odometry(memory.pose, ring), "shadow") for ring in memory.light.shadow_rings()]
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


def turn_matrix(angle: float) -> F64:
    """The matrix (2, 2) by which points (m, 2) are multiplied to turn them by an angle [rad]: points @ matrix."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, sin], [-sin, cos]])


def in_odometry(pose: tuple[float, float, float], points: F64) -> F64:
    """Points (m, 2) of the robot's frame in the odometry frame [m]."""
    placed: F64 = points @ turn_matrix(pose[2]) + np.array(pose[:2])
    return placed


def direction_to(view: View, place: Point | F64) -> float:
    """Direction of a place (2,) of the odometry frame from the robot [rad]."""
    return math.atan2(place[1] - view.position[1], place[0] - view.position[0])


def velocity_along(bearing: float, speed: float) -> Velocity:
    """The velocity of a speed [m/s] along a bearing [rad]."""
    return speed * math.cos(bearing), speed * math.sin(bearing)
