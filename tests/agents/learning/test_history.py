"""The memory of learned policies: what has changed, with the robot's own motion taken out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.learning.history import TOP_SPEED, History, history_width, with_history
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.config import load
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

BEAMS = 360
ROBOT = {"robot.kinematics": "differential", "lidar.beams": BEAMS, "lidar.noise": 0.0, "lidar.range": 20.0}
EVERYWHERE, NOWHERE = np.array([True]), np.array([False])


def walled(**world: Any) -> Simulation:
    """A robot in a bare square of 10 m, so that each beam sees a smooth wall."""
    family = {"family": "explicit", "bounds": [-5, -5, 5, 5], "start": [0, 0, 0.3], "goal": [4, 4], **world}
    simulation = Simulation({"world": family}, overrides=ROBOT)
    simulation.reset(seeds=[0])
    return simulation


def drive(simulation: Simulation, actions: Any, lags: tuple[int, ...]) -> list[NDArray[np.float32]]:
    """What a History tells after each of the actions."""
    history = History(RobotModel.of(Sensors.of(simulation.scenario)), lags, 1)
    history.add(simulation.observations()[:, 0], EVERYWHERE)
    return [history.add(simulation.step([[action]]).observation[:, 0], NOWHERE)[0] for action in actions]


@pytest.mark.parametrize("action", [[1.0, 0.0], [0.2, 1.0], [-1.0, -1.0]])
def test_a_still_world_leaves_nothing_however_the_robot_moves(action: list[float]) -> None:
    told = drive(walled(), [action] * 8, (4,))[-1]
    # Ranges are read between two beams a degree apart: off by less than a centimetre in 0.4 s but in the corners.
    assert np.percentile(np.abs(told[:BEAMS]), 95) < 0.02
    np.testing.assert_allclose(told[BEAMS:], 0.0, atol=1e-4)


def test_an_obstacle_that_comes_up_is_seen_with_its_speed_and_one_that_leaves_with_the_other_sign() -> None:
    for velocity, sign in ((-0.5, 1.0), (0.5, -1.0)):
        mover = {"shape": {"circle": 0.5}, "at": [2.5, 0.0], "motion": {"law": "bounce", "velocity": [velocity, 0.0]}}
        simulation = walled(movers=[mover], start=[0, 0, 0])
        told = drive(simulation, [[-0.5384615, 0.0]] * 6, (4,))[-1]  # standing: reverse is 0.3 of 1.3 m/s
        assert told[0] == pytest.approx(sign * 0.5, abs=0.01)


def test_the_goals_velocity_is_told_in_the_robots_frame() -> None:
    heading = 0.8
    target = {"at": [3.0, 0.0], "motion": {"law": "bounce", "velocity": [0.3, -0.2]}}
    family = {"family": "explicit", "bounds": [-8, -8, 8, 8], "start": [0, 0, heading], "target": target}
    simulation = Simulation({"world": family}, overrides=ROBOT)
    simulation.reset(seeds=[0])
    told = drive(simulation, [[0.6, 0.0]] * 6, (5,))[-1]
    cos, sin = math.cos(heading), math.sin(heading)
    expected = [0.3 * cos - 0.2 * sin, -0.3 * sin - 0.2 * cos]
    np.testing.assert_allclose(told[BEAMS:], expected, atol=2e-3)


def test_the_start_of_an_episode_has_no_past() -> None:
    simulation = Simulation("rush", 3)
    simulation.reset(seeds=[0, 1, 2])
    robot = RobotModel.of(Sensors.of(simulation.scenario))
    history = History(robot, (2, 3), 3)
    flat = simulation.observations()[:, 0]
    assert np.abs(history.add(flat, np.ones(3, dtype=bool))).max() < 1e-4
    for _ in range(4):
        flat = simulation.step(np.ones((3, 1, 2))).observation[:, 0]
        history.add(flat, np.zeros(3, dtype=bool))
    flat = simulation.step(np.ones((3, 1, 2))).observation[:, 0]
    told = history.add(flat, np.array([False, True, False]))
    assert np.abs(told[1]).max() < 1e-4
    assert np.abs(told[0]).max() > 0.1 and np.abs(told[2]).max() > 0.1


def test_rows_do_not_know_one_another_and_a_look_takes_nothing_in() -> None:
    simulation = Simulation("rush", 3)
    flat = simulation.reset(seeds=[0, 1, 2])[:, 0]
    robot = RobotModel.of(Sensors.of(simulation.scenario))
    together, alone = History(robot, (1, 3), 3), History(robot, (1, 3), 1)
    starts = np.ones(3, dtype=bool)
    for _ in range(6):
        told = together.add(flat, starts)
        np.testing.assert_array_equal(told[2], alone.add(flat[2:], starts[2:])[0])
        starts = np.zeros(3, dtype=bool)
        flat = simulation.step(np.full((3, 1, 2), 0.5)).observation[:, 0]
    looked = together.peek(flat[1:2], np.array([1]))
    np.testing.assert_array_equal(together.add(flat, starts)[1], looked[0])


def test_speeds_are_cut_and_the_width_is_what_is_said() -> None:
    simulation = Simulation("rush", 2)
    robot = RobotModel.of(Sensors.of(simulation.scenario))
    flat = simulation.reset(seeds=[0, 1])[:, 0]
    history = History(robot, (1, 4), 2)
    history.add(flat, np.ones(2, dtype=bool))
    far = flat.copy()
    far[:, :64] = 0.0
    told = history.add(far, np.zeros(2, dtype=bool))
    assert told.shape == (2, history_width(robot, (1, 4)))
    assert told.max() == TOP_SPEED and told.dtype == np.float32


def test_a_saved_history_goes_on_as_it_was() -> None:
    simulation = Simulation("rush", 2)
    robot = RobotModel.of(Sensors.of(simulation.scenario))
    history = History(robot, (2,), 2)
    flats = [simulation.reset(seeds=[0, 1])[:, 0]]
    flats += [simulation.step(np.ones((2, 1, 2))).observation[:, 0] for _ in range(8)]
    never = np.zeros(2, dtype=bool)
    for flat in flats[:4]:
        history.add(flat, never)
    saved = history.save()
    first = [history.add(flat, never) for flat in flats[4:]]
    history.restore(saved)
    np.testing.assert_array_equal(first, [history.add(flat, never) for flat in flats[4:]])


@pytest.mark.parametrize(
    ("overrides", "lags", "said"), [({}, (0,), "at least 1"), ({"lidar.fov": 3.0}, (2,), "all around")]
)
def test_a_history_that_cannot_be_is_refused(overrides: dict[str, Any], lags: tuple[int, ...], said: str) -> None:
    robot = RobotModel.of(Sensors.of(load("static", overrides)))
    with pytest.raises(ValueError, match=said):
        History(robot, lags, 1)


def test_the_memory_of_other_robots_is_refused() -> None:
    simulation = Simulation("rush", 3)
    flat = simulation.reset(seeds=[0, 1, 2])[:, 0]
    robot = RobotModel.of(Sensors.of(simulation.scenario))
    seen, state = with_history(flat, None, None, robot=robot, lags=(4,))
    assert seen.shape == (3, robot.width + history_width(robot, (4,)))
    with pytest.raises(ValueError, match="memory of 3 robots for 2"):
        with_history(flat[:2], state, None, robot=robot, lags=(4,))


def test_a_policy_without_lags_sees_the_observations_as_they_are() -> None:
    simulation = Simulation("rush", 2)
    flat = simulation.reset(seeds=[0, 1])[:, 0]
    robot = RobotModel.of(Sensors.of(simulation.scenario))
    seen, state = with_history(flat, None, None, robot=robot, lags=())
    assert seen is flat and state is None
