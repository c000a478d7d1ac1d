"""What robots of a team do about one another's bodies: take them out of scans, keep apart, and follow their own trace.

A partner's place is known from what it told, or where odometry has drifted from what both see of one another, so its body
can be told from a wall. What it hides it sees itself, and tells that too: the points of its own scan behind it stand for the
beams that its body stopped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kinematics
from bug_gym.agents.teams.hidden import ROUNDING, look_through_partners
from bug_gym.geometry import Point, velocity_along, wrap
from bug_gym.inertia import farthest_way, shown_points, way_to_stand
from bug_gym.policy import STANDING, Velocity
from bug_gym.team_policy import TOGETHER, TeamMemory, Word, met, peer_slot, word_of
from bug_gym.view import Sensors, View, ranges_together

BODY_MARGIN = 0.03
"""How far outside a partner's body a scan point may lie and still be of it [m], besides the noise of a range."""

ROOM = 0.1
"""What bodies keep between them [m]."""

AS_TOLD = 1e-3
"""A robot that is seen within this of the place [m], and the heading [rad], that it told is where it told."""

TOUCHING = 0.005
"""Bodies that come nearer to one another than this on their way may touch: their places are rounded [m]."""

CLOSING = 1e-6
"""By how much a gap lessens that does [m]."""

SAME_WALL = 6.0
"""Two neighbouring points of a scan are of one wall where they are nearer than so many beams are apart there."""


class Seen(NamedTuple):
    """What a robot sees without its partners."""

    view: View
    """The observation without their bodies, and with what they see behind themselves."""
    hidden: NDArray[np.bool_] | None = None
    """Which beams (B,) they stopped; None: none."""

    def still(self) -> View:
        """The same with a range of nothing where they stood before it: there is no telling what has moved."""
        return self.view if self.hidden is None else self.view.showing(np.where(self.hidden, 0.0, self.view.ranges))


class SeeThrough:
    """How robots of a team look through one another's bodies, all at once.

    Args:
        sensors: of each.
        robots: how many they are at most.
    """

    def __init__(self, sensors: Sensors, robots: int) -> None:
        beams = len(sensors.angles)
        widest = SAME_WALL * 2.0 * math.pi / beams
        self.reach = sensors.radius + BODY_MARGIN + 3.0 * sensors.range_noise
        """How near to a robot's place a point is of its body [m]."""
        self._limits = np.array([sensors.range, self.reach, widest, sensors.bridged_gap, sensors.is_full_circle])
        self._directions = sensors.beam_directions
        most = max(robots, beams) + 1
        self._to_work_in = np.empty((2, most), dtype=np.int64), np.empty((2, most, 4))

    def seen(self, robots: Sequence[TeamMemory], looks: Sequence[bool], partners: Sequence[bool]) -> list[Seen]:
        """What robots see without the bodies of partners.

        Args:
            robots: ones that answer.
            looks: which of them look (k,); the others get to see what their scanners see.
            partners: whose bodies are to be taken out (k,).
        """
        views: list[View] = []
        lie = []
        for memory, does_look, is_partner in zip(robots, looks, partners, strict=True):
            assert memory.view is not None
            views.append(memory.view)
            lie.append((*now_of(memory).frame.lies, *memory.view.pose, does_look, is_partner))
        count, beams = len(views), self._directions.shape[1]
        clean, hidden = np.empty((count, beams)), np.empty((count, beams), dtype=np.bool_)
        points, counts = np.empty((count, 2, beams)), np.empty((count, 2), dtype=np.int64)
        known = ranges_together(views), self._directions, self._limits, np.array(lie)
        look_through_partners(*known, clean, hidden, points, counts, *self._to_work_in)
        seen = []
        for number, (view, (taken, left)) in enumerate(zip(views, counts.tolist(), strict=True)):
            if taken > 0:
                others = points[number, 0, :left], points[number, 1, :left]
                seen.append(Seen(view.showing(clean[number], others), hidden[number]))
            else:
                seen.append(Seen(view))
        return seen


def least_gap(sensors: Sensors) -> float:
    """How near to one another the centres of two robots may come [m]."""
    return 2.0 * sensors.radius + ROOM


def farthest_blocker(sensors: Sensors) -> float:
    """How far from one another two robots may be that come nearer than `least_gap` in one step, and while they brake [m]."""
    return least_gap(sensors) + 2.0 * (farthest_way(sensors) + ROUNDING)


