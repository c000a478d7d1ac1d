"""What the planners share that keep their search and repair it where cells change: D* and D* Lite."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np

from bug_gym.agents.planning.grid import Grid, Nodes
from bug_gym.agents.planning.grid_planner import GridMemory, GridPlanner
from bug_gym.agents.planning.map_policy import MapMemory
from bug_gym.agents.planning.planner import Room
from bug_gym.agents.planning.search import Found


class Repaired(Protocol):
    """A search from one goal that is kept."""

    grid: Grid
    goal: int

    def change(self, nodes: Nodes) -> None:
        """Tell that cells (k,) are others than before."""

    def find(self, start: int) -> Found:
        """The shortest way from a cell."""
        ...


@dataclass
class RepairingMemory(GridMemory):
    """Memory of a planner that repairs."""

    searches: dict[Room, Any] = field(default_factory=dict)
    """The search for each room that was planned for."""


class RepairingPlanner(GridPlanner):
    """A planner over cells whose search goes on from what it has found before; its parameters are those of GridPlanner.

    What it has found are distances from the goal: where that moves they are all others, and the search begins anew.
    """

    memory_type: ClassVar[type[MapMemory]] = RepairingMemory

    @abstractmethod
    def searching(self, grid: Grid, goal: int) -> Repaired:
        """A search from a goal."""

    def search(self, grid: Grid, start: int, goal: int) -> Found:
        """The shortest way over cells that no search knows yet."""
        return self.searching(grid, goal).find(start)

    def search_anew(self, grid: Grid, ends: tuple[int, int], room: Room, memory: RepairingMemory) -> Found:
        """The shortest way, from what is known of the cells that are as they were."""
        start, goal = ends
        search: Repaired | None = memory.searches.get(room)
        if search is None or search.goal != goal or search.grid.lattice != grid.lattice:
            search = memory.searches[room] = self.searching(grid, goal)
        else:
            changed = np.flatnonzero(search.grid.blocked != grid.blocked).astype(np.int32)
            search.grid = grid
            search.change(changed)
        return search.find(start)
