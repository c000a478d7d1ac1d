"""What the map allows of a velocity: whatever is wished, what is cleared touches nothing, and what is free is left alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bug_gym.agents.planning.clear_step import clear_velocity, swept
from bug_gym.agents.planning.live import LiveMap
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.kinematics import Drive, steering
from bug_gym.reproductions.still_things import drive as drive_still
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

SQUARE = np.array([[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]])
WALL = (np.array([[1.0, -1.0], [1.2, -1.0], [1.2, 1.0], [1.0, 1.0]]),)


def a_drive(kinematics: str, acceleration: float) -> Drive:
    return Drive(kinematics, 2.0, 0.3, 1.5, 0.1, acceleration)


@pytest.mark.parametrize("kinematics", ["holonomic", "differential", "ackermann"])
@pytest.mark.parametrize("acceleration", [None, 2.0])
@pytest.mark.parametrize("world", ["static", "maze"])
def test_whatever_is_wished_what_is_cleared_touches_nothing(
    kinematics: str, acceleration: float | None, world: str
) -> None:
    random = np.random.default_rng([3, len(kinematics), len(world)])
    robot: dict[str, Any] = {"robot.kinematics": kinematics, "robot.max_speed": 2.0, "time.step": 0.1}
    robot |= {"robot.max_acceleration": acceleration, "time.limit": 1e4, "lidar.beams": 16}
    cut = 0
    for seed in range(6):
        simulation = Simulation(world, overrides=robot)
        flat = simulation.reset(seeds=[seed])[0, 0]
        sensors = Sensors.of(simulation.scenario)
        live, wish = LiveMap.of(simulation.world, 0, 0), (2.0, 0.0)
        for step in range(300):
            if step % 15 == 0:  # long enough to come to a wall
                angle = random.uniform(-math.pi, math.pi)
                wish = 2.0 * math.cos(angle), 2.0 * math.sin(angle)
            if kinematics != "holonomic" and step % 15 == 4:
                wish = (2.0, 0.0)
            own = View(flat, sensors).own_velocity
            clear = clear_velocity(live.still, live.pose, own, wish, sensors.drive, sensors.radius)
            cut += clear != wish
            result = simulation.step(steering(sensors.drive, clear)[None, None])
            flat = result.observation[0, 0]
            if result.terminated[0, 0]:
                assert math.dist(live.pose[:2], live.goal) <= sensors.goal_radius, (seed, step)
                break
    assert cut > 50


def test_what_is_free_is_left_alone() -> None:
    still = PlanningMap(SQUARE, np.array([[0.0, 2.0, 0.5]]), (WALL,))
    for kinematics in ("holonomic", "differential"):
        drive = a_drive(kinematics, math.inf)
        wish = (1.0, 0.0)
        assert clear_velocity(still, (0.0, 0.0, 0.0), (1.0, 0.0), wish, drive, 0.2) == wish
        # 0.2 m beside the wall after the step, which leaves 0.002 m less than is kept.
        assert clear_velocity(still, (0.7, 0.0, 0.0), (1.0, 0.0), wish, drive, 0.2) == (0.5, 0.0)
        assert clear_velocity(still, (0.79, 0.0, 0.0), (1.0, 0.0), wish, drive, 0.2)[0] <= 1e-6
        assert clear_velocity(still, (0.0, 1.2, 0.5 * math.pi), (1.0, 0.0), wish, drive, 0.2) == (0.5, 0.0)


def test_a_robot_that_is_nearer_than_its_disc_comes_no_nearer_and_gets_away() -> None:
    still, drive = PlanningMap(SQUARE, np.zeros((0, 3)), (WALL,)), a_drive("holonomic", math.inf)
    here = (0.9, 0.0, 0.0)
    assert clear_velocity(still, here, (0.0, 0.0), (-1.0, 0.0), drive, 0.2) == (-1.0, 0.0)
    assert clear_velocity(still, here, (0.0, 0.0), (0.0, 1.0), drive, 0.2) == (0.0, 1.0)
    assert clear_velocity(still, here, (0.0, 0.0), (1.0, 0.0), drive, 0.2) == (0.0, 0.0)


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_what_is_swept_ends_where_the_robot_stands(kinematics: str, speed: float) -> None:
    drive = a_drive(kinematics, 2.0)
    places = swept(drive, (1.0, 2.0, 0.3), (speed, 0.0), (speed, 0.0))
    way = speed * drive.step + speed**2 / (2.0 * 2.0)
    np.testing.assert_allclose(places[-1], (1.0 + way * math.cos(0.3), 2.0 + way * math.sin(0.3)))
    np.testing.assert_allclose(places[0], (1.0, 2.0))


def test_a_turn_is_swept_along_its_arc() -> None:
    drive = a_drive("differential", math.inf)
    places = swept(drive, (0.0, 0.0, 0.0), (1.0, 0.0), (math.cos(0.3), math.sin(0.3)))
    rate, speed = min(4.0 * 0.3, 1.5), math.cos(0.3)
    bend = speed / rate
    turned = rate * drive.step
    np.testing.assert_allclose(places[-1], (bend * math.sin(turned), bend * (1.0 - math.cos(turned))), atol=1e-4)


@pytest.mark.parametrize("seed", [118, 176, 298, 586])
@pytest.mark.parametrize("policy", ["d2t_dijkstra", "d2t_eaco"])
def test_d2t_touches_no_corner_that_lies_between_the_beams(policy: str, seed: int) -> None:
    assert drive_still(policy, seed).outcome != "collision"


def test_the_clearance_of_a_chain() -> None:
    still = PlanningMap(SQUARE, np.array([[0.0, 2.0, 0.5]]), (WALL,))
    chain = np.array([[0.0, 0.0], [0.0, 1.0], [-4.0, 1.0]])
    assert still.is_clear(chain, 0.499) and not still.is_clear(chain, 0.501)  # the disc
    assert still.is_clear(np.array([[0.0, 0.0], [0.5, 0.0]]), 0.499)  # the wall
    assert not still.is_clear(np.array([[0.0, 0.0], [0.5, 0.0]]), 0.501)
    assert still.is_clear(np.array([[0.0, 0.0], [0.0, -4.0]]), 0.999)  # the border
    assert not still.is_clear(np.array([[0.0, 0.0], [0.0, -4.0]]), 1.001)
