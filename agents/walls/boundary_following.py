"""The toolbox of the Bug family: go straight until a wall, follow it at a clearance, remember where.

A bug walks on the *contour*: the line at distance `clearance` from the obstacles, where convex corners are arcs. Every
question is put to the swept free distance of a disc (View.free_distance), never to single beams. All positions are
kept in the odometry frame. Sides: +1 turns left at a wall and keeps it on the right, -1 is its mirror image.

Sources of the rules: Lumelsky and Stepanov (1987) for motion to goal and boundary following; McGuire et al. (2019) for
what a robot with a range sensor needs beyond a point with a contact sensor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from bug_gym.agents.scan import headings
from bug_gym.agents.scan.motion import has_moved
from bug_gym.geometry import Point, wrap
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

Turn = Literal["left", "right"]
LeaveRule = Literal["front", "any"]

SIDES: dict[str, int] = {"left": 1, "right": -1}
LEAVE_RULES = ("front", "any")
STANDING: Velocity = (0.0, 0.0)
WAIT = 10.0
"""Time without any open heading after which a robot calls itself stuck [s]; something that moves may go away before."""

TARGET_MOVED = 0.5
"""Way of the target after which distances and laps measured for its old place mean nothing [m]."""


def swept(travel: float, wall: float, heading: float, side: int) -> float:
    """Turning [rad] from a direction of travel to a heading found by turning away from a wall's bearing.

    In the end of a narrow wedge that is about half a turn, whose sense the two directions alone leave open. The wall
    lay at the side, so the way from the travel to its bearing is known, and the way from there is not wrapped.
    """
    to_wall = wrap(side * (travel - wall) - 0.5 * math.pi) + 0.5 * math.pi
    return side * (side * (heading - wall) - to_wall)


def is_ahead(travel: float, direction: float) -> bool:
    """Whether a direction [rad] lies within 90 degrees of the direction of travel [rad]."""
    return abs(wrap(direction - travel)) <= 0.5 * math.pi


def side_of(turn: str) -> int:
    """+1 for "left", -1 for "right".

    Raises:
        ValueError: another word.
    """
    if turn not in SIDES:
        raise ValueError(f"turn must be one of {sorted(SIDES)}, got {turn!r}")
    return SIDES[turn]


def checked_leave_rule(leave_rule: str) -> str:
    """The leave rule, "front" or "any".

    Raises:
        ValueError: another word.
    """
    if leave_rule not in LEAVE_RULES:
        raise ValueError(f"leave_rule must be one of {list(LEAVE_RULES)}, got {leave_rule!r}")
    return leave_rule


@dataclass(frozen=True)
class Gate:
    """A door across the contour: passing it once more in the same direction closes a lap.

    Proximity to a remembered point would fire several times a pass, and on the other side of a thin wall.
    """

    place: Point
    """Middle of the door, odometry frame [m]."""
    heading: float
    """Direction in which it was passed [rad]."""
    odometer: float
    """Length of the contour walked when it was placed [m]."""
    turned: float
    """Total turning when it was placed [rad]."""

    def is_passed(self, before: Point, after: Point, half_width: float, travel: float) -> bool:
        """Whether the step from `before` to `after` goes through the door in its direction.

        A door that stands right before a corner is passed in the turn: then the direction of travel [rad] of the step
        before counts.
        """
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        x0, y0 = before[0] - self.place[0], before[1] - self.place[1]
        x1, y1 = after[0] - self.place[0], after[1] - self.place[1]
        along0, along1 = cos * x0 + sin * y0, cos * x1 + sin * y1
        if not along0 < 0.0 <= along1:
            return False
        share = -along0 / (along1 - along0)
        lateral = cos * (y0 + share * (y1 - y0)) - sin * (x0 + share * (x1 - x0))
        return abs(lateral) <= half_width and (
            along1 - along0 > 0.5 * math.dist(before, after) or math.cos(travel - self.heading) > 0.5
        )


@dataclass(frozen=True)
class Mark:
    """A hit or leave point remembered with its wall: it is known again whichever way the boundary is walked."""

    place: Point
    """Odometry frame [m]."""
    wall: Point
    """The point of the wall that the hand was on, odometry frame [m]; across a corridor is another wall."""


@dataclass
class Contour:
    """What a bug keeps while it follows one boundary."""

    side: int
    """+1: the wall is on the right; -1: on the left."""
    hit: Point
    """Where it met the boundary, odometry frame [m]."""
    wall: Point
    """The point of the wall that the hand is on, odometry frame [m]."""
    position: Point
    """Own place at the last decision, odometry frame [m]."""
    goal: Point
    """Where the target was when the lap began, odometry frame [m]."""
    approach: float
    """Direction in which it came to the hit point, odometry frame [rad]."""
    before: Point = (0.0, 0.0)
    """Own place at the decision before, odometry frame [m]."""
    heading: float | None = None
    """Direction of the last step, odometry frame [rad]; None before the first."""
    heading_before: float = 0.0
    """Direction of the step before the last, odometry frame [rad]."""
    sweep: float = 0.0
    """Turning that the next step will add, more than half a turn in a narrow wedge [rad]."""
    odometer: float = 0.0
    """Length walked along the boundary [m]."""
    turned: float = 0.0
    """Total turning since the hit [rad]; a closed lap adds or takes 2 pi."""
    steps: int = 0
    """Steps with motion since the hit."""
    aligned: int = 0
    """Steps in a row on the contour without turning away from the wall."""
    gate: Gate | None = None
    """Door where the lap began; None until the robot goes along the wall."""
    is_lap_closed: bool = False
    """Whether the last step passed the gate, after a lap among still obstacles."""
    is_disturbed: bool = False
    """Whether something near has been seen to move in this lap, which proves nothing then."""
    waited: float = 0.0
    """Time without an open heading [s]."""


@dataclass
class BugMemory(Memory):
    """Memory of a bug: what it follows now, and where it hit and left boundaries."""

    contour: Contour | None = None
    """The boundary that it follows; None while it goes to the goal."""
    hits: list[Point] = field(default_factory=list)
    """Hit points, odometry frame [m]."""
    leaves: list[Point] = field(default_factory=list)
    """Leave points, odometry frame [m]."""
    hit_sides: list[int] = field(default_factory=list)
    """Side taken at each hit point."""
    hit_odometers: list[float] = field(default_factory=list)
    """Length of the whole way at each hit point [m]."""
    odometer: float = 0.0
    """Length of the way so far by odometry [m]."""
    position: Point | None = None
    """Own place at the last decision, odometry frame [m]."""
    glances: list[View] = field(default_factory=list)
    """Earlier observations, the oldest first, to see what has moved since."""
    glance_age: float = 0.0
    """How long ago the last one was [s]."""


@dataclass
class TurningMemory(BugMemory):
    """Memory of a bug that turns round, once on each boundary, where it meets an earlier hit or leave point."""

    marks: list[Mark] = field(default_factory=list)
    """Earlier hit and leave points; the present hit point is not among them."""
    trace: list[Point] = field(default_factory=list)
    """Way along the present boundary, from its hit point, odometry frame [m]."""
    start: Mark | None = None
    """The present hit point."""
    is_turning: bool = False
    """Whether it is on its way back to the hit point."""
    has_turned: bool = False
    """Whether it has turned round on this boundary."""


@dataclass
class Survey:
    """What a bug learns of a lap that offers no other place to leave: the nearest point to the goal, as in Bug1."""

    distance: float = math.inf
    """From that point to the goal [m]."""
    is_open: bool = False
    """Whether the goal lies away from the wall there."""
    next_wall: float = math.inf
    """Distance to the goal at the end of the free way from there straight toward it [m]; infinite without one."""
    before: float = math.inf
    """Distance to the goal at the last decision [m]."""
    is_second_lap: bool = False
    """Whether the lap is closed, and the robot on its way to that point."""
    gate: Gate | None = None
    """Where the lap began."""


class Boundary:
    """How a robot goes to walls, along them and away from them; the settings that all bugs share.

    Args:
        sensors: what a driver knows of the robot.
        clearance: distance from the robot's centre to a wall while following it [m]; None: the body's radius and the
            way of one step, which is how far a robot can be off its line.
        leave_rule: "front": a heading is free only within 90 degrees of the direction of travel, as a robot sees it
            that looks ahead; "any": a free heading in any direction counts.

    Raises:
        ValueError: a clearance not above the body's radius, or an unknown leave rule.
    """

    def __init__(self, sensors: Sensors, *, clearance: float | None = None, leave_rule: str = "front") -> None:
        radius, step = sensors.radius, sensors.step_length
        clearance = radius + step if clearance is None else clearance
        if not clearance > radius or not math.isfinite(clearance):
            raise ValueError(f"clearance must be above the body's radius of {radius} m, got {clearance!r}")
        self.sensors = sensors
        self.step = step
        self.clearance = clearance
        self.leave_rule = checked_leave_rule(leave_rule)
        margin = clearance - radius
        # The contour is kept at `clearance`, but a gap counts as one down to `inner`: a disc of exactly the gap's
        # width would pass it or not by the noise of a range.
        slack = min(0.1 * clearance, 0.5 * margin)
        self.inner = clearance - slack
        self.hit_radius = clearance - 1.5 * slack if 1.5 * slack < margin else self.inner
        self.safe_radius = radius + 0.3 * margin
        self.progress = max(2.0 * step, 0.05)
        """By how much "closer" must be closer [m]."""
        self.leave_length = max(1.5 * clearance, 4.0 * step)
        """Free way toward the goal that makes a heading free [m]."""
        self.gate_half_width = min(clearance, max(3.0 * step, 0.3 * clearance))
        self.arming_length = max(2.0 * clearance, 4.0 * self.gate_half_width)
        """Way after which a gate may fire [m]."""
        angles = sensors.angles
        self.beam_spacing = float(angles[1] - angles[0]) if len(angles) > 1 else 2.0 * math.pi
        """Angle between two neighbouring beams [rad]."""
        self.touch = max(0.05 * step, 2.0 * sensors.range_noise)
        """Remaining way at which a wall counts as reached [m]."""

    # ------------------------------------------------------------------------------------------ motion to goal

    def advance(self, view: View, memory: BugMemory) -> None:
        """Bring the memory's odometer, and its contour, up to the present. Call once a decision, first."""
        if self.sees_motion(view, memory) and memory.contour is not None:
            memory.contour.is_disturbed = True
        self.move_on(view, memory)

    def sees_motion(self, view: View, memory: BugMemory) -> bool:
        """Whether something near has moved since a while ago; it looks now and then."""
        memory.glance_age += self.sensors.drive.step
        if memory.glances and memory.glance_age < GLANCE:
            return False
        memory.glance_age = 0.0
        memory.glances.append(view)
        return len(memory.glances) > GLANCES and has_moved(memory.glances.pop(0), view, NEAR)

    def move_on(self, view: View, memory: BugMemory) -> None:
        """Bring the memory's odometer, and its contour, up to the present place."""
        if memory.position is not None:
            memory.odometer += math.dist(memory.position, view.position)
        memory.position = view.position
        if memory.contour is not None:
            self._advance_contour(view, memory.contour)

    def go(self, view: View, bearing: float, distance: float, *, radius: float | None = None) -> Velocity | None:
        """Velocity straight along a bearing, slowing down to stand on the contour of what is in the way.

        Args:
            view: the observation.
            bearing: where to [rad].
            distance: how far [m]; what lies beyond does not block.
            radius: of the disc that must not touch anything [m]; None: hit_radius.

        Returns:
            The velocity in the robot's frame [m/s], or None at the hit point: the way is blocked from here.
        """
        if distance <= 0.0:
            return STANDING
        ahead = min(self.step, distance, self.free_way(view, bearing, distance, radius=radius))
        if ahead <= 0.0:
            return None
        speed = ahead / self.sensors.drive.step
        return speed * math.cos(bearing), speed * math.sin(bearing)

    def free_way(self, view: View, bearing: float, distance: float, *, radius: float | None = None) -> float:
        """How far the robot can go along a bearing [rad] to stand on the contour of what is in the way [m].

        Zero where it stands there already; infinite where nothing is in the way up to `distance` [m].
        """
        radius = self.hit_radius if radius is None else radius
        free = view.free_distance(bearing, radius)
        if free >= distance or self.can_reach_goal(view, bearing, distance):
            return math.inf
        ahead = free - (self.clearance - radius)
        return ahead if ahead > self.touch else 0.0

    def certain_way(self, view: View, bearing: float) -> float:
        """How far the way along a bearing [rad] is free for certain [m]: corners may stand out between two beams."""
        x, y = view.points
        cos, sin = math.cos(bearing), math.sin(bearing)
        along, lateral = x * cos + y * sin, y * cos - x * sin
        radius = self.inner + self.beam_spacing * np.sqrt(x * x + y * y)
        room = radius * radius - lateral * lateral
        way = np.where((along > 0.0) & (room > 0.0), along - np.sqrt(np.maximum(room, 0.0)), math.inf)
        return min(max(float(way.min(initial=math.inf)), 0.0), self.sensors.range)

    def sees_goal(self, view: View, reach: float = math.inf) -> bool:
        """Whether the way to the goal is free as far as it, looking not farther than `reach` [m].

        A goal nearer to a wall than the clearance is seen where the way is free up to it.
        """
        bearing, distance = view.goal_bearing, view.goal_distance
        if distance > reach:
            return False
        free = self.certain_way(view, bearing)
        if free >= distance:
            return True
        if free < distance - 2.0 * self.clearance:
            return False
        return view.free_distance(bearing, self.safe_radius) >= distance - self.sensors.goal_radius

    def can_reach_goal(self, view: View, bearing: float, distance: float) -> bool:
        """Whether the body passes to a goal that lies nearer to a wall than the clearance; False for any other place."""
        is_goal = abs(distance - view.goal_distance) <= 1e-6
        if not is_goal or distance > 2.0 * self.clearance + self.sensors.goal_radius:
            return False
        return view.free_distance(bearing, self.safe_radius) >= distance - self.sensors.goal_radius

    def is_free(self, view: View, bearing: float, distance: float, contour: Contour | None = None) -> bool:
        """Whether the robot can head along a bearing [rad] toward a target at a distance [m].

        With a contour and the rule "front" the bearing must also lie within 90 degrees of the direction of travel.
        """
        travel = contour.heading if contour is not None and self.leave_rule == "front" else None
        if travel is not None and not is_ahead(travel, bearing + view.heading):
            return False
        if self.can_reach_goal(view, bearing, distance):
            return True
        return view.free_distance(bearing, self.inner) >= min(distance, self.leave_length)

    def points_away(self, view: View, bearing: float, contour: Contour) -> bool:
        """Whether a bearing [rad] points away from the wall that the hand is on.

        A way that is free of the followed obstacle, if only as far as the next one: algorithms that may leave at few
        places (on the M-line) take it, and hit the next one.
        """
        x, y = view.to_robot(*contour.wall)
        return math.cos(bearing - math.atan2(y, x)) < -0.1

    def may_go_on(self, view: View, contour: Contour) -> bool:
        """Whether a bug that may leave here does: toward the goal the way is free, or by the rule "any" begins to be."""
        if self.is_free(view, view.goal_bearing, view.goal_distance, contour):
            return True
        return self.leave_rule == "any" and self.points_away(view, view.goal_bearing, contour)

    def is_open(self, view: View, contour: Contour) -> bool:
        """The test of reachability: from a nearest point the goal lies straight away from the wall or behind it."""
        bearing = view.goal_bearing
        return self.points_away(view, bearing, contour) or self.can_reach_goal(view, bearing, view.goal_distance)

    # ------------------------------------------------------------------------------------------ boundary following

    def hit(self, view: View, memory: BugMemory, side: int, bearing: float) -> Contour:
        """Begin to follow the boundary that blocks a bearing [rad]; records the hit point."""
        contour = self.lay_hand(view, side, bearing)
        memory.contour = contour
        memory.hits.append(view.position)
        memory.hit_sides.append(side)
        memory.hit_odometers.append(memory.odometer)
        return contour

    def lay_hand(self, view: View, side: int, bearing: float) -> Contour:
        """A contour along the boundary that blocks a bearing [rad], which begins here."""
        wall = view.to_odometry(*self._blocking_point(view, bearing))
        approach = wrap(bearing + view.heading)
        return Contour(side, view.position, wall, view.position, view.goal_position, approach, view.position)

    def _blocking_point(self, view: View, bearing: float) -> Point:
        """The scan point that a disc going along a bearing [rad] touches first, in the robot's frame [m]."""
        x, y = view.points
        cos, sin = math.cos(bearing), math.sin(bearing)
        along, lateral = x * cos + y * sin, y * cos - x * sin
        room = self.clearance**2 - lateral**2
        way = np.where((along > 0.0) & (room > 0.0), along - np.sqrt(np.maximum(room, 0.0)), np.inf)
        if len(way) == 0 or not math.isfinite(way.min()):
            return self.clearance * cos, self.clearance * sin
        index = int(way.argmin())
        return float(x[index]), float(y[index])

    def leave(self, view: View, memory: BugMemory) -> None:
        """Stop following; records the leave point."""
        memory.leaves.append(view.position)
        memory.contour = None

    def _advance_contour(self, view: View, contour: Contour) -> None:
        """Odometer, turning and gate of a contour after the last step."""
        contour.is_lap_closed = False
        contour.before = contour.position
        length = math.dist(contour.position, view.position)
        if length < 1e-3 * self.step:
            return
        heading = math.atan2(view.position[1] - contour.position[1], view.position[0] - contour.position[0])
        contour.heading_before = heading if contour.heading is None else contour.heading
        change = contour.sweep + wrap(heading - contour.heading_before - contour.sweep)
        contour.sweep = 0.0
        contour.turned += change
        contour.odometer += length
        contour.position = view.position
        contour.heading = heading
        contour.steps += 1
        # Where the step began: the next lap may turn back in a dead end up to a step before where it ended.
        gate = Gate(contour.before, heading, contour.odometer - length, contour.turned)
        if contour.gate is None:
            # In a wedge the hit point lies deeper than a lap will lead, and next to a corner the way comes from behind.
            is_lap = view.nearest()[0] >= self.clearance - self.touch
            is_turning = contour.side * change > math.radians(10.0)
            contour.aligned = contour.aligned + 1 if is_lap and not is_turning else 0
            if contour.aligned > 2 or contour.steps > LONGEST_ALIGNING:
                contour.gate = gate
            return
        has_target_moved = math.dist(view.goal_position, contour.goal) > TARGET_MOVED
        is_closed = not has_target_moved and self.closes_lap(contour, contour.gate)
        if has_target_moved or (is_closed and contour.is_disturbed):
            contour.goal = view.goal_position
            contour.gate = gate
            contour.is_disturbed = False
            return
        contour.is_lap_closed = is_closed

    def closes_lap(self, contour: Contour, gate: Gate) -> bool:
        """Whether the last step passed a gate after a lap: far enough, in its direction, with a full turn made."""
        if contour.odometer - gate.odometer <= self.arming_length:
            return False
        if abs(contour.turned - gate.turned) < math.pi:
            return False  # a corridor walked back, or a wall met on its other side: no lap
        return gate.is_passed(contour.before, contour.position, self.gate_half_width, contour.heading_before)

    def follow(self, view: View, memory: BugMemory) -> Velocity:
        """Velocity of one step along the boundary, its end on the contour.

        The hand stays on the wall: from the bearing of the wall the heading turns away from it until a whole step is
        open. One rule for straight walls, convex and concave corners, dead ends and thin walls. A robot without any
        open heading waits, and calls itself stuck after WAIT seconds.
        """
        contour = memory.contour
        assert contour is not None
        bearing = self._wall_bearing(view, contour)
        # At the hit point it is along the wall: a gap just too narrow must not turn it away there either.
        along = bearing + contour.side * 0.5 * math.pi
        travel = along if contour.heading is None else contour.heading - view.heading
        heading = self._open_heading(view, bearing, contour.side, travel)
        if heading is None:
            contour.waited += self.sensors.drive.step
            if contour.waited > WAIT:
                memory.verdict = "stuck"
            return STANDING
        contour.waited = 0.0
        if contour.heading is not None:
            contour.sweep = swept(travel, bearing, heading, contour.side)
        self._move_hand(view, contour, heading)
        speed = self.sensors.drive.max_speed
        return speed * math.cos(heading), speed * math.sin(heading)

    def _wall_bearing(self, view: View, contour: Contour) -> float:
        """Bearing of the wall that the hand is on, looked up in the present scan."""
        x, y = view.to_robot(*contour.wall)
        last = math.atan2(y, x)
        # Wider windows only where the wall went out of sight: a nearer wall on the other side must not take the hand.
        for window in (math.radians(45.0), math.radians(120.0), math.pi):
            distance, bearing = view.nearest(last, window)
            if math.isfinite(distance):
                contour.wall = view.to_odometry(distance * math.cos(bearing), distance * math.sin(bearing))
                return bearing
        return last

    def _move_hand(self, view: View, contour: Contour, heading: float) -> None:
        """Lay the hand on the point that forbids a step nearer to the wall than `heading` [rad].

        In a concave corner that is the next wall already, in a corridor never the wall across.
        """
        x, y = view.points
        if len(x) == 0:
            return
        inward = heading - contour.side * TRIED
        square = (x - self.step * math.cos(inward)) ** 2 + (y - self.step * math.sin(inward)) ** 2
        index = int(square.argmin())
        if square[index] <= self.clearance**2:
            contour.wall = view.to_odometry(float(x[index]), float(y[index]))

    def _open_heading(self, view: View, wall_bearing: float, side: int, travel: float) -> float | None:
        """First heading away from the wall along which a step ends on the contour; None: boxed in.

        A gap narrower than twice the clearance would turn the robot back by the noise of a range; it goes on through
        the middle where the gap is wider than twice `inner`.
        """
        turned = self._turn_from(view, wall_bearing, side, self.clearance)
        if turned is None or abs(wrap(turned - travel)) > TURNED_ASIDE:
            inner = self._turn_from(view, wall_bearing, side, self.inner)
            if inner is not None and self._is_gap(view, travel, turned, inner, side):
                angles = self._through(inner, side)
                gaps = [headings.gap_after_step(*view.points, angle, self.step) for angle in angles]
                return float(angles[max(range(9), key=gaps.__getitem__)])
        if turned is None:
            # Nearer to things than the contour, by more than a step: any step that gains distance will do.
            nearest, _ = view.nearest()
            turned = self._turn_from(view, wall_bearing, side, nearest + 0.5 * self.step)
            if turned is None:
                # In the wide place of a blind gap: back out as it came in.
                turned = self._turn_from(view, wall_bearing, side, self.inner)
            if turned is None:
                turned = self._widest_heading(view, wall_bearing, side, nearest)
        return turned

    def _through(self, inner: float, side: int) -> list[float]:
        """Bearings among which that of the middle of a narrow gap is, from the first open one on [rad]."""
        return [inner + side * share * OUTWARD / 8.0 for share in range(9)]

    def _is_gap(self, view: View, travel: float, turned: float | None, inner: float, side: int) -> bool:
        """Whether a gap that is just too narrow, and no corner, turns the robot away from the bearing `inner`."""
        if abs(wrap(inner - travel)) >= 0.5 * math.pi:
            return False
        if turned is None or abs(wrap(turned - travel)) > TURNED_BACK:
            return True
        if abs(wrap(turned - inner)) <= TURNED_ASIDE:
            return False
        return any(view.free_distance(way, self.safe_radius) >= self.leave_length for way in self._through(inner, side))

    def _widest_heading(self, view: View, wall_bearing: float, side: int, nearest: float) -> float | None:
        """Bearing along which a step ends furthest from everything; None: no further than `nearest` [m], here.

        Out of a gap that narrows by so little that no single step gains much.
        """
        x, y = view.points
        bearings = wall_bearing + side * np.arange(0.0, 2.0 * math.pi, TRIED)
        is_open = view.free_distances(bearings, self.safe_radius) >= self.step
        gaps = [headings.gap_after_step(x, y, bearing, self.step) for bearing in bearings]
        index = int(np.where(is_open, gaps, 0.0).argmax())
        return float(bearings[index]) if is_open[index] and gaps[index] > nearest else None

    def _turn_from(self, view: View, wall_bearing: float, side: int, clearance: float) -> float | None:
        """First bearing, turning away from the wall, along which a step ends at a clearance [m]; None: none does."""
        x, y = view.points
        turned = headings.first_open_heading(x, y, wall_bearing, side, self.step, clearance, self.safe_radius, TRIED)
        return None if turned < 0.0 else float(wall_bearing + side * turned)

    def survey(
        self, view: View, contour: Contour, survey: Survey, hit_distance: float
    ) -> Literal["", "leave", "unreachable"]:
        """The last resort of bugs with a range sensor: to leave straight from the nearest point of a lap, as Bug1 does.

        A lap without any place to leave means that there is no way. But a scan may take two obstacles for one, or an
        obstacle may stand so near to the next that no leave point is seen: the nearest point tells for sure. There the
        goal lies away from the wall, unless the obstacle shuts the goal or the robot in. In an acute corner one of two
        walls may let it pass for open; then the lap that begins there finds no place nearer.

        Args:
            view: the observation.
            contour: the boundary followed.
            survey: what is known of the lap, changed in place.
            hit_distance: distance to the goal at the hit point [m]; to leave, the nearest point must be nearer.

        Returns:
            "leave": leave straight toward the goal, now; "unreachable": two laps or one have shown that there is no
            way; "": go on.
        """
        if survey.gate is not contour.gate:  # something moved, and the lap begins anew
            survey.gate, survey.distance, survey.is_second_lap = contour.gate, math.inf, False
        distance, before = view.goal_distance, survey.before
        survey.before = distance
        is_there = survey.is_second_lap and before <= distance <= survey.distance + 0.5 * self.step
        if is_there and self.free_way(view, view.goal_bearing, distance) > 0.0:
            return "leave"
        if contour.is_lap_closed:
            is_nearer = survey.distance < hit_distance - CLOSER * self.step
            if survey.is_second_lap or not (survey.is_open and is_nearer):
                return "unreachable"
            survey.is_second_lap = True
        elif distance < survey.distance and contour.gate is not None and not survey.is_second_lap:
            survey.distance, survey.is_open = distance, self.is_open(view, contour)
            way = self.free_way(view, view.goal_bearing, distance)
            survey.next_wall = distance - way if way > 0.0 else math.inf
        return ""

    # ------------------------------------------------------------------------------------------ what a bug remembers

    def is_looping(self, memory: BugMemory) -> bool:
        """Whether the last hit repeats earlier ones, side included: the third time at the same place."""
        *earlier, (place, side, odometer) = zip(memory.hits, memory.hit_sides, memory.hit_odometers, strict=True)
        matches = 0
        for other, other_side, other_odometer in earlier:
            is_same = other_side == side and math.dist(other, place) <= self.gate_half_width
            matches += is_same and odometer - other_odometer > self.arming_length
        return matches >= 2

    def is_at(self, mark: Mark, place: Point, wall: Point) -> bool:
        """Whether a place on a boundary, with the wall's point beside it, is a remembered one."""
        is_near = math.dist(mark.place, place) <= self.gate_half_width
        return is_near and math.dist(mark.wall, wall) <= 1.5 * self.clearance

    def passes(self, contour: Contour, mark: Mark) -> bool:
        """Whether the last step passed a remembered place, in either direction: it was near and goes away again."""
        if contour.odometer <= 2.0 * self.gate_half_width or contour.before == contour.position:
            return False
        is_near = self.is_at(mark, contour.before, contour.wall)
        return is_near and math.dist(mark.place, contour.position) > math.dist(mark.place, contour.before)

    # ------------------------------------------------------------------------------------------ turning round once

    def hit_and_trace(self, view: View, memory: TurningMemory, side: int, bearing: float) -> None:
        """`hit`, and begin a trace; the hit point before becomes an earlier one."""
        if memory.start is not None:
            memory.marks.append(memory.start)
        contour = self.hit(view, memory, side, bearing)
        memory.start = Mark(contour.hit, contour.wall)
        memory.trace = [view.position]
        memory.is_turning = memory.has_turned = False

    def leave_and_mark(self, view: View, memory: TurningMemory) -> None:
        """`leave`, and remember the leave point."""
        assert memory.contour is not None
        memory.marks.append(Mark(view.position, memory.contour.wall))
        self.leave(view, memory)

    def forget_marks(self, memory: TurningMemory) -> None:
        """Nothing met before means anything any more, because the target has moved."""
        memory.marks.clear()
        memory.is_turning = memory.has_turned = False

    def trace_contour(self, view: View, memory: TurningMemory) -> None:
        """Add the present place to the trace; turn round where the robot passes an earlier hit or leave point."""
        contour = memory.contour
        assert contour is not None
        memory.trace.append(view.position)
        if not memory.has_turned and any(self.passes(contour, mark) for mark in memory.marks):
            memory.is_turning = memory.has_turned = True

    def walk_back(self, view: View, memory: TurningMemory) -> Velocity | None:
        """Velocity back along the trace; None at its beginning, where the other hand takes the wall.

        Where something has moved into the way the other hand takes over at once: it leads to the same hit point.
        """
        trace = memory.trace
        while len(trace) > 1 and math.dist(trace[-2], view.position) <= 1.01 * self.step:
            trace.pop()  # the furthest place that one step reaches
        if trace and math.dist(trace[-1], view.position) <= 0.5 * self.step:
            trace.pop()
        velocity = self._go_to(view, trace[-1]) if trace else None
        if velocity is None:
            self._change_hands(view, memory)
        return velocity

    def _go_to(self, view: View, place: Point) -> Velocity | None:
        """Velocity straight to a place at most a few steps away; None where the way is blocked."""
        x, y = view.to_robot(*place)
        ahead, bearing = min(self.step, math.hypot(x, y)), math.atan2(y, x)
        if view.free_distance(bearing, self.safe_radius) < ahead:
            return None
        speed = ahead / self.sensors.drive.step
        return speed * math.cos(bearing), speed * math.sin(bearing)

    def _change_hands(self, view: View, memory: TurningMemory) -> None:
        """Go on along the present boundary the other way, on a lap of its own."""
        last = memory.contour
        assert last is not None and memory.start is not None
        wall, travel = memory.start.wall, last.approach
        if memory.trace:
            distance, bearing = view.nearest()
            wall = view.to_odometry(distance * math.cos(bearing), distance * math.sin(bearing))
            travel = travel if last.heading is None else last.heading
        memory.trace = []
        memory.is_turning = False
        memory.contour = Contour(-last.side, last.hit, wall, view.position, view.goal_position, travel, view.position)

    def draw(self, memory: BugMemory) -> Drawing:
        """Hit and leave points, and the wall that the hand is on."""
        points = [(*place, "hit") for place in memory.hits] + [(*place, "leave") for place in memory.leaves]
        if memory.contour is not None:
            points.append((*memory.contour.wall, "wall"))
        return Drawing(points=points)


