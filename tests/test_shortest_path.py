"""The shortest path against closed forms, laws of distance, and an exact graph of tangents and arcs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra, minimum_spanning_tree

from bug_gym.shortest_path import Path, free_space, reachable, shortest_path

Array = NDArray[np.float64]
Rings = Sequence[ArrayLike]
World = tuple[Array, list[Rings], Array]

NEAREST = 0.99  # the share of the radius that the module promises to keep
SMALL = 1e-6  # the grid of the free space [m], and rounding
NO_CIRCLES = np.empty((0, 3))


def box(x0: float, y0: float, x1: float, y1: float) -> Array:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float)


ROOM = box(-5.0, -12.0, 30.0, 12.0)
SLAB: list[Rings] = [[box(8.0, -3.0, 12.0, 5.0)]]
U_TRAP: list[Rings] = [[[(5, -4), (12, -4), (12, 4), (5, 4), (5, 3), (11, 3), (11, -3), (5, -3)]]]
RING: list[Rings] = [[box(6.0, -4.0, 14.0, 4.0), box(6.5, -3.5, 13.5, 3.5)]]


def random_world(seed: int) -> tuple[World, float]:
    """Draw circles and star-shaped polygons, some with a hole, overlapping as they come; and a robot's radius."""
    rng = np.random.default_rng(seed)
    side = rng.uniform(5.0, 9.0)
    border = box(0.0, 0.0, side, side)
    if seed % 3 == 0:
        border = side * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.45, 1.0), (0.5, 0.6), (0.0, 0.6)])
    count = rng.integers(2, 7)
    circles = np.column_stack([rng.uniform(0.0, side, (count, 2)), rng.uniform(0.05, 1.0, count)])
    polygons: list[Rings] = []
    for _ in range(rng.integers(2, 6)):
        corners = rng.integers(3, 9)
        angle = (np.arange(corners) + rng.uniform(-0.3, 0.3, corners)) * 2.0 * np.pi / corners
        star = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.3, 1.5, (corners, 1))
        centre = rng.uniform(0.0, side, 2)
        polygons.append([centre + star, centre + 0.7 * star] if rng.random() < 0.3 else [centre + star])
    return (circles, polygons, border), float(rng.choice([0.05, 0.2, 0.35]))


def free_points(world: World, radius: float, count: int, rng: np.random.Generator) -> Array:
    """Draw points at which the robot fits."""
    low, high = world[2].min(axis=0), world[2].max(axis=0)
    points: list[Array] = []
    while len(points) < count:
        point = rng.uniform(low, high)
        if clear(world, radius, shapely.points([point]))[0]:
            points.append(point)
    return np.array(points)


def clear(world: World, radius: float, shapes: NDArray[np.object_]) -> NDArray[np.bool_]:
    """Tell which points or lines keep `radius` to everything, by their distances to the obstacles as they are."""
    circles, polygons, border = world
    solid = shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in polygons] + [shapely.LinearRing(border)])
    free = (shapely.distance(shapes, solid) >= radius - 1e-9) & shapely.within(shapes, shapely.Polygon(border))
    gap = shapely.distance(shapes[:, None], shapely.points(circles[:, :2])) - circles[:, 2]
    return np.asarray(free & (gap >= radius - 1e-9).all(axis=1))


# ---- the oracle: Dijkstra over all common tangents of the true circles around obstacles and corners, and their arcs


