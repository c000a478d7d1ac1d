"""Policies handed in as objects drive the robot that they were made for, and no other."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import pytest

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.policy import MisfitError
from bug_gym.robots_env import parallel_env

BRIEF = {"time.limit": 1.0}
OTHERS: dict[str, dict[str, Any]] = {
    "kinematics differential, not holonomic": {"robot.kinematics": "holonomic"},
    "max_speed 1.0, not 2.0": {"robot.max_speed": 2.0},
    "radius 0.2, not 0.25": {"robot.radius": 0.25},
    "beams 64, not 32": {"lidar.beams": 32},
    "range 5.0, not 8.0": {"lidar.range": 8.0},
    "step 0.1, not 0.2": {"time.step": 0.2},
    "latency 0, not 2": {"robot.latency": 0.2},
}


@pytest.mark.parametrize("said", OTHERS)
@pytest.mark.parametrize("name", ["bug2", "hd_bug", "com1_rev3"])
def test_an_object_made_for_another_robot_is_refused_and_says_why(name: str, said: str) -> None:
    scenario = "oni_wang_pair" if name == "com1_rev3" else "static"
    like_static = {"robot.kinematics": "differential", "lidar.beams": 64, "lidar.range": 5.0, **BRIEF}
    made = make_policy(name, load(scenario, like_static))
    other = load(scenario, {**like_static, **OTHERS[said]})
    for drive in (make_policy, lambda policy, source: evaluate([("x", policy)], source, episodes=1)):
        with pytest.raises(MisfitError, match=f"was made for another robot: .*{said}"):
            drive(made, other)


def test_what_the_data_sheet_says_the_world_and_peers_may_be_others() -> None:
    policy = make_policy("bug2", load("static"))
    for other in ({"lidar.noise": 0.02}, {"lidar.dropout": 0.1}, {"world.obstacles": 3}, {"goal.radius": 0.5}):
        assert make_policy(policy, load("static", other)) is policy
        assert len(evaluate([("x", policy)], load("static", {**other, **BRIEF}), episodes=1)) == 1
    several = load("static", {"robots.count": 2, **BRIEF})
    assert len(evaluate([("x", policy)], several, episodes=1)) == 2
    driver: Any = make_policy(policy, env := parallel_env(several))
    assert set(driver.predict(env.reset(seed=0)[0])[0]) == set(env.agents)


def test_velocities_are_no_numbers_of_discrete_actions() -> None:
    of_velocities = make_policy("bug2", gym.make("BugGym/Static-v0"))
    of_numbers = make_policy("bug2", gym.make("BugGym/StaticDiscrete-v0"))
    with pytest.raises(MisfitError, match="answer with velocities, the env takes numbers of discrete actions"):
        make_policy(of_velocities, gym.make("BugGym/StaticDiscrete-v0"))
    with pytest.raises(MisfitError, match="answer with numbers of discrete actions, the env takes velocities"):
        make_policy(of_numbers, gym.make("BugGym/StaticFlat-v0"))
    assert len(evaluate([("x", of_numbers)], load("static", BRIEF), episodes=1)) == 1
