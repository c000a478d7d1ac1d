"""OperativeCriticalPointBug: the virtual circle's centre goes from sub-goal to sub-goal, each the nearest to the goal.

Source: Das, Dutta and Debnath (2020). Sensing assumed: a scan all round; goal, own position, size of the body. Memory
kept: critical points chosen, what stands, what has shifted once and twice. States: rotation, looking (on the spot,
the first of two looks), motion_to_goal, motion_to_critical_point, waiting. Each open point gives a sub-goal at the
radius of the virtual circle, square to the line of sight; where something is in the way to the goal, the robot turns
on the spot and goes straight to the nearest one to the goal that was not chosen before and is a SAFE_POINT. A moving
obstacle whose track meets the robot's in time leaves a virtual obstacle there. Guarantee: none, it can cycle (then
"looping"); with no sub-goal left it stops as "stuck". Length bound: none.

What the paper leaves open or prints wrongly, and how it is here: the four cases of equation (4) hold below 180 degrees
only and (5) has cos twice (`sub_goal`); sub-goals as printed touch things, so each leg is looked at again at each step
with a swept disc ("validated"); SAFE_POINT of a step ahead measures the width of a pole beside the track (`gap_rule`);
an unsafe point is followed by the next nearest, and an unsafe step ahead counts as an obstacle; (10) has the robot's
distance in place of the obstacle's (`timing`); open points slide over round bodies, so still ones would move
(`classify`). If no sub-goal passes the robot waits, which counts as detection. Steps ahead are not stored in the set T.

Reported: no numbers; small gaps are passed and too small ones avoided, few obstacles are considered, it takes about the
time of others where obstacles are few. Found: so, with these repairs; as printed it runs into the first slab. Before the
slab [8, 12] x [-3, 5] m the right sub-goal at a radius of 0.5 m moves from (8.176, -2.824), inside the slab, to
(7.824, -3.468), and the way becomes 21.47 m; an obstacle at (5, -2.5) m that crosses at 0.5 m/s is met after 5 s in place
of 10 s, and avoided in place of missed; a pole beside the track stops the robot no more. What each repair is worth in
worlds at random: docs/results/operative-critical-points.md.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.critical_points.circle import Leg, leg_along, leg_to, virtual_circle
from bug_gym.agents.critical_points.looks import INTERVAL, THRESHOLD
from bug_gym.agents.critical_points.meeting import (
    Mover,
    is_behind,
    least_distance,
    meeting_times,
    printed_times,
    ring,
    virtual_obstacle,
)
from bug_gym.agents.critical_points.memory import CriticalPoint, LastEnd, OperativeMemory, OperativeParameters
from bug_gym.agents.critical_points.moving import rules_of_looks
from bug_gym.agents.critical_points.reading import JUMP, End, Reading, Scanner
from bug_gym.agents.critical_points.scan_kernels import can_turn, sweep_leg
from bug_gym.agents.critical_points.sub_goals import perpendicular_sub_goal, printed_sub_goal
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.agents.walls.boundary import WAIT, side_of
from bug_gym.agents.walls.contour import TARGET_MOVED
from bug_gym.agents.walls.open_points import TIE
from bug_gym.agents.walls.sub_goals import is_seen_again
from bug_gym.geometry import F64, Point, velocity_along, wrap
from bug_gym.policy import CREEP, STANDING, Drawing, ScriptedPolicy, Velocity, hidden_gap
from bug_gym.view import Sensors, View

ALIGNED = math.radians(1.0)
"""Heading error from which on the robot turns on the spot before a leg [rad]."""

SURE_WAY = 3.0
"""How far a leg under way must be free in any case [m]; noise alone may shut what lies farther."""

WIDER = (1.0, math.sqrt(2.0), 2.0)
"""Distances of a sub-goal from its open point to try, in radii: r / cos(D / 2) for turns D of 0, 90 and 120 degrees,
where the leg from the last sub-goal would cut the corner."""

ONWARD = 2.0
"""How long the way on from a sub-goal toward the goal, or the sub-goal itself, must be free in time too [s]."""


class Sight(NamedTuple):
    """What one decision rests on."""

    movers: list[Mover]
    """What moves."""
    is_mover: NDArray[np.bool_] | None
    """Whether each beam ended at one of them (B,); None: none did."""
    x: F64
    """Points of all else (k,), robot's frame [m]."""
    y: F64
    """[m]."""


