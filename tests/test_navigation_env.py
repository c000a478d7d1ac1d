"""One world with one robot behind `gym.Env`, over every registered id."""

from __future__ import annotations

import copy
import hashlib
import json
import math
import pickle
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env, data_equivalence

import bug_gym
from bug_gym.config import load, scenario_names
from bug_gym.kinematics import discrete_actions
from bug_gym.log import told
from bug_gym.navigation_env import NavigationEnv
from bug_gym.simulation import Simulation
from bug_gym.spaces import ActionBox
from bug_gym.view import Sensors
from bug_gym.world import Capacity

ROOT = Path(__file__).resolve().parents[1]
IDS = list(bug_gym.SCENARIOS_BY_ID)
INFO_TYPES = {
    "is_success": bool,
    "collision": bool,
    "outcome": str,
    "path_length": float,
    "time": float,
    "min_clearance": float,
    "goal_distance": float,
    "reward_terms": dict,
}
ALL_NOISES = {
    "lidar.noise": 0.05,
    "lidar.dropout": 0.1,
    "odometry.translation_noise": 0.05,
    "odometry.rotation_noise": 0.05,
    "odometry.translation_bias": 0.02,
    "odometry.rotation_bias": 0.02,
    "goal.sensing": "odometry",
}
ALL_TERMS = {"reward.clearance": -0.1, "reward.smoothness": -0.1}
AHEAD = np.array([1.0, 0.0], dtype=np.float32)


@pytest.fixture(params=IDS)
def env(request: pytest.FixtureRequest) -> Iterator[NavigationEnv]:
    made = gym.make(request.param).unwrapped
    assert isinstance(made, NavigationEnv)
    yield made
    made.close()


@pytest.fixture
def no_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def rollout(env: gym.Env[Any, Any], seed: int, steps: int) -> list[Any]:
    """What random actions return from the first episode of a seed on; another begins after half of the steps."""
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, 2)).astype(np.float32)
    seen: list[Any] = [env.reset(seed=seed)]
    for number, action in enumerate(actions):
        if number == steps // 2 or (len(seen[-1]) == 5 and (seen[-1][2] or seen[-1][3])):
            seen.append(env.reset())
        seen.append(env.step(action))
    return seen


def observations(env: gym.Env[Any, Any], episodes: int) -> Iterator[Any]:
    """Observations of random episodes of at most 40 steps."""
    env.action_space.seed(0)
    for seed in range(episodes):
        yield env.reset(seed=seed)[0]
        for _ in range(40):
            observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
            yield observation
            if terminated or truncated:
                break


@pytest.mark.parametrize("observation", ["dict", "flat"])
@pytest.mark.parametrize("action", ["continuous", "discrete"])
@pytest.mark.parametrize("name", IDS)
def test_gymnasium_finds_nothing_to_say(name: str, observation: str, action: str) -> None:
    env = gym.make(name, observation=observation, action=action).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env, skip_render_check=True)


def test_an_episode_behind_gym_make_raises_no_warning(env: NavigationEnv) -> None:
    assert env.spec is not None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wrapped = gym.make(env.spec.id)
        assert sum(1 for _ in observations(wrapped, episodes=2)) > 2


@pytest.mark.parametrize("name", IDS)
def test_the_same_seed_gives_the_same_run_with_all_noises(name: str) -> None:
    overrides = ALL_NOISES | ALL_TERMS
    runs = [rollout(gym.make(name, overrides=overrides), seed=7, steps=600) for _ in range(2)]
    assert data_equivalence(tuple(runs[0]), tuple(runs[1]), exact=True)


def test_a_seed_gives_the_same_run_after_other_episodes(env: NavigationEnv) -> None:
    first = rollout(env, seed=3, steps=30)
    for seed in (11, 12):
        rollout(env, seed=seed, steps=10)
    assert data_equivalence(tuple(first), tuple(rollout(env, seed=3, steps=30)), exact=True)


