"""The toolbox of bugs that go from corner to corner in sight: open points, sub-goals, and how a robot goes to them.

An *open point* (a *sudden point* in PointBug) is where the reading of a turning range sensor jumps by more than a
threshold: an end of an obstacle in sight. It is looked for in the free ways of a disc over the full circle of headings,
so the ends of gaps that the robot cannot pass are none. The *sub-goal* lies beside it, at the clearance, square to the
line of sight. The robot goes to it along the line that just passes the corner at the clearance, then round the corner
as a hand on the wall would, until it looks past it: what a point robot does in no time by standing in the corner.

              o  sub-goal                     side +1: the corner is the left end of what is behind it
              |  clearance
    S . . . . x=========  corner, obstacle

Sources: Buniyamin, Ngah, Wan Ngah and Mohamad (2011) for sudden points; Das, Dutta and Debnath (2020) for sub-goals.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.agents.scan import open_ways
from bug_gym.agents.walls.boundary import STANDING, WAIT, Boundary, LeaveRule, Turn, side_of
from bug_gym.agents.walls.boundary_bug import BoundaryParameters
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory, Contour
from bug_gym.geometry import Point, wrap
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

HEADINGS = 360
"""Headings of the full circle that are looked along."""

JUMP = 0.5
"""Change of the reading that makes an open point [m], at most: behind a gap that a small robot passes there may be only
as much room as it needs."""

TIE = 0.01
"""Costs nearer to each other than this are equal [m]."""

SHORT = 0.5
"""By how much of its distance an end in sight may seem to move between two decisions, along the line of sight."""

LOOKS = 5
"""How often it looks again at most: an end that the beams hardly tell comes and goes for ever."""

LONGEST_ROUND = 1.5 * math.pi
"""Turning after which a corner is left whatever lies behind it: a post has no other side [rad]."""


class OpenPoint(NamedTuple):
    """An end of an obstacle in sight."""

    corner: Point
    """Last point in sight of what ends there, robot's frame [m]."""
    side: int
    """+1: its left end, which the robot passes with the wall on its right; -1: its right end."""
    rotation: float
    """Angle from the goal's bearing to the heading that passes it, counter-clockwise, in [0, 2 pi) [rad]."""
    farthest: Point
    """Up to where the obstacle may go on unseen, between this beam and the next, robot's frame [m]."""

    def sub_goal(self, offset: float) -> Point:
        """The place at an offset [m] from the corner, square to the line of sight, robot's frame [m]."""
        x, y = self.corner
        away = max(math.hypot(x, y), 1e-9)
        return x - self.side * offset * y / away, y + self.side * offset * x / away


class Profile(NamedTuple):
    """What a look around shows."""

    goal_way: float
    """Free way toward the goal [m], infinite where nothing is in sight there."""
    blocking_beam: int
    """The beam that saw what ends it, -1 for none."""
    link: NDArray[np.bool_]
    """Whether each beam and the next see one surface (B,)."""
    open_points: list[OpenPoint]
    """Counter-clockwise from the goal's bearing."""
    ranges: NDArray[np.float64]
    """The ranges (B,) it was made of [m]."""


class End(NamedTuple):
    """An open point in the odometry frame."""

    corner: Point
    """Odometry frame [m]."""
    side: int
    """See OpenPoint."""


class Visit(NamedTuple):
    """A corner that the robot has gone round."""

    corner: Point
    """Odometry frame [m]."""
    first_seen: Point
    """Where it seemed to be when it was chosen: what lies between has been passed. Odometry frame [m]."""
    side: int
    """See OpenPoint."""
    odometer: float
    """Length of the whole way then [m]."""