def exact_length(world: World, start: Array, goal: Array, radius: float) -> float:
    circles, polygons, border = world
    walls = [np.asarray(ring, dtype=float) for rings in polygons for ring in rings] + [border]
    corners = np.concatenate(walls)
    centre = np.concatenate([[start, goal], circles[:, :2], corners])
    rim = np.concatenate([[0.0, 0.0], circles[:, 2] + radius, np.full(len(corners), radius)])
    owner, touch = tangents(centre, rim)
    free = clear(world, radius, shapely.linestrings(touch))
    owner, touch = owner[free], touch[free]
    links = [np.column_stack([np.arange(len(touch)), np.arange(len(touch)) + len(touch)])]
    weights = [np.hypot(*(touch[:, 1] - touch[:, 0]).T)]
    owner, place = owner.T.ravel(), np.concatenate([touch[:, 0], touch[:, 1]])
    nodes = len(place)
    edges = np.concatenate([np.stack([wall, np.roll(wall, -1, axis=0)], axis=1) for wall in walls])
    for disc in np.unique(owner):
        own = np.flatnonzero(owner == disc)
        angle = np.arctan2(*(place[own] - centre[disc]).T[::-1])
        if disc >= 2:
            breaks = crossings(disc, centre, rim, edges, radius)
            own = np.concatenate([own, nodes + np.arange(len(breaks))])
            angle = np.concatenate([angle, breaks]) % (2.0 * np.pi)
            nodes += len(breaks)
        order = np.argsort(angle)
        width = np.diff(angle[order], append=angle[order][0] + 2.0 * np.pi) if disc >= 2 else np.zeros(len(own))
        middle = angle[order] + width / 2.0
        arc = centre[disc] + rim[disc] * np.column_stack([np.cos(middle), np.sin(middle)])
        free = clear(world, radius, shapely.points(arc)) | (width < 1e-9)
        links.append(np.column_stack([own[order], np.roll(own[order], -1)])[free])
        weights.append(rim[disc] * width[free])
    link, weight = np.concatenate(links), np.concatenate(weights) + 1e-12  # a weight of zero would be no link
    graph = coo_array((weight, link.T), shape=(nodes, nodes)).tocsr()
    ends = [np.flatnonzero(owner == point) for point in (0, 1)]
    if not len(ends[0]) or not len(ends[1]):
        return math.inf
    return float(dijkstra(graph, directed=False, indices=ends[0][0])[ends[1][0]])


