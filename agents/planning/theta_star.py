"""Theta*: A* whose ways run straight between any two cells in sight of each other (a map planner).

Source: Nash, Daniel, Koenig and Felner (2007), the basic one. Sensing assumed: the map, own place on it. Memory kept: the
way. States: planning, following, waiting. Guarantee: reaches the goal in still worlds if there is a way over the cells.
Length: near the shortest of all; on even ground never over that of A*'s way over the same cells.

A cell is reached from its neighbour's parent where the two are in sight ("path 2" of the paper's UpdateVertex), else from
the neighbour itself ("path 1"). In sight: all cells that the straight line touches are free. Cells are taken for blocked
half a diagonal earlier than for others, so such a line keeps its room everywhere.

Other than in the paper, ways lead over the centres of cells and not over their corners, and a cell whose turn has been is
taken up again where a shorter way to it is found, which the paper leaves closed.

Over ground that is not the same everywhere a straight way costs what the cells under it do, looked at four times a cell,
and the one by way of the neighbour is tried too, as it may be the cheaper (Daniel, Nash, Koenig and Felner 2010 say so).
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.planning.grid import FAR, STRAIGHT, UNIT, Bytes, Grid, Nodes
from bug_gym.agents.planning.grid_planner import TerrainPlanner
from bug_gym.agents.planning.open_list import OpenList, open_list, put, take
from bug_gym.agents.planning.planner import Room
from bug_gym.agents.planning.search import NO_WAY, Found, offset_of, require_free
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Integers


def theta_star(grid: Grid, start: int, goal: int) -> Found:
    """A way over a grid that bends at centres of cells only; its cost is its length, rounded to 2^-30 of a cell.

    Args:
        grid: what is free.
        start: number of a cell.
        goal: number of a cell.

    Raises:
        ValueError: the start or the goal is blocked.
    """
    require_free(grid, start=start, goal=goal)
    cells = grid.blocked.size
    cost, parent = np.full(cells, FAR, dtype=np.int64), np.full(cells, -1, dtype=np.int32)
    expanded = search_any_angle(
        grid.blocked, grid.links, grid.weights, grid.lattice.columns, start, goal, cost, parent, open_list(cells)
    )
    if cost[goal] == FAR:
        return NO_WAY._replace(expanded=expanded)
    nodes = [goal]
    while nodes[-1] != start:
        nodes.append(int(parent[nodes[-1]]))
    return Found(np.array(nodes[::-1], dtype=np.int32), int(cost[goal]), expanded)


@kernel
def search_any_angle(
    blocked: Bytes,
    links: Bytes,
    weights: Integers | None,
    columns: int,
    start: int,
    goal: int,
    cost: Integers,
    parent: Nodes,
    heap: OpenList,
) -> int:
    """Theta* until the goal's turn has come. Returns how many cells were expanded.

    Args:
        blocked: (rows, columns).
        links: the open steps of each cell (n,).
        weights: what the ground of each costs (n,), None: the same everywhere.
        columns: of the grid.
        start: number of a cell.
        goal: number of a cell.
        cost: of the way to each cell (n,), FAR at first; written here.
        parent: where the straight way to each cell begins (n,); written here.
        heap: empty.
    """
    cost[start] = 0
    parent[start] = start
    put(heap, straight(columns, start, goal), 0, start)
    expanded = 0
    while heap.filled[0] > 0:
        node = heap.entries[0, 2]
        if node == goal:
            break
        take(heap, node)
        expanded += 1
        for step in range(8):
            if not links[node] >> step & 1:
                continue
            other = node + offset_of(step, columns)
            origin = parent[node]
            through = cost[origin] + line_cost(weights, columns, origin, other)
            if weights is not None:
                beside = cost[node] + line_cost(weights, columns, node, other)
                if beside < through - ROUNDED:
                    origin, through = node, beside
            # On even ground the way through the node itself is no shorter, by the triangle's inequality.
            if through >= cost[other]:
                continue
            if origin != node and not in_sight(blocked, columns, origin, other):
                origin = node
                through = cost[node] + line_cost(weights, columns, node, other)
                if through >= cost[other]:
                    continue
            cost[other] = through
            parent[other] = origin
            left = straight(columns, other, goal)
            put(heap, through + left, left, other)
    return expanded


ROUNDED = 4
"""Differences of costs up to this come of rounding alone."""


@called
def line_cost(weights: Integers | None, columns: int, one: int, other: int) -> int:
    """What the straight way between two cells costs on the ground under it."""
    if weights is not None:
        row, column = one // columns, one % columns
        down, across = other // columns - row, other % columns - column
        pieces = max(math.ceil(4.0 * math.sqrt(float(down * down + across * across))), 1)
        total = 0
        for piece in range(pieces):
            share = (piece + 0.5) / pieces
            at = (row + int(math.floor(share * down + 0.5))) * columns + column + int(math.floor(share * across + 0.5))
            total += weights[at]
        return round(straight(columns, one, other) * (total / (UNIT * pieces)))
    return straight(columns, one, other)


@inlined
def straight(columns: int, one: int, other: int) -> int:
    """Distance of two cells, as costs are counted."""
    dy, dx = float(one // columns - other // columns), float(one % columns - other % columns)
    return round(STRAIGHT * math.sqrt(dx * dx + dy * dy))


@called
def in_sight(blocked: Bytes, columns: int, one: int, other: int) -> bool:
    """Whether all cells are free that the straight line between two cells' centres touches, be it in a corner."""
    row, column = one // columns, one % columns
    dy, dx = other // columns - row, other % columns - column
    down, across = (1 if dy > 0 else -1), (1 if dx > 0 else -1)
    dy, dx = abs(dy), abs(dx)
    # Sides of cells crossed so far, up and across; of the next two, the nearer one is crossed first.
    up, along = 0, 0
    while up < dy or along < dx:
        difference = (2 * along + 1) * dy - (2 * up + 1) * dx
        if difference == 0:
            if blocked[row + down, column] or blocked[row, column + across]:
                return False
            row, column = row + down, column + across
            up, along = up + 1, along + 1
        elif difference < 0:
            column, along = column + across, along + 1
        else:
            row, up = row + down, up + 1
        if blocked[row, column]:
            return False
    return True


class ThetaStar(TerrainPlanner):
    """Theta* over the cells of the map; its parameters are those of TerrainPlanner."""

    def search(self, grid: Grid, start: int, goal: int) -> Found:
        """A way that bends at cells only."""
        return theta_star(grid, start, goal)

    def clearance_of(self, room: Room, size: float) -> float:
        """Half a diagonal of a cell more than the room [m]: a straight way may touch any point of a free cell."""
        return room.growth + math.sqrt(0.5) * size
