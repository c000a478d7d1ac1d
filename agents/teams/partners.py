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

from bug_gym.agents.teams.hidden import IS_CHANGED, ROUNDING, look_through_partners
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.team_policy import TeamMemory
from bug_gym.view import Sensors, View

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
        return self.view if self.hidden is None else self.view.with_ranges(np.where(self.hidden, 0.0, self.view.ranges))


def without_partners(robots: Sequence[TeamMemory], looks: Sequence[bool], partners: Sequence[bool]) -> list[Seen]:
    """What robots see without the bodies of partners.

    Args:
        robots: ones that answer.
        looks: which of them look (k,); the others get to see what their scanners see.
        partners: whose bodies are to be taken out (k,).
    """
    views = [view for memory in robots if (view := memory.view) is not None]
    frames = [(frame.x, frame.y, frame.heading) for memory in robots if (frame := memory.frame) is not None]
    sensors = views[0].sensors
    scans = np.concatenate([view.ranges for view in views]).reshape(len(views), -1)
    clean, hidden, most = scans.copy(), np.zeros(scans.shape, dtype=np.bool_), max(scans.shape) + 1
    roles = np.array([looks, partners, partners])
    look_through_partners(
        scans,
        sensors.beam_directions,
        sensors.range,
        np.array([(*frame, *view.pose) for frame, view in zip(frames, views, strict=True)]),
        roles,
        sensors.radius + BODY_MARGIN + 3.0 * sensors.range_noise,
        SAME_WALL * 2.0 * math.pi / len(sensors.angles),
        clean,
        hidden,
        np.empty((2, most), dtype=np.int64),
        np.empty((2, most, 4)),
    )
    return [
        Seen(view.with_ranges(clean[number]), hidden[number]) if is_changed else Seen(view)
        for number, (view, is_changed) in enumerate(zip(views, roles[IS_CHANGED].tolist(), strict=True))
    ]


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
    near: dict[int, dict[int, float]] = {robot: {} for robot in team}
    places = [(robot, word.place) for robot in team if (word := memories[robot].word) is not None]
    for count, (robot, place) in enumerate(places):
        for other, there in places[:count]:
            apart = math.dist(place, there)
            if apart < distance:
                near[robot][other] = near[other][robot] = apart
    return near


def closes(one: TeamMemory, velocity: Velocity, other: TeamMemory, other_velocity: Velocity, least: float) -> bool:
    """Whether a step at velocities of their frames lessens the gap between two robots to below `least` [m]."""
    assert one.view is not None
    now, duration = gap(one, other), one.view.sensors.drive.step
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
