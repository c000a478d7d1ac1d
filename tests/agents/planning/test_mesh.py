"""The constrained triangulation and its sleeves, against slow and plain counterparts."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest
import shapely

from bug_gym.agents.planning.funnel import funnel, funnel_length
from bug_gym.agents.planning.growth import apart, frame, grow
from bug_gym.agents.planning.mesh import Mesh, edges_of, triangulate
from bug_gym.agents.planning.sleeve import POINTS, Sleeve, find_sleeve, path_length
from bug_gym.agents.planning.triangulated import Manner, Task, find_way
from bug_gym.geometry import F64
from bug_gym.reproductions import d2t_worlds
from bug_gym.shortest_path import shortest_path

TOUCH = 1e-6


def shapes_of(seed: int, obstacles: int = 30, facets: int = 2) -> tuple[Task, list[shapely.Polygon]]:
    """A field, and its grown obstacles within the wall, overlapping ones united (so some are hollow)."""
    task = d2t_worlds.field(seed, obstacles, 20.0, 12.0)
    return task, apart([frame(task.border, 0.3), *grow(task.obstacles, 0.3, facets)])


def mesh_of(seed: int, **more: int) -> tuple[Mesh, list[shapely.Polygon]]:
    task, shapes = shapes_of(seed, **more)
    free = [
        place for place in (task.start, task.goal) if not shapely.union_all(shapes).intersects(shapely.Point(place))
    ]
    return triangulate(shapes, np.array(free).reshape(-1, 2)), shapes


def left_of(a: F64, b: F64, c: F64) -> F64:
    """Above 0 where points c lie left of the ways from a to b."""
    u, v = (b - a).T, (c - a).T
    return np.asarray(u[0] * v[1] - u[1] * v[0])


@pytest.mark.parametrize("seed", range(8))
def test_free_triangles_and_edges_are_those_that_share_nothing_with_an_obstacle(seed: int) -> None:
    mesh, shapes = mesh_of(seed)
    solid = shapely.buffer(shapely.union_all(shapes), -TOUCH)
    triangles = shapely.polygons(mesh.points[mesh.corners])
    np.testing.assert_array_equal(mesh.free, ~shapely.intersects(triangles, solid))
    edges, free = edges_of(mesh, shapes)
    lines = shapely.linestrings(mesh.points[edges])
    np.testing.assert_array_equal(free, ~shapely.intersects(lines, solid))
    assert 0 < mesh.free.sum() < len(mesh.free) and not free.all()


def test_triangles_run_counter_clockwise_and_know_their_neighbours() -> None:
    mesh, _ = mesh_of(1)
    a, b, c = (mesh.points[mesh.corners[:, i]] for i in range(3))
    assert (left_of(a, b, c) > 0.0).all()
    for triangle, around in enumerate(mesh.neighbours):
        for edge, other in enumerate(around):
            if other >= 0:
                assert set(np.delete(mesh.corners[triangle], edge)) <= set(mesh.corners[other])


def test_obstacles_on_a_lattice_with_sides_in_a_row_are_no_trouble() -> None:
    shapes = [d2t_worlds.block(float(x), float(y), 1.0, 1.0) for x in range(0, 12, 2) for y in range(0, 12, 2)]
    mesh = triangulate(shapes, np.array([[1.5, 1.5], [9.5, 9.5]]))
    solid = shapely.buffer(shapely.union_all(shapes), -TOUCH)
    np.testing.assert_array_equal(mesh.free, ~shapely.intersects(shapely.polygons(mesh.points[mesh.corners]), solid))


def plain_sleeve_cost(mesh: Mesh, start: int, goal: int) -> float:
    """Dijkstra over five points on each edge between free triangles, written for reading."""
    shares = np.linspace(0.0, 1.0, POINTS)[:, None]
    around = np.flatnonzero((mesh.corners == start).any(axis=1) & mesh.free)
    queue = [(0.0, number, int(t), mesh.points[start]) for number, t in enumerate(around)]
    heapq.heapify(queue)
    done: set[tuple[int, tuple[float, ...]]] = set()
    number = len(queue)
    while queue:
        cost, _, triangle, place = heapq.heappop(queue)
        if triangle < 0:
            return cost
        key = (triangle, tuple(np.round(place, 9)))
        if key in done:
            continue
        done.add(key)
        if goal in mesh.corners[triangle]:
            number += 1
            heapq.heappush(queue, (cost + math.dist(place, mesh.points[goal]), number, -1, mesh.points[goal]))
        for edge in range(3):
            beyond = int(mesh.neighbours[triangle, edge])
            if beyond >= 0 and mesh.free[beyond]:
                a, b = mesh.points[np.delete(mesh.corners[triangle], edge)]
                for point in a + shares * (b - a):
                    number += 1
                    heapq.heappush(queue, (cost + math.dist(place, point), number, beyond, point))
    return math.inf


def chain_cost(sleeve: Sleeve) -> float:
    """The shortest chain over five points on each edge of a sleeve."""
    shares = np.linspace(0.0, 1.0, POINTS)[:, None]
    at, cost = sleeve.start[None], np.zeros(1)
    for a, b in zip(sleeve.left, sleeve.right, strict=True):
        options = a + shares * (b - a)
        cost = (cost[:, None] + np.hypot(*np.moveaxis(at[:, None] - options, -1, 0))).min(axis=0)
        at = options
    return float((cost + np.hypot(*(at - sleeve.goal).T)).min())


@pytest.mark.parametrize("seed", range(4))
def test_the_sleeve_is_that_of_the_shortest_chain_over_five_points(seed: int) -> None:
    task, shapes = shapes_of(seed, obstacles=14)
    mesh = triangulate(shapes, np.array([task.start, task.goal]))
    start, goal = mesh.extra.tolist()
    sleeve = find_sleeve(mesh, start, goal)
    assert sleeve is not None and mesh.free[sleeve.triangles].all()
    assert chain_cost(sleeve) == pytest.approx(plain_sleeve_cost(mesh, start, goal), abs=1e-6)
    # each triangle borders on the next, by the edge that is crossed, its left end on the left
    chain = sleeve.triangles
    for one, other, left, right in zip(chain[:-1], chain[1:], sleeve.left, sleeve.right, strict=True):
        assert other in mesh.neighbours[one]
        middle = mesh.points[mesh.corners[one]].mean(axis=0)
        assert left_of(right, left, middle) > 0.0


def one_portal() -> Sleeve:
    ends = np.array([[5.0, 6.0]]), np.array([[5.0, 2.0]])
    return Sleeve(np.zeros(2), np.array([10.0, 0.0]), *ends, np.array([0, 1]))


def two_portals() -> Sleeve:
    left, right = np.array([[3.0, 5.0], [7.0, -1.0]]), np.array([[3.0, 1.0], [7.0, -5.0]])
    return Sleeve(np.zeros(2), np.array([10.0, 0.0]), left, right, np.array([0, 1, 2]))


def test_the_funnel_solves_the_worked_examples() -> None:
    assert funnel_length(one_portal()) == pytest.approx(2.0 * math.sqrt(29.0), abs=1e-12)
    assert funnel_length(one_portal()) == pytest.approx(10.7703, abs=1e-4)
    assert funnel_length(two_portals()) == pytest.approx(math.sqrt(10.0) + math.sqrt(20.0) + math.sqrt(10.0), abs=1e-12)
    assert funnel_length(two_portals()) == pytest.approx(10.7967, abs=1e-4)
    np.testing.assert_allclose(funnel(two_portals()), [[0, 0], [3, 1], [7, -1], [10, 0]])


def shares_met(sleeve: Sleeve, way: shapely.LineString) -> F64:
    """Where a way meets the edges of a sleeve, each as a share of the edge from left to right (n,)."""
    shares = []
    for left, right in zip(sleeve.left, sleeve.right, strict=True):
        edge = shapely.LineString([left, right])
        on_edge = shapely.get_point(shapely.shortest_line(edge, way), 0)
        shares.append(edge.project(on_edge, normalized=True))
    return np.array(shares)


@pytest.mark.parametrize("seed", range(6))
def test_no_way_through_a_sleeve_is_shorter_than_the_funnels(seed: int) -> None:
    task = d2t_worlds.field(seed, 40)
    found = find_way(task, Manner("funnel", facets=1))
    assert found is not None and found.sleeve is not None
    sleeve, shortest = found.sleeve, funnel_length(found.sleeve)
    gamma = shares_met(sleeve, shapely.LineString(funnel(sleeve)))
    assert path_length(sleeve.crossings(gamma)) == pytest.approx(shortest, abs=1e-6)
    generator = np.random.default_rng(seed)
    for scale in (1e-3, 1e-2, 0.1, 1.0):
        for _ in range(50):
            other = np.clip(gamma + scale * generator.normal(size=len(gamma)), 0.0, 1.0)
            assert path_length(sleeve.crossings(other)) >= shortest - 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_a_way_keeps_off_obstacles_and_is_hardly_longer_than_the_shortest(seed: int) -> None:
    task = d2t_worlds.field(seed, 10 + 5 * seed)
    found = find_way(task, Manner("funnel"))
    assert found is not None
    line = shapely.LineString(found.path)
    assert min(line.distance(shape) for shape in task.obstacles) >= 0.3 - 1e-9
    rings = [[shapely.get_coordinates(shape)[:-1]] for shape in task.obstacles]
    best = shortest_path([], rings, task.border, task.start, task.goal, radius=0.3).length
    assert best - 1e-6 <= found.length <= 1.04 * best


def test_a_triangle_between_a_side_that_is_no_edge_is_not_free() -> None:
    # A long side with a point close to its middle: it is no edge of the triangulation, which would cross it.
    wall, thing = shapely.box(0.0, 0.0, 10.0, 0.5), shapely.box(4.9, 0.6, 5.1, 0.8)
    mesh = triangulate([wall, thing], np.array([[5.0, -1.0]]))
    assert mesh.crossed.any()
    solid = shapely.buffer(shapely.union_all([wall, thing]), -TOUCH)
    np.testing.assert_array_equal(mesh.free, ~shapely.intersects(shapely.polygons(mesh.points[mesh.corners]), solid))


@pytest.mark.parametrize("facets", [1, 2, 8])
def test_grown_shapes_hold_all_that_is_nearer_than_the_reach(facets: int) -> None:
    generator = np.random.default_rng(facets)
    shapes = [d2t_worlds.convex_shape(generator, (3.0 * i, 0.0), 1.0) for i in range(20)]
    shapes.append(shapely.Polygon([(0, 5), (6, 5), (6, 9), (5, 9), (5, 6), (1, 6), (1, 9), (0, 9)]))
    for shape, grown in zip(shapes, grow(shapes, 0.3, facets), strict=True):
        exact = shape.buffer(0.3, quad_segs=200)
        assert exact.difference(grown).area < 1e-5
        most = 0.3 / math.cos(0.375 * math.pi / facets) + 1e-6
        assert grown.difference(shape.buffer(most, quad_segs=200)).area < 1e-5


def test_a_world_with_no_room_is_refused() -> None:
    with pytest.raises(ValueError, match="no one room"):
        frame(np.array(d2t_worlds.rectangle(0.5, 5.0)), 0.3)
    with pytest.raises(ValueError, match="needs 3 points, got 2"):
        triangulate([], np.array([[0.0, 0.0], [1.0, 0.0]]))
