"""Trainings with stable-baselines3: settings, the encoding, resuming, and the folder that comes out."""

from __future__ import annotations

import copy
import json
import logging
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

import torch

from bug_gym.agents.learning import training
from bug_gym.agents.learning.checkpoints import Rollouts, save_checkpoint
from bug_gym.agents.learning.folder import model_folder, read_config
from bug_gym.agents.learning.models import command
from bug_gym.agents.learning.networks import RobotEncoding
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.learning.settings import AnySettings, load_settings, training_names
from bug_gym.agents.learning.training import (
    make_model,
    make_training_env,
    require_same_network,
    robot_of,
    train,
    train_seeds,
    usable_cores,
)
from bug_gym.cli import main, make_parser
from bug_gym.config import ScenarioError, load
from bug_gym.held_out import TEST_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS
from bug_gym.observation import as_dict, dict_space, flat_space
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

ROOT = Path(__file__).resolve().parents[3]
TINY = {
    "algo": "ppo",
    "scenarios": ["dynamic"],
    "n_envs": 8,
    "n_steps": 16,
    "batch_size": 32,
    "n_timesteps": 1024,
    "eval_freq": 300,
    "eval_episodes": 4,
    "test_episodes": 4,
    "save_freq": 128,
}


def tiny(**changes: Any) -> AnySettings:
    """Settings of a training that takes a second."""
    return load_settings({**TINY, "overrides": {"time.limit": 3.0}, **changes})


def weights(folder: Path) -> dict[str, torch.Tensor]:
    from safetensors.torch import load_file

    return load_file(folder / "policy.safetensors")


def same_weights(first: Path, second: Path) -> bool:
    """Whether two models have the same weights, bit for bit."""
    one, other = weights(first), weights(second)
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


# --------------------------------------------------------------------------------------------------------- settings


@pytest.mark.parametrize("name", training_names())
def test_each_training_that_is_shipped_can_be_loaded_and_its_scenarios_share_a_robot(name: str) -> None:
    settings = load_settings(name)
    assert settings.name == name
    assert robot_of(settings.loaded).beams == 64


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"algo": "pppo"}, "'ppo', 'sac', 'dqn'"),
        ({"n_stepps": 4}, "did you mean 'n_steps'"),
        ({"n_steps": 0}, "n_steps"),
        ({"learning_rate": "linear"}, "lin_1e-3"),
        ({"scenarios": []}, "scenarios"),
        ({"scenarios": ["dynamik"]}, "dynamic"),
        ({"history": [0]}, "history"),
        ({"buffer_size": 5}, "buffer_size"),
        ({"batch_size": 1}, "batch_size: got 1, expected at least 2"),
        ({"n_envs": 1, "n_steps": 1}, "n_steps: got 1 with n_envs 1, expected 2 samples or more"),
    ],
)
def test_a_setting_that_cannot_be_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        tiny(**changes)


@pytest.mark.parametrize("weight", ["auto_0", "auto_-1", "auto_x", "much", "auto_nan"])
def test_a_weight_of_the_entropy_that_cannot_be_is_refused(weight: str) -> None:
    with pytest.raises(ScenarioError, match=f"ent_coef: got '{weight}', expected a number, auto, or auto_"):
        load_settings("sac_dynamic", {"ent_coef": weight})
    for known in ("auto", "auto_0.1", 0.1):
        assert load_settings("sac_dynamic", {"ent_coef": known}).algo == "sac"


@pytest.mark.parametrize(
    ("algo", "wrong", "right"), [("sac", "discrete", "continuous"), ("dqn", "continuous", "discrete")]
)
def test_actions_that_an_algorithm_cannot_learn_are_refused(algo: str, wrong: str, right: str) -> None:
    short = {"algo": algo, "scenarios": ["dynamic"], "n_timesteps": 20_000}
    assert load_settings(short).action == load_settings({**short, "action": right}).action == right
    with pytest.raises(ScenarioError, match=f"action: got '{wrong}', expected '{right}'"):
        load_settings({**short, "action": wrong})


