"""The local tangent graph: what a range scan tells of the obstacles in sight and of the ways round them.

It is made from the free ways of a disc over the full circle of headings. Neighbouring headings that end at one obstacle
make a *run*. Where a run ends, the line along which the disc just passes leads to an *end node*, the place beside the
wall's last point in sight.

    end node  o - - - - - - - - o   far obstacle or nothing
               `.           .'
      contacts   `x x x x x'    end node
                       R

Source: Kamon, Rimon and Rivlin (1998), for a point; here for a disc, so every node is a place where the robot can be.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from bug_gym.agents.scan import pieces
from bug_gym.geometry import F64, Point
from bug_gym.view import View

LEAST_HEADINGS, MOST_HEADINGS = 180, 360
"""Headings of the full circle that are looked along: as many as beams, within these limits."""

GROWTH = 1.5
"""How far apart neighbouring points of one wall may lie, in spacings of the beams there; a wall that the beams meet at
a small angle is known by its straightness instead."""

NOTHING = -1
"""Number of the run of headings that end at nothing."""


class Node(NamedTuple):
    """Where a run ends: how the disc gets past it."""

    bearing: float
    """Along which the disc just passes [rad]."""
    distance: float
    """To the place beside the contact [m]."""
    contact: Point
    """The scan point that it passes, robot's frame [m]."""
    side: int
    """+1: the run's left end, seen from the robot, which keeps the wall on its right there; -1: the right end."""

    @property
    def place(self) -> Point:
        """Where the disc touches the contact in passing, robot's frame [m]."""
        return self.distance * math.cos(self.bearing), self.distance * math.sin(self.bearing)


@functools.cache
def full_circle(spacing: float) -> F64:
    """How far each heading (m,) lies from heading 0 where neighbouring beams are so far apart [rad]."""
    headings = min(max(round(2.0 * math.pi / spacing), LEAST_HEADINGS), MOST_HEADINGS)
    turns = np.arange(headings, dtype=np.float64) * (2.0 * math.pi / headings)
    turns.flags.writeable = False
    return turns


