"""The D2T planner: cluster the obstacles, triangulate the space between, pull a way through the triangles taut.

Source: Sellers et al. 2026, sections 2 to 4 (see clustering, mesh, sleeve, ants for each step and what was settled).

Obstacles are grown by the robot and a margin first; then each way within free triangles keeps off them. Where the
clusters leave no way, the obstacles are taken as they are; where rounding leaves no sleeve though there is a way, sides
are split, and at last the shortest path itself serves. `Way.by` says which it was.

Only what may matter is triangulated: an obstacle outside the ellipse about start and goal whose ways are as long as the
one that was found touches none that is as short.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from bug_gym.agents.planning.ants import Colony, aco, eaco, eaco_refined
from bug_gym.agents.planning.clustering import Cluster, cluster, default_threshold
from bug_gym.agents.planning.funnel import funnel
from bug_gym.agents.planning.growth import FACETS, TOUCHING, apart, frame, grow
from bug_gym.agents.planning.mesh import Mesh, component, edges_of, triangulate
from bug_gym.agents.planning.sleeve import Sleeve, find_sleeve, path_length
from bug_gym.geometry import F64, Point
from bug_gym.shortest_path import shortest_path

Optimiser = Literal["funnel", "eaco", "eaco_refined", "aco", "vertices"]
By = Literal["clusters", "obstacles", "split sides", "shortest path"]

FIRST_REACH = 1.1
"""Ways up to so many times the straight one are looked for first."""
REACH_GROWTH = 2.0
WALL = 2.0
"""Longest sides of the world's wall [m]: a longer one is no edge where obstacles stand near it, and the way between
them and the wall would be lost."""
SPLITS = (1.0, 0.5, 0.25)
"""Longest sides of all after splitting [m], one after the other."""
OUTSIDE = 1e-4
"""How far off a grown obstacle a point is put that lay in it [m]."""


@dataclass(frozen=True)
class Manner:
    """How to plan."""

    optimiser: Optimiser = "eaco"
    """How the way is pulled taut: "funnel" exactly; "eaco", "eaco_refined" and "aco" by ants; "vertices": not at all,
    Dijkstra along the edges of the triangulation."""
    margin: float = 0.05
    """What is kept off obstacles beside the robot's radius [m]."""
    threshold: float | None = None
    """Psi, gaps below it are closed [m]; None: a little over the robot's diameter."""
    use_clusters: bool = True
    """Whether to cluster."""
    samples: int = 0
    """Points sampled in free space; the paper has some, and the way is a little longer with them."""
    horizon: float = math.inf
    """D_s: what is farther from the robot is not looked at, and a goal beyond it is replaced [m]."""
    facets: int = FACETS
    """Sides of a grown corner, a quarter turn."""
    clip: bool = False
    """The paper's way to keep off: obstacles are not grown, and an edge is crossed no nearer to its ends than the radius and
    the margin; one too short for that is closed. It does not keep off: where two edges meet in a corner of an obstacle, the
    straight way between a crossing on each comes nearer to it, and so does one to a side that an edge meets at a slant."""
    colony: Colony = Colony()
    """Parameters of the ants."""


class Way(NamedTuple):
    """A way and how it was found."""

    path: F64
    """Way-points (k, 2), start and goal among them [m]."""
    length: float
    """[m]"""
    by: By
    """What it goes through: the clusters, the obstacles as they are, those with sides split; or the shortest path."""
    sleeve: Sleeve | None
    """What it was pulled taut in; None for the shortest path."""
    mesh: Mesh | None
    """Of what was looked at."""
    shapes: tuple[shapely.Polygon, ...]
    """What was kept off, grown, the border's wall among it."""
    margin: float
    """What is kept from obstacles beside the radius [m]."""


class Task(NamedTuple):
    """What is asked for."""

    obstacles: Sequence[shapely.Polygon]
    """(n,) polygons [m]."""
    border: F64
    """(k, 2) simple polygon around the world [m]."""
    start: Point
    """[m]"""
    goal: Point
    """[m]"""
    radius: float
    """Of the robot [m]."""
    movers: Sequence[shapely.Polygon] = ()
    """What moves, where it stands now (m,) [m]; it is kept off and not clustered."""
    body: float | None = None
    """Radius that is kept where the whole of it leaves no way [m]; None: the same."""
    goal_radius: float = 0.0
    """The way may end so far from the goal, where an obstacle is too near to it [m]."""


def find_way(task: Task, manner: Manner = Manner(), *, seed: int = 0) -> Way | None:  # noqa: B008 (it is frozen)
    """A way for a disc robot from start to goal, None where there is none.

    Args:
        task: the world, start and goal.
        manner: how to plan.
        seed: of the ants and the samples.

    Raises:
        ValueError: a margin or threshold that cannot be, or a world with no room for the robot.
    """
    for by, parts, side in _attempts(task, manner):
        found = _through(task, manner, parts, side, seed)
        if found is not None:
            return found._replace(by=by)
    return shortest_way(task, manner) if math.isinf(manner.horizon) else None


