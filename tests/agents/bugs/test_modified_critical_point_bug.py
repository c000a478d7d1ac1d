"""ModifiedCriticalPointBug: a virtual obstacle where its way to the goal meets a mover's; else CriticalPointBug."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import Episode, canonical_world, run_episode, scene, with_mover

from bug_gym.agents import make_policy
from bug_gym.agents.critical_points.meeting import VirtualObstacle
from bug_gym.simulation import Simulation
from bug_gym.view import View

POLICY = "modified_critical_point_bug"
C = 0.5
RADIUS = 0.4
"""Of the movers [m]."""


def leaves_line_at(episode: Episode) -> float:
    """How far along the line to the goal the way first leads off it by 0.05 m [m]."""
    aside = np.flatnonzero(np.abs(episode.path[:, 1]) > 0.05)
    return float(episode.path[aside[0], 0])


def had_virtual(scenario: dict[str, Any], steps: int, **parameters: Any) -> list[bool]:
    """Whether there was a virtual obstacle after each decision."""
    simulation = Simulation(scenario, 1)
    agent = make_policy(POLICY, simulation, clearance=C, **parameters)
    observation, state, found = simulation.reset(seeds=[0]), None, []
    for _ in range(steps):
        action, state = agent.predict(observation[:, 0], state)
        assert state is not None
        memory: Any = state[0]
        found.append(bool(memory.virtual))
        observation = simulation.step(action[:, None]).observation
    return found


@pytest.mark.parametrize("shape", ["slab", "disc", "u_trap"])
def test_among_still_obstacles_it_goes_the_way_of_critical_point_bug(shape: str) -> None:
    own, others = (run_episode(name, canonical_world(shape), clearance=C) for name in (POLICY, "critical_point_bug"))
    assert np.array_equal(own.path, others.path)


@pytest.mark.parametrize(
    ("at", "velocity"), [([6.0, -3.0], [0.0, 0.5]), ([7.0, -7.0], [0.0, 1.1]), ([8.0, 4.0], [-0.3, -0.6])]
)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_it_goes_round_where_they_would_meet_as_soon_as_it_knows(
    at: list[float], velocity: list[float], kinematics: str
) -> None:
    """Who only sees the mover itself, which is beside the way, keeps to the line for some metres more."""
    scenario, overrides = with_mover(at, velocity), {"robot.kinematics": kinematics}
    episode = run_episode(POLICY, scenario, overrides, clearance=C)
    other = run_episode("critical_point_bug", scenario, overrides, clearance=C)
    assert episode.outcome == "success" and episode.min_clearance > 0.0
    assert leaves_line_at(episode) < 0.5 * leaves_line_at(other)
    # They have passed, and nothing is left in the way.
    assert not episode.memory.virtual


@pytest.mark.parametrize("heading", [0.0, 1.5])
@pytest.mark.parametrize("share", [-1.4, -0.6, 0.6, 1.4])
def test_they_meet_where_their_discs_would_touch(share: float, heading: float) -> None:
    """At 1 m/s each, at right angles, they pass at the offset of the mover's start over the root of 2."""
    policy: Any = make_policy(POLICY, Simulation(with_mover([5.0, -5.0], [0.0, 1.0])), clearance=C)
    apart = share * (policy.sub_goals.boundary.inner + RADIUS)
    scenario = with_mover([5.0, -5.0 + math.sqrt(2.0) * apart], [0.0, 1.0], RADIUS, start=[0, 0, heading])
    scenario["robot"] = {"kinematics": "holonomic"}
    assert any(had_virtual(scenario, 12)) == (abs(share) < 1.0)


@pytest.mark.parametrize(("x", "is_met"), [(9.5, True), (11.5, False)])
def test_only_what_is_met_before_the_goal_counts(x: float, is_met: bool) -> None:
    """The mover comes to the robot's line when the robot would, were it to go on behind the goal too."""
    scenario = with_mover([x, -0.4 * x], [0.0, 0.4], RADIUS)
    scenario["lidar"]["range"] = 20.0
    assert any(had_virtual(scenario, 15)) == is_met


@pytest.mark.parametrize(("x", "is_shown"), [(0.8, False), (1.0, True)])
def test_a_virtual_obstacle_is_seen_like_one_that_stands_unless_it_is_nearer_than_the_robot_keeps(
    x: float, is_shown: bool
) -> None:
    """Where the robot is that near it goes on to the side to which it is going round."""
    simulation = Simulation(scene(), 1)
    policy: Any = make_policy(POLICY, simulation, clearance=C)
    assert 0.8 < policy.sub_goals.boundary.inner + RADIUS < 1.0
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    memory.virtual = {1: VirtualObstacle(1, (x, 0.0), (x + 1.0, 0.0), RADIUS, (0.0, 1.0), (x, 0.0))}
    ranges = policy._with_virtual(view, memory).ranges
    assert ranges[0] == pytest.approx(x - RADIUS if is_shown else view.ranges[0])
