"""Bug1 for two: who stands for whom, for how long, and what is made of a partner that says nothing or goes elsewhere."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import bug_gym
from bug_gym.agents import make_policy
from bug_gym.agents.teams.bug_team import PATIENCE
from bug_gym.reproductions.team_runs import run_team
from bug_gym.reproductions.team_worlds import team_scenario
from bug_gym.simulation import Simulation

WALL = [[[9, -9], [10, -9], [10, 9], [9, 9]]]
"""Nobody sees the goal behind it."""


def test_of_two_that_have_goals_of_their_own_the_second_stands_where_they_are_near_and_the_first_goes_round_it() -> (
    None
):
    """They meet head on, and the first waits for nobody."""
    scenario = team_scenario([], [(0.0, 0.0, 0.0), (6.0, 0.0, math.pi)], (8.0, 0.0), limit=60.0)
    for place, goal in zip(scenario["robots"], ([8.0, 0.0], [-2.0, 0.0]), strict=True):
        place["goal"] = goal
    run = run_team("bug1_pair", scenario | {"mission": "all"}, clearance=0.5)
    assert run.outcomes[0] == "success" and run.least_gap >= 0.5
    gaps = np.hypot(*(run.paths[:, 0, :2] - run.paths[:, 1, :2]).T)
    arrived = next(step for step, place in enumerate(run.paths[:, 0, :2]) if math.dist(place, (8.0, 0.0)) < 0.5)
    modes = run.modes[: arrived - 1]
    assert [second == "hold" for _, second in modes] == (gaps[: len(modes)] < 2.0).tolist()
    assert any(second == "hold" for _, second in modes) and all(first != "waiting" for first, _ in modes)
    lap = 2.0 * math.pi * (0.25 + 0.5)  # round its body, at the clearance
    assert run.lengths[0] <= 8.0 + 1.5 * lap, "Bug1's bound, with its partner as the one obstacle"


@pytest.mark.parametrize("apart", [1.5, 1.9])
def test_who_follows_stands_for_a_partner_that_does_not_get_away_for_twenty_seconds(apart: float) -> None:
    simulation = Simulation(team_scenario(WALL, [(0.0, apart, 0.0), (0.0, 0.0, 0.0)], (20.0, 0.0)))
    team: Any = make_policy("bug1_pair", simulation)
    seen, state = simulation.reset(seeds=[0])[0], team.start(2)
    modes: list[str] = []
    state[1].is_behind = True
    while state[1].is_behind and len(modes) < 1000:
        _, state = team.predict(seen, state)
        modes.append(state[1].mode)
    assert set(modes[:-1]) == {"hold"} and modes[-1] == "motion_to_goal"
    assert len(modes) * team.sensors.drive.step == pytest.approx(2.0 * PATIENCE, abs=0.25)


def test_who_follows_goes_on_when_its_partner_is_two_metres_ahead() -> None:
    simulation = Simulation(team_scenario(WALL, [(0.0, 2.1, 0.0), (0.0, 0.0, 0.0)], (20.0, 0.0)))
    team: Any = make_policy("bug1_pair", simulation)
    state = team.start(2)
    state[1].is_behind = True
    _, state = team.predict(simulation.reset(seeds=[0])[0], state)
    assert state[1].mode == "motion_to_goal" and not state[1].is_behind


def test_a_partner_that_has_fallen_silent_is_gone_round_where_it_stands() -> None:
    """After ten seconds before it."""
    scenario = team_scenario(WALL, [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)], (20.0, 0.0), limit=60.0)
    env = bug_gym.parallel_env({**scenario, "mission": "all"})
    team: Any = make_policy("bug1_pair", env)
    seen, _ = env.reset(seed=0)
    actions, state = team.predict(seen)
    gaps = []
    for _ in range(250):
        seen, *_ = env.step({"robot_0": actions["robot_0"], "robot_1": np.zeros(2)})
        actions, state = team.predict({"robot_0": seen["robot_0"]}, state)
        poses = env.simulation.world.pose[0]
        gaps.append(math.dist(poses[0, :2], poses[1, :2]))
    assert min(gaps) > 0.5 and poses[0, 0] > 6.0
