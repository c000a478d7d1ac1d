"""Robots that steer: closed forms of the bicycle model, limits, faces alike, and policies that drive them."""

from __future__ import annotations

import math
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray
from pettingzoo.test import parallel_api_test

from bug_gym import kernels
from bug_gym.agents import make_policy
from bug_gym.agents.sb3 import make_vec_env
from bug_gym.config import ScenarioError, dump, load
from bug_gym.evaluation import evaluate
from bug_gym.geometry import F64
from bug_gym.inertia import foreseen
from bug_gym.kinematics import asked_velocity, differential_action, discrete_actions, steering
from bug_gym.manoeuvring import Turn, arc_action, begun, gone_on
from bug_gym.navigation_env import NavigationEnv
from bug_gym.policy import MisfitError, braking_radius
from bug_gym.robots_env import parallel_env
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv
from bug_gym.view import Sensors, View

CAR: dict[str, Any] = {"kinematics": "ackermann", "wheelbase": 0.3, "max_steering": 0.6, "max_reverse": 0.5}
WIDE: dict[str, Any] = {"family": "empty", "bounds": [-90, -90, 90, 90], "start": [1.0, 2.0, 0.7], "goal": [80, 80]}
STATIC = {"robot.kinematics": "ackermann"}
LEAST_BEND = 0.3 / math.tan(0.6)


def scenario(robot: dict[str, Any] | None = None, **parts: Any) -> dict[str, Any]:
    """A car in a wide empty world."""
    return {"robot": {**CAR, **(robot or {})}, "lidar": {"beams": 8}, "world": WIDE, **parts}


def action(speed: float, angle: float) -> tuple[float, float]:
    """The action whose contract reads: speed scaled to [-0.5, 1.0], steering angle to +-0.6."""
    return (speed + 0.5) / 1.5 * 2.0 - 1.0, angle / 0.6


def driven(described: dict[str, Any], actions: Any) -> tuple[F64, F64]:
    """Poses (steps + 1, 3) and velocities (steps + 1, 2) of a car."""
    simulation = Simulation(described)
    simulation.reset(seeds=[0])
    poses, velocities = [simulation.world.pose[0, 0].copy()], [simulation.world.velocity[0, 0].copy()]
    for pair in actions:
        simulation.step(np.array(pair)[None, None])
        poses.append(simulation.world.pose[0, 0].copy())
        velocities.append(simulation.world.velocity[0, 0].copy())
    return np.array(poses), np.array(velocities)


# ------------------------------------------------------------------------------------------------ the bicycle model


@pytest.mark.parametrize("angle", [0.6, -0.6, 0.2, -0.05])
@pytest.mark.parametrize("speed", [1.0, 0.4, -0.5])
def test_the_rear_axle_goes_on_a_circle_of_wheelbase_over_tangent(speed: float, angle: float) -> None:
    poses, velocities = driven(scenario(), [action(speed, angle)] * 50)
    bend = 0.3 / math.tan(angle)
    x, y, heading = poses[0]
    centre = np.array([x - bend * math.sin(heading), y + bend * math.cos(heading)])
    np.testing.assert_allclose(np.hypot(*(poses[:, :2] - centre).T), abs(bend), atol=1e-12)
    turned = np.unwrap(poses[:, 2]) - heading
    np.testing.assert_allclose(turned, speed / bend * 0.1 * np.arange(51), atol=1e-12)
    np.testing.assert_allclose(velocities[1:], [[speed, speed / bend]] * 50, atol=1e-12)


def test_wheels_straight_ahead_lead_straight_on() -> None:
    poses, _ = driven(scenario(), [action(1.0, 0.0)] * 20)
    expected = poses[0, :2] + 0.1 * np.arange(21)[:, None] * [math.cos(0.7), math.sin(0.7)]
    np.testing.assert_allclose(poses[:, :2], expected, atol=1e-12)
    np.testing.assert_array_equal(poses[:, 2], poses[0, 2])


