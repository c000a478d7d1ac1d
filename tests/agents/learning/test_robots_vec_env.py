"""Several robots as rows of one `VecEnv`: what they see, and how they start again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import data_equivalence
from stable_baselines3 import PPO

import bug_gym
from bug_gym.agents import sb3
from bug_gym.agents.learning.settings import load_settings
from bug_gym.agents.learning.training import InTraining, make_training_env, robot_of
from bug_gym.agents.learning.vec_envs import JoinedVecEnv
from bug_gym.agents.sb3 import NavigationVecEnv, RobotsVecEnv, make_robots_vec_env, make_vec_env
from bug_gym.config import load
from bug_gym.held_out import play

AHEAD, STANDING = [1.0, 0.0], [-0.53846154, 0.0]  # reverse is 0.3 of 1.3 m/s


def head_on(worlds: int = 2, limit: float = 20.0, goal: float = 3.0, restart: Any = "robot") -> RobotsVecEnv:
    """Two robots in a bare world: the first drives 3 m to its goal, the second has its goal beside it, far off."""
    scenario = {
        "robot": {"kinematics": "differential"},
        "lidar": {"beams": 16, "range": 5.0},
        "time": {"limit": limit},
        "world": {"family": "empty", "bounds": [-10, -10, 10, 10], "start": [0, 0, 0], "goal": [9, 9]},
        "robots": [{"start": [0, 0, 0], "goal": [goal, 0]}, {"start": [0, 5, 0], "goal": [9, 5]}],
    }
    return make_robots_vec_env(scenario, n_envs=worlds, seed=0, restart=restart)


def steps(env: RobotsVecEnv, first: Any, second: Any, count: int) -> list[Any]:
    """What each of some steps gives, all first and all second robots doing the same."""
    return [env.step(np.array([first, second] * env.simulation.count)) for _ in range(count)]


def test_rows_are_the_robots_of_a_parallel_env() -> None:
    scenario = load("crossing_robots")
    env = make_robots_vec_env(scenario, n_envs=3, seed=4)
    single = bug_gym.parallel_env(scenario, observation="flat")
    flat: Any = env.reset()
    expected, _ = single.reset(seed=5)
    rng = np.random.default_rng(0)
    for _ in range(40):
        np.testing.assert_array_equal(flat[2:4], [expected["robot_0"], expected["robot_1"]])
        actions = rng.uniform(-0.2, 1.0, (6, 2)).astype(np.float32)
        flat, reward, done, infos = env.step(actions)
        expected, rewards, *_ = single.step({"robot_0": actions[2], "robot_1": actions[3]})
        assert not done.any() and infos == [{}] * 6
        np.testing.assert_allclose(reward[2:4], [rewards["robot_0"], rewards["robot_1"]], rtol=1e-6)


def test_a_robot_that_arrives_starts_again_while_the_other_goes_on() -> None:
    env = head_on()
    first = env.reset()
    *_, (flat, reward, done, infos) = steps(env, AHEAD, [0.2, 0.3], 27)  # 2.7 m to the goal's rim
    assert done.tolist() == [True, False, True, False]
    assert infos[0]["is_success"] and infos[0]["episode"]["l"] == 27 and not infos[0]["TimeLimit.truncated"]
    assert reward[0] > 5.0 and infos[1] == {}
    np.testing.assert_allclose(flat[0, :23], first[0, :23], atol=0.2)  # but for what it sees of the other
    np.testing.assert_allclose(flat[0, 16:23], [3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-6)
    assert np.abs(flat[1, 18:20]).max() > 0.5
    assert infos[0]["terminal_observation"][16] == pytest.approx(0.3, abs=1e-6)
    *_, (_, _, done, infos) = steps(env, AHEAD, STANDING, 27)
    assert done[0] and infos[0]["episode"]["l"] == 27


def test_what_happens_to_one_robot_leaves_the_others_motion_alone() -> None:
    ended, never = head_on(worlds=1), head_on(worlds=1, goal=8.0)
    ended.reset(), never.reset()
    for env in (ended, never):
        steps(env, AHEAD, [0.5, 0.1], 40)
    np.testing.assert_array_equal(ended.simulation.world.pose[:, 1], never.simulation.world.pose[:, 1])


def test_a_robot_waits_while_another_stands_on_its_start() -> None:
    env = head_on(worlds=1)
    env.reset()
    steps(env, AHEAD, STANDING, 26)
    env.simulation.world.pose[0, 1] = [0.1, 0.0, 0.0]
    flat, reward, done, infos = steps(env, AHEAD, STANDING, 1)[0]
    assert done[0] and infos[0]["is_success"]
    assert env.simulation.world.pose[0, 0, 0] == pytest.approx(2.7)
    flat, reward, done, infos = steps(env, AHEAD, STANDING, 1)[0]
    assert done[0] and reward[0] == 0.0 and infos[0].keys() == {"terminal_observation"}
    env.simulation.world.pose[0, 1] = [0.0, 5.0, 0.0]
    steps(env, AHEAD, STANDING, 1)
    assert env.simulation.world.pose[0, 0, 0] == 0.0
    assert not steps(env, AHEAD, STANDING, 1)[0][2][0]


def test_all_start_anew_when_the_worlds_time_is_over() -> None:
    env = head_on(worlds=1, limit=4.0)
    env.reset()
    run = steps(env, AHEAD, [0.2, 0.3], 40)
    assert [step[2].tolist() for step in run[36:]] == [[False, False]] * 3 + [[True, True]]
    infos = run[-1][3]
    assert [info["TimeLimit.truncated"] for info in infos] == [True, True]
    assert [info["episode"]["l"] for info in infos] == [13, 40]
    assert env.simulation.world.steps[0] == 0 and env.simulation.world.episode[0] == 1


def test_a_world_starts_anew_when_the_last_of_its_robots_has_ended_and_not_before() -> None:
    env = head_on(limit=4.0, restart="world")
    env.reset()
    *_, (flat, reward, done, infos) = steps(env, AHEAD, [0.2, 0.3], 27)  # 2.7 m to the goal's rim
    assert done.tolist() == [True, False, True, False] and infos[0]["is_success"]
    arrived = env.simulation.world.pose[0, 0].copy()
    for flat, reward, done, infos in steps(env, AHEAD, [0.2, 0.3], 12):
        assert done.tolist() == [True, False, True, False]
        assert reward[0] == 0.0 and infos[0].keys() == {"terminal_observation"} and infos[1] == {}
        np.testing.assert_array_equal(env.simulation.world.pose[0, 0], arrived)
        np.testing.assert_array_equal(flat[0], infos[0]["terminal_observation"])
    [(flat, reward, done, infos)] = steps(env, AHEAD, [0.2, 0.3], 1)
    assert done.all() and infos[1]["TimeLimit.truncated"] and infos[1]["episode"]["l"] == 40
    assert "episode" not in infos[0]
    assert env.simulation.world.episode.tolist() == [1, 1] and env.simulation.world.steps.tolist() == [0, 0]
    *_, (_, _, done, infos) = steps(env, AHEAD, [0.2, 0.3], 27)
    assert done.tolist() == [True, False, True, False] and infos[0]["episode"]["l"] == 27


@pytest.mark.parametrize("observation", ["dict", "flat"])
@pytest.mark.parametrize("action", ["continuous", "discrete"])
def test_rows_are_those_of_parallel_envs_that_are_reset_when_no_robot_is_left(observation: Any, action: Any) -> None:
    scenario = load("circle_swap", {"time.limit": 4.0, "world.radius": 1.5})
    env = make_robots_vec_env(scenario, 3, 2, seed=7, observation=observation, action=action)
    singles = [bug_gym.parallel_env(scenario, robots=3, observation=observation, action=action) for _ in range(2)]
    assert env.num_envs == 6 and env.observation_space == singles[0].observation_space("robot_0")
    rows: Any = env.reset()
    expected = [single.reset(seed=7 + number)[0] for number, single in enumerate(singles)]
    episodes = 0
    for step in range(120):
        env.action_space.seed(step)
        for number, single in enumerate(singles):
            for robot, agent in enumerate(single.possible_agents):
                if agent in expected[number]:
                    mine = (
                        {key: value[3 * number + robot] for key, value in rows.items()}
                        if observation == "dict"
                        else None
                    )
                    same = mine if mine is not None else rows[3 * number + robot]
                    assert data_equivalence(same, expected[number][agent], exact=True)
            np.testing.assert_array_equal(env.state()[number], single.state())
        actions = np.stack([env.action_space.sample() for _ in range(6)])
        rows, reward, done, _ = env.step(actions)
        for number, single in enumerate(singles):
            names = {agent: 3 * number + robot for robot, agent in enumerate(single.possible_agents)}
            expected[number], rewards, *_ = single.step({agent: actions[names[agent]] for agent in single.agents})
            for agent, row in names.items():
                assert reward[row] == np.float32(rewards.get(agent, 0.0)) and done[row] == (agent not in single.agents)
            if not single.agents:
                expected[number], _ = single.reset()
                episodes += 1
            expected[number] = {agent: expected[number][agent] for agent in single.agents}
    assert episodes >= 4


def test_another_restart_is_refused() -> None:
    with pytest.raises(ValueError, match="restart is one of 'world', 'robot', got 'never'"):
        make_robots_vec_env("crossing_robots", restart="never")  # type: ignore[arg-type]


def test_more_robots_than_a_scenario_has_places_for_are_refused() -> None:
    with pytest.raises(ValueError, match="expected at most 4"):
        make_robots_vec_env("crossing_robots", 5)


@pytest.mark.parametrize("restart", ["world", "robot"])
def test_a_saved_state_goes_on_bit_for_bit(restart: Any) -> None:
    env = make_robots_vec_env("crossing_robots", n_envs=2, seed=0, restart=restart)
    env.reset()
    rng = np.random.default_rng(1)
    actions = rng.uniform([0.5, -0.3], [1.0, 0.3], (300, 4, 2)).astype(np.float32)
    for action in actions[:150]:
        env.step(action)
    saved = env.save()
    first = [env.step(action)[:3] for action in actions[150:]]
    env.restore(saved)
    second = [env.step(action)[:3] for action in actions[150:]]
    assert any(step[2].any() for step in first)
    for mine, theirs in zip(first, second, strict=True):
        for one, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(one, other)


def test_scenarios_with_one_and_several_robots_do_not_mix_because_they_see_different_things() -> None:
    settings = load_settings("ppo_crossing_robots", {"scenarios": ["crossing_robots", "static"]})
    with pytest.raises(ValueError, match="another robot.*peers"):
        make_training_env(settings, 0)


def test_more_robots_than_rows_are_refused() -> None:
    with pytest.raises(ValueError, match="n_envs"):
        make_training_env(load_settings("ppo_crossing_robots", {"n_envs": 1}), 0)


def test_parts_are_joined_row_after_row() -> None:
    parts = [make_robots_vec_env("crossing_robots", n_envs=count) for count in (1, 2)]
    joined = JoinedVecEnv(parts)
    joined.seed(3)
    assert joined.reset().shape == (6, 75)
    assert [part.simulation.world.seed.tolist() for part in parts] == [[3], [5, 6]]
    *_, done, infos = joined.step(np.tile(np.array(AHEAD, dtype=np.float32), (6, 1)))
    assert done.shape == (6,) and len(infos) == 6


def lasting(seconds: float, **world: Any) -> NavigationVecEnv:
    """Two worlds with episodes of so many seconds, of a world in which a robot that stands meets nothing."""
    field = {"family": "field", "obstacles": 3, "bounds": [-6, -6, 6, 6], "separation": 6.0, **world}
    return make_vec_env({"world": field, "time": {"limit": seconds}}, 2, observation="flat")


def test_a_part_that_finds_no_place_costs_the_others_no_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sb3, "TRIES", 1)
    joined = JoinedVecEnv([lasting(0.3), lasting(0.4), lasting(0.5)])
    alone = [lasting(0.3), lasting(0.4), lasting(0.5)]
    joined.seed(7)
    for part, number in zip(alone, (7, 9, 11), strict=True):
        part.seed(number)
    np.testing.assert_array_equal(joined.reset(), np.concatenate([part.reset() for part in alone]))
    rng, refused = np.random.default_rng(0), 0
    for _ in range(12):
        actions = rng.uniform(-1.0, 1.0, (6, 2)).astype(np.float32)
        expected = [part.step(some) for part, some in zip(alone, np.split(actions, 3), strict=True)]
        if any(step[2].any() for step in expected[1:]):
            with monkeypatch.context() as patched:  # the second and the third have no place for what comes next
                for late in joined.parts[1:]:
                    patched.setattr(late, "_refusal", lambda worlds: ValueError("no place") if len(worlds) else None)
                with pytest.raises(ValueError, match="no place"):
                    joined.step(actions)
                with pytest.raises(ValueError, match="no place"):
                    joined.step(-actions)
            refused += 1
            actions = -actions
        observation, reward, done, infos = joined.step(actions)
        np.testing.assert_array_equal(observation, np.concatenate([step[0] for step in expected]))
        np.testing.assert_array_equal(reward, np.concatenate([step[1] for step in expected]))
        np.testing.assert_array_equal(done, np.concatenate([step[2] for step in expected]))
        assert [info.get("episode", {}).get("r") for info in infos] == [
            info.get("episode", {}).get("r") for step in expected for info in step[3]
        ]
    assert refused > 3


def test_a_reset_of_joined_parts_drops_the_step_that_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sb3, "TRIES", 1)
    joined, fresh = (JoinedVecEnv([lasting(0.3), lasting(0.1)]) for _ in range(2))
    for made in (joined, fresh):
        made.seed(0)
        made.reset()
    saved = joined.save()
    actions = np.ones((4, 2), dtype=np.float32)
    for start_over in (lambda: joined.restore(saved), lambda: (joined.seed(0), joined.reset())):
        with monkeypatch.context() as patched:
            patched.setattr(joined.parts[1], "_refusal", lambda worlds: ValueError("no place"))
            with pytest.raises(ValueError, match="no place"):
                joined.step(actions)
        start_over()
        fresh.seed(0)
        fresh.reset()
        for one, other in zip(joined.step(actions)[:3], fresh.step(actions)[:3], strict=True):
            np.testing.assert_array_equal(one, other)
        joined.seed(0)
        joined.reset()


def test_attributes_of_joined_parts_are_set_for_all_rows_or_for_none() -> None:
    joined = JoinedVecEnv([lasting(0.3), lasting(0.3)])
    with pytest.raises(ValueError, match="the rows share 'difficulty'"):
        joined.set_attr("difficulty", 3, indices=[0])
    joined.set_attr("difficulty", 3)
    assert joined.get_attr("difficulty", [0, 3]) == [3, 3]


def test_one_policy_drives_all_robots_in_training_and_in_an_evaluation() -> None:
    settings = load_settings("ppo_crossing_robots", {"n_envs": 16, "n_steps": 16, "batch_size": 64})
    env = make_training_env(settings, 0)
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=64, n_epochs=1, device="cpu", seed=0).learn(512)
    scenario = settings.loaded[0]
    played = play(InTraining(model, robot_of([scenario]), ()), scenario, range(5))
    assert played.outcome.shape == (5, 2) and (played.outcome > 0).all()


def test_there_is_no_state_before_the_first_reset() -> None:
    with pytest.raises(ResetNeeded, match="call reset first"):
        head_on().state()
