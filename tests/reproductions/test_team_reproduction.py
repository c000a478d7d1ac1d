"""The parts of `bug-gym reproduce com1-rev3`, on their first seeds."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from bug_gym.reproductions import com1_rev3
from bug_gym.reproductions.com1_rev3 import FACTS, farthest
from bug_gym.reproductions.result import Settings
from bug_gym.reproductions.team_worlds import FIG_6, obstacles_across, random_world

FEW = Settings(seeds=3)


@pytest.mark.parametrize("name", ["formulas", "table_2", "fig_6"])
def test_what_the_paper_says_holds(name: str) -> None:
    part = getattr(com1_rev3, name)(FEW)
    assert part.holds and part.tables[0].rows
    json.dumps(part.data, allow_nan=False)


def test_the_claim_is_counted_in_both_kinds_of_worlds() -> None:
    part = com1_rev3.claim(Settings(seeds=2))
    assert [one["n"] for one in part.data.values()] == [2, 2]
    assert all(one["by_half"] <= one["both"] and one["less"] <= one["both"] for one in part.data.values())


def test_where_nobody_arrives_there_is_no_share_and_no_difference() -> None:
    assert com1_rev3.share(0, 0) == com1_rev3.difference([]) == "–"


def test_a_run_that_is_not_as_its_fact_says_is_marked() -> None:
    fact = FACTS["AD"]
    came = {"winner": 0, "named": fact.named, "total": fact.total, "both": fact.both, "stops": [21.0, 2.75]}
    assert com1_rev3._agrees(came, fact)
    for wrong in ({"winner": 1}, {"named": fact.named + 1.0}, {"both": fact.both - 2.0}, {"stops": [21.0, 4.0]}):
        assert not com1_rev3._agrees({**came, **wrong}, fact)


def test_the_printed_sums_are_those_of_their_parts() -> None:
    # On the rounded contour both have the same way when one is known to win: the other one's is the sum less the total.
    for route, fact in FACTS.items():
        assert fact.both - fact.total == pytest.approx(fact.named, abs=0.03), route


def test_worlds_are_the_same_each_time_and_have_room() -> None:
    assert random_world(5) == random_world(5) and random_world(5) != random_world(6)
    assert obstacles_across(6) == obstacles_across(6)
    for robots in (2, 4, 8):
        starts = [place["start"] for place in random_world(1, robots)["robots"]]
        assert len(starts) == robots
        assert min(math.dist(a[:2], b[:2]) for i, a in enumerate(starts) for b in starts[:i]) == pytest.approx(2.5)


def test_the_greatest_distance_to_a_way() -> None:
    way = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]])
    assert farthest(np.array([[3.0, 0.2], [10.5, 2.0]]), way) == pytest.approx(0.5)
    assert set(FIG_6) == set("abcdefg")
