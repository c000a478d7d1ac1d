"""What reproductions of HD-BUG share: differences of the same worlds, held against counts and means by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.reproductions import claims, hd_bug_real, hd_bug_tables, hd_bug_targets

BLANK = EpisodeRow("a", "s", 0, 0, "success", "", True, 1.0, 10, 1.0, 0.1, 8.0, nan, nan, 0.5, 0, 0.0, 0.0, 0.0, 0.0)


def rows(policy: str, lengths: Sequence[float | None]) -> list[EpisodeRow]:
    """An episode a world: the path to the goal [m], None where it was not reached."""
    return [
        replace(BLANK, policy=policy, seed=seed, path_length=length)
        if length is not None
        else replace(BLANK, policy=policy, seed=seed, outcome="collision", success=False)
        for seed, length in enumerate(lengths)
    ]


def test_paths_are_compared_where_both_arrive_and_p_is_the_sign_tests() -> None:
    gap = claims.paired(rows("a", [11.0, 12.0, 13.0, 5.0, None]), rows("b", [10.0, 10.0, 10.0, 5.0, 1.0]))[
        "path_length"
    ]
    assert gap["n"] == 4 and gap["mean"] == pytest.approx(1.5)
    assert gap["interval"][0] <= 1.5 <= gap["interval"][1]
    # Three of three that are no ties are longer: both tails of a fair coin, 2 / 2^3.
    assert gap["p_value"] == pytest.approx(0.25)


def test_success_is_compared_in_all_worlds_by_mcnemars_test() -> None:
    none, all_but_one = [None] * 6, [1.0] * 5 + [None]
    gap = claims.paired(rows("a", all_but_one), rows("b", none))["success"]
    assert gap["n"] == 6 and gap["mean"] == pytest.approx(5.0 / 6.0) and gap["p_value"] == pytest.approx(2.0 / 2.0**5)
    turned = claims.paired(rows("b", none), rows("a", all_but_one))["success"]
    assert turned["mean"] == pytest.approx(-gap["mean"]) and turned["p_value"] == pytest.approx(gap["p_value"])


def test_what_nobody_reached_has_no_path_and_one_world_no_interval() -> None:
    gap = claims.paired(rows("a", [None]), rows("b", [2.0]))
    assert gap["path_length"] == {"n": 0, "mean": None, "interval": [None, None], "p_value": None}
    assert claims.told(gap["path_length"]) == ["-", "-", "-"]
    assert gap["success"]["interval"] == [None, None] and claims.told(gap["success"], 100.0, 0) == ["-100", "-", "1"]


@pytest.mark.parametrize("shortest", [0.0, nan, inf])
def test_without_a_shortest_path_there_is_no_ratio(shortest: float) -> None:
    assert claims.numbers([replace(BLANK, shortest_path_length=shortest)])["path_ratio"] is None


def test_the_map_planner_keeps_what_the_bugs_keep() -> None:
    assert claims.entry("hd_bug") == "hd_bug" and claims.entry("hd_bug_map") == {
        "name": "hd_bug_map",
        "parameters": {"clearance": claims.CLEARANCE},
    }


def test_in_the_streets_and_after_targets_both_keep_the_same_from_walls(tmp_path: Path) -> None:
    """Of themselves they would not: a bug keeps the radius and one step, the planner a quarter more than the radius."""
    record = tmp_path / "one.csv"
    record.write_text("time_s,pedestrian,x_m,y_m\n0.0,1,0.0,0.0\n60.0,1,9.0,0.0\n")
    street = [hd_bug_real.entry(line) for line in hd_bug_real.LINES]
    (target,) = hd_bug_targets.scenes("evade", 1)
    for entries, scenario in ((street, hd_bug_real.crossing(record)), (hd_bug_targets.POLICIES, target["scenario"])):
        kept = []
        for one in entries:
            policy: Any = make_policy(one["name"], load(scenario), **one.get("parameters", {}))
            kept.append(policy.boundary.clearance if one["name"] == "hd_bug" else policy.measures.clearance)
        assert kept == pytest.approx([kept[0]] * len(kept))


@pytest.mark.parametrize(
    ("interval", "sooner"), [([-0.2, -0.1], True), ([-0.2, 0.1], False), ([0.1, 0.2], False), ([None, None], False)]
)
def test_a_target_is_met_sooner_where_the_whole_interval_says_so(interval: list[float | None], sooner: bool) -> None:
    assert hd_bug_targets.is_sooner({"mean": -0.1, "interval": interval}) is sooner


def test_a_path_that_is_longer_than_another_algorithms_of_the_paper_breaks_the_claim() -> None:
    def holds(**paths: float) -> bool:
        found = [
            replace(BLANK, policy=policy, scenario=str(count), path_length=path, shortest_path_length=9.0)
            for policy, path in paths.items()
            for count in hd_bug_tables.OBSTACLES
        ]
        return hd_bug_tables.claims_hold(found, hd_bug_tables.compared(found, tuple(paths)))

    assert holds(hd_bug=9.5, bug1=9.6) and not holds(hd_bug=9.5, bug1=9.4)
    assert holds(hd_bug=9.5, hd_bug_map=9.1)  # which is no algorithm of the paper
    assert not holds(hd_bug=11.0, bug1=12.0)  # beyond 12 % of the shortest
