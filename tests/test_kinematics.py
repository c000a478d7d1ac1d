"""Motion of the robot against exact solutions, and steering: a desired velocity to an action."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bug_gym.kinematics import Drive, differential_action, discrete_actions, discrete_velocities, steering
from bug_gym.simulation import Simulation

F64 = NDArray[np.float64]

STEP = 0.1
DIFFERENTIAL = {"kinematics": "differential", "max_speed": 1.0, "max_reverse": 0.3, "max_turn_rate": 1.5}
HOLONOMIC = {"kinematics": "holonomic", "max_speed": 1.3}


def drive_of(robot: dict[str, Any]) -> Drive:
    """The same robot as its driver knows it."""
    return Drive(
        kinematics=robot["kinematics"],
        max_speed=robot["max_speed"],
        max_reverse=robot.get("max_reverse", 0.3),
        max_turn_rate=robot.get("max_turn_rate", 1.5),
        step=STEP,
    )


def driven(robot: dict[str, Any], actions: Any, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[F64, F64]:
    """Poses (steps + 1, 3) and body velocities (steps + 1, 2) of a robot in a wide empty world."""
    world = {"family": "empty", "bounds": [-900, -900, 900, 900], "start": list(start), "goal": [800, 800]}
    time = {"step": STEP, "limit": 1000.0}
    simulation = Simulation({"robot": robot, "lidar": {"beams": 1}, "time": time, "world": world})
    simulation.reset(seeds=[0])
    poses, velocities = [simulation.world.pose[0, 0].copy()], [simulation.world.velocity[0, 0].copy()]
    for action in np.asarray(actions, dtype=np.float64):
        simulation.step(action[None, None])
        poses.append(simulation.world.pose[0, 0].copy())
        velocities.append(simulation.world.velocity[0, 0].copy())
    return np.array(poses), np.array(velocities)


def wrapped(angle: Any) -> Any:
    """The same angles in (-pi, pi]."""
    return np.angle(np.exp(1j * np.asarray(angle)))


# ------------------------------------------------------------------------------------------------ differential


def action_of(speed: float, rate: float) -> tuple[float, float]:
    """The action whose contract reads: speed scaled to [-0.3, 1.0], turn rate to +-1.5."""
    return (speed + 0.3) / 1.3 * 2.0 - 1.0, rate / 1.5


@pytest.mark.parametrize("rate", [-1.5, -0.4, -1e-3, -1e-5, 0.0, 1e-7, 1e-3, 0.7, 1.5])
@pytest.mark.parametrize("speed", [-0.3, 0.0, 0.5, 1.0])
def test_a_differential_robot_follows_the_exact_arc(speed: float, rate: float) -> None:
    start = (1.0, -2.0, 0.8)
    poses, velocities = driven(DIFFERENTIAL, [action_of(speed, rate)] * 60, start)
    time = STEP * np.arange(61)
    heading = start[2] + rate * time
    if rate == 0.0:
        expected = np.column_stack([1.0 + speed * time * math.cos(0.8), -2.0 + speed * time * math.sin(0.8)])
    else:
        radius = speed / rate
        # 1 - cos and its like by half angles, exact for the smallest rates too.
        middle, chord = start[2] + 0.5 * rate * time, 2.0 * radius * np.sin(0.5 * rate * time)
        expected = np.column_stack([1.0 + chord * np.cos(middle), -2.0 + chord * np.sin(middle)])
    assert np.abs(poses[:, :2] - expected).max() < 1e-9
    assert np.abs(wrapped(poses[:, 2] - heading)).max() < 1e-9
    assert velocities[1:] == pytest.approx(np.tile([speed, rate], (60, 1)), abs=1e-12)


def test_a_differential_robot_under_changing_commands_solves_the_unicycles_equation() -> None:
    rng = np.random.default_rng(0)
    speeds, rates = rng.uniform(-0.3, 1.0, 40), rng.uniform(-1.5, 1.5, 40)
    poses, _ = driven(DIFFERENTIAL, [action_of(v, w) for v, w in zip(speeds, rates, strict=True)])
    state = np.zeros(3)
    for number, (v, w) in enumerate(zip(speeds, rates, strict=True), start=1):

        def unicycle(_t: float, y: F64, v: float = v, w: float = w) -> list[float]:
            return [v * math.cos(y[2]), v * math.sin(y[2]), w]

        state = solve_ivp(unicycle, (0.0, STEP), state, rtol=1e-12, atol=1e-14).y[:, -1]
        assert poses[number, :2] == pytest.approx(state[:2], abs=1e-10)
        assert wrapped(poses[number, 2] - state[2]) == pytest.approx(0.0, abs=1e-10)


def test_the_ends_of_the_action_are_the_limits_of_a_differential_robot() -> None:
    for action, expected in (
        ([1, 0], [1.0, 0.0]),
        ([-1, 0], [-0.3, 0.0]),
        ([1, 1], [1.0, 1.5]),
        ([-1, -1], [-0.3, -1.5]),
    ):
        _, velocities = driven(DIFFERENTIAL, [action])
        assert velocities[1] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("robot", [DIFFERENTIAL, HOLONOMIC])
def test_actions_beyond_one_are_cut(robot: dict[str, Any]) -> None:
    far, _ = driven(robot, [[7.0, -3.0]])
    near, _ = driven(robot, [[1.0, -1.0]])
    assert (far == near).all()


def test_headings_stay_within_half_a_turn() -> None:
    poses, _ = driven(DIFFERENTIAL, [[0.0, 1.0]] * 100)
    assert poses[:, 2].min() >= -math.pi and poses[:, 2].max() <= math.pi
    assert poses[:, 2].min() < -3.0 and poses[:, 2].max() > 3.0


# ------------------------------------------------------------------------------------------------ holonomic


@pytest.mark.parametrize("heading", [0.0, 1.1, -2.7])
def test_a_holonomic_robot_moves_in_its_own_frame_and_does_not_turn(heading: float) -> None:
    """x ahead, y to the left, both over the top speed; what lies outside the unit disc is scaled back into it."""
    actions = [[1.0, 0.0], [0.0, 1.0], [-0.3, 0.4], [1.0, 1.0], [-1.0, 0.2]]
    poses, velocities = driven(HOLONOMIC, actions, (0.0, 0.0, heading))
    place = np.zeros(2)
    turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    for number, action in enumerate(actions, start=1):
        velocity = 1.3 * np.array(action) / max(1.0, math.hypot(*action))
        place = place + turn @ velocity * STEP
        assert velocities[number] == pytest.approx(velocity, abs=1e-12)
        assert poses[number] == pytest.approx([*place, heading], abs=1e-12)


# ------------------------------------------------------------------------------------------------ acceleration


def test_a_differential_robots_speed_changes_no_faster_than_the_limit_and_reaches_what_it_can() -> None:
    rng = np.random.default_rng(1)
    wanted = rng.uniform(-0.3, 1.0, 200)
    robot = {**DIFFERENTIAL, "max_acceleration": 2.0}
    _, velocities = driven(robot, [action_of(speed, 1.5) for speed in wanted])
    speed = 0.0
    for number, target in enumerate(wanted, start=1):
        speed = min(max(target, speed - 0.2), speed + 0.2)
        assert velocities[number] == pytest.approx([speed, 1.5], abs=1e-9), "the limit is one on speed, not on turning"


def test_a_holonomic_robots_velocity_changes_no_faster_than_the_limit_in_any_direction() -> None:
    rng = np.random.default_rng(1)
    actions = rng.uniform(-1.0, 1.0, (200, 2))
    poses, velocities = driven({**HOLONOMIC, "max_acceleration": 3.0}, actions)
    velocity = np.zeros(2)
    for number, action in enumerate(actions, start=1):
        target = 1.3 * action / max(1.0, math.hypot(*action))
        change = target - velocity
        velocity = velocity + change * min(1.0, 0.3 / math.hypot(*change))
        assert velocities[number] == pytest.approx(velocity, abs=1e-9)
    assert np.hypot(*np.diff(velocities, axis=0).T).max() <= 0.3 + 1e-9
    assert np.diff(poses[:, :2], axis=0) == pytest.approx(velocities[1:] * STEP, abs=1e-12)
    assert np.hypot(*velocities.T).max() <= 1.3 + 1e-9


def test_without_a_limit_the_speed_is_there_at_once() -> None:
    for robot in (DIFFERENTIAL, HOLONOMIC):
        _, velocities = driven(robot, [[1.0, 0.0]])
        assert velocities[1, 0] == robot["max_speed"]


# ------------------------------------------------------------------------------------------------ steering


def test_steering_a_holonomic_robot_gives_the_velocity_itself() -> None:
    rng = np.random.default_rng(0)
    for velocity in rng.uniform(-0.9, 0.9, (50, 2)):
        _, velocities = driven(HOLONOMIC, [steering(drive_of(HOLONOMIC), velocity)])
        assert velocities[1] == pytest.approx(velocity, abs=1e-6)


def test_steering_cuts_a_velocity_above_the_top_speed_and_keeps_its_direction() -> None:
    action = steering(drive_of(HOLONOMIC), (30.0, -40.0))
    assert action == pytest.approx([0.6, -0.8])


@pytest.mark.parametrize("heading", np.linspace(-math.pi, math.pi, 13))
@pytest.mark.parametrize("speed", [0.2, 0.9, 50.0])
@pytest.mark.parametrize("rate", [0.5, 1.5, 60.0])
def test_a_differential_robot_that_is_steered_comes_to_the_desired_velocity(
    heading: float, speed: float, rate: float
) -> None:
    robot = {**DIFFERENTIAL, "max_turn_rate": rate}
    drive = drive_of(robot)
    desired = speed * np.array([math.cos(heading), math.sin(heading)])
    world = {"family": "empty", "bounds": [-90, -90, 90, 90], "start": [0, 0, 0], "goal": [80, 80]}
    simulation = Simulation({"robot": robot, "lidar": {"beams": 1}, "time": {"step": STEP}, "world": world})
    simulation.reset(seeds=[0])
    errors = [abs(float(wrapped(heading)))]
    for _ in range(int((math.pi / rate + 3.0) / STEP)):
        now = simulation.world.pose[0, 0, 2]
        frame = np.array([[math.cos(now), math.sin(now)], [-math.sin(now), math.cos(now)]])
        action = steering(drive, frame @ desired)
        assert (np.abs(action) <= 1.0).all() and action.dtype == np.float32
        simulation.step(action[None, None])
        ahead, turning = simulation.world.velocity[0, 0]
        assert -1e-6 <= ahead <= min(speed, 1.0) + 1e-6 and abs(turning) <= rate + 1e-6
        errors.append(abs(float(wrapped(heading - simulation.world.pose[0, 0, 2]))))
        if errors[-2] > math.radians(30.0) + 1e-6:
            assert ahead == pytest.approx(0.0, abs=1e-6), "it stands while it turns"
    assert all(after <= before + 1e-6 for before, after in zip(errors[:-1], errors[1:], strict=True)), "it overshot"
    assert errors[-1] < 1e-3
    assert ahead == pytest.approx(min(speed, 1.0), rel=1e-4)


def test_steering_to_a_standstill_stands() -> None:
    for robot in (DIFFERENTIAL, HOLONOMIC):
        poses, _ = driven(robot, [steering(drive_of(robot), (0.0, 0.0))] * 10)
        assert np.abs(poses).max() < 1e-6


def test_the_action_of_a_speed_and_a_turn_rate_gives_them_cut_to_the_limits() -> None:
    drive = drive_of(DIFFERENTIAL)
    for wanted, expected in (
        ((0.4, -0.7), (0.4, -0.7)),
        ((-0.2, 0.1), (-0.2, 0.1)),
        ((9.0, 9.0), (1.0, 1.5)),
        ((-9.0, -9.0), (-0.3, -1.5)),
    ):
        _, velocities = driven(DIFFERENTIAL, [differential_action(drive, *wanted)])
        assert velocities[1] == pytest.approx(expected, abs=1e-6)


def test_a_robot_that_cannot_reverse_stands_at_the_lower_end_of_its_action() -> None:
    robot = {**DIFFERENTIAL, "max_reverse": 0.0}
    assert steering(drive_of(robot), (0.0, 0.0)) == pytest.approx([-1.0, 0.0])
    _, velocities = driven(robot, [[-1.0, 0.0]])
    assert velocities[1].tolist() == [0.0, 0.0]


# ------------------------------------------------------------------------------------------------ discrete actions


def test_discrete_actions_are_32_headings_of_4_speeds() -> None:
    velocities = discrete_velocities(drive_of(HOLONOMIC))
    assert velocities.shape == (128, 2)
    for i, velocity in enumerate(velocities):
        angle, speed = 2.0 * math.pi * (i // 4) / 32, 1.3 * (i % 4 + 1) / 4
        assert velocity == pytest.approx([speed * math.cos(angle), speed * math.sin(angle)], abs=1e-12)


@pytest.mark.parametrize("robot", [DIFFERENTIAL, HOLONOMIC])
def test_discrete_actions_go_through_steering(robot: dict[str, Any]) -> None:
    drive = drive_of(robot)
    actions = discrete_actions(drive)
    assert actions.shape == (128, 2) and actions.dtype == np.float32 and np.abs(actions).max() <= 1.0
    for i in (0, 3, 17, 64, 100, 127):
        angle, speed = 2.0 * math.pi * (i // 4) / 32, robot["max_speed"] * (i % 4 + 1) / 4
        assert actions[i] == pytest.approx(
            steering(drive, (speed * math.cos(angle), speed * math.sin(angle))), abs=1e-6
        )


def test_discrete_actions_move_a_holonomic_robot_where_they_say() -> None:
    actions = discrete_actions(drive_of(HOLONOMIC))
    for i in range(0, 128, 7):
        poses, _ = driven(HOLONOMIC, [actions[i]], (0.0, 0.0, 0.4))
        angle, way = 0.4 + 2.0 * math.pi * (i // 4) / 32, 1.3 * (i % 4 + 1) / 4 * STEP
        assert poses[1, :2] == pytest.approx([way * math.cos(angle), way * math.sin(angle)], abs=1e-6)


def test_discrete_actions_of_a_car_turn_its_wheels_in_proportion_and_as_far_as_they_go_beside_it() -> None:
    """Headings 0 to 8 of 32 to either side go ahead, the wheels at h / 8; the others back, at so many of 7 from behind."""
    car = Drive("ackermann", 1.0, 0.5, 1.5, STEP, wheelbase=0.3, max_steering=0.6)
    table = discrete_actions(car)
    assert table.shape == (128, 2) and table.dtype == np.float32
    for i, (forward, wheels) in enumerate(table.tolist()):
        heading, share = i // 4, (i % 4 + 1) / 4
        speed = (forward + 1.0) / 2.0 * 1.5 - 0.5
        if heading <= 8 or heading >= 24:
            assert (speed, wheels) == pytest.approx((share * 1.0, (heading if heading <= 8 else heading - 32) / 8))
        else:
            assert (speed, wheels) == pytest.approx((share * -0.5, (16 - heading) / 7), abs=1e-6)
    # At full lock, to the left and to the right of it: ahead beside it, and back just behind that.
    assert table[4 * 8 : 4 * 10, 1].tolist() == [1.0] * 8
    assert table[4 * 23 : 4 * 25, 1].tolist() == [-1.0] * 8
