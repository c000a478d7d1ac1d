"""Scripted policies with discrete actions: as near to what they want as lets them stop, and a way to stand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.inertia import nearest_number, stoppable_number
from bug_gym.kinematics import discrete_velocities
from bug_gym.navigation_env import NavigationEnv
from bug_gym.view import Sensors, View

KINEMATICS = ["holonomic", "differential"]
LAZY = {"robot.max_acceleration": 0.5, "lidar.beams": 180}
"""A robot that needs a metre to stop from 1 m/s."""


def last_info(scenario: str, name: str, overrides: dict[str, Any], *, seed: int = 0, steps: int) -> dict[str, Any]:
    """The info at the end of an episode with discrete actions, or after so many steps, verdicts or not."""
    env = NavigationEnv(scenario, action="discrete", overrides=overrides)
    policy: Any = make_policy(name, env)
    observation, info = env.reset(seed=seed)
    state = None
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        assert env.action_space.contains(action)
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    return {**info, "verdict": state[0].verdict if state else ""}


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("name", ["bug2", "tangent_bug", "dist_bug"])
@pytest.mark.parametrize("seed", range(2))
def test_a_robot_that_stops_late_touches_nothing_with_discrete_actions(name: str, kinematics: str, seed: int) -> None:
    told = last_info("rooms", name, {**LAZY, "robot.kinematics": kinematics}, seed=seed, steps=500)
    assert told["outcome"] != "collision" and told["min_clearance"] > 0.0


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("name", ["bug2", "a_star"])
def test_after_its_verdict_it_stays_where_it_is(name: str, kinematics: str) -> None:
    """None of the discrete actions stands; it had gone on into the ring."""
    env = NavigationEnv("ring", action="discrete", overrides={"robot.kinematics": kinematics})
    policy: Any = make_policy(name, env)
    observation, _ = env.reset(seed=0)
    state, places = None, []
    for _ in range(900):
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        assert not (terminated or truncated), info
        if state[0].verdict == "unreachable":
            places.append(env.simulation.world.pose[0, 0, :2].copy())
    step = Sensors.of(env.simulation.scenario).step_length
    assert len(places) > 300
    assert np.linalg.norm(np.array(places) - places[0], axis=1).max() <= step


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("name", ["dwa", "go_to_goal"])
def test_who_waits_before_a_wall_does_not_drive_into_it(name: str, kinematics: str) -> None:
    told = last_info("u_trap", name, {"robot.kinematics": kinematics}, steps=400)
    assert told["outcome"] == "running"
    assert told["min_clearance"] > 0.0


def view_in(overrides: dict[str, Any], **world: Any) -> View:
    """What a robot sees at the start of a world of walls."""
    explicit = {"family": "explicit", "bounds": [-6, -6, 6, 6], "start": [0, 0, 0], "goal": [5, 5], **world}
    env = NavigationEnv({"world": explicit}, observation="flat", overrides=overrides)
    observation, _ = env.reset(seed=0)
    return View(observation, Sensors.of(env.simulation.scenario))


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("acceleration", [None, 2.0])
def test_where_all_is_clear_it_is_the_nearest_choice(kinematics: str, acceleration: float | None) -> None:
    view = view_in({"robot.kinematics": kinematics, "robot.max_acceleration": acceleration, "lidar.noise": 0.01})
    choices = choices_of(view)
    for wish in np.random.default_rng(0).uniform(-1.0, 1.0, (30, 2)).tolist():
        x, y = wish
        assert stoppable_number(view, choices, (x, y), 0.0) == nearest_number(choices, (x, y))


@pytest.mark.parametrize("away", [0.24, 0.3, 0.36])
def test_before_a_wall_it_is_the_nearest_that_stops_short_of_it(away: float) -> None:
    """A wall so far ahead of the middle of a body of 0.2 m that stops at once: what is asked ends before it."""
    wall = [[[away, -5], [away + 0.3, -5], [away + 0.3, 5], [away, 5]]]
    view = view_in({"robot.kinematics": "holonomic", "lidar.noise": 0.001, "lidar.beams": 360}, polygons=wall)
    choices, step = choices_of(view), view.sensors.drive.step
    chosen = choices[stoppable_number(view, choices, (1.0, 0.0), 0.0)]
    assert chosen[0] * step + view.sensors.radius < away
    nearer = choices[np.hypot(choices[:, 0] - 1.0, choices[:, 1]) < math.hypot(chosen[0] - 1.0, chosen[1]) - 1e-9]
    assert (nearer[:, 0] * step + view.sensors.radius > away - 0.02).all()


def choices_of(view: View) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The velocities of the discrete actions (128, 2) [m/s]."""
    return discrete_velocities(view.sensors.drive)
