"""The reproduction of DynaBARN: its scores, whom a mover jumps onto, and its first worlds."""

import json
from pathlib import Path
from typing import Any

import pytest

from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.reproductions import dynabarn, reproduction
from bug_gym.reproductions.claims import run
from bug_gym.reproductions.result import Settings


def driven(folder: Path, keys: list[list[float]], since: float, **robot: float) -> tuple[EpisodeRow, dict[str, Any]]:
    """Straight on from (0, 0) to (6, 0) beside one mover: the run and the numbers that are made of it."""
    world = {
        "world": 300,
        "start": [0.0, 0.0, 0.0],
        "goal": [6.0, 0.0],
        "walls": [],
        "movers": [{"radius": 0.5, "keyframes": keys}],
    }
    path = folder / "worlds.jsonl"
    path.write_text(json.dumps(world) + "\n", encoding="utf-8")
    described = dynabarn.scenario(str(path), 300)
    described["scenario"]["world"]["since"] = since
    described["scenario"]["robot"] = {**described["scenario"]["robot"], **robot}
    (row,) = run(["go_to_goal"], [described], 1, Settings(), name="one")
    return row, dynabarn.summed_up("go_to_goal", [row], {"world 300": described})


def jumping_to(x: float) -> list[list[float]]:
    """A mover that has drifted far off to the side at 30 s and jumps to (x, 0) then."""
    return [[0.0, x, 0.0], [1.0, x, -0.01], [30.0, x, -9.0]]


def test_a_way_without_anybody_scores_by_its_time(tmp_path: Path) -> None:
    row, found = driven(tmp_path, [[0.0, 0.0, 9.0], [30.0, 1.0, 9.0]], 0.0)
    assert row.success and found["success"] == 1.0 and found["jumped_on"] == 0
    assert (found["as_coded"], found["as_meant"]) == (0.125, 0.5)


def test_a_mover_that_jumps_before_the_robot_is_counted_apart(tmp_path: Path) -> None:
    row, found = driven(tmp_path, jumping_to(0.7), 29.99)
    assert row.outcome == "collision" and row.time < 0.5
    assert (found["collisions"], found["jumped_on"], found["success"], found["as_meant"]) == (1, 1, 0.0, 0.0)


def test_a_robot_that_drives_out_of_a_mover_upon_it_has_not_succeeded(tmp_path: Path) -> None:
    row, found = driven(tmp_path, jumping_to(-0.66), 29.99, latency=0.0)  # a late one would stand in it at first
    assert row.outcome == "success"  # to move away is no contact in the simulation
    assert (found["collisions"], found["jumped_on"], found["success"], found["as_coded"]) == (0, 1, 0.0, 0.0)


def test_a_mover_that_came_all_the_way_has_not_jumped(tmp_path: Path) -> None:
    row, found = driven(tmp_path, [[0.0, 5.0, 0.0], [10.0, -5.0, 0.0], [30.0, -9.0, 0.0]], 0.0)
    assert row.outcome == "collision"
    assert (found["collisions"], found["jumped_on"]) == (1, 0)


def test_dynabarn_without_its_worlds_says_what_is_missing() -> None:
    with pytest.raises(ValueError, match="--data"):
        reproduction("dynabarn")(Settings())


def test_it_asks_each_policy_that_drives_the_robot(shared_data: Path) -> None:
    asked = dynabarn.drivers(dynabarn.scenario(str(shared_data / "dynabarn_worlds.jsonl"), 300))
    assert {"hd_bug_map", "bug2", "a_star", "mppi", "orca", "minimum_risk"} <= {*asked}
    assert not {"com", "ocpb", "ppo_dynamic", "navigator"} & {
        *asked
    }  # second names, and who was trained for another robot


def test_the_first_worlds_of_dynabarn_are_driven(shared_data: Path) -> None:
    settings = Settings(
        seeds=2, data=shared_data / "dynabarn_worlds.jsonl", policies=("velocity_obstacle", "bfs", "go_to_goal")
    )
    result = reproduction("dynabarn")(settings)
    assert list(result.data["results"]) == ["velocity_obstacle", "bfs (privileged)", "go_to_goal"]
    for one in result.data["results"].values():
        assert one["n"] == 2 * dynabarn.PHASES
        assert one["as_coded"] == pytest.approx(0.125 * one["success"])
        # 0.125 to 0.5 a success, whatever its time.
        assert one["as_coded"] <= one["as_meant"] <= 4.0 * one["as_coded"]
        assert one["jumped_on"] <= one["n"] and len(one["missed"]) == round(one["n"] * (1.0 - one["success"]))
