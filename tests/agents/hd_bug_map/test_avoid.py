"""What the map planner asks of its sequences among movers, and what it makes of the answers."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug.sequences import Sequences, judge_sequences
from bug_gym.agents.hd_bug_map import avoid
from bug_gym.agents.hd_bug_map.avoid import FIRST, HABIT, PACES, SECOND, Near
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.perceive import Scene
from bug_gym.agents.hd_bug_map.policy import HDBugMap
from bug_gym.agents.mapping.way import Way
from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout
from bug_gym.kinematics import differential_action
from bug_gym.simulation import Simulation
from bug_gym.view import View


class Moment(NamedTuple):
    """A decision among movers."""

    agent: HDBugMap
    scene: Scene
    memory: HDBugMapMemory
    way: Way
    near: Near


def moment(
    kinematics: str = "differential", *, steps: int = 12, goal_radius: float = 0.3, is_shut_behind: bool = False
) -> Moment:
    """What it sees once it knows a mover that crosses its way, before a disc that stands behind the robot or not."""
    motion = {"law": "bounce", "velocity": [0.0, -0.4]}
    mover = {"shape": {"circle": 0.4}, "at": [3.0, 1.5], "motion": motion}
    behind = [[-0.45, 0.0, 0.2]] if is_shut_behind else []
    world: dict[str, Any] = {"family": "explicit", "bounds": [-20, -20, 20, 20], "start": [0, 0, 0], "goal": [8, 1]}
    world |= {"movers": [mover], "circles": behind}
    scenario = {"world": world, "robot": {"kinematics": kinematics}, "goal": {"radius": goal_radius}}
    simulation = Simulation(scenario)
    agent = make_policy("hd_bug_map", simulation)
    assert isinstance(agent, HDBugMap)
    observation, memory = simulation.reset(seeds=[0])[0, 0], agent.start()
    stands = np.zeros(2) if kinematics == "holonomic" else differential_action(agent.sensors.drive, 0.0, 0.0)
    for _ in range(12):
        agent.look(View(observation, agent.sensors), memory)
        observation = simulation.step(stands[None, None]).observation[0, 0]
    scene = agent.look(View(observation, agent.sensors), memory)
    way = agent.planner.plan(scene, memory)
    near = agent.avoidance.near_movers(scene, agent.predictor)
    assert way is not None and near is not None
    return Moment(agent, scene, memory, way, near)


def asked(at: Moment, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What a decision asks of `judge_sequences`, by name."""
    names = ("drive", "pose", "radius", "first", "backs", "held", "second", "around", "futures", "margin", "spacing")
    found: list[tuple[Any, ...]] = []

    def judge(*arguments: Any) -> Sequences:
        found.append(arguments)
        return judge_sequences(*arguments)

    monkeypatch.setattr(avoid, "judge_sequences", judge)
    at.agent.avoidance.avoid(at.scene, at.memory, at.way, at.near)
    return dict(zip(names, found[0], strict=True))


