"""What the planners over cells share: the grid of a map, where ways begin and end on it, and drawing them straight."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from bug_gym.agents.parameters import Length
from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.grid import Grid, grid_of, lattice_of, with_discs
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.map_policy import MapMemory
from bug_gym.agents.planning.planner import (
    MapPlanner,
    Plan,
    PlannerMemory,
    PlannerParameters,
    Room,
    end_in_obstacle,
    is_shut_in,
    live_of,
    mover_discs,
)
from bug_gym.agents.planning.search import Found
from bug_gym.agents.planning.smoothing import Solids, pulled
from bug_gym.agents.planning.terrain import WeighedGround, weights_of
from bug_gym.geometry import F64
from bug_gym.view import Sensors

TRIED_CELLS = 4_000_000
"""Cells of the largest grid that is tried to find a resolution at which there is a way."""


@dataclass(frozen=True)
class Ground:
    """A grid, and the obstacles behind it."""

    grid: Grid
    solids: Solids


@dataclass
class GridMemory(PlannerMemory):
    """Memory of a planner over cells."""

    grounds: dict[Room, Ground] = field(default_factory=dict)
    """The grids of what stands, for each room that was planned for."""
    cells: F64 = field(default_factory=lambda: np.zeros((0, 2)))
    """The last way over cells (k, 2) [m], before it was drawn straight."""
    expanded: int = 0
    """Cells whose neighbours were looked at in this episode."""


@dataclass(frozen=True)
class GridParameters(PlannerParameters):
    """Parameters of planners over cells."""

    resolution: Length = 0.1
    """Side of a cell [m]."""
    connectivity: Literal[4, 8] = 8
    """Neighbours of a cell."""
    cut_corners: bool = False
    """Whether a diagonal step may pass a blocked cell beside it."""
    smooth: bool = True
    """Whether ways over cells are drawn straight."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.resolution >= 1e-3 and math.isfinite(self.resolution)):
            raise ValueError(f"resolution must be finite and at least 0.001 m, got {self.resolution!r}")