def test_another_seed_gives_another_world(env: NavigationEnv) -> None:
    first, second = env.reset(seed=1)[0], env.reset(seed=2)[0]
    assert not data_equivalence(first, second)


def test_the_next_episode_of_a_seed_is_another_world(env: NavigationEnv) -> None:
    first, second = env.reset(seed=1)[0], env.reset()[0]
    assert not data_equivalence(first, second)


@pytest.mark.parametrize("is_asked_before", [False, True])
def test_a_first_reset_without_a_seed_tells_which_one_it_took(is_asked_before: bool) -> None:
    fresh, other = NavigationEnv("dynamic"), NavigationEnv("dynamic")
    if is_asked_before:
        assert isinstance(fresh.np_random_seed, int)
    drawn, _ = fresh.reset()
    seed = fresh.np_random_seed
    fresh.reset()
    assert fresh.np_random_seed == seed
    again, _ = other.reset(seed=seed)
    assert all(np.array_equal(again[name], drawn[name]) for name in drawn)


def test_a_first_reset_without_a_seed_keeps_a_generator_that_was_set_by_hand() -> None:
    env, generator = NavigationEnv("empty"), np.random.default_rng(3)
    env.np_random = generator
    env.reset()
    assert env.np_random is generator and env.np_random_seed == -1


def test_envs_without_a_seed_differ() -> None:
    worlds = [gym.make("BugGym/Static-v0").reset()[0] for _ in range(2)]
    assert not data_equivalence(worlds[0], worlds[1])


def test_a_saved_state_restored_mid_episode_goes_on_bit_for_bit(env: NavigationEnv) -> None:
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(60)]
    env.reset(seed=5)
    for action in actions[:20]:
        env.step(action)
    saved = env.simulation.save()
    first = [env.step(action) for action in actions[20:]]
    env.reset(seed=6)
    env.simulation.restore(saved)
    assert data_equivalence(tuple(first), tuple(env.step(action) for action in actions[20:]), exact=True)


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_like_the_original_and_apart_from_it(env: NavigationEnv, duplicate: Any) -> None:
    env.reset(seed=5)
    for _ in range(10):
        env.step(AHEAD)
    twin = duplicate(env)
    first = [env.step(AHEAD) for _ in range(20)]
    assert data_equivalence(tuple(first), tuple(twin.step(AHEAD) for _ in range(20)), exact=True)
    assert data_equivalence(env.reset(), twin.reset(), exact=True)


def test_a_step_after_the_end_is_told_once(env: NavigationEnv, caplog: pytest.LogCaptureFixture) -> None:
    told.clear()
    for _ in range(2):
        env.reset(seed=5)
        ended = False
        while not ended:
            _seen, _reward, terminated, truncated, _info = env.step(AHEAD)
            ended = terminated or truncated
    assert "after the end" not in caplog.text
    for _ in range(2):
        assert env.step(AHEAD)[1] == 0.0
    assert caplog.text.count("after the end") == 1


ROOM = Capacity(discs=40, polygons=30, walls=400, ways=50, steered=1)


def test_a_world_that_has_grown_goes_on_bit_for_bit(env: NavigationEnv) -> None:
    """What is bound to its buffers must be bound anew."""
    twin = copy.deepcopy(env)
    for one in (env, twin):
        one.reset(seed=5)
        for _ in range(5):
            one.step(AHEAD)
    env.simulation.world.grow(env.simulation.world.capacity.joined(ROOM))
    for _ in range(20):
        assert data_equivalence(env.step(AHEAD), twin.step(AHEAD), exact=True)


def test_a_state_saved_before_the_world_grew_goes_on_bit_for_bit(env: NavigationEnv) -> None:
    env.reset(seed=5)
    env.step(AHEAD)
    saved = env.simulation.save()
    first = [env.step(AHEAD) for _ in range(10)]
    env.simulation.world.grow(env.simulation.world.capacity.joined(ROOM))
    env.step(AHEAD)
    env.simulation.restore(saved)
    assert data_equivalence(tuple(first), tuple(env.step(AHEAD) for _ in range(10)), exact=True)