def look_at_partners(memories: Sequence[TeamMemory]) -> None:
    """Find where robots that answer are to one another now, by what the first and each other one of them see.

    What they tell, by odometry alone, is wrong by as much as that has drifted: soon by more than the room that they keep.
    """
    heard = [robot for robot, memory in enumerate(memories) if memory.is_heard]
    for memory in memories:
        memory.sight = None
    for robot in heard[1:]:
        one, own = memories[heard[0]], memories[robot]
        assert one.frame is not None and one.view is not None and own.view is not None and own.word is not None
        frame = met(one.frame, one.view, own.view, peer_slot(heard[0], robot), peer_slot(robot, heard[0]))
        seen, told = word_of(own.view, frame), own.word
        if math.dist(seen.place, told.place) > AS_TOLD or abs(wrap(seen.heading - told.heading)) > AS_TOLD:
            own.sight = seen


def now_of(memory: TeamMemory) -> Word:
    """Where a robot is: as it is seen, or as it told last."""
    word = memory.sight or memory.word
    assert word is not None
    return word


def place_after(memory: TeamMemory, velocity: Velocity) -> Point:
    """Where a robot will be after a step at a velocity of its frame, in the team's frame [m]."""
    assert memory.view is not None
    word = now_of(memory)
    duration, heading = memory.view.sensors.drive.step, word.heading
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = word.place
    return (
        x + duration * (cos * velocity[0] - sin * velocity[1]),
        y + duration * (sin * velocity[0] + cos * velocity[1]),
    )


def driven_after(memory: TeamMemory, velocity: Velocity) -> Point:
    """Where a step at a velocity of its frame brings a robot that turns toward it meanwhile, in the team's frame [m]."""
    assert memory.view is not None
    drive = memory.view.sensors.drive
    speed, rate = kinematics.turning(drive, velocity)
    half = 0.5 * drive.step * rate
    chord = speed * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    return place_after(memory, velocity_along(half, chord))


def points_told(memory: TeamMemory, view: View) -> NDArray[np.float64]:
    """What a robot sees (k, 2), in the team's frame [m]."""
    assert memory.frame is not None
    (cos, sin), (x, y) = memory.frame.direction, shown_points(view)
    return np.stack([memory.frame.x + cos * x - sin * y, memory.frame.y + sin * x + cos * y], axis=-1)


def are_linked(one: Point, other: Point, points: NDArray[np.float64], *, link: float, aside: float) -> bool:
    """Whether points (k, 2) lead from one place to another, none farther than a link [m] from the next.

    Points count that make the way from the one to the other at most so much longer: `aside` [m].
    """
    ends = np.array([one, other])
    ways = np.linalg.norm(points[:, None] - ends, axis=-1).sum(axis=-1)
    near = np.concatenate([ends, points[ways <= math.dist(one, other) + aside]])
    is_next = np.linalg.norm(near[:, None] - near, axis=-1) <= link
    reached, count = is_next[0], 0
    while not reached[1] and reached.sum() > count:
        count, reached = int(reached.sum()), is_next[reached].any(axis=0)
    return bool(reached[1])


def gap(one: TeamMemory, other: TeamMemory) -> float:
    """Distance between the centres of two robots [m]."""
    return math.dist(now_of(one).place, now_of(other).place)


def nearer_than(distance: float, team: Sequence[int], memories: Sequence[TeamMemory]) -> dict[int, dict[int, float]]:
    """For each robot of a team those that are nearer to it than a distance [m], and how near they are [m]."""
    near: dict[int, dict[int, float]] = {}
    places: list[tuple[int, Point]] = []
    for robot in team:
        near[robot], memory = {}, memories[robot]
        if memory.word is None:
            continue
        word = now_of(memory)
        for other, there in places:
            apart = math.dist(word.place, there)
            if apart < distance:
                near[robot][other] = near[other][robot] = apart
        places.append((robot, word.place))
    return near


def closes(
    one: TeamMemory, velocity: Velocity, other: TeamMemory, other_velocity: Velocity, now: float, least: float
) -> bool:
    """Whether a step at velocities of their frames lessens the gap `now` between two robots to below `least` [m].

    Of robots that turn: at these velocities, or as they turn toward them. Of robots with inertia: while they drive it, and then
    brake; where they come so near in any case, whether to stand at once keeps them farther apart. Or whether their bodies
    touch on the way, which a gap that is as wide again at its end does not tell.
    """
    assert one.view is not None
    sensors = one.view.sensors
    if sensors.drive.has_inertia:
        if now - 2.0 * farthest_way(sensors) > least + ROUNDING:
            return False
        after = gap_on_ways(way_of(one, velocity), way_of(other, other_velocity))
        return after < least and after < gap_on_ways(way_of(one, STANDING), way_of(other, STANDING)) - ROUNDING
    duration = sensors.drive.step
    if now - duration * (math.hypot(*velocity) + math.hypot(*other_velocity)) > least + ROUNDING:
        return False
    ends = place_after(one, velocity), place_after(other, other_velocity)
    distance = math.dist(*ends)
    if sensors.drive.kinematics != "holonomic":
        ends = driven_after(one, velocity), driven_after(other, other_velocity)
        distance = min(distance, math.dist(*ends))
    if distance < least and distance < now - CLOSING:
        return True
    on_the_way = distance_to_segment((0.0, 0.0), _from_to(now_of(one).place, now_of(other).place), _from_to(*ends))
    return on_the_way < 2.0 * sensors.radius + TOUCHING and on_the_way < now - CLOSING