def test_what_is_planned_for_later_may_be_done_now(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else it might put it off for ever."""
    at = moment()
    arguments = asked(at, monkeypatch)
    first, second = arguments["first"], arguments["second"]
    toward = math.atan2(*(at.way.places[1] - at.scene.view.position)[::-1])
    now = np.exp(1j * (first.directions[first.speeds == at.agent.measures.top] - toward))
    later = np.exp(1j * second.directions[second.speeds > 0.0])
    assert np.abs(later[:, None] - now[None]).min(axis=1).max() < 1e-9
    assert len(later) == len(SECOND) and second.speeds[-1] == 0.0


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_who_stands_turns_toward_the_way(kinematics: str, monkeypatch: pytest.MonkeyPatch) -> None:
    at = moment(kinematics)
    first = asked(at, monkeypatch)["first"]
    stands = np.flatnonzero(first.speeds == 0.0)
    assert stands.tolist() == [len(PACES) * len(FIRST)]
    ahead = at.way.places[1] - at.scene.view.position
    assert first.directions[stands[0]] == pytest.approx(math.atan2(ahead[1], ahead[0]))


@pytest.mark.parametrize(
    ("kinematics", "is_shut_behind", "backs"),
    [("holonomic", False, False), ("differential", False, True), ("differential", True, False)],
)
def test_it_backs_out_where_it_can(
    kinematics: str, is_shut_behind: bool, backs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    at = moment(kinematics, is_shut_behind=is_shut_behind)
    arguments = asked(at, monkeypatch)
    assert arguments["backs"] == backs
    if backs:
        first = arguments["first"]
        assert first.speeds[-1] == at.agent.sensors.drive.max_reverse
        assert math.cos(first.directions[-1] - at.scene.view.heading) == pytest.approx(-1.0)


def test_a_goal_nearer_than_half_a_step_is_not_gone_past(monkeypatch: pytest.MonkeyPatch) -> None:
    at = moment(goal_radius=0.01)
    arguments = asked(at, monkeypatch)
    assert arguments["around"].goal_radius >= 0.5 * at.agent.measures.top * arguments["spacing"]
    wide = moment()
    assert asked(wide, monkeypatch)["around"].goal_radius == wide.memory.goal_radius > 0.2


def test_it_may_follow_the_way_that_was_planned(monkeypatch: pytest.MonkeyPatch) -> None:
    at = moment()
    arguments = asked(at, monkeypatch)
    np.testing.assert_array_equal(arguments["around"].nodes, at.way.places[1:])


def answer(at: Moment, ends: list[tuple[float, float]], early: float = 0.0, risk: float = 0.0) -> np.ndarray:
    """The costs of sequences that end so."""
    shape = (len(ends), 1)
    found = Sequences(np.full(shape, risk), np.array(ends)[:, None], np.full(shape, early))
    return at.agent.avoidance._costs(at.scene, at.way, found)[:, 0]


def test_a_sequence_costs_what_is_left_to_go_and_its_hits() -> None:
    at = moment()
    goal, parameters = np.array([8.0, 1.0]), at.agent.parameters
    ends = [(1.0, 0.1), (2.0, 0.25)]
    left = np.hypot(*(np.array(ends) - goal).T)
    np.testing.assert_allclose(answer(at, ends), left, atol=0.05)
    np.testing.assert_allclose(answer(at, ends, risk=0.3) - answer(at, ends), parameters.beta * avoid.HIT * 0.3)


def test_before_a_bend_it_does_not_go_to_and_fro() -> None:
    """Worlds in which something moved somewhere, and it stood before a bend until time was up."""
    scenario = load("dynamic")
    policy = PolicyEntry.of({"name": "hd_bug_map", "parameters": {"predictor": "rl"}})
    for seed in (65200, 65220, 66162, 66319):
        rollout = Rollout(policy, ScenarioEntry(scenario.name, scenario, range(seed, seed + 1)), [seed])
        (row,) = [row for rows in rollout.worlds() for row in rows]
        assert row.outcome == "success"


def test_the_sooner_at_the_goal_the_cheaper() -> None:
    at = moment()
    ends = [(7.8, 1.0)]
    assert answer(at, ends, early=1.5) == pytest.approx([-1.5 * at.agent.measures.top])
    assert answer(at, ends, early=1.5) < answer(at, ends, early=0.5) < answer(at, ends)


def test_from_where_the_way_is_out_of_sight_it_goes_straight_back() -> None:
    at = moment(is_shut_behind=True)
    behind = (-1.2, 0.0)  # the disc hides the way
    assert answer(at, [behind]) == pytest.approx([1.2 + float(at.way.rest[0])])


def test_to_turn_aside_costs_a_little() -> None:
    at = moment()
    avoidance, memory = at.agent.avoidance, at.memory
    costs = []
    for direction in (0.0, 1.0):
        memory.direction = direction
        avoidance.avoid(at.scene, memory, at.way, at.near)
        costs.append(memory.costs.copy())
    directions = avoidance._first_velocities(at.scene, at.way).directions
    turned = [np.abs(np.angle(np.exp(1j * (directions - direction)))) for direction in (0.0, 1.0)]
    expected = at.agent.parameters.beta * HABIT * (turned[1] - turned[0])
    np.testing.assert_allclose((costs[1] - costs[0])[: len(directions)], expected, atol=1e-9)