class GridPlanner(MapPlanner):
    """A planner over square cells.

    Raises:
        TypeError: an unknown parameter.
        ValueError: what MapPlanner refuses; a resolution below a millimetre, or one at which the world has too many cells.
    """

    Parameters: ClassVar[type[GridParameters]] = GridParameters
    memory_type: ClassVar[type[MapMemory]] = GridMemory
    parameters: GridParameters

    def __init__(
        self, sensors: Sensors, *, discrete: bool = False, maps: Maps | None = None, **parameters: Any
    ) -> None:
        super().__init__(sensors, discrete=discrete, maps=maps, **parameters)
        if maps is not None:
            # The frame of a start may be turned against the world's: the box about it is as long as the diagonal.
            across = 0.5 * maps.span
            lattice_of((-across, -across, across, across), self.parameters.resolution)

    @abstractmethod
    def search(self, grid: Grid, start: int, goal: int) -> Found:
        """A way over a grid from one free cell to another."""

    def clearance_of(self, room: Room, size: float) -> float:
        """From how near to an obstacle on the centre of a cell of some size is blocked [m].

        So that not only the centres but the straight ways between neighbours keep the room: the middle of one of length h
        is by Pythagoras no nearer than the root of g^2 - h^2 / 4 to what is no nearer than g to its ends.
        """
        step = size if self.parameters.connectivity == 4 else math.sqrt(2.0) * size
        return math.hypot(room.growth, 0.5 * step)

    def plan(self, scene: Scene, memory: GridMemory) -> Plan:
        """The way over the cells with as much room as there is."""
        for room in self.rooms:
            places = self._way(self.ground(room, memory), room, scene, memory)
            if places is not None:
                return Plan(places, room.margin)
        if scene.moving is not None:
            return Plan(None, reason="no way leads round the movers as they stand")
        reason, is_proven = self.why_not(scene, memory)
        return Plan(None, reason=reason, verdict="unreachable" if is_proven else "stuck")

    def ground(self, room: Room, memory: GridMemory) -> Ground:
        """The grid of what stands, made once an episode."""
        if room not in memory.grounds:
            still = live_of(memory).still
            grid = self._grid(still, self.parameters.resolution, room)
            memory.grounds[room] = Ground(grid, Solids.of(still, room.growth))
        return memory.grounds[room]

    def _grid(self, plan: PlanningMap, size: float, room: Room) -> Grid:
        own = self.parameters
        growth = self.clearance_of(room, size)
        return grid_of(plan, size, growth, connectivity=own.connectivity, cut_corners=own.cut_corners)

    def _way(self, ground: Ground, room: Room, scene: Scene, memory: GridMemory) -> F64 | None:
        grid, solids = ground.grid, ground.solids
        if scene.moving is not None:
            discs = mover_discs(scene.moving)
            clearance = self.clearance_of(room, grid.lattice.size)
            grid, solids = with_discs(grid, discs, clearance), solids.with_discs(discs)
        ends = self.ends(grid, ground.solids, room, scene)
        if ends is None:
            return None
        found = self.search_anew(grid, ends, room, memory)
        memory.expanded += found.expanded
        if len(found.nodes) == 0:
            return None
        memory.cells = grid.lattice.places(found.nodes)
        return self.drawn(memory.cells, solids, scene, grid)

    def search_anew(self, grid: Grid, ends: tuple[int, int], room: Room, memory: Any) -> Found:
        """A way in an episode; what is repaired instead of searched anew takes up here what it knows."""
        return self.search(grid, *ends)

    def ends(self, grid: Grid, solids: Solids, room: Room, scene: Scene) -> tuple[int, int] | None:
        """The free cells in which a way begins and ends, None where there are none near enough.

        From the last one the goal is reached: it lies within its radius, or straight on.
        """
        size = grid.lattice.size
        here = scene.pose[:2]
        near = self.clearance_of(room, size) - self.sensors.radius + 2.0 * size
        start = grid.free_node_near(here, near if scene.moving is None else near + room.growth)
        reach = self.sensors.goal_radius if scene.reach is None else scene.reach
        goal = grid.free_node_near(scene.goal, max(reach - 0.5 * size, 0.0))
        if start < 0 or goal < 0:
            return None
        first, last = map(tuple, grid.lattice.places(np.array([start, goal])).tolist())
        if math.dist(last, scene.goal) > reach and not solids.is_clear(last, scene.goal):
            return None  # of large cells, or where room is scarce: their centres may be so far away
        touching = solids.with_growth(0.99 * self.sensors.radius)
        return (start, goal) if touching.is_clear(here, first) else None

    def drawn(self, cells: F64, solids: Solids, scene: Scene, grid: Grid) -> F64:
        """A way over cells from where the robot is to the goal itself, drawn straight where asked."""
        places = np.concatenate([[scene.pose[:2]], cells])
        if solids.is_clear(tuple(cells[-1]), scene.goal):
            places = np.concatenate([places, [scene.goal]])
        if not self.parameters.smooth:
            return places
        cost_of = None if grid.weights is None else WeighedGround(grid.weights, grid.lattice).cost_of
        return pulled(places, self.parameters.resolution, solids.is_clear, cost_of)

    def why_not(self, scene: Scene, memory: GridMemory) -> tuple[str, bool]:
        """Why there is no way over the cells, and whether there is none for certain, over no cells at all.

        Where there may be one, the sentence names the resolution that finds it: half of theirs, half of that and on.
        """
        size, room, plan = self.parameters.resolution, self.rooms[-1], live_of(memory).still
        inside = end_in_obstacle(plan, scene, self.sensors)
        if inside:
            return inside, True
        what = f"no way over cells of {size:g} m for a body of radius {room.radius:g} m and {room.margin:g} m beside it"
        if is_shut_in(plan, scene.pose[:2], scene.goal, self.sensors):
            return f"{what}, nor over smaller ones", True
        low_x, low_y, high_x, high_y = plan.box
        finer = size
        while (high_x - low_x) * (high_y - low_y) / (0.5 * finer) ** 2 <= TRIED_CELLS:
            finer *= 0.5
            grid = self._grid(plan, finer, room)
            ends = self.ends(grid, Solids.of(plan, room.growth), room, scene)
            if ends is not None and len(self.search(grid, *ends).nodes) > 0:
                return f"{what}; a resolution of {finer:g} m would do", False
        return what if finer == size else f"{what}, nor over smaller ones down to {finer:g} m", False


@dataclass(frozen=True)
class TerrainParameters(GridParameters):
    """Parameters of planners over cells that can weigh the ground."""

    terrain: bool = False
    """Whether a metre counts as what the ground there costs, so that ways are cheap and not short."""


class TerrainPlanner(GridPlanner):
    """A planner over square cells that can weigh the ground.

    Raises:
        TypeError: an unknown parameter.
        ValueError: what GridPlanner refuses.
    """

    Parameters: ClassVar[type[GridParameters]] = TerrainParameters
    parameters: TerrainParameters

    def _grid(self, plan: PlanningMap, size: float, room: Room) -> Grid:
        grid = super()._grid(plan, size, room)
        return grid._replace(weights=weights_of(plan, grid.lattice)) if self.parameters.terrain else grid
