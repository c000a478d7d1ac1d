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
from numpy.typing import NDArray
from ros_stub import Header, LaserScan, Odometry, PoseStamped, Ros, Time

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
    bearings, distances = translation.readings(scan([1.0, math.inf, -math.inf, math.nan, 0.01, 9.0]))
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
        (there,) = translation.points(*translation.readings(seen, mount[2]), mount[:2])
        assert np.allclose(there, points[:, column])


def test_a_fine_scan_loses_nothing_on_coarse_beams(translation: Any) -> None:
    beams = Sensors.of(load("static")).angles
    rng = np.random.default_rng(5)
    for count in (720, 100, 64, 40):
        ranges = rng.uniform(0.5, 7.0, count)
        bearings, distances = translation.readings(scan(ranges.tolist()))
        found = translation.ranges_along(beams, bearings, distances, math.tau / count)
        assert found.min() == pytest.approx(ranges.min())
        spacing = beams[1] - beams[0]
        for beam, value in zip(beams, found, strict=True):
            apart = np.abs(np.remainder(bearings - beam + math.pi, math.tau) - math.pi)
            assert value <= distances[apart <= spacing / 2].min(initial=np.inf) + 1e-12
            assert value in distances[apart <= max(spacing / 2, math.tau / count) * 1.01]


POSTS = ((0.0, 0.9, 0.3), (-0.7, -0.3, 0.2), (1.5, -1.0, 0.3), (3.0, 1.2, 0.5))
"""x, y and radius of round posts [m]."""
WALL = 2.2
"""A wall lies along y = 2.2 m, in part behind a post."""
REACH = 5.0
"""Of the scanner of `static` [m]."""