def clusters_of(task: Task, manner: Manner) -> list[Cluster]:
    """The clusters of a task's obstacles; no hull comes nearer to start and goal than the robot keeps off."""
    reach = task.radius + manner.margin
    threshold = default_threshold(task.radius, manner.margin) if manner.threshold is None else manner.threshold
    return cluster(task.obstacles, threshold, keep_out=(task.start, task.goal), room=reach)


def _attempts(task: Task, manner: Manner) -> list[tuple[By, list[shapely.Polygon], float]]:
    """What is to be kept off, and the longest sides [m]: the clusters at first, then the obstacles, then these split."""
    raw = list(task.obstacles)
    found: list[tuple[By, list[shapely.Polygon], float]] = []
    if manner.use_clusters and raw:
        found.append(("clusters", [part for one in clusters_of(task, manner) for part in one.parts], math.inf))
    found.append(("obstacles", raw, math.inf))
    if math.isinf(manner.horizon):
        found += [("split sides", raw, side) for side in SPLITS]
    return found


def _through(task: Task, manner: Manner, parts: Sequence[shapely.Polygon], side: float, seed: int) -> Way | None:
    """The way among some shapes with sides no longer than `side` [m], None where they leave none."""
    reach = 0.0 if manner.clip else task.radius + manner.margin
    array = np.array(parts, dtype=object)
    ends = shapely.points([task.start, task.goal])
    away = shapely.distance(array, ends[0])
    detour = away + shapely.distance(array, ends[1])
    straight = math.dist(task.start, task.goal)
    wall = shapely.segmentize(frame(task.border, reach), min(WALL, side))
    more = grow(task.movers, reach, manner.facets)
    seen = away <= manner.horizon + reach
    longest = FIRST_REACH * straight if math.isinf(manner.horizon) else math.inf
    while True:
        near = seen & (detour <= longest + 2.0 * reach)
        grown = [*grow(array[near], reach, manner.facets), *more]
        if math.isfinite(side):
            grown = list(shapely.segmentize(np.array(grown, dtype=object), side))
        found = _among(task, manner, apart([wall, *grown]), seed)
        if near.sum() == seen.sum() or (found is not None and found.length <= longest):
            return found
        longest = max(REACH_GROWTH * longest, found.length if found is not None else 0.0)


def _among(task: Task, manner: Manner, shapes: list[shapely.Polygon], seed: int) -> Way | None:
    """The way among grown shapes that do not touch."""
    tree = shapely.STRtree(shapes)
    start = _outside(tree, task.start)
    for goal in _goals(tree, task, manner):
        extra = np.concatenate([_samples(tree, task, manner, seed), [start, goal]])
        mesh = triangulate(shapes, extra)
        first, last = (int(vertex) for vertex in mesh.extra[-2:])
        sleeve = clipped_sleeve(mesh, first, last, task, manner) if manner.clip else find_sleeve(mesh, first, last)
        if sleeve is None:
            continue
        way = _vertex_way(mesh, shapes, first, last) if manner.optimiser == "vertices" else _taut(sleeve, manner, seed)
        if way is not None:
            path = _joined(np.array(task.start), way)
            return Way(path, path_length(path), "obstacles", sleeve, mesh, tuple(shapes), manner.margin)
    return None


def clipped_sleeve(mesh: Mesh, first: int, last: int, task: Task, manner: Manner) -> Sleeve | None:
    """The sleeve between two vertices whose edges have lost what is too near to their ends; None where none is left."""
    kept_off = task.radius + manner.margin
    one, other = (mesh.points[mesh.corners[:, order]] for order in ([1, 2, 0], [2, 0, 1]))
    is_short = np.hypot(*np.moveaxis(other - one, -1, 0)) <= 2.0 * kept_off
    sleeve = find_sleeve(mesh._replace(neighbours=np.where(is_short, np.int32(-1), mesh.neighbours)), first, last)
    if sleeve is None:
        return None
    across = sleeve.right - sleeve.left
    cut = across * (kept_off / np.hypot(*across.T))[:, None]
    return sleeve._replace(left=sleeve.left + cut, right=sleeve.right - cut)


def _outside(tree: shapely.STRtree, point: Point) -> F64:
    """The point, or where it lies in a shape the nearest one that lies in none."""
    place = shapely.Point(point)
    inside = tree.query(place, predicate="intersects")
    if not len(inside):
        return np.array(point)
    shape = tree.geometries[inside[0]]
    edge = shapely.get_coordinates(shapely.shortest_line(place, shapely.get_rings(shape)))
    lengths = np.hypot(*(edge[1::2] - edge[::2]).T)
    out = edge[2 * int(lengths.argmin()) + 1]
    away = out - np.array(point)
    size = float(np.hypot(*away))
    for direction in [away / size] if size > 0.0 else []:
        if not len(tree.query(shapely.Point(out + OUTSIDE * direction), predicate="intersects")):
            return np.asarray(out + OUTSIDE * direction)
    return np.asarray(out)


