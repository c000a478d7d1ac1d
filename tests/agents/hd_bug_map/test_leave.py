"""The map planner leaves what comes up on it, whether it is known to move or not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tracked import constant_network

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug_map import policy as of_policy
from bug_gym.agents.hd_bug_map.leave import PRESSED, arc_out, can_leave, is_pressed, sidestep, start_of
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout
from bug_gym.kinematics import differential_action, steering
from bug_gym.policy import hidden_gap
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

RADIUS = 0.2


def scene(kinematics: str, circles: list[list[float]], **lidar: Any) -> tuple[Simulation, View]:
    """A robot at the origin among circles x, y, radius [m], and what it sees."""
    world = {"family": "explicit", "bounds": [-20, -20, 20, 20], "start": [0, 0, 0], "goal": [8, 1], "circles": circles}
    simulation = Simulation({"world": world, "robot": {"kinematics": kinematics}, "lidar": {"beams": 90} | lidar})
    observation = simulation.reset(seeds=[0])[0, 0]
    return simulation, View(observation, Sensors.of(simulation.scenario))


def beside(bearing: float, gap: float, radius: float = 0.5) -> list[float]:
    """A circle at a bearing [rad] whose outline is a gap [m] from the body."""
    away = RADIUS + gap + radius
    return [away * math.cos(bearing), away * math.sin(bearing), radius]


def gap_of(view: View) -> float:
    """Between the body and what is nearest [m]."""
    return float(view.ranges.min()) - view.sensors.radius


@pytest.mark.parametrize("kinematics", ["differential", "holonomic"])
def test_it_gets_away_and_touches_nothing(kinematics: str) -> None:
    rng = np.random.default_rng(8)
    left = 0
    for _ in range(60):
        circles = [beside(rng.uniform(-math.pi, math.pi), 0.006, rng.uniform(0.15, 1.2))]
        circles += [beside(rng.uniform(-math.pi, math.pi), rng.uniform(0.1, 1.0), 0.2) for _ in range(3)]
        simulation, view = scene(kinematics, circles)
        first = gap_of(view)
        for _ in range(12):
            if gap_of(view) > 0.05:
                left += 1
                break
            if kinematics == "holonomic":
                velocity = sidestep(view, (1.0, 0.0), 1.0)
                action = steering(view.sensors.drive, velocity or (0.0, 0.0))
            else:
                action = differential_action(view.sensors.drive, *arc_out(view, 1.0))
            step = simulation.step(action[None, None])
            assert not step.terminated.any()
            view = View(step.observation[0, 0], view.sensors)
            assert gap_of(view) > first - 2e-3  # what is nearest may lie between two beams
    assert left >= 50  # the others are shut in


def test_a_differential_robot_turns_away_and_backs_where_it_can_go_no_other_way() -> None:
    for bearing in (0.4, 0.8, 1.2):
        arcs = [arc_out(scene("differential", [beside(side * bearing, 0.005)])[1], 1.0) for side in (1.0, -1.0)]
        assert arcs[0] == pytest.approx((arcs[1][0], -arcs[1][1]))
        assert arcs[0][0] < 0.0
    ahead = [arc_out(scene("differential", [beside(side * 1.9, 0.005)])[1], 1.0) for side in (1.0, -1.0)]
    assert ahead[0][0] > 0.5
    assert ahead[0][1] < 0.0 < ahead[1][1]
    _, shut = scene("differential", [beside(0.6, 0.005), beside(-2.6, 0.006)])
    speed, rate = arc_out(shut, 1.0)
    assert speed == 0.0
    assert rate < 0.0


def test_it_does_not_back_where_it_does_not_look() -> None:
    _, view = scene("differential", [beside(0.4, 0.005)], fov=math.radians(270.0))
    assert arc_out(view, 1.0)[0] == 0.0


def test_a_holonomic_robot_goes_the_way_off_that_is_nearest_to_the_wanted_one() -> None:
    _, view = scene("holonomic", [beside(0.5, 0.005)])
    for wanted in ((1.0, 0.2), (0.0, -1.0), (-1.0, 0.0)):
        velocity = sidestep(view, wanted, 1.0)
        assert velocity is not None
        assert math.hypot(*velocity) == pytest.approx(1.0)
        off = math.acos(math.cos(math.atan2(velocity[1], velocity[0]) - 0.5))
        assert off > math.radians(109.9)
    assert sidestep(view, (-1.0, 0.0), 1.0) == pytest.approx((-1.0, 0.0), abs=0.1)
    everywhere = [beside(bearing, 0.005, 0.1) for bearing in np.linspace(-3.0, 3.0, 9)]
    assert sidestep(scene("holonomic", everywhere)[1], (1.0, 0.0), 1.0) is None


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_the_nearer_it_is_the_fewer_beams_have_to_say_so(noise: float) -> None:
    _, view = scene("differential", [], noise=noise)
    least = view.sensors.radius + PRESSED
    for count, short in ((3, 0.0), (2, noise), (1, 2.0 * noise)):
        for inside in (False, True):
            ranges = np.full_like(view.ranges, 3.0)
            ranges[5 : 5 + count] = least - short + (-1e-4 if inside else 1e-4)
            assert is_pressed(view.with_ranges(ranges), knows_movers=False) == inside
            assert is_pressed(view.with_ranges(ranges + noise), knows_movers=True) == inside
    # The brake keeps a differential robot farther from things than that.
    assert PRESSED + noise < hidden_gap(view.sensors)


def test_it_is_for_round_robots_that_stop_at_once() -> None:
    _, view = scene("differential", [])
    assert can_leave(view.sensors)
    assert can_leave(scene("differential", [], noise=0.03)[1].sensors)
    assert not can_leave(scene("differential", [], noise=0.05)[1].sensors)
    long_body = {"circles": [[0.0, 0.0, 0.2], [0.2, 0.0, 0.2]]}
    for robot in ({"max_acceleration": 2.0}, {"kinematics": "ackermann"}, {"latency": 0.1}, long_body):
        world = {"family": "explicit", "bounds": [-20, -20, 20, 20], "start": [0, 0, 0], "goal": [8, 1]}
        simulation = Simulation({"world": world, "robot": {"kinematics": "differential"} | robot})
        assert not can_leave(Sensors.of(simulation.scenario))


def test_an_arc_begins_where_its_velocity_points() -> None:
    assert start_of((1.0, 0.0), 0.1) == pytest.approx((1.0, 0.0))
    assert start_of((1.0, 2.0), 0.1) == pytest.approx((math.cos(0.1), math.sin(0.1)))
    assert start_of((-0.5, 0.0), 0.1) == pytest.approx((-0.5, 0.0))
    for rate in (-1.5, 1.5):
        x, y = start_of((0.0, rate), 0.1)
        assert x == 0.0
        assert 0.0 < y * math.copysign(1.0, rate) < 1e-2


def test_it_leaves_where_it_has_stood_or_knows_that_things_move() -> None:
    simulation, view = scene("differential", [beside(1.9, 0.005)])
    agent = make_policy("hd_bug_map", simulation)
    assert isinstance(agent, of_policy.HDBugMap)
    arc = differential_action(view.sensors.drive, *arc_out(view, agent.measures.top))
    x, y, heading = view.pose
    for knows, steps, moved, leaves in (
        (False, 0, 0.0, False),  # a start may be as near to a wall
        (False, 5, 0.0, True),
        (False, 5, 0.02, False),  # who has driven may have come there itself
        (True, 5, 0.02, True),
    ):
        memory = agent.start()
        memory.steps, memory.pose = steps, (x - moved, y, heading + 0.3)
        memory.moved_at = 3 if knows else memory.moved_at
        (action,) = agent.decide(view.flat[None], [memory])
        assert (memory.mode == "leaving") == leaves
        assert np.array_equal(action, arc) == leaves
        memory.verdict = "stuck"
        assert agent.decide(view.flat[None], [memory])[0][0] == differential_action(view.sensors.drive, 0.0, 0.0)[0]


def rows(scenario: Any, seeds: list[int], parameters: dict[str, Any] | None = None) -> list[tuple[str, int, float]]:
    """Outcome, steps and length of each episode."""
    policy = PolicyEntry.of({"name": "hd_bug_map", "parameters": parameters or {}})
    entry = ScenarioEntry(scenario.name, scenario, range(seeds[0], seeds[-1] + 1))
    found = [row for chunk in Rollout(policy, entry, seeds).worlds() for row in chunk]
    return [(row.outcome, row.steps, row.path_length) for row in found]


def test_fewer_slow_things_that_are_not_known_to_move_run_it_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 150 worlds, with a tracker that takes all for still."""
    scenario, seeds = load("dynamic", {"world.speeds": [0.05, 0.3], "world.obstacles": 30}), list(range(150))
    sees_nothing_move = constant_network(-99.0)
    monkeypatch.setattr(of_policy, "Tracker", lambda sensors: Tracker(sensors, sees_nothing_move))
    with_it = sum(outcome == "collision" for outcome, *_ in rows(scenario, seeds))
    monkeypatch.setattr(of_policy, "can_leave", lambda sensors: False)
    without = sum(outcome == "collision" for outcome, *_ in rows(scenario, seeds))
    assert with_it < 0.75 * without, (with_it, without)


@pytest.mark.parametrize("name", ["rooms", "static"])
def test_among_still_things_it_changes_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario, seeds = load(name, {"lidar.noise": 0.03}), list(range(7000, 7006))
    with_it = rows(scenario, seeds)
    monkeypatch.setattr(of_policy, "can_leave", lambda sensors: False)
    assert with_it == rows(scenario, seeds)


@pytest.mark.parametrize("kinematics", ["differential", "holonomic"])
def test_numbered_actions_lead_away_too(kinematics: str) -> None:
    _, view = scene(kinematics, [beside(1.9, 0.005)])
    agent = of_policy.HDBugMap(view.sensors, discrete=True)
    memory = agent.start()
    memory.steps, memory.moved_at = 5, 3
    (number,) = agent.decide(view.flat[None], [memory])
    assert number.shape == ()
    assert memory.mode == "leaving"
    assert agent._velocities is not None
    x, y = agent._velocities[number]
    assert math.cos(math.atan2(y, x) - 1.9) < 0.0