def test_a_step_is_what_the_core_gives_its_first_robot(env: NavigationEnv) -> None:
    core = Simulation(env.simulation.scenario)
    env.reset(seed=3)
    core.reset(seeds=[3])
    for action in np.random.default_rng(0).uniform(-1.5, 1.5, (150, 2)).astype(np.float32):
        flat = core.step(action[None, None]).observation[0, 0]
        assert data_equivalence(env.step(action), (env.spaces.present(flat), *core.robot_step()), exact=True)


@pytest.mark.parametrize(
    "form",
    [
        lambda action: action.astype(np.float64),
        lambda action: action.astype(np.float16),
        lambda action: action.astype(">f4"),
        lambda action: action.repeat(2)[::2],
        lambda action: action.tolist(),
        lambda action: tuple(action),
        lambda action: action.view(np.ma.MaskedArray),
        lambda action: np.frombuffer(action.tobytes(), dtype=np.float32),
        lambda action: action.astype(object),
    ],
)
def test_an_action_may_come_as_any_two_numbers(form: Any) -> None:
    env, twin = NavigationEnv("static"), NavigationEnv("static")
    env.reset(seed=0)
    twin.reset(seed=0)
    for action in np.array([[0.5, -0.25], [1.0, 1.0], [-2.0, 0.125]], dtype=np.float32):
        assert data_equivalence(env.step(action), twin.step(form(action)), exact=True)


@pytest.mark.parametrize("form", [int, np.int8, np.uint16, np.array])
def test_a_discrete_action_may_come_as_any_integer(form: Any) -> None:
    env, twin = (NavigationEnv("static", action="discrete") for _ in range(2))
    env.reset(seed=0)
    twin.reset(seed=0)
    for action in (0, 127, 33):
        assert data_equivalence(env.step(np.int64(action)), twin.step(form(action)), exact=True)


@pytest.mark.parametrize("name", IDS)
def test_a_spec_written_as_json_makes_the_same_env(name: str) -> None:
    spec = gym.make(name, overrides={"lidar.beams": 9}, observation="flat").spec
    assert spec is not None
    again = EnvSpec.from_json(spec.to_json())
    assert again == spec
    first, second = gym.make(spec), gym.make(again)
    assert data_equivalence(first.reset(seed=1), second.reset(seed=1), exact=True)
    assert second.observation_space.shape == (9 + 2 + 3 + 2,)


def test_actions_are_drawn_as_from_any_box() -> None:
    ours, plain = ActionBox(), gym.spaces.Box(-1.0, 1.0, (2,), dtype=np.float32)
    assert ours == plain
    for seed in range(20):
        ours.seed(seed)
        plain.seed(seed)
        for space in (ours, pickle.loads(pickle.dumps(ours)), copy.deepcopy(ours)):
            twin = copy.deepcopy(plain)
            for _ in range(50):
                np.testing.assert_array_equal(space.sample(), twin.sample(), strict=True)
    mask: Any = np.ones(2)
    with pytest.raises(gym.error.Error, match="mask"):
        ours.sample(mask=mask)


def test_info_has_the_same_keys_and_types_at_reset_and_step(env: NavigationEnv) -> None:
    for info in (env.reset(seed=0)[1], env.step(AHEAD)[4]):
        assert {name: type(value) for name, value in info.items()} == INFO_TYPES
        assert all(type(value) is float for value in info["reward_terms"].values())


def test_infos_share_nothing(env: NavigationEnv) -> None:
    infos = [env.reset(seed=0)[1], env.step(AHEAD)[4], env.step(AHEAD)[4]]
    kept = copy.deepcopy(infos)
    infos[0].clear()
    infos[1]["reward_terms"].clear()
    infos[1]["mine"] = 1
    assert env.step(AHEAD)[4].keys() == kept[0].keys()
    assert infos[2] == kept[2]
    assert env.step(AHEAD)[4]["reward_terms"].keys() == kept[0]["reward_terms"].keys()


