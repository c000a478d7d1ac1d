"""Lazy Theta*: the shortest way among blocked cells, which bends at cells but runs straight between them.

Source: Nash, Koenig and Tovey (2010). A node takes the parent of the one it was reached from on trust; whether they see
each other is looked at only when the node's turn has come. All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.mapping.cells import Cells
from bug_gym.agents.mapping.sight import cost_between, escape_from, is_in_sight
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.geometry import length
from bug_gym.kernels.layout import Floats, Integers

Indices = NDArray[np.int32]

ROW_STEPS, COLUMN_STEPS = (-1, -1, -1, 0, 0, 1, 1, 1), (-1, 0, 1, -1, 1, -1, 0, 1)
"""From a cell to the eight around it."""


class Scratch(NamedTuple):
    """Working memory of a search over n cells and the goal (n + 1,)."""

    cost: Floats
    parent: Indices
    seen: Indices
    """Number of the search that last came to the cell."""
    place: Indices
    """Of an open node in the heap; -1: it is closed."""
    heap: Indices
    key: Floats


class Search:
    """The working memory of searches, shared by the maps of one policy."""

    def __init__(self) -> None:
        self.resize(0)

    def resize(self, cells: int) -> None:
        """Make room for a grid of so many cells."""
        self.cells = cells
        self.stamp = 0
        parent, seen, place, heap = np.zeros((4, cells + 1), dtype=np.int32)
        self.scratch = Scratch(np.empty(cells + 1), parent, seen, place, heap, np.empty(cells + 1))


class Trip(NamedTuple):
    """What one search is asked for."""

    start: int
    """Node where the robot is."""
    sx: float
    """Where the robot is [m]."""
    sy: float
    goal: int
    """Node of the goal: one of its own, beside those of the cells."""
    gx: float
    """Where the goal is [m]."""
    gy: float
    escape: float
    """Within this distance of the start [m] blocked cells don't count."""
    stamp: int
    """Number of the search."""


@kernel
def find_way(
    cells: Cells,
    sx: float,
    sy: float,
    gx: float,
    gy: float,
    tolerance: float,
    box: Integers,
    scratch: Scratch,
    stamp: int,
    places: Floats,
    rest: Floats,
) -> int:
    """Lazy Theta* from (sx, sy) to (gx, gy). Returns the number of places of the way, 0 for none.

    A cell is the node row * columns + column. The goal is a node of its own (number rows * columns), in reach of every
    node that it is in sight of. A node is open while its place in the heap is >= 0 and closed when that is -1.

    Args:
        cells: the remembered points.
        sx: x of the start [m].
        sy: y of the start [m].
        gx: x of the goal [m].
        gy: y of the goal [m].
        tolerance: within this distance of the goal [m] blocked cells don't count.
        box: (4,) first row, first column, last row and last column of the cells that are searched.
        scratch: working memory.
        stamp: number of the search.
        places: (k, 2) the places of the way, written here [m].
        rest: (k,) what is left to go from each, written here [m].
    """
    trip = trip_of(cells, sx, sy, gx, gy, stamp)
    count = open_node(scratch, trip, 0, trip.start, trip.start, 0.0, length(gx - sx, gy - sy))
    while count > 0:
        node = scratch.heap[0]
        count = close_first(scratch, count)
        if node == trip.goal:
            break
        x, y = place_of(cells, trip, node)
        if node != trip.start:
            reparent(cells, trip, scratch, node, x, y)
        if is_in_sight(cells, x, y, gx, gy, trip.escape if node == trip.start else 0.0, tolerance):
            # From the node's parent, if it sees the goal too, the way is no longer; it was looked at before.
            count = see_goal(cells, trip, scratch, count, node, x, y)
            if not cells.is_weighted:
                continue
        count = open_neighbours(cells, trip, scratch, count, node, x, y, box)
    if scratch.seen[trip.goal] != stamp or scratch.place[trip.goal] != -1:
        return 0
    return write_way(cells, trip, scratch, places, rest)


@inlined
def trip_of(cells: Cells, sx: float, sy: float, gx: float, gy: float, stamp: int) -> Trip:
    """The trip from one place to another; a start beside the grid is in the nearest cell of it."""
    rows, columns = cells.blocked.shape
    column = min(max(int((sx - cells.x) / cells.size), 0), columns - 1)
    row = min(max(int((sy - cells.y) / cells.size), 0), rows - 1)
    escape = escape_from(cells, sx, sy)
    return Trip(row * columns + column, sx, sy, rows * columns, gx, gy, escape, stamp)


@inlined
def middle_of(cells: Cells, row: int, column: int) -> tuple[float, float]:
    """Middle of a cell [m]."""
    return cells.x + (column + 0.5) * cells.size, cells.y + (row + 0.5) * cells.size


