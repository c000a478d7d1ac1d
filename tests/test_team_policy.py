"""Policies for several robots: what `predict` takes and gives, and what robots tell one another."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import bug_gym
from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.kinematics import steering
from bug_gym.policy import MisfitError, Velocity, action_of, source_scenario
from bug_gym.simulation import Simulation
from bug_gym.team_policy import TeamMemory, TeamPolicy
from bug_gym.view import Sensors, View

SCATTERED: dict[str, Any] = {
    "name": "scattered",
    "lidar": {"beams": 64},
    "world": {"family": "empty", "bounds": [-12, -12, 12, 12], "start": [0, 0, 0], "goal": [8, 0]},
    "robots": [{"start": [-2, 0, 0.3]}, {"start": [2, 3, 2.0]}, {"start": [0, -5, -2.5]}],
}


@dataclass
class MarchMemory(TeamMemory):
    """Memory of March."""

    steps: int = 0


class March(TeamPolicy):
    """All go on in a circle, for ever."""

    def start(self, robots: int) -> tuple[MarchMemory, ...]:
        return tuple(MarchMemory() for _ in range(robots))

    def act(self, views: Sequence[View | None], memories: Sequence[Any]) -> list[Velocity]:
        for memory in memories:
            memory.steps += memory.is_heard
        return [(0.5, 0.1 * robot) for robot in range(len(views))]


def march(source: Any = SCATTERED, **settings: Any) -> Any:
    scenario = source_scenario(source)
    return March(Sensors.of(scenario), agents=[f"robot_{n}" for n in range(scenario.robots.count)], **settings)


def both_ways(name: str, source: Any, **settings: Any) -> tuple[Any, Any, Any]:
    env = bug_gym.parallel_env(source, **settings)
    return env, make_policy(name, env), env.reset(seed=1)[0]


class Wishes(March):
    """Robots want what they are told to."""

    wishes: Sequence[Velocity] = ()

    def act(self, views: Sequence[View | None], memories: Sequence[Any]) -> list[Velocity]:
        return list(self.wishes)


ROBOTS: dict[str, dict[str, Any]] = {
    "differential": {"robot": {"kinematics": "differential"}, "lidar": {"beams": 64, "noise": 0.01}},
    "with inertia": {"robot": {"kinematics": "differential", "max_acceleration": 1.0}, "lidar": {"beams": 180}},
    "with few beams": {"robot": {"kinematics": "differential", "max_speed": 2.0}, "lidar": {"beams": 16}},
    "that sees well": {"robot": {"kinematics": "differential"}, "lidar": {"beams": 180}},
    "holonomic": {"robot": {"kinematics": "holonomic"}, "lidar": {"beams": 64, "noise": 0.01}},
}


@pytest.mark.parametrize("robot", ROBOTS)
def test_robots_that_are_driven_at_once_do_as_each_would_alone(robot: str) -> None:
    scenario = source_scenario(SCATTERED | ROBOTS[robot])
    sensors, rng = Sensors.of(scenario), np.random.default_rng(3)
    team = Wishes(sensors, agents=[f"robot_{n}" for n in range(scenario.robots.count)])
    velocity = next(field.begin for field in sensors.fields if field.name == "velocity")
    drove = 0
    for _ in range(300):
        rows = np.zeros((3, sensors.width), dtype=np.float32)
        rows[:, sensors.always_seen[0]] = rng.uniform(
            0.2, rng.uniform(0.5, 2.0 * sensors.range), (3, len(sensors.angles))
        )
        rows[:, sensors.always_seen[0]] = rows[:, sensors.always_seen[0]].clip(max=sensors.range)
        rows[:, velocity] = rng.uniform(0.0, sensors.drive.max_speed, 3)
        seen = [None if rng.random() < 0.2 else row for row in rows]
        team.wishes = [tuple(wish) for wish in rng.uniform(-2.0, 2.0, (3, 2)).tolist()]
        for row, wish, action in zip(seen, team.wishes, team.decide(seen, team.started(1)), strict=True):
            view = None if row is None else View(row, sensors)
            expected = action_of(sensors, view, wish if view is not None else (0.0, 0.0), None, team.room)
            np.testing.assert_array_equal(action, expected)
            drove += not np.array_equal(action, steering(sensors.drive, (0.0, 0.0)))
    assert drove > 300


# ------------------------------------------------------------------------------------------ each robot by itself


@pytest.mark.parametrize("observation", ["dict", "flat"])
@pytest.mark.parametrize("action", ["continuous", "discrete"])
def test_a_single_robots_policy_drives_each_robot_by_itself(observation: Any, action: Any) -> None:
    env, policy, seen = both_ways("bug2", "crossing_robots", robots=3, observation=observation, action=action)
    alone = make_policy("bug2", Simulation("crossing_robots", overrides={"robots.count": 3}))
    state, states = None, dict.fromkeys(env.agents)
    for _ in range(60):
        actions, state = policy.predict(seen, state)
        assert list(actions) == list(seen) == env.agents
        for agent in env.agents:
            expected, states[agent] = alone.predict(seen[agent], states[agent])
            assert env.action_space(agent).contains(actions[agent])
            if action == "continuous":
                np.testing.assert_array_equal(actions[agent], expected)
        seen, *_ = env.step(actions)
        seen = {agent: seen[agent] for agent in env.agents}


def test_a_missing_agent_keeps_its_memory_and_gets_no_action() -> None:
    env, policy, seen = both_ways("bug2", "crossing_robots")
    _, state = policy.predict(seen)
    kept = copy.deepcopy(state[1].hits)
    actions, state = policy.predict({"robot_0": seen["robot_0"]}, state)
    assert list(actions) == ["robot_0"] and len(state) == 2 and state[1].hits == kept


def test_the_aec_env_and_a_scenario_of_several_robots_do_as_well() -> None:
    _, policy, seen = both_ways("bug2", "crossing_robots")
    expected, _ = policy.predict(seen)
    for source in (bug_gym.env("crossing_robots"), "crossing_robots"):
        again: Any = make_policy("bug2", source)
        actions, _ = again.predict(seen)
        for agent, action in expected.items():
            np.testing.assert_array_equal(actions[agent], action)


@pytest.mark.parametrize("source", ["crossing_robots", Simulation("crossing_robots", 4)])
def test_a_batch_of_rows_is_each_world_by_itself(source: Any) -> None:
    simulation = Simulation("crossing_robots", 4)
    rows = simulation.reset(seeds=range(4)).reshape(8, -1)
    actions, state = make_policy("bug2", source).predict(rows)
    assert actions.shape == (8, 2) and state is not None and len(state) == 8
    for world in range(4):
        by_agent = {f"robot_{robot}": rows[2 * world + robot] for robot in range(2)}
        each: Any = make_policy("bug2", "crossing_robots")
        named, _ = each.predict(by_agent)
        np.testing.assert_array_equal(actions[2 * world : 2 * world + 2], np.stack(list(named.values())))


def test_a_learned_policy_that_knows_no_peers_drives_each_robot_as_if_it_were_alone() -> None:
    pytest.importorskip("onnxruntime")
    two, one = {"robots.count": 2}, Simulation("rush")
    simulation = Simulation("rush", overrides=two)
    flat = simulation.reset(seeds=[0])[0]
    alone = make_policy("ppo_rush", one)
    for policy in (
        make_policy("ppo_rush", simulation),
        make_policy("ppo_rush", bug_gym.parallel_env("rush", robots=2)),
    ):
        actions, _ = policy.predict(flat, None)
        expected, _ = alone.predict(flat[:, :-4], None)
        np.testing.assert_array_equal(actions, expected)
    with pytest.raises(MisfitError, match="another robot"):
        make_policy("ppo_rush", bug_gym.parallel_env("crossing_robots", overrides={"lidar.beams": 90}))


# ------------------------------------------------------------------------------------------ a team


def poses(simulation: Simulation) -> Any:
    return simulation.world.pose[0]


def test_robots_find_where_their_frames_lie_from_their_first_sight_of_one_another() -> None:
    simulation, team = Simulation(SCATTERED), march()
    flat = simulation.reset(seeds=[0])[0]
    state: Any = None
    first = poses(simulation)[0].copy()
    for _ in range(30):
        actions, state = team.predict(flat, state)
        for robot, memory in enumerate(state):
            x, y, heading = poses(simulation)[robot] - first
            cos, sin = math.cos(first[2]), math.sin(first[2])
            assert memory.word is not None
            assert memory.word.place == pytest.approx((cos * x + sin * y, cos * y - sin * x), abs=1e-4)
            assert math.cos(memory.word.heading - heading) == pytest.approx(1.0, abs=1e-8)
            gx, gy = np.array([8.0, 0.0]) - first[:2]
            assert memory.word.goal == pytest.approx((cos * gx + sin * gy, cos * gy - sin * gx), abs=1e-4)
            assert memory.word.goal_distance == pytest.approx(
                float(simulation.info()["goal_distance"][0, robot]), abs=1e-4
            )
        flat = simulation.step(actions[None]).observation[0]


def test_a_robot_heard_later_finds_its_place_too() -> None:
    env, team = bug_gym.parallel_env(SCATTERED), march()
    seen, _ = env.reset(seed=0)
    actions, state = team.predict({agent: seen[agent] for agent in ("robot_0", "robot_2")})
    for _ in range(10):
        seen, *_ = env.step({**{"robot_1": np.array([0.2, -0.5])}, **actions})
        actions, state = team.predict({agent: seen[agent] for agent in ("robot_0", "robot_2")}, state)
    actions, state = team.predict(seen, state)
    pose = env.simulation.world.pose[0]
    for one in range(3):
        gap = math.dist(state[one].word.place, state[1].word.place)
        assert gap == pytest.approx(math.dist(pose[one, :2], pose[1, :2]), abs=1e-4)
    assert {agent for agent in actions} == set(env.agents)


@pytest.mark.parametrize("silent", [0, 1])
@pytest.mark.parametrize("seed", [0, 3])
def test_whoever_is_heard_later_finds_its_place_by_sights_of_the_same_instant(silent: int, seed: int) -> None:
    overrides = {"lidar.noise": 0.0, "robot.max_speed": 3.0, "robot.max_reverse": 0.3}
    env = bug_gym.parallel_env("random_crossings", robots=2, overrides=overrides)
    team: Any = make_policy("com1_rev3", env)
    state: Any = None
    observations, _ = env.reset(seed=seed)
    mine, other = env.simulation.world.pose[0, silent].copy(), env.simulation.world.pose[0, 1 - silent].copy()
    stands = np.array([2.0 * 0.3 / 3.3 - 1.0, 0.0], dtype=np.float32)
    for step in range(7):
        heard = {name: observations[name] for name in env.agents if step == 6 or name != f"robot_{silent}"}
        actions, state = team.predict(heard, state)
        observations, *_ = env.step({name: actions.get(name, stands) for name in env.agents})
    frame, (dx, dy), turn = state[silent].frame, mine[:2] - other[:2], float(other[2])
    cos, sin = math.cos(turn), math.sin(turn)
    np.testing.assert_allclose(frame.lies[:2], (cos * dx + sin * dy, cos * dy - sin * dx), atol=1e-4)
    assert math.remainder(frame.lies[2] - (mine[2] - turn), 2.0 * math.pi) == pytest.approx(0.0, abs=1e-4)


def test_a_partner_that_stops_answering_stands_where_it_was_heard_last() -> None:
    env, team = bug_gym.parallel_env(SCATTERED), march()
    seen, _ = env.reset(seed=0)
    actions, state = team.predict(seen)
    last = state[2].word
    seen, *_ = env.step(actions)
    del seen["robot_2"]
    actions, state = team.predict(seen, state)
    assert list(actions) == ["robot_0", "robot_1"]
    assert state[2].word == last and not state[2].is_heard and state[0].is_heard and state[2].steps == 1


def test_a_batch_of_a_team_is_its_worlds_one_by_one_and_a_world_begins_anew_as_a_whole() -> None:
    simulation, team = Simulation(SCATTERED, 2), march()
    rows = simulation.reset(seeds=[0, 1]).reshape(6, -1)
    actions, state = team.predict(rows)
    again, state = team.predict(rows, state, np.array([False] * 3 + [True] * 3))
    assert [memory.steps for memory in state] == [2, 2, 2, 1, 1, 1]
    by_agent, _ = team.predict(dict(zip(team.agents, rows[3:], strict=True)))
    np.testing.assert_array_equal(actions[3:], np.stack(list(by_agent.values())))
    np.testing.assert_array_equal(actions, again)


def test_rows_of_a_world_some_of_which_have_ended_are_those_of_missing_agents() -> None:
    simulation, team = Simulation(SCATTERED, 2), march()
    rows = simulation.reset(seeds=[0, 1]).reshape(6, -1)
    _, state = team.predict(rows)
    _, by_agent = team.predict(dict(zip(team.agents, rows[:3], strict=True)))
    actions, state = team.predict(rows, state, np.array([False, True, False] + [False] * 3))
    named, by_agent = team.predict(
        {agent: rows[number] for number, agent in enumerate(team.agents) if number != 1}, by_agent
    )
    assert [memory.is_heard for memory in state] == [True, False, True, True, True, True]
    assert [memory.steps for memory in state[:3]] == [memory.steps for memory in by_agent]
    np.testing.assert_array_equal(actions[[0, 2]], np.stack(list(named.values())))


@pytest.mark.parametrize(
    ("observation", "state", "starts", "said"),
    [
        ({"robot_7": np.zeros(3)}, None, None, "robot_7.*robot_0"),
        (np.zeros((4, 79), np.float32), None, None, "rows of worlds of 3 robots"),
        (np.zeros(79, np.float32), None, None, "rows of worlds of 3 robots"),
        (np.zeros((3, 79), np.float32), (MarchMemory(),) * 2, None, "team of 2, expected 3"),
        (np.zeros((3, 79), np.float32), (TeamMemory(),) * 3, None, "another policy: TeamMemory, expected MarchMemory"),
        (np.zeros((3, 79), np.float32), "state", None, "got str"),
        (np.zeros((3, 79), np.float32), None, [True, False], "3 bools"),
        (np.zeros((0, 79), np.float32), None, None, "rows of worlds of 3 robots"),
    ],
)
def test_what_no_team_of_three_can_use_is_refused_in_a_line(
    observation: Any, state: Any, starts: Any, said: str
) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        march().predict(observation, state, starts)
    assert "\n" not in str(caught.value)


def test_one_robot_is_no_team() -> None:
    with pytest.raises(MisfitError, match="2 robots or more, the scenario has 1"):
        march("static")


def test_an_agent_of_none_is_out_of_play_for_every_kind_of_team() -> None:
    env = bug_gym.parallel_env("crossing_robots", robots=2)
    seen, _ = env.reset(seed=0)
    for name in ("bug2", "com1_rev3", "ppo_dynamic"):
        actions, _ = make_policy(name, env).predict({"robot_0": None, "robot_1": seen["robot_1"]})
        assert list(actions) == ["robot_1"]


def test_discrete_actions_of_teams_are_numbers_as_those_of_single_robots() -> None:
    env = bug_gym.parallel_env("crossing_robots", robots=2, action="discrete")
    seen, _ = env.reset(seed=0)
    for name in ("bug2", "com1_rev3"):
        policy: Any = make_policy(name, env)
        actions, _ = policy.predict(seen)
        assert all(type(action) is np.int64 for action in actions.values())


def test_a_learned_policy_says_what_does_not_fit_among_the_robots_there_are() -> None:
    four = bug_gym.parallel_env("crossing_robots", robots=4)
    with pytest.raises(MisfitError, match="peers 1, not 3$"):
        make_policy("ppo_crossing_robots", four)
    two = bug_gym.parallel_env(load("crossing_robots", {"robot.kinematics": "holonomic"}), robots=2)
    for name in ("ppo_crossing_robots", "ppo_dynamic"):
        with pytest.raises(MisfitError, match="robot: kinematics differential, not holonomic$"):
            make_policy(name, two)
    with pytest.raises(MisfitError, match="the navigator drives differential robots, got kinematics='holonomic'"):
        make_policy("navigator", two)


def test_robots_side_by_side_that_find_no_room_are_told_how_they_start() -> None:
    env = bug_gym.parallel_env("rectangle_pair", robots=16)
    with pytest.raises(ValueError, match=r"robot 0 cannot start at .*16 robots start side by side, 2 m apart"):
        env.reset(seed=0)


@pytest.mark.parametrize("latency", [0.0, 0.1, 0.3])
def test_robots_with_latency_know_which_of_their_commands_have_yet_to_act(latency: float) -> None:
    team, steps = march(SCATTERED | {"robot": {"latency": latency}}), round(latency / 0.1)
    rows, memories = [np.full(team.sensors.width, 3.0, dtype=np.float32)] * 3, team.started(1)
    sent = []
    for _ in range(6):
        sent.append(team.decide(rows, memories))
        for robot, memory in enumerate(memories):
            expected = [actions[robot] for actions in sent][max(len(sent) - steps, 0) :]
            np.testing.assert_array_equal(memory.under_way, expected)
            assert steps == 0 or len(memory.view.under_way) == min(len(sent) - 1, steps)
