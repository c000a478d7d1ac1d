"""D* Lite: A* from the goal, repaired where cells change (a map planner; with `known=False` it plans in what it has seen).

Source: Koenig and Likhachev (2005), "Fast replanning for navigation in unknown terrain", the optimised version. Sensing
assumed: the map, own place on it, movers where they are now; in unknown terrain scan, own position, goal. Memory kept: all
scan points seen (in unknown terrain), two estimates of each cell's distance from the goal. States: planning, following,
waiting, looking. Guarantee: reaches the goal in still worlds if there is a way over the cells. Length: that of A* over what is
known.

In unknown terrain what has not been seen counts as free, and what comes to be seen is planned round. Where that leaves no
way it goes to look where the body alone might pass, then waits, and says so when no ground has turned out free for ten
seconds and what has gone is forgotten: "unreachable" where the points seen stop the body itself, else "stuck".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.grid import FAR, Bytes, Grid, Nodes
from bug_gym.agents.planning.grid_planner import TerrainParameters, TerrainPlanner
from bug_gym.agents.planning.map_policy import MapMemory
from bug_gym.agents.planning.open_list import OpenList, is_before, open_list, put, take
from bug_gym.agents.planning.planner import Plan
from bug_gym.agents.planning.repairing_planner import RepairingMemory, RepairingPlanner
from bug_gym.agents.planning.search import NO_WAY, Found, bound, bound_of, cost_between, offset_of, require_free
from bug_gym.agents.planning.seen_ground import SeeingPlanner, SeenGround, drive_in_seen
from bug_gym.agents.planning.smoothing import pulled
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Integers
from bug_gym.policy import Velocity
from bug_gym.view import View


class Estimates(NamedTuple):
    """What D* Lite knows of the cells (n,)."""

    cost: Integers
    """g: what the way to the goal costs, as it was when the cell was expanded last."""
    ahead: Integers
    """rhs: the same, from what the neighbours say now."""


class DStarLite:
    """The search from one goal, kept from one repair to the next.

    Args:
        grid: what is free; changed by the caller, who tells `change`.
        goal: number of a cell.

    Raises:
        ValueError: the goal is blocked.
    """

    def __init__(self, grid: Grid, goal: int) -> None:
        require_free(grid, goal=goal)
        cells = grid.blocked.size
        self.grid, self.goal = grid, goal
        self.expanded = 0
        """Cells expanded since the search was made."""
        cost, ahead = np.full((2, cells), FAR, dtype=np.int64)
        ahead[goal] = 0
        self.estimates = Estimates(cost, ahead)
        self.heap = open_list(cells)
        self._kind = bound_of(grid)
        self._moved = 0  # k_m: by how much bounds may have grown since the first keys
        self._start = -1

    def change(self, nodes: Nodes) -> None:
        """Tell that cells (k,) and the steps about them are others than before; `grid` says already what they are now."""
        if self._start >= 0:  # else nothing has been searched yet
            key = self._start, self.goal, self._kind, self._moved
            revise(
                self.grid.links, self.grid.weights, self.grid.lattice.columns, nodes, *key, self.estimates, self.heap
            )

    def find(self, start: int) -> Found:
        """The shortest way from a cell.

        Raises:
            ValueError: the start is blocked.
        """
        require_free(self.grid, start=start)
        columns, links, weights = self.grid.lattice.columns, self.grid.links, self.grid.weights
        if self._start < 0:
            begin(columns, start, self.goal, self._kind, self.heap)
        else:
            self._moved += int(least_between(self._kind, columns, start, self._start))
        self._start = start
        key = start, self.goal, self._kind, self._moved
        expanded = repair(links, weights, columns, *key, self.estimates, self.heap)
        self.expanded += expanded
        if self.estimates.ahead[start] >= FAR:
            return NO_WAY._replace(expanded=expanded)
        cost = int(self.estimates.ahead[start])
        none = np.empty(0, dtype=np.int32)
        nodes = np.empty(walk(links, weights, columns, start, self.goal, self.estimates, none), dtype=np.int32)
        walk(links, weights, columns, start, self.goal, self.estimates, nodes)
        return Found(nodes, cost, expanded)


@kernel
def begin(columns: int, start: int, goal: int, kind: int, heap: OpenList) -> None:
    """Put the goal into the list."""
    put(heap, bound_from(kind, columns, start, goal), 0, goal)


@kernel
def least_between(kind: int, columns: int, one: int, other: int) -> int:
    """What a way between two cells costs, at least."""
    return bound_from(kind, columns, one, other)


@kernel
def repair(
    links: Bytes,
    weights: Integers | None,
    columns: int,
    start: int,
    goal: int,
    kind: int,
    moved: int,
    estimates: Estimates,
    heap: OpenList,
) -> int:
    """ComputeShortestPath. Returns how many cells were expanded.

    Args:
        links: the open steps of each cell (n,).
        weights: what the ground of each costs (n,), None: the same everywhere.
        columns: of the grid.
        start: where the robot is.
        goal: where the search began.
        kind: what is left, at least.
        moved: k_m, added to all new keys.
        estimates: of the cells; changed.
        heap: the cells whose two estimates differ; changed.
    """
    cost, ahead = estimates
    expanded = 0
    while heap.filled[0] > 0:
        node, first, second = heap.entries[0, 2], heap.entries[0, 0], heap.entries[0, 1]
        target = min(cost[start], ahead[start])
        if not (is_before(first, second, min(target + moved, FAR), target) or ahead[start] > cost[start]):
            break
        least = min(cost[node], ahead[node])
        now = key(kind, columns, start, node, least, moved)
        if is_before(first, second, now, least):
            put(heap, now, least, node)
            continue
        expanded += 1
        if cost[node] > ahead[node]:
            cost[node] = ahead[node]
            take(heap, node)
            for step in range(8):
                other = node + offset_of(step, columns)
                if not links[node] >> step & 1 or other == goal:
                    continue
                through = cost[node] + cost_between(weights, node, other, step)
                if through < ahead[other]:
                    ahead[other] = through
                    update(columns, start, other, kind, moved, estimates, heap)
        else:
            before = cost[node]
            cost[node] = FAR
            update(columns, start, node, kind, moved, estimates, heap)
            for step in range(8):
                other = node + offset_of(step, columns)
                if not links[node] >> step & 1 or other == goal:
                    continue
                if ahead[other] == before + cost_between(weights, node, other, step):
                    look_ahead(links, weights, columns, other, estimates)
                    update(columns, start, other, kind, moved, estimates, heap)
    return expanded


@kernel
def revise(
    links: Bytes,
    weights: Integers | None,
    columns: int,
    nodes: Nodes,
    start: int,
    goal: int,
    kind: int,
    moved: int,
    estimates: Estimates,
    heap: OpenList,
) -> None:
    """Estimate anew from the neighbours what lies in and about changed cells."""
    for index in range(len(nodes)):
        for step in range(9):
            other = nodes[index] + (offset_of(step, columns) if step < 8 else 0)
            if other != goal:
                before = estimates.ahead[other]
                look_ahead(links, weights, columns, other, estimates)
                if estimates.ahead[other] != before:
                    update(columns, start, other, kind, moved, estimates, heap)


@called
def look_ahead(links: Bytes, weights: Integers | None, columns: int, node: int, estimates: Estimates) -> None:
    """Write what the way from a cell costs by what its neighbours' cost."""
    best = FAR
    for step in range(8):
        if links[node] >> step & 1:
            other = node + offset_of(step, columns)
            best = min(best, estimates.cost[other] + cost_between(weights, node, other, step))
    estimates.ahead[node] = best