@inlined
def place_of(cells: Cells, trip: Trip, node: int) -> tuple[float, float]:
    """Where a node is [m]: the middle of its cell, but for the start, which is where the robot is."""
    if node == trip.start:
        return trip.sx, trip.sy
    columns = cells.blocked.shape[1]
    return middle_of(cells, node // columns, node % columns)


@inlined
def cost_of_line(cells: Cells, ax: float, ay: float, bx: float, by: float) -> float:
    """Cost of the straight way from a to b: its length, weighted where terrain is."""
    if cells.is_weighted:
        return cost_between(cells, ax, ay, bx, by)
    return length(bx - ax, by - ay)


@inlined
def reparent(cells: Cells, trip: Trip, scratch: Scratch, node: int, x: float, y: float) -> None:
    """Look at the parent that a node took on trust: out of sight, the best closed neighbour stands in for it.

    On weighted ground the neighbour may be the better one in any case.
    """
    cost, parent = scratch.cost, scratch.parent
    up = parent[node]
    ux, uy = place_of(cells, trip, up)
    is_seen = is_in_sight(cells, ux, uy, x, y, trip.escape if up == trip.start else 0.0, 0.0)
    if is_seen and not cells.is_weighted:
        return
    best = cost[up] + cost_between(cells, ux, uy, x, y) if is_seen else np.inf
    rows, columns = cells.blocked.shape
    row, column = node // columns, node % columns
    for k in range(8):
        r, c = row + ROW_STEPS[k], column + COLUMN_STEPS[k]
        if not (0 <= r < rows and 0 <= c < columns):
            continue
        other = r * columns + c
        if scratch.seen[other] != trip.stamp or scratch.place[other] != -1:
            continue
        ox, oy = place_of(cells, trip, other)
        via = cost[other] + cost_of_line(cells, ox, oy, x, y)
        if via < best:
            best = via
            parent[node] = other
    cost[node] = best


@inlined
def see_goal(cells: Cells, trip: Trip, scratch: Scratch, count: int, node: int, x: float, y: float) -> int:
    """Reach the goal straight from a node that sees it. Returns how many nodes are open then."""
    goal = trip.goal
    total = scratch.cost[node] + cost_of_line(cells, x, y, trip.gx, trip.gy)
    if scratch.seen[goal] != trip.stamp or total < scratch.cost[goal]:
        count = open_node(scratch, trip, count, goal, node, total, total)
    return count


@inlined
def open_neighbours(
    cells: Cells, trip: Trip, scratch: Scratch, count: int, node: int, x: float, y: float, box: Integers
) -> int:
    """Reach the open cells around a node straight from its parent, on trust. Returns how many nodes are open then."""
    columns = cells.blocked.shape[1]
    row, column = node // columns, node % columns
    up = scratch.parent[node]
    ux, uy = place_of(cells, trip, up)
    # Among blocked cells no neighbour may be open: out of them it goes to any cell within the escape.
    reach = 1 if node != trip.start or trip.escape == 0.0 else int(math.ceil(trip.escape / cells.size))
    for r in range(max(row - reach, box[0]), min(row + reach, box[2]) + 1):
        for c in range(max(column - reach, box[1]), min(column + reach, box[3]) + 1):
            if cells.blocked[r, c] or (r == row and c == column):
                continue
            other = r * columns + c
            is_known = scratch.seen[other] == trip.stamp
            if is_known and scratch.place[other] == -1:
                continue
            ox, oy = middle_of(cells, r, c)
            if reach > 1 and (ox - x) ** 2 + (oy - y) ** 2 > trip.escape * trip.escape:
                continue
            through = scratch.cost[up] + length(ox - ux, oy - uy)
            if is_known and through >= scratch.cost[other]:
                continue
            key = through + length(trip.gx - ox, trip.gy - oy)
            count = open_node(scratch, trip, count, other, up, through, key)
    return count


@inlined
def write_way(cells: Cells, trip: Trip, scratch: Scratch, places: Floats, rest: Floats) -> int:
    """Write the way to the goal, backward from there. Returns the number of its places."""
    nodes = 2
    node = scratch.parent[trip.goal]
    while node != trip.start:
        nodes += 1
        node = scratch.parent[node]
    # Of a longer way the first places are kept: the rest is planned again on the way.
    kept = min(nodes, len(places))
    total = scratch.cost[trip.goal]
    at = trip.goal
    for i in range(nodes - 1, -1, -1):
        if i < kept:
            x, y = (trip.gx, trip.gy) if at == trip.goal else place_of(cells, trip, at)
            places[i, 0], places[i, 1] = x, y
            rest[i] = total - scratch.cost[at]
        at = scratch.parent[at]
    return kept


# ----------------------------------------------------------------------------------------------- the heap of open nodes


@inlined
def open_node(scratch: Scratch, trip: Trip, count: int, node: int, parent: int, cost: float, key: float) -> int:
    """Write how a node is reached, and put it in its place among the `count` open ones. Returns how many there are."""
    if scratch.seen[node] != trip.stamp:
        scratch.seen[node] = trip.stamp
        scratch.heap[count] = node
        scratch.place[node] = count
        count += 1
    scratch.cost[node] = cost
    scratch.parent[node] = parent
    scratch.key[node] = key
    rise(scratch.heap, scratch.key, scratch.place, scratch.place[node])
    return count


@inlined
def close_first(scratch: Scratch, count: int) -> int:
    """Close the node on top of the heap of `count` open ones. Returns how many are left."""
    heap, place = scratch.heap, scratch.place
    node = heap[0]
    count -= 1
    if count > 0:
        heap[0] = heap[count]
        place[heap[0]] = 0
        sink(heap, scratch.key, place, count)
    place[node] = -1
    return count


@called
def rise(heap: Indices, key: Floats, place: Indices, index: int) -> None:
    """Restore the heap above position `index`."""
    node = heap[index]
    value = key[node]
    while index > 0:
        above = (index - 1) >> 1
        if key[heap[above]] <= value:
            break
        heap[index] = heap[above]
        place[heap[index]] = index
        index = above
    heap[index] = node
    place[node] = index


@called
def sink(heap: Indices, key: Floats, place: Indices, count: int) -> None:
    """Restore the heap below its top."""
    node = heap[0]
    value = key[node]
    index = 0
    while True:
        below = 2 * index + 1
        if below >= count:
            break
        if below + 1 < count and key[heap[below + 1]] < key[heap[below]]:
            below += 1
        if key[heap[below]] >= value:
            break
        heap[index] = heap[below]
        place[heap[index]] = index
        index = below
    heap[index] = node
    place[node] = index
