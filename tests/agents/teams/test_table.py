"""What holds for every team of the table: a new one is tested by being listed."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest

import bug_gym
from bug_gym.agents import AGENTS, TEAMS, make_policy, team_names
from bug_gym.agents.parameters import parameters_of
from bug_gym.config import load
from bug_gym.drawing.canvas import Canvas
from bug_gym.evaluation import evaluate
from bug_gym.policy import Drawing, MisfitError
from bug_gym.reproductions.team_worlds import random_world
from bug_gym.simulation import Simulation
from bug_gym.team_policy import TeamPolicy


def test_teams_have_names_of_their_own() -> None:
    assert team_names() == list(TEAMS) and not set(TEAMS) & set(AGENTS)


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("action", ["continuous", "discrete"])
def test_actions_lie_in_the_action_space_and_a_run_is_the_same_again(name: str, kinematics: str, action: Any) -> None:
    runs = []
    for _ in range(2):
        env = bug_gym.parallel_env(random_world(1), overrides={"robot.kinematics": kinematics}, action=action)
        team: Any = make_policy(name, env)
        seen, _ = env.reset(seed=0)
        state, taken = None, []
        for _ in range(60):
            actions, state = team.predict({agent: seen[agent] for agent in env.agents}, state)
            assert list(actions) == env.agents
            assert all(env.action_space(agent).contains(actions[agent]) for agent in env.agents)
            taken.append(np.stack(list(actions.values())))
            seen, *_ = env.step(actions)
        runs.append(np.array(taken))
    np.testing.assert_array_equal(runs[0], runs[1])


@pytest.mark.parametrize("name", TEAMS)
def test_a_batch_is_its_worlds_one_by_one(name: str) -> None:
    simulation = Simulation(random_world(2), 3)
    team: Any = make_policy(name, simulation)
    flat, batch, states = simulation.reset(seeds=[0, 1, 2]), None, [None] * 3
    for _ in range(30):
        actions, batch = team.predict(flat.reshape(6, -1), batch)
        for world in range(3):
            by_agent = dict(zip(team.agents, flat[world], strict=True))
            named, states[world] = team.predict(by_agent, states[world])
            np.testing.assert_array_equal(actions[2 * world : 2 * world + 2], np.stack(list(named.values())))
        flat = simulation.step(actions.reshape(3, 2, 2)).observation


@pytest.mark.parametrize("name", TEAMS)
def test_differential_robots_with_noise_never_touch(name: str) -> None:
    noisy = {"robot.kinematics": "differential", "lidar.noise": 0.01, "odometry.translation_noise": 0.005}
    env = bug_gym.parallel_env(random_world(4), overrides=noisy)
    team: Any = make_policy(name, env, clearance=1.0)
    seen, _ = env.reset(seed=0)
    state: Any = None
    infos: dict[str, Any] = {}
    while env.agents:
        actions, state = team.predict({agent: seen[agent] for agent in env.agents}, state)
        seen, _, _, _, infos = env.step(actions)
    assert "collision" not in [info["outcome"] for info in infos.values()]


@pytest.mark.parametrize("name", TEAMS)
def test_what_it_shows_of_a_robot_can_be_drawn(name: str) -> None:
    simulation = Simulation(random_world(3))
    team: Any = make_policy(name, simulation)
    flat = simulation.reset(seeds=[0])[0]
    state: Any = None
    for _ in range(80):
        actions, state = team.predict(flat, state)
        flat = simulation.step(actions[None]).observation[0]
    assert isinstance(team, TeamPolicy)
    drawings = [team.draw(memory) for memory in state]
    assert all(isinstance(drawing, Drawing) for drawing in drawings)
    assert Canvas(simulation).draw(drawings).ndim == 3


@pytest.mark.parametrize("name", TEAMS)
def test_a_sentence_stands_under_each_parameter(name: str) -> None:
    team: Any = make_policy(name, Simulation(random_world(0)))
    assert all(own.text for own in parameters_of(type(team)))
    text = str(sys.modules[type(team).__module__].__doc__)
    for word in ("Source:", "Sensing assumed:", "States:", "Guarantee:", "Length:"):
        assert word in text


CROSSING, WAREHOUSE = ("crossing_robots", 2), ("warehouse_team", 8)


@pytest.mark.parametrize(
    ("team", "scenario", "robots"),
    [(team, *where) for team in ("com1_rev3", "swarm_com", "swarm_bug2") for where in (CROSSING, WAREHOUSE)]
    + [("swarm_bug1", *CROSSING), ("bug1_pair", *CROSSING)],
)
def test_robots_with_goals_of_their_own_stop_for_nobody(team: str, scenario: str, robots: int) -> None:
    rows = evaluate([team], scenario, episodes=3, seed=20)
    assert len(rows) == 3 * robots
    assert {row.outcome for row in rows} == {"success"}, [(row.seed, row.robot, row.outcome) for row in rows]


@pytest.mark.parametrize("team", TEAMS)
def test_who_goes_to_a_goal_of_its_own_gives_up_alone(team: str) -> None:
    """One of two goals is shut in; the other robot arrives all the same."""
    ring = [[3.0 * math.cos(k * math.pi / 12.0), 3.0 * math.sin(k * math.pi / 12.0), 0.5] for k in range(24)]
    world = {"family": "explicit", "circles": [[x + 8.0, y, r] for x, y, r in ring], "bounds": [-14, -14, 14, 14]}
    scenario = {
        "world": world | {"start": [-8, 0, 0], "goal": [8, 0]},
        "robots": [{"start": [-8, -5, 0], "goal": [8, 0]}, {"start": [-8, 5, 0], "goal": [-8, 11]}],
        "lidar": {"beams": 90, "range": 6.0},
        "time": {"limit": 400.0},
    }
    shut_in, free = evaluate([team], scenario, episodes=1)
    assert (shut_in.outcome, free.outcome) == ("gave_up", "success")


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_who_is_told_by_discrete_actions_touches_nothing_though_none_of_them_stands(name: str, kinematics: str) -> None:
    for scenario in ("oni_wang_pair", "disc_pair"):
        env = bug_gym.parallel_env(scenario, action="discrete", overrides={"robot.kinematics": kinematics})
        outcomes = driven_to_the_end(env, make_policy(name, env), seed=0)
        assert "success" in outcomes and "collision" not in outcomes


def driven_to_the_end(env: Any, team: Any, seed: int) -> list[str]:
    """How each robot's run ends."""
    seen, _ = env.reset(seed=seed)
    state, outcomes = None, list[str]()
    while env.agents:
        actions, state = team.predict({agent: seen[agent] for agent in env.agents}, state)
        seen, _, terminated, truncated, infos = env.step(actions)
        outcomes += [infos[agent]["outcome"] for agent in infos if terminated[agent] or truncated[agent]]
    return outcomes


