"""Bidirectional A*: from both ends at once, each cell expanded once at most (a map planner).

Source: Pijls and Post (2009), "Yet another bidirectional algorithm for finding the shortest path" (NBA*). Sensing
assumed: the map, own place on it. Memory kept: the way. States: planning, following, waiting. Guarantee: reaches the goal
in still worlds if there is a way over the cells. Length: that of A*.

A cell on which one side's turn comes is done with for both. It is not expanded where a way through it cannot be shorter
than the best one found: by this side's own bound, or by what the other side has left to offer at least.
"""

from __future__ import annotations

import numpy as np

from bug_gym.agents.planning.grid import COLUMN_STEPS, FAR, ROW_STEPS, Bytes, Grid
from bug_gym.agents.planning.grid_planner import GridPlanner
from bug_gym.agents.planning.open_list import OpenList, open_list, put, take
from bug_gym.agents.planning.search import NO_WAY, Found, bound, bound_of, cost_of, offset_of, require_free, way_of
from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Integers


def bidirectional_a_star(grid: Grid, start: int, goal: int) -> Found:
    """The shortest way over a grid.

    Args:
        grid: what is free.
        start: number of a cell.
        goal: number of a cell.

    Raises:
        ValueError: the start or the goal is blocked.
    """
    require_free(grid, start=start, goal=goal)
    cells = grid.blocked.size
    ends = np.array([start, goal])
    cost, came = np.full((2, cells), FAR, dtype=np.int64), np.zeros((2, cells), dtype=np.uint8)
    is_done, best = np.zeros(cells, dtype=np.uint8), np.array([FAR, -1])
    lists = open_list(cells), open_list(cells)
    kind = bound_of(grid)
    expanded = meet(grid.links, grid.lattice.columns, ends, kind, cost, came, is_done, lists[0], lists[1], best)
    if best[1] < 0:
        return NO_WAY._replace(expanded=expanded)
    there = way_of(grid, came[0], start, int(best[1]))
    back = way_of(grid, came[1], goal, int(best[1]))
    return Found(np.concatenate([there, back[-2::-1]]), int(best[0]), expanded)


@kernel
def meet(
    links: Bytes,
    columns: int,
    ends: Integers,
    kind: int,
    cost: Integers,
    came: Bytes,
    is_done: Bytes,
    forward: OpenList,
    backward: OpenList,
    best: Integers,
) -> int:
    """Search from both ends, the side with fewer open cells first, until one has none. Returns how many were expanded.

    Args:
        links: the open steps of each cell (n,).
        columns: of the grid.
        ends: start and goal (2,).
        kind: what is left, at least.
        cost: of the way to each cell from either end (2, n), FAR at first; written here.
        came: the step by which each was reached (2, n); written here.
        is_done: whether either side's turn has come on a cell (n,), 0 at first; written here.
        forward: empty.
        backward: empty.
        best: cost of the best way found (FAR at first), and the cell on it where the sides have met; written here.
    """
    whole = bound_between(kind, columns, ends[0], ends[1])
    cost[0, ends[0]] = cost[1, ends[1]] = 0
    put(forward, whole, 0, ends[0])
    put(backward, whole, 0, ends[1])
    if ends[0] == ends[1]:
        best[0], best[1] = 0, ends[0]
    # Of each side the least that a way through its open cells costs.
    least_forward, least_backward = whole, whole
    expanded = 0
    while forward.filled[0] > 0 and backward.filled[0] > 0:
        if forward.filled[0] <= backward.filled[0]:
            expanded += advance(links, columns, ends, kind, cost, came, is_done, forward, best, 0, least_backward)
            least_forward = forward.entries[0, 0] if forward.filled[0] > 0 else FAR
        else:
            expanded += advance(links, columns, ends, kind, cost, came, is_done, backward, best, 1, least_forward)
            least_backward = backward.entries[0, 0] if backward.filled[0] > 0 else FAR
    return expanded


@inlined
def advance(
    links: Bytes,
    columns: int,
    ends: Integers,
    kind: int,
    cost: Integers,
    came: Bytes,
    is_done: Bytes,
    heap: OpenList,
    best: Integers,
    side: int,
    least_of_other: int,
) -> int:
    """The turn of one side's first open cell. Returns 1 where it was expanded, 0 where it need not be."""
    node = heap.entries[0, 2]
    total = heap.entries[0, 0]
    take(heap, node)
    if is_done[node]:
        return 0
    is_done[node] = 1
    so_far = cost[side, node]
    if total >= best[0] or so_far + least_of_other - bound_between(kind, columns, ends[side], node) >= best[0]:
        return 0
    target = ends[1 - side]
    dy, dx = node // columns - target // columns, node % columns - target % columns
    for step in range(8):
        other = node + offset_of(step, columns)
        if not links[node] >> step & 1 or is_done[other]:
            continue
        through = so_far + cost_of(step)
        if through < cost[side, other]:
            cost[side, other] = through
            came[side, other] = step
            left = bound(kind, dx + COLUMN_STEPS[step], dy + ROW_STEPS[step])
            put(heap, through + left, left, other)
            if through + cost[1 - side, other] < best[0]:
                best[0], best[1] = through + cost[1 - side, other], other
    return 1


@inlined
def bound_between(kind: int, columns: int, one: int, other: int) -> int:
    """What a way between two cells costs, at least."""
    return bound(kind, one % columns - other % columns, one // columns - other // columns)


class BidirectionalAStar(GridPlanner):
    """Bidirectional A* over the cells of the map; its parameters are those of GridPlanner."""

    def search(self, grid: Grid, start: int, goal: int) -> Found:
        """The shortest way over the cells."""
        return bidirectional_a_star(grid, start, goal)