def away_from(memory: TeamMemory, others: Sequence[TeamMemory], *, within: float) -> float | None:
    """The bearing that leads a robot straight off those that are nearer than `within` [m]; None: nobody is, or all about it."""
    here = now_of(memory)
    x = y = 0.0
    for other in others:
        apart = _from_to(now_of(other).place, here.place)
        distance = math.hypot(*apart)
        if TOGETHER < distance <= within:
            x, y = x + apart[0] / distance, y + apart[1] / distance
    return wrap(math.atan2(y, x) - here.heading) if math.hypot(x, y) > TOGETHER else None


# --------------------------------------------------------------------------------------- robots that cannot stop at once


def way_of(memory: TeamMemory, velocity: Velocity) -> NDArray[np.float64]:
    """Where a robot is step by step (k, 2) that drives at a velocity of its frame and then brakes, in the team's frame [m]."""
    assert memory.view is not None
    drive = memory.view.sensors.drive
    return way_asked(memory, velocity if drive.kinematics == "holonomic" else kinematics.turning(drive, velocity))


def way_asked(memory: TeamMemory, asked: Velocity) -> NDArray[np.float64]:
    """The same of one that asks for a velocity (`kinematics.asked_velocity`); who does not answer stands."""
    assert memory.view is not None
    word = now_of(memory)
    x, y = word.place
    if not memory.is_heard:
        return np.array([[x, y]])
    ahead, left = way_to_stand(memory.view, asked).T
    cos, sin = math.cos(word.heading), math.sin(word.heading)
    return np.stack([x + cos * ahead - sin * left, y + sin * ahead + cos * left], axis=-1)


def gap_on_ways(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """How near to one another two robots come that are at places (k, 2) and (m, 2) step by step, and stay at the last [m]."""
    steps = max(len(one), len(other), 2)
    apart = one[np.minimum(np.arange(steps), len(one) - 1)] - other[np.minimum(np.arange(steps), len(other) - 1)]
    begin, way = apart[:-1], np.diff(apart, axis=0)
    square = np.maximum((way * way).sum(axis=-1), 1e-12)
    share = np.clip(-(begin * way).sum(axis=-1) / square, 0.0, 1.0)
    return float(np.linalg.norm(begin + share[:, None] * way, axis=-1).min())


def who_goes(
    wished: Sequence[NDArray[np.float64]], braked: Sequence[NDArray[np.float64]], *, reach: float, least: float
) -> list[bool]:
    """Which of some robots may go as they wish, so that they can all come to stand without coming too near to one another.

    Each in turn goes unless that brings it nearer than `least` to another one, and nearer than to brake does. Those that
    brake at first may go once others do that were in their way.

    Args:
        wished: where each is step by step (k, 2) that does as it wishes and then brakes [m].
        braked: likewise, that brakes at once.
        reach: how far from one another two are that need not mind one another [m].
        least: how near they may come [m].
    """
    ways, goes = list(braked), [False] * len(braked)
    near = [
        [k for k in range(len(ways)) if k != robot and math.dist(ways[k][0], way[0]) < reach]
        for robot, way in enumerate(ways)
    ]

    def is_clear(robot: int, other: int) -> bool:
        after = gap_on_ways(wished[robot], ways[other])
        return after >= least or after >= gap_on_ways(braked[robot], braked[other]) - ROUNDING

    for robot in (*range(len(ways)), *range(len(ways))):
        if not goes[robot] and all(is_clear(robot, other) for other in near[robot]):
            ways[robot], goes[robot] = wished[robot], True
    return goes


def _from_to(one: Point, other: Point) -> Point:
    """Where one place lies as seen from another [m]."""
    return other[0] - one[0], other[1] - one[1]


def distance_to_segment(place: Point, begin: Point, end: Point) -> float:
    """Distance of a place to the straight line between two others [m]."""
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    square = dx * dx + dy * dy
    share = ((place[0] - begin[0]) * dx + (place[1] - begin[1]) * dy) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(place[0] - begin[0] - share * dx, place[1] - begin[1] - share * dy)
