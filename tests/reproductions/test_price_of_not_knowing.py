"""The price of not knowing, on its first seed: nobody beats the optimum, and the marks and memories are told."""

from __future__ import annotations

import math
from typing import Any

import pytest

from bug_gym.reproductions import price_of_not_knowing as price
from bug_gym.reproductions.result import Settings
from bug_gym.reproductions.scripted_and_learned import ROBOT

POLICIES = ("bug2", "a_star", "visibility_graph")
OPTIMUM = "visibility_graph (privileged)"


@pytest.fixture(scope="module")
def found() -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(price, "SCENARIOS", {name: price.SCENARIOS[name] for name in ("fields", "u_trap")})
        patch.setattr(price, "RANGES", (2.0, 5.0))
        return price.reproduce(Settings(seeds=2, policies=POLICIES))


def test_nobody_is_shorter_than_the_shortest_and_the_exact_planner_is_near_it(found: Any) -> None:
    assert found.holds and found.data["too_short"] == []
    for label in ("fields", "u_trap"):
        ratio = {policy: one[label]["path_ratio"] for policy, one in found.data["policies"].items()}
        assert min(ratio, key=lambda policy: ratio[policy]) in (OPTIMUM, "a_star (privileged)")
        assert 1.0 - price.SLACK <= ratio[OPTIMUM] <= 1.05
        for one in found.data["policies"].values():
            middle, low, high = one[label]["share_of_optimum"]
            assert low <= middle <= high <= 1.0 + price.SLACK


def test_who_reads_the_map_is_marked_and_each_tells_what_it_keeps(found: Any) -> None:
    first = found.tables[0]
    told = {row[0]: row[-1] for row in first.rows}
    assert set(told) == {"bug2", "a_star (privileged)", OPTIMUM}
    assert told["bug2"].startswith("the M-line") and told[OPTIMUM] == "the map, which is given"
    shares = [float(row[3].split()[0]) for row in first.rows]
    assert shares == sorted(shares, reverse=True)


def test_the_range_of_the_lidar_is_drawn_against_the_share_of_the_optimum(found: Any) -> None:
    assert [curves.title for curves in found.curves] == ["fields", "u_trap"]
    for curves in found.curves:
        assert list(curves.x) == [2.0, 5.0] and list(curves.lines) == ["bug2"]
        assert all(low <= middle <= high <= 1.0 for line in curves.lines.values() for middle, low, high in line)


def test_what_was_driven_with_the_robots_own_range_is_what_that_range_would_give(found: Any) -> None:
    scenarios = {name: price.SCENARIOS[name] for name in ("fields", "u_trap")}
    own = ROBOT["lidar.range"]
    anew = price.drive(["bug2"], scenarios, 2, Settings(), {"lidar.range": own})
    for label in scenarios:
        described = price.described([row for row in anew if row.scenario == label])
        kept = found.data["ranges"][f"{own:g}"][label]["bug2"]
        assert kept["n"] == 2
        for key, value in described.items():
            assert key.startswith("decision_time") or kept[key] == value


def test_a_mean_of_nothing_is_a_dash() -> None:
    assert math.isnan(price.interval([])[0]) and price.told(price.interval([math.nan])) == "-"
    assert price.memory_of("nobody") == "" and price.memory_of("ppo_static") == "weights"
