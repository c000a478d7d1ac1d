"""TorchRL's own wrappers take every face with `info="numeric"`; away where TorchRL is not installed (docs/examples)."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import bug_gym

torchrl = pytest.importorskip("torchrl.envs")
utils = pytest.importorskip("torchrl.envs.utils")

SHORT = {"time.limit": 1.5}


def native(mode: AutoresetMode) -> Any:
    return gym.make_vec(
        "BugGym/DynamicFlat-v0", num_envs=3, autoreset_mode=mode, info="numeric", overrides=SHORT
    )  # our own vector env


def robots(observation: Literal["dict", "flat"]) -> Any:
    worlds = bug_gym.parallel_env("crossing_robots", overrides=SHORT, robots=2, observation=observation, info="numeric")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # TorchRL was tried by its makers with an earlier PettingZoo
        return torchrl.PettingZooWrapper(worlds, use_mask=True, done_on_any=False)


FACES: dict[str, Callable[[], Any]] = {
    "by id": lambda: torchrl.GymEnv("BugGym/Dynamic-v0", info="numeric", overrides=SHORT),
    "dict": lambda: torchrl.GymWrapper(gym.make("BugGym/Dynamic-v0", info="numeric", overrides=SHORT)),
    "flat": lambda: torchrl.GymWrapper(gym.make("BugGym/DynamicFlat-v0", info="numeric", overrides=SHORT)),
    "discrete": lambda: torchrl.GymWrapper(gym.make("BugGym/DynamicDiscrete-v0", info="numeric", overrides=SHORT)),
    "vector, same step": lambda: torchrl.GymWrapper(native(AutoresetMode.SAME_STEP)),
    "vector, disabled": lambda: torchrl.GymWrapper(native(AutoresetMode.DISABLED)),
    "robots, flat": lambda: robots("flat"),
    "robots, dict": lambda: robots("dict"),
}


@pytest.fixture(autouse=True)
def quiet() -> None:
    logging.getLogger("torchrl").setLevel(logging.ERROR)


@pytest.mark.parametrize("face", FACES)
def test_a_face_keeps_its_specs_and_goes_on_past_the_end_of_episodes(face: str) -> None:
    env = FACES[face]()
    utils.check_env_specs(env, seed=0)
    found = env.rollout(40, break_when_any_done=False)
    assert found.batch_size[-1] == 40 and found["next", "done"].sum() >= 2
    env.close()


def test_a_rollout_is_what_the_env_itself_does() -> None:
    wrapped = torchrl.GymEnv("BugGym/DynamicFlat-v0", info="numeric")
    wrapped.set_seed(5)
    found = wrapped.rollout(12)
    env = gym.make("BugGym/DynamicFlat-v0")
    env.reset(seed=5)  # as TorchRL does to seed; a rollout resets once more
    seen, _ = env.reset()
    for at in range(len(found)):
        np.testing.assert_array_equal(found["observation"][at].numpy(), seen)
        seen, reward, *_ = env.step(found["action"][at].numpy())
        assert found["next", "reward"][at].item() == np.float32(reward)


def test_the_last_observation_of_an_episode_is_its_own_not_that_of_the_next() -> None:
    env = torchrl.GymWrapper(native(AutoresetMode.SAME_STEP))
    env.set_seed(3)
    found = env.rollout(20, break_when_any_done=False)
    alone = native(AutoresetMode.DISABLED)
    alone.reset(seed=3)
    seen, _ = alone.reset()
    over = np.zeros(3, bool)
    for at in range(20):
        seen, _, terminated, truncated, _ = alone.step(found["action"][:, at].numpy())
        ended = terminated | truncated
        for row in np.flatnonzero(ended & ~over):
            assert found["next", "done"][row, at].item()
            np.testing.assert_array_equal(found["next", "observation"][row, at].numpy(), seen[row])
        over |= ended
        if over.all():
            return
    pytest.fail("an episode of 1.5 s did not end")