@pytest.mark.parametrize("name", ["sac_dynamic", "dqn_candidates"])
@pytest.mark.parametrize(("n_timesteps", "train_freq"), [(64, 1), (100, 1), (100, 7)])
def test_a_training_learns_something_or_is_refused(name: str, n_timesteps: int, train_freq: int) -> None:
    short: dict[str, Any] = {"n_timesteps": n_timesteps, "n_envs": 8, "train_freq": train_freq, "gradient_steps": 1}
    short |= {"eval_episodes": 1, "test_episodes": 1, "overrides.time.limit": 1.0}
    steps = 8 * train_freq * math.ceil(n_timesteps / (8 * train_freq))  # whole rounds of all worlds
    with pytest.raises(ScenarioError, match=f"learning_starts: got {steps}, expected less: .* {steps} steps"):
        load_settings(name, {**short, "learning_starts": steps})
    settings = load_settings(name, {**short, "learning_starts": steps - 1})
    env = make_training_env(settings, 0)
    model = make_model(settings, env, 0)
    model.learn(settings.n_timesteps)
    env.close()
    assert model.num_timesteps == steps and model._n_updates > 0


def test_an_unknown_training_is_refused_with_the_nearest_names() -> None:
    with pytest.raises(ScenarioError, match="ppo_dynamic"):
        load_settings("ppo_dynamik")


def test_a_linear_rate_falls_from_its_start_to_zero() -> None:
    settings = tiny(learning_rate="lin_1e-3")
    assert [settings.rate(share) for share in (1.0, 0.5, 0.0)] == [1e-3, 5e-4, 0.0]
    assert tiny(learning_rate=2e-4).rate(0.1) == 2e-4


def test_scenarios_with_different_robots_are_not_trained_in_together() -> None:
    with pytest.raises(ValueError, match="u_trap.*beams 64, not 360"):
        make_training_env(tiny(scenarios=["dynamic", "u_trap"]), 0)


def test_worlds_of_training_validation_and_test_are_apart() -> None:
    env = make_training_env(tiny(), 3)
    env.reset()
    seeds = env.get_attr("simulation")[0].world.seed
    assert seeds.min() >= TRAINING_SEEDS > TEST_SEEDS + 10**9
    assert seeds.max() < VALIDATION_SEEDS


# --------------------------------------------------------------------------------------------------------- encoding


def robot(overrides: dict[str, Any] | None = None) -> tuple[RobotModel, Sensors]:
    sensors = Sensors.of(load("static", overrides))
    return RobotModel.of(sensors), sensors


def test_clearances_are_encoded_as_the_formula_says() -> None:
    model, sensors = robot()
    encoding = RobotEncoding(flat_space(sensors.fields), model.as_dict())
    flat = torch.zeros(3, model.width)
    flat[:, 64] = 1.0
    for row, distance in enumerate((0.2, 1.0, 5.0)):
        flat[row, :64] = distance
    offset = 0.5 / (4.8 + 0.3)
    expected = [0.5 / 0.3 - offset, 0.5 / (0.8 + 0.3) - offset, 0.0]
    assert encoding(flat)[:, :64].mean(dim=1).tolist() == pytest.approx(expected, abs=1e-6)


def test_goal_and_velocity_are_scaled_by_what_the_robot_can() -> None:
    model, sensors = robot({"robot.max_speed": 2.0})
    flat = torch.zeros(1, model.width)
    flat[0, 64:66] = torch.tensor([-6.0, 8.0])
    flat[0, 69:71] = torch.tensor([1.0, 0.75])
    features = RobotEncoding(flat_space(sensors.fields), model.as_dict())(flat)[0, 64:].tolist()
    assert features == pytest.approx([-0.6, 0.8, 1.0, 1.0, 0.5, 0.5], abs=1e-6)


@pytest.mark.parametrize("scenario", ["static", "crossing_robots"])
def test_dict_and_flat_observations_are_encoded_alike(scenario: str) -> None:
    simulation = Simulation(scenario, 3)
    flat = simulation.reset(seeds=[0, 1, 2])[:, 0]
    model = RobotModel.of(Sensors.of(simulation.scenario))
    named = {name: torch.from_numpy(value) for name, value in as_dict(flat, simulation.fields).items()}
    of_flat = RobotEncoding(flat_space(simulation.fields), model.as_dict())
    of_dict = RobotEncoding(dict_space(simulation.fields), model.as_dict())
    found = of_flat(torch.from_numpy(flat))
    assert found.shape == (3, of_flat.features_dim)
    assert torch.equal(found, of_dict(named))


