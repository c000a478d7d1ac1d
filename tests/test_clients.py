"""What libraries ask of the faces: numbers alone in infos, attributes of rows, a limit of steps that infos know of."""

from __future__ import annotations

import math
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from bug_gym.navigation_env import NavigationEnv
from bug_gym.robots_env import parallel_env
from bug_gym.task import OUTCOMES, REWARD_TERMS
from bug_gym.vector_env import NavigationVectorEnv

SHORT = {"time.limit": 2.0}
STILL = np.zeros(2, dtype=np.float32)


def as_numbers(info: dict[str, Any]) -> dict[str, Any]:
    """A named info as the numeric form tells it."""
    terms = {f"reward_terms.{name}": value for name, value in info["reward_terms"].items()}
    return {**{key: value for key, value in info.items() if key != "reward_terms"}, **terms} | {
        "outcome": OUTCOMES.index(info["outcome"])
    }


# ------------------------------------------------------------------------------------------------------ numbers alone


def test_numeric_infos_say_the_same_in_numbers() -> None:
    named, numeric = NavigationEnv("rush", SHORT), NavigationEnv("rush", SHORT, info="numeric")
    seen = set()
    for seed in range(8):
        came, told = named.reset(seed=seed)[1], numeric.reset(seed=seed)[1]
        while True:
            assert as_numbers(came) == told
            assert all(isinstance(value, (bool, int, float)) for value in told.values())
            seen.add(told["outcome"])
            if came["outcome"] != "running":
                break
            action = np.array([1.0, 0.2], dtype=np.float32)
            came, told = named.step(action)[4], numeric.step(action)[4]
    assert seen >= {OUTCOMES.index(name) for name in ("running", "timeout")}


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_numeric_infos_of_many_worlds_are_arrays_of_numbers(mode: AutoresetMode) -> None:
    settings: dict[str, Any] = {"scenario": "rush", "overrides": SHORT, "autoreset_mode": mode}
    named, numeric = NavigationVectorEnv(4, **settings), NavigationVectorEnv(4, info="numeric", **settings)
    came, told = named.reset(seed=0)[1], numeric.reset(seed=0)[1]
    finals = 0
    for _ in range(25):
        for one, other in [(came, told), *([(came["final_info"], told["final_info"])] if "final_info" in told else [])]:
            assert [
                OUTCOMES[code] if name else None for code, name in zip(other["outcome"], one["outcome"], strict=True)
            ] == [*one["outcome"]]
            for term in REWARD_TERMS:
                assert np.array_equal(other[f"reward_terms.{term}"], one["reward_terms"][term])
                assert np.array_equal(other[f"_reward_terms.{term}"], one["reward_terms"][f"_{term}"])
            numbers = {key: value for key, value in other.items() if not key.lstrip("_").startswith("final_")}
            assert all(value.dtype.kind in "bif" and value.shape == (4,) for value in numbers.values())
        finals += "final_info" in told
        actions = np.tile(np.array([1.0, 0.2], dtype=np.float32), (4, 1))
        came, told = named.step(actions)[4], numeric.step(actions)[4]
    assert (finals > 0) == (mode == AutoresetMode.SAME_STEP)


def test_numeric_infos_of_robots_become_tensors() -> None:
    torch = pytest.importorskip("torch", reason="torch comes with the extra `train`")
    named = parallel_env("crossing_robots", robots=2)
    numeric = parallel_env("crossing_robots", robots=2, info="numeric")
    came, told = named.reset(seed=0)[1], numeric.reset(seed=0)[1]
    for _ in range(3):
        for agent in named.agents:
            assert as_numbers(came[agent]) == told[agent]
            tensors = {key: torch.as_tensor(value) for key, value in told[agent].items()}  # as TorchRL's wrapper does
            assert all(tensor.shape == () for tensor in tensors.values())
        actions = {agent: STILL for agent in named.agents}
        came, told = named.step(actions)[4], numeric.step(actions)[4]


@pytest.mark.parametrize("make", [NavigationEnv, parallel_env, lambda **settings: NavigationVectorEnv(2, **settings)])
def test_another_form_of_infos_is_refused(make: Any) -> None:
    with pytest.raises(ValueError, match="info is one of 'named', 'numeric', got 'codes'"):
        make(info="codes")


# ----------------------------------------------------------------------------------------------- attributes of rows


def test_attributes_of_rows_are_read_as_of_gymnasiums_vector_envs() -> None:
    ours = NavigationVectorEnv(3, scenario="static")
    sync = SyncVectorEnv([lambda: NavigationEnv("static")] * 3)
    for name in ("observation_space", "action_space", "render_mode"):
        assert ours.get_attr(name) == sync.get_attr(name) == ours.call(name)
    for env in (ours, sync):
        env.set_attr("task", [1, 2, 3])
        assert env.get_attr("task") == (1, 2, 3)
        env.set_attr("task", 7)
        assert env.get_attr("task") == (7, 7, 7)
        env.set_attr("double", [lambda value, k=k: k * value for k in range(3)])
        assert env.call("double", 2) == (0, 2, 4)
        with pytest.raises(ValueError, match="2.* values"):
            env.set_attr("task", [1, 2])
        with pytest.raises(AttributeError, match="nothing_of_this_name"):
            env.get_attr("nothing_of_this_name")
    assert ours.get_attr("simulation") == (ours.simulation,) * 3


def test_each_row_renders() -> None:
    env = NavigationVectorEnv(2, scenario="static", render_mode="rgb_array")
    env.reset(seed=0)
    first, second = env.call("render")
    assert first.shape == second.shape and first.ndim == 3 and not np.array_equal(first, second)