class TangentGraph:
    """The local tangent graph of one scan.

    Headings are counted from the goal's bearing, counter-clockwise: heading 0 points at the goal.

    Args:
        view: the observation.
        radius: of the disc that is to pass [m].
        reach: how far to look [m]; None: as far as the LIDAR sees.
    """

    def __init__(self, view: View, radius: float, *, reach: float | None = None) -> None:
        self.radius = radius
        self.reach = view.sensors.range if reach is None else min(reach, view.sensors.range)
        self.goal = view.goal
        self.goal_distance = view.goal_distance
        x, y = view.points
        if self.reach < view.sensors.range:
            seen = x * x + y * y < self.reach * self.reach
            x, y = x[seen], y[seen]
        self.x, self.y = x, y
        spacing = view.sensors.beam_spacing
        self.bearings = view.goal_bearing + full_circle(spacing)
        """Bearing of each heading (m,) [rad]."""
        headings = len(self.bearings)
        self.free = np.empty(headings)
        """Free way of the disc along each heading (m,) [m]."""
        self.contacts = np.empty(headings, dtype=np.int64)
        """Number of the scan point touched there (m,), -1 for none."""
        self.run_of = np.empty(headings, dtype=np.int64)
        """Number of the run that each heading belongs to (m,), -1 for none."""
        self._gap = 2.0 * radius
        self._piece = np.empty(len(x), dtype=np.int64)
        pieces.find_pieces(x, y, self._gap, GROWTH * spacing, view.sensors.range_noise, self._piece)
        pieces.find_runs(
            x, y, self._piece, self.bearings, radius, self.reach, self._gap, self.free, self.contacts, self.run_of
        )

    @property
    def blocking_run(self) -> int:
        """The run that the goal's bearing ends at, -1 where nothing is in sight there."""
        return int(self.run_of[0])

    def points(self, run: int) -> F64:
        """Contacts (k, 2) of a run in the robot's frame [m]."""
        index = self.contacts[(self.run_of == run) & (self.contacts >= 0)]
        return np.column_stack([self.x[index], self.y[index]])

    def nearest_of(self, run: int) -> Point | None:
        """The contact of a run that is nearest to the robot, robot's frame [m]."""
        points = self.points(run)
        if len(points) == 0:
            return None
        x, y = points[(points**2).sum(axis=1).argmin()].tolist()
        return x, y

    def run_at(self, point: Point) -> int:
        """The run with the contact nearest to a point of the robot's frame [m], -1 where nothing is in sight."""
        blocked = np.flatnonzero(self.contacts >= 0)
        if len(blocked) == 0:
            return -1
        index = self.contacts[blocked]
        square = (self.x[index] - point[0]) ** 2 + (self.y[index] - point[1]) ** 2
        return int(self.run_of[blocked[square.argmin()]])

    def end(self, run: int, side: int) -> Node | None:
        """The left (+1) or right (-1) end of a run; None where it goes all round.

        Where something nearer hides how the run goes on, the node is the way past that.
        """
        last = self.last_heading(run, side)
        if last is None:
            return None
        following = (last + side) % len(self.bearings)
        low, high = self.bearings[last], self.bearings[last] + side * 2.0 * math.pi / len(self.bearings)
        contacts = int(self.contacts[last]), int(self.contacts[following])
        _, contact, hidden_by = pieces.find_border(
            self.x, self.y, self._piece, low, high, *contacts, self.radius, self.reach, self._gap
        )
        node = self._passing(contact, side, side)
        if hidden_by < 0:
            return node
        nearer = self._passing(hidden_by, -side, side)
        return nearer if nearer.distance < node.distance else node

    def last_heading(self, run: int, side: int) -> int | None:
        """Number of the last heading of a run on its left (+1) or right (-1); None where it goes all round."""
        last = pieces.last_heading(self.run_of, run, side) if run >= 0 else -1
        return last if last >= 0 else None

    def touch(self, heading: int) -> tuple[Point, Point]:
        """Where the disc gets to along a heading, and the contact that stops it there, in the robot's frame [m].

        Without a contact the two are the same.
        """
        way, bearing, contact = float(self.free[heading]), float(self.bearings[heading]), int(self.contacts[heading])
        place = way * math.cos(bearing), way * math.sin(bearing)
        return place, place if contact < 0 else (float(self.x[contact]), float(self.y[contact]))

    def _passing(self, contact: int, turn: int, side: int) -> Node:
        """The way past a contact on its left (turn +1) or right (-1)."""
        x, y = float(self.x[contact]), float(self.y[contact])
        away = math.hypot(x, y)
        bearing = math.atan2(y, x) + turn * math.asin(min(self.radius / max(away, 1e-9), 1.0))
        distance = math.sqrt(max(away * away - self.radius * self.radius, 0.0))
        return Node(bearing, distance, (x, y), side)

    def distance_to_goal(self, node: Node) -> float:
        """Distance from a node to the goal [m]."""
        return math.dist(node.place, self.goal)

    def way_past(self, node: Node) -> float:
        """Length of the way to the goal over a node, were there nothing behind it [m]."""
        return node.distance + self.distance_to_goal(node)

    def goal_distance_of(self, run: int) -> float:
        """Distance from the goal to the nearest contact of a run [m], infinite without one."""
        gaps = self.points(run) - self.goal
        return math.sqrt((gaps**2).sum(axis=1).min(initial=math.inf))

    def nearest_to_goal(self, *, limit: float, without: int = NOTHING) -> tuple[float, Point]:
        """The place nearest to the goal that the robot can go to straight.

        Args:
            limit: how far to go at most [m].
            without: a run; headings that end at it are left out.

        Returns:
            Its distance to the goal [m], and the place in the robot's frame [m]; the robot's own where none is nearer.
        """
        used = np.flatnonzero((self.run_of != without) | (self.run_of < 0))
        if len(used) == 0:
            return self.goal_distance, (0.0, 0.0)
        bearings = self.bearings[used]
        cos = np.cos(bearings - self.bearings[0])
        way = np.clip(self.goal_distance * cos, 0.0, np.minimum(self.free[used], limit))
        square = self.goal_distance**2 - 2.0 * self.goal_distance * way * cos + way * way
        best = int(square.argmin())
        place = float(way[best] * math.cos(bearings[best])), float(way[best] * math.sin(bearings[best]))
        return math.sqrt(max(square[best], 0.0)), place