TRIED = math.radians(3.0)
"""Angle between the headings that boundary following tries [rad]; the first open one is refined."""

CLOSER = 0.1
"""How much nearer to the goal than a hit point is nearer, in steps."""

GLANCE = 0.5
"""How often a robot compares its scan with an earlier one [s]."""

GLANCES = 4
"""How many glances earlier: after 2 s a mover at 0.1 m/s has left the noise behind."""

NEAR = 3.0
"""How far from a robot what moves makes its lap worthless [m]."""

LONGEST_ALIGNING = 10
"""Steps after which a lap begins where the robot is, aligned with the wall or not."""

OUTWARD = math.radians(45.0)
"""How far from the wall's side a robot looks for the middle of a narrow gap [rad]."""

TURNED_ASIDE = math.radians(60.0)
"""Change of direction of a corner, or of a gap that is just too narrow: through a gap the way goes on [rad]."""

TURNED_BACK = math.radians(105.0)
"""Change of direction beyond that of a right-angled corner: it may be a gap that is just too narrow [rad]."""


def alternating_side(memory: BugMemory, first: int) -> int:
    """Side for the next hit point of a bug that changes sides at each: the first one's, the other, and so on."""
    return first if len(memory.hits) % 2 == 0 else -first


class BoundaryBug(ScriptedPolicy):
    """What bugs that follow walls with a hand share: their settings, and what they show of their memory.

    Args:
        sensors: what a driver knows of the robot.
        clearance: centre to wall while following [m]; None: body radius and one step.
        turn: which way to turn at a wall; of a bug that changes sides, at the first one.
        leave_rule: "front" or "any", see Boundary.
        discrete: whether actions are numbers of the discrete table.

    Raises:
        ValueError: a clearance not above the radius, an unknown turn or rule.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        turn: Turn = "left",
        leave_rule: LeaveRule = "front",
        discrete: bool = False,
    ) -> None:
        super().__init__(sensors, discrete=discrete)
        self.boundary = Boundary(sensors, clearance=clearance, leave_rule=leave_rule)
        self.side = side_of(turn)

    def draw(self, memory: Any) -> Drawing:
        """Hit and leave points, and the wall that the hand is on."""
        return self.boundary.draw(memory)
