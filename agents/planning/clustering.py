"""Clustering of obstacles: those with no room for the robot between them become one, in its convex hull.

Source: Sellers, Lei, Luo, Bi and Jan 2026, "A Dynamically Updating Graph-Based Navigation Scheme for Autonomous
Vehicles", section 2 and Algorithm 1. What the paper leaves open is settled so:

- hulls may come nearer to each other than the threshold, or overlap: clustering goes on until nothing changes;
- a hull may swallow the start or the goal: such a cluster keeps the shapes of its members;
- a lone obstacle that is not convex (a U, a spiral, the outer wall of a room) keeps its shape where its hull holds
  the start, the goal or another obstacle;
- where hulls leave no way though there is one, the planner takes the obstacles as they are (see d2t).

Shapes only ever grow, so clustering never opens a passage. Movers are not clustered, they are the navigator's task.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from bug_gym.geometry import Point

CONVEX = 1e-9
"""A shape is convex where its hull is larger by no more than this share of its area."""
INSET = 1e-7
"""Shapes that overlap by less only touch [m]."""


@dataclass(frozen=True)
class Cluster:
    """Obstacles that the robot takes for one."""

    members: tuple[int, ...]
    """Indices of its obstacles."""
    parts: tuple[shapely.Polygon, ...]
    """What is to be kept off: one hull, or the members' own shapes where a hull would swallow too much."""


def default_threshold(radius: float, margin: float) -> float:
    """Psi [m]: a little over the robot's diameter, and no less than the width that it asks of a passage."""
    return max(2.2 * radius, 2.0 * (radius + margin))


def cluster(
    obstacles: Sequence[shapely.Polygon], threshold: float, *, keep_out: Sequence[Point] = (), room: float = 0.0
) -> list[Cluster]:
    """Algorithm 1 with its repairs: clusters of obstacles less than a threshold apart.

    Args:
        obstacles: (n,) polygons [m].
        threshold: Psi [m]: a gap below it is no passage.
        keep_out: points, the start and the goal, that no hull may come nearer to than `room`.
        room: the room around these [m]; only hulls that are larger than the obstacles are bound by it.

    Raises:
        ValueError: a threshold that is not above 0.
    """
    if not 0.0 < threshold < np.inf:
        raise ValueError(f"the threshold must be above 0 m, got {threshold!r}")
    points = shapely.points(np.asarray(keep_out, dtype=float).reshape(-1, 2))
    found = _singles(obstacles, points, room)
    while True:
        merged = [_closed(group, points, room) for group in _merged(found, threshold)]
        if len(merged) == len(found):
            return merged
        found = merged


def proximity_graph(shapes: Sequence[shapely.Polygon], threshold: float) -> NDArray[np.int64]:
    """Pairs (k, 2) of shapes less than a threshold apart (the paper's Psi proximity graph), the smaller index first."""
    tree = shapely.STRtree(shapes)
    first, second = tree.query(shapes, predicate="dwithin", distance=threshold)
    one, other = first[first < second], second[first < second]
    near = np.stack([one, other], axis=1)
    array = np.asarray(shapes, dtype=object)
    return np.asarray(near[shapely.distance(array[one], array[other]) < threshold])


def planner_graph(shapes: Sequence[shapely.Polygon], pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of some pairs (k, 2) whose shortest connection no third shape crosses (the Psi planner graph).

    Its components are those of the proximity graph: what crosses a connection is nearer to both ends than they are to
    each other.
    """
    array = np.asarray(shapes, dtype=object)
    lines = shapely.shortest_line(array[pairs[:, 0]], array[pairs[:, 1]])
    line, shape = shapely.STRtree(shapes).query(lines, predicate="intersects")
    third = (shape != pairs[line, 0]) & (shape != pairs[line, 1])
    blocked = np.zeros(len(pairs), dtype=bool)
    blocked[line[third]] = True
    return np.asarray(pairs[~blocked])


def _merged(clusters: Sequence[Cluster], threshold: float) -> list[Cluster]:
    """The clusters with those that have parts less than a threshold apart put together, parts as they are."""
    owner = np.repeat(np.arange(len(clusters)), [len(one.parts) for one in clusters])
    parts = [part for one in clusters for part in one.parts]
    edges = owner[planner_graph(parts, proximity_graph(parts, threshold))]
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(clusters), len(clusters)))
    count, label = connected_components(graph, directed=False)
    groups: list[list[Cluster]] = [[] for _ in range(count)]
    for one, group in zip(clusters, label, strict=True):
        groups[group].append(one)
    return [
        group[0]
        if len(group) == 1
        else Cluster(
            tuple(sorted(i for one in group for i in one.members)), tuple(part for one in group for part in one.parts)
        )
        for group in groups
    ]


def _closed(found: Cluster, points: NDArray[np.object_], room: float) -> Cluster:
    """Several parts in their convex hull, or as they are where the hull would come too near to one of the points."""
    if len(found.parts) == 1:
        return found
    hull = shapely.convex_hull(shapely.union_all(np.array(found.parts, dtype=object)))
    if (shapely.distance(points, hull) <= room).any():
        return found
    return Cluster(found.members, (hull,))


def _singles(obstacles: Sequence[shapely.Polygon], points: NDArray[np.object_], room: float) -> list[Cluster]:
    """Each obstacle alone, in its hull where that holds no point and nothing of another obstacle."""
    shapes = np.array(obstacles, dtype=object)
    hulls = shapely.convex_hull(shapes)
    hollow = np.flatnonzero(shapely.area(hulls) > (1.0 + CONVEX) * shapely.area(shapes))
    tree = shapely.STRtree(shapes)
    for index in hollow:
        inside = tree.query(shapely.buffer(hulls[index], -INSET), predicate="intersects")
        swallowed = inside[(inside != index) & ~shapely.intersects(shapes[index], shapes[inside])]
        if not len(swallowed) and (shapely.distance(points, hulls[index]) > room).all():
            shapes[index] = hulls[index]
    return [Cluster((index,), (shape,)) for index, shape in enumerate(shapes)]
