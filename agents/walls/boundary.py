"""How a robot goes straight until a wall, follows it at a clearance and leaves it: what all bugs do.

Every question is put to the swept free distance of a disc (View.free_distance), never to single beams.

Sources of the rules: Lumelsky and Stepanov (1987) for motion to goal and boundary following; McGuire et al. (2019) for
what a robot with a range sensor needs beyond a point with a contact sensor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from bug_gym.agents.scan.motion import has_moved
from bug_gym.agents.scan.way_in import is_goal_by_wall, way_in
from bug_gym.agents.walls.contour import BugMemory, Contour
from bug_gym.agents.walls.headings import TRIED, OpenHeadings
from bug_gym.agents.walls.laps import Laps
from bug_gym.agents.walls.rounding import Rounding
from bug_gym.geometry import Point, velocity_along, wrap
from bug_gym.inertia import needs_care, speed_within, stopping_radius
from bug_gym.policy import STANDING, Drawing, MisfitError, Velocity, braking_radius
from bug_gym.steering import look_ahead
from bug_gym.view import Sensors, View

Turn = Literal["left", "right"]
LeaveRule = Literal["front", "any"]

SIDES: dict[str, int] = {"left": 1, "right": -1}
LEAVE_RULES = ("front", "any")

SideAfter = Callable[[float], int]
"""The side to turn to at a wall after so much more way [m]."""

FirstHeading = Callable[[View, Contour, float, float], "float | None"]
"""Where to go along a wall [rad], not wrapped, given the bearing of the hand on it and of the travel [rad]; None: boxed
in."""

WAIT = 10.0
"""Time without any open heading after which a robot calls itself stuck [s]; something that moves may go away before."""

GLANCE = 0.5
"""How often a robot compares its scan with an earlier one [s]."""

GLANCES = 4
"""How many glances earlier: after 2 s a mover at 0.1 m/s has left the noise behind."""

SLACK = 0.1
"""By how much a gap may be narrower than the clearance on both sides, in clearances."""

HIT_SLACKS = 1.5
"""By how much the disc that goes straight to the goal is smaller than that of the clearance, in such slacks."""

BESIDE_BRAKE = 1e-3
"""How much more than its brake asks for a robot wants beside it on the way to the goal [m]."""

SAFE_SHARE = 0.3
"""How much of what a robot keeps from walls the body needs where it comes nearer to them."""

SHORT = 0.01
"""How far short of its contour a wall must not make a robot stand [m]."""

FRESH_STARTS = 3
"""How often bugs begin anew that can."""

NEAR = 3.0
"""How far from a robot what moves makes its lap worthless [m]."""


def default_margin(sensors: Sensors) -> float:
    """What a robot keeps from walls beside its body unless it is told [m].

    The way of one step, which is how far it can be off its line; and no less than the way before a wall at which `brake`
    makes a differential robot stand: it would stand there for ever, short of its contour.
    """
    stands = 2.0 * (braking_radius(sensors) - sensors.radius)
    return max(sensors.step_length, stands + SHORT if stands > 0.0 else 0.0)


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


class Boundary:
    """How a robot goes to walls, along them and away from them; the settings that all bugs share.

    Args:
        sensors: what a driver knows of the robot.
        clearance: distance from the robot's centre to a wall while following it [m]; None: the body's radius and
            `default_margin`.
        leave_rule: "front": a heading is free only within 90 degrees of the direction of travel, as a robot sees it
            that looks ahead; "any": a free heading in any direction counts.
        foresees: whether what it is shown is what the robot sees when its command acts.

    Raises:
        ValueError: a clearance not above the body's radius, or an unknown leave rule.
        MisfitError: a scanner that does not see walls at the clearance, or not as far as a way must be free to be gone.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        leave_rule: str = "front",
        foresees: bool = False,
    ) -> None:
        radius, step = sensors.radius, sensors.step_length
        clearance = radius + default_margin(sensors) if clearance is None else clearance
        if not clearance > radius or not math.isfinite(clearance):
            raise ValueError(f"clearance must be above the body's radius of {radius} m, got {clearance!r}")
        self.sensors = sensors
        self.drive = replace(sensors.drive, latency=0)
        """How its commands act after what it is shown: at once, where it is shown what the robot sees when they act."""
        self.step = step
        """The way of one step [m]."""
        self.pace = speed_within(self.drive, step)
        """Speed along walls [m/s]: a robot with inertia can stop within the step that it looks ahead, a late one that decides
        by what it sees now within what it keeps from walls, if that is less."""
        self.clearance = clearance
        if not foresees:
            self.decide_late()
        self.leave_rule = checked_leave_rule(leave_rule)
        margin = clearance - radius
        # The contour is kept at `clearance`, but a gap counts as one down to `inner`: a disc of exactly the gap's
        # width would pass it or not by the noise of a range.
        slack = min(SLACK * clearance, 0.5 * margin)
        self.inner = clearance - slack
        """Radius of the disc that must pass for a gap to be one [m]."""
        self.safe_radius = radius + SAFE_SHARE * margin
        """Radius of the disc that the body needs where it comes nearer to walls than the contour [m]."""
        hit = clearance - HIT_SLACKS * slack if HIT_SLACKS * slack < margin else self.inner
        # A way that the brake, or what keeps a robot able to stop, does not let it go is none: it would stand before it.
        stopped = max(
            braking_radius(sensors), stopping_radius(sensors, SAFE_SHARE * margin) if needs_care(sensors) else radius
        )
        self.hit_radius = max(hit, min(stopped + BESIDE_BRAKE, clearance))
        """Radius of the disc that must not touch anything on the way to the goal [m]."""
        self.body_radius = radius + 0.1 * margin
        """Radius of the disc that the body needs where it has been, among things that stand still [m]."""
        self.progress = max(2.0 * step, 0.05)
        """By how much "closer" must be closer [m]."""
        self.leave_length = max(1.5 * clearance, 4.0 * step)
        """Free way toward the goal that makes a heading free [m]."""
        self._require_sight()
        self.gate_half_width = min(clearance, max(3.0 * step, 0.3 * clearance))
        """How near to a remembered place, across the contour, is there [m]."""
        self.arming_length = max(2.0 * clearance, 4.0 * self.gate_half_width)
        """Way after which a gate may fire [m]."""
        angles = sensors.angles
        self.beam_spacing = float(angles[1] - angles[0]) if len(angles) > 1 else 2.0 * math.pi
        """Angle between two neighbouring beams [rad]."""
        self.touch = max(0.05 * step, 2.0 * sensors.range_noise)
        """Remaining way at which a wall counts as reached [m]."""
        turn = sensors.drive.max_turn_rate * sensors.drive.step
        self.turn_decisions = math.ceil(math.pi / turn) if turn > 0.0 else 0
        """Decisions in which a robot makes half a turn."""
        self.headings = OpenHeadings(
            step=step,
            clearance=clearance,
            inner=self.inner,
            safe_radius=self.safe_radius,
            leave_length=self.leave_length,
        )
        self.laps = Laps(
            step=step,
            clearance=clearance,
            touch=self.touch,
            gate_half_width=self.gate_half_width,
            arming_length=self.arming_length,
            goes_back=sensors.drive.kinematics == "ackermann",
        )
        self.fresh_starts = 0
        """How often a bug that goes round in vain may begin anew, if it can (`BugMemory.is_fresh`): its hand came to another
        wall through a gap that is one from one side only."""
        self.rounding: Rounding | None = None
        """How corners are rounded; None: the contour is kept to exactly."""
        self.exact_length = 2.0 * clearance + sensors.goal_radius
        """Distance to the goal within which it is in any case [m]: a goal in a corner may be seen from there alone."""

    def decide_late(self) -> None:
        """From now on be shown what the robot sees as it decides, also where its command acts later.

        It comes off its contour then by what it drives until it is told better.
        """
        self.drive, kept = self.sensors.drive, self.clearance - self.sensors.radius
        self.pace = speed_within(self.drive, min(self.step, kept) if self.drive.latency > 0 else self.step)

    def _require_sight(self) -> None:
        """Refuse a scanner to which walls at the clearance look farther away, or no heading ever free."""
        near, far = self.sensors.min_range, self.sensors.range
        if near > self.clearance:
            came = f"the scanner tells no distance below {near:g} m: expected a clearance of at least that"
            raise MisfitError(f"walls cannot be followed at {self.clearance:g} m, {came}")
        if far < self.leave_length:
            came = f"the scanner sees {far:g} m: expected a lidar.range of at least that, or a smaller clearance"
            raise MisfitError(f"a wall is left where {self.leave_length:g} m toward the goal are free, {came}")

    def require_corners(self) -> None:
        """Refuse a scanner that loses the wall at the corners of a lap; what is claimed of the lap would be of another wall.

        A step past its end, straight on, a wall lies behind the hand by the angle whose tangent is the step by the clearance.

        Raises:
            MisfitError: it does not look so far back.
        """
        if not self.sees_corners:
            came = f"a wall's corner that is passed lies {math.degrees(self._corner):.4g} degrees from ahead"
            raise MisfitError(
                f"{came}, the scanner looks to {math.degrees(self.sensors.angles[-1]):.4g}: expected a lidar.fov of at least "
                f"{math.ceil(200.0 * self._corner) / 100.0:g}, or a larger clearance"
            )

    @property
    def sees_corners(self) -> bool:
        """Whether the scanner looks as far back as a wall's corner lies that was just passed; else laps may lose the wall."""
        return len(self.sensors.angles) < 2 or float(self.sensors.angles[-1]) >= self._corner

    @property
    def _corner(self) -> float:
        """How far from ahead that lies [rad]."""
        return 0.5 * math.pi + math.atan2(self.step, self.clearance)

    def round_corners(self) -> None:
        """From now on follow walls as a robot should that is driven on arcs, along `Contour.course`."""
        self.rounding = Rounding(
            drive=self.sensors.drive,
            step=self.step,
            clearance=self.clearance,
            inner=self.inner,
            gate_half_width=self.gate_half_width,
            safe_radius=self.safe_radius,
        )

    # ------------------------------------------------------------------------------------------------------ where it is

    def advance(self, view: View, memory: BugMemory) -> None:
        """Bring the memory's odometer, and its contour, up to the present. Call once a decision, first."""
        if self.sees_motion(view, memory) and memory.contour is not None:
            memory.contour.is_disturbed = True
        self.move_on(view, memory)

    def sees_motion(self, view: View, memory: BugMemory) -> bool:
        """Whether something near has moved since a while ago; it looks now and then."""
        return self.looks_now(memory) and self.has_moved(view, memory)

    def looks_now(self, memory: BugMemory) -> bool:
        """Whether it is time for a glance. Call once a decision."""
        memory.glance_age += self.sensors.drive.step
        return not memory.glances or memory.glance_age >= GLANCE

    def has_moved(self, view: View, memory: BugMemory) -> bool:
        """Whether something near has moved since some glances ago; this is the latest one."""
        memory.glance_age = 0.0
        memory.glances.append(view)
        return len(memory.glances) > GLANCES and has_moved(memory.glances.pop(0), view, NEAR)

    def move_on(self, view: View, memory: BugMemory) -> None:
        """Bring the memory's odometer, and its contour, up to the present place."""
        position = view.position
        if memory.position is not None:
            memory.odometer += math.dist(memory.position, position)
        memory.position = position
        if memory.contour is not None:
            memory.contour.course = None
            self.laps.advance(view, memory.contour)

    # -------------------------------------------------------------------------------------------------------- free ways

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
        inward = self.way_in(view, distance)
        if inward is not None:
            bearing, ahead = inward
            return velocity_along(bearing, min(min(ahead, self.step) / self.sensors.drive.step, self.pace))
        free = self.free_way(view, bearing, distance, radius=radius)
        ahead = min(self.step, distance, free)
        if ahead <= 0.0:
            return None
        drive = self.drive
        speed = min(ahead / drive.step, speed_within(drive, free))
        if drive.latency > 0 and self._is_goal(view, distance):
            speed = min(speed, distance / (drive.step * (1 + drive.latency)))  # else it drives past, and back, for ever
        return velocity_along(bearing, speed)

    def go_until_hit(self, view: View, memory: BugMemory, side: SideAfter | int, bearing: float) -> Velocity | None:
        """As `go` toward the goal, along a bearing [rad]; but a robot that rounds corners rounds that at the hit point too.

        It sees before it comes to the hit point how the contour leads on from there, to that side. It has landed at the hit
        point, or where another place of the contour is nearer to it: None then, and `hit` goes on from there.
        """
        landing, memory.landing = memory.landing, None
        distance = view.goal_distance
        if self.rounding is None or distance <= self.exact_length:
            return self.go(view, bearing, distance)
        if landing is None:
            free = self.free_way(view, bearing, distance)
            if free <= look_ahead(self.sensors.drive):
                landing = self._landing(view, side if isinstance(side, int) else side(free), bearing, free)
        if landing is None:
            return self.go(view, bearing, distance)
        place = self.rounding.land(view, landing)
        if place is None:
            return self.go(view, bearing, distance)
        memory.landing = landing
        assert landing.foot is not None
        if math.dist(landing.foot[:2], landing.hit) > 0.5 * self.step or math.hypot(*place) <= self.touch:
            return None
        return velocity_along(math.atan2(place[1], place[0]), self.pace)

    def _landing(self, view: View, side: int, bearing: float, free: float) -> Contour:
        """The contour that begins where the free way [m] along a bearing [rad] ends."""
        contour = self.lay_hand(view, side, bearing)
        contour.hit = view.to_odometry(*velocity_along(bearing, free))
        contour.foot = (*contour.hit, bearing + view.heading)
        return contour

    def step_to(self, view: View, place: Point, *, radius: float | None = None) -> Velocity | None:
        """Velocity straight to a place of the odometry frame, at most a few steps away; None where it is blocked.

        The robot has been there: the body passes, if nearer to walls than the contour. `radius` is that of the disc that must
        not touch anything [m]; None: safe_radius.
        """
        x, y = view.to_robot(*place)
        ahead, bearing = min(self.step, math.hypot(x, y)), math.atan2(y, x)
        if view.free_distance(bearing, self.safe_radius if radius is None else radius) < ahead:
            return None
        return velocity_along(bearing, min(ahead / self.sensors.drive.step, self.pace))

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
        if not self._is_near_goal(view, distance):
            return False
        if view.free_distance(bearing, self.safe_radius) >= distance - self.sensors.goal_radius:
            return True
        return self.way_in(view, distance) is not None

    def way_in(self, view: View, distance: float) -> tuple[float, float] | None:
        """The bearing [rad] and the way [m] that bring the body within the radius of a goal where it fits nowhere at the goal.

        In the corner of a room that may be only on some bearings, and not straight on to the goal. None where the body fits at
        the goal, for a distance [m] to any other place, and where no way is free.
        """
        if not self._is_near_goal(view, distance) or not is_goal_by_wall(view):
            return None
        return way_in(view, self.safe_radius)

    def goal_heading(self, view: View) -> float | None:
        """The bearing [rad] on which the body passes to a goal that lies nearer to a wall than the clearance; None: on none."""
        if not self.can_reach_goal(view, view.goal_bearing, view.goal_distance):
            return None
        inward = self.way_in(view, view.goal_distance)
        return view.goal_bearing if inward is None else inward[0]

    def _is_near_goal(self, view: View, distance: float) -> bool:
        """Whether a distance [m] is that to a goal so near that the last of the way may lead nearer to walls."""
        return self._is_goal(view, distance) and distance <= self.exact_length

    def _is_goal(self, view: View, distance: float) -> bool:
        """Whether a distance [m] is that to the goal."""
        return abs(distance - view.goal_distance) <= 1e-6

    def is_free(self, view: View, bearing: float, distance: float, contour: Contour | None = None) -> bool:
        """Whether the robot can head along a bearing [rad] toward a target at a distance [m].

        With a contour the leave rule must allow it too.
        """
        if not self.may_head(contour, bearing + view.heading):
            return False
        if self.can_reach_goal(view, bearing, distance):
            return True
        return view.free_distance(bearing, self.inner) >= min(distance, self.leave_length)

    def may_head(self, contour: Contour | None, direction: float) -> bool:
        """Whether the leave rule lets a robot on a contour head in a direction [rad] of the odometry frame."""
        travel = contour.heading if contour is not None and self.leave_rule == "front" else None
        return travel is None or is_ahead(travel, direction)

    def points_away(self, view: View, bearing: float, contour: Contour) -> bool:
        """Whether a bearing [rad] points away from the wall that the hand is on.

        A way that is free of the followed obstacle, if only as far as the next one: algorithms that may leave at few
        places (on the M-line) take it, and hit the next one.
        """
        x, y = view.to_robot(*contour.wall)
        return math.cos(bearing - math.atan2(y, x)) < -0.1

    def may_leave(self, view: View, contour: Contour, *, is_nearer: bool) -> bool:
        """Whether a bug that leaves where it is nearer to the goal than it was may leave here.

        The way to the goal must be free for `leave_length`, else each ripple of a wall would end a lap. Where obstacles stand
        closer together than that no place may do on a whole lap; then the nearest one will, from which the way is free as
        far as the next obstacle.
        """
        if is_nearer and self.is_free(view, view.goal_bearing, view.goal_distance, contour):
            return True
        if contour.takes_less and (math.isfinite(contour.way_out) or not self.fresh_starts):
            return view.goal_distance <= contour.way_out + self.progress and self.begins_free(view, contour)
        if is_nearer and view.goal_distance < contour.way_out and self.begins_free(view, contour):
            contour.way_out = view.goal_distance
        return False

    def begins_free(self, view: View, contour: Contour) -> bool:
        """Whether the way to the goal is free of the followed wall, if only as far as the next obstacle, a step or more away.

        Less than a step is a corner of the same wall.
        """
        bearing = view.goal_bearing
        if not self.may_head(contour, bearing + view.heading) or not self.points_away(view, bearing, contour):
            return False
        return self.free_way(view, bearing, view.goal_distance) >= self.step

    def may_go_on(self, view: View, contour: Contour) -> bool:
        """Whether a bug that may leave here does: toward the goal the way is free, or by the rule "any" begins to be."""
        if self.is_free(view, view.goal_bearing, view.goal_distance, contour):
            return True
        return self.leave_rule == "any" and self.points_away(view, view.goal_bearing, contour)

    def is_open(self, view: View, contour: Contour) -> bool:
        """The test of reachability: from a nearest point the goal lies straight away from the wall or behind it."""
        bearing = view.goal_bearing
        return self.points_away(view, bearing, contour) or self.can_reach_goal(view, bearing, view.goal_distance)

    # ----------------------------------------------------------------------------------------------- boundary following

    def hit(self, view: View, memory: BugMemory, side: int, bearing: float) -> Contour:
        """Begin to follow the boundary that blocks a bearing [rad]; records the hit point."""
        contour, memory.landing = memory.landing, None
        if contour is None:
            contour = self.lay_hand(view, side, bearing)
            contour.hit_distance = view.goal_distance
        else:
            contour.position, contour.goal, contour.sweep = view.position, view.goal_position, 0.0
            contour.hit_distance = math.dist(contour.hit, contour.goal)
        memory.vain_leaves = memory.vain_leaves + 1 if self._was_left_in_vain(contour, memory) else 0
        contour.has_no_other = memory.vain_leaves > 1
        memory.contour = contour
        memory.hits.append(contour.hit)
        contour.been = memory.hits[0]
        memory.hit_sides.append(contour.side)
        memory.hit_odometers.append(memory.odometer)
        return contour

    def _was_left_in_vain(self, contour: Contour, memory: BugMemory) -> bool:
        """Whether the last boundary was left with less asked, only to be hit again where it had been."""
        if not memory.left_for_less or not memory.hits or memory.hit_sides[-1] != contour.side:
            return False
        return math.dist(memory.hits[-1], contour.hit) <= self.gate_half_width

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
        memory.left_for_less = memory.contour is not None and memory.contour.takes_less
        memory.contour = None

    def follow(self, view: View, memory: BugMemory, first_heading: FirstHeading | None = None) -> Velocity:
        """Velocity of one step along the boundary, its end on the contour.

        The hand stays on the wall: from the bearing of the wall the heading turns away from it until a whole step is
        open. One rule for straight walls, convex and concave corners, dead ends and thin walls. A robot without any
        open heading waits; after WAIT seconds it backs the way it came, and calls itself stuck where it cannot or has done
        so here before. `first_heading` is another rule.
        """
        contour = memory.contour
        assert contour is not None
        if contour.vain_laps > 1:
            self._end_vain_laps(memory)
            return STANDING
        is_exact = (
            contour.is_exact or contour.asked_for > self.turn_decisions or view.goal_distance <= self.exact_length
        )
        rounding = None if is_exact else self.rounding
        if rounding is not None and contour.foot is not None:
            place = rounding.go_on(view, contour)
            if place is not None:
                contour.waited = 0.0
                contour.asked_for += 1
                return velocity_along(math.atan2(place[1], place[0]), self.pace)
        contour.foot = None
        bearing = self._wall_bearing(view, contour)
        # At the hit point it is along the wall: a gap just too narrow must not turn it away there either.
        along = bearing + contour.side * 0.5 * math.pi
        travel = along if contour.heading is None else contour.heading - view.heading
        if first_heading is None:
            heading = self.headings.first(view, bearing, contour.side, travel)
        else:
            heading = first_heading(view, contour, bearing, travel)
        if heading is None:
            contour.waited += self.sensors.drive.step
            if contour.waited <= WAIT:
                return STANDING
            heading = self._backed_out(view, contour, travel) if first_heading is None else None
            if heading is None:
                memory.verdict = "stuck"
                return STANDING
        contour.waited = 0.0
        heading = self._resolved(view, contour, heading)
        if contour.heading is not None:
            # A robot that turns on the spot asks again and again before it moves, its hand on one wall after another.
            since = travel if contour.asked is None else contour.asked - view.heading
            contour.sweep += swept(since, bearing, heading, contour.side)
            contour.asked = heading + view.heading
            contour.asked_for += 1
        self._move_hand(view, contour, heading)
        if rounding is not None and first_heading is None:
            rounding.begin(view, contour, heading)
        return velocity_along(heading, self.pace)

    def _end_vain_laps(self, memory: BugMemory) -> None:
        """Begin anew from here, or give up where that has been tried."""
        if memory.fresh_starts >= self.fresh_starts:
            memory.verdict = "looping"
            return
        memory.fresh_starts += 1
        memory.contour, memory.is_fresh = None, True

    def _backed_out(self, view: View, contour: Contour, travel: float) -> float | None:
        """Back the way it came, where nothing else is open; None: no step is, or it has come back here from there."""
        if contour.backed_from is not None and math.dist(contour.backed_from, view.position) <= 2.0 * self.step:
            return None
        contour.backed_from = view.position
        return self.headings.back(view, travel)

    def _resolved(self, view: View, contour: Contour, heading: float) -> float:
        """A heading [rad], or the last one where the robot has turned to and fro on the spot for more than half a turn.

        Each turn shows it the wall by other beams, so that between two narrow ways it may change its mind for ever.
        """
        if contour.asked is None or contour.asked_for <= self.turn_decisions:
            return heading
        asked = contour.asked - view.heading
        is_open = view.free_distance(asked, self.safe_radius) >= self.step
        return asked if is_open else heading

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
        inward = heading - contour.side * TRIED
        ahead, left = velocity_along(inward, self.step)
        point = view.point_nearest_to(ahead, left)
        if point is None:
            return
        dx, dy = point[0] - ahead, point[1] - left
        if dx * dx + dy * dy <= self.clearance**2:
            contour.wall = view.to_odometry(*point)

    def draw(self, memory: BugMemory) -> Drawing:
        """Hit and leave points, and the wall that the hand is on."""
        points = [(*place, "hit") for place in memory.hits] + [(*place, "leave") for place in memory.leaves]
        if memory.contour is not None:
            points.append((*memory.contour.wall, "wall"))
        return Drawing(points=points)