class Candidate(NamedTuple):
    """A sub-goal, in the robot's frame."""

    end: End
    """The open point that it lies beside."""
    place: Point
    """[m]."""
    number: int
    """Of the open point among those of the scan."""


class OperativeCriticalPointBug(ScriptedPolicy):
    """OperativeCriticalPointBug.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a circle not wider than the body, both ways to say its radius, a jump not above 0.
    """

    Parameters = OperativeParameters
    parameters: OperativeParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        self.circle = virtual_circle(sensors.footprint, self._safety())
        self.side = side_of(own.turn)
        radius, body = self.circle.radius, self.circle.body
        jump = max(min(JUMP, radius), 6.0 * sensors.range_noise) if own.jump is None else own.jump
        self.tracker = Tracker(sensors)
        self.rules = rules_of_looks(sensors)
        self.shift, self.interval = float(self.rules[THRESHOLD]), float(self.rules[INTERVAL])
        # A little more than the brake of differential robots asks for, else it stops them on the leg.
        least = min(body + 2.0 * sensors.range_noise + 0.021, radius)
        self.keep = least + 0.05 * (radius - least)
        """Radius of the disc that must pass along the leg under way [m]."""
        self.take = min(least + max(0.2 * (radius - least), sensors.range_noise), radius)
        """The same along a leg that is chosen [m]; else noise would take the leg back while the robot turns to it."""
        # A car turns in moves of its own.
        self.swing = min(body + hidden_gap(sensors), radius) if sensors.drive.kinematics == "differential" else body
        """Radius of the disc that must pass where a body whose circle lies off the axle swings round on the spot [m]."""
        self.spare = 6.0 * sensors.range_noise
        """What the far end of a long leg under way may seem to lack [m]: it is looked at again from nearer."""
        self.near = 0.5 * (body + radius)
        """How near to the outline of a mover the circle's centre comes in time, along a leg [m]."""
        self.nearest = 0.75 * body + 0.25 * radius
        """The same along the leg under way [m]."""
        # The sensor is not at the circle's centre: a disc that it holds in any case looks round.
        self.scanner = Scanner(sensors, radius=max(self.keep - self.circle.offset, 0.25 * self.keep), jump=jump)
        # The least of many distances is short by noise.
        self.width = 2.0 * radius - 4.0 * sensors.range_noise
        """Gaps up to this are unsafe [m]."""
        self.gap_rule = own.gap_rule or ("two_nearest" if own.sub_goal == "printed" else "leg")
        self.same = max(2.0 * sensors.step_length, 0.5 * radius)
        """Sub-goals and open points nearer to each other than this are one [m]."""
        self.turns = sensors.drive.kinematics != "holonomic"
        beams = len(sensors.angles)
        self._left, self._right = np.empty(beams, dtype=np.int64), np.empty(beams, dtype=np.int64)

    def _safety(self) -> float:
        """The safety constant."""
        own, body = self.parameters, virtual_circle(self.sensors.footprint, 0.0).body
        if own.clearance is not None:
            if own.safety is not None:
                raise ValueError(f"expected safety or clearance, got both: {own.safety!r} and {own.clearance!r} m")
            if not own.clearance > body or not math.isfinite(own.clearance):
                raise ValueError(f"clearance must be above the body's radius of {body:g} m, got {own.clearance!r}")
            return own.clearance - body
        safety = self.sensors.step_length if own.safety is None else own.safety
        if not safety > 0.0 or not math.isfinite(safety):
            raise ValueError(f"safety must be above 0 m, got {safety!r}")
        return safety

    def start(self) -> OperativeMemory:
        """Memory of a new episode."""
        return OperativeMemory(mode="motion_to_goal", tracker=self.tracker.start())

    def act(self, view: View, memory: OperativeMemory) -> Velocity:
        """One decision."""
        self._advance(view, memory)
        sight = self._detect(view, memory)
        if memory.critical is not None:
            velocity = self._go_on(view, memory, sight, memory.critical)
            if velocity is not None:
                return velocity
        is_open = self._is_open(view, memory, sight)
        meetings = self._meetings(view, memory, sight)
        if is_open and not meetings:
            leg = leg_along(self.circle, view.goal_bearing, view.goal_distance, turns=self.turns)
            return self._drive(view, memory, leg, "motion_to_goal")
        return self._choose(view, memory, sight, only_virtual=is_open)

    # ------------------------------------------------------------------------------------------ OBSTACLE_DETECTION

    def _advance(self, view: View, memory: OperativeMemory) -> None:
        """Bring the memory up to the present."""
        drive = self.sensors.drive
        if memory.cost.pose is not None:
            memory.time += drive.step
        memory.cost.go_on(view.pose, drive.max_speed, drive.max_turn_rate if self.turns else math.inf)
        memory.circle = (*view.to_odometry(self.circle.ahead, self.circle.left), self.circle.radius)
        moved = 0.0 if memory.goal_seen is None else math.dist(memory.goal_seen, view.goal_position)
        memory.goal_seen, memory.goal_shift = view.goal_position, math.atan2(moved, view.goal_distance)
        if memory.goal is None or math.dist(memory.goal, view.goal_position) > TARGET_MOVED:
            memory.goal = view.goal_position
            memory.traversed.clear()
            memory.refused.clear()
            memory.used.clear()
            memory.roaming.begin(view.goal_distance, memory.cost.length)
        if memory.roaming.goes_on(view.position, memory.cost.length):
            memory.verdict = "looping"

    def _detect(self, view: View, memory: OperativeMemory) -> Sight:
        """Tell what stands from what moves."""
        if self.parameters.classify == "open_points":
            return self._detect_by_open_points(view, memory)
        assert memory.tracker is not None
        things, beam_thing = self.tracker.things(memory.tracker, view, memory.time)
        movers, is_dynamic = memory.sets.update(things, memory.time, self.rules)
        self._count_detections(memory, movers)
        if not movers:
            return Sight([], None, *view.points)
        is_mover = is_dynamic[beam_thing]
        return Sight(movers, is_mover, *self.scanner.points_but(view.ranges, is_mover))

    def _detect_by_open_points(self, view: View, memory: OperativeMemory) -> Sight:
        """The same by the printed rule: which beams a mover takes is not known, and all count as still."""
        reading = self.scanner.read(view, None, ())
        points = [(view.to_odometry(*end.point), self.circle.radius) for end in reading.ends]
        movers = memory.printed_sets.update(points, memory.time, self.shift)
        self._count_detections(memory, movers)
        return Sight(movers, None, *view.points)

    def _count_detections(self, memory: OperativeMemory, movers: list[Mover]) -> None:
        """Each moving obstacle that is found costs DOT."""
        for mover in movers:
            if mover.number not in memory.movers:
                memory.movers.add(mover.number)
                memory.cost.detecting += self.interval

    def _meetings(self, view: View, memory: OperativeMemory, sight: Sight) -> bool:
        """Whether tracks meet on the straight way to the goal; brings the virtual obstacles up to that."""
        before, memory.virtual = memory.virtual, {}
        speed = self.sensors.drive.max_speed
        place, velocity = memory.circle[:2], velocity_along(view.goal_bearing + view.heading, speed)
        times_of = meeting_times if self.parameters.timing == "corrected" else printed_times
        for mover in sight.movers:
            # One that is being avoided may come as near as along a leg: beside it the robot would turn back else.
            near = self.near if mover.number in before else self.circle.radius
            times = times_of(place, velocity, mover, near + mover.radius)
            if times is not None and times.first <= view.goal_distance / speed:
                memory.virtual[mover.number] = virtual_obstacle(mover, times)
                memory.avoided.add(mover.number)
        return bool(memory.virtual)

    # -------------------------------------------------------------------------------------------------- legs

    def _is_open(self, view: View, memory: OperativeMemory, sight: Sight) -> bool:
        """Whether nothing that stands is in the way to the goal, and the step ahead is a SAFE_POINT."""
        rest = min(max(view.goal_distance - self.sensors.goal_radius, 0.0), self.sensors.range)
        leg = leg_along(self.circle, view.goal_bearing, rest, turns=self.turns)
        if self.parameters.sub_goal != "validated":
            nearest = int(np.abs(np.angle(np.exp(1j * (self.sensors.angles - view.goal_bearing)))).argmin())
            is_free = bool(view.ranges[nearest] >= min(view.goal_distance, self.sensors.range))
        else:
            radius = self.keep if memory.mode == "motion_to_goal" else self.take
            is_free = self._is_swept(leg, sight.x, sight.y, radius)
        return is_free and self._is_safe(view, sight, leg, None)

    def _is_swept(self, leg: Leg, x: F64, y: F64, radius: float, spare: float = 0.0) -> bool:
        """Whether the circle may turn and go along a leg, or as far as `spare` before its end [m]."""
        if (
            self.turns
            and self.circle.offset > 0.0
            and not can_turn(x, y, self.circle.ahead, self.circle.left, leg.turn, self.swing)
        ):
            return False
        free, _, _ = sweep_leg(x, y, *leg.begin, leg.heading, leg.length, radius, 0.0, self._left, self._right)
        return free >= min(leg.length, max(leg.length - spare, SURE_WAY))

    def _is_safe(self, view: View, sight: Sight, leg: Leg, candidate: Candidate | None) -> bool:
        """SAFE_POINT of a leg: no gap across it up to the circle's width."""
        if not self.parameters.safe_point:
            return True
        if self.gap_rule == "two_nearest":
            return self._printed_gap(view, sight, leg, candidate) > 2.0 * self.circle.radius
        _, gap, _ = sweep_leg(
            sight.x, sight.y, *leg.begin, leg.heading, leg.length, 0.0, self.width, self._left, self._right
        )
        return math.isinf(gap)

    def _printed_gap(self, view: View, sight: Sight, leg: Leg, candidate: Candidate | None) -> float:
        """S_d as printed [m]: to the facing open point of the neighbour; ahead, between the two nearest open points."""
        points = [end.point for end in self.scanner.read(view, sight.is_mover, ()).ends]
        if candidate is not None:
            facing = (candidate.number + candidate.end.side) % max(len(points), 1)
            return math.dist(candidate.end.point, points[facing]) if len(points) > 1 else math.inf
        step = min(self.sensors.step_length, leg.length)
        ahead = leg._replace(length=step).end
        nearest = sorted(points, key=lambda point: math.dist(point, ahead))[:2]
        return math.dist(*nearest) if len(nearest) == 2 else math.inf

    def _meets_nobody(self, view: View, leg: Leg, movers: list[Mover], near: float) -> bool:
        """Whether the circle's centre stays further than `near` [m] from all movers, in time.

        The robot turns first and goes along the leg; then it may turn again and go on toward the goal, or stand.
        """
        if not movers:
            return True
        drive = self.sensors.drive
        begin, end = view.to_odometry(*leg.begin), view.to_odometry(*leg.end)
        turning = abs(leg.turn) / max(drive.max_turn_rate, 1e-6)
        velocity = velocity_along(leg.heading + view.heading, drive.max_speed)
        arrival = turning + leg.length / drive.max_speed
        goal = view.goal_position
        onward = math.atan2(goal[1] - end[1], goal[0] - end[0])
        turned = arrival
        if self.turns:
            turned += abs(wrap(onward - leg.heading - view.heading)) / max(drive.max_turn_rate, 1e-6)
        until = turned + min(math.dist(end, goal) / drive.max_speed, ONWARD)

        def is_clear(*parts: tuple[Point, Point, float, float]) -> bool:
            return all(least_distance(*part, mover) >= near + mover.radius for part in parts for mover in movers)

        return is_clear((begin, (0.0, 0.0), 0.0, turning), (begin, velocity, turning, arrival)) and (
            is_clear((end, (0.0, 0.0), arrival, turned), (end, velocity_along(onward, drive.max_speed), turned, until))
            or is_clear((end, (0.0, 0.0), arrival, arrival + ONWARD))
        )

    # ------------------------------------------------------------------------------------------ critical points

    def _go_on(self, view: View, memory: OperativeMemory, sight: Sight, critical: CriticalPoint) -> Velocity | None:
        """Velocity to the critical point; None where it is reached, or given up."""
        place = view.to_robot(*critical.place)
        reach = self.sensors.step_length * (1.0 if self.discrete else 0.1)
        if math.dist(place, (self.circle.ahead, self.circle.left)) <= reach:
            memory.traversed.append(critical.place)
            if math.dist(critical.place, critical.open_point.place) <= 1.01 * WIDER[-1] * self.circle.radius:
                memory.used.append(critical.open_point)
            memory.critical = None
            return None
        leg = leg_to(self.circle, place, turns=self.turns)
        is_reachable = leg is not None and memory.time <= critical.deadline
        if leg is None or not is_reachable:
            memory.refused.append(critical.place)
            memory.critical = None
            return None
        if self.parameters.sub_goal == "validated":
            if not self._meets_nobody(view, leg, sight.movers, self.nearest):
                memory.critical = None
                return None
            is_way = self._is_swept(leg, sight.x, sight.y, self.keep, spare=self.spare)
            if not (is_way and self._is_safe(view, sight, leg, None)):
                memory.refused.append(critical.place)
                memory.critical = None
                return None
        return self._drive(view, memory, leg, "motion_to_critical_point")

    def _choose(self, view: View, memory: OperativeMemory, sight: Sight, *, only_virtual: bool) -> Velocity:
        """Velocity to the best sub-goal that may be gone to; else wait."""
        reading = self._look(view, memory, sight)
        if reading is None:
            memory.mode = "looking"
            return STANDING
        candidates = self._in_order(view, memory, reading, only_virtual=only_virtual)
        memory.open_points = [view.to_odometry(*end.point) for end in reading.ends]
        memory.sub_goals = [view.to_odometry(*candidate.place) for candidate in candidates]
        for candidate in candidates:
            leg = self._leg_of(view, memory, sight, reading, candidate)
            if leg is None:
                continue
            memory.looked_at = -math.inf
            drive = self.sensors.drive
            seconds = abs(leg.turn) / max(drive.max_turn_rate, 1e-6) + leg.length / drive.max_speed
            place = view.to_odometry(*leg.end)
            memory.critical = CriticalPoint(
                place,
                LastEnd(view.to_odometry(*candidate.end.point), candidate.end.side),
                memory.time + 3.0 * seconds + 2.0,
            )
            memory.critical_points.append(place)
            memory.waited = 0.0
            return self._drive(view, memory, leg, "motion_to_critical_point")
        return self._wait(memory)

    def _look(self, view: View, memory: OperativeMemory, sight: Sight) -> Reading | None:
        """The scan, with the open points that the look before showed too; None at the first of two looks.

        A beam without a return, or two ranges at a small angle to a wall, open a wall for once.
        """
        reading = self.scanner.read(view, sight.is_mover, list(memory.virtual.values()))
        looks = [LastEnd(view.to_odometry(*end.point), end.side) for end in reading.ends]
        before, is_next = memory.last_ends, memory.time - memory.looked_at <= 1.5 * self.sensors.drive.step
        memory.last_ends, memory.looked_at = looks, memory.time
        if not is_next:
            return None
        near = 2.0 * self.circle.radius
        twice = [
            end
            for end in reading.ends
            if any(
                one.side == end.side
                and is_seen_again(end.point, view.to_robot(*one.place), self._drift(end.point), near)
                for one in before
            )
        ]
        return reading._replace(ends=twice)

    def _drift(self, point: Point) -> float:
        """How far an open point in the robot's frame may seem to move across the line of sight between two looks [m]."""
        return max(self.same, 1.5 * self.scanner.lookout.spacing * math.hypot(*point))

    def _wait(self, memory: OperativeMemory) -> Velocity:
        """Stand, and give up after WAIT seconds without anywhere to go: something may move away before."""
        memory.mode = "waiting"
        memory.waited += self.sensors.drive.step
        memory.cost.detecting += self.sensors.drive.step
        if memory.waited > WAIT:
            memory.verdict = "stuck"
        return STANDING

    def _in_order(
        self, view: View, memory: OperativeMemory, reading: Reading, *, only_virtual: bool
    ) -> list[Candidate]:
        """The sub-goals of all open points, the nearest to the goal first.

        Where only a virtual obstacle is in the way, its own alone count, those behind the mover first.
        """
        candidates = [
            Candidate(end, self._sub_goal(view, end, 1.0), number)
            for number, end in enumerate(reading.ends)
            if end.virtual is not None or not only_virtual
        ]

        def is_ahead(candidate: Candidate) -> bool:
            virtual = candidate.end.virtual
            return not (only_virtual and virtual and is_behind(view.to_odometry(*candidate.place), virtual))

        def distance(candidate: Candidate) -> float:
            return math.dist(candidate.place, view.goal)

        ranked = sorted(candidates, key=lambda one: (is_ahead(one), distance(one)))
        # Among equal ones the first that is met when turning from the goal to the side of `turn`.
        for first in range(len(ranked)):
            last = first + 1
            while last < len(ranked) and distance(ranked[last]) <= distance(ranked[first]) + TIE:
                if is_ahead(ranked[last]) != is_ahead(ranked[first]):
                    break
                last += 1
            ranked[first:last] = sorted(ranked[first:last], key=lambda one: self._rotation(view, one))
        # Those of open points that gave one before come last: there is hardly more to see from there.
        return sorted(ranked, key=lambda one: self._is_used(view, memory, one.end))

    def _is_used(self, view: View, memory: OperativeMemory, end: End) -> bool:
        """Whether sub-goals of an open point were made before, and one of them reached."""
        place = view.to_odometry(*end.point)
        return any(one.side == end.side and math.dist(one.place, place) <= 0.5 * self.same for one in memory.used)

    def _rotation(self, view: View, candidate: Candidate) -> float:
        """Angle from the goal's bearing to an open point, to the side of `turn`, in [0, 2 pi) [rad]."""
        return (self.side * (candidate.end.bearing - view.goal_bearing)) % (2.0 * math.pi)

    def _sub_goal(self, view: View, end: End, share: float) -> Point:
        """The sub-goal of an open point, so many radii from it, in the robot's frame [m]."""
        radius = share * self.circle.radius
        if self.parameters.sub_goal != "printed":
            return perpendicular_sub_goal(end.point, end.bearing, end.side, radius)
        point, bearing = view.to_odometry(*end.point), end.bearing + view.heading
        return view.to_robot(*printed_sub_goal(point, bearing, end.side, radius))

    def _leg_of(
        self, view: View, memory: OperativeMemory, sight: Sight, reading: Reading, candidate: Candidate
    ) -> Leg | None:
        """The leg to a sub-goal not yet visited, where it may be gone; None where none may."""
        if self.parameters.sub_goal != "validated":
            leg = leg_to(self.circle, candidate.place, turns=self.turns)
            is_new = leg is not None and self._is_new(view, memory, leg)
            return leg if leg is not None and is_new and self._is_safe(view, sight, leg, candidate) else None
        for share in WIDER:
            place = self._sub_goal(view, candidate.end, share)
            leg = leg_to(self.circle, place, turns=self.turns)
            for way in () if leg is None else (leg, self._detour(leg, reading)):
                if way is not None and self._may_go(view, memory, sight, reading, way, candidate):
                    return way
        return None

    def _may_go(
        self,
        view: View,
        memory: OperativeMemory,
        sight: Sight,
        reading: Reading,
        leg: Leg,
        candidate: Candidate,
    ) -> bool:
        """Whether a leg leads to a new place, past everything that stands, in time past what moves, and is safe."""
        if not (self._is_new(view, memory, leg) and self._is_swept(leg, reading.x, reading.y, self.take)):
            return False
        return self._meets_nobody(view, leg, sight.movers, self.near) and self._is_safe(view, sight, leg, candidate)

    def _detour(self, leg: Leg, reading: Reading) -> Leg | None:
        """The leg to a sub-goal beside what a leg touches first, as that touches it; None where it touches nothing.

        Beside a corner that the robot has come to, the way on may cut the corner by a little, which is no open point.
        """
        x, y = reading.x, reading.y
        free, _, touched = sweep_leg(x, y, *leg.begin, leg.heading, leg.length, self.take, 0.0, self._left, self._right)
        if free >= leg.length:
            return None
        cos, sin = math.cos(leg.heading), math.sin(leg.heading)
        beside = (y[touched] - leg.begin[1]) * cos - (x[touched] - leg.begin[0]) * sin
        side = -1 if beside > 0.0 else 1
        place = perpendicular_sub_goal((float(x[touched]), float(y[touched])), leg.heading, side, self.circle.radius)
        return leg_to(self.circle, place, turns=self.turns)

    def _is_new(self, view: View, memory: OperativeMemory, leg: Leg) -> bool:
        """Whether a leg leads away from here, to a place that was not visited."""
        return leg.length > self.sensors.step_length and not self._is_visited(view, memory, leg.end)

    def _is_visited(self, view: View, memory: OperativeMemory, place: Point) -> bool:
        """Whether a sub-goal is in the set T, or was given up on the way."""
        x, y = view.to_odometry(*place)
        if any(math.dist(other, (x, y)) <= self.same for other in memory.traversed):
            return True
        return any(math.dist(other, (x, y)) <= self.sensors.step_length for other in memory.refused)

    # -------------------------------------------------------------------------------------------------- motion

    def _drive(self, view: View, memory: OperativeMemory, leg: Leg, mode: str) -> Velocity:
        """Velocity along a leg: a turn on the spot, then straight on."""
        drive = self.sensors.drive
        # A goal that moves across is never ahead to a degree: it is led by what it moves meanwhile.
        aligned = ALIGNED + (2.0 * memory.goal_shift if mode == "motion_to_goal" else 0.0)
        if self.turns and abs(leg.heading) > aligned:
            memory.mode = "motion_to_goal" if mode == "motion_to_goal" else "rotation"
            return velocity_along(leg.heading, CREEP)
        memory.mode = mode
        ahead = min(self.sensors.step_length, leg.length)
        if math.isfinite(drive.max_acceleration):
            ahead = min(ahead, drive.step * math.sqrt(2.0 * drive.max_acceleration * leg.length))
        if self.parameters.sub_goal == "validated":
            x, y = view.points
            free, _, _ = sweep_leg(x, y, *leg.begin, leg.heading, ahead, self.keep, 0.0, self._left, self._right)
            if free < ahead:
                is_enough = mode == "motion_to_goal" and free >= view.goal_distance - self.sensors.goal_radius
                if not is_enough:  # a mover is right there
                    return self._wait(memory)
                ahead = max(free, 0.0)
        memory.waited = 0.0
        return velocity_along(leg.heading, ahead / drive.step)

    def draw(self, memory: OperativeMemory) -> Drawing:
        """Virtual circle, open points, sub-goals, critical points, virtual obstacles, and the line to the goal."""
        points = [(*place, "open_point") for place in memory.open_points]
        points += [(*place, "sub_goal") for place in memory.sub_goals]
        points += [(*place, "waypoint") for place in memory.critical_points]
        x, y, radius = memory.circle
        segments = []
        if memory.goal is not None:
            segments.append((x, y, *memory.goal, "to_goal"))
        if memory.critical is not None:
            points.append((*memory.critical.place, "chosen"))
            segments.append((x, y, *memory.critical.place, "chosen"))
        areas = [(ring((x, y), (x, y), radius), "circle")]
        for obstacle in memory.virtual.values():
            areas.append((ring(obstacle.begin, obstacle.end, obstacle.radius), "virtual"))
            points.append((*obstacle.point, "meeting"))
        return Drawing(points=points, segments=segments, areas=areas)