@dataclass
class SubGoalMemory(BugMemory):
    """Memory of a bug that goes from sub-goal to sub-goal."""

    corner: Point | None = None
    """The corner that it goes to or round; None without a sub-goal. Odometry frame [m]."""
    side: int = 1
    """On which side it passes the corner, see OpenPoint."""
    first_seen: Point = (0.0, 0.0)
    """Where the corner seemed to be when it was chosen, odometry frame [m]."""
    farthest: Point = (0.0, 0.0)
    """Up to where from there it may turn out to be, odometry frame [m]."""
    drift: float = 0.0
    """How far beside the line between the two it may turn out to be [m]."""
    came_from: Point | None = None
    """Where it set out for the present corner; None before the first. Odometry frame [m]."""
    sub_goals: list[Point] = field(default_factory=list)
    """All sub-goals so far, odometry frame [m]."""
    visits: list[Visit] = field(default_factory=list)
    """Corners that it has gone round."""
    blocked: list[Point] = field(default_factory=list)
    """Corners that turned out to be out of reach from the last sub-goal, odometry frame [m]."""
    goal: Point | None = None
    """Where the target was when all this was remembered, odometry frame [m]."""
    waited: float = 0.0
    """Time without anywhere to go [s]."""
    seen: list[End] | None = None
    """Open points in sight at the last decision but this; None at the first."""
    sees: list[End] | None = None
    """Open points in sight now."""
    looks: int = 0
    """How often it has stood for another look before it chooses."""