def _goals(tree: shapely.STRtree, task: Task, manner: Manner) -> list[F64]:
    """Where the way is to end: at the goal, or on the horizon, the points nearest to the goal first."""
    goal, start = np.array(task.goal), np.array(task.start)
    if math.dist(task.start, task.goal) <= manner.horizon:
        place = _outside(tree, task.goal)
        return [place] if math.dist(place, task.goal) <= task.goal_radius else []
    toward = math.atan2(goal[1] - start[1], goal[0] - start[0])
    turns = np.pi * np.arange(HORIZON_POINTS) / HORIZON_POINTS
    angles = toward + np.stack([turns, -turns], axis=1).ravel()[1:]
    places = start + manner.horizon * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    taken = tree.query(shapely.points(places), predicate="intersects")[0]
    return [place for number, place in enumerate(places) if number not in set(taken.tolist())]


HORIZON_POINTS = 16
"""Half as many points on the horizon are tried."""


def _samples(tree: shapely.STRtree, task: Task, manner: Manner, seed: int) -> F64:
    """Points sampled evenly in free space (m, 2), within the horizon or the world; those in a shape are left out."""
    if manner.samples == 0:
        return np.empty((0, 2))
    generator = np.random.default_rng([seed, manner.samples])
    if math.isinf(manner.horizon):
        low, high = task.border.min(axis=0), task.border.max(axis=0)
        places = generator.uniform(low, high, (manner.samples, 2))
    else:
        angle = generator.uniform(0.0, 2.0 * np.pi, manner.samples)
        away = manner.horizon * np.sqrt(generator.random(manner.samples))
        places = np.array(task.start) + away[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    taken = np.zeros(len(places), dtype=bool)
    taken[tree.query(shapely.points(places), predicate="intersects")[0]] = True
    return np.asarray(places[~taken])


def _taut(sleeve: Sleeve, manner: Manner, seed: int) -> F64:
    """The way within a sleeve."""
    if manner.optimiser == "funnel":
        return funnel(sleeve)
    if manner.optimiser == "eaco_refined":
        found = eaco_refined(sleeve, manner.colony, seed=seed)
    else:
        found = (aco if manner.optimiser == "aco" else eaco)(sleeve, manner.colony, seed=seed)
    return sleeve.crossings(found.gamma)


def _vertex_way(mesh: Mesh, shapes: Sequence[shapely.Polygon], start: int, goal: int) -> F64 | None:
    """Dijkstra's shortest way along the free edges of a mesh (the paper's graph search on G_cdt)."""
    edges, free = edges_of(mesh, shapes)
    edges = edges[free]
    lengths = np.hypot(*(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]]).T)
    graph = coo_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(mesh.points), len(mesh.points))).tocsr()
    cost, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    if not np.isfinite(cost[goal]):
        return None
    trail = [goal]
    while trail[-1] != start:
        trail.append(int(before[trail[-1]]))
    return np.asarray(mesh.points[trail[::-1]])


def _joined(start: F64, way: F64) -> F64:
    """The way from a point that may lie a little beside its first one."""
    return way if np.allclose(start, way[0], rtol=0.0, atol=1e-12) else np.concatenate([start[None], way])


def shortest_way(task: Task, manner: Manner) -> Way | None:
    """The shortest path itself, with less of the margin where that leaves none; None where there is none at all."""
    obstacles = [*task.obstacles, *task.movers]
    rings = [[ring.coords[:-1] for ring in (one.exterior, *one.interiors)] for one in obstacles]
    body = task.radius if task.body is None else task.body
    rooms = [(task.radius, manner.margin), (task.radius, TOUCHING * manner.margin), (body, TOUCHING * manner.margin)]
    for radius, margin in [*((own + kept, kept) for own, kept in rooms), (body, 0.0)]:
        shapes = apart([frame(task.border, radius), *grow(obstacles, radius)])
        tree = shapely.STRtree(shapes)
        start, goal = _outside(tree, task.start), _outside(tree, task.goal)
        if math.dist(goal, task.goal) > task.goal_radius:
            continue
        found = shortest_path([], rings, task.border, start, goal, radius=radius)
        if math.isfinite(found.length):
            path = _joined(np.array(task.start), found.points)
            return Way(path, path_length(path), "shortest path", None, None, tuple(shapes), margin)
    return None


def graph_size(mesh: Mesh, shapes: Sequence[shapely.Polygon], vertex: int) -> tuple[int, int]:
    """Nodes and edges of the component of the free graph that holds a vertex (the paper's G_cdt)."""
    edges, free = edges_of(mesh, shapes)
    kept = edges[free]
    kept = kept[component(kept, len(mesh.points), vertex)]
    return len(np.unique(kept)), len(kept)
