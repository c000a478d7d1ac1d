"""A way among remembered points, what is left to go from its places, and whether it is still open.

All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.mapping.cells import Cells
from bug_gym.agents.mapping.sight import cost_between, escape_from, is_in_sight
from bug_gym.compiling import kernel
from bug_gym.kernels.geometry import length
from bug_gym.kernels.layout import Floats


class Way:
    """A way over places (k, 2) from the robot to the goal, and what is left to go from each.

    Attributes:
        places: (k, 2) the robot's place, the bends, the goal [m].
        rest: (k,) cost from each place to the goal: length [m], weighted where terrain is.
    """

    __slots__ = ("places", "rest")

    def __init__(self, places: NDArray[np.float64], rest: NDArray[np.float64]) -> None:
        self.places = places
        self.rest = rest


@kernel
def is_way_open(cells: Cells, places: Floats, tolerance: float) -> bool:
    """Whether the straight ways from place to place are open, but for the last `tolerance` metres."""
    last = len(places) - 2
    for i in range(last + 1):
        ax, ay = places[i, 0], places[i, 1]
        slack = tolerance if i == last else 0.0
        if not is_in_sight(cells, ax, ay, places[i + 1, 0], places[i + 1, 1], escape_from(cells, ax, ay), slack):
            return False
    return True


@kernel
def passed_nodes(cells: Cells, places: Floats, near: float, cuts: bool) -> int:
    """How many nodes after the first are near to it, or not needed since the way to the next one is open."""
    x, y = places[0, 0], places[0, 1]
    escape = escape_from(cells, x, y)
    passed = 0
    while len(places) - passed > 2:
        node, following = passed + 1, passed + 2
        is_near = math.hypot(places[node, 0] - x, places[node, 1] - y) < near
        is_cut = cuts and is_in_sight(cells, x, y, places[following, 0], places[following, 1], escape, 0.0)
        if not (is_near or is_cut):
            break
        passed += 1
    return passed


@kernel
def rest_distances(cells: Cells, points: Floats, places: Floats, rest: Floats, result: Floats) -> None:
    """For each point the least of: straight to a place of the way, and on along it."""
    for i in range(len(points)):
        best = np.inf
        px, py = points[i, 0], points[i, 1]
        for k in range(len(places)):
            qx, qy = places[k, 0], places[k, 1]
            away = length(px - qx, py - qy)
            if away + rest[k] >= best:
                continue
            if cells.is_weighted:
                away = cost_between(cells, px, py, qx, qy)
                if away + rest[k] >= best:
                    continue
            if is_in_sight(cells, px, py, qx, qy, 0.0, cells.size):
                best = away + rest[k]
        result[i] = best
