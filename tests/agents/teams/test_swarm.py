"""Swarms: each robot drives by its law alone, to its side, until one of them has arrived."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

import bug_gym
from bug_gym.agents import make_policy
from bug_gym.evaluation import evaluate
from bug_gym.policy import MisfitError
from bug_gym.reproductions.team_runs import run_team
from bug_gym.reproductions.team_worlds import Across, team_scenario
from bug_gym.simulation import Simulation

LAWS = {"swarm_com": "com", "swarm_bug1": "bug1", "swarm_bug2": "bug2"}


@pytest.mark.parametrize("name", LAWS)
def test_each_drives_its_law_to_its_side_until_one_arrives(name: str) -> None:
    scenario = Across(before=5.0, behind=4.0, half=4.0, depth=4.0, offset=1.5).scenario()
    run = run_team(name, scenario, ghosts=True, clearance=1.0, hold_distance=0.0)
    for robot, turn in enumerate(("right", "left")):
        alone = run_episode(LAWS[name], scenario, clearance=1.0, turn=turn)
        steps = min(len(alone.path), len(run.paths)) - 1
        np.testing.assert_array_equal(run.paths[:steps, robot], alone.path[:steps])
    assert run.outcomes.count("success") == 1


@pytest.mark.parametrize("name", LAWS)
def test_the_first_arrival_stops_the_others(name: str) -> None:
    wall = [[[6, -4], [8, -4], [8, 2], [6, 2]]]
    scenario = {**team_scenario(wall, [(0.0, -1.0, 0.0), (0.0, 1.0, 0.0)], (14.0, 0.0), limit=80.0), "mission": "all"}
    run = run_team(name, scenario, clearance=1.0, max_steps=700)
    assert "collision" not in run.outcomes and run.outcomes.count("success") == 1
    team: Any = make_policy(name, Simulation(scenario))
    flat, state = run.simulation.observations()[0], run.memories
    actions, state = team.predict(flat, state)
    first = run.outcomes.index("success")
    assert np.abs(actions[1 - first]).max() == 0.0 and state[1 - first].mode == "stopped"


def test_a_robot_holds_from_below_its_distance_to_an_earlier_one_until_the_other_distance() -> None:
    """The earlier one comes nearer, goes away and comes again, and holds for nobody."""
    starts = [(0.0, 0.0, 0.0), (0.0, 1.62, 0.0)]
    env = bug_gym.parallel_env(team_scenario([[[9, -9], [10, -9], [10, 9], [9, 9]]], starts, (20.0, 0.0)))
    policy: Any = make_policy("swarm_com", env)
    seen, _ = env.reset(seed=0)
    state: Any = None
    gaps: list[float] = []
    holds: list[bool] = []
    for speed in (*[0.5] * 5, *[-0.5] * 18, *[0.5] * 10):
        _, state = policy.predict(seen, state)
        poses = env.simulation.world.pose[0]
        gaps.append(math.dist(poses[0, :2], poses[1, :2]))
        holds.append(state[1].mode == "hold")
        assert state[0].mode != "hold"
        seen, *_ = env.step({"robot_0": np.array([0.0, speed]), "robot_1": np.zeros(2)})
    assert min(gaps) < 1.5 and max(gaps) > 2.0
    for gap, before, held in zip(gaps, [False, *holds], holds, strict=False):
        assert held == (gap < (2.0 if before else 1.5))
    assert state[1].holds == 1 and state[1].held == pytest.approx(0.1 * sum(holds))


def test_one_robot_is_no_swarm() -> None:
    with pytest.raises(MisfitError, match="2 robots or more"):
        make_policy("swarm_bug2", "static")


def test_a_swarm_refuses_distances_that_nobody_can_keep_and_the_memory_of_another_law() -> None:
    env = bug_gym.parallel_env("oni_wang_pair")
    for distance in (3.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="hold_distance"):
            make_policy("swarm_bug2", env, hold_distance=distance)
    seen, _ = env.reset(seed=0)
    _, state = make_policy("swarm_bug1", env).predict(seen)
    with pytest.raises(ValueError, match="another law: Bug1Memory, expected Bug2Memory"):
        make_policy("swarm_bug2", env).predict(seen, state)


def test_a_lap_round_a_partner_that_is_to_go_on_is_no_proof_that_there_is_no_way() -> None:
    """Robots on a circle start on one another's goals, and stand for those before them."""
    overrides = {"robots.count": 16, "robot.kinematics": "holonomic"}
    rows = evaluate(["swarm_bug2"], "circle_swap", episodes=2, seed=3, overrides=overrides)
    assert {row.verdict for row in rows} == {"", "stuck"}
    walls = [[[9, -3], [15, -3], [15, -2.5], [9, -2.5]], [[9, 3], [15, 3], [15, 3.5], [9, 3.5]]]
    walls += [[[9, -2.5], [9.5, -2.5], [9.5, 3], [9, 3]], [[14.5, -2.5], [15, -2.5], [15, 3], [14.5, 3]]]
    shut = team_scenario(walls, [(0.0, -1.0, 0.0), (0.0, 1.0, 0.0)], (12.0, 0.0), limit=400.0)
    assert "unreachable" in [row.verdict for row in evaluate(["swarm_bug2"], shut, episodes=1)]