# --------------------------------------------------------------------------------------------------------- training


def test_rollouts_are_shuffled_by_seed_and_round_alone() -> None:
    orders = []
    for seed, rounds in ((1, 0), (1, 0), (1, 1), (2, 0)):
        env = make_training_env(tiny(), 0)
        model: Any = make_model(tiny(), env, seed)
        model.policy.set_training_mode(False)
        buffer = model.rollout_buffer
        assert isinstance(buffer, Rollouts)
        buffer.rounds = rounds
        buffer.rewards[:] = 0.0
        buffer.values[:] = np.arange(128).reshape(16, 8)
        np.random.default_rng(rounds).random()
        orders.append(torch.cat([batch.old_values for batch in buffer.get(32)]).tolist())
    assert orders[0] == orders[1]
    assert orders[0] != orders[2] and orders[0] != orders[3]
    assert sorted(orders[0]) == list(range(128))


@pytest.mark.parametrize("changes", [{}, {"history": [2, 5]}, {"scenarios": ["dynamic", "static"]}])
def test_a_training_that_was_cut_off_ends_with_the_same_model(tmp_path: Path, changes: dict[str, Any]) -> None:
    settings = tiny(**changes)
    train(settings, tmp_path / "whole", threads=1, tensorboard=False)
    cut = tmp_path / "cut"
    train(settings, cut, threads=1, tensorboard=False, minutes=1e-9)
    assert read_config(cut)["runs"]["0"]["curve"][-1]["steps"] < settings.n_timesteps
    train(settings, cut, threads=1, tensorboard=False)
    assert same_weights(tmp_path / "whole", cut)


