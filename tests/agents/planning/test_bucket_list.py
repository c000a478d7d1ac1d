"""The open list of A* against a sorted one, and A* where its ring is used to the full."""

from __future__ import annotations

import heapq

import numpy as np
import pytest
from compiled import for_python

from bug_gym.agents.planning import a_star as module
from bug_gym.agents.planning.a_star import a_star
from bug_gym.agents.planning.bucket_list import (
    NARROWEST,
    RING,
    BucketList,
    bucket_list,
    come_round,
    drop_top,
    grown,
    has_room,
    node_of,
    put_in,
    second_key,
)
from bug_gym.agents.planning.dijkstra import dijkstra
from bug_gym.agents.planning.grid import STRAIGHT, UNIT, make_grid

put, come, drop = for_python(put_in), for_python(come_round), for_python(drop_top)
pack, unpack = for_python(second_key), for_python(node_of)


def put_one(opened: BucketList, first: int, left: int, node: int) -> None:
    """Put a node in."""
    put(opened, first, pack(left, node))


def take_first(opened: BucketList) -> tuple[int, int]:
    """First key and node of the first entry, which is taken out; -1 where there is none."""
    if not come(opened):
        return -1, -1
    first, second = opened.heap[0].tolist()
    drop(opened)
    return first, unpack(second)


@pytest.mark.parametrize("seed", range(4))
def test_entries_come_in_the_order_of_their_keys_whatever_waits(seed: int) -> None:
    """Keys within half a ring above the first one, as those of neighbours are, many near it, and some below it."""
    generator = np.random.default_rng(seed)
    opened = bucket_list(room=8)
    sorted_ones: list[tuple[int, int, int]] = []
    reach, base = RING << NARROWEST - 1, 10**12
    for node in range(3000):
        farthest = reach if node % 2 else 3 << NARROWEST
        first = base + int(generator.integers(-farthest // 100, farthest))
        left = int(generator.integers(4)) * STRAIGHT
        while not has_room(opened):
            opened = grown(opened)
        put_one(opened, first, left, node)
        heapq.heappush(sorted_ones, (first, left, -node))
        while sorted_ones and (generator.random() < 0.3 or node % 300 == 0):  # all of them at times
            expected = heapq.heappop(sorted_ones)
            assert take_first(opened) == (expected[0], -expected[2])
            base = max(base, expected[0])
    assert base > 10**12 + 2 * (RING << NARROWEST)  # the ring was gone round more than once
    while sorted_ones:
        expected = heapq.heappop(sorted_ones)
        assert take_first(opened) == (expected[0], -expected[2])
    assert take_first(opened) == (-1, -1)


def test_what_is_left_and_the_node_decide_among_equals() -> None:
    opened = bucket_list()
    for left, node in ((2 * STRAIGHT, 1), (STRAIGHT, 2**31 - 1), (STRAIGHT, 7), (2**61, 3)):
        put_one(opened, 5, left, node)
    assert [take_first(opened)[1] for _ in range(4)] == [2**31 - 1, 7, 1, 3]


@pytest.mark.parametrize("factor", [1, 40, 3000])
def test_dear_ground_does_not_send_a_star_round_the_ring(factor: int) -> None:
    """Buckets of the common width would mix up keys that lie a whole ring apart."""
    generator = np.random.default_rng(factor)
    grid = make_grid((generator.random((30, 30)) < 0.2).astype(np.uint8))
    weights = np.where(generator.random(grid.blocked.size) < 0.5, UNIT, factor * UNIT)
    grid = grid._replace(weights=weights)
    free = np.flatnonzero(grid.blocked.ravel() == 0)
    for start, goal in generator.choice(free, (30, 2)).tolist():
        assert a_star(grid, start, goal).cost == dijkstra(grid, start, goal).cost


def test_a_search_goes_on_when_its_list_has_grown(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = make_grid((np.random.default_rng(5).random((60, 60)) < 0.25).astype(np.uint8))
    free = np.flatnonzero(grid.blocked.ravel() == 0)
    ends = [(int(free[0]), int(other)) for other in free[::97]]
    roomy = [a_star(grid, *each) for each in ends]
    monkeypatch.setattr(module, "bucket_list", lambda weights: bucket_list(weights, 1))
    for each, expected in zip(ends, roomy, strict=True):
        found = a_star(grid, *each)
        assert found.nodes.tolist() == expected.nodes.tolist() and found[1:] == expected[1:]
