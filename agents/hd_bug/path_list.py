"""The double linked list of what HD-BUG has navigated: each node keeps its light area and its open doors.

Source: Hasibuzzaman, Jan and Wu, section 5 ("past navigated areas are stored in a double-linked list", "backtracking").
Links from each node to those in its light make short cuts: a way back need not be walked node by node. So read, the list
is a topological map, as in the SRT method (Oriolo et al.) or gap navigation trees (LaValle, Planning Algorithms, 12.3.4).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.light import HEADINGS, SLACK, are_before_walls, are_behind_walls, are_in_sight, are_lit
from bug_gym.compiling import kernel
from bug_gym.geometry import F64, Point
from bug_gym.kernels.layout import Flags, Floats

SAME = 0.2
"""Nearer than this to a node no new one is made [m]: the list grows with the ground, not with time."""


@dataclass(eq=False)
class Door:
    """A candidate: from the light into the dark."""

    inside: Point
    """v, in the light, odometry frame [m]."""
    outside: Point
    """q, in the shadow [m]."""
    room: float
    """Distance of the nearest scan point from the way between them [m]."""
    owner: int
    """Number of the node that has v in its light."""


@dataclass(eq=False)
class PathNode:
    """A place on the way so far."""

    number: int
    """In order of making."""
    place: Point
    """Odometry frame [m]."""
    odometer: float
    """Way travelled until there [m]."""
    previous: PathNode | None = field(default=None, repr=False)
    following: PathNode | None = field(default=None, repr=False)
    came_from: PathNode | None = field(default=None, repr=False)
    """The node that the robot was at before: not the previous one where it had gone back over the list."""
    doors: list[Door] = field(default_factory=list, repr=False)
    """Its open doors; without any it is closed."""


class PathList:
    """The way so far.

    Args:
        room: for how many nodes there is room at first; it grows.
    """

    def __init__(self, room: int = 64) -> None:
        self.first: PathNode | None = None
        self.last: PathNode | None = None
        self.here: PathNode | None = None
        """The node that the robot is at."""
        self.nodes: list[PathNode] = []
        self._places = np.empty((room, 2))
        self._lights = np.empty((room, HEADINGS))
        self._farthest = np.empty(room)
        self._links = np.zeros((room, room), dtype=np.bool_)

    def __iter__(self) -> Iterator[PathNode]:
        node = self.first
        while node is not None:
            yield node
            node = node.following

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def places(self) -> F64:
        """Places of the nodes (n, 2) [m]."""
        return self._places[: len(self.nodes)]

    @property
    def lights(self) -> F64:
        """Light areas of the nodes (n, K) [m]."""
        return self._lights[: len(self.nodes)]

    @property
    def doors(self) -> list[Door]:
        """All open doors, the oldest node's first."""
        return [door for node in self for door in node.doors]

    def visit(self, place: Point, odometer: float, light: F64) -> PathNode:
        """The node of a place with its light area (K,): a new last one, or the one made there before."""
        known = self._at(place)
        if known is not None:
            if math.dist(known.place, place) < 0.25 * SAME:
                np.maximum(self._lights[known.number], light, out=self._lights[known.number])
                self._farthest[known.number] = self._lights[known.number].max()
            self.here = known
            return known
        number = len(self.nodes)
        if number == len(self._places):
            self._grow()
        node = PathNode(number, place, odometer, previous=self.last, came_from=self.here)
        if self.last is None:
            self.first = node
        else:
            self.last.following = node
        came_from, self.last, self.here = self.here, node, node
        self.nodes.append(node)
        self._places[number], self._lights[number], self._farthest[number] = place, light, light.max()
        self._link(number, came_from)
        return node

    def _at(self, place: Point) -> PathNode | None:
        """The node made where a place is."""
        if not self.nodes:
            return None
        away = np.hypot(*(self.places - np.array(place)).T)
        nearest = int(away.argmin())
        return self.nodes[nearest] if away[nearest] < SAME else None

    def _grow(self) -> None:
        """Room for twice as many."""
        count = len(self._places)
        self._places = np.concatenate([self._places, np.empty((count, 2))])
        self._lights = np.concatenate([self._lights, np.empty((count, HEADINGS))])
        self._farthest = np.concatenate([self._farthest, np.empty(count)])
        links = np.zeros((2 * count, 2 * count), dtype=np.bool_)
        links[:count, :count] = self._links
        self._links = links

    def _link(self, number: int, came_from: PathNode | None) -> None:
        """Link a node with the one before and with all in sight of it."""
        sees = np.empty(number + 1, dtype=np.bool_)
        are_in_sight(self.places, self.lights, number, sees)
        if came_from is not None:
            sees[came_from.number] = True
        self._links[number, : number + 1] = sees
        self._links[: number + 1, number] = sees

    def cut(self, one: int, other: int) -> None:
        """There is no straight way between two nodes after all."""
        self._links[one, other] = self._links[other, one] = False

    def is_lit(self, points: F64, slack: float = SLACK) -> NDArray[np.bool_]:
        """Which of some points (m, 2) lie in the light of a node, or no farther outside than the slack [m]."""
        lit = np.zeros(len(points), dtype=np.bool_)
        are_lit(self.places, self.lights, self._farthest[: len(self.nodes)], points, slack, lit)
        return lit

    def is_before_wall(self, points: F64, reach: float, slack: float) -> NDArray[np.bool_]:
        """Which of some points (m, 2) lie at most `slack` [m] behind where a node's light ends at something."""
        found = np.zeros(len(points), dtype=np.bool_)
        are_before_walls(self.places, self.lights, points, reach, slack, found)
        return found

    def is_behind_wall(self, points: F64, reach: float, near: float, jump: float, slack: float) -> NDArray[np.bool_]:
        """Which of some points (m, 2) a node has seen to lie behind a wall, as `light.are_behind_walls` says."""
        found = np.zeros(len(points), dtype=np.bool_)
        are_behind_walls(self.places, self.lights, points, reach, near, jump, slack, found)
        return found

    def ways_from(self, start: int) -> tuple[F64, F64]:
        """Lengths (n,) [m] of the least ways from a node to all, and the node before each on its way (n,), -1: none."""
        count = len(self.nodes)
        length, before = np.empty(count), np.empty(count)
        least_ways(self.places, self._links, start, np.zeros(count, dtype=np.bool_), length, before)
        return length, before

    def way_to(self, start: int, end: int) -> list[int]:
        """Numbers of the nodes on the least way from one node to another, both included; empty without a way."""
        length, before = self.ways_from(start)
        if not math.isfinite(length[end]):
            return []
        way = [end]
        while way[-1] != start:
            way.append(int(before[way[-1]]))
        return way[::-1]


@kernel
def least_ways(places: Floats, links: Flags, start: int, done: Flags, length: Floats, before: Floats) -> None:
    """Least ways from one place to all over links: Dijkstra's, over arrays.

    Args:
        places: (n, 2) [m].
        links: (m, m) of at least n; which places one can go between straight.
        start: where from.
        done: (n,) False; is written.
        length: (n,) [m] is written; infinite where there is no way.
        before: (n,) number of the place before each on its way, -1: none; is written.
    """
    count = len(places)
    length[:] = np.inf
    before[:] = -1.0
    length[start] = 0.0
    for _ in range(count):
        best, least = -1, np.inf
        for j in range(count):
            if not done[j] and length[j] < least:
                best, least = j, length[j]
        if best < 0:
            break
        done[best] = True
        for j in range(count):
            if done[j] or not links[best, j]:
                continue
            way = least + math.hypot(places[j, 0] - places[best, 0], places[j, 1] - places[best, 1])
            if way < length[j]:
                length[j], before[j] = way, best
