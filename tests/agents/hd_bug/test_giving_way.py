"""What HD-BUG makes of movers: which it goes behind, which it gives way to, and how."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug.avoid import BEHIND, HABIT, SIDEWAYS, TURN, Movers
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.agents.hd_bug.roll_out import RollOut, Velocities
from bug_gym.simulation import Simulation
from bug_gym.view import View

MOVER_RADIUS = 0.3


def moment(
    *movers: tuple[tuple[float, float], tuple[float, float]], kinematics: str = "holonomic", circles: Any = ()
) -> tuple[Any, Scene, Any, Movers]:
    """The avoidance of a robot at the origin, what it sees, its memory, and movers: places [m] and velocities [m/s]."""
    world = {
        "family": "explicit",
        "bounds": [-40, -40, 40, 40],
        "circles": list(circles),
        "start": [0, 0, 0],
        "goal": [30, 0],
    }
    simulation = Simulation(
        {"world": world, "robot": {"kinematics": kinematics}, "lidar": {"beams": 360, "range": 10.0}}
    )
    policy: Any = make_policy("hd_bug", simulation, predictor="kalman")
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    scene, count = policy.perception.perceive(view, memory), len(movers)
    tracks = scene.tracks._replace(
        id=np.arange(1, count + 1),
        position=np.array([place for place, _ in movers]),
        velocity=np.array([velocity for _, velocity in movers]),
        radius=np.full(count, MOVER_RADIUS),
        moving=np.ones(count, dtype=np.bool_),
    )
    times = policy.avoidance.times
    places = tracks.position[:, None] + tracks.velocity[:, None] * times[:, None]
    memory.reach = 2.0
    return policy.avoidance, Scene(view, tracks), memory, Movers(tracks, places, np.full((count, len(times)), 0.05))


def from_sight(direction: float, place: tuple[float, float]) -> float:
    """Angle of a direction from the line of sight to a place, counter-clockwise [rad]."""
    return math.remainder(direction - math.atan2(place[1], place[0]), 2.0 * math.pi)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("bearing", [0.0, 1.0, -2.5])
def test_it_gives_way_at_a_right_angle_to_the_line_of_sight_away_from_the_motion(bearing: float, side: float) -> None:
    """A mover that crosses to the left of the line of sight is given way to on the right, and the other way round."""
    place = (1.2 * math.cos(bearing), 1.2 * math.sin(bearing))
    course = bearing + math.pi - side * 0.5
    avoidance, scene, memory, movers = moment((place, (0.6 * math.cos(course), 0.6 * math.sin(course))))
    direction, speed = avoidance._react(scene, memory, movers, 0)
    assert abs(from_sight(direction, place) + side * 0.5 * math.pi) <= SIDEWAYS[-1] + 1e-9
    assert speed == avoidance.motion.speeds[0] and not memory.is_backing


def test_where_that_side_is_shut_it_gives_way_to_the_other() -> None:
    """What comes from straight ahead goes to the left a little; the right is shut by a disc that the robot nearly touches."""
    avoidance, scene, memory, movers = moment(((1.5, 0.0), (-0.6, 0.1)), circles=[[0.0, -0.9, 0.6]])
    direction, speed = avoidance._react(scene, memory, movers, 0)
    assert abs(from_sight(direction, (1.5, 0.0)) - 0.5 * math.pi) <= SIDEWAYS[-1] + 1e-9 and speed > 0.0


@pytest.mark.parametrize(("kinematics", "behind", "backs"), [
    ("differential", [], True), ("differential", [[-0.81, 0.0, 0.6]], False), ("holonomic", [], False),
])  # fmt: skip
def test_shut_on_both_sides_it_stands_and_backs_out_of_what_comes_where_it_can(
    kinematics: str, behind: list[list[float]], backs: bool
) -> None:
    walls = [[0.0, -0.9, 0.6], [0.0, 0.9, 0.6], *behind]
    avoidance, scene, memory, movers = moment(((1.5, 0.0), (-0.4, 0.0)), kinematics=kinematics, circles=walls)
    assert avoidance._react(scene, memory, movers, 0) == (scene.view.heading, 0.0)
    assert memory.is_backing == backs


def test_it_does_not_back_into_what_comes_from_behind() -> None:
    """Backing is for where it is hit less likely than standing."""
    walls = [[0.0, -0.9, 0.6], [0.0, 0.9, 0.6]]
    avoidance, scene, memory, movers = moment(((-2.0, 0.0), (0.3, 0.0)), kinematics="differential", circles=walls)
    avoidance._react(scene, memory, movers, 0)
    assert not memory.is_backing


def test_the_threat_is_the_nearest_of_those_that_come_nearer_within_the_margin_and_half_a_seconds_way() -> None:
    goes, comes, farther = ((0.8, 0.0), (0.5, 0.0)), ((0.0, 1.0), (0.0, -0.5)), ((-1.1, 0.0), (0.5, 0.0))
    avoidance, scene, _, movers = moment(goes, farther, comes)
    assert avoidance._threat(scene, movers, 1.0) == 2
    assert moment(goes)[0]._threat(*moment(goes)[1::2], 1.0) is None
    margin = avoidance.parameters.margin + 0.5 * (1.0 + 0.5) + MOVER_RADIUS + avoidance.sensors.radius
    for off, found in ((-0.01, 0), (0.01, None)):
        avoidance, scene, _, movers = moment(((margin + off, 0.0), (-0.5, 0.0)))
        assert avoidance._threat(scene, movers, 1.0) == found


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_behind_a_mover_is_on_the_side_that_it_comes_from(side: float) -> None:
    """Of two velocities that mirror one another only that is told apart, and only ahead, for one that goes."""
    avoidance, scene, memory, movers = moment(((6.0, 0.0), (0.0, 0.2 * side)))
    turned = np.radians([40.0, -40.0, 140.0, -140.0, 40.0, -40.0])
    velocities = Velocities(turned, np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0]), np.full(6, np.inf))
    behind = avoidance._is_behind(scene, movers, velocities)
    assert behind.tolist() == [side < 0.0, side > 0.0, False, False, False, False]
    direction, _ = avoidance._anticipate(scene, memory, movers, (0.0, 1.0), (30.0, 0.0))[0]
    costs = memory.costs[:-1].reshape(32, -1)
    left, right = costs[1:16], costs[:16:-1]
    ahead = np.arange(1, 16) < 8
    np.testing.assert_allclose((left - right)[ahead], side * BEHIND * memory.reach, atol=1e-6)
    np.testing.assert_allclose((left - right)[~ahead][1:], 0.0, atol=1e-6)
    assert math.sin(direction) * side < 0.0


def test_a_turn_from_the_last_direction_costs_by_its_angle() -> None:
    avoidance, scene, memory, movers = moment(((-8.0, 0.0), (-0.2, 0.0)))
    costs = []
    for memory.direction in (0.0, 0.5):
        avoidance._anticipate(scene, memory, movers, (0.0, 1.0), (30.0, 0.0))
        costs.append(memory.costs[:-1].reshape(32, -1)[:, 0])
    headings = np.arange(32) * math.pi / 16
    apart = [np.abs(np.angle(np.exp(1j * (headings - before)))) for before in (0.0, 0.5)]
    np.testing.assert_allclose(
        costs[1] - costs[0], avoidance.parameters.beta * HABIT * (apart[1] - apart[0]), atol=1e-9
    )


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_robot_that_has_to_turn_to_its_place_has_more_left_to_go(kinematics: str) -> None:
    avoidance, *_ = moment(((5.0, 0.0), (0.0, 0.0)), kinematics=kinematics)
    turns = np.array([0.0, 1.0, -2.0, math.pi])
    ends = np.column_stack([np.zeros((4, 2)), turns])
    rest = avoidance._rest(RollOut(np.full(4, np.inf), np.zeros(4), ends, np.zeros(4)), (3.0, 0.0))
    drive = avoidance.drive
    turning = 0.0 if kinematics == "holonomic" else TURN * drive.max_speed / drive.max_turn_rate
    np.testing.assert_allclose(rest, 3.0 + turning * np.abs(turns))


def test_to_be_at_the_goal_early_is_worth_the_way_that_it_could_have_gone() -> None:
    avoidance, *_ = moment(((5.0, 0.0), (0.0, 0.0)))
    ends, early = np.array([[0.1, 0.0, 0.0]] * 3), np.array([0.0, 0.1, 0.4])
    rest = avoidance._rest(RollOut(np.full(3, np.inf), np.zeros(3), ends, early), (0.2, 0.0))
    np.testing.assert_allclose(rest, [0.1, -0.1 * avoidance.drive.max_speed, -0.4 * avoidance.drive.max_speed])
