"""BugGym/Prediction-v0."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from bug_gym.agents.prediction.env import PredictionEnv
from bug_gym.agents.prediction.features import ANSWERS, KALMAN_ERRORS

ID = "BugGym/Prediction-v0"


def test_it_is_an_env_as_gymnasium_wants_it() -> None:
    check_env(gym.make(ID).unwrapped, skip_render_check=True)


def test_an_episode_is_one_answer() -> None:
    env = gym.make(ID)
    env.reset(seed=3)
    *_, terminated, truncated, _ = env.step(np.zeros(ANSWERS, dtype=np.float32))
    assert terminated and not truncated


def test_the_same_seed_asks_the_same() -> None:
    env = PredictionEnv()
    first, second = ([env.reset(seed=5)[0], *(env.reset()[0] for _ in range(10))] for _ in range(2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first[0], env.reset(seed=6)[0])


def test_the_answer_zero_is_the_filters() -> None:
    env = PredictionEnv()
    for seed in range(3):
        env.reset(seed=seed)
        _, reward, _, _, info = env.step(np.zeros(ANSWERS, dtype=np.float32))
        assert np.array_equal(info["errors"], info["kalman_errors"]) and reward == 0.0


def test_the_reward_is_by_how_much_the_answer_beats_the_filter() -> None:
    env = PredictionEnv()
    env.reset(seed=1)
    _, reward, _, _, info = env.step(np.full(ANSWERS, 0.3, dtype=np.float32))
    assert reward == pytest.approx(np.mean((info["kalman_errors"] - info["errors"]) / KALMAN_ERRORS))


def test_an_answer_is_cut_to_the_bounds_of_its_space() -> None:
    env = PredictionEnv()
    beyond = np.array([3.0, -7.0, 0.5, 1.5, -1.0, 1e30, 0.0, -1.5], dtype=np.float32)
    told = []
    for answer in (beyond, np.array([1.0, -1.0, 0.5, 1.0, -1.0, 1.0, 0.0, -1.0], dtype=np.float32)):
        env.reset(seed=2)
        told.append(env.step(answer))
    (_, reward, _, _, info), (_, cut_reward, _, _, cut_info) = told
    assert reward == cut_reward and np.array_equal(info["errors"], cut_info["errors"])


def test_worlds_follow_their_laws_in_turn() -> None:
    env = PredictionEnv(laws=("crowd", "bounce"))
    laws = []
    env.reset(seed=0)
    for _ in range(2000):
        laws.append(env.reset()[1]["law"])
    changes = [law for law, before in zip(laws, ["", *laws], strict=False) if law != before]
    assert changes[:2] == ["crowd", "bounce"]


@pytest.mark.parametrize("laws", [(), ("fly",)])
def test_laws_that_are_none_are_refused(laws: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="expected some of bounce"):
        PredictionEnv(laws)


@pytest.mark.parametrize("answer", [np.zeros(3), np.full(ANSWERS, np.nan)])
def test_an_answer_that_is_none_is_refused(answer: np.ndarray) -> None:
    env = PredictionEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="8 finite numbers"):
        env.step(answer)


def test_nothing_can_be_answered_before_it_is_asked() -> None:
    env = PredictionEnv()
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros(ANSWERS, dtype=np.float32))
