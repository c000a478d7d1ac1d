"""What scans showed a moment ago counts beside what the last one shows, and who cannot stop in time gets past."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.inertia import needs_care, scans_kept, shown_points, stoppable_action
from bug_gym.kinematics import asked_velocity
from bug_gym.navigation_env import NavigationEnv
from bug_gym.reproductions.still_things import drive as drive_still
from bug_gym.view import Sensors, View


def sensors_of(**values: Any) -> Sensors:
    """Of a robot with keys such as `robot__max_speed`."""
    return Sensors.of(load("empty", {key.replace("__", "."): value for key, value in values.items()}))


def observed(
    sensors: Sensors,
    pose: tuple[float, float, float],
    velocity: tuple[float, float],
    ranges: float | NDArray[Any] = 1e3,
) -> NDArray[np.float32]:
    """An observation of a robot; nothing is seen unless ranges [m] say so."""
    flat = np.zeros(sensors.fields[-1].end, dtype=np.float32)
    for name, value in (("ranges", np.minimum(ranges, sensors.range)), ("pose", pose), ("velocity", velocity)):
        (field,) = (one for one in sensors.fields if one.name == name)
        flat[field.begin : field.end] = value
    return flat


# -- Who remembers -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "scans"),
    [
        ({}, 0),  # the robot of the scenarios stops at once
        ({"lidar__noise": 0.01, "lidar__beams": 64}, 0),
        ({"lidar__noise": 0.03, "lidar__beams": 32}, 3),
        ({"lidar__dropout": 0.05, "lidar__beams": 32}, 3),  # what the lost beam would have met shows in the next scan
        ({"lidar__dropout": 0.05, "lidar__beams": 180}, 0),
        ({"robot__max_acceleration": 1.0, "lidar__beams": 720}, 0),  # each scan shows all
        ({"robot__max_acceleration": 1.0, "lidar__beams": 32}, 3),
        ({"robot__max_acceleration": 1.0, "lidar__beams": 32, "time__step": 0.05}, 6),
        ({"robot__max_acceleration": 1.0, "lidar__beams": 32, "time__step": 0.5}, 1),
        ({"robot__max_acceleration": 1.0, "lidar__beams": 720, "lidar__dropout": 0.05}, 3),
        ({"robot__max_acceleration": 1.0, "lidar__beams": 720, "lidar__noise": 0.02}, 3),
    ],
)
def test_scans_are_kept_where_one_alone_may_hide_something(values: dict[str, Any], scans: int) -> None:
    assert scans_kept(sensors_of(**values)) == scans


def test_a_policy_keeps_as_many_scans_as_count_and_where_their_points_were() -> None:
    values = {"robot.max_acceleration": 1.0, "robot.kinematics": "differential", "lidar.beams": 32, "lidar.noise": 0.0}
    env = NavigationEnv(load("static", values), observation="flat")
    policy: Any = make_policy("bug2", env)
    observation, _ = env.reset(seed=3)
    state: Any = None
    seen = []
    for number in range(25):
        seen.append(shown_points(View(observation, policy.sensors)))
        action, state = policy.predict(observation, state)
        assert len(state[0].lately) == min(number + 1, 3)
        observation, *_ = env.step(action)
    for kept, shown in zip(state[0].lately, seen[-3:], strict=True):
        np.testing.assert_array_equal(kept, shown)
    view = View(observation, policy.sensors, lately=state[0].lately)
    x, y, _ = view.points_of_late
    own = len(view.points[0])
    places = [view.to_odometry(*place) for place in zip(x[own:].tolist(), y[own:].tolist(), strict=True)]
    np.testing.assert_allclose(places, np.concatenate(state[0].lately, axis=1).T, atol=1e-6)


def test_a_robot_that_needs_no_memory_keeps_none() -> None:
    env = NavigationEnv("static", observation="flat")
    policy: Any = make_policy("bug2", env)
    observation, _ = env.reset(seed=3)
    _, state = policy.predict(observation)
    assert state[0].lately == []


# -- What it is good for -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_tip_that_lies_between_the_beams_now_stops_the_robot_as_it_did(kinematics: str) -> None:
    sensors = sensors_of(robot__max_acceleration=1.0, robot__kinematics=kinematics, lidar__beams=32)
    pose, wish = (3.0, -2.0, 0.5), (sensors.drive.max_speed, 0.0)
    tip = np.array([[3.0 + 0.22 * math.cos(0.5)], [-2.0 + 0.22 * math.sin(0.5)]])
    flat = observed(sensors, pose, (0.0, 0.0))
    free = asked_velocity(sensors.drive, stoppable_action(View(flat, sensors), wish, 0.0))
    assert free[0] > 0.5
    stopped = asked_velocity(sensors.drive, stoppable_action(View(flat, sensors, lately=[tip]), wish, 0.0))
    assert stopped[0] == pytest.approx(0.0, abs=1e-6)
    behind = 2.0 * np.array([[pose[0]], [pose[1]]]) - tip
    past = asked_velocity(sensors.drive, stoppable_action(View(flat, sensors, lately=[behind]), wish, 0.0))
    assert past[0] == pytest.approx(free[0])


RADIUS, STEP, MOST = 0.2, 0.05, 1.0


def nearest_pass(sensors: Sensors, speed: float, tip: tuple[float, float], *, brakes: bool) -> float:
    """How near the middle of a robot comes to a tip [m] that has seen it too late; plain physics, step by step.

    Args:
        sensors: of a robot.
        speed: its own, along x, when it sees the tip [m/s].
        tip: where that is [m].
        brakes: whether it does nothing but brake.
    """
    (x, y, heading), (vx, vy) = (0.0, 0.0, 0.0), (speed, 0.0)
    drive, nearest = sensors.drive, math.inf
    for _ in range(200):
        is_holonomic = drive.kinematics == "holonomic"
        own = (vx, vy) if is_holonomic else (math.hypot(vx, vy), 0.0)
        view = View(observed(sensors, (x, y, heading), own), sensors, lately=[np.array([[tip[0]], [tip[1]]])])
        asked = asked_velocity(drive, stoppable_action(view, (drive.max_speed, 0.0), 0.0))
        if is_holonomic:
            asked = (0.0, 0.0) if brakes else asked
            change = asked[0] - vx, asked[1] - vy
            share = min(MOST * STEP / max(math.hypot(*change), 1e-12), 1.0)
            vx, vy = vx + share * change[0], vy + share * change[1]
        else:
            speed = max(own[0] - MOST * STEP, 0.0)
            heading += 0.0 if brakes else asked[1] * STEP
            vx, vy = speed * math.cos(heading), speed * math.sin(heading)
        for part in np.linspace(0.1, 1.0, 10).tolist():
            nearest = min(nearest, math.dist((x + part * vx * STEP, y + part * vy * STEP), tip))
        x, y = x + vx * STEP, y + vy * STEP
        if math.hypot(vx, vy) < 1e-9:
            break
    return nearest


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_who_cannot_stop_in_time_gets_past(kinematics: str, side: float) -> None:
    sensors = sensors_of(
        robot__max_acceleration=MOST,
        robot__kinematics=kinematics,
        robot__max_speed=2.0,
        time__step=STEP,
        lidar__beams=32,
    )
    # It needs 0.5 m to stand, and has 0.45 m to a tip that is 0.17 m beside its way.
    tip = (0.45 + math.sqrt(RADIUS**2 - 0.17**2), side * 0.17)
    assert nearest_pass(sensors, 1.0, tip, brakes=True) < RADIUS
    assert nearest_pass(sensors, 1.0, tip, brakes=False) > RADIUS


# -- Long steps --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kinematics", ["holonomic", "differential", "ackermann"])
def test_a_long_step_ends_before_what_may_go_on_beside_a_point(kinematics: str) -> None:
    robot = {"robot__kinematics": kinematics, "robot__max_speed": 2.0, "time__step": 0.2, "lidar__noise": 0.0}
    sensors = sensors_of(**robot, lidar__beams=32)
    gap = sensors.beam_spacing
    (beam,) = np.flatnonzero(np.isclose(sensors.angles % (2.0 * math.pi), 2.0 * math.pi - 3.0 * gap))
    for way in (0.44, 0.5, 0.6, 0.8, 1.5):
        ranges = np.full(32, 1e3)
        ranges[beam] = way
        view = View(observed(sensors, (0.0, 0.0, 0.0), (0.0, 0.0), ranges), sensors)
        ahead, left = asked_velocity(sensors.drive, stoppable_action(view, (2.0, 0.0), 0.0))
        assert left == pytest.approx(0.0, abs=1e-6)
        point = way * math.cos(3.0 * gap), -way * math.sin(3.0 * gap)
        kept = sensors.radius + gap * way
        # The largest eighth whose end keeps off; a quarter at least, after which the beams will show more.
        eighths = [part / 8 for part in range(8, 2, -1) if passed(part / 8 * 2.0 * 0.2, point) > kept + 0.005]
        assert ahead / 2.0 == pytest.approx(eighths[0] if eighths else 0.25, abs=1e-6)
    assert ahead == pytest.approx(2.0)  # far away


def passed(way: float, point: tuple[float, float]) -> float:
    """How near to a point a robot comes on so much way along x [m]."""
    return math.hypot(point[0] - min(max(point[0], 0.0), way), point[1])


def test_robots_of_the_scenarios_step_short_enough() -> None:
    assert not needs_care(sensors_of(lidar__noise=0.0, lidar__beams=64))
    assert not needs_care(sensors_of(lidar__noise=0.0, lidar__beams=32, robot__max_speed=0.5))
    assert needs_care(sensors_of(lidar__noise=0.0, lidar__beams=32))
    assert needs_care(sensors_of(lidar__noise=0.01, lidar__beams=64))


# -- Worlds in which it mattered ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("policy", "seed"),
    [
        ("vis_bug_21", 136),  # a sharp corner between two of 32 beams
        ("vis_bug_22", 219),  # a corner that noise moved away as the robot set out toward it
        ("tangent_bug", 366),  # the end of a wall between beams that scatter, of a robot that stops at once
        ("hd_bug", 366),
        ("velocity_obstacle", 387),
        ("hd_bug", 399),
        ("vis_bug_21", 1090),  # the same behind a beam that is lost
        ("class1", 1090),
        ("dwa", 1090),  # it stood beside a wall, and the one beam that showed it was lost
        ("dwa", 1436),
        ("bug1", 1670),  # it came nearer to a corner by less than what was eased, step by step
        ("dwa", 1883),
        ("minimum_risk", 1538),  # a corner between a beam that met it and one that went past, of a robot with inertia
        ("hd_bug_map", 1838),
        ("hd_bug_map", 727),  # the end of a wall a long step ahead, which the beam beside it misses
    ],
)
def test_corners_that_scans_hide_are_not_touched(policy: str, seed: int) -> None:
    assert drive_still(policy, seed).outcome != "collision"
