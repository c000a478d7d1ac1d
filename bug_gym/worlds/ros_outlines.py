"""The occupied cells of a map as polygons.

Outlines run along the borders of cells and are then drawn straighter by at most half a cell (see `outline`).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.geometry import F64
from bug_gym.worlds.layout import Rings
from bug_gym.worlds.ros_files import OCCUPIED, UNKNOWN, RosMap, load_ros_map


def load_outlines(path: str, *, unknown_is_wall: bool) -> tuple[Rings, ...]:
    """What is occupied on a map as polygons [m], each its shell and its holes.

    Raises:
        ValueError: no such map.
    """
    return outlines_of(load_ros_map(path), unknown_is_wall=unknown_is_wall)


@lru_cache(maxsize=8)
def outlines_of(plan: RosMap, *, unknown_is_wall: bool) -> tuple[Rings, ...]:
    """What is occupied on a map that was read, likewise."""
    walls = plan.cells >= (UNKNOWN if unknown_is_wall else OCCUPIED)
    return tuple(tuple(plan.to_world(ring) for ring in rings) for rings in outline(walls))


CHAMFER = 0.3125
"""Share of a cell's side by which two occupied cells that touch only in a corner are joined there."""

STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
"""Directions 0 to 3 of the sides of cells, x and y, counter-clockwise."""


class _Corners(NamedTuple):
    """Corners of the outlines in order, one outline after the other; occupied cells lie on the left."""

    places: F64
    """x, y (k, 2) [cells]."""
    arriving: NDArray[np.int64]
    """Direction (k,) of the side that ends in the corner."""
    leaving: NDArray[np.int64]
    """Direction (k,) of the side that begins in the corner."""
    is_shared: NDArray[np.bool_]
    """Whether two outlines meet in the corner (k,)."""
    first: NDArray[np.int64]
    """Index (m,) of the first corner of each outline."""
    group: NDArray[np.int64]
    """Number (m,) of the connected cells that each outline bounds."""


def outline(walls: NDArray[np.bool_]) -> list[Rings]:
    """Outlines of the occupied cells as simple polygons, each its shell and its holes (k, 2) [cells].

    Cells that share a side or a corner belong to one polygon. Where an outline steps from one row of cells into the
    next, by a side of length 1 between opposite turns, it is drawn through the middle of that side: slanting walls come
    out straight, and no part of an outline moves by more than half a cell::

              +-----                .-----
              |          ->      .`
        ------+             -----`
    """
    import shapely  # slow to load, and few scenarios have a map

    if not walls.any():
        return []
    corners = _trace(walls)
    straight = _assemble(corners, straighten=True)
    is_simple = shapely.is_valid(straight)
    if not is_simple.all():
        straight = np.where(is_simple, straight, _assemble(corners, straighten=False))
    return [_rings(polygon) for polygon in straight]


def _trace(walls: NDArray[np.bool_]) -> _Corners:
    """Walk along all sides between an occupied and a free cell."""
    from scipy import ndimage  # slow to load, and few scenarios have a map

    labels, _ = ndimage.label(np.pad(walls, 1), structure=np.ones((3, 3)))
    nodes = walls.shape[1] + 1  # in a row
    key, group = _sides(labels, nodes)
    node, direction = np.divmod(key, 4)
    x_step, y_step = STEPS[direction].T
    ends = node + x_step + nodes * y_step
    after = np.full(len(key), -1)
    # To the right first: so cells that touch in a corner stay on one side of an outline.
    for turn in (3, 0, 1):
        wanted = 4 * ends + (direction + turn) % 4
        found = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        after = np.where((after < 0) & (key[found] == wanted), found, after)
    order, first = _follow(after.tolist())
    leaving = direction[order]
    arriving = leaving[_neighbours(first, len(order))[0]]
    is_corner = leaving != arriving
    node = node[order]
    _, number, count = np.unique(node, return_inverse=True, return_counts=True)
    y, x = np.divmod(node, nodes)
    corners_before = np.concatenate([[0], np.cumsum(is_corner)])
    return _Corners(
        np.column_stack([x, y])[is_corner].astype(np.float64),
        arriving[is_corner],
        leaving[is_corner],
        count[number][is_corner] > 1,
        corners_before[first],
        group[order][first],
    )


