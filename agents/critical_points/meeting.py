"""Where the straight tracks of the robot and of a moving obstacle meet in time, and the virtual obstacle there.

Source: Das, Dutta and Debnath (2020), equations (7) to (10). (10) is printed with the robot's own distance to the
meeting point, O_TC = D_C / v_obs; then the two times are equal only for equal speeds, wherever the obstacle is. Here
the obstacle's distance counts, and "equal" is that circle and obstacle touch: with the relative place dp and velocity
dv, |dp + dv t| = r + r_obs has the solutions t1 and t2. One formula for crossing, head-on and overtaking.

A disc at the meeting point would be left before the obstacle is there. The virtual obstacle is all that the obstacle
covers from t1 to t2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.geometry import F64, Point


class Mover(NamedTuple):
    """A moving obstacle; odometry frame."""

    number: int
    """Of its track."""
    place: Point
    """Its centre [m]."""
    velocity: Point
    """[m/s]."""
    radius: float
    """Of the disc that it is taken for [m]."""

    def at(self, time: float) -> Point:
        """Where it is after a time [s], if it goes on straight [m]."""
        return self.place[0] + time * self.velocity[0], self.place[1] + time * self.velocity[1]


class Times(NamedTuple):
    """When two tracks are nearer than a distance, from now on [s]."""

    closest: float
    """t*, of the least distance."""
    first: float
    """t1; 0 where they are that near already."""
    last: float
    """t2."""


class VirtualObstacle(NamedTuple):
    """What a moving obstacle covers while the robot would meet it; odometry frame."""

    number: int
    """Of the mover's track."""
    begin: Point
    """Centre at t1 [m]."""
    end: Point
    """Centre at t2 [m]."""
    radius: float
    """[m]."""
    velocity: Point
    """Of the mover [m/s]."""
    point: Point
    """P_C, where they are nearest [m]."""


def meeting_times(place: Point, velocity: Point, mover: Mover, distance: float) -> Times | None:
    """When a robot that goes straight is nearer than a distance [m] to a mover's centre; None: never from now on.

    Args:
        place: of the robot, odometry frame [m].
        velocity: of the robot [m/s].
        mover: the obstacle.
        distance: of the two centres, r + r_obs [m].
    """
    dx, dy = mover.place[0] - place[0], mover.place[1] - place[1]
    vx, vy = mover.velocity[0] - velocity[0], mover.velocity[1] - velocity[1]
    square = vx * vx + vy * vy
    if square < 1e-9:
        return None
    closest = -(dx * vx + dy * vy) / square
    room = distance * distance - (dx * dx + dy * dy - closest * closest * square)
    if closest < 0.0 or room <= 0.0:
        return None
    half = math.sqrt(room / square)
    return Times(closest, max(closest - half, 0.0), closest + half)


def printed_times(place: Point, velocity: Point, mover: Mover, distance: float) -> Times | None:
    """When they meet by (8) to (10) as printed: at the crossing of the tracks, both times from the robot's distance.

    The times are equal where they differ by less than the robot needs for `distance`. Tracks that do not cross ahead
    of both never meet.
    """
    (x, y), (u, v) = velocity, mover.velocity
    across = x * v - y * u
    speed, other = math.hypot(x, y), math.hypot(u, v)
    if abs(across) < 1e-9 * max(speed * other, 1e-9):
        return None
    dx, dy = mover.place[0] - place[0], mover.place[1] - place[1]
    own, others = (dx * v - dy * u) / across, (dx * y - dy * x) / across
    if own < 0.0 or others < 0.0:
        return None
    way = own * speed
    tolerance = distance / speed
    if abs(way / speed - way / other) > tolerance:
        return None
    return Times(own, max(own - tolerance, 0.0), own + tolerance)


def virtual_obstacle(mover: Mover, times: Times) -> VirtualObstacle:
    """What a mover covers from the first to the last of some times."""
    ends = mover.at(times.first), mover.at(times.last)
    return VirtualObstacle(mover.number, *ends, mover.radius, mover.velocity, mover.at(times.closest))


def least_distance(begin: Point, velocity: Point, first: float, last: float, mover: Mover) -> float:
    """Least distance [m] of the centres while the robot goes straight between two times from now [s].

    Args:
        begin: where the robot is at time `first`, odometry frame [m].
        velocity: of the robot from then on [m/s].
        first: [s].
        last: [s].
        mover: the obstacle.
    """
    x, y = mover.at(first)
    dx, dy = x - begin[0], y - begin[1]
    vx, vy = mover.velocity[0] - velocity[0], mover.velocity[1] - velocity[1]
    square = vx * vx + vy * vy
    time = 0.0 if square < 1e-12 else min(max(-(dx * vx + dy * vy) / square, 0.0), last - first)
    return math.hypot(dx + time * vx, dy + time * vy)


def is_behind(place: Point, obstacle: VirtualObstacle) -> bool:
    """Whether a place lies behind a mover where it is met: (Q - P_C) . v_obs < 0."""
    dx, dy = place[0] - obstacle.point[0], place[1] - obstacle.point[1]
    return dx * obstacle.velocity[0] + dy * obstacle.velocity[1] < 0.0


def ring(begin: Point, end: Point, radius: float) -> F64:
    """Outline (k, 2) of all that is nearer than a radius [m] to a straight line between two places [m]."""
    heading = math.atan2(end[1] - begin[1], end[0] - begin[0])
    angles = heading + np.linspace(0.5 * math.pi, 2.5 * math.pi, 33)[:-1]
    centres = np.where((np.arange(32) < 16)[:, None], begin, end)
    outline: F64 = centres + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return outline