def tangents(centre: Array, rim: Array) -> tuple[NDArray[np.int64], Array]:
    """Return (m, 2) pairs of discs and (m, 2, 2) the points where a common tangent touches them."""
    i, j = np.triu_indices(len(centre), 1)
    signs = np.array([(a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    pair = np.repeat(np.column_stack([i, j]), 4, axis=0)
    reach = np.tile(signs, (len(i), 1)) * rim[pair]
    along = centre[pair[:, 1]] - centre[pair[:, 0]]
    distance = np.hypot(*along.T)
    exists = (distance > 1e-9) & (np.abs(reach[:, 0] - reach[:, 1]) <= distance)
    pair, reach, along, distance = pair[exists], reach[exists], along[exists], distance[exists]
    along = along / distance[:, None]
    cosine = (reach[:, 0] - reach[:, 1]) / distance
    across = np.column_stack([-along[:, 1], along[:, 0]])
    normal = cosine[:, None] * along + np.sqrt(1.0 - cosine**2)[:, None] * across
    return pair, centre[pair] + reach[:, :, None] * normal[:, None, :]


def crossings(disc: int, centre: Array, rim: Array, edges: Array, radius: float) -> Array:
    """Return the angles at which a circle meets the other circles and the walls moved out by the radius."""
    away = centre[2:] - centre[disc]
    distance = np.hypot(*away.T)
    meets = (np.abs(rim[disc] - rim[2:]) < distance) & (distance < rim[disc] + rim[2:])
    away, distance, other = away[meets], distance[meets], rim[2:][meets]
    half = np.arccos((rim[disc] ** 2 + distance**2 - other**2) / (2.0 * rim[disc] * distance))
    toward = np.arctan2(away[:, 1], away[:, 0])
    angles = [toward - half, toward + half]
    line = edges[:, 1] - edges[:, 0]
    normal = np.column_stack([-line[:, 1], line[:, 0]]) / np.hypot(*line.T)[:, None]
    for offset in (-radius, radius):
        height = ((edges[:, 0] - centre[disc]) * normal).sum(axis=1) + offset
        meets = np.abs(height) < rim[disc]
        half = np.arccos(height[meets] / rim[disc])
        toward = np.arctan2(normal[meets, 1], normal[meets, 0])
        angles += [toward - half, toward + half]
    return np.concatenate(angles)


@pytest.mark.parametrize("seed", range(40))
def test_the_length_in_a_random_world_is_within_one_percent_of_the_exact_one(seed: int) -> None:
    world, radius = random_world(seed)
    start, goal = free_points(world, radius, 2, np.random.default_rng(seed))
    path = shortest_path(*world, start, goal, radius=radius)
    exact = exact_length(world, start, goal, radius)
    assert path.length == exact or abs(path.length - exact) < 0.01 * exact
    assert exact_length(world, start, goal, NEAREST * radius) - SMALL <= path.length <= exact + SMALL


def test_the_random_worlds_hold_bent_and_straight_and_missing_paths() -> None:
    kinds = set()
    for seed in range(40):
        world, radius = random_world(seed)
        start, goal = free_points(world, radius, 2, np.random.default_rng(seed))
        kinds.add(min(len(shortest_path(*world, start, goal, radius=radius).points), 3))
    assert kinds == {0, 2, 3}


@pytest.mark.parametrize("seed", range(30))
def test_for_a_point_among_polygons_the_length_is_that_of_the_visibility_graph(seed: int) -> None:
    (_, polygons, border), _ = random_world(seed)
    world = NO_CIRCLES, polygons, border
    start, goal = free_points(world, 0.01, 2, np.random.default_rng(seed))
    path = shortest_path(*world, start, goal, radius=0.0)
    assert path.length == pytest.approx(visibility_graph_length(world, start, goal), abs=10 * SMALL)


def visibility_graph_length(world: World, start: Array, goal: Array) -> float:
    _, polygons, border = world
    solid = shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in polygons])
    free = shapely.buffer(
        shapely.difference(shapely.Polygon(border), solid), SMALL
    )  # so that sight along a wall is free
    nodes = np.concatenate([[start, goal], *[np.asarray(ring) for rings in polygons for ring in rings], border])
    i, j = np.triu_indices(len(nodes), 1)
    seen = shapely.covers(free, shapely.linestrings(np.stack([nodes[i], nodes[j]], axis=1)))
    weight = np.hypot(*(nodes[i] - nodes[j]).T)[seen]
    graph = coo_array((weight, (i[seen], j[seen])), shape=(len(nodes), len(nodes))).tocsr()
    return float(dijkstra(graph, directed=False, indices=0)[1])


# ---- closed forms


def around_a_disc(clearance: float) -> float:
    """A disc of radius 3 half-way between two points 20 m apart: two tangents and an arc."""
    rim = 3.0 + clearance
    return 2.0 * math.sqrt(10.0**2 - rim**2) + rim * (math.pi - 2.0 * math.acos(rim / 10.0))


def around_corners(first: tuple[float, float], second: tuple[float, float], clearance: float) -> float:
    """From (0, 0) around two corners of one horizontal wall, both above the line, to (20, 0)."""
    (x0, y0), (x1, y1) = first, second
    total = x1 - x0
    for x, y in ((x0, y0), (20.0 - x1, y1)):
        slope = math.atan2(y, x) + math.asin(clearance / math.hypot(x, y))
        total += math.sqrt(x * x + y * y - clearance**2) + clearance * slope
    return total


CLOSED_FORMS: dict[str, tuple[Array, list[Rings], Callable[[float], float]]] = {
    "disc": (np.array([(10.0, 0.0, 3.0)]), [], around_a_disc),
    "slab": (NO_CIRCLES, SLAB, lambda c: around_corners((8.0, 3.0), (12.0, 3.0), c)),
    "u_trap": (NO_CIRCLES, U_TRAP, lambda c: around_corners((5.0, 4.0), (12.0, 4.0), c)),
}


@pytest.mark.parametrize("radius", [0.05, 0.5, 1.5])
@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_the_length_is_that_of_the_closed_form(name: str, radius: float) -> None:
    circles, polygons, closed_form = CLOSED_FORMS[name]
    length = shortest_path(circles, polygons, ROOM, (0.0, 0.0), (20.0, 0.0), radius=radius).length
    assert closed_form(NEAREST * radius) - SMALL <= length <= closed_form(radius) + SMALL


def test_the_closed_forms_are_those_of_the_literature() -> None:
    lengths = [round(closed_form(0.5), 3) for _, _, closed_form in CLOSED_FORMS.values()]
    assert lengths == [21.238, 21.476, 22.950]


def test_a_path_around_a_hollow_of_the_border_bends_around_its_corner() -> None:
    border = np.array([(0, 0), (10, 0), (10, 10), (5, 10), (5, 5), (0, 5)], dtype=float)
    length = shortest_path(NO_CIRCLES, [], border, (1.0, 4.0), (6.0, 9.0), radius=0.5).length

    def by_hand(clearance: float) -> float:
        tangent = math.sqrt(17.0 - clearance**2)
        turn = math.pi / 2.0 - 2.0 * (math.atan2(1.0, 4.0) - math.asin(clearance / math.sqrt(17.0)))
        return 2.0 * tangent + clearance * turn

    assert by_hand(0.5 * NEAREST) - SMALL <= length <= by_hand(0.5) + SMALL


def test_an_empty_room_is_crossed_straight() -> None:
    path = shortest_path(NO_CIRCLES, [], ROOM, (0.0, 0.0), (3.0, 4.0), radius=0.5)
    assert path.length == pytest.approx(5.0)
    assert path.points.tolist() == [[0.0, 0.0], [3.0, 4.0]]


def test_a_path_to_where_one_stands_is_zero_long() -> None:
    assert shortest_path(NO_CIRCLES, SLAB, ROOM, (0.0, 0.0), (0.0, 0.0), radius=0.5).length == 0.0


def test_what_stands_far_from_the_straight_line_is_in_the_way_of_a_long_detour() -> None:
    wall: Rings = [box(4.0, -9.0, 6.0, 6.0)]
    longer: Rings = [box(4.0, 6.0, 6.0, 11.0)]
    apart: Rings = [box(-2.0, -11.0, -1.0, 11.0)]
    over, under = (2.0 * math.hypot(4.0, end) + 2.0 for end in (6.0, 9.0))
    for polygons, length in (([wall], over), ([wall, apart], over), ([wall, longer], under)):
        path = shortest_path(NO_CIRCLES, polygons, ROOM, (0.0, 0.0), (10.0, 0.0), radius=0.0)
        assert path.length == pytest.approx(length, abs=SMALL)


def test_a_point_robot_walks_half_around_a_circle_from_its_rim() -> None:
    length = shortest_path([(5.0, 5.0, 1.0)], [], box(0.0, 0.0, 10.0, 10.0), (4.0, 5.0), (6.0, 5.0), radius=0.0).length
    assert length == pytest.approx(math.pi, rel=1e-4)


# ---- laws


def field(seed: int, obstacles: int, side: float) -> World:
    """Half circles, half squares turned at random, 25 % of the area if none overlapped."""
    rng = np.random.default_rng(seed)
    size = math.sqrt(0.25 * side * side / obstacles / math.pi)
    circles = np.column_stack([rng.uniform(0.0, side, (obstacles // 2, 2)), np.full(obstacles // 2, size)])
    angle = rng.uniform(0.0, np.pi, (obstacles - obstacles // 2, 1)) + np.arange(4) * np.pi / 2.0
    centre = rng.uniform(0.0, side, (len(angle), 1, 2))
    squares = centre + size * math.sqrt(math.pi / 2.0) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return circles, [[square] for square in squares], box(0.0, 0.0, side, side)


def field_path(world: World, radius: float, seed: int) -> Path:
    """Return a path between two free points, the first pair of the seed that can reach each other."""
    rng = np.random.default_rng(seed)
    while True:
        start, goal = free_points(world, radius, 2, rng)
        path = shortest_path(*world, start, goal, radius=radius)
        if len(path.points) > 4:
            return path


@pytest.mark.parametrize("obstacles", [20, 100, 600])
def test_there_and_back_are_equally_long(obstacles: int) -> None:
    world = field(obstacles, obstacles, 2.9 * math.sqrt(obstacles))
    path = field_path(world, 0.2, seed=1)
    back = shortest_path(*world, path.points[-1], path.points[0], radius=0.2)
    assert back.length == pytest.approx(path.length, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_no_detour_over_a_third_point_is_shorter(seed: int) -> None:
    world = field(seed, 30, 15.0)
    a, b, c = free_points(world, 0.2, 3, np.random.default_rng(seed))
    direct = shortest_path(*world, a, c, radius=0.2).length
    first, second = (shortest_path(*world, p, q, radius=0.2).length for p, q in ((a, b), (b, c)))
    assert direct <= first + second + SMALL


@pytest.mark.parametrize("seed", range(5))
def test_a_way_point_splits_a_path_into_shortest_paths(seed: int) -> None:
    world = field(seed, 100, 29.0)
    path = field_path(world, 0.2, seed)
    middle = path.points[len(path.points) // 2]
    parts = [shortest_path(*world, end, middle, radius=0.2).length for end in (path.points[0], path.points[-1])]
    assert sum(parts) == pytest.approx(path.length, abs=SMALL)


@pytest.mark.parametrize("seed", range(5))
def test_a_wider_robot_never_has_a_shorter_path(seed: int) -> None:
    world = field(seed, 30, 15.0)
    start, goal = free_points(world, 0.45, 2, np.random.default_rng(seed))
    lengths = [shortest_path(*world, start, goal, radius=r).length for r in (0.0, 0.1, 0.2, 0.3, 0.45)]
    assert lengths == sorted(lengths)
    assert lengths[0] >= math.dist(start, goal) - SMALL


@pytest.mark.parametrize("obstacles", [20, 100, 600])
def test_the_points_of_a_path_keep_clear_and_add_up_to_its_length(obstacles: int) -> None:
    world = field(obstacles, obstacles, 2.9 * math.sqrt(obstacles))
    path = field_path(world, 0.2, seed=2)
    legs = shapely.linestrings(np.stack([path.points[:-1], path.points[1:]], axis=1))
    assert clear(world, NEAREST * 0.2, legs).all()
    assert shapely.length(legs).sum() == pytest.approx(path.length)


def test_a_turned_and_shifted_world_has_the_same_length() -> None:
    circles, polygons, border = world = field(3, 60, 22.0)
    path = field_path(world, 0.2, seed=3)
    turn = np.array([(math.cos(1.0), math.sin(1.0)), (-math.sin(1.0), math.cos(1.0))])

    def moved(points: ArrayLike) -> Array:
        return np.asarray(np.asarray(points) @ turn + (100.0, -300.0))

    turned = np.column_stack([moved(circles[:, :2]), circles[:, 2]]), [[moved(r) for r in p] for p in polygons]
    start, goal = moved(path.points[[0, -1]])
    assert shortest_path(*turned, moved(border), start, goal, radius=0.2).length == pytest.approx(path.length, rel=1e-3)


def test_the_orientation_of_a_ring_does_not_matter() -> None:
    lengths = {
        round(shortest_path(NO_CIRCLES, [[slab]], border, (0.0, 0.0), (20.0, 0.0), radius=0.5).length, 9)
        for slab in (box(8.0, -3.0, 12.0, 5.0), box(8.0, -3.0, 12.0, 5.0)[::-1])
        for border in (ROOM, ROOM[::-1])
    }
    assert len(lengths) == 1


@pytest.mark.parametrize("seed", range(10))
def test_the_free_space_ends_between_099_and_1_radii_from_the_obstacles(seed: int) -> None:
    world, radius = random_world(seed)
    rings = shapely.get_rings(shapely.get_parts(free_space(*world, radius=radius)))
    points = shapely.points(shapely.get_coordinates(shapely.segmentize(rings, 0.01)))
    circles, polygons, border = world
    solid = [shapely.Polygon(p[0], p[1:]) for p in polygons] + [shapely.LinearRing(border)]
    distance = shapely.distance(points, shapely.union_all(solid))
    to_circle = (shapely.distance(points[:, None], shapely.points(circles[:, :2])) - circles[:, 2]).min(axis=1)
    nearest = np.minimum(distance, to_circle)
    assert nearest.min() >= NEAREST * radius - SMALL
    assert nearest.max() <= radius + SMALL


# ---- reachability


def maze(cells: int, seed: int) -> tuple[list[Rings], NDArray[np.int64]]:
    """Draw a maze, a spanning tree of cells 1 m wide; return its walls, 0.2 m thick, and the cells of the only way."""
    number = np.arange(cells * cells).reshape(cells, cells)
    beside = np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()])
    above = np.column_stack([number[:-1].ravel(), number[1:].ravel()])
    doors = np.concatenate([beside, above])
    cost = np.random.default_rng(seed).uniform(1.0, 2.0, len(doors))
    tree = minimum_spanning_tree(coo_array((cost, doors.T), shape=(cells**2, cells**2)).tocsr()).tocoo()
    is_open = set(zip(tree.row.tolist(), tree.col.tolist(), strict=True))
    walls: list[Rings] = []
    for a, b in doors.tolist():
        if (a, b) not in is_open and (b, a) not in is_open:
            y, x = divmod(b, cells)
            width, height = (0.1, 1.1) if b == a + 1 else (1.1, 0.1)
            walls.append([box(x - 0.1, y - 0.1, x + width, y + height)])
    parent = breadth_first_order(tree, 0, directed=False)[1]
    way = [cells * cells - 1]
    while way[-1] != 0:
        way.append(int(parent[way[-1]]))
    return walls, np.array(way[::-1])


@pytest.mark.parametrize("seed", range(3))
def test_a_path_through_a_maze_takes_the_only_way(seed: int) -> None:
    walls, way = maze(15, seed)
    path = shortest_path(NO_CIRCLES, walls, box(0.0, 0.0, 15.0, 15.0), (0.5, 0.5), (14.5, 14.5), radius=0.2)
    steps = shapely.get_coordinates(shapely.segmentize(shapely.linestrings(path.points), 0.01))
    cell = np.floor(steps).astype(int) @ (1, 15)
    assert cell[np.flatnonzero(np.diff(cell, prepend=-1))].tolist() == way.tolist()
    assert path.length < len(way) - 1


UNREACHABLE: dict[str, tuple[ArrayLike, list[Rings]]] = {
    "in a ring": (NO_CIRCLES, RING),
    "behind a wall": (NO_CIRCLES, [[box(8.0, -20.0, 9.0, 20.0)]]),
    "behind circles that overlap": ([(8.0, y, 1.0) for y in np.arange(-12.0, 13.0, 1.5)], []),
    "behind two walls that overlap": (NO_CIRCLES, [[box(8, -12, 9, 1)], [box(8.5, 0, 9, 12)]]),
}


@pytest.mark.parametrize("name", UNREACHABLE)
def test_where_there_is_no_way_the_length_is_infinite(name: str) -> None:
    circles, polygons = UNREACHABLE[name]
    path = shortest_path(circles, polygons, ROOM, (0.0, 0.0), (10.3, 0.2), radius=0.2)
    assert path.length == math.inf
    assert path.points.shape == (0, 2)
    assert not reachable(circles, polygons, ROOM, (0.0, 0.0), (10.3, 0.2), radius=0.2)


def test_within_the_hole_of_a_polygon_the_robot_moves_freely() -> None:
    assert shortest_path(NO_CIRCLES, RING, ROOM, (8.0, -2.0), (12.0, 1.0), radius=0.5).length == pytest.approx(5.0)


GAPS: dict[str, Callable[[float], tuple[ArrayLike, list[Rings]]]] = {
    "circles": lambda gap: ([(8.0, 20.0 + gap / 2.0, 20.0), (8.0, -20.0 - gap / 2.0, 20.0)], []),
    "small circles": lambda gap: ([(8.0, y * (1.4 + gap) + 0.3, 0.7) for y in range(-9, 10)], []),
    "walls": lambda gap: (NO_CIRCLES, [[box(7, gap / 2.0, 9, 20)], [box(7, -20, 9, -gap / 2.0)]]),
    "corners": lambda gap: (
        NO_CIRCLES,
        [[[(6, 20), (8, gap / 2.0), (10, 20)]], [[(6, -20), (8, -gap / 2.0), (10, -20)]]],
    ),
    "a wall and a circle": lambda gap: ([(8.0, 20.0 + gap / 2.0, 20.0)], [[box(3, -20, 13, -gap / 2.0)]]),
}


@pytest.mark.parametrize("radius", [0.2, 0.37])
@pytest.mark.parametrize("name", GAPS)
def test_a_gap_of_exactly_two_radii_is_open(name: str, radius: float) -> None:
    circles, polygons = GAPS[name](2.0 * radius)
    assert reachable(circles, polygons, ROOM, (0.0, 0.0), (20.0, 0.0), radius=radius)
    assert 20.0 <= shortest_path(circles, polygons, ROOM, (0.0, 0.0), (20.0, 0.0), radius=radius).length < 20.1


@pytest.mark.parametrize("radius", [0.2, 0.37])
@pytest.mark.parametrize("name", GAPS)
def test_a_gap_of_two_radii_less_two_percent_is_closed(name: str, radius: float) -> None:
    circles, polygons = GAPS[name](1.96 * radius)
    assert not reachable(circles, polygons, ROOM, (0.0, 0.0), (20.0, 0.0), radius=radius)


def test_a_point_does_not_pass_between_obstacles_that_touch() -> None:
    touching: list[Rings] = [[box(8, -12, 10, 0)], [box(10, 0, 12, 12)]]
    assert not reachable(NO_CIRCLES, touching, ROOM, (0.0, 0.0), (20.0, 0.0), radius=0.0)


@pytest.mark.parametrize("seed", range(40, 60))
def test_what_is_reachable_has_a_path(seed: int) -> None:
    world, radius = random_world(seed)
    start, goal = free_points(world, radius, 2, np.random.default_rng(seed))
    path = shortest_path(*world, start, goal, radius=radius)
    assert reachable(*world, start, goal, radius=radius) == math.isfinite(path.length)


# ---- bad input

BAD_INPUT: dict[str, tuple[dict[str, object], str]] = {
    "start in an obstacle": ({"start": (10.0, 0.0)}, "start"),
    "start too near to an obstacle": ({"start": (7.6, 0.0)}, "start"),
    "goal too near to the border": ({"goal": (29.6, 0.0)}, "goal"),
    "goal outside": ({"goal": (40.0, 0.0)}, "goal"),
    "a start with three numbers": ({"start": (0.0, 0.0, 0.0)}, "start"),
    "a goal that is not a number": ({"goal": (math.nan, 0.0)}, "goal"),
    "a negative radius": ({"radius": -0.1}, "radius"),
    "a radius that is not a number": ({"radius": math.nan}, "radius"),
    "a circle without radius": ({"circles": [(1.0, 2.0)]}, "circles"),
    "a circle of negative radius": ({"circles": [(5.0, 5.0, -1.0)]}, "circles"),
    "a polygon that crosses itself": ({"polygons": [[[(0, 5), (1, 6), (1, 5), (0, 6)]]]}, "polygon 0"),
    "a polygon given without its list of rings": ({"polygons": [[(0, 5), (1, 5), (1, 6)]]}, "polygon 0"),
    "a polygon without rings": ({"polygons": [[]]}, "polygon 0"),
    "a border of two points": ({"border": [(0, 0), (1, 1)]}, "border"),
}


@pytest.mark.parametrize("name", BAD_INPUT)
@pytest.mark.parametrize("function", [shortest_path, reachable])
def test_bad_input_is_refused_by_name(function: Callable[..., object], name: str) -> None:
    change, message = BAD_INPUT[name]
    arguments: dict[str, object] = {
        "circles": NO_CIRCLES,
        "polygons": SLAB,
        "border": ROOM,
        "start": (0.0, 0.0),
        "goal": (20.0, 0.0),
        "radius": 0.5,
    }
    with pytest.raises(ValueError, match=message):
        function(**(arguments | change))
