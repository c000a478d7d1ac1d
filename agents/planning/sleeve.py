"""The sleeve: which triangles the way goes through, so that within them it may be pulled taut.

A way along edges of the triangulation does not say which triangles it would be pulled taut in. So the triangles
themselves are searched: nodes are points on the edges that they share, five on each, ends included, and a way from one
to another costs the straight line within the triangle (A*, the straight line to the goal as its estimate). With the
triangles' centroids instead, ways come out a quarter too long: they run round the field through the large triangles at
its border.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.planning.mesh import Mesh, Triangles, place_in
from bug_gym.agents.planning.open_list import OpenList, open_list, put, take
from bug_gym.compiling import called, inlined, kernel
from bug_gym.geometry import F64
from bug_gym.kernels.geometry import length
from bug_gym.kernels.layout import Floats, Integers

POINTS = 5
"""Points on each shared edge."""
NANO = 1e-9
"""Unit of the keys of open nodes [m]."""


class Sleeve(NamedTuple):
    """The triangles of a way, by the edges in between."""

    start: F64
    """Where it begins (2,) [m]."""
    goal: F64
    """Where it ends (2,) [m]."""
    left: F64
    """Left ends of the shared edges in their order, seen along the way (n, 2) [m]."""
    right: F64
    """Right ends (n, 2) [m]."""
    triangles: NDArray[np.int64]
    """The triangles (n + 1,)."""

    def crossings(self, gamma: F64) -> F64:
        """The way (n + 2, 2) that crosses each edge at a share gamma (n,) of it, from left to right (equation 1)."""
        across = self.left + np.asarray(gamma)[:, None] * (self.right - self.left)
        return np.concatenate([self.start[None], across, self.goal[None]])

    @property
    def middles(self) -> F64:
        """Gamma of the middles of the edges (n,)."""
        return np.full(len(self.left), 0.5)


def find_sleeve(mesh: Mesh, start: int, goal: int) -> Sleeve | None:
    """The sleeve between two vertices of a mesh, None where no free triangles join them."""
    triangles = np.empty(len(mesh.corners), dtype=np.int64)
    count = search(
        mesh.points, mesh.corners, mesh.neighbours, mesh.free, start, goal, new_nodes(len(mesh.corners)), triangles
    )
    if count == 0:
        return None
    chosen = triangles[:count]
    left, right = _portals(mesh, chosen)
    return Sleeve(mesh.points[start], mesh.points[goal], left, right, chosen)


def _portals(mesh: Mesh, chosen: NDArray[np.int64]) -> tuple[F64, F64]:
    """Left and right ends (n, 2) of the edges between triangles in a row."""
    edge = np.argmax(mesh.neighbours[chosen[:-1]] == chosen[1:, None], axis=1)
    # Going out of a triangle whose corners run counter-clockwise, the edge's second end is on the left.
    right = mesh.corners[chosen[:-1], (edge + 1) % 3]
    left = mesh.corners[chosen[:-1], (edge + 2) % 3]
    return mesh.points[left], mesh.points[right]


@inlined
def point_on(points: Floats, corners: Triangles, triangle: int, edge: int, share: int) -> tuple[float, float]:
    """One of the points on an edge of a triangle [m]."""
    a, b = corners[triangle, (edge + 1) % 3], corners[triangle, (edge + 2) % 3]
    part = share / (POINTS - 1)
    return (
        points[a, 0] + part * (points[b, 0] - points[a, 0]),
        points[a, 1] + part * (points[b, 1] - points[a, 1]),
    )


class Nodes(NamedTuple):
    """The nodes of a search, m of them."""

    cost: Floats
    """Length of the shortest way found to each (m,) [m]."""
    parent: Integers
    """Node that it was reached from (m,), -1 none."""
    opened: OpenList
    """Those to go on from, by that length and the estimate of the rest in NANO."""


def new_nodes(triangles: int) -> Nodes:
    """The nodes of a new search over so many triangles: none is reached."""
    m = 3 * POINTS * triangles
    return Nodes(np.full(m, np.inf), np.empty(m, dtype=np.int64), open_list(m))


@called
def trace(parents: Integers, node: int, triangles: Integers) -> int:
    """Write the triangles that a chain of nodes leaves, first to last; returns how many."""
    count = 0
    at = node
    while at >= 0:
        count += 1
        at = parents[at]
    at = node
    for place in range(count - 1, -1, -1):
        triangles[place] = at // (3 * POINTS)
        at = parents[at]
    return count


@called
def leave(
    points: Floats,
    corners: Triangles,
    neighbours: Triangles,
    free: NDArray[np.bool_],
    triangle: int,
    came_from: int,
    x: float,
    y: float,
    goal: int,
    node: int,
    nodes: Nodes,
) -> None:
    """Open the points on the edges of a triangle that another free one lies beyond.

    Args:
        points: vertices [m].
        corners: of the triangles.
        neighbours: of the triangles.
        free: which triangles may be used.
        triangle: which one is left.
        came_from: the one before it, which is not gone back to.
        x: where the way into the triangle ends [m].
        y: the same.
        goal: vertex.
        node: that stands for it, -1: it is the start.
        nodes: of the search, changed.
    """
    so_far = nodes.cost[node] if node >= 0 else 0.0
    for edge in range(3):
        beyond = neighbours[triangle, edge]
        if beyond < 0 or beyond == came_from or not free[beyond]:
            continue
        for share in range(POINTS):
            px, py = point_on(points, corners, triangle, edge, share)
            to_go = length(points[goal, 0] - px, points[goal, 1] - py)
            number = (3 * triangle + edge) * POINTS + share
            reached = so_far + length(px - x, py - y)
            if reached < nodes.cost[number]:
                nodes.cost[number], nodes.parent[number] = reached, node
                put(nodes.opened, int((reached + to_go) / NANO), 0, number)


@kernel
def search(
    points: Floats,
    corners: Triangles,
    neighbours: Triangles,
    free: NDArray[np.bool_],
    start: int,
    goal: int,
    nodes: Nodes,
    triangles: Integers,
) -> int:
    """A* over points on shared edges; a node is leaving triangle t over edge i at point k: (3 t + i) POINTS + k.

    In a triangle that has the goal as a corner the estimate of the rest is exact, so the first node taken there ends it.

    Args:
        points: vertices (p, 2) [m].
        corners: of the triangles (t, 3).
        neighbours: of the triangles (t, 3).
        free: which triangles may be used (t,).
        start: vertex.
        goal: vertex.
        nodes: of a new search, changed.
        triangles: the sleeve, written here (t,).

    Returns:
        How many triangles it has, 0 for none.
    """
    for triangle in range(corners.shape[0]):
        if free[triangle] and place_in(corners, triangle, start) >= 0:
            if place_in(corners, triangle, goal) >= 0:
                triangles[0] = triangle
                return 1
            x, y = points[start, 0], points[start, 1]
            leave(points, corners, neighbours, free, triangle, -1, x, y, goal, -1, nodes)
    while nodes.opened.filled[0] > 0:
        node = nodes.opened.entries[0, 2]
        take(nodes.opened, node)
        triangle, edge = node // (3 * POINTS), node // POINTS % 3
        beyond = neighbours[triangle, edge]
        if place_in(corners, beyond, goal) >= 0:
            count = trace(nodes.parent, node, triangles)
            triangles[count] = beyond
            return count + 1
        x, y = point_on(points, corners, triangle, edge, node % POINTS)
        leave(points, corners, neighbours, free, beyond, triangle, x, y, goal, node, nodes)
    return 0


def path_length(path: F64) -> float:
    """Length of a way through points (k, 2) [m] (equation 2)."""
    return math.fsum(np.hypot(*np.diff(path, axis=0).T).tolist())