def test_it_drives_as_a_differential_robot_that_turns_by_speed_tan_angle_over_wheelbase() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.uniform(-1.0, 1.0, (2, 80))
    speed, angle = 0.75 * first + 0.25, 0.6 * second
    rate = speed * np.tan(angle) / 0.3
    alike = {"kinematics": "differential", "max_turn_rate": 4.0, "max_reverse": 0.5}
    other = {**scenario(), "robot": alike}
    mine, theirs = (
        driven(scenario(), zip(first, second, strict=True)),
        driven(other, zip(first, rate / 4.0, strict=True)),
    )
    for ours, reference in zip(mine, theirs, strict=True):
        np.testing.assert_allclose(ours, reference, atol=1e-12)


def test_nothing_turns_it_on_the_spot() -> None:
    poses, velocities = driven(scenario(), [action(0.0, 0.6)] * 5)
    np.testing.assert_allclose(poses, poses[:1].repeat(6, axis=0), atol=1e-15)
    np.testing.assert_allclose(velocities, 0.0, atol=1e-15)


def test_a_limited_acceleration_changes_the_speed_and_keeps_the_arc() -> None:
    poses, velocities = driven(scenario({"max_acceleration": 2.0}), [action(1.0, 0.3)] * 8)
    np.testing.assert_allclose(velocities[:7, 0], [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(velocities[:, 1], velocities[:, 0] * math.tan(0.3) / 0.3, atol=1e-12)
    bend, (x, y, heading) = 0.3 / math.tan(0.3), poses[0]
    centre = np.array([x - bend * math.sin(heading), y + bend * math.cos(heading)])
    np.testing.assert_allclose(np.hypot(*(poses[:, :2] - centre).T), bend, atol=1e-12)


def test_a_late_action_is_the_same_one_later() -> None:
    rng = np.random.default_rng(5)
    actions = rng.uniform(-1.0, 1.0, (20, 2))
    now, late = driven(scenario(), actions)[0], driven(scenario({"latency": 0.3}), actions)[0]
    np.testing.assert_array_equal(late[:4], late[:1].repeat(4, axis=0))
    np.testing.assert_allclose(late[3:], now[:-3], atol=1e-12)


def test_odometry_without_noise_is_the_way_that_was_driven_and_its_bias_is_counted() -> None:
    for bias in (0.0, 0.1):
        described = scenario(odometry={"translation_bias": bias}, goal={"sensing": "odometry"})
        simulation = Simulation(described)
        simulation.reset(seeds=[0])
        for _ in range(30):
            simulation.step(np.array([[action(1.0, 0.2)]]))
        (x, y, heading), odometry = simulation.world.pose[0, 0] - (1.0, 2.0, 0.7), simulation.world.array("odometry")[0]
        cos, sin = math.cos(0.7), math.sin(0.7)
        expected = (1.0 + bias) * np.array([cos * x + sin * y, cos * y - sin * x])
        np.testing.assert_allclose(odometry, [*expected, heading], atol=1e-12)


@pytest.mark.parametrize("circles", [None, [[0.3, 0.0, 0.17], [0.0, 0.0, 0.17]]])
def test_contact_is_found_on_the_whole_arc(circles: Any) -> None:
    # A peg on the circle that the body sweeps, but for its last part: some step ends just where it first touches.
    robot = {"circles": circles} if circles else {"radius": 0.2}
    foremost, radius = (0.3, 0.17) if circles else (0.0, 0.2)
    sweep = math.hypot(LEAST_BEND, foremost)
    peg = [sweep * math.sin(2.0), LEAST_BEND - sweep * math.cos(2.0), 0.05]
    world = {"family": "explicit", "circles": [peg], "start": [0, 0, 0], "goal": [8, 8]}
    simulation = Simulation({**scenario(robot), "world": world})
    simulation.reset(seeds=[0])
    while simulation.world.outcome[0, 0] == kernels.RUNNING:
        simulation.step(np.array([[action(1.0, 0.6)]]))
    assert simulation.world.outcome[0, 0] == kernels.COLLISION
    x, y, heading = simulation.world.pose[0, 0]
    nose = np.array([x + foremost * math.cos(heading), y + foremost * math.sin(heading)])
    assert np.hypot(*(nose - peg[:2])) == pytest.approx(radius + 0.05, abs=2e-5)


# ------------------------------------------------------------------------------------------------ what a driver does


@pytest.fixture(scope="module")
def drive() -> Any:
    return Sensors.of(load(scenario())).drive


def test_an_action_asks_for_the_speed_and_rate_that_made_it(drive: Any) -> None:
    for speed, angle in ((1.0, 0.6), (-0.5, -0.3), (0.2, 0.0)):
        rate = speed * math.tan(angle) / 0.3
        np.testing.assert_allclose(differential_action(drive, speed, rate), action(speed, angle), atol=1e-6)
        np.testing.assert_allclose(asked_velocity(drive, action(speed, angle)), (speed, rate), atol=1e-12)
    np.testing.assert_allclose(differential_action(drive, 0.0, 1.0), action(0.0, 0.0), atol=1e-6)
    assert drive.least_bend == pytest.approx(LEAST_BEND) and drive.max_turn_rate == pytest.approx(1.0 / LEAST_BEND)


def test_discrete_actions_steer_ahead_and_back_alike_to_both_sides(drive: Any) -> None:
    table = discrete_actions(drive)
    assert table.shape == (128, 2) and np.abs(table).max() <= 1.0
    speeds, wheels = 0.75 * table[:, 0] + 0.25, table[:, 1]
    fast = np.arange(3, 128, 4)
    np.testing.assert_allclose(
        speeds[fast], np.where(np.abs((np.arange(32) + 16) % 32 - 16) <= 8, 1.0, -0.5), atol=1e-6
    )
    assert wheels[3] == 0.0 and wheels[8 * 4] == 1.0 and wheels[24 * 4] == -1.0 and wheels[16 * 4] == 0.0
    mirrored = (-np.arange(32) % 32) * 4
    np.testing.assert_allclose(wheels[mirrored], -wheels[np.arange(32) * 4], atol=1e-7)
    # What goes toward a heading behind brings the robot to that side.
    for heading in (12, 20):
        poses, _ = driven({**scenario(), "world": {**WIDE, "start": [0, 0, 0]}}, [table[heading * 4 + 3]] * 5)
        assert poses[-1, 0] < 0.0 and (poses[-1, 1] > 0.0) == (heading < 16)


def test_steering_comes_round_to_what_lies_behind(drive: Any) -> None:
    for bearing in (0.0, 0.5, -2.0, math.pi):
        first, second = steering(drive, (math.cos(bearing), math.sin(bearing)))
        assert 0.75 * first + 0.25 >= 0.5 - 1e-6
        assert math.copysign(1.0, second) == math.copysign(1.0, bearing) or bearing == 0.0


def test_what_a_late_command_finds_is_where_the_robot_will_be() -> None:
    described = load(scenario({"latency": 0.3, "max_acceleration": 4.0}))
    simulation = Simulation(described)
    simulation.reset(seeds=[0])
    rng = np.random.default_rng(2)
    sent = [rng.uniform(-1.0, 1.0, 2).astype(np.float32) for _ in range(9)]
    for one in sent[:6]:
        simulation.step(one.astype(np.float64)[None, None])
    view = View(simulation.world.observation[0, 0], Sensors.of(described), sent[3:6])
    ahead, (x, y, heading) = foreseen(view), simulation.world.pose[0, 0].copy()
    for one in sent[6:]:
        simulation.step(one.astype(np.float64)[None, None])
    dx, dy, turn = simulation.world.pose[0, 0] - (x, y, heading)
    cos, sin = math.cos(heading), math.sin(heading)
    np.testing.assert_allclose((ahead.x, ahead.y), (cos * dx + sin * dy, cos * dy - sin * dx), atol=1e-6)
    assert math.remainder(ahead.turn - turn, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


def swept_gap(x: F64, y: F64, circles: F64, curvature: float, direction: int, way: float) -> float:
    """Least gap between points and circles of a body at many places of an arc [m]."""
    along = direction * np.linspace(0.0, way, 3000)
    turn = curvature * along
    px = np.where(curvature, np.sin(turn) / (curvature or 1.0), along)
    py = np.where(curvature, (1.0 - np.cos(turn)) / (curvature or 1.0), 0.0)
    least = math.inf
    for cx, cy, radius in circles:
        at = px + np.cos(turn) * cx - np.sin(turn) * cy, py + np.sin(turn) * cx + np.cos(turn) * cy
        least = min(least, float(np.hypot(x[:, None] - at[0], y[:, None] - at[1]).min()) - radius)
    return least


def test_a_body_goes_on_an_arc_as_far_as_it_touches_nothing() -> None:
    rng = np.random.default_rng(0)
    circles = np.array([[0.0, 0.1, 0.17], [0.3, -0.1, 0.15]])
    blocked = 0
    for _ in range(150):
        x, y = rng.uniform(-2.0, 2.0, (2, 6))
        if min(float(np.hypot(x - cx, y - cy).min()) - radius for cx, cy, radius in circles) < 0.02:
            continue
        curvature, direction = float(rng.choice([0.0, rng.uniform(-2.3, 2.3)])), int(rng.choice([-1, 1]))
        free = kernels.free_arc(x, y, circles, 0.01, direction, curvature, 1.5)
        grown = circles + [0.0, 0.0, 0.01]
        assert swept_gap(x, y, grown, curvature, direction, free) >= -1e-9
        if free < 1.5:
            blocked += 1
            assert swept_gap(x, y, grown, curvature, direction, free) <= 1e-3
    assert blocked > 20


# ------------------------------------------------------------------------------------------------ faces


def test_all_faces_give_the_same_numbers() -> None:
    rng = np.random.default_rng(7)
    actions = rng.uniform(-1.0, 1.0, (40, 2)).astype(np.float32)
    env = NavigationEnv("dynamic", STATIC, observation="flat")
    vector = NavigationVectorEnv(2, scenario="dynamic", overrides=STATIC, observation="flat")
    sb3 = make_vec_env("BugGym/Navigation-v0", 2, scenario="dynamic", overrides=STATIC, seed=0)
    robots = parallel_env("dynamic", overrides=STATIC, observation="flat")
    single, _ = env.reset(seed=0)
    many, _ = vector.reset(seed=0)
    several, _ = robots.reset(seed=0)
    stacked = sb3.reset()
    for pair in [None, *actions]:
        if pair is not None:
            single, reward, ended, cut, info = env.step(pair)
            many, rewards, *_ = vector.step(np.stack([pair, pair]))
            several, shared, *_ = robots.step({"robot_0": pair})
            stacked, sb3_rewards, *_ = sb3.step(np.stack([pair, pair]))
            assert reward == rewards[0] == shared["robot_0"] and np.float32(reward) == sb3_rewards[0]
            if ended or cut:
                break
        assert env.observation_space.contains(single)
        for other in (many[0], several["robot_0"], flat_of(stacked)):
            np.testing.assert_array_equal(single, other)


def flat_of(stacked: Any) -> NDArray[np.float32]:
    """The first row of SB3's observations as one vector."""
    if isinstance(stacked, dict):
        return np.concatenate([np.ravel(stacked[key][0]) for key in ("ranges", "goal", "pose", "velocity")])
    return np.asarray(stacked[0])


def test_checkers_of_gymnasium_pettingzoo_and_sb3_find_nothing() -> None:
    from stable_baselines3.common.env_checker import check_env as check_sb3

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make("BugGym/Navigation-v0", scenario="ackermann").unwrapped, skip_render_check=True)
        check_sb3(NavigationEnv("ackermann", action="discrete", observation="flat"))
    pair = parallel_env("circle_swap", overrides={**STATIC, "robots.count": 2})
    parallel_api_test(pair, num_cycles=20)


def test_ppo_trains_on_it() -> None:
    from stable_baselines3 import PPO

    envs = make_vec_env("BugGym/Navigation-v0", 4, scenario="ackermann", seed=0)
    model = PPO("MultiInputPolicy", envs, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    model.learn(64)
    assert model.num_timesteps == 64


def test_a_branch_goes_on_as_its_origin_and_a_saved_state_comes_back() -> None:
    simulation = Simulation("dynamic", overrides=STATIC)
    simulation.reset(seeds=[4])
    rng = np.random.default_rng(1)
    for pair in rng.uniform(-1.0, 1.0, (5, 2)):
        simulation.step(pair[None, None])
    branches, saved = simulation.branches(3), simulation.snapshot()
    actions = rng.uniform(-1.0, 1.0, (6, 2))
    for pair in actions:
        simulation.step(pair[None, None])
        branches.step(np.broadcast_to(pair, (3, 1, 2)))
    after = simulation.world.floats[0].copy()
    np.testing.assert_array_equal(branches.world.pose, np.broadcast_to(simulation.world.pose, (3, 1, 3)))
    simulation.restore(saved)
    for pair in actions:
        simulation.step(pair[None, None])
    np.testing.assert_array_equal(simulation.world.floats[0], after)


def test_numbers_that_are_drawn_differ_from_world_to_world_and_keep_their_arc() -> None:
    robot = {"wheelbase": {"uniform": [0.2, 0.6]}, "max_steering": {"uniform": [0.2, 0.6]}}
    simulation = Simulation(scenario(robot), 8)
    simulation.reset(seeds=range(8))
    for _ in range(3):
        simulation.step(np.ones((8, 1, 2)))
    wheelbase, most = simulation.world.drawn.T
    assert len(set(wheelbase)) == 8 and simulation.world.drawn_keys == ("robot.wheelbase", "robot.max_steering")
    # An action is a share of what any robot of the scenario can do, cut to this one's own.
    np.testing.assert_allclose(simulation.world.velocity[:, 0, 1], np.tan(most) / wheelbase, rtol=1e-12)
    assert (simulation.world.observation[:, 0, -1] <= simulation.fields[-1].high[1]).all()


# ------------------------------------------------------------------------------------------------ what is refused


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ({"wheelbase": 0.0}, "robot.wheelbase: got 0.0, expected a number above 0"),
        ({"wheelbase": -0.3}, "robot.wheelbase: got -0.3, expected a number above 0"),
        ({"max_steering": math.pi / 2}, r"robot.max_steering: got 1.57.*, expected at most 1.5"),
        ({"max_steering": 0.0}, "robot.max_steering: got 0.0, expected a number above 0"),
        ({"wheelbase": 1e-3, "max_steering": 1.5}, "robot.wheelbase: got 0.001, with which the robot turns by up to"),
        ({"wheel_base": 0.3}, "unknown key, did you mean 'wheelbase'"),
        ({"kinematics": "ackerman"}, "did you mean 'ackermann'"),
    ],
)
def test_what_no_robot_can_be_is_refused_in_a_line(robot: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message) as refused:
        load(scenario(robot))
    assert "\n" not in str(refused.value)


def test_a_scenario_comes_back_as_it_was_and_others_do_not_tell_of_wheels() -> None:
    for described in (scenario(), scenario({"wheelbase": {"uniform": [0.2, 0.4]}}), "ackermann"):
        assert load(dump(load(described))) == load(described)
    assert "wheelbase" not in load("static").model_dump(mode="json")["robot"]
    kept = load("static", {"robot.wheelbase": 0.5})
    assert load(dump(kept)) == kept


@pytest.mark.parametrize("name", ["bug1", "navigator", "ppo_static"])
def test_who_cannot_drive_it_is_refused_in_a_line(name: str) -> None:
    pytest.importorskip("onnxruntime")
    with pytest.raises(MisfitError, match="ackermann") as refused:
        make_policy(name, load("static", STATIC))
    assert "\n" not in str(refused.value)


def test_a_team_is_refused() -> None:
    with pytest.raises(MisfitError, match="turns on the spot, which an ackermann robot cannot"):
        make_policy("com1_rev3", load("warehouse_team", STATIC))


# ------------------------------------------------------------------------------------------------ policies


@pytest.mark.parametrize("name", ["bug2", "tangent_bug", "a_star"])
def test_policies_drive_through_still_worlds_without_a_contact(name: str) -> None:
    rows = evaluate([name], ["static"], episodes=4, overrides=STATIC)
    assert [row.outcome for row in rows] == ["success"] * 4


@pytest.mark.parametrize("name", ["dwa", "mppi"])
def test_policies_that_plan_arcs_touch_nothing(name: str) -> None:
    rows = evaluate([name], ["static"], episodes=2, overrides=STATIC)
    assert "collision" not in [row.outcome for row in rows] and rows[0].success


@pytest.mark.parametrize("overrides", [{"robot.latency": 0.2}, {"robot.max_acceleration": 1.0}])
def test_late_and_heavy_cars_touch_nothing_still(overrides: dict[str, Any]) -> None:
    rows = evaluate(["tangent_bug"], ["ackermann"], episodes=3, overrides=overrides)
    assert "collision" not in [row.outcome for row in rows]


BOX = {
    "family": "explicit",
    "bounds": [-10, -10, 10, 10],
    "polygons": [[[-1, -3], [1, -3], [1, 3], [-1, 3]]],
    "start": [-6, 0.2, 0],
    "goal": [6, 0],
}
CHAIN = [[0.0, 0.0, 0.155], [0.165, 0.0, 0.155], [0.33, 0.0, 0.155]]
LONG = {"wheelbase": 0.33, "max_steering": 0.42, "circles": CHAIN}


@pytest.mark.parametrize("name", ["bug0", "com1", "dist_bug", "hd_bug_map"])
@pytest.mark.parametrize(
    "robot", [LONG, {"wheelbase": 0.33, "max_steering": 0.42, "radius": 0.2}], ids=["long", "round"]
)
def test_a_wall_faced_squarely_is_gone_round_and_a_small_goal_met(name: str, robot: dict[str, Any]) -> None:
    described = {
        "robot": {**CAR, **robot},
        "lidar": {"beams": 180, "range": 6.0},
        "goal": {"radius": 0.1},
        "time": {"limit": 60.0},
        "world": BOX,
    }
    (row,) = evaluate([name], described, episodes=1)
    assert row.success


@pytest.mark.parametrize(("bearing", "moves"), [(0.6, 2), (-1.2, 4), (2.0, 5), (-3.1, 8)])
def test_a_turn_in_several_moves_ends_where_it_began(bearing: float, moves: int) -> None:
    # A post ahead leaves no arc on which it could turn at once.
    posts = [[0.42, 0.0, 0.1]]
    world = {"family": "explicit", "circles": posts, "start": [0, 0, 0], "goal": [8, 8]}
    simulation = Simulation(scenario(lidar={"beams": 360}, world=world))
    simulation.reset(seeds=[0])
    sensors, turn, driven, way = Sensors.of(simulation.scenario), None, [], []
    for _ in range(200):
        view = View(simulation.world.observation[0, 0], sensors)
        wish = (math.cos(bearing), math.sin(bearing))
        radius = sensors.radius + 0.02
        turn = begun(view, wish, radius) if turn is None else gone_on(view, turn, radius, None)
        if turn is None:
            break
        speed, rate = turn.arc(view)
        driven.append((turn.side, turn.direction))
        simulation.step(differential_action(sensors.drive, speed, rate).astype(float)[None, None])
        way.append(simulation.world.pose[0, 0].copy())
    assert simulation.world.outcome[0, 0] == kernels.RUNNING
    assert turn is None and driven
    x, y, heading = simulation.world.pose[0, 0]
    assert abs(math.remainder(heading - bearing, 2.0 * math.pi)) < math.radians(2.5)
    assert all(side in (0, math.copysign(1, bearing)) for side, _ in driven)
    changes = sum(one != other for one, other in pairwise([pair for pair in driven if pair[0]]))
    assert 1 <= changes < moves + 2
    # A move swings by half its turn, so what is left beside its place is of the third order of it.
    assert math.hypot(x, y) < 0.15 and np.hypot(*np.array(way)[:, :2].T).max() < 0.5


@pytest.mark.parametrize("beams", [60, 120, 360])
@pytest.mark.parametrize("gap", np.linspace(0.03, 0.15, 13).tolist())
def test_a_turn_goes_on_the_other_way_where_inertia_lets_no_move_begin(gap: float, beams: int) -> None:
    """Before a wall, whose next point may lie between two beams: what its brake keeps is more than what bounds an arc."""
    wall = [[0.2 + gap, -3.0], [1.0 + gap, -3.0], [1.0 + gap, 3.0], [0.2 + gap, 3.0]]
    world = {"family": "explicit", "polygons": [wall], "start": [0, 0, 0.2], "goal": [-8, 8]}
    simulation = Simulation(scenario({"max_acceleration": 0.5}, lidar={"beams": beams}, world=world))
    simulation.reset(seeds=[0])
    sensors, stands = Sensors.of(simulation.scenario), 0
    radius, room = braking_radius(sensors), 0.02
    turn: Turn | None
    turn = Turn((0.0, 0.0), 1.6, 1, 1, 0.4, 1.2)
    for _ in range(600):
        view = View(simulation.world.observation[0, 0], sensors)
        turn = gone_on(view, turn, radius, room)
        if turn is None:
            break
        action = arc_action(view, (0.0, 1.0), None, radius, room, turn.arc(view))
        simulation.step(action.astype(float)[None, None])
        stands = stands + 1 if simulation.world.velocity[0, 0, 0] == 0.0 else 0
        assert stands < 5, "it stands, and its move is kept"
    assert turn is None and simulation.world.outcome[0, 0] == kernels.RUNNING


def test_no_turn_begins_where_an_arc_ahead_does() -> None:
    simulation = Simulation(scenario(lidar={"beams": 90}))
    simulation.reset(seeds=[0])
    sensors = Sensors.of(simulation.scenario)
    view = View(simulation.world.observation[0, 0], sensors)
    assert begun(view, (-1.0, 0.3), sensors.radius) is None


def test_a_goal_within_the_turning_circle_is_turned_to() -> None:
    for away, is_turned in ((0.4, True), (1.2, False)):
        world = {**WIDE, "start": [0, 0, 0], "goal": [0, away]}
        simulation = Simulation(scenario(lidar={"beams": 90}, world=world, goal={"radius": 0.05}))
        simulation.reset(seeds=[0])
        sensors = Sensors.of(simulation.scenario)
        view = View(simulation.world.observation[0, 0], sensors)
        assert (begun(view, (0.0, 1.0), sensors.radius) is not None) == is_turned


def test_moves_to_and_fro_are_no_lap() -> None:
    # It called itself looping after 4 m, since a robot that backs seems to have turned round.
    rows = evaluate(["bug0", "com1", "rev3"], ["ackermann"], episodes=8)
    assert sum(row.success for row in rows) >= 22
    assert all(row.path_length > 15.0 for row in rows if row.verdict == "looping")


@pytest.mark.parametrize(("name", "seed"), [("bug0", 26), ("bug2", 49)])
def test_what_is_seen_while_it_turns_is_no_part_of_a_lap(name: str, seed: int) -> None:
    # There is a way. Asked during its turns, bug0 called itself looping on it, and bug2 its goal unreachable.
    (row,) = evaluate([name], ["ackermann"], episodes=1, seed=seed)
    assert row.verdict == "" and row.success


def test_a_planner_is_not_stopped_by_the_disc_about_a_car() -> None:
    rows = evaluate(["a_star"], ["ackermann"], episodes=24)
    assert all(row.success for row in rows)


def test_a_dead_end_is_left_in_several_moves() -> None:
    # Nose to the end of a lane of 1 m, less than twice the least radius: the goal lies behind.
    walls = [[[-3, 0.5], [1, 0.5], [1, 0.6], [-3, 0.6]], [[-3, -0.6], [1, -0.6], [1, -0.5], [-3, -0.5]]]
    world = {
        "family": "explicit",
        "polygons": [*walls, [[1, -0.6], [1.1, -0.6], [1.1, 0.6], [1, 0.6]]],
        "start": [0.6, 0, 0],
        "goal": [-6, 0],
    }
    described = {"name": "lane", "robot": CAR, "lidar": {"beams": 90}, "world": world, "time": {"limit": 60.0}}
    (row,) = evaluate(["go_to_goal"], described, episodes=1)
    assert row.success


def test_discrete_actions_of_policies_arrive_too() -> None:
    env = NavigationEnv("static", STATIC, action="discrete")
    policy, state = make_policy("tangent_bug", env), None
    observation, info = env.reset(seed=0)
    while info["outcome"] == "running":
        number, state = policy.predict(observation, state)
        observation, *_, info = env.step(number)
    assert info["is_success"]


def test_a_picture_shows_it(tmp_path: Path) -> None:
    frame = NavigationEnv("ackermann", render_mode="rgb_array")
    frame.reset(seed=0)
    picture = frame.render()
    assert picture is not None and picture.shape[2] == 3
