"""What the searches over a grid share: lower bounds of what is left to go, steps, and the way that was found."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.planning.grid import COLUMN_STEPS, DIAGONAL, FAR, ROW_STEPS, STRAIGHT, UNIT, Bytes, Grid, Nodes
from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Integers

OCTILE, MANHATTAN, NOTHING = 0, 1, 2
"""Bounds of what is left: by straight and diagonal steps; by straight ones alone, exact with four neighbours and too much
with eight; none, as Dijkstra's."""


class Found(NamedTuple):
    """What a search over a grid has found."""

    nodes: Nodes
    """Numbers (k,) of the cells of the way from start to goal; none where there is no way."""
    cost: int
    """Of the way, in STRAIGHT and DIAGONAL, times what the ground costs; FAR where there is none."""
    expanded: int
    """Cells whose neighbours were looked at."""

    @property
    def length(self) -> float:
        """Of the way [cells], infinite where there is none."""
        return self.cost / STRAIGHT if self.cost < FAR else math.inf


NO_WAY = Found(np.zeros(0, dtype=np.int32), FAR, 0)


def require_free(grid: Grid, **nodes: int) -> None:
    """Raises a ValueError where a cell that a search begins or ends in is blocked or not of the grid."""
    lattice = grid.lattice
    for name, node in nodes.items():
        if not 0 <= node < grid.blocked.size:
            raise ValueError(f"the {name} is cell {node}, expected one from 0 to {grid.blocked.size - 1}")
        if not grid.is_free(node):
            ((x, y),) = lattice.places(np.array([node])).tolist()
            raise ValueError(f"the {name} ({x:g}, {y:g}) lies in an obstacle, or nearer to one than the body needs")


def bound_of(grid: Grid) -> int:
    """The bound that never says too much for a grid's steps."""
    return OCTILE if grid.connectivity == 8 else MANHATTAN


def way_of(grid: Grid, came: Bytes, start: int, goal: int) -> Nodes:
    """The cells of a way, from the step by which each was reached."""
    columns = grid.lattice.columns
    nodes = np.empty(trace(came, columns, start, goal, np.empty(0, dtype=np.int32)), dtype=np.int32)
    trace(came, columns, start, goal, nodes)
    return nodes[::-1]


@kernel
def trace(came: Bytes, columns: int, start: int, goal: int, nodes: Nodes) -> int:
    """Write the cells from the goal back to the start, as many as there is room for; returns how many there are.

    The low three bits of `came` are the step by which a cell was reached.
    """
    count, node = 0, goal
    while True:
        if count < len(nodes):
            nodes[count] = node
        count += 1
        if node == start:
            return count
        node -= offset_of(came[node] & 7, columns)


@inlined
def offset_of(step: int, columns: int) -> int:
    """What a step adds to the number of a cell."""
    return ROW_STEPS[step] * columns + COLUMN_STEPS[step]


@inlined
def cost_of(step: int) -> int:
    """What a step costs."""
    return DIAGONAL if step & 1 else STRAIGHT


@inlined
def cost_between(weights: Integers | None, node: int, other: int, step: int) -> int:
    """What a step from a cell to the one beside it costs: half of it on the ground of each."""
    if weights is not None:
        both: int = weights[node] + weights[other]
        return cost_of(step) * both // (2 * UNIT)
    return cost_of(step)


@inlined
def bound(kind: int, dx: int, dy: int) -> int:
    """What is left to go over so many columns and rows, at least; with MANHATTAN and eight neighbours it is a guess."""
    if kind == NOTHING:
        return 0
    dx, dy = abs(dx), abs(dy)
    if kind == MANHATTAN:
        return STRAIGHT * (dx + dy)
    return STRAIGHT * max(dx, dy) + (DIAGONAL - STRAIGHT) * min(dx, dy)


def cost_of_way(nodes: NDArray[np.integer], columns: int) -> int:
    """What a chain of neighbouring cells costs on open ground; a slow count for checks."""
    rows, cols = np.divmod(nodes.astype(np.int64), columns)
    steps = np.abs(np.diff(rows)) + np.abs(np.diff(cols))
    return int(STRAIGHT * (steps == 1).sum() + DIAGONAL * (steps == 2).sum())