@pytest.mark.parametrize("name", ["com1_rev3", "swarm_bug2", "orca"])
def test_rows_of_an_sb3_env_with_its_dones_end_as_by_agent(name: str) -> None:
    """A robot that has arrived stands there, an obstacle to the others; its row goes on and says that it is done."""
    make_robots_vec_env = pytest.importorskip("bug_gym.agents.sb3").make_robots_vec_env
    env = bug_gym.parallel_env("circle_swap", robots=4)
    team = make_policy(name, env)
    by_agent = driven_to_the_end(env, team, seed=0)
    rows = make_robots_vec_env("circle_swap", 4, 1, seed=0)
    seen, state, done = rows.reset(), None, np.ones(4, dtype=bool)
    outcomes: list[str] = []
    while len(outcomes) < 4:
        actions, state = team.predict(seen, state, done)
        seen, _, done, infos = rows.step(actions)
        outcomes += [info["outcome"] for info in infos if "episode" in info]
    assert by_agent == outcomes == ["success"] * 4


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(("scenario", "robots"), [("circle_swap", 2), ("circle_swap", 8), ("corridor_swap", 4)])
def test_nobody_of_com1_rev3_stands_for_ever_where_robots_have_goals_of_their_own(
    scenario: str, robots: int, kinematics: str
) -> None:
    """Who has stepped aside may find one that has arrived on the way back to its own way."""
    for seed in range(2):
        overrides = {"robot.kinematics": kinematics, "time.limit": 300.0}
        env = bug_gym.parallel_env(scenario, robots=robots, overrides=overrides)
        assert driven_to_the_end(env, make_policy("com1_rev3", env), seed) == ["success"] * robots


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize("robot", [{"max_acceleration": 0.5}, {"max_acceleration": 1.0}, {"latency": 0.3}], ids=str)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_robots_that_cannot_stop_at_once_touch_nobody(name: str, robot: dict[str, float], kinematics: str) -> None:
    """Head on, and across: each could stop before where the other is, and both drive on."""
    settings = {f"robot.{one}": value for one, value in robot.items()} | {"robot.kinematics": kinematics}
    for scenario, episodes in (("corridor_swap", 1), ("random_crossings", 2)):
        source = load(scenario, settings | {"robots.count": 2, "time.limit": 40.0})
        outcomes = [row.outcome for row in evaluate([name], source, episodes=episodes, seed=100)]
        assert "collision" not in outcomes


