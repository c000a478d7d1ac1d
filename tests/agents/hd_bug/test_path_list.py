"""The double linked list of the path: links, places found again, dead ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bug_gym.agents.hd_bug.path_list import PathList, PathNode

PACE = 0.5


def wandered(seed: int, steps: int = 400) -> PathList:
    """A list along a random walk with steps of 0.1 m."""
    rng = np.random.default_rng(seed)
    path = PathList(PACE)
    x = y = odometer = 0.0
    heading = 0.0
    for _ in range(steps):
        path.append((x, y), odometer)
        heading += rng.normal(0.0, 0.4)
        x, y, odometer = x + 0.1 * math.cos(heading), y + 0.1 * math.sin(heading), odometer + 0.1
    return path


def backward(path: PathList) -> list[PathNode]:
    nodes = []
    node = path.last
    while node is not None:
        nodes.append(node)
        node = node.previous
    return nodes


@pytest.mark.parametrize("seed", range(3))
def test_backward_is_forward_reversed(seed: int) -> None:
    path = wandered(seed)
    forward = list(path)
    assert len(forward) > 50 and backward(path) == forward[::-1]
    assert forward[0] is path.first and forward[0].previous is None
    assert forward[-1] is path.last and forward[-1].following is None


@pytest.mark.parametrize("seed", range(3))
def test_nodes_are_a_pace_apart_along_the_way(seed: int) -> None:
    odometers = np.array([node.odometer for node in wandered(seed)])
    gaps = np.diff(odometers)
    assert (gaps >= PACE).all() and (gaps < PACE + 0.1 + 1e-9).all()


def test_append_says_whether_it_added_a_node() -> None:
    path = PathList(PACE)
    added = [path.append((odometer, 0.0), odometer) for odometer in (0.0, 0.4, 0.5, 0.9, 1.0)]
    assert added == [True, False, True, False, True]
    assert [node.odometer for node in path] == [0.0, 0.5, 1.0]


@pytest.mark.parametrize("seed", range(3))
def test_near_finds_the_nearest_node_within_a_pace(seed: int) -> None:
    path = wandered(seed)
    nodes = list(path)
    found = 0
    for place in np.random.default_rng(seed + 10).uniform(-6.0, 6.0, (500, 2)).tolist():
        gaps = [math.dist(node.place, place) for node in nodes]
        nearest = int(np.argmin(gaps))
        node = path.near((place[0], place[1]))
        if gaps[nearest] > PACE:
            assert node is None
        else:
            assert node is not None and math.dist(node.place, place) == gaps[nearest]
            found += 1
    assert found > 10


@pytest.mark.parametrize("index", [0, 1, 17, -2, -1])
def test_turning_back_closes_exactly_the_nodes_behind(index: int) -> None:
    path = wandered(4)
    nodes = list(path)
    path.back_to(nodes[index])
    last_open = nodes.index(nodes[index])
    assert [node.is_closed for node in nodes] == [place > last_open for place in range(len(nodes))]


def test_a_later_dead_end_leaves_earlier_ones_closed() -> None:
    path = PathList(PACE)
    for place in range(6):
        path.append((float(place), 0.0), float(place))
    nodes = list(path)
    path.back_to(nodes[3])
    path.append((3.0, 1.0), 6.0)
    path.append((3.0, 2.0), 7.0)
    last = path.last
    assert last is not None and last.previous is not None
    path.back_to(last.previous)
    assert [node.is_closed for node in path] == [False] * 4 + [True] * 2 + [False, True]


def test_an_empty_list_has_no_nodes() -> None:
    path = PathList(PACE)
    assert list(path) == [] and path.near((0.0, 0.0)) is None and path.first is path.last is None