def test_info_at_reset_says_that_nothing_has_happened(env: NavigationEnv) -> None:
    info = env.reset(seed=0)[1]
    assert (info["outcome"], info["is_success"], info["collision"]) == ("running", False, False)
    assert info["time"] == info["path_length"] == 0.0
    assert set(info["reward_terms"].values()) == {0.0}


def test_the_reward_is_the_sum_of_its_terms() -> None:
    env = NavigationEnv("dynamic", overrides=ALL_TERMS)
    env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(50):
        _, reward, _, _, info = env.step(env.action_space.sample())
        assert reward == pytest.approx(sum(info["reward_terms"].values()), abs=1e-12)
        assert all(info["reward_terms"][name] <= 0.0 for name in ("clearance", "smoothness"))


def test_driving_straight_to_the_goal_is_a_success() -> None:
    env = NavigationEnv("empty")  # from (0, 0) to (8, 0) at 1 m/s, reached at 0.3 m
    env.reset(seed=0)
    total, steps, terminated, truncated = 0.0, 0, False, False
    info: dict[str, Any] = {}
    while not (terminated or truncated):
        _, reward, terminated, truncated, info = env.step(AHEAD)
        total, steps = total + reward, steps + 1
    assert (terminated, truncated, info["outcome"], info["is_success"]) == (True, False, "success", True)
    assert steps in (77, 78)
    assert info["path_length"] == pytest.approx(7.7, abs=1e-6)
    assert total == pytest.approx(7.7 + 10.0 - 0.01 * steps, abs=1e-6)  # progress, goal, steps


def test_driving_into_the_border_is_a_collision() -> None:
    env = NavigationEnv("empty")
    env.reset(seed=0)
    info: dict[str, Any] = {}
    terminated = False
    while not terminated:
        _, _, terminated, truncated, info = env.step(-AHEAD)
        assert not truncated
    assert (info["outcome"], info["collision"], info["is_success"]) == ("collision", True, False)
    assert info["path_length"] == pytest.approx(10.0 - 0.2, abs=1e-6)
    assert info["min_clearance"] == pytest.approx(0.0, abs=1e-6)


def test_standing_still_ends_at_the_time_limit() -> None:
    env = NavigationEnv("empty", overrides={"time.limit": 1.0})
    env.reset(seed=0)
    ends = [env.step(np.zeros(2))[2:] for _ in range(10)]
    assert [truncated for _, truncated, _ in ends] == [False] * 9 + [True]
    assert not any(terminated for terminated, _, _ in ends)
    assert ends[-1][2]["outcome"] == "timeout"
    assert ends[-1][2]["time"] == pytest.approx(1.0)


def test_the_shortest_path_is_given_on_request_only() -> None:
    env = NavigationEnv("empty")
    assert "shortest_path_length" not in env.reset(seed=0, options={})[1]
    assert env.reset(seed=0, options={"shortest_path": True})[1]["shortest_path_length"] == pytest.approx(8.0)
    assert "shortest_path_length" not in env.reset(seed=0, options={"shortest_path": False})[1]


def test_the_shortest_path_goes_round_the_still_obstacles() -> None:
    env = NavigationEnv("disc")  # of 3 m, in the middle of 20 m; the way is two tangents and an arc between them
    grown, half = 3.0 + 0.2, 10.0
    angle = math.acos(grown / half)
    expected = 2.0 * math.sqrt(half**2 - grown**2) + grown * (math.pi - 2.0 * angle)
    length = env.reset(seed=0, options={"shortest_path": True})[1]["shortest_path_length"]
    assert length == pytest.approx(expected, rel=0.01)


def test_there_is_no_shortest_path_out_of_a_ring() -> None:
    assert NavigationEnv("ring").reset(seed=0, options={"shortest_path": True})[1]["shortest_path_length"] == math.inf


