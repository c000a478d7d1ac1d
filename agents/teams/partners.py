"""What robots of a team do about one another's bodies: take them out of scans, keep apart, and follow their own trace.

A partner's place is known from what it told, so its body can be told from a wall. What it hides it sees itself, and
tells that too: the points of its own scan behind it stand for the beams that its body stopped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.teams.hidden import ROUNDING, look_through_partners
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.team_policy import TeamMemory
from bug_gym.view import Sensors, View, ranges_together

BODY_MARGIN = 0.03
"""How far outside a partner's body a scan point may lie and still be of it [m], besides the noise of a range."""

ROOM = 0.1
"""What bodies keep between them [m]."""

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
        reach, widest = sensors.radius + BODY_MARGIN + 3.0 * sensors.range_noise, SAME_WALL * 2.0 * math.pi / beams
        self._limits = np.array([sensors.range, reach, widest, sensors.bridged_gap, sensors.is_full_circle])
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
            assert memory.view is not None and memory.frame is not None
            views.append(memory.view)
            lie.append((*memory.frame.lies, *memory.view.pose, does_look, is_partner))
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
    """How far from one another two robots may be that come nearer than `least_gap` in one step [m]."""
    return least_gap(sensors) + 2.0 * (sensors.step_length + ROUNDING)


def place_after(memory: TeamMemory, velocity: Velocity) -> Point:
    """Where a robot will be after a step at a velocity of its frame, in the team's frame [m]."""
    assert memory.word is not None and memory.view is not None
    duration, heading = memory.view.sensors.drive.step, memory.word.heading
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = memory.word.place
    return (
        x + duration * (cos * velocity[0] - sin * velocity[1]),
        y + duration * (sin * velocity[0] + cos * velocity[1]),
    )


def gap(one: TeamMemory, other: TeamMemory) -> float:
    """Distance between the centres of two robots, as they told it [m]."""
    assert one.word is not None and other.word is not None
    return math.dist(one.word.place, other.word.place)


def nearer_than(distance: float, team: Sequence[int], memories: Sequence[TeamMemory]) -> dict[int, dict[int, float]]:
    """For each robot of a team those that are nearer to it than a distance [m], and how near they are [m]."""
    near: dict[int, dict[int, float]] = {}
    places: list[tuple[int, Point]] = []
    for robot in team:
        near[robot], word = {}, memories[robot].word
        if word is None:
            continue
        for other, there in places:
            apart = math.dist(word.place, there)
            if apart < distance:
                near[robot][other] = near[other][robot] = apart
        places.append((robot, word.place))
    return near


def closes(
    one: TeamMemory, velocity: Velocity, other: TeamMemory, other_velocity: Velocity, now: float, least: float
) -> bool:
    """Whether a step at velocities of their frames lessens the gap `now` between two robots to below `least` [m]."""
    assert one.view is not None
    duration = one.view.sensors.drive.step
    if now - duration * (math.hypot(*velocity) + math.hypot(*other_velocity)) > least + ROUNDING:
        return False
    distance = math.dist(place_after(one, velocity), place_after(other, other_velocity))
    return distance < least and distance < now - 1e-6


def distance_to_segment(place: Point, begin: Point, end: Point) -> float:
    """Distance of a place to the straight line between two others [m]."""
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    square = dx * dx + dy * dy
    share = ((place[0] - begin[0]) * dx + (place[1] - begin[1]) * dy) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(place[0] - begin[0] - share * dx, place[1] - begin[1] - share * dy)
