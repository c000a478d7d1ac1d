"""Open points: the ends of obstacles in sight, as a turning range sensor meets them.

An *open point* (a *sudden point* in PointBug) is where the reading of a turning range sensor jumps by more than a
threshold: an end of an obstacle in sight. It is looked for in the free ways of a disc over the full circle of headings,
so the ends of gaps that the robot cannot pass are none. The *sub-goal* lies beside it, at the clearance, square to the
line of sight.

              o  sub-goal                     side +1: the corner is the left end of what is behind it
              |  clearance
    S . . . . x=========  corner, obstacle

Sources: Buniyamin, Ngah, Wan Ngah and Mohamad (2011) for sudden points; Das, Dutta and Debnath (2020) for sub-goals.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.scan import open_ways
from bug_gym.geometry import F64, Point
from bug_gym.view import Sensors, View

HEADINGS = 360
"""Headings of the full circle that are looked along."""

TIE = 0.01
"""Costs nearer to each other than this are equal [m]."""


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
    ranges: F64
    """The ranges (B,) it was made of [m]."""


class Lookout:
    """How a robot looks round for open points.

    Args:
        sensors: what a driver knows of the robot.
        radius: of the disc whose free ways are looked at [m].
        jump: change of the reading that makes an open point [m].
    """

    def __init__(self, sensors: Sensors, *, radius: float, jump: float) -> None:
        self.radius = radius
        self.jump = jump
        angles = sensors.angles
        self.spacing = float(angles[1] - angles[0]) if len(angles) > 1 else 2.0 * math.pi
        """Angle between two neighbouring beams [rad]."""
        self._wraps = bool(angles[-1] + 1.5 * self.spacing >= angles[0] + 2.0 * math.pi)

    def look(self, view: View) -> Profile:
        """The free ways of a disc over the full circle, counted from the goal's bearing, and where they jump."""
        sensors, first, beams = view.sensors, view.goal_bearing, len(view.ranges)
        scanner = sensors.range, sensors.range_noise, self.spacing, self._wraps
        cos, sin = np.empty((2, HEADINGS))
        x, y, ranges = np.empty((3, beams))
        link, is_long = np.empty((2, beams), dtype=np.bool_)
        chosen = np.empty(beams, dtype=np.int64)
        free, beam = np.empty(HEADINGS), np.empty(HEADINGS, dtype=np.int64)
        found, side = np.empty((HEADINGS, 5)), np.empty(HEADINGS, dtype=np.int64)
        count = open_ways.look_round(
            view.ranges,
            sensors.beam_directions,
            scanner,
            (self.radius, self.jump, first),
            (cos, sin),
            (x, y, ranges, link, is_long),
            (free, beam),
            chosen,
            found,
            side,
        )
        ends = zip(found[:count].tolist(), side[:count].tolist(), strict=True)
        points = [OpenPoint((u, v), hand, turn % (2.0 * math.pi), (w, z)) for (turn, u, v, w, z), hand in ends]
        return Profile(float(free[0]), int(beam[0]), link, points, ranges)


def blocking_surface(view: View, profile: Profile) -> F64:
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


def rotation_to(point: OpenPoint, side: int) -> float:
    """Angle from the goal's bearing to an open point, turning to the left (+1) or right (-1), in [0, 2 pi) [rad]."""
    return point.rotation if side > 0 else (-point.rotation) % (2.0 * math.pi)


def goal_distance_of(view: View, place: Point) -> float:
    """Distance from a place in the robot's frame to the goal [m]."""
    return math.dist(place, view.goal)
