"""What planners do where their goal goes through what stands: that no way leads there now is no verdict."""

from __future__ import annotations

from typing import Any

import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.mapping.goal_watch import SETTLED, GoalWatch
from bug_gym.navigation_env import NavigationEnv

PLANNERS = ["a_star", "visibility_graph", "d2t_dijkstra", "rrt_star", "d_star_lite", "hd_bug_map"]
UNTOLD = [("d_star_lite", {"known": False}), ("d2t_dijkstra", {"known": False})]


def drive(name: str, motion: dict[str, Any], parameters: dict[str, Any], **things: Any) -> tuple[str, str, float]:
    """Outcome, verdict and time [s] of a run after a target that begins at (6, 0), behind a box or what is told instead."""
    world = {
        "family": "explicit",
        "bounds": [-8, -8, 8, 8],
        "polygons": [[[0, -2], [4, -2], [4, 2], [0, 2]]],
        "start": [-6, 0, 0],
        "target": {"at": [6, 0], "motion": {"law": "waypoints", **motion}},
        **things,
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


@pytest.mark.parametrize(("name", "parameters"), [("hd_bug_map", {}), UNTOLD[0]])
def test_a_door_that_opens_unseen_lets_it_to_a_target_that_moves_behind_it(
    name: str, parameters: dict[str, Any]
) -> None:
    # A box whose door, in the side toward the robot, goes aside while that looks for a way round on the other sides.
    walls = [((2.0, -2.0), (6.5, -1.7)), ((2.0, 1.7), (6.5, 2.0)), ((6.2, -1.7), (6.5, 1.7))]
    walls += [((2.0, -1.7), (2.3, -0.8)), ((2.0, 0.8), (2.3, 1.7))]
    door = {
        "shape": {"polygon": [[-0.15, -0.8], [0.15, -0.8], [0.15, 0.8], [-0.15, 0.8]]},
        "motion": {"law": "replay", "points": [[0, 2.15, 0], [25, 2.15, 0], [28, 2.15, 1.8], [99, 2.15, 1.8]]},
    }
    boxes = [[[x0, y0], [x1, y0], [x1, y1], [x0, y1]] for (x0, y0), (x1, y1) in walls]
    target = {"at": [5, 0], "motion": {"law": "waypoints", "speed": 0.2, "points": [[5.5, 1], [5.5, -1], [3.5, 0]]}}
    outcome, verdict, time = drive(name, {}, parameters, polygons=boxes, movers=[door], target=target)
    assert (outcome, verdict) == ("success", "") and time > 28.0


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