class SubGoals:
    """How a robot sees open points and goes to sub-goals; the settings that these bugs share.

    Args:
        sensors: what a driver knows of the robot.
        clearance: see Boundary; also from a corner to its sub-goal [m].
        leave_rule: see Boundary; here it says where a goal may lie that is open only as far as the scan reaches.
        jump: change of the reading that makes an open point [m]; None: JUMP, or half the gap it passes if that is less.

    Raises:
        ValueError: a clearance not above the body's radius, an unknown leave rule, a jump not above 0.
    """

    def __init__(
        self, sensors: Sensors, *, clearance: float | None = None, leave_rule: str = "any", jump: float | None = None
    ) -> None:
        self.boundary = Boundary(sensors, clearance=clearance, leave_rule=leave_rule)
        jump = min(JUMP, self.boundary.inner) if jump is None else jump
        if not jump > 0.0 or not math.isfinite(jump):
            raise ValueError(f"jump must be above 0 m, got {jump!r}")
        self.jump = jump
        self.same = self.boundary.gate_half_width
        """Distance within which two corners are one [m]."""
        angles = sensors.angles
        self._spacing = float(angles[1] - angles[0]) if len(angles) > 1 else 2.0 * math.pi
        self._wraps = bool(angles[-1] + 1.5 * self._spacing >= angles[0] + 2.0 * math.pi)
        # Noise must not close the view along a wall at the clearance.
        safe, noise = self.boundary.safe_radius, 2.0 * sensors.range_noise
        self.radius = max(safe, self.boundary.inner - noise)
        """Of the disc whose free ways are looked at [m]."""
        self.leg_radius = max(safe, self.boundary.hit_radius - noise)
        """Of the disc whose way to a corner must be free [m]."""
        self._headings = np.arange(HEADINGS) * (2.0 * math.pi / HEADINGS)

    # ------------------------------------------------------------------------------------------ looking around

    def look(self, view: View) -> Profile:
        """The free ways of a disc over the full circle, counted from the goal's bearing, and where they jump."""
        radius, reach, ranges = self.radius, view.sensors.range, self._filled(view)
        noise = view.sensors.range_noise
        x, y = view.sensors.beam_directions * ranges
        link = np.empty(len(x), dtype=np.bool_)
        open_ways.link_beams(x, y, ranges, reach, self.jump, 2.0 * radius, noise, self._wraps, link)
        first = view.goal_bearing
        cos, sin = np.cos(first + self._headings), np.sin(first + self._headings)
        free, beam = np.empty(HEADINGS), np.empty(HEADINGS, dtype=np.int64)
        open_ways.sweep_disc(x, y, ranges, reach, link, radius, first, cos, sin, free, beam)
        found, side = np.empty((HEADINGS, 5)), np.empty(HEADINGS, dtype=np.int64)
        chosen = np.empty(len(x), dtype=np.int64)
        count = open_ways.find_open_points(
            x, y, ranges, reach, link, radius, first, free, beam, self.jump, noise, self._wraps, chosen, found, side
        )
        ends = zip(found[:count].tolist(), side[:count].tolist(), strict=True)
        points = [OpenPoint((u, v), hand, turn % (2.0 * math.pi), (w, z)) for (turn, u, v, w, z), hand in ends]
        return Profile(float(free[0]), int(beam[0]), link, points, ranges)

    def _filled(self, view: View) -> NDArray[np.float64]:
        """The ranges (B,) [m], filled in where a beam alone got no return from what its neighbours show to be a wall.

        No disc passes between their points, or those and the next ones lie on one line. On a line the inverse ranges of
        three neighbours have no second difference, but for the curvature of the cosine.
        """
        ranges, reach, bend = view.ranges, view.sensors.range, 2.0 * math.cos(self._spacing)
        earlier, before, after, later = (np.maximum(np.roll(ranges, shift), 1e-9) for shift in (2, 1, -1, -2))
        apart = before * before + after * after - 2.0 * before * after * math.cos(2.0 * self._spacing)
        between = bend * before * after / (before + after)
        error = 3.0 * view.sensors.range_noise + 0.2 * self.jump
        is_line = np.ones(len(ranges), dtype=np.bool_)
        for near, far in ((before, earlier), (after, later)):
            is_line &= (far < reach) & (np.abs(1.0 / far + 1.0 / between - bend / near) <= error / (near * between))
        if not self._wraps:
            is_line[:2] = is_line[-2:] = False
            apart[[0, -1]] = math.inf
        is_wall = (np.maximum(before, after) < reach) & ((apart <= 4.0 * self.radius**2) | is_line)
        return np.where((ranges >= reach) & is_wall, between, ranges)

    def surface(self, view: View, profile: Profile) -> NDArray[np.float64]:
        """Points (k, 2) of what blocks the way to the goal, as far as the scan shows it whole, robot's frame [m]."""
        count, first = len(profile.link), profile.blocking_beam
        if first < 0:
            return np.empty((0, 2))
        last = first
        while profile.link[last % count] and last < first + count:
            last += 1
        while profile.link[(first - 1) % count] and first > last - count:
            first -= 1
        beams = np.arange(first, last + 1) % count
        return (view.sensors.beam_directions[:, beams] * profile.ranges[beams]).T

    def is_visited(self, view: View, memory: SubGoalMemory, point: OpenPoint) -> bool:
        """Whether an open point's corner is one that the robot has gone round, as far as the scan can tell."""
        ends = view.to_odometry(*point.corner), view.to_odometry(*point.farthest)
        return any(distance_between(ends, (visit.first_seen, visit.corner)) <= self.same for visit in memory.visits)

    def is_blocked(self, view: View, memory: SubGoalMemory, point: OpenPoint) -> bool:
        """Whether an open point's corner is one that is out of reach."""
        place = view.to_odometry(*point.corner)
        return any(math.dist(place, corner) <= self.same for corner in memory.blocked)

    def _seen_twice(self, view: View, memory: SubGoalMemory, profile: Profile) -> list[OpenPoint]:
        """The open points that were in sight at the last decision too: a beam without a return opens a wall for once."""
        if memory.seen is None:
            return profile.open_points
        seen = memory.seen
        return [point for point in profile.open_points if any(self._is_end(view, point, end) for end in seen)]

    def looks_again(self, view: View, memory: SubGoalMemory, profile: Profile) -> bool:
        """Whether to stand for one decision before a choice: two looks running have not shown the same open points."""
        points, seen = profile.open_points, memory.seen or []
        is_same = len(self._seen_twice(view, memory, profile)) == len(points)
        is_same &= all(any(self._is_end(view, point, end) for point in points) for end in seen)
        memory.looks += 1
        return not is_same and memory.looks <= LOOKS

    def _is_end(self, view: View, point: OpenPoint, end: End) -> bool:
        """Whether an open point is one of the last decision.

        Where the line of sight grazes a surface its last point in sight falls short by what lies between two beams,
        and by more along that line than across it.
        """
        (x, y), (u, v) = point.corner, view.to_robot(*end.corner)
        away = max(math.hypot(x, y), 1e-9)
        along, across = (x * u + y * v) / away - away, (x * v - y * u) / away
        short = max(2.0 * self.boundary.clearance, SHORT * away)
        return point.side == end.side and abs(across) <= self._drift(point) and abs(along) <= short

    def _drift(self, point: OpenPoint) -> float:
        """How far beside where it is seen now a corner may turn out to be [m]."""
        return max(self.same, 1.5 * self._spacing * math.hypot(*point.corner))

    def new_points(self, view: View, memory: SubGoalMemory, profile: Profile) -> list[OpenPoint]:
        """The open points in sight whose corners are neither visited nor out of reach."""
        points = [
            point for point in self._seen_twice(view, memory, profile) if not self.is_blocked(view, memory, point)
        ]
        return [point for point in points if not self.is_visited(view, memory, point)]

    def other_points(self, view: View, memory: SubGoalMemory, profile: Profile) -> list[OpenPoint]:
        """The open points in sight that are not out of reach, nor the corner that the robot is at."""
        points = [p for p in self._seen_twice(view, memory, profile) if not self.is_blocked(view, memory, p)]
        if not memory.visits:
            return points
        # Round a disc the next end in sight is hardly further than what made the last one be gone round.
        last, near = memory.visits[-1].corner, 0.5 * self.same
        return [point for point in points if math.dist(view.to_odometry(*point.corner), last) > near]

    # ------------------------------------------------------------------------------------------ going there

    def go_on(self, view: View, memory: SubGoalMemory, profile: Profile) -> Velocity | None:
        """Velocity to the goal where it is in sight, else on to the sub-goal; None where a new one is to be chosen."""
        self.boundary.advance(view, memory)
        self._follow_target(view, memory)
        memory.seen, memory.sees = memory.sees, [End(view.to_odometry(*p.corner), p.side) for p in profile.open_points]
        if not self._sees_goal(view, memory, profile):
            velocity = self._approach(view, memory, profile) if memory.corner is not None else None
            if velocity is not None:
                return velocity
            if not self._is_open(view, memory, profile):
                return None
        velocity = self.boundary.go(view, view.goal_bearing, view.goal_distance)
        if velocity is not None:
            memory.contour = memory.corner = None
            memory.waited = 0.0
            memory.looks = 0
            memory.mode = "motion_to_goal"
        return velocity

    def set_out(self, view: View, memory: SubGoalMemory, profile: Profile, point: OpenPoint) -> Velocity:
        """First velocity to the sub-goal of an open point."""
        memory.corner = memory.first_seen = view.to_odometry(*point.corner)
        memory.side = point.side
        memory.farthest = view.to_odometry(*point.farthest)
        memory.drift = self._drift(point)
        memory.came_from = view.position
        memory.contour = None
        memory.waited = 0.0
        memory.looks = 0
        memory.mode = "motion_to_sub_goal"
        memory.sub_goals.append(view.to_odometry(*point.sub_goal(self.boundary.clearance)))
        return self._approach(view, memory, profile) or STANDING

    def give_up(self, memory: SubGoalMemory, verdict: str) -> Velocity:
        """Stand, and say the verdict after WAIT seconds without anywhere to go: something may move away before."""
        memory.contour = None  # a goal behind is better than none
        memory.waited += self.boundary.sensors.drive.step
        if memory.waited > WAIT:
            memory.verdict = verdict
        return STANDING

    def _sees_goal(self, view: View, memory: SubGoalMemory, profile: Profile) -> bool:
        """Whether nothing is in the way to the goal, and the goal not beyond what the scan shows.

        A robot that has set out for a corner moves before it looks again: turning on the spot it may see other points
        of the same walls, and turn between goal and corner for ever.
        """
        bearing, distance = view.goal_bearing, view.goal_distance
        set_out_at = None if memory.corner is None else memory.came_from
        if set_out_at is not None and math.dist(set_out_at, view.position) <= self.boundary.step:
            return False
        if self.boundary.can_reach_goal(view, bearing, distance):
            return True
        return distance <= view.sensors.range and self._goal_way(view, memory, profile) >= distance

    def _is_open(self, view: View, memory: SubGoalMemory, profile: Profile) -> bool:
        """Whether nothing in sight is in the way to the goal; with the rule "front" only for a goal ahead."""
        contour = memory.contour
        if self.boundary.leave_rule == "front" and contour is not None and contour.heading is not None:
            aside = wrap(view.goal_bearing + view.heading - contour.heading)
        else:
            aside = 0.0
        is_free = self._goal_way(view, memory, profile) >= min(view.goal_distance, view.sensors.range)
        return is_free and abs(aside) <= 0.5 * math.pi

    def _goal_way(self, view: View, memory: SubGoalMemory, profile: Profile) -> float:
        """Free way toward the goal [m], for a robot on this way with less to spare, so that it does not waver."""
        if memory.mode == "motion_to_goal":
            return view.free_distance(view.goal_bearing, self.boundary.hit_radius)
        return profile.goal_way

    def _approach(self, view: View, memory: SubGoalMemory, profile: Profile) -> Velocity | None:
        """Velocity to the present corner and round it; None where it is passed or out of reach."""
        assert memory.corner is not None
        if memory.contour is None:
            self._sharpen(view, memory, profile)
            x, y = view.to_robot(*memory.corner)
            if math.hypot(x, y) > self.boundary.clearance + 0.5 * self.boundary.step:
                velocity = self._leg(view, x, y, memory.side)
                if velocity is None:
                    memory.blocked.append(memory.corner)
                    memory.corner = None
                return velocity
            approach = wrap(math.atan2(y, x) + memory.side * 0.5 * math.pi + view.heading)
            place, goal = view.position, view.goal_position
            memory.contour = Contour(memory.side, place, memory.corner, place, goal, approach, place)
            memory.mode = "corner_rounding"
        if self._is_round(memory):
            self._note_visit(memory, memory.corner)
            return None
        return self.boundary.follow(view, memory)

    def _sharpen(self, view: View, memory: SubGoalMemory, profile: Profile) -> None:
        """Move the corner to where the scan shows it now: from afar its last point in sight fell between two beams."""
        assert memory.corner is not None
        x, y = view.to_robot(*memory.corner)
        best, corner = math.inf, memory.corner
        for point in profile.open_points:
            place = view.to_odometry(*point.corner)
            distance = math.dist(point.corner, (x, y))
            aside = kernels.point_wall_distance(*place, *memory.first_seen, *memory.farthest)
            if point.side == memory.side and distance < best and aside <= memory.drift:
                best, corner = distance, place
        memory.corner = corner

    def _leg(self, view: View, x: float, y: float, side: int) -> Velocity | None:
        """Velocity straight to where the robot passes a corner at x, y [m] at the clearance; None where it cannot.

        Between the clearance and the narrowest gap that counts as one it takes the widest berth that is free.
        """
        boundary = self.boundary
        away, bearing = math.hypot(x, y), math.atan2(y, x)
        best = (0.0, 0.0, 0.0)
        for share in range(5):
            offset = min(boundary.clearance - 0.25 * share * (boundary.clearance - boundary.inner), away)
            heading = bearing + side * math.asin(offset / away)
            length = math.sqrt(away * away - offset * offset)
            free = min(view.free_distance(heading, self.leg_radius), length)
            if free > best[0]:
                best = free, heading, length
            if free >= length:
                break
        free, heading, length = best
        return boundary.go(view, heading, length, radius=self.leg_radius) if free > 0.0 else None

    def _is_round(self, memory: SubGoalMemory) -> bool:
        """Whether the robot looks past the corner that it goes round: for two decisions no free way has jumped there."""
        assert memory.corner is not None and memory.contour is not None
        if memory.contour.is_lap_closed or abs(memory.contour.turned) > LONGEST_ROUND:
            return True
        ends = [*(memory.seen or ()), *(memory.sees or ())]
        return not any(end.side == memory.side and math.dist(end.corner, memory.corner) <= self.same for end in ends)

    # ------------------------------------------------------------------------------------------ what it remembers

    def _follow_target(self, view: View, memory: SubGoalMemory) -> None:
        """Forget where it has been when the target is elsewhere: all corners may be worth a visit again."""
        if memory.goal is not None and math.dist(memory.goal, view.goal_position) <= TARGET_MOVED:
            return
        memory.goal = view.goal_position
        memory.visits.clear()
        memory.blocked.clear()

    def _note_visit(self, memory: SubGoalMemory, corner: Point) -> None:
        """The corner is passed; the third time round the same one on the same side is a loop."""
        visit = Visit(corner, memory.first_seen, memory.side, memory.odometer)
        earlier = 0
        for other in memory.visits:
            is_same = other.side == visit.side and math.dist(other.corner, corner) <= self.same
            earlier += is_same and visit.odometer - other.odometer > self.boundary.arming_length
        if earlier >= 2:
            memory.verdict = "looping"
        memory.visits.append(visit)
        memory.blocked.clear()
        memory.corner = None

    def draw(self, memory: SubGoalMemory) -> Drawing:
        """Sub-goals so far and the present corner."""
        points = [(*place, "sub_goal") for place in memory.sub_goals]
        if memory.corner is not None:
            points.append((*memory.corner, "corner"))
        return Drawing(points=points)


