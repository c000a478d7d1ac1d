"""Dijkstra: cells in the order of their distance from the start (a map planner).

Source: Dijkstra (1959). Sensing assumed: the map, own place on it. Memory kept: the way. States: planning, following,
waiting. Guarantee: reaches the goal in still worlds if there is a way over the cells. Length: the shortest over the cells
before it is smoothed. What A* is checked by: it knows nothing of where the goal lies.
"""

from __future__ import annotations

import numpy as np

from bug_gym.agents.planning.grid import FAR, Bytes, Grid
from bug_gym.agents.planning.grid_planner import TerrainPlanner
from bug_gym.agents.planning.open_list import OpenList, drop_spent, open_list, put, put_next, spend_first
from bug_gym.agents.planning.search import NO_WAY, Found, cost_between, offset_of, require_free, way_of
from bug_gym.compiling import kernel
from bug_gym.kernels.layout import Integers


def dijkstra(grid: Grid, start: int, goal: int) -> Found:
    """The shortest way over a grid.

    Args:
        grid: what is free.
        start: number of a cell.
        goal: number of a cell.

    Raises:
        ValueError: the start or the goal is blocked.
    """
    require_free(grid, start=start, goal=goal)
    cost, came = np.full(grid.blocked.size, FAR, dtype=np.int64), np.zeros(grid.blocked.size, dtype=np.uint8)
    heap = open_list(grid.blocked.size)
    expanded = settle(grid.links, grid.weights, grid.lattice.columns, start, goal, cost, came, heap)
    if cost[goal] == FAR:
        return NO_WAY._replace(expanded=expanded)
    return Found(way_of(grid, came, start, goal), int(cost[goal]), expanded)


def distances(grid: Grid, start: int) -> Integers:
    """What the shortest way to each cell costs (n,), FAR where there is none; the start may be anywhere free."""
    require_free(grid, start=start)
    cost, came = np.full(grid.blocked.size, FAR, dtype=np.int64), np.zeros(grid.blocked.size, dtype=np.uint8)
    settle(grid.links, grid.weights, grid.lattice.columns, start, -1, cost, came, open_list(grid.blocked.size))
    return cost


@kernel
def settle(
    links: Bytes,
    weights: Integers | None,
    columns: int,
    start: int,
    goal: int,
    cost: Integers,
    came: Bytes,
    heap: OpenList,
) -> int:
    """Settle cells in the order of their cost, until the goal's turn has come. Returns how many were expanded.

    Args:
        links: the open steps of each cell (n,).
        weights: what the ground of each costs (n,), None: the same everywhere.
        columns: of the grid.
        start: number of a cell.
        goal: number of a cell, -1 for all cells.
        cost: of the way to each cell (n,), FAR at first; written here.
        came: the step by which each was reached (n,); written here.
        heap: empty.
    """
    cost[start] = 0
    put(heap, 0, 0, start)
    expanded = 0
    while heap.filled[0] > 0:
        if heap.entries[0, 2] == goal:
            break
        node, is_spent = spend_first(heap), True
        expanded += 1
        for step in range(8):
            other = node + offset_of(step, columns)
            if not links[node] >> step & 1:
                continue
            through = cost[node] + cost_between(weights, node, other, step)
            if through < cost[other]:
                cost[other] = through
                came[other] = step
                is_spent = put_next(heap, cost[other], 0, other, is_spent)
        if is_spent:
            drop_spent(heap)
    return expanded


class Dijkstra(TerrainPlanner):
    """Dijkstra over the cells of the map; its parameters are those of TerrainPlanner."""

    def search(self, grid: Grid, start: int, goal: int) -> Found:
        """The shortest way over the cells."""
        return dijkstra(grid, start, goal)
