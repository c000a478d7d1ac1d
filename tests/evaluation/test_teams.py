"""What an evaluation says of robots that share a world."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bug_gym.evaluation import evaluate, rollout
from bug_gym.evaluation.page import page
from bug_gym.evaluation.page.failures import failed
from bug_gym.evaluation.replays import chosen
from bug_gym.evaluation.rows import AMONG_ROBOTS, EpisodeRow
from bug_gym.evaluation.summary import paired_difference, summarise
from bug_gym.evaluation.teams import team_differences, team_rows, team_tables
from bug_gym.evaluation.text_table import TextTable
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.team_runs import run_team
from bug_gym.reproductions.team_worlds import random_world, team_scenario

BLANK = EpisodeRow(
    policy="pair",
    scenario="hall",
    seed=0,
    robot=0,
    outcome="success",
    verdict="",
    success=True,
    time=10.0,
    steps=100,
    path_length=9.0,
    goal_distance=0.2,
    shortest_path_length=8.0,
    spl=0.8,
    time_ratio=math.nan,
    min_clearance=0.3,
    turns=1,
    total_turning=0.5,
    decision_time_mean=1e-4,
    decision_time_p99=2e-4,
    decision_time_total=1e-2,
)


def robots(policy: str, seed: int, *of_each: dict[str, Any]) -> list[EpisodeRow]:
    """Rows of the robots of one world."""
    rows = []
    for robot, values in enumerate(of_each):
        given = {"robots_gap": 1.0, **values}
        given["success"] = given.get("outcome", "success") == "success"
        rows.append(replace(BLANK, policy=policy, seed=seed, robot=robot, **given))
    return rows


def first_of(policy: str, seed: int, *of_each: dict[str, Any]) -> list[EpisodeRow]:
    """Rows of the robots of a world whose mission the first arrival ends."""
    return robots(policy, seed, *({"mission": "first", **values} for values in of_each))


def test_a_row_of_a_team_says_who_arrived_first_and_what_all_did() -> None:
    first = {"outcome": "ended", "path_length": 7.0, "holds": 2, "held_time": 3.5, "robots_gap": 0.7}
    (row,) = team_rows(first_of("pair", 3, first, {"time": 11.0, "path_length": 10.0, "holds": 1, "held_time": 0.5}))
    assert (row.seed, row.robots, row.winner, row.time, row.length) == (3, 2, 1, 11.0, 10.0)
    assert (row.total_length, row.holds, row.held_time, row.robots_gap) == (17.0, 3, 4.0, 0.7)
    assert (row.arrived, row.collided, row.deadlock, row.success) == (1, 0, False, True)


def test_of_two_that_arrive_the_earlier_one_wins_and_of_equals_the_first() -> None:
    (row,) = team_rows(robots("pair", 0, {"time": 12.0}, {"time": 11.0}, {"time": 11.0}))
    assert row.winner == 1 and row.arrived == 3


def test_robots_that_stand_when_the_time_is_up_have_stopped_one_another() -> None:
    standing = {"outcome": "timeout", "standing_time": 30.0}
    assert team_rows(robots("pair", 0, standing, standing))[0].deadlock
    assert not team_rows(robots("pair", 0, standing, {**standing, "standing_time": 1.0}))[0].deadlock
    # One that has arrived does not make those that stand for ever go on.
    assert team_rows(robots("pair", 0, standing, {}))[0].deadlock
    assert not team_rows(robots("pair", 0, {}, {}))[0].deadlock
    assert not team_rows(robots("pair", 0, standing, {**standing, "standing_time": 1.0}, {}))[0].deadlock


@pytest.mark.parametrize(
    ("places", "steps"), [("ABC", 0), ("ABB", 1), ("AAA", 2), ("ABA", 0), ("BAABBB", 2), ("A", 0), ("AB", 0)]
)
def test_a_robot_stands_in_the_steps_that_began_and_ended_where_it_ended(places: str, steps: int) -> None:
    found = {"A": [0.0, 0.0], "B": [0.0, 0.3], "C": [0.4, 0.3]}
    assert rollout._standing_steps([found[place] for place in places]) == steps


def test_a_mission_is_the_first_arrival_or_everybodys() -> None:
    late = {"outcome": "timeout"}
    for mission, done in (("first", True), ("all", False)):
        (row,) = team_rows(robots("pair", 0, {"mission": mission}, {**late, "mission": mission}))
        assert row.success == done and row.arrived == 1
        assert math.isnan(row.last_time)
    (row,) = team_rows(robots("pair", 0, {"time": 12.0}, {"time": 15.0}))
    assert row.success and (row.time, row.last_time) == (12.0, 15.0)
    assert not team_rows(robots("pair", 0, late, {**late, "mission": "all"}))[0].success
    with pytest.raises(ValueError, match="mission must be one of all, first, came 'last'"):
        replace(BLANK, mission="last")


def test_a_summary_counts_missions_and_its_interval_is_over_worlds() -> None:
    rows = []
    for seed in range(5):
        rows += robots("pair", seed, {"mission": "first"}, {"mission": "first", "outcome": "ended", "spl": 0.0})
    first = summarise(rows)[0]
    assert (first.n, first.success, first.spl, first.ended) == (5, 1.0, 0.8, 0.5)
    assert (first.success_low, first.success_high) == wilson_interval(5, 5)
    every = summarise([replace(row, mission="all") for row in rows])[0]
    assert (every.n, every.success, every.spl) == (5, 0.0, 0.4)


def test_paired_differences_of_robots_are_of_their_worlds() -> None:
    one, other = [], []
    for seed in range(4):
        one += robots("one", seed, {"time": 12.0}, {"time": 20.0})
        other += robots("other", seed, {"time": 10.0}, {"outcome": "timeout"} if seed == 0 else {"time": 10.0})
    success, time = (paired_difference(one, other, field) for field in ("success", "time"))
    assert (success.n, success.mean) == (4, 0.25)
    # World 0: of the robot that arrived under both; the others: the mean of both robots.
    assert (time.n, time.mean) == (4, (2.0 + 3 * 6.0) / 4)


@pytest.mark.parametrize(("here", "there"), [(0, 0), (0, 1), (1, 0)])
def test_where_the_first_arrival_ends_a_mission_the_winners_are_compared_whatever_their_numbers(
    here: int, there: int
) -> None:
    """Worlds 0 and 1 are won by both, 2 by one of them, and 3 by nobody; what the other robot did is no part of it."""
    won: dict[str, Any] = {"time": 12.0, "path_length": 10.0, "min_clearance": 0.5, "turns": 4, "holds": 0}
    ended: dict[str, Any] = {"outcome": "ended", "time": 12.0, "path_length": 99.0, "min_clearance": 0.01, "holds": 2}
    lost = {"outcome": "timeout", "time": 60.0, "path_length": 99.0}
    one, other = [], []
    for seed, better in enumerate((1.0, 3.0)):
        first = {**won, "time": 12.0 - better, "path_length": 10.0 - 2.0 * better, "turns": 3}
        one += first_of("one", seed, *([won, ended] if here == 0 else [ended, won]))
        other += first_of("other", seed, *([first, ended] if there == 0 else [ended, first]))
    one += first_of("one", 2, won, ended) + first_of("one", 3, lost, lost)
    other += first_of("other", 2, lost, lost) + first_of("other", 3, lost, lost)
    means = {"time": 2.0, "path_length": 4.0, "turns": 1.0, "min_clearance": 0.0}
    found = {field: paired_difference(one, other, field) for field in means}
    assert {field: (gap.n, gap.mean) for field, gap in found.items()} == {key: (2, mean) for key, mean in means.items()}
    # What says something of failures, too, is of all robots in all worlds: 2 holds of one of the two in world 2 alone.
    holds = paired_difference(one, other, "holds")
    assert (holds.n, holds.mean) == (4, 1.0 / 4)
    # Where all are to arrive the same rows are compared robot by robot, where both arrived.
    mine, theirs = ([replace(row, mission="all") for row in rows] for rows in (one, other))
    assert paired_difference(mine, theirs, "time").n == (2 if here == there else 0)


def test_a_page_shows_teams_and_counts_no_robot_as_failed_whose_partner_won(tmp_path: Path) -> None:
    rows = []
    for seed in range(3):
        rows += robots("pair", seed, {"mission": "first"}, {"mission": "first", "outcome": "ended"})
    text = page("teams", rows, summarise(rows))
    assert "2 robots, the first that arrives ends the mission" in text and "Every episode succeeded." in text
    assert failed(rows) == {} and chosen(rows, 5) == []


def test_robots_alone_are_no_team_and_their_rows_say_nothing_of_others() -> None:
    assert team_rows([BLANK]) == [] and team_tables([BLANK]) == []
    assert not set(AMONG_ROBOTS) & set(BLANK.as_dict())
    assert EpisodeRow.from_dict(BLANK.as_dict()).as_dict() == BLANK.as_dict()
    row = robots("pair", 0, {"holds": 2})[0]
    again = EpisodeRow.from_dict(json.loads(json.dumps(row.as_dict())))
    assert again.holds == 2 and again.robots_gap == 1.0


def test_differences_are_paired_by_world_and_count_where_both_arrive() -> None:
    rows = []
    for seed, more in enumerate((1.0, 2.0, 3.0)):
        rows += first_of("base", seed, {"time": 10.0}, {"outcome": "ended", "path_length": 5.0})
        rows += first_of("pair", seed, {"time": 10.0 + more}, {"outcome": "ended", "path_length": 5.0 + more})
    rows += first_of("base", 7, {"outcome": "timeout"}, {"outcome": "timeout"})
    rows += first_of("pair", 7, {"time": 99.0, "holds": 2, "robots_gap": 0.8}, {"outcome": "ended"})
    ((title, header, lines),) = team_differences(rows, "base")
    assert "base" in title and header[:2] == ["policy", "worlds"]
    told = dict(zip(header, lines[0], strict=True))
    assert told["worlds"] == "4" and "last [s]" not in header
    assert [float(told[name].split()[0]) for name in ("missions [%]", "first [s]", "together [m]")] == [25.0, 2.0, 2.0]
    # What says something of failures, too, is compared in all worlds.
    assert [float(told[name].split()[0]) for name in ("holds", "gap [m]")] == [0.5, -0.05]


def told_of(table: TextTable, policy: str) -> dict[str, str]:
    """What a table says of a policy, by column."""
    (line,) = [line for line in table.lines if line[0] == policy]
    return dict(zip(table.header, line, strict=True))


def test_a_table_of_teams_says_of_all_robots_what_they_did_where_all_are_to_arrive() -> None:
    held = {"holds": 3, "held_time": 3.0, "robots_gap": 0.6}
    rows = robots("pair", 0, {"time": 10.0, "path_length": 9.0}, {"time": 14.0, "path_length": 12.0})
    rows += robots("pair", 1, {"time": 12.0, "path_length": 11.0}, {"outcome": "timeout", "standing_time": 9.0})
    rows += robots("pair", 2, {"time": 20.0, "path_length": 19.0, **held}, {"time": 16.0, "path_length": 15.0})
    rows += robots("pair", 3, {"time": 18.0, "path_length": 17.0}, {"outcome": "collision"})
    (table,) = team_tables(rows + robots("other", 0, {}, {}))
    assert table.title == "hall: 2 robots, all are to arrive"
    missions = wilson_interval(2, 4)
    assert told_of(table, "pair") == {
        "policy": "pair",
        "missions [%]": f"50 [{100 * missions.low:.0f}, {100 * missions.high:.0f}]",
        "robots [%]": "75",  # six of eight
        "first [s]": "14.00",  # of 10, 12, 16 and 18
        "last [s]": "17.00",  # of 14 and 20
        "winner [m]": "13.00",  # of 9, 11, 15 and 17
        "together [m]": "27.50",  # of 21 and 34
        "holds": "0.75",
        "held [s]": "0.75",
        "least gap [m]": "0.60",
        "collisions": "1",
        "deadlocks": "0",
    }


def test_a_table_of_teams_says_who_won_where_the_first_arrival_ends_a_mission() -> None:
    stands = {"outcome": "timeout", "standing_time": 30.0}
    rows = first_of("pair", 0, {"time": 10.0}, {"outcome": "ended"}) + first_of("pair", 1, {"outcome": "ended"}, {})
    rows += first_of("pair", 2, {"outcome": "ended"}, {}) + first_of("pair", 3, stands, stands)
    (table,) = team_tables(rows)
    told = told_of(table, "pair")
    assert table.title == "hall: 2 robots, the first that arrives ends the mission"
    assert told["wins"] == "1 : 2" and told["deadlocks"] == "1" and told["missions [%]"].startswith("75 ")
    assert not {"robots [%]", "last [s]"} & {*told}


def test_differences_of_teams_are_told_as_finely_as_they_matter() -> None:
    rows = []
    for seed in range(3):
        rows += robots("base", seed, {"time": 10.0}, {"outcome": "collision"} if seed else {})
        rows += robots("pair", seed, {"time": 10.125}, {"outcome": "collision", "held_time": 0.375})
    (table,) = team_differences(rows, "base")
    told = told_of(table, "pair")
    assert told["missions [%]"].startswith("-33 [") and told["held [s]"].startswith("+0.38 [")
    assert "first [s]" not in told  # no mission that both accomplished
    assert team_differences(rows, "nobody") == []


def test_an_evaluation_of_teams_drives_them_as_predict_does(tmp_path: Path) -> None:
    scenario = random_world(3)
    policies = [("pair", name, {"clearance": 1.0}) for name in ("com1_rev3",)]
    rows = evaluate(
        [*policies, ("swarm", "swarm_bug2", {"clearance": 1.0})], scenario, episodes=2, out=tmp_path / "out"
    )
    run = run_team("com1_rev3", scenario, seed=0, clearance=1.0)
    mine = [row for row in rows if row.policy == "pair" and row.seed == 0]
    assert [row.outcome for row in mine] == list(run.outcomes)
    np.testing.assert_allclose([row.robots_gap for row in mine], run.least_gap)
    assert [row.holds for row in mine] == [memory.holds for memory in run.memories]
    with (tmp_path / "out" / "teams.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 4 and {line["policy"] for line in lines} == {"pair", "swarm"}
    assert lines[0]["winner"] == str(run.winner)
    assert "2 robots, the first that arrives ends the mission" in (tmp_path / "out" / "summary.md").read_text()
    assert evaluate(
        [*policies, ("swarm", "swarm_bug2", {"clearance": 1.0})], scenario, episodes=2, out=tmp_path / "out"
    )


def test_a_team_is_left_out_where_there_are_not_robots_enough() -> None:
    two = team_scenario([], [(0.0, 0.0, 0.0), (0.0, 3.0, 0.0)], (4.0, 1.0))
    rows = evaluate(["com1_rev3", "bug2"], [{**two, "name": "two"}, "u_trap"], episodes=1)
    assert {(row.policy, row.scenario) for row in rows} == {("com1_rev3", "two"), ("bug2", "two"), ("bug2", "u_trap")}
    with pytest.raises(ValueError, match="2 robots or more, the scenario has 1"):
        evaluate(["com1_rev3"], ["u_trap"], episodes=1)