@called
def update(columns: int, start: int, node: int, kind: int, moved: int, estimates: Estimates, heap: OpenList) -> None:
    """UpdateVertex: a cell is in the list while its two estimates differ."""
    if estimates.cost[node] == estimates.ahead[node]:
        take(heap, node)
    else:
        least = min(estimates.cost[node], estimates.ahead[node])
        put(heap, key(kind, columns, start, node, least, moved), least, node)


@inlined
def key(kind: int, columns: int, start: int, node: int, least: int, moved: int) -> int:
    """The first key of a cell whose smaller estimate is `least`."""
    return min(least + bound_from(kind, columns, start, node) + moved, FAR)


@inlined
def bound_from(kind: int, columns: int, start: int, node: int) -> int:
    """What the way from the start to a cell costs, at least."""
    return bound(kind, start % columns - node % columns, start // columns - node // columns)


@kernel
def walk(
    links: Bytes,
    weights: Integers | None,
    columns: int,
    start: int,
    goal: int,
    estimates: Estimates,
    nodes: Nodes,
) -> int:
    """Write the cells from the start to the goal, each time the neighbour through which it is shortest.

    Returns how many there are; no more are written than there is room for.
    """
    count, node = 0, start
    while True:
        if count < len(nodes):
            nodes[count] = node
        count += 1
        if node == goal:
            return count
        best, onward = FAR, 0
        for step in range(8):
            if links[node] >> step & 1:
                other = node + offset_of(step, columns)
                through = estimates.cost[other] + cost_between(weights, node, other, step)
                if through < best:
                    best, onward = through, step
        node += offset_of(onward, columns)


@dataclass(frozen=True)
class DStarLiteParameters(TerrainParameters):
    """Parameters of D* Lite."""

    known: bool = True
    """Whether the map is given; else it is planned in what has been seen so far, and the policy is not privileged."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.terrain and not self.known:
            raise ValueError("terrain=True needs known=True: ground is not remembered from what has been seen of it")


@dataclass
class DStarLiteMemory(RepairingMemory):
    """Memory of D* Lite."""

    seen: SeenGround | None = None
    """What has been seen of unknown terrain."""


class DStarLitePlanner(SeeingPlanner, TerrainPlanner, RepairingPlanner):
    """D* Lite over the cells of the map, repaired where movers come and go, or where something new is seen.

    Raises:
        TypeError: an unknown parameter.
        ValueError: what GridPlanner refuses; `terrain` in terrain that is not known.
    """

    Parameters: ClassVar[type[DStarLiteParameters]] = DStarLiteParameters
    memory_type: ClassVar[type[MapMemory]] = DStarLiteMemory
    parameters: DStarLiteParameters

    def reads_map(self) -> bool:
        """Whether the map is given."""
        return self.parameters.known

    def searching(self, grid: Grid, goal: int) -> DStarLite:
        """A search from a goal."""
        return DStarLite(grid, goal)

    def act(self, view: View, memory: Any) -> Velocity:
        """One decision."""
        if self.privileged:
            return super().act(view, memory)
        if memory.seen is None:
            memory.seen = SeenGround(self.parameters, self.rooms)
        return drive_in_seen(self, memory.seen, view, memory)

    def plan(self, scene: Scene, memory: Any) -> Plan:
        """The way over the cells, as seen so far where the map is not given."""
        seen = memory.seen
        if seen is None:
            return super().plan(scene, memory)
        while True:
            ends = seen.ends(scene, self.sensors)
            found = self.search_anew(seen.grid, ends, seen.room, memory) if ends is not None else NO_WAY
            memory.expanded += found.expanded
            if len(found.nodes) > 0:
                memory.cells = seen.grid.lattice.places(found.nodes)
                places = np.concatenate([[scene.pose[:2]], memory.cells])
                if seen.solids.is_clear(tuple(memory.cells[-1]), scene.goal):
                    places = np.concatenate([places, [scene.goal]])
                size = self.parameters.resolution
                return Plan(
                    pulled(places, size, seen.solids.is_clear) if self.parameters.smooth else places, seen.room.margin
                )
            if not seen.narrow():
                size, room = self.parameters.resolution, seen.room
                reason = (
                    f"what has been seen leaves no way over cells of {size:g} m for a body of radius {room.radius:g} m"
                )
                return Plan(None, reason=reason, verdict="stuck")
