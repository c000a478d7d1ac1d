"""What VisBug-21 and VisBug-22 share: Bug2 walks ahead in the robot's mind, as far as the robot sees.

Source: Lumelsky and Skewis (1990), the procedure "compute T_i". The *scout* stands at the intermediate target T_i and
holds the registers of Bug2 there. It walks Bug2's path, M-line and contour, step by step over the present scan, and
stops where the robot can no longer see it; the robot goes straight toward it. So the path that counts is Bug2's,
whichever short cuts the robot takes, and with a vision range no wider than the clearance the robot is Bug2.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any

from bug_gym.agents.scan.way_in import is_goal_by_wall
from bug_gym.agents.walls.boundary import FRESH_STARTS, Boundary, side_of
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory, Contour, copied
from bug_gym.agents.walls.laps import is_proof
from bug_gym.agents.walls.m_line import (
    ON_LINE,
    MLine,
    MLineMemory,
    MLineParameters,
    go_along,
    nearer_crossing,
)
from bug_gym.agents.walls.thinning import ThinningPolicy
from bug_gym.agents.walls.visibility import NEAR, Scan
from bug_gym.geometry import Point, velocity_along
from bug_gym.policy import STANDING, Drawing, Velocity
from bug_gym.view import Sensors, View

MOST_STEPS = 200
"""Steps that the scout takes in one decision at most; it goes on in the next one."""


@dataclass
class Scout(MLineMemory):
    """Bug2 at the intermediate target T_i. One is never changed: a step makes a new one."""

    hit_distance: float = math.inf
    """Distance from the last hit point H to the goal [m]."""
    crossing_distance: float = math.inf
    """Distance from X, the last crossing of M-line and boundary, to the goal [m]."""

    def copy(self) -> Scout:
        """One that can be changed."""
        lists = self.hits[:], self.leaves[:], self.hit_sides[:], self.hit_odometers[:]
        other = copied(self)
        other.hits, other.leaves, other.hit_sides, other.hit_odometers = lists
        other.contour = None if self.contour is None else copied(self.contour)
        return other

    @property
    def place(self) -> Point:
        """T_i, odometry frame [m]."""
        assert self.position is not None
        return self.position

    @property
    def m_line(self) -> MLine:
        """The M-line."""
        assert self.line is not None
        return self.line


@dataclass
class VisionMemory(BugMemory):
    """Memory of a bug that looks ahead. Hit and leave points are the scout's."""

    trail: list[Scout] = field(default_factory=list)
    """The scout and where it came from, step by step, since the robot last stood at it."""
    way: list[Point] = field(default_factory=list)
    """The robot's own places since then, odometry frame [m]."""
    is_goal_seen: bool = False
    """Whether T_i is the goal itself."""
    seen_distance: float = math.inf
    """Distance to the goal where it came in sight [m]."""
    blind_until: float = 0.0
    """The scout's odometer up to which it walks right before the robot, since it was lost from sight there [m]."""
    restart_distance: float = math.inf
    """Distance to the goal where the M-line was last drawn anew [m]."""

    @property
    def scout(self) -> Scout:
        """The scout at T_i."""
        return self.trail[-1]


@dataclass(frozen=True)
class VisBugParameters(MLineParameters):
    """Parameters of VisBugs."""

    vision_range: float | None = None
    """How far the robot looks, at most the LIDAR's range [m]; None: that."""


