"""Layouts measured with shapely: their bodies, the distances between them, and what a scan sees of them."""

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


def rings_of(layout: Layout) -> list[tuple[F64, tuple[float, float] | None]]:
    """Corners of each ring in the world; with a place where they move with a body."""
    still = [(ring, None) for polygon in layout.polygons for ring in polygon]
    moving = [
        (np.asarray(mover.outline) + mover.at, mover.at) for mover in layout.movers if np.ndim(mover.outline) == 2
    ]
    return [(layout.border, None), *still, *moving]


def slow_scan(layout: Layout, peers: F64, pose: F64, angles: F64, reach: float) -> F64:
    """Distances along beams: circles in closed form, polygons and the border by shapely.

    Args:
        peers: circles (n, 3) of the other robots.
        pose: x, y [m], heading [rad] of the robot that looks.
        angles: of the beams (B,) from its heading [rad].
        reach: longest range [m].
    """
    x, y, heading = pose
    directions = np.stack([np.cos(heading + angles), np.sin(heading + angles)], axis=1)
    lines = shapely.multilinestrings([shapely.linestrings(np.vstack([ring, ring[:1]])) for ring, _ in rings_of(layout)])
    rays = shapely.linestrings(
        np.stack([np.broadcast_to([x, y], directions.shape), [x, y] + reach * directions], axis=1)
    )
    found = shapely.distance(shapely.Point(x, y), shapely.intersection(rays, lines))
    ranges = np.where(np.isnan(found), reach, found)
    moving = [(*mover.at, mover.outline) for mover in layout.movers if isinstance(mover.outline, float)]
    for cx, cy, radius in [*layout.circles, *moving, *peers]:
        # |t d - c| = r: the roots of t^2 - 2 (c d) t + c^2 - r^2
        half = directions @ [cx - x, cy - y]
        under = half**2 - ((cx - x) ** 2 + (cy - y) ** 2 - radius**2)
        with np.errstate(invalid="ignore"):
            root = half - np.sqrt(under)
        ranges = np.where((under >= 0.0) & (root >= 0.0), np.minimum(ranges, root), ranges)
    return ranges