def _sides(labels: NDArray[np.int32], nodes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sides between an occupied and a free cell as 4 node + direction (k,), sorted, and the group of each (k,)."""
    inner = slice(1, -1)
    below, above = labels[:-1, inner], labels[1:, inner]
    left, right = labels[inner, :-1], labels[inner, 1:]
    keys, groups = [], []
    # A side begins in the corner of its cell that lies `x`, `y` from the lower or left one of its two nodes.
    for occupied, free, direction, x, y in (
        (above, below, 0, 0, 0),
        (left, right, 1, 0, 0),
        (below, above, 2, 1, 0),
        (right, left, 3, 0, 1),
    ):
        row, column = np.nonzero((occupied > 0) & (free == 0))
        keys.append(4 * ((row + y) * nodes + column + x) + direction)
        groups.append(occupied[row, column])
    key = np.concatenate(keys)
    order = np.argsort(key)
    return key[order], np.concatenate(groups)[order].astype(np.int64)


def _follow(after: list[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sides (k,) in the order of walking, given which one comes after each, and where each outline begins (m,)."""
    is_seen = bytearray(len(after))
    order: list[int] = []
    first: list[int] = []
    for begin in range(len(after)):
        if is_seen[begin]:
            continue
        first.append(len(order))
        side = begin
        while not is_seen[side]:
            is_seen[side] = 1
            order.append(side)
            side = after[side]
    return np.array(order), np.array(first)


def _neighbours(first: NDArray[np.int64], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Index before and after each of `count` items of rings that begin at `first` (count,)."""
    last = np.append(first[1:], count) - 1
    before, after = np.arange(count) - 1, np.arange(count) + 1
    before[first], after[last] = last, first
    return before, after


def _assemble(corners: _Corners, *, straighten: bool) -> NDArray[np.object_]:
    """Shapely's polygons, one for each group of cells."""
    import shapely  # slow to load, and few scenarios have a map

    places, ring = _ring_points(corners, straighten=straighten)
    rings = shapely.linearrings(places, indices=ring)
    is_shell = shapely.is_ccw(rings)
    shells = np.empty(corners.group.max(), dtype=object)
    shells[corners.group[is_shell] - 1] = rings[is_shell]
    polygons: NDArray[np.object_] = shapely.polygons(shells)
    holes: dict[int, list[object]] = {}
    for number, hole in zip(corners.group[~is_shell] - 1, rings[~is_shell], strict=True):
        holes.setdefault(int(number), []).append(hole)
    for number, inner in holes.items():
        polygons[number] = shapely.polygons(shells[number], inner)
    return polygons


def _ring_points(corners: _Corners, *, straighten: bool) -> tuple[F64, NDArray[np.int64]]:
    """Points (n, 2) of all outlines, and the number (n,) of each one's outline."""
    places, count = corners.places, len(corners.places)
    before, after = _neighbours(corners.first, count)
    turn = (corners.leaving - corners.arriving) % 4  # 1 to the left, 3 to the right
    way = places[after] - places
    is_step = (np.abs(way).sum(axis=1) == 1.0) & (turn != turn[after])
    if not straighten:
        is_step[:] = False
    stays = ~is_step & ~is_step[before]
    chamfer = CHAMFER * corners.is_shared[:, None]
    on_arriving, on_leaving = places - chamfer * STEPS[corners.arriving], places + chamfer * STEPS[corners.leaving]
    points = np.stack([on_arriving, on_leaving, places + 0.5 * way], axis=1)
    counts = np.column_stack([stays, stays & corners.is_shared, is_step])
    outlines = np.repeat(np.arange(len(corners.first)), np.diff(np.append(corners.first, count)))
    return _without_straight_angles(points[counts], np.repeat(outlines, counts.sum(axis=1)))


def _without_straight_angles(points: F64, ring: NDArray[np.int64]) -> tuple[F64, NDArray[np.int64]]:
    """Points (n, 2) and their rings' numbers (n,) without the points on straight lines between their neighbours."""
    before, after = _neighbours(np.flatnonzero(np.diff(ring, prepend=-1)), len(ring))
    (x1, y1), (x2, y2) = (points - points[before]).T, (points[after] - points).T
    bends = x1 * y2 != y1 * x2  # exact: all places are multiples of 1/16
    return points[bends], ring[bends]


def _rings(polygon: Any) -> Rings:
    """Shell and holes of a shapely polygon as open rings (k, 2)."""
    import shapely  # slow to load, and few scenarios have a map

    return tuple(shapely.get_coordinates(ring)[:-1] for ring in (polygon.exterior, *polygon.interiors))
