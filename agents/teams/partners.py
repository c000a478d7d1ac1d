"""What robots of a team do about one another's bodies: take them out of scans, keep apart, and follow their own trace.

A partner's place is known from what it told, so its body can be told from a wall. What it hides it sees itself, and
tells that too: the points of its own scan behind it stand for the beams that its body stopped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bug_gym.agents.teams.hidden import put_in_walls, take_out_bodies
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.team_policy import Frame, TeamMemory
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
    still: View
    """The same with a range of nothing where they stood before it: there is no telling what has moved."""


def without_partners(view: View, frame: Frame, partners: Sequence[TeamMemory]) -> Seen:
    """What a robot sees without the bodies of partners.

    Args:
        view: what the robot sees.
        frame: where its odometry frame lies in the team's.
        partners: those whose bodies are to be taken out.
    """
    sensors = view.sensors
    ux, uy = sensors.beam_directions
    places = [view.to_robot(*frame.to_odometry(other.word.place)) for other in partners if other.word is not None]
    if not places:
        return Seen(view, view)
    bodies = np.array([*places, (0.0, 0.0)])
    reach = sensors.radius + BODY_MARGIN + 3.0 * sensors.range_noise
    ranges, hidden = view.ranges.copy(), np.zeros(len(view.ranges), dtype=np.bool_)
    if not take_out_bodies(ranges, ux, uy, sensors.range, bodies[:-1], reach, hidden):
        return Seen(view, view)
    widest = SAME_WALL * 2.0 * math.pi / len(ranges)
    for other in partners:
        if other.view is None or other.word is None or not other.is_heard:
            continue
        x, y = view.to_robot(*frame.to_odometry(other.word.place))
        turn = other.word.heading - frame.heading - view.heading
        theirs = other.view.ranges
        put_in_walls(ranges, hidden, ux, uy, sensors.range, bodies, reach, theirs, x, y, turn, widest)
    seen = view.with_ranges(ranges)
    ranges[hidden] = 0.0
    return Seen(seen, view.with_ranges(ranges))


def least_gap(sensors: Sensors) -> float:
    """How near to one another the centres of two robots may come [m]."""
    return 2.0 * sensors.radius + ROOM


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


def closes(one: TeamMemory, after: Point, other: TeamMemory, other_after: Point, least: float) -> bool:
    """Whether a step lessens the gap between two robots to below `least` [m]."""
    distance = math.dist(after, other_after)
    return distance < least and distance < gap(one, other) - 1e-6


def distance_to_segment(place: Point, begin: Point, end: Point) -> float:
    """Distance of a place to the straight line between two others [m]."""
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    square = dx * dx + dy * dy
    share = ((place[0] - begin[0]) * dx + (place[1] - begin[1]) * dy) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(place[0] - begin[0] - share * dx, place[1] - begin[1] - share * dy)
