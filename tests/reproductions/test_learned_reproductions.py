"""What `bug-gym reproduce` says of learned policies, on a few worlds."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

from ros_maps import write_map

from bug_gym.agents import make_policy
from bug_gym.agents.learning.folder import TRAINED_FOLDER, read_config, trained_names
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.reproductions import learned, ppo_curve, price_of_not_knowing, reproduction, scripted_and_learned
from bug_gym.reproductions.result import Settings
from bug_gym.reproductions.scripted_and_learned import ROBOT, real_maps
from bug_gym.worlds.ros_files import FREE, OCCUPIED


def test_held_out_results_are_those_that_the_card_of_the_model_tells() -> None:
    names = tuple(name for name in trained_names() if name in learned.TARGETS)
    result = reproduction("learned")(Settings(seeds=200, policies=names))
    for name, found in result.data["models"].items():
        config = read_config(TRAINED_FOLDER / name)
        for scenario, held in config["runs"][str(config["seed"])]["held_out"].items():
            assert found[scenario]["n"] == 200
            # The first 200 of the card's worlds: the card's share lies in their interval, but for one time in a thousand.
            assert found[scenario]["low"] - 0.02 <= held["success"] <= found[scenario]["high"] + 0.02


def test_a_model_below_its_target_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(learned.TARGETS, "ppo_dynamic", 1.01)
    result = reproduction("learned")(Settings(seeds=3, policies=("ppo_dynamic",)))
    assert result.holds is False and "ppo_dynamic" in result.notes[0]


@pytest.mark.parametrize("module", [price_of_not_knowing, scripted_and_learned])
def test_everybody_who_is_driven_by_default_can_drive(module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def note(policies: list[Any], suite: dict[str, Any], **settings: Any) -> list[Any]:
        asked.extend(policies)
        raise InterruptedError

    monkeypatch.setattr(module, "evaluate", note)
    with pytest.raises(InterruptedError):
        module.reproduce(Settings())
    names = [one if isinstance(one, str) else one["name"] for one in asked]
    assert set(names) & set(trained_names()) == {name for name in trained_names() if "crossing_robots" not in name}
    env = gym.make("BugGym/Static-v0", scenario="dynamic", disable_env_checker=True)
    for name in names:
        make_policy(name, env)


def test_learned_and_scripted_policies_stand_in_one_table_and_misfits_are_left_out() -> None:
    result = reproduction("scripted-and-learned")(
        Settings(seeds=1, policies=("tangent_bug", "go_to_goal", "ppo_dynamic"))
    )
    tables = {table.title: [line[0] for line in table.rows] for table in result.tables}
    assert tables["dynamic"] == ["tangent_bug", "go_to_goal", "ppo_dynamic"]
    assert tables["32 beams"] == ["tangent_bug", "go_to_goal"]
    for label, by_policy in result.data["collisions"].items():
        for policy, kinds in by_policy.items():
            shares = [s for s in result.data["summaries"] if (s["scenario"], s["policy"]) == (label, policy)]
            assert sum(kinds.values()) == sum(round(share["collision"] * share["n"]) for share in shares)
    paired = [one for one in result.data["differences"] if one["scenario"] == "dynamic"]
    assert [(one["policy"], one["baseline"]) for one in paired] == [
        ("go_to_goal", "tangent_bug"),
        ("ppo_dynamic", "tangent_bug"),
    ]


def test_maps_in_a_folder_are_driven_in_too(tmp_path: Path) -> None:
    for name, corner in (("a", 20), ("b", 60)):
        cells = np.full((120, 140), FREE)
        cells[corner : corner + 20, 50:70] = OCCUPIED
        write_map(tmp_path, cells, name)
    (tmp_path / "notes.yaml").write_text("image: none.pgm\n")
    maps = real_maps(tmp_path)
    assert list(maps) == ["map a", "map b"]
    for source, changes in maps.values():
        rows = evaluate(["tangent_bug"], load(source, {**ROBOT, **changes}), episodes=2)
        assert all(row.success for row in rows)


def test_a_folder_without_maps_is_refused_before_anything_is_driven(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="maps of ROS's map_server"):
        reproduction("scripted-and-learned")(Settings(seeds=1, policies=("go_to_goal",), data=tmp_path))


@pytest.mark.slow
def test_a_million_and_a_half_steps_of_ppo_reach_nine_of_ten_on_dynamic(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
    monkeypatch.setitem(ppo_curve.CHANGES, "eval_freq", 1_400_000)
    result = reproduction("ppo-curve")(Settings(seeds=1))
    assert result.holds
