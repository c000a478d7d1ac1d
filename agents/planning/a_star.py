"""A*: cells in the order of the way there and the least that is left (a map planner).

Source: Hart, Nilsson and Raphael (1968). Sensing assumed: the map, own place on it. Memory kept: the way. States:
planning, following, waiting. Guarantee: reaches the goal in still worlds if there is a way over the cells. Length: the
shortest from cell to cell before it is smoothed. Over the shortest of all that touch free cells only that is at most 8.3 %
with eight neighbours in the open, and 41.5 % where cells beside them stop diagonal steps.

Among equals the one nearer to the goal comes first.
"""

from __future__ import annotations

import numpy as np

from bug_gym.agents.planning.bucket_list import (
    BucketList,
    bucket_list,
    come_round,
    drop_top,
    grown,
    has_room,
    node_of,
    put_in,
    second_key,
)
from bug_gym.agents.planning.grid import COLUMN_STEPS, FAR, ROW_STEPS, Bytes, Grid
from bug_gym.agents.planning.grid_planner import TerrainPlanner
from bug_gym.agents.planning.search import NO_WAY, Found, bound, bound_of, cost_between, offset_of, require_free, way_of
from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Integers

LOWEST = (0, *((steps & -steps).bit_length() - 1 for steps in range(1, 256)))
"""The first step of some, told as bits."""

AT_START = 8
"""The step by which the start was reached: none."""


def onward(step: int) -> int:
    """The steps, as bits, that may lead on to somewhere new after a step.

    What lies beside both cells was looked at from the first one already, where the way is no longer.
    """
    if step == AT_START:
        return 255
    ahead, aside = (0, 1, 7), (2, 6)
    return sum(1 << (step + turn) % 8 for turn in ahead + aside)


ONWARD = tuple(onward(step) for step in range(AT_START + 1))


def a_star(grid: Grid, start: int, goal: int, *, guess: int | None = None) -> Found:
    """The shortest way over a grid.

    Args:
        grid: what is free.
        start: number of a cell.
        goal: number of a cell.
        guess: what is left (`search.OCTILE` and its neighbours); None: the bound that never says too much. With one that
            does, the way need not be the shortest.

    Raises:
        ValueError: the start or the goal is blocked.
    """
    require_free(grid, start=start, goal=goal)
    cells = grid.blocked.size
    cost, came = np.full(cells, FAR, dtype=np.int64), np.zeros(cells, dtype=np.uint8)
    kind = bound_of(grid) if guess is None else guess
    opened = bucket_list(grid.weights)
    columns = grid.lattice.columns
    begin(columns, start, goal, kind, cost, came, opened)
    expanded = 0
    while True:
        expanded += search(grid.links, grid.weights, columns, goal, kind, cost, came, opened)
        if has_room(opened):
            break
        opened = grown(opened)
    if cost[goal] == FAR:
        return NO_WAY._replace(expanded=expanded)
    return Found(way_of(grid, came, start, goal), int(cost[goal]), expanded)


@kernel
def begin(columns: int, start: int, goal: int, kind: int, cost: Integers, came: Bytes, opened: BucketList) -> None:
    """Put the start into the list."""
    left = bound(kind, start % columns - goal % columns, start // columns - goal // columns)
    cost[start], came[start] = 0, AT_START
    put_in(opened, left, second_key(left, start))


@kernel
def search(
    links: Bytes,
    weights: Integers | None,
    columns: int,
    goal: int,
    kind: int,
    cost: Integers,
    came: Bytes,
    opened: BucketList,
) -> int:
    """A* over open steps, until the goal's turn has come or the list is full. Returns how many cells were expanded.

    Args:
        links: the open steps of each cell (n,).
        weights: what the ground of each costs (n,), None: the same everywhere.
        columns: of the grid.
        goal: number of a cell.
        kind: what is left.
        cost: of the way to each cell (n,), FAR where none has been found; written here.
        came: the step by which each was reached (n,); written here.
        opened: cells that have been found; in a full one the search goes on when it has grown.
    """
    goal_row, goal_column = goal // columns, goal % columns
    expanded = 0
    while has_room(opened) and come_round(opened):
        first, node = opened.heap[0, 0], node_of(opened.heap[0, 1])
        if node == goal:
            break
        drop_top(opened)
        here = cost[node]
        dy = node // columns
        dx = node - dy * columns - goal_column
        dy -= goal_row
        if first != here + bound(kind, dx, dy):
            continue  # a shorter way to it has been found since, and was followed in its turn
        expanded += 1
        steps = int(links[node])
        if weights is None:
            steps &= not_seen_before(links, columns, node, came[node])
        while steps != 0:
            step = LOWEST[steps]
            steps &= steps - 1
            other = node + offset_of(step, columns)
            through = here + cost_between(weights, node, other, step)
            if through < cost[other]:
                cost[other] = through
                came[other] = step
                left = bound(kind, dx + COLUMN_STEPS[step], dy + ROW_STEPS[step])
                put_in(opened, through + left, second_key(left, other))
    return expanded


@inlined
def not_seen_before(links: Bytes, columns: int, node: int, by: int) -> int:
    """The steps out of a cell, as bits, to what was not looked at from the cell before at no more cost.

    After a straight step that is what lies aside, where a diagonal step leads there; the rest is in ONWARD.
    """
    steps: int = ONWARD[by]
    if by < AT_START and not by & 1:
        before = int(links[node - offset_of(by, columns)])
        for turn in (1, 7):
            steps &= ~((before >> ((by + turn) & 7) & 1) << ((by + 2 * turn) & 7))
    return steps


class AStar(TerrainPlanner):
    """A* over the cells of the map; its parameters are those of TerrainPlanner."""

    def search(self, grid: Grid, start: int, goal: int) -> Found:
        """The shortest way over the cells."""
        return a_star(grid, start, goal)