@pytest.mark.parametrize("changes", [{}, {"history": [2, 5]}, {"scenarios": ["dynamic", "static"]}])
@pytest.mark.parametrize("saves", [1, 4, 7])
def test_a_training_that_ended_after_a_checkpoint_goes_on_from_there_to_the_same_model(
    saves: int, changes: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the middle of its episodes, of its curve and of its learning."""
    settings = tiny(**changes)
    train(settings, tmp_path / "whole", threads=1, tensorboard=False)
    saved = []

    def save_and_end(*arguments: Any) -> None:
        save_checkpoint(*arguments)
        saved.append(arguments[0])
        if len(saved) == saves:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(training, "save_checkpoint", save_and_end)
        train(settings, tmp_path / "cut", threads=1, tensorboard=False)
    train(settings, tmp_path / "cut", threads=1, tensorboard=False)
    assert same_weights(tmp_path / "whole", tmp_path / "cut")
    whole, cut = (
        [{name: value for name, value in point.items() if "seconds" not in name} for point in run["curve"]]
        for run in (read_config(tmp_path / folder)["runs"]["0"] for folder in ("whole", "cut"))
    )
    assert cut == whole


def test_a_training_killed_outright_and_started_again_ends_with_the_same_model(tmp_path: Path) -> None:
    settings = tiny(n_timesteps=6144)
    train(settings, tmp_path / "whole", threads=1, tensorboard=False)
    killed = tmp_path / "killed"
    script = (
        "import sys\nfrom bug_gym.agents.learning.training import train\n"
        "from bug_gym.agents.learning.settings import load_settings\n"
        "train(load_settings(eval(sys.argv[1])), sys.argv[2], threads=1, tensorboard=False)"
    )
    data = {**TINY, "overrides": {"time.limit": 3.0}, "n_timesteps": 6144}
    process = subprocess.Popen([sys.executable, "-c", script, repr(data), str(killed)], cwd=ROOT)
    deadline = time.monotonic() + 60.0
    while not (killed / "checkpoint.pt").exists() and time.monotonic() < deadline:
        time.sleep(0.002)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert (killed / "checkpoint.pt").exists() and not (killed / "config.json").exists()
    train(settings, killed, threads=1, tensorboard=False)
    assert same_weights(tmp_path / "whole", killed)


def test_the_cores_are_counted_where_the_system_tells_no_affinity(monkeypatch: pytest.MonkeyPatch) -> None:
    assert usable_cores() == len(os.sched_getaffinity(0))
    monkeypatch.delattr(os, "sched_getaffinity")
    assert usable_cores() == os.cpu_count()


def test_the_folder_of_another_training_is_refused(tmp_path: Path) -> None:
    train(tiny(), tmp_path, threads=1, tensorboard=False)
    with pytest.raises(ValueError, match="another training: settings"):
        train(tiny(gamma=0.9), tmp_path, threads=1, tensorboard=False)
    with pytest.raises(ValueError, match="another training: seed"):
        train(tiny(), tmp_path, seed=1, threads=1, tensorboard=False)


def without_checkpoints(algo: str, **changes: Any) -> AnySettings:
    """Settings of a training of an algorithm that begins again where it is cut off."""
    own = {key: value for key, value in TINY.items() if key not in ("n_steps", "save_freq")}
    short = {"learning_starts": 16, "n_timesteps": 160, "eval_freq": 80, "overrides": {"time.limit": 3.0}}
    return load_settings({**own, **short, "algo": algo, **changes})


def held(folder: Path) -> dict[str, bytes]:
    """What the files of a folder hold, but for locks."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.parametrize("algo", ["sac", "dqn"])
def test_what_minutes_ended_is_not_begun_again(algo: str, tmp_path: Path) -> None:
    settings = without_checkpoints(algo)
    out = train_seeds(settings, tmp_path, seeds=[0, 1], threads=1, minutes=1e-9)
    curve = read_config(tmp_path / "seed-0")["runs"]["0"]["curve"]
    done = curve[-1]["steps"]
    assert done < 160 and f"Ended by --minutes after {done} of 160 steps" in (out / "card.md").read_text()
    before = held(tmp_path)
    train_seeds(settings, tmp_path, seeds=[0, 1], threads=1, minutes=1e-9)  # both are done
    assert held(tmp_path) == before
    told = rf"seed-0 holds a model whose training was ended after {done} of 160 steps by --minutes; .* give a new --out"
    for more in (None, 60.0):
        with pytest.raises(ValueError, match=told):
            train_seeds(settings, tmp_path, seeds=[0, 1], threads=1, minutes=more)
    with pytest.raises(ValueError, match=told):
        train(settings, tmp_path / "seed-0", threads=1, minutes=1e-9)
    assert held(tmp_path) == before


def test_what_minutes_ended_goes_on_here_from_its_checkpoint_and_not_elsewhere(tmp_path: Path) -> None:
    settings = tiny()
    train(settings, tmp_path, threads=1, tensorboard=False, minutes=1e-9)
    before = held(tmp_path)
    with pytest.raises(ValueError, match="cannot be gone on with by other processes: give a new --out"):
        train_seeds(settings, tmp_path, workers=2)
    checkpoint = (tmp_path / "checkpoint.pt").rename(tmp_path / "aside")
    with pytest.raises(ValueError, match="cannot be gone on with: give a new --out"):
        train_seeds(settings, tmp_path, threads=1)
    checkpoint.rename(tmp_path / "checkpoint.pt")
    assert held(tmp_path) == before
    train_seeds(settings, tmp_path, threads=1)
    assert read_config(tmp_path)["runs"]["0"]["curve"][-1]["steps"] == 1024


def test_a_damaged_checkpoint_is_refused(tmp_path: Path) -> None:
    train(tiny(), tmp_path, threads=1, tensorboard=False)
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(ValueError, match="checkpoint.pt is damaged"):
        train(tiny(), tmp_path, threads=1, tensorboard=False)


def test_a_checkpoint_of_other_code_or_threads_is_refused_with_a_way_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train(tiny(), tmp_path, threads=1, tensorboard=False, minutes=1e-9)
    before = held(tmp_path)
    with pytest.raises(ValueError, match=r"threads was 1, is now 2; --threads 1 goes on with it"):
        train(tiny(), tmp_path, threads=2, tensorboard=False)
    with monkeypatch.context() as patch:
        patch.setattr(training, "source_digest", lambda: "another")
        told = r"checkpoint.pt was saved by other code \(bug_gym_source was [0-9a-f]{16}, is now another\), .* or remove it"
        with pytest.raises(ValueError, match=told):
            train(tiny(), tmp_path, threads=1, tensorboard=False)
    assert held(tmp_path) == before
    train(tiny(), tmp_path, threads=1, tensorboard=False)
    assert read_config(tmp_path)["runs"]["0"]["curve"][-1]["steps"] == 1024


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"algo": "sac", "learning_starts": 100, "n_timesteps": 300, "batch_size": 32},
        {"algo": "dqn", "learning_starts": 100, "n_timesteps": 300, "batch_size": 32},
    ],
)
def test_every_algorithm_trains_and_keeps_what_made_its_model(tmp_path: Path, changes: dict[str, Any]) -> None:
    data = {key: value for key, value in TINY.items() if key not in ("n_steps", "save_freq") or "algo" not in changes}
    settings = load_settings({**data, "overrides": {"time.limit": 3.0}, **changes})
    before = copy.deepcopy(make_model(settings, make_training_env(settings, 0), 0).policy.state_dict())
    train(settings, tmp_path, threads=1)
    assert any(not torch.equal(value, before[name]) for name, value in weights(tmp_path).items())
    config = read_config(tmp_path)
    assert config["settings"] == json.loads(settings.model_dump_json())
    assert config["scenarios"][0]["name"] == "dynamic" and config["seed"] == 0
    assert {"torch", "stable_baselines3", "python", "bug_gym"} <= config["machine"].keys()
    assert (tmp_path / "curve.csv").read_text(encoding="utf-8").startswith("steps,seconds,cpu_seconds,success")
    assert list((tmp_path / "tensorboard").glob("events*"))
    assert (tmp_path / "policy.onnx").stat().st_size < 2**20
    assert "bug-gym train" in (tmp_path / "card.md").read_text(encoding="utf-8")


