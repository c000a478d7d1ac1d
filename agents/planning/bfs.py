"""BFS: cells in rings about the start, by the number of steps (a map planner).

Source: Moore (1959), breadth-first search. Sensing assumed: the map, own place on it. Memory kept: the way. States:
planning, following, waiting. Guarantee: reaches the goal in still worlds if there is a way over the cells. Length: the
fewest steps, whatever their length: a diagonal one counts as one, so among ways of as many steps it takes any.
"""

from __future__ import annotations

import numpy as np

from bug_gym.agents.planning.grid import Bytes, Grid, Nodes
from bug_gym.agents.planning.grid_planner import GridPlanner
from bug_gym.agents.planning.search import NO_WAY, Found, cost_of_way, offset_of, require_free, way_of
from bug_gym.compiling import kernel

REACHED = 8
"""Bit of a cell that has been reached, beside the step by which it was."""


def bfs(grid: Grid, start: int, goal: int) -> Found:
    """The way of the fewest steps over a grid.

    Args:
        grid: what is free.
        start: number of a cell.
        goal: number of a cell.

    Raises:
        ValueError: the start or the goal is blocked.
    """
    require_free(grid, start=start, goal=goal)
    came, queue = np.zeros(grid.blocked.size, dtype=np.uint8), np.empty(grid.blocked.size, dtype=np.int32)
    expanded = spread(grid.links, grid.lattice.columns, start, goal, came, queue)
    if not came[goal]:
        return NO_WAY._replace(expanded=expanded)
    nodes = way_of(grid, came, start, goal)
    return Found(nodes, cost_of_way(nodes, grid.lattice.columns), expanded)


@kernel
def spread(links: Bytes, columns: int, start: int, goal: int, came: Bytes, queue: Nodes) -> int:
    """Reach cells in the order of their steps from the start, until the goal is one. Returns how many were expanded.

    Args:
        links: the open steps of each cell (n,).
        columns: of the grid.
        start: number of a cell.
        goal: number of a cell.
        came: the step by which each was reached, with REACHED (n,), 0 at first; written here.
        queue: room for the cells in the order in which they are reached (n,).
    """
    came[start] = REACHED
    queue[0] = start
    first, end = 0, 1
    while first < end and not came[goal]:
        node = queue[first]
        first += 1
        for number in range(8):
            step = 2 * number % 8 + number // 4  # straight ones first: fewest steps, and short ones among them
            other = node + offset_of(step, columns)
            if links[node] >> step & 1 and not came[other]:
                came[other] = REACHED | step
                queue[end] = other
                end += 1
    return first


class BFS(GridPlanner):
    """BFS over the cells of the map; its parameters are those of GridPlanner."""

    def search(self, grid: Grid, start: int, goal: int) -> Found:
        """The way of the fewest steps."""
        return bfs(grid, start, goal)
