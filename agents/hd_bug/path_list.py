"""The double linked list of places that HD-BUG has passed: where it came from, and what it has given up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from bug_gym.geometry import Point


@dataclass(slots=True, eq=False)
class PathNode:
    """A place on the way so far."""

    place: Point
    """Odometry frame [m]."""
    odometer: float
    """Way travelled until there [m]."""
    previous: PathNode | None = field(default=None, repr=False)
    following: PathNode | None = field(default=None, repr=False)
    is_closed: bool = False
    """Whether it lies in a dead end that the robot has turned back from."""


class PathList:
    """The way so far, a node every `pace` metres, found again by place.

    Args:
        pace: distance between nodes [m].
    """

    def __init__(self, pace: float) -> None:
        self.pace = pace
        self.first: PathNode | None = None
        self.last: PathNode | None = None
        self._cells: dict[tuple[int, int], list[PathNode]] = {}

    def __iter__(self) -> Iterator[PathNode]:
        node = self.first
        while node is not None:
            yield node
            node = node.following

    def _cell(self, place: Point) -> tuple[int, int]:
        return math.floor(place[0] / self.pace), math.floor(place[1] / self.pace)

    def append(self, place: Point, odometer: float) -> bool:
        """Add a node if the last one is a pace behind; returns whether it was."""
        if self.last is not None and odometer - self.last.odometer < self.pace:
            return False
        node = PathNode(place, odometer, previous=self.last)
        if self.last is None:
            self.first = node
        else:
            self.last.following = node
        self.last = node
        self._cells.setdefault(self._cell(place), []).append(node)
        return True

    def near(self, place: Point) -> PathNode | None:
        """The node nearest to a place, if one is within a pace."""
        column, row = self._cell(place)
        best, least = None, self.pace
        for i in (column - 1, column, column + 1):
            for j in (row - 1, row, row + 1):
                for node in self._cells.get((i, j), ()):
                    away = math.dist(node.place, place)
                    if away <= least:
                        best, least = node, away
        return best

    def back_to(self, node: PathNode) -> None:
        """Close the nodes after `node`: they led into a dead end."""
        behind = self.last
        while behind is not None and behind is not node:
            behind.is_closed = True
            behind = behind.previous