@pytest.mark.parametrize("scenario", ["dynamic", "terrain"])
def test_a_flattened_dict_is_the_flat_observation(scenario: str) -> None:
    of_dict, of_flat = NavigationEnv(scenario), NavigationEnv(scenario, observation="flat")
    fields, flat = of_dict.reset(seed=2)[0], of_flat.reset(seed=2)[0]
    assert list(fields) == list(cast(gym.spaces.Dict, of_dict.observation_space))
    np.testing.assert_array_equal(gym.spaces.flatten(of_dict.observation_space, fields), flat)
    assert gym.spaces.flatten_space(of_dict.observation_space) == of_flat.observation_space


def test_flat_observations_are_the_fields_in_order(env: NavigationEnv) -> None:
    assert env.spec is not None
    flat = gym.make(env.spec.id, observation="flat").unwrapped
    fields = env.reset(seed=2)[0]
    assert list(fields) == ["ranges", "goal", "pose", "velocity"]
    np.testing.assert_array_equal(flat.reset(seed=2)[0], np.concatenate([value.ravel() for value in fields.values()]))
    assert flat.observation_space.shape == flat.reset(seed=2)[0].shape


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_discrete_action_is_its_row_of_the_steering_table(kinematics: str) -> None:
    overrides = {"robot.kinematics": kinematics}
    discrete, continuous = NavigationEnv("static", overrides, action="discrete"), NavigationEnv("static", overrides)
    table = discrete_actions(Sensors.of(discrete.simulation.scenario).drive)
    for action in range(0, 128, 5):
        discrete.reset(seed=0)
        continuous.reset(seed=0)
        assert data_equivalence(discrete.step(action), continuous.step(table[action]), exact=True)


def test_discrete_actions_head_counter_clockwise_in_four_speeds() -> None:
    env = NavigationEnv("empty", {"robot.kinematics": "holonomic", "robot.max_speed": 0.8}, action="discrete")
    for action in (0, 3, 8 * 4 + 1, 20 * 4 + 2):  # ahead slow and fast, to the left, behind to the right
        env.reset(seed=0)
        velocity = env.step(action)[0]["velocity"]
        speed, heading = 0.8 * (action % 4 + 1) / 4.0, 2.0 * math.pi * (action // 4) / 32.0
        np.testing.assert_allclose(velocity, [speed * math.cos(heading), speed * math.sin(heading)], atol=1e-6)


# ---------------------------------------------------------------------------------------------- dm_control's three


def test_observations_lie_in_their_space_and_no_element_is_constant(env: NavigationEnv) -> None:
    seen = []
    for observation in observations(env, episodes=30):
        assert env.observation_space.contains(observation)
        seen.append(np.concatenate([value.ravel() for value in observation.values()]))
    assert (np.ptp(np.array(seen), axis=0) > 0.0).all()


def test_only_the_heading_of_a_holonomic_robot_is_constant() -> None:
    env = NavigationEnv("static", {"robot.kinematics": "holonomic"}, observation="flat")
    seen = np.array(list(observations(env, episodes=30)))
    heading = 64 + 2 + 2
    np.testing.assert_array_equal(np.flatnonzero(np.ptp(seen, axis=0) == 0.0), [heading])


@pytest.mark.parametrize("observation", ["dict", "flat"])
def test_observations_share_no_memory(observation: Any) -> None:
    env = NavigationEnv("dynamic", observation=observation)
    seen = [env.reset(seed=0)[0], env.step(AHEAD)[0], env.step(AHEAD)[0], env.reset()[0]]
    kept = copy.deepcopy(seen)
    arrays = [list(one.values()) if isinstance(one, dict) else [one] for one in seen]
    for number, one in enumerate(arrays):
        for other in arrays[:number]:
            assert not any(np.shares_memory(a, b) for a in one for b in other)
    env.step(AHEAD)
    assert data_equivalence(tuple(seen), tuple(kept), exact=True)


def test_initial_states_vary(env: NavigationEnv) -> None:
    goals, poses = [], []
    for seed in range(10):
        goals.append(tuple(env.reset(seed=seed)[0]["goal"]))
        poses.append(tuple(env.simulation.world.pose[0, 0]))
    assert len(set(goals)) == len(set(poses)) == 10


# ---------------------------------------------------------------------------------------------- registration, pictures


def test_videos_play_in_real_time_and_the_class_stays_as_it_is() -> None:
    before = copy.deepcopy(NavigationEnv.metadata)
    env = NavigationEnv("empty", {"time.step": 0.04})
    assert env.metadata["render_fps"] == pytest.approx(25.0)
    assert NavigationEnv.metadata == before


@pytest.mark.parametrize("name", IDS)
def test_gymnasium_finds_nothing_to_say_about_pictures(name: str, no_screen: None) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(name, overrides={"time.step": 0.01}).unwrapped)


