"""What a robot remembers of still obstacles: points of its scans on a grid, and the shortest way among them.

The plane is cut into square cells (cells.py). Everything that isn't blocked counts as open, seen or not ("free-space
assumption"; Koenig, Tovey and Smirnov 2003). The way is found by Lazy Theta* (lazy_theta.py). As every cell is looked
at before it gives up, no way is found only where the remembered points close the goal off, up to half a cell's
diagonal.

All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.mapping.cells import (
    BLOCK,
    SUPPOSED,
    Scan,
    add_scan,
    add_terrain,
    count_bar,
    count_point,
    empty_cells,
    forget_disc,
)
from bug_gym.agents.mapping.lazy_theta import Search, find_way
from bug_gym.agents.mapping.sight import cost_between, escape_from, is_blocked, is_in_sight
from bug_gym.agents.mapping.way import Way, is_way_open, passed_nodes, rest_distances
from bug_gym.geometry import Point

MARGIN = 3.0
"""Open ground kept around everything known [m], so that a way round it is on the grid."""

MOST_CELLS = 64_000_000
"""Cells of the largest grid; points beyond are not remembered."""

MOST_PLACES = 512
"""Places of the longest way; of a longer one the first are kept."""


class PointMap:
    """Remembered scan points and the ways among them.

    Args:
        center: place around which the grid begins [m].
        span: half of its side [m]; it grows by itself.
        cell: side of a cell [m].
        clearance: distance that a way keeps from every remembered point [m].
        search: scratch memory.
        is_weighted: whether terrain is remembered too.
    """

    def __init__(
        self, center: Point, span: float, cell: float, clearance: float, search: Search, *, is_weighted: bool = False
    ) -> None:
        self.search = search
        self.removed = 0
        """Points taken away so far because beams passed them."""
        self.revised = 0
        """Cells whose ground has turned out or is supposed to cost something else, so far."""
        self.extent = np.array([center[0], center[1], center[0], center[1]])
        """xmin, ymin, xmax, ymax of all points and all dear terrain so far [m]."""
        side = math.ceil(2.0 * span / cell)
        self.cells = empty_cells(center[0] - span, center[1] - span, side, side, cell, clearance, is_weighted)

    def cover(self, x: float, y: float, margin: float) -> None:
        """Grow the grid until it reaches `margin` [m] beyond a place, if it doesn't yet."""
        old = self.cells
        rows, columns = old.holds.shape
        right, top = old.x + columns * old.size, old.y + rows * old.size
        if old.x <= x - margin and x + margin <= right and old.y <= y - margin and y + margin <= top:
            return
        # By half as much again, so that it seldom happens.
        ahead = margin + 0.25 * max(right - old.x, top - old.y)
        low_x, low_y = min(old.x, x - ahead), min(old.y, y - ahead)
        high_x, high_y = max(right, x + ahead), max(top, y + ahead)
        new_columns, new_rows = (math.ceil(span / old.size) + BLOCK for span in (high_x - low_x, high_y - low_y))
        if new_columns * new_rows > MOST_CELLS:
            return
        self.cells = empty_cells(low_x, low_y, new_columns, new_rows, old.size, old.clearance, old.is_weighted)
        column, row = round((old.x - self.cells.x) / old.size), round((old.y - self.cells.y) / old.size)
        inside = (slice(row, row + rows), slice(column, column + columns))
        blocks = tuple(slice(part.start // BLOCK, part.stop // BLOCK) for part in inside)
        for name in ("spot", "holds", "blocked", *(("weight", "looked_from") if old.is_weighted else ())):
            getattr(self.cells, name)[inside] = getattr(old, name)
        for name in ("points_in_block", "blocked_in_block"):
            getattr(self.cells, name)[blocks] = getattr(old, name)

    def add_scan(
        self,
        position: Point,
        heading: float,
        angles: NDArray[np.float64],
        ranges: NDArray[np.float64],
        reach: float,
        noise: float,
        is_still: NDArray[np.bool_],
    ) -> int:
        """Remember the points of a scan, and forget those that its beams pass.

        Args:
            position: where the scan was taken.
            heading: of the robot [rad].
            angles: (B,) bearing of each beam [rad].
            ranges: (B,) [m].
            reach: range that means "nothing seen" [m].
            noise: standard deviation of a range [m].
            is_still: (B,) False where the beam hit something that moves: it is not remembered.

        Returns:
            How many points came new.
        """
        self.cover(*position, reach + MARGIN)
        scan = Scan(*position, heading, angles, ranges, reach, noise, is_still)
        added, removed = add_scan(self.cells, scan, self.extent, np.empty(len(ranges)))
        self.removed += removed
        return int(added)

    def add_terrain(self, position: Point, heading: float, factors: NDArray[np.float32], spacing: float) -> None:
        """Remember the cost factors (K, J) at K headings and J distances, `spacing` [m] apart."""
        self.revised += add_terrain(self.cells, *position, heading, factors, spacing)
        if factors.max() > 1.0:
            # What is dear may be worth going round: its surroundings belong to the box that is searched.
            reach = SUPPOSED * factors.shape[1] * spacing
            self.extent[:2] = np.minimum(self.extent[:2], (position[0] - reach, position[1] - reach))
            self.extent[2:] = np.maximum(self.extent[2:], (position[0] + reach, position[1] + reach))

    def forget(self, x: float, y: float, radius: float) -> None:
        """Forget the points within a disc [m]."""
        forget_disc(self.cells, x, y, radius)

    def forget_all(self) -> None:
        """Forget every point."""
        cells = self.cells
        for array in (cells.holds, cells.blocked, cells.points_in_block, cells.blocked_in_block):
            array[:] = 0

    def set_clearance(self, clearance: float) -> None:
        """Find ways at another clearance [m] from now on."""
        self.cells = self.cells._replace(clearance=clearance)
        self.cells.blocked[:] = 0
        self.cells.blocked_in_block[:] = 0
        for x, y in self.points():
            count_point(self.cells, x, y, 1)

    def bar(self, place: Point) -> None:
        """Block the cell about a place, if it is on the grid, until all is forgotten or the clearance is set."""
        count_bar(self.cells, *place)

    def points(self) -> NDArray[np.float64]:
        """The remembered points (k, 2)."""
        cells = self.cells
        rows, columns = np.nonzero(cells.holds)
        spot = (cells.spot[rows, columns] + 0.5) / 256.0
        return np.column_stack(
            [cells.x + (columns + spot[:, 0]) * cells.size, cells.y + (rows + spot[:, 1]) * cells.size]
        )

    def is_open(self, a: Point, b: Point, tolerance: float = 0.0) -> bool:
        """Whether the straight way from a to b keeps the clearance, but for its last `tolerance` metres."""
        return bool(is_in_sight(self.cells, *a, *b, escape_from(self.cells, *a), tolerance))

    def is_blocked(self, place: Point) -> bool:
        """Whether a place lies nearer than the clearance to a remembered point, by its cell."""
        return bool(is_blocked(self.cells, *place))

    def is_way_open(self, way: Way, tolerance: float) -> bool:
        """Whether a way keeps the clearance, but for its last `tolerance` metres."""
        return bool(is_way_open(self.cells, way.places, tolerance))

    def pass_nodes(self, way: Way, position: Point, near: float, *, cuts: bool) -> None:
        """Let a way begin at another place, without the nodes before the first that lies ahead.

        Args:
            way: changed in place.
            position: where it is to begin.
            near: a node nearer than this is passed [m].
            cuts: whether a node is passed too where the way to the next one is open.
        """
        way.places[0] = position
        passed = passed_nodes(self.cells, way.places, near, cuts)
        way.places, way.rest = way.places[passed:], way.rest[passed:]
        way.places[0] = position
        way.rest[0] = self.costs_to(position, way.places[1:2])[0] + way.rest[1]

    def find_way(self, start: Point, goal: Point, goal_radius: float) -> Way | None:
        """The shortest way that keeps the clearance from all remembered points; None: they close the goal off.

        Args:
            start: where the robot is.
            goal: where to.
            goal_radius: within this distance of the goal [m] the clearance doesn't count.
        """
        self.cover(*start, MARGIN)
        self.cover(*goal, MARGIN)
        cells, search = self.cells, self.search
        if search.cells < cells.holds.size:
            search.resize(cells.holds.size)
        search.stamp += 1
        box = self._box_about(start, goal)
        places, rest = np.empty((MOST_PLACES, 2)), np.empty(MOST_PLACES)
        count = find_way(cells, *start, *goal, goal_radius, box, search.scratch, search.stamp, places, rest)
        return Way(places[:count].copy(), rest[:count].copy()) if count else None

    def _box_about(self, start: Point, goal: Point) -> NDArray[np.int64]:
        """First row and column, last row and column (4,) about all that is known and both ends of a way.

        A way that leaves the box can as well go along its rim.
        """
        cells = self.cells
        rim = cells.clearance + 3.0 * cells.size
        rows, columns = cells.blocked.shape
        return np.array(
            [
                max(int((min(self.extent[1], start[1], goal[1]) - rim - cells.y) / cells.size), 0),
                max(int((min(self.extent[0], start[0], goal[0]) - rim - cells.x) / cells.size), 0),
                min(int((max(self.extent[3], start[1], goal[1]) + rim - cells.y) / cells.size), rows - 1),
                min(int((max(self.extent[2], start[0], goal[0]) + rim - cells.x) / cells.size), columns - 1),
            ]
        )

    def costs_to(self, start: Point, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cost of the straight ways from a place to each of the places (m, 2): length [m], weighted where terrain is."""
        if not self.cells.is_weighted:
            away: NDArray[np.float64] = np.hypot(places[:, 0] - start[0], places[:, 1] - start[1])
            return away
        return np.array([cost_between(self.cells, *start, x, y) for x, y in places])

    def rest_distances(self, places: NDArray[np.float64], way: Way) -> NDArray[np.float64]:
        """What is left to go from each of the places (m, 2): straight to the best place of a way, and on along it.

        Infinite where no place of the way is in sight.
        """
        result = np.empty(len(places))
        rest_distances(self.cells, places, way.places, way.rest, result)
        return result
