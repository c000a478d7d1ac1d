"""What robots of a team do about one another's bodies: take them out of scans, keep apart, and follow their own trace.

A partner's place is known from what it told, so its body can be told from a wall. What it hides it sees itself, and
tells that too: the points of its own scan behind it stand for the beams that its body stopped.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

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

Points = tuple[NDArray[np.float64], NDArray[np.float64]]


def without_partners(view: View, frame: Frame, partners: Sequence[TeamMemory]) -> View:
    """The observation without the bodies of partners, and with what they see behind themselves.

    Args:
        view: what the robot sees.
        frame: where its odometry frame lies in the team's.
        partners: those whose bodies are to be taken out.
    """
    sensors = view.sensors
    places = [view.to_robot(*frame.to_odometry(other.word.place)) for other in partners if other.word is not None]
    reach = sensors.radius + BODY_MARGIN + 3.0 * sensors.range_noise
    x, y = sensors.beam_directions * view.ranges
    is_body = np.zeros(len(view.ranges), dtype=bool)
    for px, py in places:
        is_body |= (x - px) ** 2 + (y - py) ** 2 <= reach * reach
    is_body &= view.ranges < sensors.range
    if not is_body.any():
        return view
    ranges = view.ranges.copy()
    ranges[is_body] = sensors.range
    directions = sensors.beam_directions[:, is_body]
    for other in partners:
        if other.view is not None and other.frame is not None and other.is_heard:
            walls = walls_in(view, frame, other.view, other.frame, (*places, (0.0, 0.0)))
            ranges[is_body] = np.minimum(ranges[is_body], first_wall(directions, *walls, sensors.range))
    return view.with_ranges(ranges)


def walls_in(
    view: View, frame: Frame, theirs: View, their_frame: Frame, bodies: Iterable[Point]
) -> tuple[Points, Points]:
    """Walls between neighbouring points of a partner's scan, both ends x (k,), y (k,) in the own robot's frame [m]."""
    sensors = theirs.sensors
    turn = their_frame.heading + theirs.heading - frame.heading - view.heading
    ox, oy = view.to_robot(*frame.to_odometry(their_frame.to_team(theirs.position)))
    ahead, left = sensors.beam_directions * theirs.ranges
    cos, sin = math.cos(turn), math.sin(turn)
    x, y = ox + cos * ahead - sin * left, oy + sin * ahead + cos * left
    is_wall = theirs.ranges < sensors.range
    reach = sensors.radius + BODY_MARGIN + 3.0 * sensors.range_noise
    for px, py in bodies:
        is_wall &= (x - px) ** 2 + (y - py) ** 2 > reach * reach
    nx, ny = np.roll(x, -1), np.roll(y, -1)
    spacing = 2.0 * math.pi / len(theirs.ranges)
    widest = SAME_WALL * spacing * np.minimum(theirs.ranges, np.roll(theirs.ranges, -1))
    is_one = is_wall & np.roll(is_wall, -1) & (np.hypot(nx - x, ny - y) <= widest)
    return (x[is_one], y[is_one]), (nx[is_one], ny[is_one])


def first_wall(directions: NDArray[np.float64], begin: Points, end: Points, far: float) -> NDArray[np.float64]:
    """Distance along each direction (2, m) to the first of some walls [m]; `far` where there is none."""
    if len(begin[0]) == 0:
        return np.full(directions.shape[1], far)
    ux, uy = directions[0][:, None], directions[1][:, None]
    aside, aside_end = ux * begin[1] - uy * begin[0], ux * end[1] - uy * end[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = aside / (aside - aside_end)
    along = ux * begin[0] + uy * begin[1]
    along = along + share * (ux * end[0] + uy * end[1] - along)
    is_met = (share >= 0.0) & (share <= 1.0) & (along > 0.0)
    return np.minimum(np.where(is_met, along, far).min(axis=1), far)


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
