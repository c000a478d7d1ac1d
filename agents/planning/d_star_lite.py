"""D* Lite: A* from the goal, repaired where cells change (a map planner; with `known=False` it plans in what it has seen).

Source: Koenig and Likhachev (2005), "Fast replanning for navigation in unknown terrain", the optimised version. Sensing
assumed: the map, own place on it, movers where they are now; in unknown terrain scan, own position, goal. Memory kept: all
scan points seen (in unknown terrain), two estimates of each cell's distance from the goal. States: planning, following,
waiting. Guarantee: reaches the goal in still worlds if there is a way over the cells, or says that there is none. Length:
that of A* over what is known.

In unknown terrain what has not been seen counts as free, and what comes to be seen is planned round.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.grid import FAR, Bytes, Grid, Nodes
from bug_gym.agents.planning.grid_planner import GridParameters
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.map_policy import MapMemory
from bug_gym.agents.planning.open_list import OpenList, is_before, open_list, put, take
from bug_gym.agents.planning.planner import GOAL_MOVED, STRAYED, Plan
from bug_gym.agents.planning.repairing_planner import RepairingMemory, RepairingPlanner
from bug_gym.agents.planning.search import NO_WAY, Found, bound, bound_of, cost_of, offset_of, require_free
from bug_gym.agents.planning.seen_ground import SeenGround
from bug_gym.agents.planning.smoothing import pulled
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Integers
from bug_gym.policy import Velocity
from bug_gym.view import Sensors, View


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
            links, columns = self.grid.links, self.grid.lattice.columns
            key = self._start, self.goal, self._kind, self._moved
            revise(links, columns, nodes, *key, self.estimates, self.heap)

    def find(self, start: int) -> Found:
        """The shortest way from a cell.

        Raises:
            ValueError: the start is blocked.
        """
        require_free(self.grid, start=start)
        columns, links = self.grid.lattice.columns, self.grid.links
        if self._start < 0:
            begin(columns, start, self.goal, self._kind, self.heap)
        else:
            self._moved += int(least_between(self._kind, columns, start, self._start))
        self._start = start
        expanded = repair(links, columns, start, self.goal, self._kind, self._moved, self.estimates, self.heap)
        self.expanded += expanded
        if self.estimates.ahead[start] >= FAR:
            return NO_WAY._replace(expanded=expanded)
        cost = int(self.estimates.ahead[start])
        nodes = np.empty(walk(links, columns, start, self.goal, self.estimates, np.empty(0, dtype=np.int32)), np.int32)
        walk(links, columns, start, self.goal, self.estimates, nodes)
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
    links: Bytes, columns: int, start: int, goal: int, kind: int, moved: int, estimates: Estimates, heap: OpenList
) -> int:
    """ComputeShortestPath. Returns how many cells were expanded.

    Args:
        links: the open steps of each cell (n,).
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
                if links[node] >> step & 1 and other != goal and cost[node] + cost_of(step) < ahead[other]:
                    ahead[other] = cost[node] + cost_of(step)
                    update(columns, start, other, kind, moved, estimates, heap)
        else:
            before = cost[node]
            cost[node] = FAR
            update(columns, start, node, kind, moved, estimates, heap)
            for step in range(8):
                other = node + offset_of(step, columns)
                if links[node] >> step & 1 and other != goal and ahead[other] == before + cost_of(step):
                    look_ahead(links, columns, other, estimates)
                    update(columns, start, other, kind, moved, estimates, heap)
    return expanded


@kernel
def revise(
    links: Bytes,
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
                look_ahead(links, columns, other, estimates)
                if estimates.ahead[other] != before:
                    update(columns, start, other, kind, moved, estimates, heap)


@called
def look_ahead(links: Bytes, columns: int, node: int, estimates: Estimates) -> None:
    """Write what the way from a cell costs by what its neighbours' cost."""
    best = FAR
    for step in range(8):
        if links[node] >> step & 1:
            best = min(best, estimates.cost[node + offset_of(step, columns)] + cost_of(step))
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
def walk(links: Bytes, columns: int, start: int, goal: int, estimates: Estimates, nodes: Nodes) -> int:
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
                through = estimates.cost[node + offset_of(step, columns)] + cost_of(step)
                if through < best:
                    best, onward = through, step
        node += offset_of(onward, columns)


@dataclass(frozen=True)
class DStarLiteParameters(GridParameters):
    """Parameters of D* Lite."""

    known: bool = True
    """Whether the map is given; else it is planned in what has been seen so far, and the policy is not privileged."""


@dataclass
class DStarLiteMemory(RepairingMemory):
    """Memory of D* Lite."""

    seen: SeenGround | None = None
    """What has been seen of unknown terrain."""


class DStarLitePlanner(RepairingPlanner):
    """D* Lite over the cells of the map, repaired where movers come and go, or where something new is seen.

    Raises:
        TypeError: an unknown parameter.
        ValueError: what GridPlanner refuses.
    """

    Parameters: ClassVar[type[DStarLiteParameters]] = DStarLiteParameters
    memory_type: ClassVar[type[MapMemory]] = DStarLiteMemory
    parameters: DStarLiteParameters

    def __init__(
        self, sensors: Sensors, *, discrete: bool = False, maps: Maps | None = None, **parameters: Any
    ) -> None:
        super().__init__(sensors, discrete=discrete, maps=maps, **parameters)
        self.privileged = self.parameters.known

    def first_memory(self, flat: NDArray[np.float32], number: int) -> MapMemory:
        """Memory of a new episode; one without a map asks for none."""
        return super().first_memory(flat, number) if self.privileged else self.start()

    def begin(self, robot: int) -> MapMemory:
        """Memory of the episode that a robot has begun; one without a map asks for none."""
        return super().begin(robot) if self.privileged else self.start()

    def searching(self, grid: Grid, goal: int) -> DStarLite:
        """A search from a goal."""
        return DStarLite(grid, goal)

    def act(self, view: View, memory: Any) -> Velocity:
        """One decision."""
        if self.privileged:
            return super().act(view, memory)
        scene = Scene(view.pose, view.goal_position, None)
        seen = memory.seen
        if seen is None:
            seen = memory.seen = SeenGround(self.parameters, self.rooms)
        is_open = seen.look(view, scene.goal)
        away = math.inf if memory.route is None else memory.route.advance(*scene.pose[:2])
        is_new = math.dist(memory.planned_for, scene.goal) > GOAL_MOVED or away > STRAYED
        if is_new or is_open or memory.route is None or not seen.is_route_open(memory.route, scene.pose[:2]):
            self.replace_route(scene, memory)
        return self.follower.follow(memory.route, view, scene) if memory.route is not None else (0.0, 0.0)

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
                return Plan(None, reason=reason, verdict="unreachable")
