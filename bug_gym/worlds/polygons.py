"""Walls and buildings as polygons: rectangles, their unions, rings that are turned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bug_gym.geometry import F64
from bug_gym.worlds.family import Rng
from bug_gym.worlds.layout import SAME_POINT, Rings

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


Rectangle = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax [m]."""


def rectangle(xmin: float, ymin: float, xmax: float, ymax: float) -> F64:
    """Corners (4, 2) of an axis-parallel rectangle."""
    return np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]], dtype=np.float64)


def rings_of(polygon: object) -> Rings:
    """Shell and holes of a shapely polygon as open rings (k, 2), without points on straight lines."""
    import shapely  # slow to load, and most scenarios need none

    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.simplify(polygon, SAME_POINT)), return_index=True)
    ends = np.flatnonzero(np.diff(ring)) + 1
    return tuple(part[:-1].copy() for part in np.split(corners, ends))  # the first corner comes again as the last


def as_polygons(solid: BaseGeometry) -> tuple[Rings, ...]:
    """The polygons of a shapely geometry."""
    import shapely  # slow to load, and most scenarios need none

    pieces = shapely.get_parts(solid)
    return tuple(rings_of(piece) for piece in pieces[shapely.area(pieces) > 0.0])


def boxes(rectangles: Sequence[Rectangle]) -> BaseGeometry:
    """The union of rectangles."""
    import shapely  # slow to load, and most scenarios need none

    return shapely.union_all(shapely.box(*np.array(rectangles, dtype=np.float64).reshape(-1, 4).T))


def lined_walls(x: F64, y: F64, half: float) -> list[Rectangle]:
    """Walls along all but the outermost lines at x (columns + 1,) and y (rows + 1,) [m], `half` a wall thick to either side.

    They go on a little beyond the border, which the outermost lines are, so that no beam slips between the two.
    """
    xmin, ymin, xmax, ymax = (float(place) for place in (x[0], y[0], x[-1], y[-1]))
    walls = [(line - half, ymin - half, line + half, ymax + half) for line in x[1:-1].tolist()]
    return walls + [(xmin - half, line - half, xmax + half, line + half) for line in y[1:-1].tolist()]


def turned(ring: F64, centre: tuple[float, float], rotation: float | str, rng: Rng) -> F64:
    """A ring (k, 2) turned about a point by an angle [rad], or by one that is drawn."""
    angle = float(rng.uniform(-math.pi, math.pi)) if rotation == "random" else float(rotation)
    if angle == 0.0:
        return ring
    cos, sin = math.cos(angle), math.sin(angle)
    middle = np.array(centre)
    corners: F64 = (ring - middle) @ np.array([[cos, sin], [-sin, cos]]) + middle
    return corners
