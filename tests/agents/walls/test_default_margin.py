"""What bugs keep from walls unless they are told: enough for the brake not to make them stand short of it."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bug_gym.agents import make_policy
from bug_gym.agents.walls.boundary import Boundary
from bug_gym.config import Scenario, load
from bug_gym.navigation_env import NavigationEnv
from bug_gym.policy import braking_radius
from bug_gym.reproductions import still_things
from bug_gym.view import Sensors


def robot(kinematics: str, speed: float, step: float, noise: float) -> Scenario:
    """A maze with such a robot."""
    values = {"robot.kinematics": kinematics, "robot.max_speed": speed, "time.step": step, "lidar.noise": noise}
    return load("maze", {**values, "time.limit": 120.0})


@settings(max_examples=60)
@given(st.floats(0.3, 2.0), st.sampled_from([0.05, 0.1, 0.2]), st.floats(0.0, 0.03))
def test_a_differential_robot_comes_to_its_contour_before_its_brake_makes_it_stand(
    speed: float, step: float, noise: float
) -> None:
    sensors = Sensors.of(robot("differential", speed, step, noise))
    stands = sensors.radius + 2.0 * (braking_radius(sensors) - sensors.radius)
    assert Boundary(sensors).clearance > stands
    assert Boundary(sensors).clearance >= sensors.radius + sensors.step_length


@settings(max_examples=20)
@given(st.floats(0.3, 2.0), st.sampled_from([0.05, 0.1, 0.2]), st.floats(0.0, 0.03))
def test_one_that_stops_at_once_keeps_a_step(speed: float, step: float, noise: float) -> None:
    sensors = Sensors.of(robot("holonomic", speed, step, noise))
    assert Boundary(sensors).clearance == sensors.radius + sensors.step_length


@pytest.mark.parametrize("policy", ["bug2", "vis_bug_21"])
@pytest.mark.parametrize(("speed", "step", "noise"), [(0.75, 0.05, 0.0), (0.5, 0.05, 0.0), (0.95, 0.05, 0.018)])
def test_with_short_steps_it_never_stands_for_long(policy: str, speed: float, step: float, noise: float) -> None:
    """Half a metre in 10 s at the least, turns on the spot and all: whoever stops for good is found out."""
    scenario = robot("differential", speed, step, noise)
    env = NavigationEnv(scenario)
    driver = make_policy(policy, env)
    for seed in (30, 94):
        observation, info = env.reset(seed=seed)
        state, done, way, before = None, False, 0.0, 0.0
        while not done:
            action, state = driver.predict(observation, state)
            observation, _, terminated, truncated, info = env.step(action)
            done = terminated or truncated
            if done or info["time"] >= before + 10.0:
                assert done or info["path_length"] > way + 0.5, info
                way, before = info["path_length"], info["time"]
        assert info["outcome"] != "collision"


def test_visbug_does_not_stand_where_its_scout_saw_a_way_that_its_body_cannot_go() -> None:
    """With this noise the view is wider than the way; it stood there, and sent the scout out anew in each decision."""
    env = NavigationEnv(still_things.scenario(46))
    driver = make_policy("vis_bug_21", env)
    observation, info = env.reset(seed=46)
    state = None
    for _ in range(600):
        action, state = driver.predict(observation, state)
        observation, *_, info = env.step(action)
    assert info["path_length"] > 10.0
