"""Layouts measured with shapely: their bodies, and the distances between them."""

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from bug_gym.worlds.layout import Layout, Mover

F64 = NDArray[np.float64]


def polygons_of(layout: Layout) -> list[Any]:
    """The still polygons as shapely's."""
    return [shapely.Polygon(rings[0], rings[1:]) for rings in layout.polygons]


def free_room(layout: Layout, point: Any) -> float:
    """Distance from a point to the nearest still obstacle or the border, negative inside one [m]."""
    place, border = shapely.Point(point), shapely.Polygon(layout.border)
    rooms = [border.exterior.distance(place) if border.contains(place) else -border.distance(place)]
    rooms += [math.dist(point, (x, y)) - r for x, y, r in layout.circles]
    rooms += [p.distance(place) if not p.contains(place) else -p.exterior.distance(place) for p in polygons_of(layout)]
    return float(min(rooms))


def gap_to_mover(point: Any, mover: Mover) -> float:
    """Distance from a point to a mover, 0 inside a polygon [m]."""
    if mover.is_circle:
        return math.dist(point, mover.at) - float(mover.outline)
    return float(shapely.Polygon(np.asarray(mover.outline) + mover.at).distance(shapely.Point(point)))


def bodies_of(layout: Layout) -> tuple[list[tuple[Any, float]], list[tuple[Any, float]]]:
    """Still obstacles and movers as shapely's points and polygons, each with the radius that a circle adds."""
    still = [(shapely.Point(x, y), float(r)) for x, y, r in layout.circles] + [(p, 0.0) for p in polygons_of(layout)]
    moving = [
        (shapely.Point(mover.at), float(mover.outline))
        if mover.is_circle
        else (shapely.Polygon(np.asarray(mover.outline) + mover.at), 0.0)
        for mover in layout.movers
    ]
    return still, moving


def gaps(some: list[tuple[Any, float]], others: list[tuple[Any, float]]) -> F64:
    """Distances (n, m) between bodies; what overlaps has none or a negative one."""
    (one, one_radius), (two, two_radius) = (zip(*bodies, strict=True) for bodies in (some, others))
    apart: F64 = shapely.distance(np.array(one)[:, None], np.array(two)[None])
    between: F64 = apart - np.array(one_radius)[:, None] - np.array(two_radius)[None]
    return between
