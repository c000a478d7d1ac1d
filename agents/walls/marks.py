"""Hit and leave points that are known again: a place on a boundary, together with the wall beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.agents.walls.boundary import Boundary
from bug_gym.agents.walls.contour import Contour
from bug_gym.geometry import Point


@dataclass(frozen=True)
class Mark:
    """A hit or leave point remembered with its wall: it is known again whichever way the boundary is walked."""

    place: Point
    """Odometry frame [m]."""
    wall: Point
    """The point of the wall that the hand was on, odometry frame [m]; across a corridor is another wall."""


def is_at(boundary: Boundary, mark: Mark, place: Point, wall: Point) -> bool:
    """Whether a place on a boundary, with the wall's point beside it, is a remembered one."""
    is_near = math.dist(mark.place, place) <= boundary.gate_half_width
    return is_near and math.dist(mark.wall, wall) <= 1.5 * boundary.clearance


def passes(boundary: Boundary, contour: Contour, mark: Mark) -> bool:
    """Whether the last step passed a remembered place, in either direction: it was near and goes away again."""
    if contour.odometer <= 2.0 * boundary.gate_half_width or contour.before == contour.position:
        return False
    is_near = is_at(boundary, mark, contour.before, contour.wall)
    return is_near and math.dist(mark.place, contour.position) > math.dist(mark.place, contour.before)
