"""Worlds in which nothing moves as arrays, many at once: what `World.load_all` writes into rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.geometry import F64, following
from bug_gym.worlds.layout import SAME_POINT, Layout

Counts = NDArray[np.int64]

IN_DOUBT = 1e-9  # an area that is less than this share of what it is the difference of may have either sign


class Spans(NamedTuple):
    """Which entries of an array belong to which of several things, one after the other."""

    size: Counts
    """How many each of them has (n,)."""
    owner: Counts
    """Number of the thing that each entry belongs to."""
    place: Counts
    """Number of the entry among those of its thing."""


class Standing(NamedTuple):
    """What stands in several worlds; corners, rings, polygons and circles of all of them lie in one array each."""

    wall_begin: F64
    """Where the sides of all rings begin (w, 2), each world's border first [m]."""
    wall_next: Counts
    """Number, in its world, of the side that begins where each one ends (w,)."""
    of_world: Spans
    """Walls by worlds."""
    corners: Counts
    """How many corners the rings of each world have (n,): no fewer than walls."""
    border_walls: Counts
    """How many sides each border has (n,)."""
    polygons: Spans
    """Polygons by worlds."""
    polygon_first: Counts
    """Number of each polygon's first wall in its world."""
    polygon_walls: Counts
    """How many walls each polygon has."""
    polygon_side: Counts
    """On which side of its walls each polygon lies, see `world.inner_side`."""
    centre: F64
    """Middle (p, 2) of the box that holds each polygon [m]."""
    radius: F64
    """Of the disc about that which holds it [m]."""
    circles: Spans
    """Circles by worlds."""
    circle: F64
    """x, y, radius (c, 3) of each [m]."""


def is_standing(layout: Layout) -> bool:
    """Whether nothing moves in a world but robots."""
    return not layout.movers and layout.target is None


def spans(sizes: Sequence[int] | Counts) -> Spans:
    """Entries of things that have so many each."""
    size = np.asarray(sizes, dtype=np.int64)
    owner = np.arange(len(size)).repeat(size)
    return Spans(size, owner, np.arange(len(owner)) - (size.cumsum() - size)[owner])


def standing(layouts: Sequence[Layout]) -> Standing:
    """The arrays of worlds in which nothing moves."""
    shapes = [[(layout.border,), *layout.polygons] for layout in layouts]
    all_shapes = [shape for world in shapes for shape in world]
    all_rings = [ring for rings in all_shapes for ring in rings]
    of_shape = spans([len(world) for world in shapes])
    of_ring = spans([len(rings) for rings in all_shapes])
    of_corner = spans([len(ring) for ring in all_rings])
    corners: F64 = np.concatenate(all_rings).astype(np.float64, copy=False)
    is_polygon = of_shape.place > 0
    wall_begin, wall_next, walls_of = sides_of(corners, of_corner)
    walls_of_shape = np.bincount(of_ring.owner[walls_of], minlength=len(all_shapes))
    first = walls_of_shape.cumsum() - walls_of_shape
    of_world = spans(np.bincount(of_shape.owner, walls_of_shape, len(layouts)).astype(np.int64))
    world_first = of_world.size.cumsum() - of_world.size
    shells, shell_of = corners[of_ring.place[of_corner.owner] == 0], spans(of_corner.size[of_ring.place == 0])
    centre, radius = holding_discs(shells, shell_of)
    return Standing(
        wall_begin=wall_begin,
        wall_next=wall_next - world_first[of_world.owner],
        of_world=of_world,
        corners=np.bincount(of_shape.owner[of_ring.owner], of_corner.size, len(layouts)).astype(np.int64),
        border_walls=walls_of_shape[~is_polygon],
        polygons=spans(of_shape.size - 1),
        polygon_first=(first - world_first[of_shape.owner])[is_polygon],
        polygon_walls=walls_of_shape[is_polygon],
        polygon_side=inner_sides(corners, of_corner, of_ring)[is_polygon],
        centre=centre[is_polygon],
        radius=radius[is_polygon],
        circles=spans([len(layout.circles) for layout in layouts]),
        circle=np.concatenate([layout.circles for layout in layouts]),
    )


def next_numbers(rings: Spans) -> Counts:
    """Of each corner (c,) the number of the next one of its ring."""
    after = np.arange(1, len(rings.owner) + 1)
    ends = rings.size.cumsum()[rings.size > 0]
    after[ends - 1] = ends - rings.size[rings.size > 0]
    return after


def sides_of(corners: F64, rings: Spans) -> tuple[F64, Counts, Counts]:
    """Where the sides of rings begin (w, 2), without those that have no direction; the next one's number, the ring's."""
    after = next_numbers(rings)
    is_side = np.hypot(*(corners[after] - corners).T) > SAME_POINT
    if is_side.all():
        return corners, after, rings.owner
    corners, owner = corners[is_side], rings.owner[is_side]
    return corners, next_numbers(spans(np.bincount(owner, minlength=len(rings.size)))), owner


def holding_discs(corners: F64, rings: Spans) -> tuple[F64, F64]:
    """Middles (n, 2) of the boxes that hold rings, and the distance of the farthest corner (n,) [m]."""
    starts = rings.size.cumsum() - rings.size
    centre = 0.5 * (np.minimum.reduceat(corners, starts) + np.maximum.reduceat(corners, starts))
    return centre, np.maximum.reduceat(np.hypot(*(corners - centre[rings.owner]).T), starts)


def inner_sides(corners: F64, rings: Spans, polygons: Spans) -> Counts:
    """Side of the walls on which polygons lie (p,), as their rings run: 1 left, -1 right, 0 not the same for all."""
    x, y = corners.T
    next_x, next_y = corners[next_numbers(rings)].T
    starts = rings.size.cumsum() - rings.size
    left, right = np.add.reduceat(x * next_y, starts), np.add.reduceat(y * next_x, starts)
    area = left - right
    for ring in np.flatnonzero(np.abs(area) <= IN_DOUBT * (np.abs(left) + np.abs(right))).tolist():
        own = slice(starts[ring], starts[ring] + rings.size[ring])
        area[ring] = signed_area(x[own], y[own])
    side = np.where(polygons.place == 0, 1, -1) * np.where(np.signbit(area), -1, 1)
    total = np.bincount(polygons.owner, side, len(polygons.size)).astype(np.int64)
    sides: Counts = np.where(np.abs(total) == polygons.size, np.sign(total), 0)
    return sides


def signed_area(x: F64, y: F64) -> float:
    """Twice the area of a ring (k,), (k,) [m2]: above 0 where it runs to the left."""
    return float(x @ following(y) - y @ following(x))
