"""What holds for every policy of the table: a new one is tested by being listed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import run_episode

import bug_gym
from bug_gym import observation
from bug_gym.agents import AGENTS, make_policy, playable_names, policy_names
from bug_gym.agents.floors.random import Random
from bug_gym.agents.parameters import parameters_of
from bug_gym.cli import main
from bug_gym.inertia import are_cut_at_once
from bug_gym.policy import AT_ONCE, Drawing, ScriptedPolicy
from bug_gym.simulation import Simulation
from bug_gym.team_policy import EachAlone

SCRIPTED = [name for name, agent in AGENTS.items() if not agent.model]
"""Those that drive any robot: what plays a model drives the one that it was trained with."""
DRIVERS = [*SCRIPTED, *(name for name in playable_names() if AGENTS[name].model and AGENTS[name].family != "learned")]
"""Those and the ones that are more than a model, where the robot is the models'."""
CAREFUL = [name for name in SCRIPTED if name != "random"]


def first_observations(overrides: dict[str, Any] | None = None, *, count: int = 3) -> tuple[Simulation, Any]:
    """A Simulation of several rows and its first flat observations (n, D)."""
    simulation = Simulation("static", count, overrides=overrides)
    return simulation, simulation.reset(seeds=range(count))[:, 0]


@pytest.mark.parametrize("name", SCRIPTED)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_actions_lie_in_the_action_space(name: str, kinematics: str) -> None:
    simulation, flat = first_observations({"robot.kinematics": kinematics})
    policy = make_policy(name, simulation)
    state = None
    for _ in range(50):
        actions, state = policy.predict(flat, state)
        assert actions.shape == (3, 2) and actions.dtype == np.float32
        assert np.abs(actions).max() <= 1.0
        flat = simulation.step(actions[:, None]).observation[:, 0]


@pytest.mark.parametrize("name", DRIVERS)
def test_a_batch_is_its_rows_one_by_one_in_either_form(name: str) -> None:
    simulation, flat = first_observations()
    policy = make_policy(name, simulation)
    batch = single = as_dict = None
    for _ in range(40):
        actions, batch = policy.predict(flat, batch)
        named, as_dict = policy.predict(observation.as_dict(flat, simulation.fields), as_dict)
        one, single = policy.predict(flat[1], single)
        np.testing.assert_array_equal(actions, named)
        np.testing.assert_array_equal(actions[1], one)
        flat = simulation.step(actions[:, None]).observation[:, 0]


@pytest.mark.parametrize("name", ["tangent_bug", "hd_bug_map", "orca", "apf"])
def test_rows_of_robots_that_take_care_are_those_one_by_one(name: str) -> None:
    simulation = Simulation("rooms", 5, overrides={"robot.kinematics": "differential", "robot.max_acceleration": 0.5})
    flat = simulation.reset(seeds=range(5))[:, 0]
    policy: Any = make_policy(name, simulation)
    assert are_cut_at_once(policy.sensors)
    batch, singles = None, [None] * 5
    for _ in range(120):
        actions, batch = policy.predict(flat, batch)
        for row in range(5):
            one, singles[row] = policy.predict(flat[row], singles[row])
            np.testing.assert_array_equal(actions[row], one)
        flat = simulation.step(actions[:, None]).observation[:, 0]


def test_more_rows_than_are_read_at_once_are_those_one_by_one() -> None:
    simulation, flat = first_observations(count=AT_ONCE + 3)
    policy, batch = make_policy("bug2", simulation), None
    singles: list[Any] = [None] * len(flat)
    for _ in range(5):
        actions, batch = policy.predict(flat, batch)
        for row in range(len(flat)):
            one, singles[row] = policy.predict(flat[row], singles[row])
            np.testing.assert_array_equal(actions[row], one)
        flat = simulation.step(actions[:, None]).observation[:, 0]


@pytest.mark.parametrize("action", ["continuous", "discrete"])
def test_no_rows_get_no_actions(action: str) -> None:
    env = gym.make("BugGym/Static-v0", observation="flat", action=action)
    values, _ = env.reset(seed=0)
    actions, state = make_policy("bug2", env).predict(values[None][:0])
    some, _ = make_policy("bug2", env).predict(values[None])
    assert len(actions) == 0 == len(state or ()) and actions.dtype == some.dtype and actions.shape[1:] == some.shape[1:]


