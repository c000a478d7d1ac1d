"""Sub-goals, beside corners in sight: which of them count, how a robot goes to one, and what it remembers of them.

The robot goes to a sub-goal along the line that just passes the corner at the clearance, then round the corner as a
hand on the wall would, until it looks past it: what a point robot does in no time by standing in the corner.

Source: Das, Dutta and Debnath (2020) for sub-goals; see open_points for what they lie beside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from bug_gym import kernels
from bug_gym.agents.scan.way_in import is_goal_by_wall
from bug_gym.agents.walls.boundary import WAIT, Boundary
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory, Contour
from bug_gym.agents.walls.open_points import Lookout, OpenPoint, Profile
from bug_gym.agents.walls.roaming import Roaming
from bug_gym.geometry import Point, wrap
from bug_gym.policy import STANDING, Drawing, Velocity
from bug_gym.view import Sensors, View

JUMP = 0.5
"""Change of the reading that makes an open point [m], at most: behind a gap that a small robot passes there may be only
as much room as it needs."""

SHORT = 0.5
"""By how much of its distance an end in sight may seem to move between two decisions, along the line of sight."""

LOOKS = 5
"""How often it looks again at most: an end that the beams hardly tell comes and goes for ever."""

LONGEST_ROUND = 1.5 * math.pi
"""Turning after which a corner is left whatever lies behind it: a post has no other side [rad]."""


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
    roaming: Roaming = field(default_factory=Roaming)
    """How far it has gone, and over what ground."""
    looks: int = 0
    """How often it has stood for another look before it chooses."""


class SubGoals:
    """How a robot sees open points and goes to sub-goals; the settings that these bugs share.

    Args:
        sensors: what a driver knows of the robot.
        clearance: see Boundary; also from a corner to its sub-goal [m].
        leave_rule: see Boundary; here it says where a goal may lie that is open only as far as the scan reaches.
        jump: change of the reading that makes an open point [m]; None: JUMP, or half the gap it passes if that is less.
        foresees: see Boundary.

    Raises:
        ValueError: a clearance not above the body's radius, an unknown leave rule, a jump not above 0.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        leave_rule: str = "any",
        jump: float | None = None,
        foresees: bool = False,
    ) -> None:
        self.boundary = Boundary(sensors, clearance=clearance, leave_rule=leave_rule, foresees=foresees)
        jump = min(JUMP, self.boundary.inner) if jump is None else jump
        if not jump > 0.0 or not math.isfinite(jump):
            raise ValueError(f"jump must be above 0 m, got {jump!r}")
        self.same = self.boundary.gate_half_width
        """Distance within which two corners are one [m]."""
        # Noise must not close the view along a wall at the clearance.
        safe, noise = self.boundary.safe_radius, 2.0 * sensors.range_noise
        self.leg_radius = max(safe, self.boundary.hit_radius - noise)
        """Of the disc whose way to a corner must be free [m]."""
        self.lookout = Lookout(sensors, radius=max(safe, self.boundary.inner - noise), jump=jump)

    # ------------------------------------------------------------------------------------------ which open points count

    def look(self, view: View) -> Profile:
        """The free ways of a disc over the full circle, counted from the goal's bearing, and where they jump."""
        return self.lookout.look(view)

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
        """Whether an open point is one of the last decision."""
        near = 2.0 * self.boundary.clearance
        return point.side == end.side and is_seen_again(
            point.corner, view.to_robot(*end.corner), self._drift(point), near
        )

    def _drift(self, point: OpenPoint) -> float:
        """How far beside where it is seen now a corner may turn out to be [m]."""
        return max(self.same, 1.5 * self.lookout.spacing * math.hypot(*point.corner))

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

    # ------------------------------------------------------------------------------------------------------ going there

    def go_on(self, view: View, memory: SubGoalMemory, profile: Profile) -> Velocity | None:
        """Velocity to the goal where it is in sight, else on to the sub-goal; None where a new one is to be chosen."""
        self.boundary.advance(view, memory)
        self._follow_target(view, memory)
        if memory.roaming.goes_on(view.position, memory.odometer):
            memory.verdict = "looping"
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
        is_in_sight = distance <= view.sensors.range
        return is_in_sight and self._goal_way(view, memory, profile) >= distance - self._short_of_goal(view)

    def _is_open(self, view: View, memory: SubGoalMemory, profile: Profile) -> bool:
        """Whether nothing in sight is in the way to the goal; with the rule "front" only for a goal ahead."""
        away = view.goal_distance - self._short_of_goal(view)
        is_free = self._goal_way(view, memory, profile) >= min(away, view.sensors.range)
        return is_free and self.boundary.may_head(memory.contour, view.goal_bearing + view.heading)

    def _short_of_goal(self, view: View) -> float:
        """How far before the goal [m] its way may end: where the robot is there, or from where the rest shows (way_in)."""
        near = self.boundary.exact_length
        is_far = view.goal_distance > near
        return near if is_far and is_goal_by_wall(view) else view.sensors.goal_radius

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

    # ------------------------------------------------------------------------------------------------ what it remembers

    def _follow_target(self, view: View, memory: SubGoalMemory) -> None:
        """Forget where it has been when the target is elsewhere: all corners may be worth a visit again."""
        if memory.goal is not None and math.dist(memory.goal, view.goal_position) <= TARGET_MOVED:
            return
        memory.goal = view.goal_position
        memory.visits.clear()
        memory.blocked.clear()
        memory.roaming.begin(view.goal_distance, memory.odometer)

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


def is_seen_again(corner: Point, earlier: Point, aside: float, near: float) -> bool:
    """Whether an open point may be one of an earlier look.

    Where the line of sight grazes a surface its last point in sight falls short by what lies between two beams, and by
    more along that line than across it.

    Args:
        corner: now, robot's frame [m].
        earlier: then, robot's frame of now [m].
        aside: how far it may have moved across the line of sight [m].
        near: how far along it at least, where it is near [m].
    """
    (x, y), (u, v) = corner, earlier
    away = max(math.hypot(x, y), 1e-9)
    along, across = (x * u + y * v) / away - away, (x * v - y * u) / away
    return abs(across) <= aside and abs(along) <= max(near, SHORT * away)


def distance_between(first: tuple[Point, Point], second: tuple[Point, Point]) -> float:
    """Distance between two straight lines that do not cross, each from one point to another [m]."""
    ends = (*((end, second) for end in first), *((end, first) for end in second))
    return min(kernels.point_wall_distance(*end, *begin, *until) for end, (begin, until) in ends)