@dataclass(frozen=True)
class SubGoalParameters(BoundaryParameters):
    """Parameters of bugs that go from corner to corner."""

    clearance: float | None = None
    """Distance from a corner to its sub-goal, and from the robot's centre to a wall [m]; None: the body's radius and one
    step."""
    turn: Turn = "left"
    """Which of two equally good corners to take, seen from the line to the goal."""
    leave_rule: LeaveRule = "any"
    """Where a goal may lie that is open only as far as the scan reaches: "any" everywhere, "front" within 90 degrees of
    the direction of travel."""
    jump: float | None = None
    """Change of the reading that makes an open point [m]; None: 0.5, for small robots less."""


class SubGoalBug(ScriptedPolicy):
    """What bugs that go from corner to corner share; each chooses the next corner by a rule of its own.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a clearance not above the radius, an unknown turn or rule, a jump not above 0.
    """

    Parameters = SubGoalParameters
    parameters: SubGoalParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        self.sub_goals = SubGoals(sensors, clearance=own.clearance, leave_rule=own.leave_rule, jump=own.jump)
        self.side = side_of(own.turn)

    def start(self) -> SubGoalMemory:
        """Memory of a new episode."""
        return SubGoalMemory(mode="motion_to_goal")

    def act(self, view: View, memory: Any) -> Velocity:
        """One decision."""
        profile = self.sub_goals.look(view)
        velocity = self.sub_goals.go_on(view, memory, profile)
        if velocity is not None:
            return velocity
        if self.sub_goals.looks_again(view, memory, profile):
            return STANDING
        point = self.choose(view, memory, profile)
        if point is None:
            return self.sub_goals.give_up(memory, self.verdict(profile))
        return self.sub_goals.set_out(view, memory, profile, point)

    @abstractmethod
    def choose(self, view: View, memory: Any, profile: Profile) -> OpenPoint | None:
        """The open point to go to next; None where there is none."""

    def verdict(self, profile: Profile) -> str:
        """What it means that there is none."""
        return "stuck"

    def draw(self, memory: Any) -> Drawing:
        """Sub-goals and the present corner."""
        return self.sub_goals.draw(memory)


