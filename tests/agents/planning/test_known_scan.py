"""A noisy scan put right by the map: still things lie where they are, and what moves is as it was seen."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bug_gym.agents import AGENTS
from bug_gym.agents.planning.known_scan import along_rays, looked_at, put_right
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.smoothing import Solids
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.reproductions import cylinder_claims
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

PLANNERS = [name for name, line in AGENTS.items() if line.privileged]
NOISE = 0.02
NO_EDGES, NO_DISCS = np.zeros((0, 4)), np.zeros((0, 3))


def test_rays_meet_discs_and_edges_where_geometry_says() -> None:
    ways = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [math.sqrt(0.5), math.sqrt(0.5)]])
    discs = np.array([[3.0, 0.0, 1.0], [-3.0, 0.5, 1.0], [0.0, -2.0, 0.5]])
    edges = np.array([[-1.0, 4.0, 1.0, 4.0], [5.0, -1.0, 5.0, 1.0]])
    found = along_rays(ways, (0.0, 0.0, 0.3), edges, discs)
    np.testing.assert_allclose(found, [2.0, 4.0, 3.0 - math.sqrt(0.75), np.inf])
    assert np.isinf(along_rays(ways, (0.0, 0.0, 0.0), NO_EDGES, NO_DISCS)).all()


def seen(scenario: str, noise: float, seed: int, *, beams: int = 180) -> tuple[np.ndarray, Sensors, Simulation]:
    """The scan of a world's beginning (B,) [m]."""
    simulation = Simulation(scenario, overrides={"lidar.noise": noise, "lidar.beams": beams, "world.obstacles": 30})
    flat = simulation.reset(seeds=[seed])[0, 0]
    sensors = Sensors.of(simulation.world.scenario)
    return flat[sensors.always_seen[0]].astype(np.float64), sensors, simulation


@pytest.mark.parametrize("seed", range(8))
def test_near_things_that_stand_are_as_far_as_without_noise(seed: int) -> None:
    exact, sensors, simulation = seen("static", 0.0, seed)
    noisy, _, _ = seen("static", NOISE, seed)
    live = Maps(simulation).of_robot(0)
    found = put_right(noisy, sensors, live.pose, Solids.of(live.still, 0.2), NOISE)
    near = exact < looked_at(sensors) - 4.0 * NOISE
    off = np.abs(found - exact)[near]
    assert np.abs(noisy - exact)[near].max(initial=0.0) <= 4.0 * NOISE, "no beam of these seeds lies further off"
    assert off.max(initial=0.0) < 1e-5
    far = noisy >= looked_at(sensors)
    np.testing.assert_array_equal(found[far], noisy[far])


def test_what_is_not_on_the_map_stays_as_it_was_seen() -> None:
    sensors = Sensors.of(load("static"))
    ranges = np.full(len(sensors.angles), 5.0)
    ranges[:10] = 0.5  # something that moves, before a wall at 0.8 m
    wall = Solids(NO_DISCS, np.array([[0.8, -5.0, 0.8, 5.0]]), 0.2)
    np.testing.assert_array_equal(put_right(ranges, sensors, (0.0, 0.0, 0.0), wall, NOISE), ranges)
    ranges[0] = 0.8 / math.cos(sensors.angles[0]) + 3.9 * NOISE
    assert put_right(ranges, sensors, (0.0, 0.0, 0.0), wall, NOISE)[0] == pytest.approx(
        0.8 / math.cos(sensors.angles[0])
    )
    ranges[0] += 0.2 * NOISE
    assert put_right(ranges, sensors, (0.0, 0.0, 0.0), wall, NOISE)[0] == ranges[0]


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("robot", ["holonomic", "jackal"])
def test_noise_does_not_make_a_planner_stand_among_things_on_its_map(name: str, robot: str) -> None:
    """With ways as near to cylinders as their margin most stood for good at 3 cm: of some hundred beams one is short."""
    scenario = load(cylinder_claims.scenario(robot, shut=False), {"lidar.noise": 0.03, "time.limit": 60.0})
    rows = evaluate([name], scenario, episodes=3, seed=700_006)
    assert all(row.min_clearance > 0.0 and row.outcome in ("success", "gave_up") for row in rows)
    assert sum(row.success for row in rows) >= (1 if name == "theta_star" else 3)  # whose cells are too large for some