# ------------------------------------------------------------------------------------------------------ command line


def tiny_file(folder: Path) -> Path:
    path = folder / "tiny.yaml"
    data = {**TINY, "overrides": {"time.limit": 3.0}}
    path.write_text("".join(f"{key}: {json.dumps(value)}\n" for key, value in data.items()), encoding="utf-8")
    return path


def test_the_command_trains_several_seeds_and_gathers_the_best(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["train", str(tiny_file(tmp_path)), "--seeds", "2", "--threads", "1", "--out", str(out)]
    assert main([*arguments, "--set", "gamma=0.9"]) == 0
    assert f"{out}/agent" in capsys.readouterr().out
    config = read_config(out / "agent")
    scores = {seed: run["best"]["success"] for seed, run in config["runs"].items()}
    assert list(scores) == ["0", "1"] and config["settings"]["gamma"] == 0.9
    assert scores[str(config["seed"])] == max(scores.values())
    assert same_weights(out / "agent", out / f"seed-{config['seed']}")
    made_at = (out / "seed-0" / "policy.onnx").stat().st_mtime_ns
    assert main([*arguments, "--set", "gamma=0.9"]) == 0
    assert (out / "seed-0" / "policy.onnx").stat().st_mtime_ns == made_at  # what is done is not done again
    assert "`bug-gym train tiny.yaml --seeds 2 --threads 1`" in (out / "agent" / "card.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("runs", "played", "seed", "seeds"),
    [
        ("0", 0, 0, 1),
        ("5", 5, 5, 1),
        ("012", 1, 0, 3),
        ("567", 6, 5, 3),
        ("39", 9, 9, 1),  # no command trains those alone: the one that is played
    ],
)
def test_the_command_on_a_card_trains_the_seeds_on_as_many_threads(
    runs: str, played: int, seed: int, seeds: int
) -> None:
    settings = json.loads(load_settings("ppo_static").model_dump_json())
    record = {"name": "ppo_static", "settings": settings, "runs": dict.fromkeys(runs, {}), "seed": played}
    for machine, threads in (({"machine": {"threads": 3}}, 3), ({}, None)):
        options = make_parser().parse_args(shlex.split(command({**record, **machine}))[1:])
        assert (options.seed, options.seeds, options.threads) == (seed, seeds, threads)


def test_the_command_on_a_card_makes_the_model_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tiny_file(tmp_path)
    assert main(["train", "tiny.yaml", "--seed", "5", "--threads", "1", "--out", "first"]) == 0
    told = re.search("Made again by `(.*)`;", Path("first", "card.md").read_text(encoding="utf-8"))
    assert told is not None
    assert main([*shlex.split(told[1])[1:], "--out", "again"]) == 0
    assert read_config(Path("again"))["seed"] == 5 and same_weights(Path("first"), Path("again"))


def test_of_a_file_of_ones_own_a_card_says_where_the_settings_are_that_its_command_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tiny_file(tmp_path)
    assert main(["train", "tiny.yaml", "--set", "policy_kwargs.net_arch=[5]", "--threads", "1", "--out", "first"]) == 0
    card = Path("first", "card.md").read_text(encoding="utf-8")
    told = re.search("Made again by `(.*)`;.*; what (.*) and `--set` said is `(.*)` in (.*)", card)
    assert told is not None
    settings = json.loads(Path("first", told[4]).read_text(encoding="utf-8"))[told[3]]
    Path(told[2]).write_text(json.dumps(settings), encoding="utf-8")
    assert main([*shlex.split(told[1])[1:], "--out", "again"]) == 0
    assert same_weights(Path("first"), Path("again"))


@pytest.mark.parametrize("changes", [{}, {"history": [], "gamma": 0.9}, {"start_from": "./o'neil's model"}])
def test_the_command_on_a_card_gives_the_settings_that_were_trained(changes: dict[str, Any]) -> None:
    settings = load_settings("ppo_rush", changes)
    record = {"name": "ppo_rush", "settings": json.loads(settings.model_dump_json()), "runs": {"0": {}}}
    words = shlex.split(command(record))
    pairs = [word.partition("=") for word in words[3:] if word != "--set"]
    assert words[:3] == ["bug-gym", "train", "ppo_rush"]
    assert load_settings("ppo_rush", {key: json.loads(value) for key, _, value in pairs}) == settings


@pytest.mark.parametrize(
    ("scenario", "stage", "trusts"),
    [
        ({}, {}, False),
        ({"reward_terms": {"near": {"function": "mine:near"}}}, {}, True),
        ({"observation_fields": {"near": {"function": "mine:near"}}}, {}, True),
        ({"world": {"family": "mine:World"}}, {}, True),
        ({"world": {"family": "mine"}}, {}, False),  # by the name that a package or a program gave it: code already
        ({}, {"overrides": {"reward_terms.near": "mine:near"}}, True),
        ({}, {"scenarios": ["static", {"world": {"family": "mine.py:World"}}]}, True),
        ({}, {"scenarios": ["gone.yaml"]}, False),
    ],
)
def test_the_command_on_a_card_trusts_what_names_code(
    scenario: dict[str, Any], stage: dict[str, Any], trusts: bool
) -> None:
    stages = [{"scenarios": [], "overrides": {}, **stage}]
    settings = {"scenarios": ["rush"], "overrides": {}, "curriculum": stages}
    record = {"name": "mine", "scenarios": [scenario], "settings": settings, "runs": {"0": {}}}
    assert command(record) == f"bug-gym train mine.yaml{' --trust' * trusts}"


def test_so_it_does_of_an_expert_that_is_code() -> None:
    for expert, trusts in (("bug2:turn=left", ""), ("mine:Mine:turn=left", " --trust")):
        settings = {"scenarios": ["rush"], "overrides": {}, "expert": expert}
        record = {"name": "mine", "scenarios": [{}], "settings": settings, "runs": {"0": {}}}
        assert command(record) == f"bug-gym train mine.yaml{trusts}"


@pytest.mark.parametrize(
    ("changes", "own"),
    [
        ({}, {"reward.goal": 5.0, "time.limit": 3.0}),
        ({"overrides.time.limit": 2.0, "overrides.lidar.beams": 8}, {"reward.goal": 5.0, "time.limit": 2.0, "lidar.beams": 8}),
        ({"overrides": {"time.limit": 2.0}}, {"time.limit": 2.0}),
        ({"overrides.lidar.beams": 8, "overrides": {"time.limit": 2.0}}, {"time.limit": 2.0, "lidar.beams": 8}),
    ],
)  # fmt: skip
def test_a_value_below_overrides_is_added_to_those_of_the_training(
    changes: dict[str, Any], own: dict[str, Any]
) -> None:
    training = TINY | {"overrides": {"reward.goal": 5.0, "time.limit": 3.0}}
    settings = load_settings(training, changes)
    assert settings.overrides == own and settings.loaded[0].time.limit == own["time.limit"]
    assert training["overrides"] == {"reward.goal": 5.0, "time.limit": 3.0}


def test_so_is_a_value_below_any_key_that_has_keys() -> None:
    of_network = {"policy_kwargs": {"net_arch": [8], "activation_fn": "tanh"}}
    settings = load_settings(TINY | of_network, {"policy_kwargs.net_arch": [32, 16]})
    assert (settings.policy_kwargs.net_arch, settings.policy_kwargs.activation_fn) == ((32, 16), "tanh")
    cloning: Any = load_settings("bc_hd_bug", {"data.episodes": 3})
    assert (cloning.data.policies, cloning.data.episodes) == (("hd_bug",), 3)
    with pytest.raises(ScenarioError, match="policy_kwargs.net_arc: unknown key, did you mean 'net_arch'"):
        load_settings(TINY, {"policy_kwargs.net_arc": [8]})
    with pytest.raises(ScenarioError, match="n_steps: got 8, expected keys and values, as n_steps.more is one"):
        load_settings(TINY | {"n_steps": 8}, {"n_steps.more": 3})


def test_below_overrides_that_are_none_nothing_is_added() -> None:
    with pytest.raises(ScenarioError, match="training: overrides: got 3, expected"):
        load_settings(TINY | {"overrides": 3}, {"overrides.lidar.beams": 8})


@pytest.mark.parametrize("algo", [{}, {"algo": None}])
def test_a_training_without_an_algorithm_lacks_it(algo: dict[str, Any]) -> None:
    data = {key: value for key, value in TINY.items() if key != "algo"} | algo
    with pytest.raises(ScenarioError, match="^training: algo: missing, expected one of 'ppo', 'sac', "):
        load_settings(data)


def test_a_model_can_begin_with_the_weights_of_another(tmp_path: Path) -> None:
    settings = tiny(n_timesteps=128)
    train(settings, tmp_path / "first", threads=1, tensorboard=False)
    still = tiny(n_timesteps=128, learning_rate=1e-30, start_from=str(tmp_path / "first"))
    train(still, tmp_path / "second", seed=5, threads=1, tensorboard=False)
    first, second = weights(tmp_path / "first"), weights(tmp_path / "second")
    assert all(torch.allclose(first[name], second[name]) for name in first)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"encoding": "linear"}, "encoding was 'clearance', is now 'linear'"),
        ({"policy_kwargs": {"activation_fn": "tanh"}}, "policy_kwargs.activation_fn was 'relu', is now 'tanh'"),
        ({"action": "discrete"}, "action was 'continuous', is now 'discrete'"),
        ({"history": [4]}, r"history was \[\], is now \[4\]"),
        ({"policy_kwargs": {"net_arch": [8]}}, r"policy_kwargs.net_arch was \[128, 128\], is now \[8\]"),
        ({"overrides": {"lidar.beams": 32}}, "beams was 64, is now 32"),
    ],
)
def test_weights_that_mean_something_else_are_not_begun_with(
    changes: dict[str, Any], said: str, tmp_path: Path
) -> None:
    for seeds in ([0], [0, 1]):
        with pytest.raises(ValueError, match=f"ppo_static is of another network: {said}"):
            train_seeds(tiny(start_from="ppo_static", **changes), tmp_path / "model", seeds=seeds, threads=1)
    assert not (tmp_path / "model").exists()


