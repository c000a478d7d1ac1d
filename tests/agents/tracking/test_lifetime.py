"""When tracks end: which of two at one place is kept, which place a new one may take, and how long the unseen are kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from compiled import for_python
from tracked import world_of

from bug_gym.agents.tracking import lifetime
from bug_gym.agents.tracking.layout import (
    ANGLE_STEP,
    CLUSTER,
    HITS,
    ID,
    IS_CONFIRMED,
    IS_FULL_CIRCLE,
    IS_MOVING,
    NOW,
    NUMBERS,
    POSE,
    RADIUS,
    RANGE,
    SEEN,
    SETTINGS,
    STATE,
    TRACKS,
    Memory,
    Scan,
    X,
    Y,
)
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.config import load
from bug_gym.view import Sensors

join_doubles = for_python(lifetime.join_doubles)
worst_track = for_python(lifetime.worst_track)
is_gone = for_python(lifetime.is_gone)


def tracks_at(*places: tuple[float, float], seen: tuple[float, ...] = ()) -> Memory:
    """A memory with tracks of discs of 0.3 m, numbered from 1 on, last seen at some times [s]."""
    memory = Tracker(Sensors.of(load(world_of([])))).start().arrays()
    for m, (x, y) in enumerate(places):
        memory.numbers[m, ID], memory.numbers[m, CLUSTER] = m + 1, -1
        memory.state[m, [X, Y, RADIUS]] = x, y, 0.3
        memory.state[m, SEEN] = seen[m] if seen else 0.0
    return memory


@pytest.mark.parametrize(
    ("seen", "kept"), [((1.0, 2.0), 1), ((2.0, 1.0), 0), ((1.0, 1.0), 0)], ids=["later", "earlier", "together"]
)
def test_of_two_tracks_at_one_place_that_seen_last_is_kept_then_the_older(seen: tuple[float, float], kept: int) -> None:
    """The hits of the other become its own."""
    memory, owner = tracks_at((2.0, 0.0), (2.1, 0.0), seen=seen), np.array([0, 1, -1, 1, 0])
    join_doubles(memory, 1, owner)
    assert memory.numbers[:2, ID].tolist() == [1 if kept == 0 else 0, 2 if kept == 1 else 0]
    assert owner.tolist() == [kept, kept, -1, kept, kept]


def test_tracks_farther_apart_than_half_their_radius_are_two() -> None:
    for apart, left in ((0.14, 1), (0.16, 2)):
        memory = tracks_at((2.0, 0.0), (2.0 + 0.6 * apart, 0.8 * apart))
        join_doubles(memory, 1, np.zeros(0, dtype=np.int64))
        assert np.count_nonzero(memory.numbers[:, ID]) == left


def test_a_new_track_takes_a_free_place_or_that_of_the_farthest_still_thing_out_of_sight() -> None:
    """Farther than itself, else none: what is near matters more."""
    places = [(1.0 + 0.1 * m, 0.0) for m in range(TRACKS)]
    memory = tracks_at(*places[:-1])
    assert worst_track(memory, 0.0, 0.0, 0.5) == TRACKS - 1
    memory = tracks_at(*places)
    memory.numbers[TRACKS - 1, IS_MOVING], memory.numbers[TRACKS - 2, CLUSTER] = 1, 0
    assert worst_track(memory, 0.0, 0.0, 0.5) == TRACKS - 3
    assert worst_track(memory, 0.0, 0.0, places[TRACKS - 3][0] + 0.01) == -1


def scan_of(ranges: list[float], now: float) -> Scan:
    """A scan all round from the origin, within 10 m."""
    pose, settings, beams = np.zeros(POSE), np.zeros(SETTINGS), len(ranges)
    pose[NOW] = now
    settings[[RANGE, ANGLE_STEP, IS_FULL_CIRCLE]] = 10.0, 2.0 * math.pi / beams, 1.0
    nothing = np.zeros(beams)
    return Scan(np.array(ranges), nothing, nothing, nothing > 0.0, np.full(beams, -1), pose, settings)


@pytest.mark.parametrize(
    ("moves", "ahead", "limit"), [(False, 5.0, 1.0), (True, 5.0, 0.5), (False, 1.0, 3.0), (True, 1.0, 3.0)]
)
def test_a_track_out_of_sight_is_kept_for_longer_where_its_place_is_hidden(
    moves: bool, ahead: float, limit: float
) -> None:
    """It stands 2 m ahead; the beam there goes past it, or ends before it."""
    state, numbers = np.zeros(STATE), np.zeros(NUMBERS, dtype=np.int64)
    state[[X, RADIUS]] = 2.0, 0.3
    numbers[[ID, IS_CONFIRMED, IS_MOVING]] = 1, 1, moves
    for unseen, gone in ((0.0, False), (limit - 0.05, False), (limit + 0.05, True)):
        assert is_gone(state, numbers, scan_of([ahead, 9.0, 9.0, 9.0], unseen)) == gone


@pytest.mark.parametrize(("hits", "gone"), [(0b00100, False), (0b01000, True), (0b10000, True)])
def test_what_was_hardly_ever_seen_is_let_go_after_three_updates_without_it(hits: int, gone: bool) -> None:
    """And is kept where it is confirmed."""
    state: Any = np.zeros(STATE)
    numbers = np.zeros(NUMBERS, dtype=np.int64)
    state[[X, RADIUS]] = 2.0, 0.3
    numbers[[ID, HITS]] = 1, hits
    assert is_gone(state, numbers, scan_of([1.0] * 4, 0.1)) == gone
    numbers[IS_CONFIRMED] = 1
    assert not is_gone(state, numbers, scan_of([1.0] * 4, 0.1))
