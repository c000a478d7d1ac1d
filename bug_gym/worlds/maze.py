"""Mazes."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, NotNegative, Positive, Share
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.family import Crew, Family, Rng, check_cells
from bug_gym.worlds.grid import carve
from bug_gym.worlds.layout import Layout, Rings
from bug_gym.worlds.places import TRIES, border_of, finish, has_room_for_all
from bug_gym.worlds.polygons import as_polygons, boxes


class MazeWorld(Family):
    """A perfect maze, drawn anew for each seed, of as many equal cells as fit into the bounds."""

    family: Literal["maze"]
    bounds: Box = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    passage: Positive = 1.2
    """Least width of a passage; the cells widen evenly until they fill the bounds [m]."""
    wall: Positive = 0.2
    """Thickness of the walls between cells [m]."""
    loops: Share = 0.0
    """Share, 0 to 1, of the walls left over that are taken away; 0: one way between any two cells."""
    separation: NotNegative = 8.0
    """Least straight distance from start to goal, both in the middle of a cell [m]."""

    @property
    def cells(self) -> tuple[int, int]:
        """How many cells lie along x and along y."""
        xmin, ymin, xmax, ymax = self.bounds
        return self._fitting(xmax - xmin), self._fitting(ymax - ymin)

    @property
    def passages(self) -> tuple[float, float]:
        """Width of a cell along x and along y [m]: n cells and n - 1 walls fill the bounds."""
        xmin, ymin, xmax, ymax = self.bounds
        columns, rows = self.cells
        return (xmax - xmin - (columns - 1) * self.wall) / columns, (ymax - ymin - (rows - 1) * self.wall) / rows

    def check(self, robot: Robot) -> None:
        """The robot fits through, and there are cells as far apart as `separation` says."""
        self.check_width(self.passage, robot, "passage")
        columns, rows = self.cells
        check_cells(columns, rows, "passage")
        if columns * rows < 2:
            raise wrong(f"got {self.passage:g}, expected at most what lets two cells into the bounds", "passage")
        width, height = self.passages
        corner = (columns - 1) * (width + self.wall), (rows - 1) * (height + self.wall)
        self.check_separation(self.separation, (0.0, 0.0, 0.0), corner)

    def _fitting(self, side: float) -> int:
        # 1e-9: a side that is just so many cells must not lose one to rounding
        return math.floor((side + self.wall) / (self.passage + self.wall) + 1e-9)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A perfect maze by randomised depth-first search, some of its walls taken away again for loops."""
        columns, rows = self.cells
        open_right, open_up = carve(columns, rows, self.loops, rng)
        polygons = maze_walls(self, open_right, open_up)
        places = [(column, row) for column in range(columns) for row in range(rows)]
        free = is_clear(np.zeros((0, 3)), polygons, border_of(self), crew.robot.reach)
        for _ in range(TRIES):
            first, last = (places[int(i)] for i in rng.integers(0, len(places), 2))
            start, goal = cell_centre(self, *first), cell_centre(self, *last)
            if math.dist(start, goal) < self.separation:
                continue
            pose = (*start, float(rng.uniform(-math.pi, math.pi)))
            if has_room_for_all(crew, pose, free):
                return finish(crew, self, pose, goal, polygons=polygons)
        raise ValueError(
            f"found no two cells of the maze {self.separation} m apart, the first with room for all robots"
        )


def cell_centre(world: MazeWorld, column: int, row: int) -> tuple[float, float]:
    """Middle of a cell [m]."""
    (width, height), (xmin, ymin, _, _) = world.passages, world.bounds
    return xmin + column * (width + world.wall) + 0.5 * width, ymin + row * (height + world.wall) + 0.5 * height


def maze_walls(world: MazeWorld, open_right: np.ndarray, open_up: np.ndarray) -> tuple[Rings, ...]:
    """The walls between the cells as polygons, joined where they meet."""
    (width, height), (xmin, ymin, xmax, ymax) = world.passages, world.bounds
    thick = world.wall
    columns, rows = world.cells
    walls = []
    for x, y in zip(*np.nonzero(~open_right), strict=True):
        left, low = xmin + (x + 1) * (width + thick) - thick, ymin + y * (height + thick)
        walls.append((left, low - thick, left + thick, low + height + thick))
    for x, y in zip(*np.nonzero(~open_up), strict=True):
        left, low = xmin + x * (width + thick), ymin + (y + 1) * (height + thick) - thick
        walls.append((left - thick, low, left + width + thick, low + thick))
    # A wall that ends at the border goes on a little beyond it, so that no beam slips between the two.
    frame = boxes([(xmin - thick, ymin - thick, xmax + thick, ymax + thick)])
    return as_polygons(boxes(walls).intersection(frame))
