"""What is visible in one scan: the places that a robot sees with all that is round them, and could go straight to.

A place is visible where the robot sees the whole disc of the clearance round it, and a disc can go straight to it.

Source: Lumelsky and Skewis (1990), for a point; here for a disc.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.scan import joined
from bug_gym.agents.walls.boundary import Boundary
from bug_gym.agents.walls.m_line import MLine
from bug_gym.geometry import F64, Point
from bug_gym.policy import braking_radius
from bug_gym.view import View

NEAR = 2.5
"""Up to where T_i is right before the robot, in steps: the contour between them is not straight, but free."""


class Elsewhere(View):
    """The present scan as a robot at another place would know it.

    Args:
        view: what the robot observes.
        place: where it is not, odometry frame [m].
        x: points' x (k,) in the robot's frame [m].
        y: points' y (k,) [m].
    """

    __slots__ = ()

    def __init__(self, view: View, place: Point, x: F64, y: F64) -> None:
        dx, dy = view.to_robot(*place)
        self.sensors = view.sensors
        self.ranges = view.ranges
        self.goal = (view.goal[0] - dx, view.goal[1] - dy)
        self.pose = (place[0], place[1], view.heading)
        self.velocity = view.velocity
        self.flat = view.flat
        self._trig = view._trig
        self._points = (x - dx, y - dy)


class Scan:
    """What the robot sees now: walls as lines of points, and the free space between it and them.

    Args:
        view: the observation.
        boundary: the robot's settings at walls.
    """

    def __init__(self, view: View, boundary: Boundary) -> None:
        sensors = view.sensors
        beams = len(sensors.angles)
        self.view = view
        self.boundary = boundary
        self.nearest, _ = view.nearest()
        # Noise must not close the view along a wall at the clearance.
        self.radius = max(boundary.safe_radius, boundary.inner - 2.0 * sensors.range_noise)
        self.first_angle = float(sensors.angles[0])
        self.angle_step = float(sensors.angles[1] - sensors.angles[0]) if beams > 1 else 2.0 * math.pi
        self.is_round = beams * self.angle_step > 2.0 * math.pi - 1e-6
        gap, spacing = 2.0 * boundary.inner, 0.5 * boundary.inner
        points = np.empty((2, 7 * beams))
        cos, sin = sensors.beam_directions
        count, total = joined.join_scan(view.ranges, cos, sin, sensors.range, self.is_round, gap, spacing, *points)
        self.x, self.y = points[:, :count]
        self.all = points[:, :total]
        """Points of walls, and those up to which walls may go on unseen."""

    def is_open(self, place: Point) -> bool:
        """Whether nothing is in the way to a place that was visible, by a smaller disc than made it so."""
        boundary, view = self.boundary, self.view
        x, y = view.to_robot(*place)
        bearing, distance = math.atan2(y, x), math.hypot(x, y)
        if distance <= NEAR * boundary.step:
            radius, distance = boundary.safe_radius, min(distance, boundary.step)
        else:
            radius = max(boundary.safe_radius, boundary.hit_radius - 2.0 * view.sensors.range_noise)
        # A robot that came too near to a wall can still go along it.
        radius = max(min(radius, 0.98 * self.nearest), braking_radius(view.sensors))
        return view.free_distance(bearing, radius) >= min(distance, view.sensors.range)

    def seen_from(self, place: Point) -> Elsewhere:
        """The scan from a place of the odometry frame [m]."""
        return Elsewhere(self.view, place, self.x, self.y)

    def sees(self, place: Point, reach: float) -> bool:
        """Whether a place of the odometry frame [m] is visible, at most `reach` [m] away."""
        return self._first_seen(place, (0.0, 0.0), 1, reach, self.x, self.y) == 0

    def sees_surely(self, place: Point, reach: float) -> bool:
        """Whether it stays visible on the way to it, wherever between two beams the walls beside the way end."""
        return self._first_seen(place, (0.0, 0.0), 1, reach, *self.all) == 0

    def first_visible(self, line: MLine, stride: float, count: int, reach: float) -> Point | None:
        """The first surely visible one of `count` places on the M-line, each `stride` [m] further from its goal."""
        whole = math.dist(line.start, line.goal)
        count = min(count, int(whole / stride))
        if count <= 0:
            return None
        dx = (line.start[0] - line.goal[0]) * stride / whole
        dy = (line.start[1] - line.goal[1]) * stride / whole
        k = self._first_seen((line.goal[0] + dx, line.goal[1] + dy), (dx, dy), count, reach, *self.all) + 1
        return None if k == 0 else (line.goal[0] + k * dx, line.goal[1] + k * dy)

    def _first_seen(self, place: Point, stride: Point, count: int, reach: float, px: F64, py: F64) -> int:
        """Number of the first one of `count` places that the points leave visible, or -1."""
        x, y = self.view.to_robot(*place)
        ex, ey = self.view.to_robot(place[0] + stride[0], place[1] + stride[1])
        beams = self.view.ranges, self.first_angle, self.angle_step, self.is_round
        return int(joined.first_seen_free((x, y), (ex - x, ey - y), count, reach, *beams, px, py, self.radius))