@pytest.mark.parametrize(("ours", "theirs"), [("sac", "ppo"), ("ppo", "sac"), ("dqn", "ppo")])
def test_the_network_of_another_algorithm_is_not_begun_with(ours: str, theirs: str, tmp_path: Path) -> None:
    model = {"ppo": "ppo_static", "sac": "sac_dynamic"}[theirs]
    settings = load_settings({"algo": ours, "scenarios": ["dynamic"], "n_timesteps": 100_000, "start_from": model})
    with pytest.raises(ValueError, match=f"is of another network: its algorithm was '{theirs}', is now '{ours}'"):
        train(settings, tmp_path / "model")
    assert not (tmp_path / "model").exists()


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"robot.kinematics": "holonomic"}, "kinematics differential, not holonomic"),
        ({"lidar.range": 7.0}, "range 5.0, not 7.0"),
        ({"lidar.fov": 3.0}, "first_angle"),
    ],
)
def test_a_word_is_said_once_of_a_model_of_another_robot_that_is_begun_with(
    overrides: dict[str, Any], said: str, caplog: pytest.LogCaptureFixture
) -> None:
    other = tiny(start_from="ppo_static", overrides=overrides)
    with caplog.at_level(logging.WARNING, logger="bug_gym"):
        require_same_network(model_folder("ppo_static"), tiny())
        assert not caplog.messages
        for _ in range(3):
            require_same_network(model_folder("ppo_static"), other)
    (told,) = caplog.messages
    assert "was made for another robot: " in told and said in told


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ppo_dinamic"], "ppo_dynamic"),
        (["ppo_dynamic", "--set", "gama=1"], "gamma"),
        (["ppo_dynamic", "--seed", "-1"], "seed"),
        (["ppo_dynamic", "--start-from", "nothing"], "nothing"),
        (["ppo_dynamic", "--set", "batch_size=1"], "batch_size: got 1, expected at least 2"),
        (["ppo_dynamic", "--set", "n_envs=1", "--set", "n_steps=1"], "n_steps: got 1 with n_envs 1"),
    ],
)
def test_bad_input_leaves_with_exit_code_2(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["train", *arguments, "--threads", "1"]) == 2
    assert said in capsys.readouterr().err


