"""Policies of envs in wrappers: what leaves spaces as they are is seen through, what changes them is refused."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.wrappers import vector

from bug_gym.agents import make_policy

CHANGED: dict[str, Any] = {
    "flattened": lambda: wrappers.FlattenObservation(gym.make("BugGym/Dynamic-v0")),
    "stacked": lambda: wrappers.FrameStackObservation(gym.make("BugGym/DynamicFlat-v0"), 2),
    "normalised": lambda: wrappers.NormalizeObservation(gym.make("BugGym/DynamicFlat-v0")),
    "rescaled": lambda: wrappers.RescaleAction(gym.make("BugGym/Dynamic-v0"), np.float32(0.0), np.float32(1.0)),
    "vector": lambda: vector.FlattenObservation(gym.make_vec("BugGym/Dynamic-v0", 2)),
}


@pytest.mark.parametrize("name", CHANGED)
def test_wrappers_that_change_spaces_are_refused(name: str) -> None:
    """Gymnasium flattens to the same numbers in the same order; what a policy reads is the env's own all the same."""
    env = CHANGED[name]()
    kind = "actions" if name == "rescaled" else "observations"
    with pytest.raises(ValueError, match=f"policy 'bug2' reads the env's own {kind}: got Box.* expected "):
        make_policy("bug2", env)
    assert make_policy("bug2", env.unwrapped) is not None


def test_wrappers_that_change_no_space_are_seen_through() -> None:
    env = wrappers.RecordEpisodeStatistics(wrappers.TimeLimit(gym.make("BugGym/Dynamic-v0"), 50))
    plain = gym.make("BugGym/Dynamic-v0")
    (seen, _), (bare, _) = env.reset(seed=3), plain.reset(seed=3)
    np.testing.assert_array_equal(
        make_policy("bug2", env).predict(seen)[0], make_policy("bug2", plain).predict(bare)[0]
    )


def test_vec_envs_of_stable_baselines3_that_change_spaces_are_refused() -> None:
    common = pytest.importorskip("stable_baselines3.common.vec_env")
    from bug_gym.agents.sb3 import make_vec_env

    env = make_vec_env("BugGym/Dynamic-v0", 2, observation="flat")
    assert make_policy("bug2", common.VecMonitor(env)) is not None
    with pytest.raises(ValueError, match="observations: got Box"):
        make_policy("bug2", common.VecFrameStack(env, 2))
    normalised = common.VecNormalize(env)
    for wrapped in (normalised, common.VecMonitor(normalised)):
        with pytest.raises(ValueError, match="got ones that VecNormalize normalises"):
            make_policy("bug2", wrapped)
    assert make_policy("bug2", common.VecNormalize(env, norm_obs=False)) is not None
