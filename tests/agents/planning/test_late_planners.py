"""Robots with latency that follow ways and walls: what they do is judged from where a command finds them."""

from __future__ import annotations

import math
from typing import Any

import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.planning.follow import pose_to_be
from bug_gym.evaluation import evaluate
from bug_gym.navigation_env import NavigationEnv
from bug_gym.view import Sensors, View

BOX = [[-1, -2], [1, -2], [1, 3], [-1, 3]]
PLANNERS = ["a_star", "theta_star", "visibility_graph", "d_star_lite"]


def described(kinematics: str, speed: float, step: float, late: int) -> dict[str, Any]:
    """A box between start and goal, for a robot whose commands act so many steps later."""
    return {
        "robot": {"kinematics": kinematics, "max_speed": speed, "latency": round(late * step, 3)},
        "lidar": {"beams": 180, "range": 20.0},
        "time": {"step": step, "limit": 90.0},
        "world": {
            "family": "explicit",
            "bounds": [-8, -8, 8, 8],
            "polygons": [BOX],
            "start": [-6, 0, 0],
            "goal": [6, 0.3],
        },
    }


@pytest.mark.parametrize("late", [1, 2])
@pytest.mark.parametrize(("speed", "step"), [(2.0, 0.2), (2.0, 0.3), (5.0, 0.2), (5.0, 0.5)])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_late_robot_keeps_to_its_way(kinematics: str, speed: float, step: float, late: int) -> None:
    # They stood 8 mm before the corner for ever, nearer than lets a robot turn.
    for row in evaluate(PLANNERS, described(kinematics, speed, step, late), episodes=1):
        assert row.success and row.path_length < 14.0, row.policy


@pytest.mark.parametrize(
    ("policy", "speed", "step", "late"),
    [("bug2", 5.0, 0.5, 1), ("bug2", 5.0, 0.3, 2), ("tangent_bug", 2.0, 0.5, 2), ("hd_bug_map", 5.0, 0.5, 2)],
)
def test_a_late_robot_does_not_drive_past_its_goal_for_ever(policy: str, speed: float, step: float, late: int) -> None:
    (row,) = evaluate([policy], described("holonomic", speed, step, late), episodes=1)
    assert row.success


@pytest.mark.parametrize(("speed", "step"), [(2.0, 0.5), (5.0, 0.2)])
def test_what_lies_between_beams_is_as_wide_for_a_late_robot_as_it_is_from_here(speed: float, step: float) -> None:
    """The corner of the box, met by no beam, was touched two steps after a scan that showed it 2.4 m away."""
    (row,) = evaluate(["hd_bug_map"], described("holonomic", speed, step, 2), episodes=1)
    assert row.success


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("late", [0, 1, 3])
def test_the_pose_to_be_is_the_one_that_comes(kinematics: str, late: int) -> None:
    env = NavigationEnv(described(kinematics, 1.0, 0.2, late), observation="flat")
    policy, sensors = make_policy("bug2", env), Sensors.of(env.simulation.scenario)
    observation, _ = env.reset(seed=0)
    state: Any = None
    expected, came = [], []
    for _ in range(40):
        view = View(observation, sensors)
        view.under_way = [] if state is None else list(state[0].under_way)
        expected.append(pose_to_be(view, view.pose))
        came.append(view.pose)
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
    for foretold, pose in zip(expected, came[late:], strict=False):
        assert math.dist(foretold[:2], pose[:2]) < 1e-3
        assert math.cos(foretold[2] - pose[2]) > 1.0 - 1e-5
