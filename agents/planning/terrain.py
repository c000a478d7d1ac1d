"""What the ground costs a planner: regions of a map as weights of a grid's cells, and straight ways over them.

A region divides a robot's greatest speeds by its factor while its centre is there, so a metre in it costs the factor, in
metres of open ground; where regions overlap the largest counts (bug_gym/schema/polygons.py).
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray

from bug_gym.agents.planning.grid import UNIT, Lattice
from bug_gym.agents.planning.map import Ground, PlanningMap
from bug_gym.compiling import kernel
from bug_gym.geometry import F64, Point
from bug_gym.kernels.layout import Integers


def weights_of(plan: PlanningMap, lattice: Lattice) -> Integers | None:
    """What the ground at the centre of each cell costs (rows * columns,), in UNIT; None where there are no regions."""
    if not plan.regions:
        return None
    weights = np.full((lattice.rows, lattice.columns), UNIT, dtype=np.int64)
    xs = lattice.x + lattice.size * np.arange(lattice.columns)
    ys = lattice.y + lattice.size * np.arange(lattice.rows)
    for ground in plan.regions:
        xmin, ymin, xmax, ymax = box_of(ground)
        rows = slice(*np.searchsorted(ys, (ymin, ymax), side="left"))
        columns = slice(*np.searchsorted(xs, (xmin, xmax), side="left"))
        x, y = np.meshgrid(xs[columns], ys[rows])
        part = weights[rows, columns]
        part[is_on(ground, x, y) & (part < round(UNIT * ground.factor))] = round(UNIT * ground.factor)
    return weights.ravel()


def box_of(ground: Ground) -> tuple[float, float, float, float]:
    """xmin, ymin, xmax, ymax of a region [m]."""
    if ground.disc is not None:
        x, y, radius = ground.disc
        return x - radius, y - radius, x + radius, y + radius
    (xmin, ymin), (xmax, ymax) = ground.rings[0].min(axis=0).tolist(), ground.rings[0].max(axis=0).tolist()
    return xmin, ymin, xmax, ymax


def is_on(ground: Ground, x: F64, y: F64) -> NDArray[np.bool_]:
    """Whether places lie in a region; of the shape of x and y."""
    if ground.disc is not None:
        own_x, own_y, radius = ground.disc
        return np.asarray(np.hypot(x - own_x, y - own_y) <= radius)
    shell, *holes = ground.rings
    return np.asarray(shapely.contains_xy(shapely.Polygon(shell, holes), x, y))


class WeighedGround:
    """The cost of straight ways over a grid's ground.

    Args:
        weights: of the cells (n,).
        lattice: where they lie.
    """

    def __init__(self, weights: Integers, lattice: Lattice) -> None:
        self._weights, self._lattice = weights, lattice

    def cost_of(self, a: Point, b: Point) -> float:
        """What the straight way from a to b costs, looked at four times a cell [m of open ground]."""
        return float(cost_along(self._weights, self._lattice, *a, *b))


@kernel
def cost_along(weights: Integers, lattice: Lattice, ax: float, ay: float, bx: float, by: float) -> float:
    """The length of a straight piece times the mean weight of the cells under it."""
    dx, dy = bx - ax, by - ay
    long = math.sqrt(dx * dx + dy * dy)
    pieces = max(int(math.ceil(4.0 * long / lattice.size)), 1)
    total = 0
    for piece in range(pieces):
        share = (piece + 0.5) / pieces
        column = int(math.floor((ax + share * dx - lattice.x) / lattice.size + 0.5))
        row = int(math.floor((ay + share * dy - lattice.y) / lattice.size + 0.5))
        column, row = min(max(column, 0), lattice.columns - 1), min(max(row, 0), lattice.rows - 1)
        total += weights[row * lattice.columns + column]
    return long * total / (UNIT * pieces)