def test_a_picture_shows_the_world_and_its_change(no_screen: None) -> None:
    env = NavigationEnv("dynamic", render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    env.step(AHEAD)
    second = env.render()
    assert first.dtype == np.uint8
    assert first.shape == second.shape
    assert first.shape[2] == 3
    assert 0.0 < (first != second).any(axis=2).mean() < 0.5


def test_looking_changes_nothing(no_screen: None) -> None:
    seen = [rollout(NavigationEnv("dynamic", render_mode=mode), seed=0, steps=40) for mode in (None, "rgb_array")]
    assert data_equivalence(tuple(seen[0]), tuple(seen[1]), exact=True)


def test_a_copy_of_an_env_with_a_window_opens_its_own(no_screen: None) -> None:
    env = NavigationEnv("empty", overrides={"time.step": 0.01}, render_mode="human")
    env.reset(seed=0)
    twin = pickle.loads(pickle.dumps(env))
    assert data_equivalence(env.step(AHEAD), twin.step(AHEAD), exact=True)
    assert env.render() is None
    env.close()
    twin.close()


def test_rendering_without_a_mode_is_answered_by_a_warning() -> None:
    env = NavigationEnv("empty")
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def test_registering_twice_changes_nothing_and_warns_of_nothing() -> None:
    specs = {name: gym.spec(name) for name in IDS}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bug_gym.register_envs()
    assert all(gym.spec(name) is spec for name, spec in specs.items())


def test_no_id_leaves_the_time_limit_to_a_wrapper() -> None:
    assert all(gym.spec(name).max_episode_steps is None for name in IDS)


def test_the_reset_after_one_that_was_refused_goes_on_with_the_episode_after_it() -> None:
    world = {"family": "field", "bounds": [-6, -6, 6, 6], "obstacles": 28, "sizes": [0.4, 0.9], "separation": 6.0}
    env: Any = gym.make("BugGym/Navigation-v0", scenario={"world": {**world, "solvable": 0.3}})
    env.reset(seed=0)
    with pytest.raises(ValueError, match="seed 0, episode 1: only"):
        env.reset()
    assert env.unwrapped.simulation.world.episode[0] == 0
    env.step(np.zeros(2, dtype=np.float32))
    env.reset()
    assert env.unwrapped.simulation.world.episode[0] == 2


def test_importing_registers_without_loading_the_core() -> None:
    script = (
        "import sys, json, bug_gym, gymnasium; gymnasium.spec('BugGym/Maze-v0');"
        "print(json.dumps([name for name in ('numba', 'shapely', 'scipy', 'bug_gym.kernels') if name in sys.modules]))"
    )
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == []


def test_the_core_is_at_hand_as_simulation(env: NavigationEnv) -> None:
    assert env.simulation.count == env.simulation.robots == 1


def test_navigation_takes_a_scenario_as_name_dict_or_object() -> None:
    data = {"world": {"family": "empty", "start": [0, 0, 0], "goal": [3, 4]}}
    for scenario in (data, load(data)):
        info = gym.make("BugGym/Navigation-v0", scenario=scenario).reset(seed=0)[1]
        assert info["goal_distance"] == pytest.approx(5.0)
    assert gym.make("BugGym/Navigation-v0", scenario="slab").reset(seed=0)[1]["goal_distance"] == pytest.approx(20.0)


# ---------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    "action",
    [
        [math.nan, 0.0],
        [0.0, math.inf],
        [0.0],
        [0.0, 0.0, 0.0],
        [[0.0, 0.0]],
        0.0,
        None,
        "ahead",
        [[0.0], [0.0, 1.0]],
        {},
    ],
)
def test_an_action_that_is_none_is_refused_and_changes_nothing(action: Any) -> None:
    env = NavigationEnv("static")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="^an action (is|has)|^actions must be finite"):
        env.step(action)
    assert env.step(AHEAD)[4]["time"] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("action", "said"),
    [
        ([math.nan, 0.0], r"^actions must be finite, got nan$"),
        ([0.0, -math.inf], r"^actions must be finite, got -inf$"),
        ([math.inf, -math.inf], r"^actions must be finite, got inf$"),
        ([0.0], r"^an action has shape \(1,\), expected \(2,\)$"),
        ([0.0, 0.0, 0.0], r"^an action has shape \(3,\), expected \(2,\)$"),
        ([[0.0, 0.0]], r"^an action has shape \(1, 2\), expected \(2,\)$"),
        (0.0, r"^an action has shape \(\), expected \(2,\)$"),
    ],
)
def test_an_array_that_is_no_action_is_refused_amid_an_episode(action: Any, said: str) -> None:
    env, twin = NavigationEnv("static"), NavigationEnv("static")
    for one in (env, twin):
        one.reset(seed=0)
        one.step(AHEAD)
    with pytest.raises(ValueError, match=said):
        env.step(np.array(action, dtype=np.float32))
    assert data_equivalence(env.step(AHEAD), twin.step(AHEAD), exact=True)