def test_list_names_the_trainings(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "trainings"]) == 0
    assert set(training_names()) <= set(capsys.readouterr().out.split())


# ------------------------------------------------------------------------------------------------------- divergence


@pytest.mark.parametrize(
    "changes", [{}, {"algo": "sac", "learning_starts": 16, "n_steps": None, "save_freq": None, "eval_freq": 1000}]
)
def test_a_training_that_diverges_says_which_when_and_at_what_rate(
    changes: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """torch tells all the numbers that came, and none of these."""
    settings = {**TINY, "overrides": {"time.limit": 3.0}, **changes, "name": "wild", "learning_rate": 1e9}
    path = tmp_path / "wild.yaml"
    path.write_text(json.dumps({key: value for key, value in settings.items() if value is not None}))
    assert main(["train", str(path), "--seed", "3", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    told = re.fullmatch(
        rf"bug-gym: error: wild \({settings['algo']}, seed 3\) has diverged after ([\d,]+) of 1,024 steps: (.*)", said
    )
    assert told is not None, said[:300]
    assert 0 < int(told[1].replace(",", "")) < 1024
    assert told[2] == "its network answers with NaN or infinity; learning_rate is 1000000000.0, try a smaller one"


def test_weights_that_are_no_numbers_are_found_at_a_validation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What drives by the largest of NaNs would go on to the end, and be written as a model."""
    own = {key: value for key, value in TINY.items() if key not in ("n_steps", "save_freq")}
    settings = load_settings({**own, "algo": "dqn", "overrides": {"time.limit": 3.0}, "learning_starts": 16})
    real = training.make_model

    def spoilt(*arguments: Any) -> Any:
        model = real(*arguments)
        with torch.no_grad():
            next(model.policy.parameters())[0] = math.nan
        return model

    monkeypatch.setattr(training, "make_model", spoilt)
    with pytest.raises(ValueError, match="has diverged after .* steps"):
        train(settings, tmp_path)
    assert not (tmp_path / "config.json").exists()


def test_another_error_while_it_learns_is_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> Any:
        raise ValueError("the disk is full")

    monkeypatch.setattr(training, "validate", fails)
    with pytest.raises(ValueError, match="^the disk is full$"):
        train(tiny(), tmp_path)