@pytest.mark.parametrize("name", DRIVERS)
def test_episode_start_gives_a_row_a_new_memory(name: str) -> None:
    simulation, flat = first_observations(count=2)
    policy = make_policy(name, simulation)
    _, state = policy.predict(flat)
    for _ in range(5):
        _, state = policy.predict(flat, state)
    assert state is not None
    fresh, after = policy.predict(flat, state, np.array([True, False]))
    assert after is not None and after[0] is not state[0] and after[1] is state[1]
    expected, _ = policy.predict(flat[0])
    np.testing.assert_array_equal(fresh[0], expected)


@pytest.mark.parametrize("name", DRIVERS)
def test_discrete_actions_are_numbers_of_the_table(name: str) -> None:
    env = gym.make("BugGym/Static-v0", action="discrete")
    policy = make_policy(name, env)
    values, _ = env.reset(seed=5)
    state = None
    for _ in range(30):
        action, state = policy.predict(values, state)
        assert env.action_space.contains(action.item() if action.ndim == 0 else action)
        values, *_ = env.step(action)


@pytest.mark.parametrize("name", DRIVERS)
def test_another_beam_count_is_refused(name: str) -> None:
    policy = make_policy(name, Simulation("static"))
    _, flat = first_observations({"lidar.beams": 32})
    with pytest.raises(ValueError, match="64 beams"):
        policy.predict(flat)


@pytest.mark.parametrize("name", DRIVERS)
def test_a_number_that_is_not_finite_is_refused(name: str) -> None:
    simulation, flat = first_observations()
    flat[0, 3] = np.nan
    with pytest.raises(ValueError, match="finite"):
        make_policy(name, simulation).predict(flat)


@pytest.mark.parametrize("name", DRIVERS)
@pytest.mark.parametrize("scan", ["nothing", "contact"])
def test_a_scan_of_nothing_or_of_contact_all_round_is_no_error(name: str, scan: str) -> None:
    simulation, flat = first_observations(count=1)
    flat[:, :64] = simulation.scenario.lidar.range if scan == "nothing" else 0.0
    policy = make_policy(name, simulation)
    state = None
    for _ in range(20):
        actions, state = policy.predict(flat, state)
        assert np.isfinite(actions).all()


@pytest.mark.parametrize("name", CAREFUL)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(3))
def test_no_collision_among_still_obstacles(name: str, kinematics: str, seed: int) -> None:
    episode = run_episode(name, "static", {"robot.kinematics": kinematics, "lidar.beams": 128}, seed=seed)
    assert episode.outcome != "collision"


@pytest.mark.parametrize("name", CAREFUL)
def test_the_open_way_to_the_goal_is_taken_straight(name: str) -> None:
    world = {"family": "empty", "start": [0, 0, 0], "goal": [8, 3]}
    episode = run_episode(name, {"world": world})
    assert episode.outcome == "success"
    straight = math.hypot(8.0, 3.0) - 0.3
    assert straight - 1e-6 <= episode.length <= 1.005 * straight


@pytest.mark.parametrize("name", SCRIPTED)
def test_what_is_drawn_is_a_drawing(name: str) -> None:
    episode = run_episode(name, "u_trap", max_steps=150)
    policy = make_policy(name, episode.simulation)
    assert isinstance(policy, ScriptedPolicy)
    drawing = policy.draw(episode.memory)
    assert isinstance(drawing, Drawing)
    for *numbers, label in [*drawing.points, *drawing.segments]:
        assert np.isfinite(numbers).all() and isinstance(label, str)


ANGLE, SHIFT = 0.7, np.array([1.3, -2.1])


def moved(points: Any) -> Any:
    """Points (..., 2) turned by ANGLE and shifted by SHIFT, as lists."""
    cos, sin = math.cos(ANGLE), math.sin(ANGLE)
    return (np.asarray(points, dtype=float) @ np.array([[cos, sin], [-sin, cos]]) + SHIFT).tolist()


