"""D*: a search from the goal that is repaired where cells change (a map planner).

Source: Stentz (1994), "Optimal and efficient path planning for partially-known environments": PROCESS-STATE,
MODIFY-COST, states NEW, OPEN and CLOSED, RAISE and LOWER. Sensing assumed: the map, own place on it, movers where they are
now. Memory kept: the distance of each cell from the goal, and where the way goes on from it. States: planning, following,
waiting. Guarantee: reaches the goal in still worlds if there is a way over the cells. Length: that of A*.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bug_gym.agents.planning.grid import FAR, Bytes, Grid, Nodes
from bug_gym.agents.planning.open_list import OpenList, open_list, put, take
from bug_gym.agents.planning.repairing_planner import RepairingPlanner
from bug_gym.agents.planning.search import NO_WAY, Found, cost_of, offset_of, require_free
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Integers

NEW, OPEN, CLOSED = 0, 1, 2
"""Tags of a cell: not reached yet, to be looked at (again), looked at."""

NOWHERE = 8
"""In place of a step: the way does not go on from here."""


class States(NamedTuple):
    """What D* knows of the cells (n,)."""

    distance: Integers
    """h: what the way to the goal costs."""
    least: Integers
    """k: the least that it has cost since the cell was put into the list."""
    tag: Bytes
    onward: Bytes
    """b: the step by which the way goes on."""


class DStar:
    """The search from one goal, kept from one repair to the next.

    Args:
        grid: what is free; changed by `change`.
        goal: number of a cell.

    Raises:
        ValueError: the goal is blocked.
    """

    def __init__(self, grid: Grid, goal: int) -> None:
        require_free(grid, goal=goal)
        cells = grid.blocked.size
        self.grid, self.goal = grid, goal
        self.expanded = 0
        """Cells looked at since the search was made."""
        distance, least = np.full((2, cells), FAR, dtype=np.int64)
        self.states = States(distance, least, np.zeros(cells, dtype=np.uint8), np.full(cells, NOWHERE, dtype=np.uint8))
        self.heap = open_list(cells)
        begin(self.states, self.heap, goal)

    def change(self, nodes: Nodes) -> None:
        """Tell that cells (k,) and the steps about them are others than before; `grid` says already what they are now."""
        modify(self.grid.lattice.columns, nodes, self.states, self.heap)

    def find(self, start: int) -> Found:
        """The shortest way from a cell.

        Raises:
            ValueError: the start is blocked.
        """
        require_free(self.grid, start=start)
        columns = self.grid.lattice.columns
        expanded = process(self.grid.links, columns, start, self.states, self.heap)
        self.expanded += expanded
        cost = int(self.states.distance[start])
        if cost >= FAR:
            return NO_WAY._replace(expanded=expanded)
        onward = self.states.onward
        nodes = np.empty(go_on(onward, columns, start, self.goal, np.empty(0, dtype=np.int32)), dtype=np.int32)
        go_on(onward, columns, start, self.goal, nodes)
        return Found(nodes, cost, expanded)


@kernel
def begin(states: States, heap: OpenList, goal: int) -> None:
    """Put the goal into the list."""
    insert(states, heap, goal, 0)


@kernel
def modify(columns: int, nodes: Nodes, states: States, heap: OpenList) -> None:
    """MODIFY-COST: cells whose steps have changed are looked at again, with their neighbours, where they were before."""
    for index in range(len(nodes)):
        for step in range(9):
            other = nodes[index] + (offset_of(step, columns) if step < 8 else 0)
            if states.tag[other] == CLOSED:
                insert(states, heap, other, states.distance[other])


@kernel
def process(links: Bytes, columns: int, start: int, states: States, heap: OpenList) -> int:
    """PROCESS-STATE until no cell in the list can make the way from the start shorter. Returns how many were looked at."""
    expanded = 0
    while heap.filled[0] > 0:
        node, least = heap.entries[0, 2], heap.entries[0, 0]
        if least >= FAR or (states.tag[start] == CLOSED and least >= states.distance[start]):
            break
        take(heap, node)
        states.tag[node] = CLOSED
        expanded += 1
        if least < states.distance[node]:
            lower_by_neighbours(links, columns, node, least, states)
        if least == states.distance[node]:
            pass_on(links, columns, node, states, heap)
        else:
            raise_neighbours(links, columns, node, least, states, heap)
    return expanded


@inlined
def lower_by_neighbours(links: Bytes, columns: int, node: int, least: int, states: States) -> None:
    """A raised cell takes the way of a neighbour that is surely right, where that is shorter."""
    for step in range(8):
        other = node + offset_of(step, columns)
        if not links[node] >> step & 1 or states.tag[other] == NEW or states.distance[other] > least:
            continue
        through = states.distance[other] + cost_of(step)
        if through < states.distance[node]:
            states.distance[node] = through
            states.onward[node] = step


@inlined
def pass_on(links: Bytes, columns: int, node: int, states: States, heap: OpenList) -> None:
    """A LOWER state: its neighbours learn of its way."""
    for step in range(8):
        other = node + offset_of(step, columns)
        through = states.distance[node] + cost_of(step) if links[node] >> step & 1 else FAR
        leads_here = states.onward[other] == step ^ 4
        if leads_here:
            if states.distance[other] != through:
                insert(states, heap, other, through)
        elif through < FAR and (states.tag[other] == NEW or states.distance[other] > through):
            states.onward[other] = step ^ 4
            insert(states, heap, other, through)


@inlined
def raise_neighbours(links: Bytes, columns: int, node: int, least: int, states: States, heap: OpenList) -> None:
    """A RAISE state: those whose way leads here become dearer, and those that know a shorter way are asked for it."""
    for step in range(8):
        other = node + offset_of(step, columns)
        is_open = links[node] >> step & 1
        through = min(states.distance[node] + cost_of(step), FAR) if is_open else FAR
        if states.onward[other] == step ^ 4:
            if states.distance[other] != through:
                insert(states, heap, other, through)
        elif not is_open:
            continue
        elif states.tag[other] == NEW:
            if through < FAR:
                states.onward[other] = step ^ 4
                insert(states, heap, other, through)
        elif states.distance[other] > through:
            insert(states, heap, node, states.distance[node])
        elif (
            states.distance[node] > states.distance[other] + cost_of(step)
            and states.tag[other] == CLOSED
            and states.distance[other] > least
        ):
            insert(states, heap, other, states.distance[other])


@called
def insert(states: States, heap: OpenList, node: int, distance: int) -> None:
    """INSERT: put a cell into the list under the least that its way has cost."""
    if states.tag[node] == NEW:
        states.least[node] = distance
    elif states.tag[node] == OPEN:
        states.least[node] = min(states.least[node], distance)
    else:
        states.least[node] = min(states.distance[node], distance)
    states.distance[node] = distance
    states.tag[node] = OPEN
    put(heap, states.least[node], 0, node)


@kernel
def go_on(onward: Bytes, columns: int, start: int, goal: int, nodes: Nodes) -> int:
    """Write the cells of the way from the start, as many as there is room for; returns how many there are."""
    count, node = 0, start
    while True:
        if count < len(nodes):
            nodes[count] = node
        count += 1
        if node == goal:
            return count
        node += offset_of(onward[node], columns)


class DStarPlanner(RepairingPlanner):
    """D* over the cells of the map, repaired where movers come and go; its parameters are those of GridPlanner."""

    def searching(self, grid: Grid, goal: int) -> DStar:
        """A search from a goal."""
        return DStar(grid, goal)
