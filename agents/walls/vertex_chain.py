"""The chain of vertices in sight over which the shortest way past an obstacle goes, by one of its sides.

A *vertex* is a place in sight at which a taut string bends that keeps the clearance to what is seen of the obstacle:

    S ---- v1 -.             side +1: the obstacle on the right
          =====  `. v2
          =======    `--- T

Between vertices the string runs straight, tangent to the discs of the clearance round both, and round each vertex along
its disc. What is not in sight counts as free.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.geometry import F64, Point, wrap

SAME = 1e-9
"""Bearings nearer to each other than this are one [rad]."""


class VertexChain(NamedTuple):
    """A way past an obstacle."""

    vertices: tuple[Point, ...]
    """Places of the obstacle where it bends, in order, robot's frame [m]."""
    length: float
    """From the robot along the chain to the goal [m]."""


class Leg(NamedTuple):
    """A straight piece that is tangent to a disc at each of its ends."""

    heading: float
    """Robot's frame [rad]."""
    length: float
    """[m]"""


def tangent(begin: Point, until: Point, side: int, radii: tuple[float, float]) -> Leg:
    """The straight piece from one disc to another that leaves both on the same hand.

    Args:
        begin: centre of the disc that it comes from [m].
        until: centre of the disc that it goes to [m].
        side: +1 leaves both on the right.
        radii: of the two discs [m]; 0 is a point.
    """
    dx, dy = until[0] - begin[0], until[1] - begin[1]
    apart, more = math.hypot(dx, dy), radii[1] - radii[0]
    lean = math.asin(max(-1.0, min(more / max(apart, 1e-9), 1.0)))
    return Leg(math.atan2(dy, dx) + side * lean, math.sqrt(max(apart * apart - more * more, 0.0)))


def chain_past(surface: F64, first: Point, goal: Point, side: int, clearance: float, least: float) -> VertexChain:
    """The taut string from the robot over a vertex to the goal, past what is seen of the obstacle.

    Args:
        surface: points (k, 2) seen of the obstacle, robot's frame [m].
        first: the vertex to which the way is free, robot's frame [m].
        goal: robot's frame [m].
        side: +1 leaves the obstacle on the right, -1 on the left.
        clearance: distance kept from vertices [m].
        least: nearer to the obstacle than this a straight piece counts as blocked [m].
    """
    leg = tangent((0.0, 0.0), first, side, (0.0, clearance))
    vertices, length, rest = [first], leg.length, surface
    while True:
        last = tangent(vertices[-1], goal, side, (clearance, 0.0))
        place = _next_vertex(rest, vertices[-1], last, side, clearance, least)
        if place is None:
            bend = _turning(leg, last, side)
            return VertexChain(tuple(vertices), length + clearance * bend + last.length)
        vertex = (float(rest[place, 0]), float(rest[place, 1]))
        rest = np.delete(rest, place, axis=0)
        to_it = tangent(vertices[-1], vertex, side, (clearance, clearance))
        length += clearance * _turning(leg, to_it, side) + to_it.length
        leg = to_it
        vertices.append(vertex)


def _turning(before: Leg, after: Leg, side: int) -> float:
    """How far the string bends round a vertex, none where it would bend away from it [rad]."""
    return max(0.0, wrap(side * (before.heading - after.heading)))


def _next_vertex(surface: F64, vertex: Point, last: Leg, side: int, clearance: float, least: float) -> int | None:
    """Index of the point where the string bends next; None where the last piece to the goal is free."""
    ahead = np.array([math.cos(last.heading), math.sin(last.heading)])
    left = np.array([-ahead[1], ahead[0]])
    offset = surface - vertex
    along, beside = offset @ ahead, side * (offset @ left)
    between = (along > 0.0) & (along < last.length)
    if not (between & (np.abs(beside - clearance) < least)).any():
        return None
    bearings = np.where(between, np.arctan2(beside, along), -np.inf)
    # Of points in one line the farthest: the string does not bend at the others.
    return int(np.where(bearings >= bearings.max() - SAME, along, -np.inf).argmax())