def two_worlds() -> tuple[dict[str, Any], dict[str, Any]]:
    """A world with still obstacles and two movers beside the way, and the same one turned and shifted."""
    polygons = [[[3, -1.5], [4, -1.5], [4, 2.5], [3, 2.5]], [[7, -4], [8, -4], [7.5, 0.8]]]
    circles = [[10.0, 1.0, 0.8]]
    velocity, at, ways = [0.0, 0.2], [5.5, 5.0], [[13.0, 5.0], [13.0, 7.0]]
    plain = {
        "family": "explicit",
        "bounds": [-40, -40, 40, 40],
        "polygons": polygons,
        "circles": circles,
        "movers": [
            {"shape": {"circle": 0.4}, "at": at, "motion": {"law": "bounce", "velocity": velocity}},
            {"shape": {"circle": 0.3}, "at": ways[0], "motion": {"law": "waypoints", "points": ways, "speed": 0.3}},
        ],
        "start": [0.0, 0.0, 0.0],
        "goal": [13.0, 0.0],
    }
    turn = np.array([[math.cos(ANGLE), math.sin(ANGLE)], [-math.sin(ANGLE), math.cos(ANGLE)]])
    turned = {
        **plain,
        "polygons": [moved(ring) for ring in polygons],
        "circles": [[*moved(circle[:2]), circle[2]] for circle in circles],
        "movers": [
            {
                "shape": {"circle": 0.4},
                "at": moved(at),
                "motion": {"law": "bounce", "velocity": (np.array(velocity) @ turn).tolist()},
            },
            {
                "shape": {"circle": 0.3},
                "at": moved(ways[0]),
                "motion": {"law": "waypoints", "points": moved(ways), "speed": 0.3},
            },
        ],
        "start": [*moved([0.0, 0.0]), ANGLE],
        "goal": moved([13.0, 0.0]),
    }
    return plain, turned


@pytest.mark.parametrize("name", SCRIPTED)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_turned_and_shifted_world_gives_the_same_outcome_and_length(
    name: str, kinematics: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Of a first observation with another last bit it would draw others.
    monkeypatch.setattr(Random, "first_memory", lambda self, flat, number: self.start())
    plain, turned = two_worlds()
    settings = {"robot": {"kinematics": kinematics}, "lidar": {"beams": 360, "range": 6.0}, "time": {"limit": 90.0}}
    first, second = (run_episode(name, {**settings, "world": world}) for world in (plain, turned))
    assert (first.outcome, first.verdict) == (second.outcome, second.verdict)
    assert second.length == pytest.approx(first.length, rel=0.01)


def mirrored_worlds(goal: float) -> list[dict[str, Any]]:
    """A world with the goal so far to the left [m], and its mirror image about the line on which the robot looks.

    Nothing in it is a tie: no wall lies square to the way, and no two ways round are of one length.
    """
    worlds = []
    for sign in (1.0, -1.0):
        polygons: list[list[list[float]]] = [
            [[3, -1.5], [4, -1.7], [4.4, 2.3], [3.3, 2.6]],
            [[7, -4], [8, -4], [7.5, 0.8]],
        ]
        worlds.append(
            {
                "family": "explicit",
                "bounds": [-40, -40, 40, 40],
                "polygons": [[[x, sign * y] for x, y in ring] for ring in polygons],
                "circles": [[10.0, sign * 1.0, 0.8]],
                "movers": [
                    {
                        "shape": {"circle": 0.4},
                        "at": [5.5, sign * 5.0],
                        "motion": {"law": "bounce", "velocity": [0.0, sign * 0.2]},
                    }
                ],
                "start": [0.0, 0.0, 0.0],
                "goal": [13.0, sign * goal],
            }
        )
    return worlds


OTHER = {"left": "right", "right": "left"}
SIDED = [name for name in SCRIPTED if AGENTS[name].family in ("bug", "field")]
"""Whose rules tell left from right by the parameter `turn` alone; what has cells in the world, or draws, need not."""


@pytest.mark.parametrize("name", SIDED)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("goal", [0.7, -0.7])
def test_a_mirrored_world_gives_the_mirrored_way(name: str, kinematics: str, goal: float) -> None:
    settings = {"robot": {"kinematics": kinematics}, "lidar": {"beams": 360, "range": 6.0}, "time": {"limit": 60.0}}
    policy: Any = make_policy(name, Simulation("static"))
    turn = getattr(policy.parameters, "turn", None)
    own: list[dict[str, Any]] = [{}, {}] if turn is None else [{"turn": turn}, {"turn": OTHER.get(turn, turn)}]
    first, second = (
        run_episode(name, {**settings, "world": world}, **turned)
        for world, turned in zip(mirrored_worlds(goal), own, strict=True)
    )
    assert (first.outcome, first.verdict) == (second.outcome, second.verdict)
    # Within a tenth of a step: errors of rounding grow where a robot turns from step to step.
    np.testing.assert_allclose(first.path[:, :2], second.path[:, :2] * [1.0, -1.0], atol=0.01)


def test_what_new_policy_writes_meets_what_holds_for_those_of_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "policy", "fine_bug"]) == 0
    name = "fine_bug.py:FineBug"
    for kinematics in ("holonomic", "differential"):
        for goal in (0.7, -0.7, 0.0):
            test_a_mirrored_world_gives_the_mirrored_way(name, kinematics, goal)
        test_actions_lie_in_the_action_space(name, kinematics)
        test_no_collision_among_still_obstacles(name, kinematics, 0)
        test_a_turned_and_shifted_world_gives_the_same_outcome_and_length(name, kinematics, monkeypatch)
    for parameter in parameters_of(type(make_policy(name, Simulation("static")))):
        if "float" in parameter.type:
            with pytest.raises(ValueError, match=f"{parameter.name}.* at most"):
                make_policy(name, Simulation("static"), **{parameter.name: 1e300})