class Vision:
    """The scout and the robot that goes after it.

    Args:
        sensors: what a driver knows of the robot.
        parameters: of its VisBug.
        foresees: see Boundary.

    Raises:
        ValueError: a clearance not above the radius, an unknown turn or rule, a vision range below the clearance.
    """

    def __init__(self, sensors: Sensors, parameters: VisBugParameters, *, foresees: bool) -> None:
        own = parameters
        self.boundary = Boundary(sensors, clearance=own.clearance, leave_rule=own.leave_rule, foresees=foresees)
        self.boundary.require_corners()
        self.boundary.fresh_starts = FRESH_STARTS
        self.room = self.boundary.safe_radius - sensors.radius
        self.side = side_of(parameters.turn)
        vision_range = parameters.vision_range
        reach = sensors.range if vision_range is None else vision_range
        if not reach >= self.boundary.clearance:
            raise ValueError(
                f"vision_range must be at least the clearance of {self.boundary.clearance} m, got {vision_range!r}"
            )
        self.reach = min(reach, sensors.range)
        self.on_line = ON_LINE * self.boundary.step

    # ------------------------------------------------------------------------------------------------- what is seen now

    def look(self, view: View, memory: VisionMemory) -> Scan:
        """The present scan, with the memory brought up to it. Call once a decision, first."""
        boundary, scan = self.boundary, Scan(view, self.boundary)
        boundary.move_on(view, memory)
        if not memory.trail:
            self._begin(view, memory)
        if boundary.sees_motion(view, memory):
            self._disturb(memory)
        self._follow_target(view, memory)
        if math.dist(view.position, memory.scout.place) <= boundary.step:
            memory.trail = [memory.scout]
            memory.way = []
        elif not (memory.is_goal_seen or scan.is_open(memory.scout.place)):
            self._drop_hidden(scan, memory)
        return scan

    def _begin(self, view: View, memory: VisionMemory) -> None:
        """Draw the M-line from here; the scout stands where the robot is."""
        before = memory.scout if memory.trail else Scout()
        scout = Scout(
            hits=before.hits,
            leaves=before.leaves,
            hit_sides=before.hit_sides,
            hit_odometers=before.hit_odometers,
            odometer=before.odometer,
            position=view.position,
            line=MLine(view.position, view.goal_position),
        )
        memory.trail = [scout]
        memory.way = []
        memory.blind_until = 0.0
        memory.restart_distance = view.goal_distance

    def _disturb(self, memory: VisionMemory) -> None:
        """Something near has moved: the lap on which the scout is proves nothing, wherever on it the scout stands."""
        memory.trail = [scout.copy() for scout in memory.trail]
        for scout in memory.trail:
            if scout.contour is not None:
                scout.contour.is_disturbed = True

    def _follow_target(self, view: View, memory: VisionMemory) -> None:
        """Draw the M-line anew where the target has moved away from its end."""
        scout, goal = memory.scout, view.goal_position
        is_at_end = math.dist(scout.place, scout.m_line.goal) <= 0.5 * self.boundary.step
        moved = math.dist(scout.m_line.goal, goal)
        if moved <= TARGET_MOVED and not (is_at_end and moved > self.boundary.step):
            return
        if scout.contour is None:
            self._begin(view, memory)
            return
        distance = math.dist(scout.place, goal)
        scout = copied(scout)
        scout.line, scout.hit_distance, scout.crossing_distance = MLine(scout.place, goal), distance, distance
        memory.trail[-1] = scout
        memory.restart_distance = math.inf

    def _drop_hidden(self, scan: Scan, memory: VisionMemory) -> None:
        """Take the scout back to where the robot can go; where that is nowhere, begin anew from here if that is nearer."""
        if not self._call_back(scan, memory):
            self._begin_nearer(scan.view, memory)

    def _call_back(self, scan: Scan, memory: VisionMemory) -> bool:
        """Take the scout back to where the robot can go; from there it walks right before the robot for a while.

        Returns:
            Whether there is such a place.
        """
        lost = memory.scout.odometer
        while len(memory.trail) > 1 and not scan.is_open(memory.scout.place):
            memory.trail.pop()
        memory.blind_until = max(memory.blind_until, lost)
        return scan.is_open(memory.scout.place)

    def _begin_nearer(self, view: View, memory: VisionMemory) -> bool:
        """Begin anew from here, if this is nearer to the goal than where that happened last."""
        if view.goal_distance >= memory.restart_distance - self.boundary.progress:
            return False
        self._begin(view, memory)
        return True

    # ------------------------------------------------------------------------------------------------------ compute T_i

    def sees_goal(self, scan: Scan, memory: VisionMemory) -> bool:
        """Step 1: whether the goal itself is T_i."""
        view = scan.view
        if memory.is_goal_seen:
            memory.is_goal_seen = scan.is_open(view.goal_position) or self._can_reach(view)
            if not memory.is_goal_seen:
                self._lose_goal(scan, memory)
        elif view.goal_distance <= self.reach and not self._is_blind(memory):
            memory.is_goal_seen = scan.sees_surely(view.goal_position, self.reach) or self._can_reach(view)
            memory.seen_distance = view.goal_distance
        return memory.is_goal_seen

    def _can_reach(self, view: View) -> bool:
        """Whether the way is open to a goal that lies nearer to a wall than the clearance."""
        return self.boundary.can_reach_goal(view, view.goal_bearing, view.goal_distance)

    def _lose_goal(self, scan: Scan, memory: VisionMemory) -> None:
        """The goal went out of sight on the way to it: go back to the scout, or begin anew from here."""
        view = scan.view
        is_near = view.goal_distance > memory.seen_distance - self.boundary.leave_length
        if is_near and scan.is_open(memory.scout.place) or not self._begin_nearer(view, memory):
            memory.blind_until = memory.scout.odometer + self.boundary.leave_length

    def _is_blind(self, memory: VisionMemory) -> bool:
        """Whether the scout must not go further than one step before the robot."""
        return memory.scout.odometer < memory.blind_until

    def walk_ahead(self, scan: Scan, memory: VisionMemory) -> None:
        """Steps 2 and 3: the scout walks Bug2's path to the end of what is visible of it."""
        view, step = scan.view, self.boundary.step
        for _ in range(MOST_STEPS):
            scout = memory.scout
            if math.dist(scout.place, view.goal_position) <= self.boundary.sensors.goal_radius - self.on_line:
                return  # Bug2 has arrived there
            ahead = self._step(scan, scout)
            memory.verdict = ahead.verdict
            gap = math.dist(view.position, scout.place)
            if ahead.verdict or math.dist(ahead.place, scout.place) < 1e-3 * step:
                if gap <= step:
                    memory.trail[-1] = ahead  # boxed in, and it counts how long
                return
            if gap > step:
                if self._is_blind(memory) or not self._is_visible(scan, ahead):
                    return
            elif gap > self.on_line and not scan.is_open(ahead.place):
                return
            memory.trail.append(ahead)

    def _is_visible(self, scan: Scan, scout: Scout) -> bool:
        """Whether the scout's place is visible, and the wall that its hand is on."""
        boundary, contour = self.boundary, scout.contour
        if self._may_end_by_wall(scan, scout):
            return False
        if contour is not None and math.dist(scout.place, contour.wall) > boundary.clearance + boundary.step:
            return False
        return scan.sees(scout.place, self.reach - boundary.clearance)

    def _may_end_by_wall(self, scan: Scan, scout: Scout) -> bool:
        """Whether the scout is near a goal at which the body does not fit: it walks right before the robot there.

        How near to the goal the body comes shows from near by alone: far away the lines between points cut corners.
        """
        if math.dist(scout.place, scan.view.goal_position) > self.boundary.exact_length:
            return False
        return is_goal_by_wall(scan.seen_from(scout.place))

    def _step(self, scan: Scan, scout: Scout) -> Scout:
        """The scout one step further on Bug2's path."""
        boundary = self.boundary
        view, ahead = scan.seen_from(scout.place), scout.copy()
        contour = ahead.contour
        if ahead.is_fresh:
            ahead.line, ahead.is_fresh = MLine(scout.place, ahead.m_line.goal), False
            ahead.hit_distance = ahead.crossing_distance = math.inf
        if contour is not None:
            if self._may_leave(view, ahead, contour):
                boundary.leave(view, ahead)
            elif is_proof(contour):
                ahead.verdict = "unreachable"
                return ahead
        velocity = go_along(boundary, view, ahead.m_line) if ahead.contour is None else None
        if velocity is None:
            if ahead.contour is None:
                boundary.hit(view, ahead, self.side, view.goal_bearing)
                distance = math.dist(view.position, ahead.m_line.goal)
                ahead.hit_distance = ahead.crossing_distance = min(distance, ahead.crossing_distance)
            velocity = boundary.follow(view, ahead)
        drive = view.sensors.drive
        boundary.move_on(scan.seen_from(view.to_odometry(velocity[0] * drive.step, velocity[1] * drive.step)), ahead)
        return ahead

    def _may_leave(self, view: View, scout: Scout, contour: Contour) -> bool:
        """Whether the last step crossed the M-line nearer to the goal than the hit point, with a free way on."""
        distance = nearer_crossing(self.boundary, view, contour, scout.m_line, scout.hit_distance)
        if distance is None:
            return False
        scout.crossing_distance = distance
        return self.boundary.may_go_on(view, contour)

    def jump(self, scan: Scan, memory: VisionMemory, reference: float) -> bool:
        """Step 4: T_i is the visible point of the M-line nearest to the goal, if any is nearer than `reference` [m].

        Returns:
            Whether it is.
        """
        if memory.verdict or self._is_blind(memory):
            return False
        scout, stride = memory.scout, self.boundary.step
        place = scan.first_visible(
            scout.m_line, stride, int(reference / stride) - 1, self.reach - self.boundary.clearance
        )
        if place is None:
            return False
        view, ahead = scan.seen_from(place), scout.copy()
        if ahead.contour is not None:
            self.boundary.leave(view, ahead)
        self.boundary.move_on(view, ahead)
        memory.trail.append(ahead)
        return True

    # ---------------------------------------------------------------------------------------------------- motion to T_i

    def move(self, scan: Scan, memory: VisionMemory) -> Velocity:
        """Velocity straight toward T_i; back on the own way while T_i is hidden."""
        view, scout = scan.view, memory.scout
        memory.hits, memory.hit_sides, memory.hit_odometers = scout.hits, scout.hit_sides, scout.hit_odometers
        memory.leaves = scout.leaves
        gap = math.dist(view.position, scout.place)
        memory.mode = "motion_to_goal"
        if not memory.is_goal_seen and scout.contour is not None:
            memory.mode = "boundary_following" if gap <= NEAR * self.boundary.step else "motion_to_sub_goal"
        if memory.is_goal_seen:
            inward = self.boundary.way_in(view, view.goal_distance)
            target = view.goal_position if inward is None else view.to_odometry(*velocity_along(*inward))
        elif scan.is_open(scout.place):
            target = scout.place
        else:
            return self._go_back(scan, memory)
        memory.way.append(view.position)
        return self._go_straight(view, target)

    def _go_back(self, scan: Scan, memory: VisionMemory) -> Velocity:
        """Velocity on the own way back to where the scout was last visible; where that is blocked, begin anew."""
        view, way = scan.view, memory.way
        while way and math.dist(way[-1], view.position) <= 0.5 * self.boundary.step:
            way.pop()
        if way and scan.is_open(way[-1]):
            return self._go_straight(view, way[-1])
        if not way and self._call_back(scan, memory):  # it went where there was a view, but no way for the body
            return self._go_straight(view, memory.scout.place)
        self._begin(view, memory)
        return STANDING

    def _go_straight(self, view: View, place: Point) -> Velocity:
        x, y = view.to_robot(*place)
        distance = math.hypot(x, y)
        if distance == 0.0:
            return STANDING
        share = min(distance, self.boundary.step) / (distance * view.sensors.drive.step)
        return x * share, y * share

    def draw(self, memory: VisionMemory) -> Drawing:
        """Hit and leave points, the M-line, T_i and the way to it."""
        drawing = self.boundary.draw(memory)
        if not memory.trail:
            return drawing
        scout = memory.scout
        start, goal = scout.m_line.start, scout.m_line.goal
        target = goal if memory.is_goal_seen else scout.place
        segments = [(*start, *goal, "m_line")]
        if memory.position is not None:
            segments.append((*memory.position, *target, "plan"))
        return Drawing(points=[*drawing.points, (*target, "target")], segments=segments)


