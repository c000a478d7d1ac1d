"""What planners do where their goal goes through what stands: that no way leads there now is no verdict."""

from __future__ import annotations

from typing import Any

import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.mapping.goal_watch import SETTLED, GoalWatch
from bug_gym.navigation_env import NavigationEnv

PLANNERS = ["a_star", "visibility_graph", "d2t_dijkstra", "rrt_star", "d_star_lite", "hd_bug_map"]
UNTOLD = [("d_star_lite", {"known": False}), ("d2t_dijkstra", {"known": False})]


def drive(name: str, motion: dict[str, Any], parameters: dict[str, Any]) -> tuple[str, str, float]:
    """Outcome, verdict and time [s] of a run after a target that begins at (6, 0), behind a box."""
    world = {
        "family": "explicit",
        "bounds": [-8, -8, 8, 8],
        "polygons": [[[0, -2], [4, -2], [4, 2], [0, 2]]],
        "start": [-6, 0, 0],
        "target": {"at": [6, 0], "motion": {"law": "waypoints", **motion}},
    }
    env = NavigationEnv({"lidar": {"beams": 90}, "time": {"limit": 90.0}, "world": world})
    policy, verdict = make_policy(name, env, **parameters), ""
    state: tuple[Any, ...] | None = None
    observation, info = env.reset(seed=0)
    while info["outcome"] == "running" and not verdict:
        action, state = policy.predict(observation, state)
        assert state is not None
        verdict = state[0].verdict
        observation, *_, info = env.step(action)
    return info["outcome"], verdict, info["time"]


@pytest.mark.parametrize(("name", "parameters"), [*((name, {}) for name in PLANNERS), *UNTOLD])
def test_a_target_that_comes_out_of_an_obstacle_again_is_caught(name: str, parameters: dict[str, Any]) -> None:
    # From the far side through the box to the near one: within it for 13 s.
    assert drive(name, {"speed": 0.3, "points": [[-2, 0]], "stop": True}, parameters)[:2] == ("success", "")


@pytest.mark.parametrize("name", ["a_star", "visibility_graph", "d2t_dijkstra", "hd_bug_map"])
def test_one_that_stays_within_it_is_unreachable_once_it_has_stayed(name: str) -> None:
    outcome, verdict, time = drive(name, {"speed": 1.0, "points": [[2, 0]], "stop": True}, {})
    assert (outcome, verdict) == ("running", "unreachable")
    assert 4.0 + SETTLED <= time < 60.0


def test_a_goal_has_settled_until_it_goes_elsewhere_and_after_a_while() -> None:
    watch = GoalWatch()
    watch.look((1.0, 2.0), 0.1)
    watch.look((1.0, 2.04), 0.1)
    assert watch.has_settled
    watch.look((1.0, 2.06), 0.1)
    assert not watch.has_settled
    for _ in range(99):
        watch.look((1.0, 2.06), 0.1)
    assert not watch.has_settled
    watch.look((1.0, 2.06), 0.11)
    assert watch.has_settled