DRIFT = {"odometry.translation_noise": 0.05, "odometry.rotation_noise": 0.05}


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_robots_that_cannot_stop_at_once_touch_nobody_whatever_their_odometry_says(name: str, kinematics: str) -> None:
    """They see one another: what they tell by odometry is soon wrong by more than the room that they keep."""
    robot = {"robot.kinematics": kinematics, "robot.max_acceleration": 0.5}
    source = load("corridor_swap", robot | DRIFT | {"time.limit": 40.0})
    outcomes = [row.outcome for row in evaluate([name], source, episodes=6, seed=100)]
    assert "collision" not in outcomes


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("drift", [0.02, 0.05])
def test_a_pair_whose_odometry_drifts_does_not_stand_before_one_another_for_ever(kinematics: str, drift: float) -> None:
    source = load("corridor_swap", {"robot.kinematics": kinematics, "time.limit": 60.0} | dict.fromkeys(DRIFT, drift))
    rows = evaluate(["bug1_pair"], source, episodes=3, seed=100)
    assert all(row.outcome == "success" for row in rows)


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize("late", [0, 1])
def test_who_is_heard_later_with_a_goal_of_its_own_goes_there_too(name: str, late: int) -> None:
    env = bug_gym.parallel_env("circle_swap", robots=2)
    team: Any = make_policy(name, env)
    seen, _ = env.reset(seed=3)
    state, step = None, 0
    outcomes: dict[str, str] = {}
    while env.agents:
        heard = [agent for agent in env.agents if step >= 5 or agent != f"robot_{late}"]
        actions, state = team.predict({agent: seen[agent] for agent in heard}, state)
        stand = {agent: np.zeros(2, dtype=np.float32) for agent in env.agents}
        seen, _, _, _, infos = env.step(stand | actions)
        outcomes |= {agent: infos[agent]["outcome"] for agent in infos}
        step += 1
    assert outcomes == dict.fromkeys(env.possible_agents, "success")


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize("robot", [{"robot.max_acceleration": 1.0}, {"robot.latency": 0.1}], ids=str)
def test_discrete_actions_of_robots_that_cannot_stop_at_once_are_refused_in_a_line(name: str, robot: Any) -> None:
    env = bug_gym.parallel_env(random_world(1), overrides=robot, action="discrete")
    with pytest.raises(MisfitError, match="no discrete action"):
        make_policy(name, env)