@pytest.mark.parametrize("action", [-1, 128, 1.0, [1], None])
def test_a_discrete_action_that_is_none_is_refused(action: Any) -> None:
    env = NavigationEnv("static", action="discrete")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="an action"):
        env.step(action)


def test_actions_beyond_the_space_are_cut_to_it() -> None:
    env = NavigationEnv("static")
    runs = []
    for action in ([5.0, -3.0], [1.0, -1.0]):
        env.reset(seed=0)
        runs.append(env.step(np.array(action)))
    assert data_equivalence(runs[0], runs[1], exact=True)


def test_the_greatest_numbers_are_cut_too() -> None:
    env = NavigationEnv("static")
    runs = []
    for action in ([1.7e308, 1.7e308], [1.0, 1.0]):
        env.reset(seed=0)
        env.step(AHEAD)
        runs.append(env.step(np.array(action)))
    assert data_equivalence(runs[0], runs[1], exact=True)


def test_a_step_before_the_first_reset_is_refused() -> None:
    with pytest.raises(ResetNeeded):
        NavigationEnv("static").step(AHEAD)


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_a_picture_before_the_first_reset_is_refused(mode: str, no_screen: None) -> None:
    with pytest.raises(ResetNeeded, match="call reset first"):
        NavigationEnv("static", render_mode=mode).render()


def test_a_state_saved_before_the_first_reset_needs_it_again() -> None:
    env = NavigationEnv("static")
    saved = env.simulation.save()
    env.reset(seed=0)
    env.step(AHEAD)
    env.simulation.restore(saved)
    with pytest.raises(ResetNeeded):
        env.step(AHEAD)


