"""Several robots behind PettingZoo's two interfaces."""

from __future__ import annotations

import copy
import pickle
import re
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pettingzoo
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import data_equivalence
from pettingzoo import test as pettingzoo_test
from pettingzoo.utils.env import ParallelEnv

import bug_gym
from bug_gym import robots_env
from bug_gym.navigation_env import NavigationEnv
from bug_gym.robots_env import RobotsEnv

finds: Any = pettingzoo_test  # its functions have no types

# Each scenario that a registered id binds, and the one that is made for several robots.
SCENARIOS = sorted({*bug_gym.SCENARIOS_BY_ID.values(), "crossing_robots"})
ALL_NOISES = {
    "lidar.noise": 0.05,
    "lidar.dropout": 0.1,
    "odometry.translation_noise": 0.05,
    "odometry.rotation_noise": 0.05,
    "goal.sensing": "odometry",
}
HEAD_ON = {
    "name": "head_on",
    "time": {"limit": 20.0},
    "world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]},
    "robots": [
        {"start": [-2, 0, 0], "goal": [8, 0]},
        {"start": [2, 0, 3.141592653589793], "goal": [-8, 0]},
        {"start": [0, 5, 0], "goal": [8, 5]},
    ],
}


def rollout(env: RobotsEnv, seed: int, steps: int) -> list[Any]:
    """What random actions return from the first episode of a seed on, and from the next ones."""
    rng = np.random.default_rng(seed)
    seen: list[Any] = [env.reset(seed=seed)]
    for number in range(steps):
        if not env.agents or number == steps // 2:
            seen.append(env.reset())
        seen.append(env.step({agent: rng.uniform(-1.0, 1.0, 2).astype(np.float32) for agent in env.agents}))
    return seen


