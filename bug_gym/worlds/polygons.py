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

    simple = shapely.simplify(polygon, SAME_POINT)
    rings = [simple.exterior, *simple.interiors]
    return tuple(np.asarray(shapely.get_coordinates(ring)[:-1], dtype=np.float64) for ring in rings)


def as_polygons(solid: BaseGeometry) -> tuple[Rings, ...]:
    """The polygons of a shapely geometry."""
    import shapely  # slow to load, and most scenarios need none

    return tuple(rings_of(piece) for piece in shapely.get_parts(solid) if piece.area > 0.0)


def boxes(rectangles: Sequence[Rectangle]) -> BaseGeometry:
    """The union of rectangles."""
    import shapely  # slow to load, and most scenarios need none

    return shapely.union_all([shapely.box(*rectangle) for rectangle in rectangles])


def turned(ring: F64, centre: tuple[float, float], rotation: float | str, rng: Rng) -> F64:
    """A ring (k, 2) turned about a point by an angle [rad], or by one that is drawn."""
    angle = float(rng.uniform(-math.pi, math.pi)) if rotation == "random" else float(rotation)
    if angle == 0.0:
        return ring
    cos, sin = math.cos(angle), math.sin(angle)
    middle = np.array(centre)
    corners: F64 = (ring - middle) @ np.array([[cos, sin], [-sin, cos]]) + middle
    return corners