def cheapest(points: list[OpenPoint], cost: Callable[[OpenPoint], float], side: int) -> OpenPoint | None:
    """The open point of least cost [m]; of equal ones the first met when turning from the goal to a side; None of none.

    Args:
        points: to choose from.
        cost: of one of them [m].
        side: +1 turns left, -1 right.
    """
    costs = [cost(point) for point in points]
    equal = [point for point, value in zip(points, costs, strict=True) if value <= min(costs) + TIE]
    return min(equal, key=lambda point: rotation_to(point, side), default=None)


def distance_between(first: tuple[Point, Point], second: tuple[Point, Point]) -> float:
    """Distance between two straight lines that do not cross, each from one point to another [m]."""
    ends = (*((end, second) for end in first), *((end, first) for end in second))
    return min(kernels.point_wall_distance(*end, *begin, *until) for end, (begin, until) in ends)


def rotation_to(point: OpenPoint, side: int) -> float:
    """Angle from the goal's bearing to an open point, turning to the left (+1) or right (-1), in [0, 2 pi) [rad]."""
    return point.rotation if side > 0 else (-point.rotation) % (2.0 * math.pi)


def goal_distance_of(view: View, place: Point) -> float:
    """Distance from a place in the robot's frame to the goal [m]."""
    return math.dist(place, view.goal)
