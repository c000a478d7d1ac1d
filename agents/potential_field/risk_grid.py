"""The memory grid of the minimum risk method: dots where something was seen, dots where the robot has been.

Source: Wang and Liu (2005, 2008). A direction's risk is the sum of the dots in its sector.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.compiling import kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats, Integers

DIRECTIONS = 16
"""How many regional directions there are."""

MOST_OBSTACLE_DOTS = 5
"""Of one cell, that count."""

MARGIN = 8.0
"""Room beyond what must be covered, so that the grid seldom grows [m]."""


class Weights(NamedTuple):
    """What a dot counts."""

    obstacle: float
    trajectory: float


@kernel
def add_dots(dots: Integers, px: Floats, py: Floats, x: float, y: float, size: float) -> None:
    """A dot for each point seen, up to MOST_OBSTACLE_DOTS a cell, and one of the trajectory for the robot's own cell.

    Args:
        dots: (2, rows, columns), of obstacles and of the trajectory.
        px: points' x (k,) from the grid's corner [m].
        py: points' y (k,) [m].
        x: own place there [m].
        y: the same [m].
        size: side of a cell [m].
    """
    for i in range(px.size):
        row, column = int(py[i] // size), int(px[i] // size)
        if 0 <= row < dots.shape[1] and 0 <= column < dots.shape[2] and dots[0, row, column] < MOST_OBSTACLE_DOTS:
            dots[0, row, column] += 1
    dots[1, int(y // size), int(x // size)] += 1


@kernel
def sum_risks(
    dots: Integers, x: float, y: float, size: float, reach: float, obstacle: float, trajectory: float, risks: Floats
) -> None:
    """Weighted dots in the sector of each direction, into `risks` (n,).

    Args:
        dots: (2, rows, columns), of obstacles and of the trajectory.
        x: own place from the grid's corner [m].
        y: the same [m].
        size: side of a cell [m].
        reach: radius of the sectors [m].
        obstacle: weight of a dot of an obstacle.
        trajectory: weight of a dot of the trajectory.
        risks: result (n,), of the directions 2 pi k / n of the grid's frame.
    """
    risks[:] = 0.0
    own_row, own_column, cells = int(y // size), int(x // size), int(reach / size)
    for row in range(max(own_row - cells, 0), min(own_row + cells + 1, dots.shape[1])):
        for column in range(max(own_column - cells, 0), min(own_column + cells + 1, dots.shape[2])):
            if dots[0, row, column] == 0 and dots[1, row, column] == 0:
                continue
            dx, dy = (column + 0.5) * size - x, (row + 0.5) * size - y
            if dx * dx + dy * dy > reach * reach or (row == own_row and column == own_column):
                continue
            sector = int(round(math.atan2(dy, dx) / (2.0 * math.pi) * risks.size)) % risks.size
            risks[sector] += obstacle * dots[0, row, column] + trajectory * dots[1, row, column]


class RiskGrid:
    """The dots of one episode, on a grid that grows as the robot goes.

    Args:
        size: side of a cell [m].
    """

    def __init__(self, size: float) -> None:
        self.size = size
        self.corner = (0.0, 0.0)
        """Lower left corner, odometry frame [m]."""
        self.dots: NDArray[np.int64] = np.zeros((2, 0, 0), dtype=np.int64)
        """(2, rows, columns), of obstacles and of the trajectory."""

    def cover(self, x: float, y: float, reach: float) -> None:
        """Make sure that the grid reaches so far from a place [m]."""
        _, rows, columns = self.dots.shape
        low = self.corner
        high = low[0] + columns * self.size, low[1] + rows * self.size
        if x - reach >= low[0] and y - reach >= low[1] and x + reach <= high[0] and y + reach <= high[1]:
            return
        room = reach + MARGIN
        left, below = (math.floor((c - room - at) / self.size) for c, at in zip((x, y), low, strict=True))
        right, above = (math.ceil((c + room - at) / self.size) for c, at in zip((x, y), low, strict=True))
        left, below = min(left, 0), min(below, 0)
        right, above = max(right, columns), max(above, rows)
        grown = np.zeros((2, above - below, right - left), dtype=np.int64)
        grown[:, -below : rows - below, -left : columns - left] = self.dots
        self.dots, self.corner = grown, (low[0] + left * self.size, low[1] + below * self.size)

    def add(self, place: tuple[float, float], x: F64, y: F64) -> None:
        """The dots of one decision: points x, y (k,) of the odometry frame that are seen, and the own place."""
        left, below = self.corner
        add_dots(self.dots, x - left, y - below, place[0] - left, place[1] - below, self.size)

    def risks(self, place: tuple[float, float], reach: float, weights: Weights) -> F64:
        """Risk of each direction (16,), the first along the x axis of the odometry frame."""
        result = np.empty(DIRECTIONS)
        x, y = place[0] - self.corner[0], place[1] - self.corner[1]
        sum_risks(self.dots, x, y, self.size, reach, weights.obstacle, weights.trajectory, result)
        return result

    def middles(self, layer: int) -> F64:
        """Middles (k, 2) of the cells with dots of obstacles (0) or of the trajectory (1), odometry frame [m]."""
        rows, columns = np.nonzero(self.dots[layer])
        middles: F64 = np.column_stack([columns + 0.5, rows + 0.5]) * self.size + np.asarray(self.corner)
        return middles
