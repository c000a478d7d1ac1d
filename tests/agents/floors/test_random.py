"""The random policy: the same in the same world, independent in others and of its neighbours."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

import bug_gym
from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.evaluation import evaluate

HOLONOMIC = {"robot.kinematics": "holonomic", "lidar.beams": 8}


def first_actions(seeds: range, **parameters: Any) -> NDArray[np.float32]:
    """The first actions in worlds of some seeds (n, 2)."""
    env = gym.make("BugGym/Navigation-v0", scenario=load("static", HOLONOMIC))
    policy = make_policy("random", env, **parameters)
    return np.array([policy.predict(env.reset(seed=seed)[0])[0] for seed in seeds])


def test_worlds_have_draws_of_their_own_and_the_same_ones_each_time() -> None:
    drawn = first_actions(range(12))
    np.testing.assert_array_equal(drawn, first_actions(range(12)))
    assert len(np.unique(drawn, axis=0)) == 12
    assert (drawn != first_actions(range(12), seed=1)).all()


def test_first_velocities_of_many_worlds_are_spread_evenly_over_the_disc() -> None:
    """Of n even draws no share lies farther from its own than 4 / sqrt(n) * sqrt(p (1 - p))."""
    x, y = first_actions(range(600)).T
    square, angle = x**2 + y**2, np.arctan2(y, x)
    assert square.max() <= 1.0 + 1e-6
    halves = (square < 0.5, angle < 0.0, np.abs(angle) < np.pi / 2, np.sin(3.0 * angle) > 0.0)
    for share, even in [(square < 0.25, 0.25), *((half, 0.5) for half in halves)]:
        assert abs(share.mean() - even) < 4.0 * np.sqrt(even * (1.0 - even) / 600)


def test_rows_and_robots_draw_apart_and_as_they_do_alone() -> None:
    envs = gym.make_vec("BugGym/Navigation-v0", num_envs=6, scenario=load("static", HOLONOMIC))
    policy, (observations, _) = make_policy("random", envs), envs.reset(seed=0)
    state = None
    rows = []
    for _ in range(3):
        actions, state = policy.predict(observations, state)
        rows.append(actions)
        observations = envs.step(actions)[0]
    assert len(np.unique(rows[0], axis=0)) == 6
    env = gym.make("BugGym/Navigation-v0", scenario=load("static", HOLONOMIC))
    observation, _ = env.reset(seed=4)
    state = None
    for step in range(3):
        action, state = policy.predict(observation, state)
        np.testing.assert_array_equal(action, rows[step][4])
        observation = env.step(action)[0]
    team = bug_gym.parallel_env("circle_swap")
    driver: Any = make_policy("random", team)
    moves, _ = driver.predict(team.reset(seed=0)[0])
    assert len(np.unique(list(moves.values()), axis=0)) == len(team.agents)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_evaluation_does_not_depend_on_who_drives_what(workers: int) -> None:
    rows = evaluate(["random"], "static", episodes=4, overrides=HOLONOMIC, workers=workers)
    alone = evaluate(["random"], "static", episodes=2, seed=2, overrides=HOLONOMIC)
    assert [row.path_length for row in rows][2:] == [row.path_length for row in alone]
