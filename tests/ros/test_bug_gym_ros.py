"""The ROS 2 package: what messages mean, and both nodes talking to one another, with stand-ins for ROS itself."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_stub
from ros_stub import LaserScan, Odometry, PoseStamped, Ros

from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

PACKAGE = Path(__file__).resolve().parents[2] / "ros" / "bug_gym_ros"


@pytest.fixture
def ros(monkeypatch: pytest.MonkeyPatch) -> Iterator[Ros]:
    """A fresh process of ROS, in which the package can be imported."""
    monkeypatch.syspath_prepend(str(PACKAGE))
    before = dict(sys.modules)
    yield ros_stub.install()
    for name in sys.modules.keys() - before.keys():
        if name.split(".")[0] in ("rclpy", "bug_gym_ros") or name.partition(".")[0].endswith(("_msgs", "_srvs")):
            del sys.modules[name]


@pytest.fixture
def translation(ros: Ros) -> Any:
    return importlib.import_module("bug_gym_ros.translation")


def scan(ranges: list[float], first: float = -math.pi, increment: float = 0.0) -> LaserScan:
    """A scan of a whole turn, or of readings that many radians apart."""
    increment = increment or math.tau / len(ranges)
    return LaserScan(
        angle_min=first, angle_max=first + increment * (len(ranges) - 1), angle_increment=increment,
        range_min=0.1, range_max=8.0, ranges=ranges,
    )  # fmt: skip


def odometry(x: float, y: float, heading: float, first: float = 0.0, turn: float = 0.0) -> Odometry:
    message = Odometry()
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(heading / 2), math.cos(heading / 2)
    message.twist.twist.linear.x, message.twist.twist.angular.z = first, turn
    return message


def goal(x: float, y: float) -> PoseStamped:
    message = PoseStamped()
    message.pose.position.x, message.pose.position.y = x, y
    return message


@pytest.mark.parametrize("heading", [-3.0, -1.0, 0.0, 0.5, 2.0, math.pi])
@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.1, -0.2)])
def test_yaw_is_the_heading_of_a_quaternion(translation: Any, heading: float, roll: float, pitch: float) -> None:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_quat()
    assert math.cos(translation.yaw(ros_stub.Quaternion(x, y, z, w)) - heading) == pytest.approx(1.0)


def test_readings_follow_rep_117(translation: Any) -> None:
    bearings, distances = translation.readings(scan([1.0, math.inf, -math.inf, math.nan, 0.01, 9.0]), (0.0, 0.0, 0.0))
    assert distances.tolist() == [1.0, math.inf, 0.1, 0.1, math.inf]
    step = math.tau / 6
    assert np.allclose(np.cos(bearings), np.cos([-math.pi + step * place for place in (0, 1, 2, 4, 5)]))


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (0.2, -0.1, 0.0), (-0.15, 0.05, 2.5)])
def test_points_stay_where_they_are_whatever_the_mount(translation: Any, mount: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(3)
    angles, ranges = rng.uniform(-math.pi, math.pi, 40), rng.uniform(0.5, 5.0, 40)
    points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)])
    offset = points - np.array(mount[:2])[:, None]
    for column in range(40):
        bearing = math.atan2(offset[1, column], offset[0, column]) - mount[2]
        seen = scan([float(np.hypot(*offset[:, column]))], first=bearing, increment=0.1)
        (found_bearing,), (distance,) = translation.readings(seen, mount)
        there = distance * np.array([math.cos(found_bearing), math.sin(found_bearing)])
        assert np.allclose(there, points[:, column])


def test_a_fine_scan_loses_nothing_on_coarse_beams(translation: Any) -> None:
    beams = Sensors.of(load("static")).angles
    rng = np.random.default_rng(5)
    for count in (720, 100, 64, 40):
        ranges = rng.uniform(0.5, 7.0, count)
        bearings, distances = translation.readings(scan(ranges.tolist()), (0.0, 0.0, 0.0))
        found = translation.ranges_along(beams, bearings, distances, math.tau / count)
        assert found.min() == pytest.approx(ranges.min())
        spacing = beams[1] - beams[0]
        for beam, value in zip(beams, found, strict=True):
            apart = np.abs(np.remainder(bearings - beam + math.pi, math.tau) - math.pi)
            assert value <= distances[apart <= spacing / 2].min(initial=np.inf) + 1e-12
            assert value in distances[apart <= max(spacing / 2, math.tau / count) * 1.01]


def test_a_scan_that_does_not_cover_the_beams_is_refused(translation: Any) -> None:
    robot = translation.Robot(load("static"))
    half = scan([2.0] * 100, first=-math.pi / 2, increment=math.pi / 99)
    with pytest.raises(translation.MessageError, match="no reading near the beam at"):
        robot.hear_scan(half, 0.0)
    with pytest.raises(translation.MessageError, match="no reading near"):
        robot.hear_scan(scan([math.nan] * 64), 0.0)


def test_an_observation_says_what_the_messages_said(translation: Any) -> None:
    robot = translation.Robot(load("dynamic"))
    sensors = robot.sensors
    with pytest.raises(translation.MessageError, match="have not all come"):
        robot.observation()
    with pytest.raises(translation.MessageError, match="before any odometry"):
        robot.hear_goal(goal(1.0, 0.0))
    robot.hear_odometry(odometry(10.0, -4.0, math.pi / 2), 0.0)
    assert robot.hear_goal(goal(10.0, -1.0))
    robot.hear_scan(scan([1.5] * len(sensors.angles), first=float(sensors.angles[0])), 0.0)
    robot.hear_odometry(odometry(9.0, -3.0, math.pi, 0.7, -0.3), 0.1)
    view = translation.View(robot.observation(), sensors)
    assert np.allclose(view.ranges, 1.5)
    assert view.goal == pytest.approx((-1.0, -2.0), abs=1e-6)
    assert view.pose == pytest.approx((1.0, 1.0, math.pi / 2), abs=1e-6)
    assert view.velocity == pytest.approx((0.7, -0.3))
    assert view.goal_position == pytest.approx((3.0, 0.0), abs=1e-6)
    assert not robot.hear_goal(goal(11.0, -1.0), moves=True) and robot.hear_goal(goal(11.0, -1.0))


def test_what_a_robot_cannot_tell_is_refused(translation: Any) -> None:
    with pytest.raises(ValueError, match="terrain: a robot's messages do not tell terrain"):
        translation.Robot(load("terrain"))


@pytest.mark.parametrize("name", ["static", "dynamic"])
def test_actions_and_commands_are_each_others_inverse(translation: Any, name: str) -> None:
    simulation = Simulation(name, overrides={"robot.max_acceleration": None})
    drive = Sensors.of(simulation.scenario).drive
    for action in np.random.default_rng(2).uniform(-1, 1, (20, 2)):
        simulation.reset(seeds=[1])
        simulation.step(action[None, None])
        ahead, left, turn = translation.velocities(drive, action)
        second = left if drive.kinematics == "holonomic" else turn
        assert simulation.world.velocity[0, 0] == pytest.approx((ahead, second), abs=1e-6)


def test_speed_ends_before_what_is_ahead(translation: Any) -> None:
    for limit in (0.5, 2.0, math.inf):
        drive = Sensors.of(load("dynamic", {"robot.max_acceleration": None if math.isinf(limit) else limit})).drive
        for room in (0.0, 0.01, 0.3, 2.0):
            speed = translation.greatest_speed(drive, room)
            braking = 0.0 if math.isinf(limit) else speed**2 / (2.0 * limit)
            assert speed * drive.step + braking == pytest.approx(room)
        assert translation.greatest_speed(drive, -0.1) == 0.0


def test_a_robot_before_a_wall_does_not_drive_into_it(translation: Any) -> None:
    robot = translation.Robot(load("dynamic"), clearance=0.05)
    sensors = robot.sensors
    robot.hear_odometry(odometry(0.0, 0.0, 0.0), 0.0)
    robot.hear_goal(goal(5.0, 0.0))
    robot.hear_scan(scan([sensors.radius + 0.04] * len(sensors.angles), first=float(sensors.angles[0])), 0.0)
    ahead, left, turn = robot.command(np.array([1.0, 0.5]))
    assert (ahead, left) == (0.0, 0.0) and turn == 0.5 * sensors.drive.max_turn_rate


def run_both(ros: Ros, steps: int, **parameters: Any) -> tuple[Any, Any]:
    """Both nodes, step by step in turn."""
    ros.parameters.update(parameters)
    policy = importlib.import_module("bug_gym_ros.policy_node").PolicyNode()
    world = importlib.import_module("bug_gym_ros.world_node").WorldNode()
    world.tell()
    for _ in range(steps):
        if world.is_over or (not policy.robot.has_goal and policy.told):
            break
        policy.on_step()
        ros.now += world.timer.period
        world.on_step()
    return policy, world


@pytest.mark.parametrize(
    ("policy", "scenario"), [("bug2", "static"), ("tangent_bug", "dynamic"), ("ppo_dynamic", "dynamic")]
)
def test_a_policy_over_topics_drives_as_it_does_in_the_world(ros: Ros, policy: str, scenario: str) -> None:
    seed = 4
    _, world = run_both(ros, 2000, policy=policy, scenario=scenario, seed=seed, clearance=0.0)
    (row,) = evaluate(policy, scenario, episodes=1, seed=seed)
    assert world.is_over and ros.log[-1] == f"episode {seed} has ended: {row.outcome}"
    found = world.simulation.info()["path_length"][0, 0]
    assert found == pytest.approx(row.path_length, rel=0.01)


def test_a_robot_stands_when_nothing_is_heard(ros: Ros) -> None:
    policy, world = run_both(ros, 5, policy="go_to_goal", scenario="dynamic", patience=0.3)
    assert ros.published["cmd_vel"][-1].linear.x > 0.0
    ros.now += 0.5
    policy.on_step()
    assert ros.published["cmd_vel"][-1] == ros_stub.Twist()
    assert policy.told == "standing: no scan and odometry for 0.3 s"
    for _ in range(7):  # and so does the world's robot, whose commands have ended
        world.on_step()
    assert world.simulation.world.velocity[0, 0].tolist() == pytest.approx([0.0, 0.0], abs=1e-6)


def test_a_verdict_and_an_arrival_end_the_way(ros: Ros) -> None:
    policy, _ = run_both(ros, 3000, policy="bug2", scenario="ring")
    assert policy.told == "given up: unreachable" and not policy.robot.has_goal
    assert ros.published["cmd_vel"][-1] == ros_stub.Twist()


def test_the_package_names_what_it_holds() -> None:
    import ast
    import xml.etree.ElementTree as ElementTree

    written = (PACKAGE / "setup.py").read_text()
    for node in ("policy", "world"):
        module = PACKAGE / "bug_gym_ros" / f"{node}_node.py"
        assert f"{node} = {{NAME}}.{node}_node:main" in written
        assert any(
            isinstance(one, ast.FunctionDef) and one.name == "main" for one in ast.parse(module.read_text()).body
        )
    needed = {one.text for one in ElementTree.parse(PACKAGE / "package.xml").getroot().iter("exec_depend")}
    imported = {
        name.name.split(".")[0] if isinstance(one, ast.Import) else str(one.module).split(".")[0]
        for file in (PACKAGE / "bug_gym_ros").glob("*.py")
        for one in ast.walk(ast.parse(file.read_text()))
        if isinstance(one, (ast.Import, ast.ImportFrom))
        for name in one.names
    }
    assert imported & needed == needed - {"launch_ros"}
    assert all("share/{NAME}/launch" in written for _ in (PACKAGE / "launch").glob("*.py"))
