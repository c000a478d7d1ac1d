"""The free space as triangles: a Delaunay triangulation from which all that meets an obstacle is taken away.

Source: Sellers et al. 2026, section 3 and Algorithm 2 (dynamically constrained Delaunay triangulation, D2T). The
triangulation is that of the vertices of obstacles, of the start, the goal and points sampled in free space. An edge is
free where it crosses no obstacle's interior (along a side is allowed), a triangle where it shares no area with an
obstacle: three free edges do not suffice, a hull's inside may have them. The paper keeps the largest component; what
counts is the one that holds the robot.

No shape is compared with each edge. A side of an obstacle that is an edge of the triangulation crosses none of the
others; so only the sides that are missing are walked along, from triangle to triangle, and what they cross is marked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from bug_gym.compiling import called, kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats

Triangles = NDArray[np.int32]

NOBODY = -1
"""Owner of a point that is no obstacle's vertex."""
ON_LINE = 1e-10
"""A point lies on a line if it makes with it a triangle of less than this share of the squared length [-]."""
ON_SIDE = 1e-7
"""An edge no deeper in a shape runs along its side [m]."""


class Mesh(NamedTuple):
    """A triangulation; edge i of a triangle lies opposite its corner i."""

    points: F64
    """Vertices (p, 2) [m]."""
    owner: NDArray[np.int64]
    """Shape that each vertex belongs to (p,), NOBODY of none."""
    corners: Triangles
    """Vertices of each triangle (t, 3), counter-clockwise."""
    neighbours: Triangles
    """Triangle beyond each edge (t, 3), -1 none."""
    free: NDArray[np.bool_]
    """Whether a triangle shares no area with a shape (t,)."""
    crossed: NDArray[np.bool_]
    """Whether an edge crosses a side of a shape (t, 3)."""
    extra: NDArray[np.int64]
    """Vertices that the points beside those of the shapes became (e,)."""


def triangulate(shapes: Sequence[shapely.Polygon], extra: F64) -> Mesh:
    """The constrained triangulation of polygons that do not overlap, and of points outside them.

    Args:
        shapes: (n,) polygons, with holes or without [m].
        extra: (e, 2) points more; they become the last vertices of the mesh [m].

    Raises:
        ValueError: fewer than three points, or all of them on one line.
    """
    points, owner, sides = _vertices(shapes, extra)
    if len(points) < 3:
        raise ValueError(f"a triangulation needs 3 points, got {len(points)}")
    delaunay = Delaunay(points)
    corners = np.ascontiguousarray(delaunay.simplices, dtype=np.int32)
    neighbours = np.ascontiguousarray(delaunay.neighbors, dtype=np.int32)
    _turn_left(points, corners, neighbours)
    alias = np.arange(len(points))
    alias[delaunay.coplanar[:, 0]] = delaunay.coplanar[:, 2]  # a point on another one is no vertex
    sides = alias[sides]
    crossed = np.zeros((len(corners), 3), dtype=np.bool_)
    mark_crossings(points, corners, neighbours, sides, crossed, np.full(len(points), -1, np.int32))
    free = np.asarray(~crossed.any(axis=1))
    free[_inside(shapes, points, owner, corners)] = False
    return Mesh(points, owner, corners, neighbours, free, crossed, alias[len(points) - len(extra) :])


def _vertices(shapes: Sequence[shapely.Polygon], extra: F64) -> tuple[F64, NDArray[np.int64], NDArray[np.int64]]:
    """All points (p, 2), whose they are (p,), and the sides (s, 2) of the shapes as pairs of points."""
    rings, ring_owner = shapely.get_rings(np.array(shapes, dtype=object), return_index=True)
    coordinates, ring = shapely.get_coordinates(rings, return_index=True)
    last = np.flatnonzero(np.diff(ring, append=len(rings)))  # closes its ring, and is its first point again
    kept = np.ones(len(coordinates), dtype=bool)
    kept[last] = False
    number = np.cumsum(kept) - 1
    first = np.concatenate([[0], last[:-1] + 1]).astype(np.int64) if len(last) else np.empty(0, dtype=np.int64)
    number[last] = number[first]
    start = np.flatnonzero(kept)
    sides = np.stack([number[start], number[start + 1]], axis=1)
    points = np.concatenate([coordinates[kept], np.asarray(extra, dtype=float).reshape(-1, 2)])
    owner = np.concatenate([ring_owner[ring[kept]], np.full(len(points) - kept.sum(), NOBODY)])
    return np.ascontiguousarray(points), owner, sides