def parallel_maker(scenario: str, **settings: Any) -> Callable[[], RobotsEnv]:
    return lambda: bug_gym.parallel_env(scenario, robots=2, **settings)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_pettingzoo_finds_nothing_to_say_about_the_parallel_env(scenario: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        finds.parallel_api_test(parallel_maker(scenario)(), num_cycles=700)
        finds.parallel_seed_test(parallel_maker(scenario), num_cycles=100)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_pettingzoo_finds_nothing_to_say_about_the_aec_env(scenario: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Flat: the test calls a Dict space "unusual" in a warning.
        finds.api_test(bug_gym.env(scenario, robots=2, observation="flat"), num_cycles=100)
        finds.seed_test(lambda: bug_gym.env(scenario, robots=2), num_cycles=100)


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("robots", [2, 4, 16])
def test_pettingzoo_finds_nothing_to_say_about_few_or_many_robots(robots: int, kinematics: str) -> None:
    settings: dict[str, Any] = {"robots": robots, "overrides": {"robot.kinematics": kinematics, **ALL_NOISES}}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        finds.parallel_api_test(bug_gym.parallel_env("circle_swap", **settings), num_cycles=200)
        finds.parallel_seed_test(lambda: bug_gym.parallel_env("circle_swap", **settings), num_cycles=30)
        finds.api_test(bug_gym.env("circle_swap", observation="flat", **settings), num_cycles=60)
        finds.seed_test(lambda: bug_gym.env("circle_swap", **settings), num_cycles=30)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_same_seed_gives_the_same_run_with_all_noises(scenario: str) -> None:
    runs = [rollout(parallel_maker(scenario, overrides=ALL_NOISES)(), seed=3, steps=600) for _ in range(2)]
    assert data_equivalence(tuple(runs[0]), tuple(runs[1]), exact=True)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_pettingzoo_finds_nothing_to_say_about_pictures(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    finds.render_test(partial(bug_gym.env, scenario, robots=2, overrides={"time.step": 0.01}))


def test_most_cycles_cut_an_episode_off() -> None:
    finds.max_cycles_test(robots_env)


@pytest.mark.parametrize("observation", ["dict", "flat"])
@pytest.mark.parametrize("scenario", sorted({*bug_gym.SCENARIOS_BY_ID.values()}))
def test_one_robot_gets_what_the_single_env_gives(scenario: str, observation: Any) -> None:
    single = NavigationEnv(scenario, observation=observation)
    parallel = bug_gym.parallel_env(scenario, robots=1, observation=observation)
    first = parallel.reset(seed=4)
    assert data_equivalence(tuple(one["robot_0"] for one in first), single.reset(seed=4), exact=True)
    assert parallel.observation_space("robot_0") == single.observation_space
    assert parallel.action_space("robot_0") == single.action_space
    single.action_space.seed(0)
    for _ in range(200):
        action = single.action_space.sample()
        expected = single.step(action)
        came = tuple(one["robot_0"] for one in parallel.step({"robot_0": action}))
        assert data_equivalence(came, expected, exact=True)
        if not parallel.agents:
            assert data_equivalence(parallel.reset()[0]["robot_0"], single.reset()[0], exact=True)


def test_discrete_actions_are_those_of_the_single_env() -> None:
    single, parallel = NavigationEnv("static", action="discrete"), bug_gym.parallel_env("static", action="discrete")
    single.reset(seed=0), parallel.reset(seed=0)
    for action in (0, 17, 127):
        came = tuple(one["robot_0"] for one in parallel.step({"robot_0": action}))
        assert data_equivalence(came, single.step(action), exact=True)


def test_robots_that_drive_into_one_another_both_collide_and_leave() -> None:
    env = bug_gym.parallel_env(HEAD_ON)
    env.reset(seed=0)
    ahead = np.array([1.0, 0.0])
    steps = 0
    while len(env.agents) == 3:
        _, _, terminated, truncated, infos = env.step({"robot_0": ahead, "robot_1": ahead, "robot_2": np.zeros(2)})
        steps += 1
    assert steps in (18, 19)  # 4 m less two radii of 0.2 m, at 2 m/s in steps of 0.1 s
    assert terminated == {"robot_0": True, "robot_1": True, "robot_2": False}
    assert not any(truncated.values())
    assert [infos[agent]["outcome"] for agent in infos] == ["collision", "collision", "running"]
    assert env.agents == ["robot_2"]
    observations, *_ = env.step({"robot_2": ahead})
    assert list(observations) == ["robot_2"]


def test_the_first_arrival_ends_the_mission_for_all_where_that_is_the_mission() -> None:
    goals = {"mission": "first", "world": {"family": "empty", "start": [0, 0, 0], "goal": [2, 2]}}
    env = bug_gym.parallel_env({**HEAD_ON, **goals, "robots": [{"start": [0, 2, 0]}, {"start": [-6, -3, 0]}]})
    env.reset(seed=0)
    terminated: dict[str, bool] = {"robot_0": False}
    while not terminated["robot_0"]:
        assert env.agents == ["robot_0", "robot_1"]
        _, rewards, terminated, truncated, infos = env.step({agent: np.array([1.0, 0.0]) for agent in env.agents})
    assert terminated == {"robot_0": True, "robot_1": False} and truncated == {"robot_0": False, "robot_1": True}
    assert [infos[agent]["outcome"] for agent in infos] == ["success", "ended"] and env.agents == []
    assert rewards["robot_1"] < 1.0, "no more than its progress"


def test_a_collision_ends_no_mission() -> None:
    env = bug_gym.parallel_env({**HEAD_ON, "mission": "first"})
    env.reset(seed=0)
    ahead = np.array([1.0, 0.0])
    while len(env.agents) == 3:
        env.step({"robot_0": ahead, "robot_1": ahead, "robot_2": np.zeros(2)})
    assert env.agents == ["robot_2"]


def test_a_robot_that_left_stays_as_an_obstacle() -> None:
    env = bug_gym.parallel_env(HEAD_ON)
    env.reset(seed=0)
    ahead = np.array([1.0, 0.0])
    while "robot_0" in env.agents:
        env.step({agent: ahead * (agent != "robot_2") for agent in env.agents})
    observation, *_ = env.step({"robot_2": np.zeros(2)})
    beams = observation["robot_2"]["ranges"]
    # The two stand at (-0.2, 0) and (0.2, 0), 5 m from (0, 5): 4.8 m straight behind, on the right at three quarters.
    nearest = beams[len(beams) * 3 // 4 - 5 : len(beams) * 3 // 4 + 6].min()
    assert nearest == pytest.approx(np.hypot(5.0, 0.2) - 0.2, abs=0.01)
    np.testing.assert_allclose(observation["robot_2"]["peers"][:, 2:], 0.0)


def test_peers_are_where_the_other_robots_are_and_move_as_they_do() -> None:
    env = bug_gym.parallel_env(HEAD_ON)
    observations, _ = env.reset(seed=0)
    np.testing.assert_allclose(observations["robot_0"]["peers"][:, :2], [[4, 0], [2, 5]], atol=1e-5)
    # The second robot looks the other way.
    np.testing.assert_allclose(observations["robot_1"]["peers"][:, :2], [[4, 0], [2, -5]], atol=1e-5)
    actions = {"robot_0": np.array([1.0, 0.0]), "robot_1": np.array([0.0, 0.5]), "robot_2": np.zeros(2)}
    observations, *_ = env.step(actions)
    np.testing.assert_allclose(observations["robot_0"]["peers"][:, 2:], [[0.0, -0.5], [0.0, 0.0]], atol=1e-5)
    np.testing.assert_allclose(observations["robot_1"]["peers"][:, 2:], [[-1.0, 0.0], [0.0, 0.0]], atol=1e-5)


def test_the_state_is_what_all_robots_observe() -> None:
    env = bug_gym.parallel_env(robots=3, observation="flat")
    observations, _ = env.reset(seed=0)
    assert env.state_space.contains(env.state())
    np.testing.assert_array_equal(env.state(), np.concatenate(list(observations.values())))


@pytest.mark.parametrize("ask", [RobotsEnv.render, RobotsEnv.state, lambda env: env.step({})])
def test_nothing_is_told_before_the_first_reset(ask: Callable[[RobotsEnv], Any]) -> None:
    pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    env = bug_gym.parallel_env(render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="call reset first"):
        ask(env)


def test_spaces_are_the_same_object_at_each_call_and_one_for_each_robot() -> None:
    env = bug_gym.parallel_env(robots=2)
    for space in (env.observation_space, env.action_space):
        assert space("robot_0") is space("robot_0")
        assert space("robot_0") is not space("robot_1")
        assert space("robot_0") == space("robot_1")


@pytest.mark.parametrize("robots", [1, 2, 3, 4])
def test_there_are_as_many_robots_as_asked_for(robots: int) -> None:
    env = bug_gym.parallel_env(robots=robots)
    observations, infos = env.reset(seed=0)
    names = [f"robot_{number}" for number in range(robots)]
    assert list(observations) == list(infos) == env.agents == env.possible_agents == names
    assert all(env.observation_space(agent).contains(observations[agent]) for agent in names)


def test_observations_share_no_memory() -> None:
    env = bug_gym.parallel_env(robots=2)
    kept = [env.reset(seed=0), env.step({agent: np.ones(2) for agent in env.possible_agents})]
    copies = copy.deepcopy(kept)
    env.step({agent: np.ones(2) for agent in env.possible_agents})
    env.reset()
    assert data_equivalence(tuple(kept), tuple(copies), exact=True)


def test_a_pickled_env_goes_on_like_the_original() -> None:
    env = bug_gym.parallel_env(robots=2)
    env.reset(seed=0)
    actions = {agent: np.ones(2) for agent in env.agents}
    env.step(actions)
    twin = pickle.loads(pickle.dumps(env))
    assert data_equivalence(env.step(actions), twin.step(actions), exact=True)


def test_wrappers_draw_from_a_generator_that_resets_seed_as_they_do_the_single_envs() -> None:
    single, env = NavigationEnv("static"), bug_gym.parallel_env("static")
    for seed in (4, None, None, 7):
        single.reset(seed=seed), env.reset(seed=seed)
        for _ in range(3):
            assert env.np_random.integers(10**9) == single.np_random.integers(10**9)
    aec: Any = bug_gym.env("static")
    aec.reset(seed=7)
    assert aec.unwrapped.np_random.integers(10**9) == np.random.default_rng(7).integers(10**9)


def test_the_generator_is_of_the_seed_that_drew_the_first_world_or_the_one_that_was_set() -> None:
    env, given = bug_gym.parallel_env("static"), np.random.default_rng(3)
    assert env.np_random is env.np_random
    env.reset()
    drawn = np.random.default_rng(env.simulation.world.seed[0])
    assert env.np_random.integers(10**9) == drawn.integers(10**9)
    env.reset()
    assert env.np_random.integers(10**9) == drawn.integers(10**9)
    env = bug_gym.parallel_env("static")
    env.np_random = given
    env.reset()
    assert env.np_random is given
    env.reset(seed=1)
    assert env.np_random is not given


def test_worlds_draw_nothing_from_the_generator() -> None:
    used, other = bug_gym.parallel_env(robots=2), bug_gym.parallel_env(robots=2)
    used.reset(seed=2), other.reset(seed=2)
    used.np_random.random(100)
    assert data_equivalence(used.reset(), other.reset(), exact=True)


def test_the_shortest_path_of_each_robot_is_given_on_request() -> None:
    infos = bug_gym.parallel_env(HEAD_ON).reset(seed=0, options={"shortest_path": True})[1]
    assert [info["shortest_path_length"] for info in infos.values()] == pytest.approx([10.0, 10.0, 8.0])


def test_pettingzoo_makes_both_by_id() -> None:
    if not hasattr(pettingzoo, "make"):
        pytest.skip("PettingZoo before 1.27 has no registry")
    parallel = pettingzoo.make("parallel", bug_gym.ROBOTS_ID, robots=3)
    aec = pettingzoo.make("aec", bug_gym.ROBOTS_ID, robots=3)
    assert isinstance(parallel, ParallelEnv)
    assert parallel.possible_agents == aec.possible_agents == ["robot_0", "robot_1", "robot_2"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bug_gym.register_envs()


def test_the_metadata_of_the_class_stays_as_it_is() -> None:
    before = copy.deepcopy(RobotsEnv.metadata)
    assert bug_gym.parallel_env(overrides={"time.step": 0.05}).metadata["render_fps"] == pytest.approx(20.0)
    assert RobotsEnv.metadata == before


# ---------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize("actions", [{"robot_0": np.zeros(2)}, {f"robot_{n}": np.zeros(2) for n in range(3)}, {}])
def test_each_robot_in_play_and_no_other_gets_an_action(actions: dict[str, Any]) -> None:
    env = bug_gym.parallel_env(robots=2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="actions"):
        env.step(actions)


@pytest.mark.parametrize("strange", [1, None, ("robot_0",), "robot_2"], ids=repr)
def test_a_key_that_is_no_robot_is_named(strange: Any) -> None:
    env = bug_gym.parallel_env(robots=2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=re.escape(f"got actions for {strange!r}, expected them for ['robot_0'")):
        env.step({"robot_0": np.zeros(2), strange: 0, "robot_1": np.zeros(2)})


@pytest.mark.parametrize("action", [np.array([np.nan, 0.0]), np.zeros(3), None])
def test_an_action_that_is_none_is_refused(action: Any) -> None:
    env = bug_gym.parallel_env(robots=2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="action"):
        env.step({"robot_0": np.zeros(2), "robot_1": action})


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"robots": 5}, "at most 4"),
        ({"robots": 0}, "robots"),
        ({"scenario": "crossing_robot"}, "crossing_robots"),
        ({"observation": "image"}, "'dict', 'flat'.*'image'"),
        ({"render_mode": "ansi"}, "'rgb_array'.*'ansi'"),
    ],
)
def test_an_argument_that_is_not_known_is_told_what_is(settings: dict[str, Any], said: str) -> None:
    for make in (bug_gym.parallel_env, bug_gym.env):
        with pytest.raises(ValueError, match=said):
            make(**settings)


def test_the_package_has_no_other_names() -> None:
    with pytest.raises(AttributeError, match="paralel_env"):
        bug_gym.paralel_env  # noqa: B018
