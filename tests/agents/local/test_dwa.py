"""The dynamic window approach: circles, what can be stopped from, and where it gets."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

from bug_gym.agents import make_policy
from bug_gym.agents.local.dwa import DWA, DWAMemory, smoothed
from bug_gym.agents.local.windows import Window, arc_distance, weigh_window
from bug_gym.compiling import kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats
from bug_gym.simulation import Simulation

BOX = {"family": "explicit", "bounds": [-6, -6, 14, 6], "start": [0, 0, 0]}


@kernel
def distance_on_arc(px: Floats, py: Floats, speed: float, rate: float, radius: float, look: float) -> float:
    """`arc_distance`, which only kernels call."""
    return arc_distance(px, py, speed, rate, radius, look)


def stepped_distance(points: F64, speed: float, rate: float, radius: float, look: float) -> float:
    """The same by small steps."""
    lap = 2.0 * math.pi * speed / abs(rate) if rate else math.inf
    for way in np.arange(0.0, min(look, lap), 1e-3):
        turned = rate * way / speed
        x, y = (way, 0.0) if rate == 0.0 else (speed / rate * math.sin(turned), speed / rate * (1 - math.cos(turned)))
        if (np.hypot(points[:, 0] - x, points[:, 1] - y) < radius).any():
            return float(way)
    return min(look, lap)


@pytest.mark.parametrize("seed", range(40))
def test_the_way_along_a_circle_is_that_of_small_steps(seed: int) -> None:
    generator = np.random.default_rng(seed)
    away, angle = generator.uniform(0.35, 3.0, 4), generator.uniform(-np.pi, np.pi, 4)
    points = np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1)
    speed, rate = float(generator.uniform(0.1, 1.0)), float(generator.choice([0.0, *generator.uniform(-2.0, 2.0, 5)]))
    found = distance_on_arc(points[:, 0].copy(), points[:, 1].copy(), speed, rate, 0.3, 4.0)
    assert found == pytest.approx(stepped_distance(points, speed, rate, 0.3, 4.0), abs=5e-3)


def test_smoothing_leaves_out_what_is_no_velocity() -> None:
    scores = np.array([[1.0, 2.0, 3.0], [4.0, -np.inf, 6.0]])
    found = smoothed(scores, is_round=False)
    assert found[0, 0] == pytest.approx((1 + 2 + 4) / 3) and found[1, 1] == -np.inf
    assert found[0, 1] == pytest.approx((1 + 2 + 3 + 4 + 6) / 5)
    assert smoothed(scores, is_round=True)[0, 0] == pytest.approx((1 + 2 + 3 + 4 + 6) / 5)


def test_the_robot_is_told_the_speed_and_the_turn_rate_that_were_chosen() -> None:
    simulation = Simulation({"world": {**BOX, "goal": [3, 4]}}, overrides={"robot.kinematics": "differential"})
    policy = make_policy("dwa", simulation)
    assert isinstance(policy, DWA)
    observation, state = simulation.reset(seeds=[0]), None
    for _ in range(30):
        action, state = policy.predict(observation[0, 0], state)
        memory = state[0]
        assert isinstance(memory, DWAMemory)
        speed, rate = memory.velocity
        drive = policy.sensors.drive
        span = drive.max_speed + drive.max_reverse
        assert 0.5 * (action[0] + 1.0) * span - drive.max_reverse == pytest.approx(speed, abs=1e-5)
        assert action[1] * drive.max_turn_rate == pytest.approx(rate, abs=1e-5)
        observation = simulation.step(action[None, None]).observation


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("acceleration", [None, 0.5])
def test_it_never_drives_into_what_stands(kinematics: str, acceleration: float | None) -> None:
    overrides: dict[str, Any] = {"robot.kinematics": kinematics, "robot.max_acceleration": acceleration}
    wall = {**BOX, "goal": [11, 0.3], "polygons": [[[4, -5], [4.5, -5], [4.5, 5], [4, 5]]]}
    episode = run_episode("dwa", {"world": wall, "lidar": {"beams": 180}}, overrides, max_steps=250)
    assert episode.outcome != "collision" and episode.min_clearance > 0.0
    reached = [run_episode("dwa", "static", overrides, seed=seed, max_steps=900).outcome for seed in range(4)]
    assert "collision" not in reached and reached.count("success") >= 2


def test_each_weight_works() -> None:
    discs = [[3.0, 0.4, 0.5], [5.5, -1.2, 0.8], [8.0, 0.9, 0.6]]
    world = {"world": {**BOX, "goal": [11, 0], "circles": discs}, "lidar": {"beams": 180}}
    plain = run_episode("dwa", world, {"robot.kinematics": "differential"}, max_steps=300)
    changes: list[dict[str, Any]] = [
        {"heading_weight": 0.1},
        {"distance_weight": 8.0},
        {"speed_weight": 8.0},
        {"look": 0.6},
    ]
    for change in changes:
        other = run_episode("dwa", world, {"robot.kinematics": "differential"}, max_steps=300, **change)
        assert other.path.shape != plain.path.shape or not np.allclose(other.path, plain.path), change
    assert plain.outcome == "success" and plain.length <= 12.5


def a_window(**weights: float) -> Window:
    """A window in which only the weights told count."""
    none: dict[str, Any] = {"heading_weight": 0.0, "distance_weight": 0.0, "speed_weight": 0.0}
    limits: dict[str, Any] = {
        "radius": 0.2,
        "max_speed": 1.0,
        "step": 0.1,
        "acceleration": 0.5,
        "turn_rate": 2.0,
        "gain": 1e9,
    }
    return Window(**limits, look=3.0, **{**none, **weights}, is_holonomic=False)


def scores_of(window: Window, speeds: F64, rates: F64, points: F64, goal: tuple[float, float]) -> F64:
    """What the velocities of a window are worth (v, w)."""
    scores = np.empty((len(speeds), len(rates)))
    weigh_window(window, speeds, rates, points[:, 0].copy(), points[:, 1].copy(), *goal, scores)
    return scores


def test_the_heading_is_that_to_the_goal_where_it_comes_to_stand_if_it_brakes_after_the_decision() -> None:
    window, goal = a_window(heading_weight=1.0), (2.0, 1.5)
    speeds, rates = np.array([0.2, 0.6, 1.0]), np.array([-1.5, -0.4, 0.0, 0.7, 2.0])
    found = scores_of(window, speeds, rates, np.zeros((0, 2)), goal)
    for (i, speed), (j, rate) in itertools.product(enumerate(speeds.tolist()), enumerate(rates.tolist())):
        x = y = heading = time = 0.0
        left, tick = speed, 1e-4
        while left > 0.0:  # along its circle, at first as it is, then ever slower
            x, y = x + tick * left * math.cos(heading), y + tick * left * math.sin(heading)
            heading += tick * left * rate / speed
            time += tick
            left = speed if time < window.step else speed - window.acceleration * (time - window.step)
        error = (math.atan2(goal[1] - y, goal[0] - x) - heading + math.pi) % (2.0 * math.pi) - math.pi
        assert found[i, j] == pytest.approx(1.0 - abs(error) / math.pi, abs=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_admissible_can_be_stopped_on_the_free_part_of_its_circle(seed: int) -> None:
    generator = np.random.default_rng(seed)
    away, angle = generator.uniform(0.3, 1.5, 12), generator.uniform(-np.pi, np.pi, 12)
    points = np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1)
    window = a_window(distance_weight=1.0, speed_weight=1.0)
    speeds, rates = np.linspace(0.1, 1.0, 7), np.linspace(-2.0, 2.0, 9)
    found = scores_of(window, speeds, rates, points, (50.0, 0.0))
    for (i, speed), (j, rate) in itertools.product(enumerate(speeds.tolist()), enumerate(rates.tolist())):
        free = distance_on_arc(points[:, 0].copy(), points[:, 1].copy(), speed, rate, window.radius, window.look)
        if math.isfinite(found[i, j]):
            assert speed <= math.sqrt(2.0 * free * window.acceleration)
            assert found[i, j] == pytest.approx(free / window.look + speed / window.max_speed)
        else:
            assert speed * window.step + speed**2 / (2.0 * window.acceleration) > free


@pytest.mark.parametrize(
    ("parameters", "words"),
    [({"look": 0.0}, "look must be above 0"), ({"heading_weight": -1.0}, "heading_weight must not be negative")],
)
def test_bad_parameters_are_refused(parameters: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_policy("dwa", "static", **parameters)
