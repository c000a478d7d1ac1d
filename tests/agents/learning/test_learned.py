"""Learned policies in play: the shipped models, and models from files."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

import bug_gym
from bug_gym.agents import AGENTS, make_policy, policy_names
from bug_gym.agents.learning.folder import TRAINED_FOLDER, read_config, trained_names
from bug_gym.agents.learning.play import as_env_actions
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.checks import install_command
from bug_gym.config import load
from bug_gym.evaluation import evaluate, make_plan
from bug_gym.held_out import play
from bug_gym.kinematics import discrete_actions
from bug_gym.observation import as_dict
from bug_gym.policy import MisfitError
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

ROOT = Path(__file__).resolve().parents[3]
LEARNED = [name for name, agent in AGENTS.items() if agent.family == "learned"]
FLOOR = 0.85
"""Share of the success on its card that a model has to reach in a few worlds; one with its inputs mixed up has none."""


def scenario_of(name: str) -> Any:
    """A scenario that a shipped model was trained in."""
    return read_config(TRAINED_FOLDER / name)["settings"]["scenarios"][0]


def observations(scenario: Any, steps: int = 30) -> tuple[Simulation, list[np.ndarray[Any, Any]]]:
    """A Simulation of four worlds, and flat observations (4, D) of the first robot of each in some random steps."""
    simulation = Simulation(scenario, 4)
    found = [simulation.reset(seeds=range(4))[:, 0]]
    rng = np.random.default_rng(0)
    for _ in range(steps):
        actions = rng.uniform([0.0, -1.0], 1.0, (4, simulation.scenario.robots.count, 2))
        found.append(simulation.step(actions).observation[:, 0])
    return simulation, found


def test_every_shipped_model_is_a_policy_and_every_learned_policy_is_shipped() -> None:
    assert sorted(LEARNED) == trained_names()
    assert set(LEARNED) <= set(policy_names())


@pytest.mark.parametrize("name", LEARNED)
def test_a_shipped_model_is_small_and_says_what_made_it(name: str) -> None:
    folder = TRAINED_FOLDER / name
    assert sum(path.stat().st_size for path in folder.iterdir()) < 2**20
    config = read_config(folder)
    assert {"settings", "scenarios", "machine", "runs", "seed"} <= config.keys()
    card = (folder / "card.md").read_text(encoding="utf-8")
    for words in (f"bug-gym train {name}", "Wilson", "held out", config["settings"]["algo"].upper()):
        assert words in card


@pytest.mark.parametrize("name", LEARNED)
def test_a_shipped_model_arrives_nearly_as_often_as_its_card_says(name: str) -> None:
    config = read_config(TRAINED_FOLDER / name)
    for scenario, told in config["runs"][str(config["seed"])]["held_out"].items():
        simulation = Simulation(scenario)
        played = play(make_policy(name, simulation), simulation.scenario, range(100))
        assert played.ended("success").mean() >= FLOOR * told["success"] > 0.5


@pytest.mark.parametrize("name", LEARNED)
def test_batches_dicts_and_single_observations_give_the_same_actions(name: str) -> None:
    simulation, flats = observations(scenario_of(name))
    policy = make_policy(name, simulation)
    batch = named = single = None
    for flat in flats:
        actions, batch = policy.predict(flat, batch)
        assert actions.shape == (4, 2) and actions.dtype == np.float32 and np.abs(actions).max() <= 1.0
        again, named = policy.predict(as_dict(flat, simulation.fields), named)
        one, single = policy.predict(flat[2], single)
        np.testing.assert_array_equal(actions, again)
        np.testing.assert_allclose(one, actions[2], atol=1e-5)


@pytest.mark.parametrize("name", LEARNED)
def test_an_episode_start_forgets_the_row(name: str) -> None:
    simulation, flats = observations(scenario_of(name))
    policy = make_policy(name, simulation)
    state = None
    for flat in flats:
        _, state = policy.predict(flat, state)
    actions, _ = policy.predict(flats[0], state, np.array([True, True, False, True]))
    fresh, _ = policy.predict(flats[0])
    np.testing.assert_allclose(actions[[0, 1, 3]], fresh[[0, 1, 3]], atol=1e-5)


@pytest.mark.parametrize("name", LEARNED)
def test_discrete_envs_get_numbers_of_the_table(name: str) -> None:
    if load(scenario_of(name)).robots.count > 1:
        drive_robots_discretely(name)
        return
    env = gym.make("BugGym/Navigation-v0", scenario=scenario_of(name), action="discrete")
    policy = make_policy(name, env)
    observation, _ = env.reset(seed=0)
    state = None
    for _ in range(20):
        action, state = policy.predict(observation, state)
        assert env.action_space.contains(action)
        observation, *_ = env.step(action)


def drive_robots_discretely(name: str) -> None:
    """The same for the robots of a world, by agent."""
    env = bug_gym.parallel_env(scenario_of(name), action="discrete")
    policy: Any = make_policy(name, env)  # gives actions by agent, as it is made for an env of several
    state = None
    observations, _ = env.reset(seed=0)
    for _ in range(20):
        actions, state = policy.predict(observations, state)
        assert all(env.action_space(agent).contains(action) for agent, action in actions.items())
        observations, *_ = env.step(actions)


def test_a_continuous_action_becomes_the_nearest_discrete_one_and_a_number_its_action() -> None:
    table = discrete_actions(Sensors.of(Simulation("static").scenario).drive)
    assert as_env_actions(table[[3, 77]], table, discrete=True).tolist() == [
        int(np.flatnonzero((table == row).all(axis=1))[0]) for row in table[[3, 77]]
    ]
    np.testing.assert_array_equal(as_env_actions(np.array([5, 9]), table, discrete=False), table[[5, 9]])


@pytest.mark.parametrize("name", LEARNED)
def test_the_graph_computes_what_the_model_in_stable_baselines3_does(name: str) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import InTraining, rebuild

    simulation, flats = observations(scenario_of(name))
    config = read_config(TRAINED_FOLDER / name)
    original = InTraining(rebuild(name), RobotModel.from_dict(config["robot"]), config["history"])
    table = discrete_actions(Sensors.of(simulation.scenario).drive)
    played, mine, theirs = make_policy(name, simulation), None, None
    for flat in flats:
        actions, mine = played.predict(flat, mine)
        expected, theirs = original.predict(flat, theirs)
        np.testing.assert_allclose(actions, as_env_actions(expected, table, discrete=False), atol=1e-5)


def test_playing_loads_no_torch() -> None:
    script = (
        "import sys\nfrom bug_gym.agents import make_policy\nfrom bug_gym.simulation import Simulation\n"
        "simulation = Simulation('dynamic')\nflat = simulation.reset(seeds=[0])[:, 0]\n"
        "make_policy('ppo_dynamic', simulation).predict(flat)\nassert 'torch' not in sys.modules"
    )
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


# ---------------------------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"lidar.beams": 32}, "beams 64, not 32"),
        ({"lidar.range": 10.0}, "range 5.0, not 10.0"),
        ({"robot.radius": 0.25}, "radius 0.2, not 0.25"),
        ({"robot.kinematics": "holonomic"}, "kinematics differential, not holonomic"),
        ({"robot.max_speed": 2.0}, "max_speed 1.0, not 2.0"),
        ({"time.step": 0.05}, "step 0.1, not 0.05"),
        ({"lidar.fov": 3.0}, "angle_step"),
        ({"robot.max_acceleration": 1.0}, "max_acceleration None, not 1.0"),
    ],
)
def test_another_robot_is_refused(overrides: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make_policy("ppo_dynamic", Simulation("dynamic", overrides=overrides))


def test_an_observation_with_a_number_that_is_not_finite_is_refused() -> None:
    simulation, (flat, *_) = observations("dynamic", 1)
    flat[0, 0] = np.inf
    with pytest.raises(ValueError, match="finite"):
        make_policy("ppo_dynamic", simulation).predict(flat)


def test_an_observation_of_another_length_is_refused() -> None:
    simulation, (flat, *_) = observations("dynamic", 1)
    with pytest.raises(ValueError, match="64 beams"):
        make_policy("ppo_dynamic", simulation).predict(flat[:, :-1])


def test_an_unknown_name_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(ValueError, match="'ppo_dynamic'"):
        make_policy("ppo_dinamic", "dynamic")


def test_a_folder_without_a_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no trained policy"):
        make_policy(f"{tmp_path}/", "dynamic")


@pytest.mark.parametrize("file", ["policy.onnx", "config.json"])
def test_a_damaged_file_is_refused(tmp_path: Path, file: str) -> None:
    folder = shutil.copytree(TRAINED_FOLDER / "ppo_dynamic", tmp_path / "model")
    data = (folder / file).read_bytes()
    (folder / file).write_bytes(data[: len(data) // 2])
    with pytest.raises(ValueError, match=f"{file} is damaged"):
        make_policy(f"{folder}/", "dynamic")


def test_a_folder_that_was_trained_elsewhere_is_played_by_its_path(tmp_path: Path) -> None:
    folder = shutil.copytree(TRAINED_FOLDER / "ppo_dynamic", tmp_path / "model")
    simulation, (flat, *_) = observations("dynamic", 1)
    mine, _ = make_policy(f"{folder}/", simulation).predict(flat)
    np.testing.assert_array_equal(mine, make_policy("ppo_dynamic", simulation).predict(flat)[0])


def test_without_onnxruntime_the_error_names_the_extra_and_the_rest_goes_on() -> None:
    script = (
        "import sys; sys.modules['onnxruntime'] = None\n"
        "from bug_gym.agents import make_policy, playable_names\n"
        "assert 'bug0' in playable_names() and 'ppo_dynamic' not in playable_names()\n"
        "make_policy('ppo_dynamic', 'dynamic')"
    )
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert install_command("play") in run.stderr.splitlines()[-1]


# ----------------------------------------------------------------------------------------- zips of stable-baselines3


@pytest.mark.parametrize("observation", ["dict", "flat"])
def test_a_zip_of_stable_baselines3_is_played_as_the_model_plays(tmp_path: Path, observation: Any) -> None:
    sb3 = pytest.importorskip("stable_baselines3")
    from bug_gym.agents.sb3 import make_vec_env

    env = make_vec_env("dynamic", 4, seed=0, observation=observation)
    policy_class = "MlpPolicy" if observation == "flat" else "MultiInputPolicy"
    model = sb3.PPO(policy_class, env, n_steps=8, batch_size=16, device="cpu", seed=0)
    model.save(tmp_path / "model.zip")
    policy = make_policy(f"{tmp_path}/model.zip", env, trust=True)
    simulation, (flat, *_) = observations("dynamic", 1)
    theirs = flat if observation == "flat" else as_dict(flat, simulation.fields)
    expected, _ = model.predict(theirs, deterministic=True)
    for form in (flat, as_dict(flat, simulation.fields)):
        np.testing.assert_array_equal(policy.predict(form, deterministic=True)[0], expected)
    with pytest.raises(ValueError, match="made for observations"):
        make_policy(f"{tmp_path}/model.zip", Simulation("dynamic", overrides={"lidar.beams": 32}), trust=True)


def saved_zip(path: Path, env: Any) -> Path:
    """A model of SB3 that has learned nothing, made for an env."""
    sb3 = pytest.importorskip("stable_baselines3")
    policy_class = "MultiInputPolicy" if isinstance(env.observation_space, gym.spaces.Dict) else "MlpPolicy"
    sb3.PPO(policy_class, env, n_steps=8, batch_size=8, device="cpu", seed=0).save(path / "model.zip")
    return path / "model.zip"


WRAPPED = {
    "a scale for actions": lambda env: gym.wrappers.RescaleAction(env, np.float32(0.0), np.float32(1.0)),
    "a scale for what is seen": lambda env: gym.wrappers.RescaleObservation(env, np.float32(-1.0), np.float32(1.0)),
    "another order": lambda env: gym.wrappers.FlattenObservation(sorted_by_name(env)),
}


def sorted_by_name(env: Any) -> Any:
    """An env whose Dict has its fields in the order of their names, as gymnasium sorts those of a mapping."""
    space = gym.spaces.Dict(dict(env.observation_space.spaces))
    return gym.wrappers.TransformObservation(env, lambda seen: {name: seen[name] for name in space}, space)


@pytest.mark.parametrize("wrapped", WRAPPED.values(), ids=WRAPPED)
def test_a_zip_that_was_trained_in_other_spaces_is_refused(tmp_path: Path, wrapped: Any) -> None:
    is_flat = wrapped is WRAPPED["a scale for what is seen"]
    env = gym.make("BugGym/DynamicFlat-v0" if is_flat else "BugGym/Dynamic-v0")
    with pytest.raises(MisfitError, match="was made for"):
        make_policy(str(saved_zip(tmp_path, wrapped(env))), "dynamic", trust=True)


@pytest.mark.parametrize("other", [{"lidar.range": 9}, {"robot.max_speed": 2}, {"robot.kinematics": "holonomic"}])
def test_a_zip_for_a_robot_that_sees_or_drives_otherwise_is_refused(tmp_path: Path, other: dict[str, Any]) -> None:
    path = str(saved_zip(tmp_path, gym.make("BugGym/Dynamic-v0")))
    with pytest.raises(MisfitError, match=r"was made for (ranges|velocity) from .*: another robot, or wrappers"):
        make_policy(path, Simulation("dynamic", overrides=other), trust=True)


def test_a_zip_is_played_in_a_larger_world_and_after_flattening(tmp_path: Path) -> None:
    env = gym.wrappers.FlattenObservation(gym.make("BugGym/Dynamic-v0"))
    path = str(saved_zip(tmp_path, env))
    flat = env.reset(seed=4)[0]
    larger = Simulation("dynamic", overrides={"world.bounds": [-30, -30, 30, 30]})
    policy = make_policy(path, larger, trust=True)
    expected, _ = stable_baselines3_model(path).predict(flat, deterministic=True)
    np.testing.assert_array_equal(policy.predict(flat, deterministic=True)[0], expected)


def stable_baselines3_model(path: str) -> Any:
    """The model in a zip, as SB3 reads it."""
    return pytest.importorskip("stable_baselines3").PPO.load(path, device="cpu")


def test_a_zip_is_refused_without_trust_and_nothing_of_it_is_read(tmp_path: Path) -> None:
    (tmp_path / "model.zip").write_bytes(b"not even a zip")
    with pytest.raises(ValueError, match="trust=True"):
        make_policy(f"{tmp_path}/model.zip", "dynamic")


def test_a_zip_that_is_none_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    (tmp_path / "model.zip").write_bytes(b"not even a zip")
    with pytest.raises(ValueError, match="no model of stable-baselines3"):
        make_policy(f"{tmp_path}/model.zip", "dynamic", trust=True)
    with pytest.raises(ValueError, match="no file"):
        make_policy(f"{tmp_path}/gone.zip", "dynamic", trust=True)


CONTRIB = {
    **{"QRDQN": "MlpPolicy", "TQC": "MlpPolicy", "CrossQ": "MlpPolicy", "TRPO": "MlpPolicy", "ARS": "MlpPolicy"},
    **{"RecurrentPPO": "MlpLstmPolicy", "MaskablePPO": "MlpPolicy"},
}
"""Algorithms of sb3-contrib, and a policy of each."""


def contrib_zip(path: Path, name: str) -> Any:
    """A model of sb3-contrib that has learned nothing, saved as model.zip."""
    contrib = pytest.importorskip("sb3_contrib")
    from bug_gym.agents.sb3 import make_vec_env

    action: Any = "discrete" if name in ("QRDQN", "MaskablePPO") else "continuous"
    env = make_vec_env("dynamic", 1, seed=0, observation="flat", action=action)
    model = getattr(contrib, name)(CONTRIB[name], env, device="cpu", seed=0)
    model.save(path / "model.zip")
    return model


@pytest.mark.parametrize("name", CONTRIB)
def test_a_zip_of_sb3_contrib_is_played_as_the_model_plays(name: str, tmp_path: Path) -> None:
    model = contrib_zip(tmp_path, name)
    simulation, (flat, *_) = observations("dynamic", 1)
    policy = make_policy(f"{tmp_path}/model.zip", simulation, trust=True)
    expected, _ = model.predict(flat, deterministic=True)
    if expected.dtype.kind in "iu":
        expected = discrete_actions(Sensors.of(simulation.scenario).drive)[expected]
    np.testing.assert_array_equal(policy.predict(flat, deterministic=True)[0], expected)


def with_data(path: Path, **changes: Any) -> str:
    """A copy of a zip that says other things of itself."""
    copied = path.with_name("changed.zip")
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(copied, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, json.dumps(json.loads(content) | changes) if name == "data" else content)
    return str(copied)


def test_a_zip_of_an_algorithm_that_is_not_there_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    contrib_zip(tmp_path, "QRDQN")
    new = with_data(tmp_path / "model.zip", policy_class={"__module__": "sb3_contrib.new.policies"})
    with pytest.raises(
        ValueError, match=r"a model of sb3_contrib\.new\.policies, which is not known here: .*as an object"
    ):
        make_policy(new, "dynamic", trust=True)
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(
        ValueError, match="model of QRDQN, of the package sb3-contrib, which is not installed.*as an object"
    ):
        make_policy(f"{tmp_path}/model.zip", "dynamic", trust=True)
    with pytest.raises(ValueError, match="trust=True"):
        make_policy(f"{tmp_path}/model.zip", "dynamic")


def test_a_zip_that_its_algorithm_cannot_read_is_refused_in_a_line(tmp_path: Path) -> None:
    contrib_zip(tmp_path, "QRDQN")
    path = with_data(tmp_path / "model.zip", policy_class={"__module__": "mine"})
    with pytest.raises(ValueError, match=r"changed\.zip cannot be read as a model of DQN: \w+: "):
        make_policy(path, "dynamic", trust=True)
    with zipfile.ZipFile(tmp_path / "empty.zip", "w") as target:
        target.writestr("data", "[]")
    with pytest.raises(ValueError, match="known are models of PPO, SAC.*QRDQN"):
        make_policy(str(tmp_path / "empty.zip"), "dynamic", trust=True)


# --------------------------------------------------------------------------------------------------------- evaluation


def test_learned_and_scripted_policies_are_evaluated_side_by_side() -> None:
    rows = evaluate(["bug0", "ppo_dynamic"], "dynamic", episodes=3)
    assert [(row.policy, row.seed) for row in rows] == [
        (name, seed) for name in ("bug0", "ppo_dynamic") for seed in range(3)
    ]
    assert all(row.decision_time_mean > 0.0 for row in rows)


def test_a_learned_policy_is_left_out_of_scenarios_with_another_robot() -> None:
    rows = evaluate(["bug0", "ppo_dynamic"], ["dynamic", "u_trap"], episodes=1)
    assert {(row.policy, row.scenario) for row in rows} == {
        ("bug0", "dynamic"),
        ("ppo_dynamic", "dynamic"),
        ("bug0", "u_trap"),
    }


def test_a_policy_that_fits_none_of_the_scenarios_is_an_error_where_it_was_asked_for() -> None:
    with pytest.raises(ValueError, match="another robot"):
        make_plan(["bug0", "ppo_dynamic"], "u_trap")
    assert not {entry.name for entry in make_plan(None, "u_trap", episodes=1).policies} & set(LEARNED)


def test_an_evaluation_and_a_batch_end_alike() -> None:
    simulation = Simulation("rush")
    policy = make_policy("ppo_dynamic", simulation)
    rows = evaluate(["ppo_dynamic"], "rush", episodes=12, seed=5)
    played = play(policy, simulation.scenario, range(5, 17), slots=5)
    assert played.ended("success")[:, 0].tolist() == [row.success for row in rows]
    np.testing.assert_allclose(played.time[:, 0], [row.time for row in rows], atol=1e-9)
    np.testing.assert_allclose(played.path_length[:, 0], [row.path_length for row in rows], atol=1e-4)


def test_a_learned_policy_drives_robots_of_a_vector_env() -> None:
    envs = gym.make_vec("BugGym/Dynamic-v0", num_envs=3)
    policy = make_policy("ppo_dynamic", envs)
    observation, _ = envs.reset(seed=0)
    actions, _ = policy.predict(observation)
    assert actions.shape == (3, 2)
