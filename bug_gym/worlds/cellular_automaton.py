"""Dense fields of thin cylinders, grown by a cellular automaton.

As the worlds of the BARN benchmark are made (Perille, Truong, Xiao and Stone, "Benchmarking Metric Ground Navigation", SSRR
2020, section III): cells are filled at random, then smoothed; a cylinder stands on each full one; only fields with a way
through are kept. They take 30 x 30 cells of 0.15 m, shares of 0.15 to 0.3, 2 to 4 rounds and the thresholds 5 and 1.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bug_gym.geometry import F64
from bug_gym.schema.errors import wrong
from bug_gym.schema.ranges import least_of
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, Flag, Lines, Neighbours, Point, Pose, Positive, RoundCounts, Shares
from bug_gym.worlds.family import Crew, Family, Rng, check_cells
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import finish

FIELDS = 10_000
"""How many fields are grown before none is found to be as asked for."""


class CellularAutomatonWorld(Family):
    """A dense field of thin cylinders, drawn anew for each seed: the only way out of an alley of cylinders.

         goal
    #            #
    # ##   #     #
    #  #      ## #   field: rows x columns
    ##    ##   # #
    #            #
    #   start    #   alley
    ##############
    """

    family: Literal["cellular_automaton"]
    bounds: Box = (-6.0, -1.0, 2.0, 15.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    corner: Point = (-4.5, 0.0)
    """Lower left corner of the alley x, y [m]."""
    columns: Lines = 30
    """How many cells lie across the field, its sides among them."""
    rows: Lines = 30
    """How many cells the field is long."""
    alley: Lines = 34
    """How many cells lie from the lower end of the alley to the field."""
    cell: Positive = 0.15
    """Side of a cell [m]."""
    radius: Positive = 0.075
    """Of the cylinders [m]."""
    fill: Shares = (0.15, 0.3)
    """Least and greatest share, 0 to 1, of the cells that are full before the field is smoothed."""
    rounds: RoundCounts = (2, 4)
    """How often, at least and at most, it is smoothed."""
    fill_from: Neighbours = 5
    """Full neighbours, of eight, from which on a cell is filled; what lies beyond the field counts as empty."""
    clear_to: Neighbours = 1
    """Full neighbours up to which a cell is cleared."""
    solvable: Positive | None = 0.35
    """Clearance [m] at which a path is certain: of the robot's centre, to cylinders. None: no such promise."""
    is_shut: Flag = False
    """Whether there is no path, instead, even for the robot's own radius, the least that may be drawn; of a body of several
    `circles`, for the largest of them alone."""
    start: Pose = (-2.0, 3.0, 0.5 * math.pi)
    """x [m], y [m], heading [rad], in the alley."""
    goal: Point = (-2.0, 13.0)
    """x, y [m], beyond the field."""

    @property
    def _right(self) -> float:
        """Right side of the field [m]."""
        return self.corner[0] + self.columns * self.cell

    @property
    def _low(self) -> float:
        """Lower end of the field [m]."""
        return self.corner[1] + self.alley * self.cell

    @property
    def _high(self) -> float:
        """Upper end of the field [m]."""
        return self._low + self.rows * self.cell

    def check(self, robot: Robot) -> None:
        """The field lies within the bounds, the start in the alley and the goal beyond the field, each with room."""
        check_cells(self.columns, self.alley + self.rows, "columns")
        if self.radius < 0.5 * self.cell:
            raise wrong(f"got {self.radius:g}, expected at least half a cell ({0.5 * self.cell:g})", "radius")
        self.check_clearance(self.solvable, robot, "solvable")
        room = max(robot.reach, self.solvable or 0.0)
        (left, low), thick = self.corner, 0.5 * self.cell + self.radius
        self.check_holds((left - thick - room, low - thick, self._right + thick + room, self._high), "field")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)
        inside = left + thick + room <= self.start[0] <= self._right - thick - room
        if not (inside and low + thick + room <= self.start[1] <= self._low - thick - room):
            raise wrong(f"got {list(self.start)}, expected a place in the alley, {room:g} m from its sides", "start")
        if self.goal[1] < self._high + thick + room:
            least = self._high + thick + room
            raise wrong(f"got {list(self.goal)}, expected one beyond the field, y at least {least:g}", "goal")

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A field with a way through it, or without one.

        Raises:
            ValueError: no such field was grown.
        """
        alley = self._alley()
        for _ in range(FIELDS):
            cylinders = self._at(grown(self, rng), self._low)
            if self._is_as_asked(cylinders, crew.robot):
                places = np.vstack([alley, cylinders])
                circles = np.column_stack([places, np.full(len(places), self.radius)])
                return finish(crew, self, self.start, self.goal, circles=circles)
        kind = "without a way" if self.is_shut else f"with a way at a clearance of {self.solvable} m"
        raise ValueError(f"none of {FIELDS} fields of cylinders is one {kind}")

    def _is_as_asked(self, cylinders: F64, robot: Robot) -> bool:
        if self.is_shut:
            # What stops a disc that lies in the body stops the body.
            disc = max(least_of(radius) for _, _, radius in robot.circles or ((0.0, 0.0, robot.radius),))
            return not has_way_through(cylinders, self.radius, disc)
        return self.solvable is None or has_way_through(cylinders, self.radius, self.solvable)

    def _alley(self) -> F64:
        """Cylinders (n, 2) of the alley's end and sides [m]; the field has its sides from `grown`."""
        full = np.zeros((self.alley, self.columns), dtype=bool)
        full[0] = full[:, 0] = full[:, -1] = True
        return self._at(full, self.corner[1])

    def _at(self, full: np.ndarray, low: float) -> F64:
        """Places (n, 2) of the cylinders on full cells (rows, columns), the lowest row at `low` [m]."""
        cells = np.argwhere(full) + 0.5
        return np.column_stack([self.corner[0] + self.cell * cells[:, 1], low + self.cell * cells[:, 0]])


def grown(world: CellularAutomatonWorld, rng: Rng) -> np.ndarray:
    """The full cells (rows, columns) of a field: filled at random, then smoothed, its left and right sides full."""
    share = rng.uniform(*world.fill)
    full = rng.random((world.rows, world.columns)) < share
    for _ in range(int(rng.integers(world.rounds[0], world.rounds[1] + 1))):
        neighbours = full_neighbours(full)
        full = (full | (neighbours >= world.fill_from)) & (neighbours > world.clear_to)
    full[:, 0] = full[:, -1] = True
    return full


def full_neighbours(full: np.ndarray) -> np.ndarray:
    """How many of the eight cells about each cell (rows, columns) are full; none are beyond the edge."""
    rows, columns = full.shape
    padded = np.pad(full, 1).astype(np.int64)
    about = sum(padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3))
    return np.asarray(about - full)


def has_way_through(cylinders: F64, radius: float, clearance: float) -> bool:
    """Whether a disc passes a field from below to above.

    It is stopped if and only if a chain of cylinders leads from the left side to the right one, each so near to the next
    that no disc passes between: grown by its radius they overlap, and their union cuts the plane (Lozano-Perez 1983).

    Args:
        cylinders: places (n, 2) [m], the two sides of the field among them.
        radius: of the cylinders [m].
        clearance: radius of the disc [m].
    """
    x, y = cylinders.T
    # 1e-9: a gap of exactly twice the clearance is open
    near = 2.0 * (radius + clearance) - 1e-9
    is_linked = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2 < near * near
    chained = x <= x.min()
    added = chained
    while added.any():
        added = is_linked[added].any(0) & ~chained
        chained = chained | added
    return not bool(chained[x >= x.max()].any())
