"""Reward terms and observation fields of one's own, learned from and evaluated: named, trusted, kept with the model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

import torch

from bug_gym import ObservationField
from bug_gym.agents import make_policy
from bug_gym.agents.learning.folder import read_config
from bug_gym.agents.learning.models import write_agent
from bug_gym.agents.learning.networks import RobotEncoding
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.learning.settings import PPOSettings, load_settings
from bug_gym.agents.learning.sweep_settings import load_sweep
from bug_gym.agents.learning.training import make_model, make_training_env, rebuild
from bug_gym.cli import main
from bug_gym.config import ScenarioError, load
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.plan import make_plan
from bug_gym.navigation_env import NavigationEnv
from bug_gym.observation import as_dict, as_flat, dict_space, flat_space
from bug_gym.policy import MisfitError
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

CODE = """
def near(ranges):
    return -1.0 * (ranges.min(axis=1) < 1.0)

def last(action):
    return action
"""
SCENARIO = """
name: mine
world: {family: field}
time: {limit: 3.0}
reward_terms:
  near: {function: rewards.py:near, weight: 0.25}
observation_fields:
  last: {function: "rewards.py:last", shape: [2], low: -2, high: 2}
"""
TRAINING = """
algo: ppo
scenarios: [SCENARIO]
n_envs: 8
n_steps: 16
batch_size: 32
n_timesteps: 256
eval_freq: 256
eval_episodes: 4
test_episodes: 4
history: [2]
policy_kwargs: {net_arch: [8]}
"""


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with functions, a scenario that names them, and a training in it."""
    (tmp_path / "rewards.py").write_text(CODE, encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(SCENARIO, encoding="utf-8")
    text = TRAINING.replace("SCENARIO", (tmp_path / "mine.yaml").as_posix())
    (tmp_path / "training.yaml").write_text(text, encoding="utf-8")
    return tmp_path


def test_a_function_that_has_changed_since_makes_another_training(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["train", str(files / "training.yaml"), "--out", str(files / "model"), "--threads", "1", "--trust"]
    assert main(command) == 0
    assert main(command) == 0  # it is done
    (files / "rewards.py").write_text(CODE.replace("1.0)", "0.5)"), encoding="utf-8")
    assert main(command) == 2
    assert "is of another training: scenarios.0.reward_terms.near has changed since" in capsys.readouterr().err
    (files / "model" / "config.json").unlink()
    assert main(command) == 2
    assert "checkpoint.pt is of another training: scenarios.0.reward_terms.near was" in capsys.readouterr().err


def test_a_training_learns_from_them_and_says_so(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = files / "model"
    main(["train", str(files / "training.yaml"), "--out", str(out), "--threads", "1", "--trust"])
    config, card = read_config(out), (out / "card.md").read_text(encoding="utf-8")
    assert config["robot"]["own"] == [["last", 2, 2.0]]
    assert "Made again by `bug-gym train training.yaml --trust --threads 1`" in card
    assert f"Reward terms of its own: near = 0.25 x `{files}/rewards.py:near`" in card
    assert f"Observation fields of its own: last = `{files}/rewards.py:last`" in card
    env = NavigationEnv(files / "mine.yaml", trust=True)
    policy: Any = make_policy(f"{out}/", env)
    observation, _ = env.reset(seed=0)
    action, state = policy.predict(observation)
    observation = env.step(action)[0]
    assert policy.predict(observation, state)[0].shape == (2,)
    with pytest.raises(MisfitError, match="own"):
        make_policy(f"{out}/", NavigationEnv("static"))
    with pytest.raises(ScenarioError, match="trust=True"):
        rebuild(out)
    robot_width = env.spaces.fields[-1].end  # behind it lies the history, a lag of 180 beams and a goal
    assert rebuild(out, trust=True).observation_space.shape == (robot_width + 180 + 2,)


def test_a_model_that_was_trained_alone_sees_them_among_several_robots(files: Path) -> None:
    settings = load_settings(files / "training.yaml", trust=True)
    robot = RobotModel.of(Sensors.of(settings.loaded[0]))
    network = make_model(settings, make_training_env(settings, 0), 0).policy
    point = {
        "steps": 0,
        "seconds": 0.0,
        "cpu_seconds": 0.0,
        "success": 0.0,
        "collision": 0.0,
        "timeout": 1.0,
        "time": None,
    }
    write_agent(files, network, settings, robot, {"0": {"curve": [point], "best": point, "held_out": {}}})
    one = load(files / "mine.yaml", trust=True)
    three = load(one, {"robots.count": 3}, trust=True)
    simulation = Simulation(three)
    simulation.reset(seeds=[0])
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (1, 3, 2)).astype(np.float32)
    flat = simulation.step(drawn).observation[0]
    seen = as_dict(flat, simulation.fields)
    np.testing.assert_array_equal(seen["last"], flat[:, -2:])
    expected, _ = make_policy(f"{files}/", one).predict(as_flat(seen, Sensors.of(one).fields))
    policy: Any = make_policy(f"{files}/", three)
    for observation in (flat, seen):
        np.testing.assert_array_equal(policy.predict(observation)[0], expected)
    named, _ = policy.predict({f"robot_{number}": row for number, row in enumerate(flat)})
    np.testing.assert_allclose(np.stack(list(named.values())), expected, atol=1e-6)


def test_data_cannot_grant_itself_trust(files: Path) -> None:
    settings = load_settings(files / "training.yaml")
    with pytest.raises(ScenarioError, match=r"reward_terms\.near is the code"):
        make_training_env(settings, 0)
    with pytest.raises(ScenarioError, match="unknown key"):
        load_settings(files / "training.yaml", {"_trust": True})
    with pytest.raises(ScenarioError, match="a training is plain data"):
        load_settings(files / "training.yaml", {"overrides": {"reward_terms.more": lambda ranges: ranges[:, 0]}})


@pytest.mark.parametrize("form", ["dict", "flat"])
def test_the_first_layer_sees_them_over_their_greatest_size(form: str) -> None:
    field = ObservationField(function=lambda action: action, shape=(2,), low=[-4.0, 0.0], high=2.0)
    scenario = load("dynamic", observation_fields={"last": field})
    sensors = Sensors.of(scenario)
    robot = RobotModel.of(sensors)
    assert (
        RobotModel.from_dict(robot.as_dict()) == robot
        and "own" not in RobotModel.of(Sensors.of(load("dynamic"))).as_dict()
    )
    space = flat_space(sensors.fields) if form == "flat" else dict_space(sensors.fields)
    layer = RobotEncoding(space, robot.as_dict())
    flat = torch.ones(1, robot.width)
    flat[:, -2:] = torch.tensor([-4.0, 2.0])
    parts = {one.name: flat[:, one.begin : one.end] for one in sensors.fields}
    features = layer(flat if form == "flat" else parts)
    assert features.shape == (1, layer.features_dim) and features[0, -2:].tolist() == [-1.0, 0.5]


def test_evaluations_drive_in_them_where_they_are_trusted(files: Path) -> None:
    scenario = str(files / "mine.yaml")
    with pytest.raises(ScenarioError, match="trust=True"):
        evaluate(["bug2"], scenario, episodes=1)
    alone = evaluate(["bug2"], scenario, episodes=2, trust=True)
    shared = evaluate(["bug2"], scenario, episodes=2, trust=True, workers=2)
    plain = evaluate(["bug2"], scenario, episodes=2, overrides={"reward_terms": {}, "observation_fields": {}})
    told = [[(row.seed, row.outcome, row.path_length) for row in rows] for rows in (alone, shared, plain)]
    assert told[0] == told[1] == told[2]  # a scripted policy heeds neither
    manifest = make_plan(["bug2"], scenario, episodes=1, trust=True).manifest()
    (entry,) = manifest["scenarios"].values()
    assert set(entry["code"]) == {"reward_terms.near", "observation_fields.last"} and all(entry["code"].values())


def test_what_a_training_or_a_sweep_names_lies_beside_it(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the working directory lie others of the same names, which must not be taken."""
    elsewhere = files / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "rewards.py").write_text("raise AssertionError('of another folder')\n", encoding="utf-8")
    (elsewhere / "mine.yaml").write_text("world: {family: empty}\n", encoding="utf-8")
    monkeypatch.chdir(elsewhere)
    stages = "curriculum: [{scenarios: [mine.yaml], success: 0.5}, {overrides: {reward_terms.more: rewards.py:near}}]\n"
    (files / "training.yaml").write_text(TRAINING.replace("SCENARIO", "mine.yaml") + stages, encoding="utf-8")
    (files / "sweep.yaml").write_text("training: training.yaml\nspace: {gamma: [0.9]}\n", encoding="utf-8")
    for settings in (
        load_settings("../training.yaml", trust=True),
        load_sweep("../sweep.yaml", trust=True).trained_with({"gamma": 0.9}),
    ):
        assert isinstance(settings, PPOSettings)
        judged, (first,), (second,) = settings.loaded[0], *settings.stages
        assert [[*scenario.reward_terms] for scenario in (judged, first, second)] == [
            ["near"],
            ["near"],
            ["near", "more"],
        ]


def test_what_a_sweep_changes_lies_beside_it(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (files / "mine.yaml").rename(files / "other.yaml")
    elsewhere = files / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    text = (
        "training: ppo_rush\noverrides: {scenarios: [other.yaml], curriculum: [{scenarios: [other.yaml]}]}\n"
        "space: {overrides.reward_terms.more: [rewards.py:near, rewards.py:last]}\n"
    )
    (files / "sweep.yaml").write_text(text, encoding="utf-8")
    sweep = load_sweep("../sweep.yaml", trust=True)
    for function in sweep.grid["overrides.reward_terms.more"]:
        trained = sweep.trained_with({"overrides.reward_terms.more": function})
        assert [{*scenario.reward_terms} for (scenario,) in trained.worlds.values()] == [{"near", "more"}] * 2


def test_a_sweep_asks_for_trust_for_the_code_of_stages_too(files: Path) -> None:
    (files / "bare.yaml").write_text("world: {family: field}\n", encoding="utf-8")
    stages = "curriculum: [{overrides: {reward_terms.more: rewards.py:near}}]\n"
    (files / "training.yaml").write_text(TRAINING.replace("SCENARIO", "bare.yaml") + stages, encoding="utf-8")
    (files / "sweep.yaml").write_text("training: training.yaml\nspace: {gamma: [0.9]}\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match="trust"):
        load_sweep(files / "sweep.yaml")
    load_sweep(files / "sweep.yaml", trust=True)


def test_a_sweep_runs_functions_where_it_is_trusted(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (files / "sweep.yaml").write_text("training: training.yaml\nspace: {gamma: [0.9]}\n", encoding="utf-8")
    command = ["sweep", str(files / "sweep.yaml"), "--out", str(files / "swept")]
    assert main(command) == 2 and "--trust" in capsys.readouterr().err
    assert not (files / "swept").exists()
    assert main([*command, "--trust"]) == 0
    assert "reward_terms" in read_config(files / "swept" / "trial-0" / "seed-0")["scenarios"][0]


def test_a_suite_runs_no_code_of_its_own_accord(files: Path) -> None:
    suite = files / "suite.yaml"
    suite.write_text("scenarios: [mine.yaml]\npolicies: [bug2]\nseeds: {count: 1}\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match="trust=True"):
        evaluate(None, str(suite))
    assert len(evaluate(None, str(suite), trust=True)) == 1
    assert np.isfinite(evaluate(None, str(suite), trust=True)[0].path_length)