def free_way(place: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """By plain geometry: how far it is from places (..., 2) along angles (...) to a post or the wall [m]."""
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    with np.errstate(divide="ignore"):
        free = np.where(along[..., 1] > 0.0, (WALL - place[..., 1]) / along[..., 1], np.inf)
    for x, y, radius in POSTS:
        there = np.array([x, y]) - place
        middle = (there * along).sum(axis=-1)
        inside = radius**2 - (there**2).sum(axis=-1) + middle**2
        free = np.minimum(free, np.where((inside >= 0.0) & (middle > 0.0), middle - np.sqrt(np.abs(inside)), np.inf))
    return free


def seen_way(mount: tuple[float, float, float], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """By plain geometry: how far beams from the centre run in sight of the scanner, to a centimetre [m]."""
    steps = np.arange(0.0, REACH + 0.01, 0.01)
    scanner = np.array(mount[:2])
    apart = np.stack([np.outer(np.cos(angles), steps), np.outer(np.sin(angles), steps)], axis=-1) - scanner
    bearings = np.arctan2(apart[..., 1], apart[..., 0])
    hidden = np.hypot(apart[..., 0], apart[..., 1]) > free_way(scanner, bearings)
    return np.where(hidden.any(axis=1), steps[hidden.argmax(axis=1)], REACH)


def scan_from(mount: tuple[float, float, float], count: int) -> LaserScan:
    """What a scanner that sits there sees of the posts and the wall, in a whole turn."""
    angles = np.asarray(-math.pi + math.tau / count * np.arange(count) + mount[2], dtype=np.float64)
    free = free_way(np.array(mount[:2]), angles)
    return scan(np.where(free < 8.0, free, np.inf).tolist())


def ranges_of(robot: Any, seen: LaserScan) -> NDArray[np.float64]:
    """What a policy gets to see of a scan [m]."""
    robot.hear_odometry(odometry(0.0, 0.0, 0.0), 0.0)
    robot.hear_goal(goal(4.0, 0.0))
    robot.hear_scan(seen, 0.0)
    view = importlib.import_module("bug_gym.view").View(robot.observation(), robot.sensors)
    return np.asarray(view.ranges, dtype=np.float64)


MOUNTS = [(0.1, 0.0, 0.0), (0.2, -0.1, 0.0), (-0.15, 0.05, 2.5), (0.3, 0.0, math.pi), (0.0, -0.25, -1.0)]


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("count", [64, 200, 720])
def test_a_scanner_beside_the_centre_says_what_is_free(
    translation: Any, mount: tuple[float, float, float], count: int
) -> None:
    robot = translation.Robot(load("static"), mount=mount)
    found, beams = ranges_of(robot, scan_from(mount, count)), robot.sensors.angles
    fine = np.linspace(-math.pi, math.pi, 1440, endpoint=False)
    free, seen = np.minimum(free_way(np.zeros(2), fine), REACH), seen_way(mount, fine)
    half = math.pi / count  # of the scanner's increment; seen from the centre, things near it are wider apart
    width = half * (1.0 + math.hypot(*mount[:2]) / np.minimum(free, seen)) + 0.005
    for beam, value in zip(beams, found, strict=True):
        apart = np.abs(np.remainder(fine - beam + math.pi, math.tau) - math.pi)
        assert value <= free[apart <= width].max() + 0.02, "longer than what is free"
        assert value >= seen[apart <= width + robot.sensors.beam_spacing / 2.0].min() - 0.02, (
            "shorter than what is seen"
        )


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("count", [64, 200, 720])
def test_a_scanner_beside_the_centre_keeps_its_hits(
    translation: Any, mount: tuple[float, float, float], count: int
) -> None:
    robot = translation.Robot(load("static"), mount=mount)
    seen = scan_from(mount, count)
    found, hits = ranges_of(robot, seen), 0
    for place, distance in enumerate(seen.ranges):
        angle = seen.angle_min + seen.angle_increment * place + mount[2]
        x, y = mount[0] + distance * math.cos(angle), mount[1] + distance * math.sin(angle)
        if math.isfinite(distance) and math.hypot(x, y) < REACH:
            apart = np.remainder(robot.sensors.angles - math.atan2(y, x) + math.pi, math.tau) - math.pi
            assert found[np.abs(apart).argmin()] <= math.hypot(x, y) + 1e-5
            hits += 1
    assert 0 < hits < count


@pytest.mark.parametrize("ahead", [0.1, 0.15, 0.2, 0.3])
@pytest.mark.parametrize("far", [0.6, 0.8, 1.0, 1.5, 2.0])
def test_a_lone_post_is_no_gap_in_a_scan(
    translation: Any, monkeypatch: pytest.MonkeyPatch, ahead: float, far: float
) -> None:
    monkeypatch.setitem(globals(), "POSTS", ((0.0, far, 0.3),))
    monkeypatch.setitem(globals(), "WALL", math.inf)
    robot = translation.Robot(load("static"), mount=(ahead, 0.0, 0.0))
    found = ranges_of(robot, scan_from((ahead, 0.0, 0.0), 360))
    assert found.min() == pytest.approx(far - 0.3, abs=0.01)
    assert robot.sensors.angles[found.argmin()] == pytest.approx(math.pi / 2, abs=0.1)
    assert (found[np.sin(robot.sensors.angles) < -0.01] == REACH).all()


def test_a_scanner_beside_the_centre_may_miss_readings_but_no_beam(translation: Any) -> None:
    mount = (0.2, 0.0, 0.0)
    robot = translation.Robot(load("static"), mount=mount)
    whole = scan_from(mount, 360)
    every_other = [math.nan if place % 2 else value for place, value in enumerate(whole.ranges)]
    assert np.isclose(ranges_of(robot, scan(every_other)), ranges_of(robot, whole), rtol=0.1).mean() > 0.9
    with pytest.raises(translation.MessageError, match="no reading near the beam at 186 degrees, one of 3 without"):
        robot.hear_scan(scan([math.nan] * 20 + whole.ranges[20:]), 0.0)
    assert (ranges_of(robot, scan([math.inf] * 360)) == REACH).all()


def test_a_hit_beside_a_gap_hides_half_the_way_to_its_neighbour_and_one_increment_of_the_gap(translation: Any) -> None:
    bearings = 0.1 * np.arange(-10, 11)
    distances = np.append(np.full(20, np.inf), 1.0)
    beams = np.array([0.78, 0.91, 1.04])
    for turned in (1, -1):  # the gap is behind the last reading, or before the first
        found = translation.ranges_along(
            turned * beams[::turned], turned * bearings[::turned], distances[::turned], 0.1, (0.2, 0.0)
        )[::turned]
        edge = 1.0 + 0.1 * 1.001
        hit = math.hypot(0.2 + math.cos(1.0), math.sin(1.0))
        assert found[0] == np.inf and hit - 0.02 < found[1] <= hit
        assert found[2] == pytest.approx(0.2 * math.sin(edge) / math.sin(edge - beams[2]))  # the sine rule


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


def at(message: Any, when: float) -> Any:
    """The message, stamped [s]."""
    message.header.stamp = Time(*divmod(round(when * 1e9), 10**9))
    return message


def test_a_goal_may_come_before_odometry(translation: Any) -> None:
    robot = translation.Robot(load("static"))
    robot.hear_scan(scan([1.5] * 64), 0.0)
    assert robot.hear_goal(goal(10.0, -1.0)) and robot.has_goal and not robot.is_there
    robot.hear_odometry(odometry(10.0, -4.0, math.pi / 2), 0.0)
    robot.hear_odometry(odometry(9.0, -3.0, math.pi), 0.1)
    view = translation.View(robot.observation(), robot.sensors)
    assert view.pose == pytest.approx((1.0, 1.0, math.pi / 2), abs=1e-6)
    assert view.goal == pytest.approx((-1.0, -2.0), abs=1e-6)


def heard_until(translation: Any, when: float) -> Any:
    """A robot on its way to a goal, all of whose messages are stamped with that time [s]."""
    robot = translation.Robot(load("static"))
    robot.hear_odometry(at(odometry(7.0, 0.0, 0.0), when), when)
    assert robot.hear_goal(at(goal(9.0, 0.0), when))
    robot.hear_scan(at(scan([1.5] * 64), when), when)
    return robot


@pytest.mark.parametrize("since", [10.0, 9.0, 0.0])
def test_a_restart_forgets_what_was_stamped_before(translation: Any, since: float) -> None:
    robot = heard_until(translation, 9.0)
    robot.restart(since)
    assert not robot.has_goal and robot.silent(9.1) == "scan and odometry"
    assert robot.hear_goal(at(goal(3.0, 0.0), 10.0), moves=True)
    robot.hear_odometry(at(odometry(1.0, 0.0, 0.0), 10.0), 10.0)
    with pytest.raises(translation.MessageError, match="have not all come"):
        robot.observation()
    robot.hear_scan(at(scan([2.5] * 64), 10.0), 10.0)
    view = translation.View(robot.observation(), robot.sensors)
    assert view.pose == (0.0, 0.0, 0.0) and view.goal == (2.0, 0.0) and np.allclose(view.ranges, 2.5)


def test_a_restart_counts_from_its_stamp_whatever_comes_first(translation: Any) -> None:
    robot = heard_until(translation, 9.0)
    robot.hear_goal(at(goal(3.0, 0.0), 10.1), moves=True)  # of after the restart, of which word comes later
    robot.hear_odometry(at(odometry(1.0, 0.0, 0.0), 10.1), 10.1)
    robot.restart(10.0)
    robot.hear_odometry(at(odometry(7.0, 0.0, 0.0), 9.9), 10.2)  # of before it, and late
    robot.hear_scan(at(scan([1.5] * 64), 9.9), 10.2)
    with pytest.raises(translation.MessageError, match="before the reset"):
        robot.hear_goal(at(goal(9.0, 0.0), 9.9))
    assert robot.has_goal and robot.silent(10.2) == "scan"
    robot.hear_scan(scan([2.5] * 64), 10.1)  # a scanner that does not stamp
    view = translation.View(robot.observation(), robot.sensors)
    assert view.pose == (0.0, 0.0, 0.0) and view.goal == (2.0, 0.0) and np.allclose(view.ranges, 2.5)


def nodes(ros: Ros, *, world_first: bool = False, **parameters: Any) -> tuple[Any, Any]:
    """Both nodes, the world's robot having told once what it senses."""
    ros.parameters.update(parameters)
    make_policy = importlib.import_module("bug_gym_ros.policy_node").PolicyNode
    policy = None if world_first else make_policy()
    world = importlib.import_module("bug_gym_ros.world_node").WorldNode()
    world.tell()
    return policy or make_policy(), world


def drive(ros: Ros, policy: Any, world: Any, steps: int) -> None:
    """Step by step in turn, until the episode or the way ends."""
    for _ in range(steps):
        if world.is_over or (not policy.robot.has_goal and policy.told):
            break
        policy.on_step()
        ros.now += world.timer.period
        world.on_step()


def run_both(ros: Ros, steps: int, **parameters: Any) -> tuple[Any, Any]:
    """Both nodes, step by step in turn."""
    policy, world = nodes(ros, **parameters)
    drive(ros, policy, world, steps)
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


def test_a_world_that_starts_first_is_heard(ros: Ros) -> None:
    ros.now = 5.0
    policy, world = nodes(ros, world_first=True, policy="bug2", scenario="static", seed=4)
    assert policy.robot.has_goal
    world.tell()  # odometry and scan come again, the goal does not
    drive(ros, policy, world, 2000)
    assert ros.log[-1] == "episode 4 has ended: success" and len(ros.published["goal_pose"]) == 1


def test_the_goal_of_a_world_is_heard_once(ros: Ros) -> None:
    ros.now = 5.0
    policy, _ = nodes(ros, policy="bug2", scenario="static")
    (told,) = ros.published["goal_pose"]
    assert ros.log == [f"going to {told.pose.position.x:.2f}, {told.pose.position.y:.2f}"]
    policy.state = "memory"
    again = ros_stub.Node("rviz").create_publisher(PoseStamped, "goal_pose", 10)  # as RViz, which keeps no messages
    again.publish(at(goal(told.pose.position.x, told.pose.position.y), 6.0))
    assert policy.state is None and len(ros.log) == 2


def test_a_robot_without_a_goal_says_once_that_it_stands(ros: Ros) -> None:
    ros.parameters.update(policy="bug2", scenario="static")
    policy = importlib.import_module("bug_gym_ros.policy_node").PolicyNode()
    for _ in range(3):
        policy.on_scan(scan([math.nan] * 64))
        policy.on_step()
    assert [line[:24] for line in ros.log] == ["the scan has no reading ", "standing: no goal yet"]
    policy.on_odometry(odometry(0.0, 0.0, 0.0))
    policy.on_goal(goal(0.0, 0.0))
    policy.on_scan(scan([2.0] * 64))
    policy.on_step()
    policy.on_step()
    assert ros.log[2:] == ["going to 0.00, 0.00", "arrived"]
    policy.on_goal(goal(0.0, 0.0))  # the same again, from someone who does not stamp
    assert ros.log[4:] == ["going to 0.00, 0.00"] and policy.robot.has_goal
    for _ in range(2):
        policy.on_reset(Header())
        policy.on_step()
    assert ros.log[5:] == ["reset", "standing: no goal yet"] * 2


def commands_of_episode(ros: Ros, first: int, seed: int, policy: str) -> list[tuple[float, float]]:
    """What is driven in the episode of a seed by nodes that were started for the first one."""
    pair = nodes(ros, policy=policy, scenario="rush", seed=first, moving_goal=True)
    for number in range(first, seed):
        drive(ros, *pair, 3000)
        assert ros.log[-1] == f"episode {number} has ended: collision"
        pair[1].on_reset(None, None)
        assert ros.published["reset"] == [Header(Time(*divmod(round(ros.now * 1e9), 10**9)), "odom")]
        assert pair[0].state is None and not pair[0].robot.has_goal
        pair[1].tell()
    ros.published.clear()
    drive(ros, *pair, 3000)
    assert pair[1].is_over
    return [(one.linear.x, one.angular.z) for one in ros.published["cmd_vel"]]


@pytest.mark.parametrize("policy", ["bug2", "tangent_bug"])
def test_after_a_reset_a_policy_drives_as_if_it_had_just_started(ros: Ros, policy: str) -> None:
    again = commands_of_episode(ros, 1, 2, policy)
    assert len(again) > 1 and commands_of_episode(ros_stub.install(), 2, 2, policy) == again


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