def _turn_left(points: F64, corners: Triangles, neighbours: Triangles) -> None:
    """Put the corners of every triangle into counter-clockwise order."""
    a, b, c = points[corners[:, 0]], points[corners[:, 1]], points[corners[:, 2]]
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    wrong = area < 0.0
    corners[wrong] = corners[wrong][:, [0, 2, 1]]
    neighbours[wrong] = neighbours[wrong][:, [0, 2, 1]]


def _inside(
    shapes: Sequence[shapely.Polygon],
    points: F64,
    owner: NDArray[np.int64],
    corners: Triangles,
) -> NDArray[np.int64]:
    """Indices of the triangles that lie within a shape: all corners are that shape's, and so is the middle."""
    owners = owner[corners]
    own = np.flatnonzero((owners[:, 0] == owners[:, 1]) & (owners[:, 1] == owners[:, 2]) & (owners[:, 0] != NOBODY))
    array = np.array(shapes, dtype=object)
    if not len(own):
        return own
    hollow = shapely.area(shapely.convex_hull(array)) > (1.0 + 1e-12) * shapely.area(array)
    unsure = own[hollow[owners[own, 0]]]
    middle = points[corners[unsure]].mean(axis=1)
    shapely.prepare(array)
    outside = unsure[~shapely.contains_xy(array[owners[unsure, 0]], middle[:, 0], middle[:, 1])]
    return np.asarray(np.setdiff1d(own, outside, assume_unique=True))


