"""Obstacles grown by the robot, so that it may be planned for as a point.

Corners become circumscribed polygons: what is grown holds all that a disc of the radius touches, and a way outside it
keeps that far off. (Clipping the ends of the edges that a way crosses does not: two edges that share a corner, both
crossed at a distance R from it, let the straight way between them come nearer.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from bug_gym.geometry import F64

FACETS = 8
"""Sides of a grown corner, a quarter turn."""
TOUCHING = 0.1
"""Share of the margin by which they grow that is kept where the whole of it leaves no way."""
FRAME = 1.0
"""Width of the wall that the border of a world is taken for [m]."""


def grow(shapes: Sequence[shapely.Polygon], reach: float, facets: int = FACETS) -> list[shapely.Polygon]:
    """Polygons grown by `reach` [m], their corners round from outside."""
    array = np.array(shapes, dtype=object)
    if reach == 0.0 or not len(array):
        return list(array)
    convex = shapely.area(shapely.convex_hull(array)) <= (1.0 + 1e-9) * shapely.area(array)
    grown = np.empty(len(array), dtype=object)
    grown[convex] = _grow_convex(array[convex], reach, facets)
    # A side of shapely's corner turns by up to one and a half times what a side should; its middle is what must be out.
    grown[~convex] = shapely.buffer(array[~convex], reach / np.cos(0.375 * np.pi / facets), quad_segs=facets)
    return list(shapely.get_parts(grown))


def _grow_convex(shapes: NDArray[np.object_], reach: float, facets: int) -> NDArray[np.object_]:
    """Convex polygons grown, all at once: at each corner the tangents of its arc meet in as many points as it takes."""
    if not len(shapes):
        return shapes
    points, index = shapely.get_coordinates(shapely.normalize(shapes), return_index=True)
    last = np.flatnonzero(np.diff(index, append=len(shapes)))
    side = np.delete(np.diff(points, axis=0), last[:-1], axis=0)
    owner = np.delete(index, last)
    corner = np.delete(points, last, axis=0)
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    before = np.arange(len(owner)) - 1
    before[first] = np.append(first[1:], len(owner)) - 1
    # Rings run clockwise after normalize: outside is to the left of a side.
    outward = np.arctan2(side[:, 0], -side[:, 1])
    bend = np.mod(outward[before] - outward, 2.0 * np.pi)
    bend[bend > np.pi] = 0.0  # straight on, but for rounding
    count = np.maximum(np.ceil(bend / (0.5 * np.pi / facets) - 1e-9).astype(int), 1)
    half = 0.5 * bend / count
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    angle = np.repeat(outward[before], count) - (2 * number + 1) * np.repeat(half, count)
    far = np.repeat(reach / np.cos(half), count)[:, None]
    ring = np.repeat(corner, count, axis=0) + far * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(shapely.polygons(shapely.linearrings(ring, indices=np.repeat(owner, count))))


def apart(shapes: Sequence[shapely.Polygon]) -> list[shapely.Polygon]:
    """The same area as polygons that do not touch: those that do are united."""
    array = np.array(shapes, dtype=object)
    first, second = shapely.STRtree(array).query(array, predicate="intersects")
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(len(array), len(array)))
    count, label = connected_components(graph, directed=False)
    crowd = np.bincount(label, minlength=count) > 1
    kept = list(array[~crowd[label]])
    united = [shapely.union_all(array[label == group]) for group in np.flatnonzero(crowd)]
    return kept + [part for one in united for part in shapely.get_parts(one)]


def frame(border: F64, reach: float) -> shapely.Polygon:
    """The wall around a world [m]: all that is nearer than `reach` to the border from inside, and a little outside.

    Args:
        border: (k, 2) simple polygon.
        reach: radius of the robot and margin.

    Raises:
        ValueError: the world is too small for it.
    """
    room = shapely.buffer(shapely.Polygon(border), -reach, join_style="mitre")
    if room.is_empty or room.geom_type != "Polygon":
        raise ValueError(f"the world leaves no one room to a robot that keeps {reach:g} m off its border")
    x1, y1, x2, y2 = shapely.bounds(shapely.Polygon(border))
    return shapely.difference(shapely.box(x1 - FRAME, y1 - FRAME, x2 + FRAME, y2 + FRAME), room)
