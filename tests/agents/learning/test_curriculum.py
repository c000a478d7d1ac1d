"""Trainings by stages, and trainings whose robots have other limits in each episode."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

import torch
from safetensors.torch import load_file

from bug_gym.agents.learning import training
from bug_gym.agents.learning.curriculum import rows_of_stage
from bug_gym.agents.learning.folder import read_config
from bug_gym.agents.learning.settings import AnySettings, PPOSettings, load_settings
from bug_gym.agents.learning.training import curriculum_of, make_training_env, train
from bug_gym.agents.learning.vec_envs import CurriculumVecEnv
from bug_gym.cli import main
from bug_gym.config import ScenarioError
from bug_gym.held_out import TRAINING_SEEDS
from bug_gym.simulation import Simulation

STAGES: list[dict[str, Any]] = [
    {"scenarios": ["static"], "overrides": {"world.obstacles": 0}, "success": 0.0},
    {"overrides": {"world.obstacles": 4}, "success": 0.0, "share": 0.75},
    {"share": 0.5},
]
TINY: dict[str, Any] = {
    "algo": "ppo",
    "scenarios": ["dynamic"],
    "overrides": {"time.limit": 3.0},
    "curriculum": STAGES,
    "policy_kwargs": {"net_arch": [8]},
    "n_envs": 8,
    "n_steps": 16,
    "batch_size": 32,
    "n_timesteps": 1024,
    "eval_freq": 256,
    "eval_episodes": 2,
    "test_episodes": 2,
    "save_freq": 128,
}


def tiny(**changes: Any) -> PPOSettings:
    """Settings of a training that takes a second."""
    settings = load_settings({**TINY, **changes})
    assert isinstance(settings, PPOSettings)
    return settings


def same_weights(first: Path, second: Path) -> bool:
    """Whether two models have the same weights, bit for bit."""
    one, other = (load_file(folder / "policy.safetensors") for folder in (first, second))
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


class Killed(BaseException):
    """What ends a training at once."""


def killed_at(steps: int, monkeypatch: pytest.MonkeyPatch, settings: AnySettings, folder: Path) -> None:
    """Train until so many steps, and no further."""

    def on_step(keeper: training.ProgressKeeper) -> bool:
        if keeper.num_timesteps > steps:
            raise Killed
        return True

    with monkeypatch.context() as patch:
        patch.setattr(training.ProgressKeeper, "_on_step", on_step)
        with pytest.raises(Killed):
            train(settings, folder, threads=1, tensorboard=False)


# ---------------------------------------------------------------------------------------------------------- the worlds


def test_a_stage_has_its_share_of_the_rows_and_the_stages_before_it_the_rest() -> None:
    settings = tiny(n_envs=100)
    for number, counts in enumerate([[100], [75, 25], [50, 25, 25]]):
        rows = rows_of_stage(settings.curriculum, settings.stages, number, 100)
        assert [count for _, count in rows] == counts
        expected = [settings.stages[number][0], *(stage[0] for stage in settings.stages[:number])]
        assert [scenario for scenario, _ in rows] == expected


def test_rows_of_a_stage_are_worlds_of_its_scenarios_with_seeds_of_their_own() -> None:
    settings = tiny()
    env = make_training_env(settings, 3)
    worlds = curriculum_of(env)
    assert isinstance(worlds, CurriculumVecEnv)
    for stage, counts in enumerate([[8], [6, 2], [4, 2, 2]]):
        if stage:
            worlds.enter(stage)
        seen, first = env.reset(), 0
        scenarios = [settings.stages[stage][0], *(before[0] for before in settings.stages[:stage])]
        for scenario, count in zip(scenarios, counts, strict=True):
            seeds = TRAINING_SEEDS + 3 * training.SEED_BLOCK + 8 * stage + first
            alone = Simulation(scenario, count).reset(seeds=list(range(seeds, seeds + count)))[:, 0]
            assert np.array_equal(seen[first : first + count], alone)
            first += count
        assert all(env.observation_space.contains(row) for row in seen)


def test_a_state_of_another_stage_is_restored_bit_for_bit() -> None:
    here, there = (make_training_env(tiny(history=[2]), 0) for _ in range(2))
    here.reset()
    there.reset()
    stages = curriculum_of(here)
    assert stages is not None
    stages.enter(2)
    here.reset()
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 8, 2)).astype(np.float32)
    here.step(actions[0])
    there.restore(here.save())
    for action in actions:
        came, alike = here.step(action), there.step(action)
        for number in range(3):
            assert np.array_equal(np.asarray(came[number]), np.asarray(alike[number]))


# -------------------------------------------------------------------------------------------------------- the training


@pytest.mark.parametrize("history", [[], [2]])
def test_a_training_killed_in_a_later_stage_ends_with_the_same_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, history: list[int]
) -> None:
    settings = tiny(history=history)
    train(settings, tmp_path / "whole", threads=1, tensorboard=False)
    killed_at(700, monkeypatch, settings, tmp_path / "cut")
    train(settings, tmp_path / "cut", threads=1, tensorboard=False)
    assert same_weights(tmp_path / "whole", tmp_path / "cut")
    whole, cut = (read_config(tmp_path / name)["runs"]["0"] for name in ("whole", "cut"))
    assert whole["entered"] == cut["entered"] and [one["steps"] for one in whole["entered"]] == [256, 512]


def test_stages_change_what_is_learned_and_are_told_in_record_and_card(tmp_path: Path) -> None:
    train(tiny(), tmp_path / "stages", threads=1, tensorboard=False)
    train(tiny(curriculum=[]), tmp_path / "plain", threads=1, tensorboard=False)
    assert not same_weights(tmp_path / "stages", tmp_path / "plain")
    config, card = read_config(tmp_path / "stages"), (tmp_path / "stages" / "card.md").read_text(encoding="utf-8")
    assert [stage["success"] for stage in config["settings"]["curriculum"]] == [0.0, 0.0, None]
    assert [scenario["name"] for scenario in config["scenarios"]] == ["dynamic"]  # by which it is judged
    assert "- Stage 1: worlds of static" in card and "begun at 256 steps (seed 0)" in card
    assert "curriculum" not in read_config(tmp_path / "plain")["settings"]


def test_a_stage_that_is_not_learned_lasts(tmp_path: Path) -> None:
    stages = [{"success": 1.0}, {}]
    train(tiny(curriculum=stages, n_timesteps=512), tmp_path / "model", threads=1, tensorboard=False)
    assert read_config(tmp_path / "model")["runs"]["0"].get("entered", []) == []
    assert "never reached" in (tmp_path / "model" / "card.md").read_text(encoding="utf-8")


def test_the_command_takes_the_stages_of_another_file(tmp_path: Path) -> None:
    plain = {key: value for key, value in TINY.items() if key != "curriculum"} | {"n_timesteps": 384}
    (tmp_path / "plain.yaml").write_text(json.dumps(plain), encoding="utf-8")
    (tmp_path / "stages.yaml").write_text(json.dumps({"curriculum": STAGES}), encoding="utf-8")
    arguments = ["train", str(tmp_path / "plain.yaml"), "--out", str(tmp_path / "model"), "--threads", "1"]
    assert main([*arguments, "--curriculum", str(tmp_path / "stages.yaml")]) == 0
    assert len(read_config(tmp_path / "model")["settings"]["curriculum"]) == 3
    assert main([*arguments, "--curriculum", str(tmp_path / "plain.yaml")]) == 2


def test_robots_with_other_limits_in_each_episode_are_trained_and_told(tmp_path: Path) -> None:
    ranges = {"robot.max_speed": {"uniform": [0.5, 1.5]}, "lidar.noise": {"choice": [0.0, 0.02]}}
    settings = tiny(overrides={"time.limit": 3.0, **ranges}, n_timesteps=384)
    train(settings, tmp_path / "model", threads=1, tensorboard=False)
    config = read_config(tmp_path / "model")
    assert config["scenarios"][0]["robot"]["max_speed"] == {"uniform": [0.5, 1.5]}
    assert config["robot"]["max_speed"] == 1.5


# ----------------------------------------------------------------------------------------------------------- faults


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"curriculum": [{}, {}]}, r"curriculum\.0\.success: got None, expected a share"),
        ({"curriculum": [{"success": 0.5}]}, r"curriculum\.0\.success: got 0.5, expected none"),
        ({"curriculum": [{"share": 0.5}]}, r"curriculum\.0\.share: got 0.5, expected 1"),
        ({"curriculum": [{"success": 0.5}, {"share": 0.0}]}, r"curriculum\.1\.share: got 0.0, expected more than 0"),
        ({"curriculum": [{"sucess": 0.5}]}, "did you mean 'success'"),
        ({"curriculum": [{"scenarios": ["statc"]}]}, "did you mean 'static'"),
        ({"curriculum": [{"overrides": {"world.obstacle": 3}}]}, "did you mean 'obstacles'"),
        ({"algo": "sac"}, "unknown key 'curriculum'|curriculum: unknown key"),
    ],
)
def test_stages_that_cannot_be_are_refused(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(ScenarioError, match=told):
        load_settings({**{key: TINY[key] for key in ("algo", "scenarios", "curriculum", "n_timesteps")}, **changes})


def test_a_stage_with_another_robot_is_refused() -> None:
    stages = [{"overrides": {"lidar.beams": 32}, "success": 0.5}, {}]
    with pytest.raises(ValueError, match="has another robot than"):
        make_training_env(tiny(curriculum=stages), 0)
