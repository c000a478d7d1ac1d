"""The double linked list of light areas: links, what is lit, ways back."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from bug_gym.agents.hd_bug.light import ANGLES, HEADINGS
from bug_gym.agents.hd_bug.path_list import SAME, PathList, PathNode

F64 = NDArray[np.float64]


def random_light(rng: np.random.Generator) -> F64:
    """A light area (K,) of a few levels."""
    return np.repeat(rng.uniform(0.3, 4.0, HEADINGS // 10), 10)


def wandered(seed: int, count: int = 150) -> PathList:
    """A list along a random walk with steps of half a metre."""
    rng = np.random.default_rng(seed)
    path = PathList(room=8)  # so that it has to grow
    x = y = heading = 0.0
    for step in range(count):
        path.visit((x, y), 0.5 * step, random_light(rng))
        heading += rng.normal(0.0, 0.4)
        x, y = x + 0.5 * math.cos(heading), y + 0.5 * math.sin(heading)
    return path


def backward(path: PathList) -> list[PathNode]:
    nodes = []
    node = path.last
    while node is not None:
        nodes.append(node)
        node = node.previous
    return nodes


def star(place: F64, light: F64) -> shapely.Polygon:
    """A light area as a polygon: between two headings it reaches as far as the farther of them."""
    rings = []
    for k in range(HEADINGS):
        far = max(light[k], light[(k + 1) % HEADINGS])
        turns = np.linspace(ANGLES[k], ANGLES[k] + 2.0 * math.pi / HEADINGS, 6)
        rings += [(place[0] + far * math.cos(a), place[1] + far * math.sin(a)) for a in turns]
    return shapely.Polygon(rings)


@pytest.mark.parametrize("seed", range(3))
def test_backward_is_forward_reversed(seed: int) -> None:
    path = wandered(seed)
    forward = list(path)
    assert len(forward) == len(path) > 50 and backward(path) == forward[::-1] and path.nodes == forward
    assert forward[0] is path.first and forward[0].previous is None
    assert forward[-1] is path.last and forward[-1].following is None


def test_a_place_visited_again_is_the_same_node_and_keeps_the_farther_light() -> None:
    path = PathList()
    first = path.visit((0.0, 0.0), 0.0, np.full(HEADINGS, 1.0))
    path.visit((1.0, 0.0), 1.0, np.full(HEADINGS, 1.0))
    light = np.where(np.arange(HEADINGS) < 90, 2.0, 0.5)
    assert path.visit((0.01, 0.0), 2.0, light) is first is path.here
    assert path.visit((0.9 * SAME, 0.0), 2.0, np.full(HEADINGS, 9.0)) is first
    np.testing.assert_array_equal(path.lights[0], np.where(np.arange(HEADINGS) < 90, 2.0, 1.0))
    assert len(path) == 2


def test_what_is_seen_farther_at_a_place_visited_again_is_lit() -> None:
    path = PathList()
    path.visit((0.0, 0.0), 0.0, np.full(HEADINGS, 1.0))
    far = np.array([[3.0, 0.0], [0.0, 4.5]])
    assert not path.is_lit(far).any()
    path.visit((0.01, 0.0), 0.0, np.full(HEADINGS, 4.0))
    np.testing.assert_array_equal(path.is_lit(far), [True, False])


def test_the_robot_has_come_from_where_it_was_and_can_go_back_there_though_neither_sees_the_other() -> None:
    """Also where that is not the last node that was made."""
    path, dark = PathList(), np.zeros(HEADINGS)
    first, second = path.visit((0.0, 0.0), 0.0, dark), path.visit((1.0, 0.0), 1.0, dark)
    assert path.visit((0.0, 0.0), 2.0, dark) is first
    third = path.visit((0.0, 1.0), 3.0, dark)
    assert third.came_from is first and third.previous is second and second.came_from is first
    assert path.way_to(third.number, second.number) == [third.number, first.number, second.number]


@pytest.mark.parametrize("seed", range(3))
def test_lit_is_what_a_light_area_holds(seed: int) -> None:
    path = wandered(seed, count=12)
    light = shapely.union_all([star(*pair) for pair in zip(path.places, path.lights, strict=True)])
    places = np.random.default_rng(seed + 10).uniform(path.places.min() - 3.0, path.places.max() + 3.0, (600, 2))
    sure = shapely.distance(light.boundary, shapely.points(places)) > 0.02
    found = path.is_lit(places, slack=0.0)
    assert 0.05 < found.mean() < 0.95
    np.testing.assert_array_equal(found[sure], shapely.contains_xy(light, places)[sure])


@pytest.mark.parametrize("seed", range(3))
def test_ways_back_are_the_shortest_over_the_links(seed: int) -> None:
    path = wandered(seed, count=60)
    n = len(path)
    apart = np.hypot(*(path.places[:, None] - path.places).T)
    linked = np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            sight = False
            for a, b in ((i, j), (j, i)):
                toward = math.atan2(*(path.places[b] - path.places[a])[::-1])
                k = int(toward / (2.0 * math.pi) * HEADINGS % HEADINGS)
                sight |= apart[i, j] <= min(path.lights[a][k], path.lights[a][(k + 1) % HEADINGS])
            if sight or i - j == 1:
                linked[i, j] = linked[j, i] = apart[i, j]
    start = n - 1
    expected = dijkstra(linked, indices=start)
    found, _ = path.ways_from(start)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    way = path.way_to(start, 0)
    assert way[0] == start and way[-1] == 0
    assert sum(apart[a, b] for a, b in zip(way, way[1:], strict=False)) == pytest.approx(expected[0])


def test_a_way_that_was_cut_is_gone_round_or_gone() -> None:
    path = PathList()
    for x in range(3):
        path.visit((float(x), 0.0), float(x), np.full(HEADINGS, 1.5))
    assert path.way_to(2, 0) == [2, 1, 0]
    path.cut(2, 1)
    assert path.way_to(2, 0) == [] == path.way_to(0, 2)
    path.visit((1.0, 0.9), 3.0, np.full(HEADINGS, 1.5))
    assert path.way_to(2, 0) == [2, 3, 0]


def test_an_empty_list_has_no_nodes_and_lights_nothing() -> None:
    path = PathList()
    assert list(path) == [] and path.doors == [] and path.first is path.last is None
    assert not path.is_lit(np.zeros((3, 2))).any()