@pytest.mark.parametrize("name", ["reset", "step", "close"])
def test_what_rows_cannot_do_alone_is_told(name: str) -> None:
    with pytest.raises(AttributeError, match=rf"a row of NavigationVectorEnv has no method '{name}': .*together"):
        NavigationVectorEnv(2).call(name)


def test_what_rows_share_is_not_set_for_each() -> None:
    env = NavigationVectorEnv(2)
    with pytest.raises(AttributeError, match="the rows share 'simulation'"):
        env.set_attr("simulation", [1, 2])


def test_an_id_takes_another_scenario_in_the_vec_env_of_stable_baselines3() -> None:
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
    from bug_gym.agents.sb3 import make_vec_env

    env = make_vec_env("BugGym/Navigation-v0", 2, scenario="maze", seed=0)
    assert env.simulation.scenario.name == "maze"
    assert make_vec_env("BugGym/Rush-v0", 2).simulation.scenario.name == "rush"
    with pytest.raises(ValueError, match="scenario goes with a registered id.*got 'static' beside it"):
        make_vec_env("static", 2, scenario="maze")


# ------------------------------------------------------------------------------------------------- a limit of steps


def steps_to_the_end(env: gym.Env[Any, Any]) -> tuple[int, bool, bool, dict[str, Any]]:
    """Stand until an episode ends: its steps, terminated, truncated and info."""
    env.reset(seed=0)
    for step in range(1, 10_000):
        *_, terminated, truncated, info = env.step(STILL)
        if terminated or truncated:
            return step, terminated, truncated, info
    raise AssertionError("it never ends")


def test_the_info_knows_of_the_limit_that_make_sets() -> None:
    env = gym.make("BugGym/Static-v0", max_episode_steps=10)
    assert env.spec is not None and env.spec.max_episode_steps == 10
    for made in (env, gym.make(env.spec), gym.make(gym.make("BugGym/Static-v0", max_episode_steps=10).spec)):  # type: ignore[arg-type]
        step, terminated, truncated, info = steps_to_the_end(made)
        assert (step, terminated, truncated, info["outcome"]) == (10, False, True, "timeout")
    unlimited: Any = gym.make("BugGym/Static-v0").unwrapped
    assert unlimited.simulation.scenario.time.steps == 600
    assert unlimited.simulation.scenario.digest != env.unwrapped.simulation.scenario.digest  # type: ignore[attr-defined]


def test_a_limit_behind_the_scenarios_own_changes_nothing() -> None:
    for most in (10**6, -1, None):
        env = gym.make("BugGym/Static-v0", max_episode_steps=most, overrides=SHORT)
        step, _, truncated, info = steps_to_the_end(env)
        assert (step, truncated, info["outcome"]) == (20, True, "timeout")


@pytest.mark.parametrize(
    ("make", "limit", "action"),
    [
        (partial(gym.make, "BugGym/Navigation-v0"), "max_episode_steps", STILL),
        (partial(gym.make_vec, "BugGym/Navigation-v0", 2), "max_episode_steps", np.zeros((2, 2), np.float32)),
        (partial(parallel_env), "max_cycles", {"robot_0": STILL}),
    ],
)
def test_a_limit_from_outside_cuts_the_same_episodes_off(make: Any, limit: str, action: Any, tmp_path: Path) -> None:
    """Even where the family draws what the scenario's own limit leaves room for: when a recording is entered."""
    lines = [f"{time},1,{2.0 * math.sin(time):f},{2.0 * math.cos(time):f}" for time in range(200)]
    (tmp_path / "walk.csv").write_text("\n".join(["time_s,pedestrian,x_m,y_m", *lines]))
    world = {"family": "replay", "path": str(tmp_path / "walk.csv"), "bounds": [-8, -8, 8, 8]}
    scenario = {"world": world, "time": {"limit": 60.0}, "lidar": {"beams": 32, "range": 20.0}}
    whole, short = make(scenario=scenario), make(scenario=scenario, **{limit: 20})
    for seed in range(5):
        assert data_equivalence(short.reset(seed=seed), whole.reset(seed=seed), exact=True)
        for _ in range(19):
            assert data_equivalence(short.step(action), whole.step(action), exact=True)
        cut_off = short.step(action)[3]
        assert np.all([*cut_off.values()] if isinstance(cut_off, dict) else cut_off)


def test_a_limit_that_is_none_is_told_by_gymnasium() -> None:
    with pytest.raises(ValueError, match="positive"):
        gym.make("BugGym/Static-v0", max_episode_steps=-3)


def test_single_envs_side_by_side_end_as_the_native_rows_do() -> None:
    settings: dict[str, Any] = {"num_envs": 2, "max_episode_steps": 7}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ours = gym.make_vec("BugGym/Static-v0", **settings)
        sync = gym.make_vec("BugGym/Static-v0", vectorization_mode="sync", **settings)
    ours.reset(seed=0), sync.reset(seed=0)
    for actions in np.zeros((20, 2, 2), dtype=np.float32):
        came, expected = ours.step(actions), sync.step(actions)
        assert data_equivalence(came[1:4], expected[1:4], exact=True)
        assert [*came[4]["outcome"]] == [*expected[4]["outcome"]]


def test_an_env_without_a_maker_takes_any_spec() -> None:
    env = NavigationEnv("static")
    max_episode_steps = 3  # of a caller who is not gymnasium.make
    env.spec = gym.spec("BugGym/Static-v0")
    assert env.simulation.scenario.time.steps == 600 and max_episode_steps == 3