@called
def turn(points: Floats, a: int, b: int, c: int) -> int:
    """1 where the way from a over b to c turns left, -1 where right, 0 where the three lie on a line."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    vx, vy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
    cross = ux * vy - uy * vx
    limit = ON_LINE * (ux * ux + uy * uy)
    if cross > limit:
        return 1
    return -1 if cross < -limit else 0


@called
def place_in(corners: Triangles, triangle: int, vertex: int) -> int:
    """Which corner of a triangle a vertex is."""
    for i in range(3):
        if corners[triangle, i] == vertex:
            return i
    return -1


@called
def edge_between(neighbours: Triangles, triangle: int, other: int) -> int:
    """Which edge of a triangle another one lies beyond."""
    for i in range(3):
        if neighbours[triangle, i] == other:
            return i
    return -1


@called
def next_around(corners: Triangles, neighbours: Triangles, triangle: int, vertex: int, onward: int) -> int:
    """The next triangle around a vertex, counter-clockwise (`onward` 1) or clockwise (2); -1 at the hull."""
    return int(neighbours[triangle, (place_in(corners, triangle, vertex) + onward) % 3])


@called
def cross_from(
    points: Floats, corners: Triangles, neighbours: Triangles, first: int, a: int, b: int
) -> tuple[int, int, int]:
    """How the way from vertex a to b begins.

    Args:
        points: vertices [m].
        corners: of the triangles.
        neighbours: of the triangles.
        first: a triangle that has the corner a.
        a: vertex.
        b: vertex.

    Returns:
        A vertex on the way that an edge leads to from a, or -1; else the triangle that the way goes through and its
        edge that is crossed (-1, -1: a has no triangle there, which rounding alone can bring).
    """
    for onward in (1, 2):
        triangle = first
        while triangle >= 0:
            i = place_in(corners, triangle, a)
            p, q = corners[triangle, (i + 1) % 3], corners[triangle, (i + 2) % 3]
            if p == b or q == b:
                return b, -1, -1
            to_p, to_q = turn(points, a, b, p), turn(points, a, b, q)
            ahead_p = (points[p, 0] - points[a, 0]) * (points[b, 0] - points[a, 0]) + (points[p, 1] - points[a, 1]) * (
                points[b, 1] - points[a, 1]
            )
            ahead_q = (points[q, 0] - points[a, 0]) * (points[b, 0] - points[a, 0]) + (points[q, 1] - points[a, 1]) * (
                points[b, 1] - points[a, 1]
            )
            if to_p == 0 and ahead_p > 0.0:
                return p, -1, -1
            if to_q == 0 and ahead_q > 0.0:
                return q, -1, -1
            if to_p < 0 and to_q > 0:
                return -1, triangle, i
            triangle = next_around(corners, neighbours, triangle, a, onward)
            if triangle == first:
                return -1, -1, -1
    return -1, -1, -1


@kernel
def mark_crossings(
    points: Floats,
    corners: Triangles,
    neighbours: Triangles,
    sides: NDArray[np.int64],
    crossed: NDArray[np.bool_],
    at: Triangles,
) -> None:
    """Walk along the sides of shapes and mark the edges of the triangulation that they cross.

    Args:
        points: vertices (p, 2) [m].
        corners: vertices of the triangles (t, 3), counter-clockwise.
        neighbours: triangle beyond each edge (t, 3).
        sides: pairs of vertices (s, 2).
        crossed: edges (t, 3), written here.
        at: (p,) -1; a triangle at each vertex is written here.
    """
    for triangle in range(corners.shape[0]):
        for i in range(3):
            at[corners[triangle, i]] = triangle
    for side in range(sides.shape[0]):
        a, b = sides[side, 0], sides[side, 1]
        for _ in range(points.shape[0]):  # each turn passes a vertex; the bound only ends what cannot be
            if a == b or at[a] < 0 or at[b] < 0:
                break
            vertex, triangle, edge = cross_from(points, corners, neighbours, at[a], a, b)
            if vertex < 0 and triangle < 0:
                break
            if vertex < 0:
                vertex = walk(points, corners, neighbours, triangle, edge, a, b, crossed)
            a = vertex


@called
def walk(
    points: Floats,
    corners: Triangles,
    neighbours: Triangles,
    triangle: int,
    edge: int,
    a: int,
    b: int,
    crossed: NDArray[np.bool_],
) -> int:
    """Go from vertex a toward b, out of a triangle over one of its edges, and mark what is crossed.

    Returns:
        The first vertex on the way.
    """
    while True:
        crossed[triangle, edge] = True
        beyond = neighbours[triangle, edge]
        if beyond < 0:
            return b
        entered = edge_between(neighbours, beyond, triangle)
        crossed[beyond, entered] = True
        apex = corners[beyond, entered]
        side = 0 if apex == b else turn(points, a, b, apex)
        if side == 0:
            return int(apex)
        # The way leaves between the apex and the corner on its other side.
        triangle = beyond
        edge = (entered + 1) % 3 if side > 0 else (entered + 2) % 3


def edges_of(mesh: Mesh, shapes: Sequence[shapely.Polygon]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The edges (e, 2) of a mesh of shapes, each once, the smaller vertex first; and which are free (e,).

    An edge is free where it crosses no side and its middle lies in no shape; along a side it is.
    """
    ends = np.stack([mesh.corners[:, [1, 2, 0]], mesh.corners[:, [2, 0, 1]]], axis=-1).reshape(-1, 2)
    ends = np.sort(ends, axis=1).astype(np.int64)
    keys, number = np.unique(ends[:, 0] * len(mesh.points) + ends[:, 1], return_inverse=True)
    edges = np.stack([keys // len(mesh.points), keys % len(mesh.points)], axis=1)
    crossed, beside_free = np.zeros((2, len(edges)), dtype=bool)
    np.logical_or.at(crossed, number, mesh.crossed.ravel())
    np.logical_or.at(beside_free, number, np.repeat(mesh.free, 3))
    owners = mesh.owner[edges]
    unsure = np.flatnonzero(~crossed & ~beside_free & (owners[:, 0] == owners[:, 1]) & (owners[:, 0] != NOBODY))
    cores = shapely.buffer(np.array(shapes, dtype=object), -ON_SIDE)
    middle = mesh.points[edges[unsure]].mean(axis=1)
    within = shapely.contains_xy(cores[owners[unsure, 0]], middle[:, 0], middle[:, 1])
    crossed[unsure[within]] = True
    return edges, ~crossed


def component(edges: NDArray[np.int64], vertices: int, vertex: int) -> NDArray[np.bool_]:
    """Which of some edges (e, 2) hang together with a vertex (e,)."""
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(vertices, vertices))
    label = connected_components(graph, directed=False)[1]
    return np.asarray(label[edges[:, 0]] == label[vertex])