def test_an_unknown_policy_is_refused_with_the_nearest_names() -> None:
    with pytest.raises(ValueError, match="did you mean 'bug2'"):
        make_policy("bug_2", Simulation("static"))


@pytest.mark.parametrize("name", DRIVERS)
def test_an_unknown_parameter_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="has no parameter 'colour'"):
        make_policy(name, Simulation("static"), colour="red")


BUGS = [name for name, agent in AGENTS.items() if agent.family == "bug"]


@pytest.mark.parametrize("name", BUGS)
@pytest.mark.parametrize(
    "parameters",
    [{"clearance": -0.5}, {"clearance": 0.2}, {"clearance": math.nan}, {"turn": "up"}, {"leave_rule": "now"}],
)
def test_bad_parameters_of_bugs_are_refused(name: str, parameters: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(parameters))):
        make_policy(name, Simulation("static"), **parameters)


@pytest.mark.parametrize("source", ["scenario", "env", "vector", "parallel", "aec"])
def test_a_policy_is_made_from_any_face(source: str) -> None:
    makers: dict[str, Any] = {
        "scenario": lambda: "static",
        "env": lambda: gym.make("BugGym/Static-v0"),
        "vector": lambda: gym.make_vec("BugGym/Static-v0", num_envs=2),
        "parallel": lambda: bug_gym.parallel_env("static", robots=2),
        "aec": lambda: bug_gym.env("static", robots=2),
    }
    policy: Any = make_policy("bug2", makers[source]())
    single = policy.policy if isinstance(policy, EachAlone) else policy  # several robots, each by itself
    assert isinstance(single, ScriptedPolicy) and len(policy.sensors.angles) == 64
    assert isinstance(policy, EachAlone) == (source in ("parallel", "aec"))


def test_sb3s_evaluate_policy_runs_a_scripted_policy_as_it_stands() -> None:
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.evaluation import evaluate_policy

    from bug_gym.agents.sb3 import make_vec_env

    env = make_vec_env("static", 4, seed=0)
    rewards, lengths = evaluate_policy(make_policy("bug2", env), env, n_eval_episodes=8, return_episode_rewards=True)
    assert isinstance(rewards, list) and isinstance(lengths, list)
    # Every world is solvable: the goal's 10 outweighs the 0.01 of each step.
    assert min(rewards) > 10.0 and max(lengths) < 600


def test_the_table_lists_each_policy_once() -> None:
    assert policy_names() == list(AGENTS) and len(set(policy_names())) == len(AGENTS)