def test_several_robots_are_sent_to_the_parallel_env() -> None:
    with pytest.raises(ValueError, match="parallel_env"):
        NavigationEnv("crossing_robots")


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"observation": "image"}, "'dict', 'flat'.*'image'"),
        ({"action": "joystick"}, "'continuous', 'discrete'.*'joystick'"),
        ({"render_mode": "ansi"}, "'rgb_array'.*'ansi'"),
        ({"scenario": "statik"}, "static"),
        ({"overrides": {"lidar.beems": 3}}, "beams"),
    ],
)
def test_an_argument_that_is_not_known_is_told_what_is(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        NavigationEnv(**settings)


def test_a_seed_too_large_for_the_core_is_refused() -> None:
    with pytest.raises(ValueError, match="seed"):
        NavigationEnv("empty").reset(seed=2**63)


# ---------------------------------------------------------------------------------------------- digests

DIGESTS = {
    "BugGym/Navigation-v0": "e917bd5fb5ae767549b38630d814d36c4b9a5ccc2d3a5f9520e877cbec15ada0",
    "BugGym/Static-v0": "e917bd5fb5ae767549b38630d814d36c4b9a5ccc2d3a5f9520e877cbec15ada0",
    "BugGym/Dynamic-v0": "ac640eb51ee8363ff1988ca7d85f9d1d26f18a82082c338612565ab94fff8ef3",
    "BugGym/MovingTarget-v0": "3e388e00f59f6364902a990ee19c718305a419d89871a042c200f0c3307cebbd",
    "BugGym/Rush-v0": "d8a6390b47d7d11c925b2355dc457df0b65bc5fdcef7e933e4f672f15ab88203",
    "BugGym/Maze-v0": "d0f088f8ef9b8885872fc74f5075ae6ed40779429c7ef2cdfcc0d62760e6e0b8",
    "BugGym/Crowd-v0": "2d2f96b3bc5cd54e0608adc99acdc1666d4459ed2b85b24f449d971b84099a97",
}
"""SHA-256 of a seeded rollout of each id: the only values that come from a run. What changes them makes a new -v1."""


def digest(name: str) -> str:
    """SHA-256 of the float32 observations of three seeds, 200 random actions each."""
    env = gym.make(name, observation="flat")
    result = hashlib.sha256()
    for seed in range(3):
        for item in rollout(env, seed=seed, steps=200):
            result.update(item[0].tobytes())
    return result.hexdigest()


@pytest.mark.parametrize("name", IDS)
def test_an_id_gives_the_worlds_that_it_always_gave(name: str) -> None:
    assert digest(name) == DIGESTS[name]


def test_each_scenario_of_one_robot_has_an_id_with_all_its_forms() -> None:
    bound = {*bug_gym.SCENARIOS_BY_ID.values(), *bug_gym.SCENARIOS_BY_FURTHER_ID.values()}
    assert bound == {name for name in scenario_names() if load(name).robots.count == 1}
    assert bug_gym.SCENARIOS_BY_FURTHER_ID["BugGym/OniWang-v0"] == "oni_wang"
    for name, scenario in bug_gym.SCENARIOS_BY_FURTHER_ID.items():
        for form, keywords in bug_gym.FORMS.items():
            assert gym.spec(name.replace("-v0", f"{form}-v0")).kwargs == {"scenario": scenario, **keywords}


def test_further_ids_make_their_scenario_in_one_row_and_in_many() -> None:
    env = gym.make("BugGym/UTrapDiscrete-v0")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    assert cast(NavigationEnv, env.unwrapped).simulation.scenario == load("u_trap")
    envs = gym.make_vec("BugGym/RoomsFlat-v0", num_envs=2)
    assert envs.reset(seed=0)[0].shape == envs.observation_space.shape


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("form", [form for form in bug_gym.FORMS if form])
def test_a_further_id_is_the_env_in_another_form(name: str, form: str) -> None:
    further = name.replace("-v0", f"{form}-v0")
    keywords: dict[str, Any] = dict(bug_gym.FORMS[form])
    named, plain = gym.make(further), gym.make(name, **keywords)
    assert named.observation_space == plain.observation_space and named.action_space == plain.action_space
    assert isinstance(named.observation_space, gym.spaces.Box)
    assert isinstance(named.action_space, gym.spaces.Discrete) == (form == "Discrete")
    named.action_space.seed(3)
    action = named.action_space.sample()
    for env in (named, plain):
        env.reset(seed=3)
    first, second = named.step(action), plain.step(action)
    np.testing.assert_array_equal(first[0], second[0])
    assert first[1:4] == second[1:4]
    rows = gym.make_vec(further, num_envs=2)
    assert rows.single_observation_space == plain.observation_space and rows.single_action_space == plain.action_space