class VisBug(ThinningPolicy):
    """VisBug but for the places on the M-line that it takes in step 4.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a clearance not above the radius, an unknown turn or rule, a vision range below the clearance.
    """

    Parameters = VisBugParameters
    parameters: VisBugParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.vision = Vision(sensors, self.parameters, foresees=self.foresees)

    @property
    def kept(self) -> Boundary:
        """How the scout keeps to walls."""
        return self.vision.boundary

    def starts(self, memory: VisionMemory) -> int:
        """How often the scout has begun anew."""
        return memory.scout.fresh_starts if memory.trail else 0

    def start(self) -> VisionMemory:
        """Memory of a new episode."""
        return VisionMemory(mode="motion_to_goal")

    def act(self, view: View, memory: VisionMemory) -> Velocity:
        """One decision."""
        vision = self.vision
        scan = vision.look(view, memory)
        if not vision.sees_goal(scan, memory):
            vision.walk_ahead(scan, memory)
            while vision.jump(scan, memory, self.reference(view, memory.scout)):
                vision.walk_ahead(scan, memory)
        return vision.move(scan, memory)

    @abstractmethod
    def reference(self, view: View, scout: Scout) -> float:
        """How near to the goal [m] a visible place on the M-line must be to be taken for T_i."""

    def draw(self, memory: VisionMemory) -> Drawing:
        """Hit and leave points, the M-line and T_i."""
        return self.vision.draw(memory)
