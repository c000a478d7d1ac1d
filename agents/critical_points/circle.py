r"""The virtual circle about a body, and the straight legs that bring its centre to a place.

Its centre C lies midway between the two farthest points of the body, its radius r is half their distance and a safety
constant. On a differential robot C lies `ahead` of the wheels' axle A: the robot turns on the spot about A, and then C
goes straight.

               r  _____
                /       \
       A--->---|----C----|- - - - - - - o Q        |A Q'| = |C Q|
                \ _____ /

Source: Das, Dutta and Debnath (2020), section 2.1.2 and equation (6). The printed (6) shifts the axle along the
perpendicular of the open point; the robot arrives along its leg, so here the shift is along that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bug_gym.geometry import Point, wrap


class VirtualCircle(NamedTuple):
    """The virtual circle in the robot's frame."""

    ahead: float
    """Centre C, how far ahead of the robot's origin [m]."""
    left: float
    """The same to the left [m]."""
    body: float
    """Radius about C that holds the body [m]."""
    radius: float
    """Radius r: that and the safety constant [m]."""

    @property
    def offset(self) -> float:
        """Distance from the robot's origin to C [m]."""
        return math.hypot(self.ahead, self.left)


class Leg(NamedTuple):
    """A turn on the spot, and a straight way of the circle's centre."""

    heading: float
    """Where to, in the robot's frame [rad]."""
    length: float
    """How far [m]."""
    begin: Point
    """Where C is after the turn, robot's frame [m]."""
    turn: float
    """The turn before it [rad]; 0 of a holonomic robot."""

    @property
    def end(self) -> Point:
        """Where C is at its end, robot's frame [m]."""
        x, y = self.begin
        return x + self.length * math.cos(self.heading), y + self.length * math.sin(self.heading)


def virtual_circle(footprint: Sequence[tuple[float, float, float]], safety: float) -> VirtualCircle:
    """The virtual circle of a body.

    Args:
        footprint: the body as circles x, y, radius in the robot's frame [m].
        safety: the safety constant lambda [m].
    """
    circles = np.array(footprint, dtype=np.float64)
    x, y, radii = circles.T
    distance = np.hypot(x[:, None] - x, y[:, None] - y)
    extent = distance + radii[:, None] + radii
    # A circle alone is as wide as its diameter.
    np.fill_diagonal(extent, 2.0 * radii)
    i, j = divmod(int(extent.argmax()), len(circles))
    apart = max(float(distance[i, j]), 1e-12)
    # From one centre to the other, then from the middle of the centres to that of the farthest points.
    shift = 0.5 * float(radii[j] - radii[i]) / apart if i != j else 0.0
    ahead = 0.5 * float(x[i] + x[j]) + shift * float(x[j] - x[i])
    left = 0.5 * float(y[i] + y[j]) + shift * float(y[j] - y[i])
    body = float((np.hypot(x - ahead, y - left) + radii).max())
    return VirtualCircle(ahead, left, body, body + safety)


def leg_to(circle: VirtualCircle, place: Point, *, turns: bool) -> Leg | None:
    """The leg that brings the circle's centre to a place of the robot's frame [m]; None where none does.

    With C ahead of the axle, the axle stops at A = Q - AC (Q - A0) / |Q - A0|, as the leg's heading is that of Q.
    A place nearer to the axle than C cannot be reached by turning and going ahead.
    """
    x, y = place
    if not turns:
        dx, dy = x - circle.ahead, y - circle.left
        return Leg(math.atan2(dy, dx), math.hypot(dx, dy), (circle.ahead, circle.left), 0.0)
    square = x * x + y * y - circle.left * circle.left
    length = math.sqrt(max(square, 0.0)) - circle.ahead
    if square < 0.0 or length < 0.0:
        return None
    heading = wrap(math.atan2(y, x) - math.atan2(circle.left, length + circle.ahead))
    return _turned(circle, heading, length)


def leg_along(circle: VirtualCircle, bearing: float, length: float, *, turns: bool) -> Leg:
    """The leg that moves the robot's origin along a bearing [rad] so far [m]."""
    if not turns:
        return Leg(bearing, length, (circle.ahead, circle.left), 0.0)
    return _turned(circle, bearing, length)


def _turned(circle: VirtualCircle, heading: float, length: float) -> Leg:
    """The leg after a turn to a heading."""
    cos, sin = math.cos(heading), math.sin(heading)
    begin = (cos * circle.ahead - sin * circle.left, sin * circle.ahead + cos * circle.left)
    return Leg(heading, length, begin, heading)
