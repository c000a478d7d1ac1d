"""The composed core: goals, rewards, odometry, the clock; a row depends on nothing but its seed and actions."""

import math
import os
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym import kernels, observation, scenarios, task
from bug_gym.kinematics import Drive, steering
from bug_gym.log import told
from bug_gym.simulation import Simulation, announce_compilation

F64 = NDArray[np.float64]

STEP = 0.1
WIDE = {"family": "empty", "bounds": [-60, -60, 60, 60], "start": [0.0, 0.0, 0.0], "goal": [50.0, 0.0]}
ROBOTS: dict[str, dict[str, Any]] = {
    "holonomic": {"kinematics": "holonomic", "max_speed": 1.0},
    "differential": {"kinematics": "differential", "max_speed": 1.0},
}
NOISY: dict[str, Any] = {
    "lidar": {"beams": 33, "range": 6.0, "noise": 0.02, "dropout": 0.05},
    "odometry": {"translation_noise": 0.1, "rotation_noise": 0.1, "translation_bias": 0.02, "rotation_bias": 0.01},
}


def make(count: int = 1, threads: int = 1, **parts: Any) -> Simulation:
    """Worlds of a scenario given by its parts; one beam unless they say more."""
    return Simulation({"lidar": {"beams": 1}, "world": WIDE, **parts}, count=count, threads=threads)


def part(simulation: Simulation, name: str, row: int = 0, robot: int = 0) -> F64:
    """One field of a robot's present observation."""
    [field] = [field for field in simulation.fields if field.name == name]
    values: F64 = simulation.world.observation[row, robot, field.begin : field.end].astype(np.float64)
    return values


def info(simulation: Simulation, name: str, row: int = 0, robot: int = 0) -> Any:
    """One value of a robot's present info."""
    return simulation.info()[name][row, robot]


# ------------------------------------------------------------------------------------------------ the goal


def test_the_goal_is_reached_where_the_chord_enters_its_disc_even_if_it_leaves_it_again() -> None:
    """At 20 m/s a step of 2 m crosses the whole disc of radius 0.3, off its middle by 0.1."""
    simulation = make(robot={"max_speed": 20.0}, world={**WIDE, "goal": [5.0, 0.1]})
    simulation.reset(seeds=[0])
    for _ in range(3):
        result = simulation.step([[[1.0, 0.0]]])
    assert info(simulation, "outcome") == "success" and info(simulation, "is_success")
    assert result.terminated[0, 0] and not result.truncated[0, 0]
    entry = 5.0 - math.sqrt(0.3**2 - 0.1**2)
    assert simulation.world.pose[0, 0, :2] == pytest.approx([entry, 0.0], abs=1e-12)
    assert info(simulation, "path_length") == pytest.approx(entry, abs=1e-12)
    assert info(simulation, "goal_distance") == pytest.approx(0.3, abs=1e-12)


@pytest.mark.parametrize("offset, expected", [(0.3 - 1e-9, "success"), (0.3 + 1e-9, "running")])
def test_a_goal_that_is_passed_at_its_radius_is_reached_only_from_inside(offset: float, expected: str) -> None:
    simulation = make(robot={"max_speed": 20.0}, world={**WIDE, "goal": [5.0, offset]})
    simulation.reset(seeds=[0])
    for _ in range(5):
        simulation.step([[[1.0, 0.0]]])
    assert info(simulation, "outcome") == expected


def test_a_goal_behind_a_wall_is_not_reached_through_it() -> None:
    world = {
        "family": "explicit",
        "polygons": [[[2, -3], [2.001, -3], [2.001, 3], [2, 3]]],
        "start": [0, 0, 0],
        "goal": [2.6, 0],
    }
    simulation = make(robot={"max_speed": 20.0}, world=world)
    simulation.reset(seeds=[0])
    simulation.step([[[1.0, 0.0]]])
    simulation.step([[[1.0, 0.0]]])
    assert info(simulation, "outcome") == "collision"


def test_a_goal_in_front_of_a_wall_is_reached_before_the_wall_is_touched() -> None:
    world = {"family": "explicit", "circles": [[3.0, 0.0, 0.5]], "start": [0, 0, 0], "goal": [2.4, 0]}
    simulation = make(robot={"max_speed": 20.0}, world=world)
    simulation.reset(seeds=[0])
    simulation.step([[[1.0, 0.0]]])
    simulation.step([[[1.0, 0.0]]])
    assert info(simulation, "outcome") == "success"
    assert info(simulation, "min_clearance") == pytest.approx(3.0 - 0.5 - 2.1 - 0.2, abs=1e-12)


@pytest.mark.parametrize("speed", [0.5, 20.0])
def test_a_goal_that_moves_over_a_standing_robot_is_reached(speed: float) -> None:
    target = {"at": [8.0, 0.2], "motion": {"law": "bounce", "velocity": [-speed, 0.0]}}
    simulation = make(world={**WIDE, "goal": None, "target": target})
    simulation.reset(seeds=[0])
    steps = math.ceil((8.0 - math.sqrt(0.3**2 - 0.2**2)) / speed / STEP)
    for step in range(1, steps + 1):
        assert info(simulation, "outcome") == "running"
        simulation.step([[[0.0, 0.0]]])
        if step < steps:
            assert simulation.world.goal[0, 0] == pytest.approx([8.0 - speed * STEP * step, 0.2], abs=1e-9)
    assert info(simulation, "outcome") == "success"


def test_a_goal_that_flees_at_the_robots_speed_is_not_reached() -> None:
    target = {"at": [0.35, 0.0], "motion": {"law": "bounce", "velocity": [1.0, 0.0]}}
    simulation = make(world={**WIDE, "goal": None, "target": target})
    simulation.reset(seeds=[0])
    for _ in range(100):
        simulation.step([[[1.0, 0.0]]])
    assert info(simulation, "outcome") == "running"
    assert info(simulation, "goal_distance") == pytest.approx(0.35, abs=1e-9)


@pytest.mark.parametrize("law", ["bounce", "waypoints", "random_walk"])
def test_a_moving_goal_is_observed_where_it_is(law: str) -> None:
    motions: dict[str, Any] = {
        "bounce": {"law": "bounce", "speed": 0.7},
        "waypoints": {"law": "waypoints", "points": [[5, 5], [-5, 3]], "speed": 0.7},
        "random_walk": {"law": "random_walk", "speed": 0.7},
    }
    world = {"family": "empty", "start": [1, -2, 0.6], "target": {"at": [3.0, 3.0], "motion": motions[law]}}
    simulation = make(robot=ROBOTS["differential"], world=world)
    simulation.reset(seeds=[0])
    places = []
    rng = np.random.default_rng(0)
    for _ in range(60):
        simulation.step(rng.uniform(-1, 1, (1, 1, 2)))
        x, y, heading = simulation.world.pose[0, 0]
        goal = simulation.world.goal[0, 0].copy()
        places.append(goal)
        away = goal - [x, y]
        seen = [
            math.cos(heading) * away[0] + math.sin(heading) * away[1],
            -math.sin(heading) * away[0] + math.cos(heading) * away[1],
        ]
        assert part(simulation, "goal") == pytest.approx(seen, abs=1e-5)
        assert info(simulation, "goal_distance") == pytest.approx(math.hypot(*away), abs=1e-12)
    assert np.hypot(*np.diff(places, axis=0).T).max() <= 0.07 + 1e-9
    assert np.ptp(places, axis=0).max() > 0.5


@pytest.mark.parametrize("law", ["bounce", "random_walk"])
def test_a_moving_goal_that_needs_no_room_passes_neither_border_nor_obstacle(law: str) -> None:
    world: dict[str, Any] = {
        "family": "explicit",
        "bounds": [-5, -5, 5, 5],
        "circles": [[2, 2, 0.5], [-2, 2, 0.5], [0, -3, 1]],
        "polygons": [[[2, -2], [3, -2], [3, -1], [2, -1]]],
        "start": [0, 0, 0],
        "target": {"at": [3, 3.4], "room": 0.0, "motion": {"law": law, "speed": 2.0}},
    }
    simulation = Simulation({"lidar": {"beams": 1}, "time": {"limit": 1000.0}, "world": world}, count=20)
    simulation.reset(seeds=range(20))
    for _ in range(1500):
        simulation.step(np.zeros((20, 1, 2)))
        x, y = simulation.world.goal[:, 0].T
        assert max(np.abs(x).max(), np.abs(y).max()) <= 5.0 + 1e-9
        assert min((np.hypot(x - a, y - b) - radius).min() for a, b, radius in world["circles"]) >= -1e-9
        assert (np.maximum(np.abs(x - 2.5), np.abs(y + 1.5)) >= 0.5 - 1e-9).all()


def test_a_robot_that_begins_at_its_goal_has_reached_it_after_one_step_without_moving() -> None:
    simulation = make(world={**WIDE, "goal": [0.1, 0.1]})
    simulation.reset(seeds=[0])
    simulation.step([[[1.0, 0.0]]])
    assert info(simulation, "outcome") == "success"
    assert info(simulation, "path_length") == 0.0


# ------------------------------------------------------------------------------------------------ rewards

WEIGHTS = {"progress": 1.3, "goal": 7.0, "collision": -4.0, "step": -0.02, "clearance": -0.5, "smoothness": -0.1}


@pytest.mark.parametrize("kinematics", ROBOTS)
def test_the_reward_is_the_sum_of_its_terms_and_each_term_is_what_it_says(kinematics: str) -> None:
    world = {
        "family": "field",
        "moving": 0.5,
        "speeds": [0.3, 1.0],
        "separation": 3.0,
        "target_motion": {"law": "random_walk", "speed": 0.5},
    }
    rng = np.random.default_rng(0)
    seen = dict.fromkeys(task.REWARD_TERMS, 0)
    drive = Drive(kinematics, max_speed=1.0, max_reverse=0.3, max_turn_rate=1.5, step=STEP)
    for seed in range(60):
        simulation = make(robot=ROBOTS[kinematics], world=world, reward=WEIGHTS)
        simulation.reset(seeds=[seed])
        before, last = info(simulation, "goal_distance"), np.zeros(2)
        drift = rng.uniform(-1, 1, 2)
        for _ in range(60):
            if seed % 2:
                drift = steering(drive, part(simulation, "goal")).astype(np.float64)
            action = np.clip(drift + rng.uniform(-0.5, 0.5, 2), -1.0, 1.0)
            result = simulation.step(action[None, None])
            terms = dict(zip(task.REWARD_TERMS, info(simulation, "reward_terms"), strict=True))
            outcome, after = info(simulation, "outcome"), info(simulation, "goal_distance")
            assert result.reward[0, 0] == pytest.approx(sum(terms.values()), abs=1e-12)
            assert terms["progress"] == pytest.approx(1.3 * (before - after), abs=1e-9)
            assert terms["goal"] == (7.0 if outcome == "success" else 0.0)
            assert terms["collision"] == (-4.0 if outcome == "collision" else 0.0)
            assert terms["step"] == -0.02
            assert terms["smoothness"] == pytest.approx(-0.1 * ((action - last) ** 2).sum(), abs=1e-12)
            assert -0.5 <= terms["clearance"] <= 0.0
            assert (terms["clearance"] == -0.5) == (outcome == "collision")
            for name, value in terms.items():
                seen[name] += value != 0.0
            before, last = after, action
            if outcome != "running":
                break
    assert min(seen.values()) > 1, seen


def test_the_clearance_term_falls_off_linearly_from_contact_to_its_scale() -> None:
    """Beside a wall: the gap is known, the robot moves along it."""
    for gap in (0.1, 0.3, 0.49, 0.51, 2.0):
        wall = [[-9, 0.2 + gap], [9, 0.2 + gap], [9, 5], [-9, 5]]
        world = {"family": "explicit", "polygons": [wall], "start": [0, 0, 0], "goal": [8, 0]}
        simulation = make(world=world, reward=WEIGHTS)
        simulation.reset(seeds=[0])
        simulation.step([[[1.0, 0.0]]])
        terms = dict(zip(task.REWARD_TERMS, info(simulation, "reward_terms"), strict=True))
        assert terms["clearance"] == pytest.approx(-0.5 * max(0.0, 1.0 - gap / task.CLEARANCE_SCALE), abs=1e-9)


def test_the_clearance_term_is_of_the_step_and_not_of_the_episode() -> None:
    """Away from a wall: the smallest clearance of the episode stays, the term of the step goes."""
    world = {
        "family": "explicit",
        "polygons": [[[-9, 0.3], [9, 0.3], [9, 5], [-9, 5]]],
        "start": [0, 0, 0],
        "goal": [8, -8],
    }
    simulation = make(world=world, reward=WEIGHTS)
    simulation.reset(seeds=[0])
    for step in range(1, 8):
        simulation.step([[[0.0, -1.0]]])
        nearest = 0.1 + (step - 1) * STEP
        terms = dict(zip(task.REWARD_TERMS, info(simulation, "reward_terms"), strict=True))
        assert terms["clearance"] == pytest.approx(-0.5 * max(0.0, 1.0 - nearest / 0.5), abs=1e-9)
        assert info(simulation, "min_clearance") == pytest.approx(0.1, abs=1e-12)


def test_progress_telescopes_to_the_change_of_distance() -> None:
    simulation = make(
        count=20, robot=ROBOTS["differential"], world={"family": "field", "moving": 0.5}, reward={"progress": 1.0}
    )
    simulation.reset(seeds=list(range(20)))
    first = simulation.info()["goal_distance"][:, 0].copy()
    total = np.zeros(20)
    rng = np.random.default_rng(0)
    for _ in range(80):
        simulation.step(rng.uniform([-0.2, -1], [1, 1], (20, 1, 2)))
        total += simulation.info()["reward_terms"][:, 0, task.REWARD_TERMS.index("progress")]
    assert total == pytest.approx(first - simulation.info()["goal_distance"][:, 0], abs=1e-9)
    assert np.abs(total).min() > 0.0


def test_a_finished_robot_gets_nothing_more_and_stays_as_it_is() -> None:
    world = {"family": "explicit", "circles": [[1.0, 0, 0.5]], "start": [0, 0, 0], "goal": [5, 0]}
    simulation = make(world=world)
    simulation.reset(seeds=[0])
    for _ in range(4):
        simulation.step([[[1.0, 0.0]]])
    assert info(simulation, "outcome") == "collision"
    pose, path = simulation.world.pose.copy(), info(simulation, "path_length")
    for _ in range(5):
        result = simulation.step([[[-1.0, 0.3]]])
        assert result.reward[0, 0] == 0.0 and (info(simulation, "reward_terms") == 0.0).all()
        assert result.terminated[0, 0]
        assert (simulation.world.pose == pose).all() and info(simulation, "path_length") == path
        assert (simulation.world.velocity == 0.0).all() and not simulation.world.active.any()


# ------------------------------------------------------------------------------------------------ the clock


@pytest.mark.parametrize("step, limit", [(0.1, 2.0), (0.1, 1.04), (0.1, 1.06), (0.3, 1.0), (0.07, 0.5), (0.25, 0.25)])
def test_the_time_limit_truncates_after_limit_over_step_rounded(step: float, limit: float) -> None:
    simulation = make(time={"step": step, "limit": limit})
    simulation.reset(seeds=[0])
    steps = round(limit / step)
    for number in range(1, steps + 1):
        result = simulation.step([[[0.1, 0.0]]])
        assert result.truncated[0, 0] == (number == steps) and not result.terminated[0, 0]
        assert info(simulation, "time") == pytest.approx(number * step, abs=1e-12)
    assert info(simulation, "outcome") == "timeout"


def test_a_robot_out_of_time_is_observed_as_it_goes_and_one_that_touched_as_it_stands() -> None:
    """Learning goes on from the last observation of an episode that was cut off, so it must be one like any other."""
    for name, expected in (("timeout", [0.6, 0.8]), ("collision", [0.0, 0.0])):
        circles = [[0.6, 0.8, 0.5]] if name == "collision" else []
        world = {"family": "explicit", "circles": circles, "start": [0, 0, 0], "goal": [8, 0]}
        simulation = make(time={"step": 0.1, "limit": 1.0}, world=world)
        simulation.reset(seeds=[0])
        for _ in range(10):
            simulation.step([[[0.6, 0.8]]])
        assert info(simulation, "outcome") == name
        assert part(simulation, "velocity") == pytest.approx(expected)


def test_a_goal_reached_in_the_last_step_is_a_success_and_no_timeout() -> None:
    simulation = make(time={"step": 0.1, "limit": 1.0}, world={**WIDE, "goal": [1.25, 0.0]})
    simulation.reset(seeds=[0])
    for _ in range(10):
        result = simulation.step([[[1.0, 0.0]]])
    assert result.terminated[0, 0] and not result.truncated[0, 0]


def test_path_length_is_the_sum_of_the_chords() -> None:
    simulation = make(robot=ROBOTS["differential"])
    simulation.reset(seeds=[0])
    rng = np.random.default_rng(0)
    places = [simulation.world.pose[0, 0, :2].copy()]
    for _ in range(100):
        simulation.step(rng.uniform(-1, 1, (1, 1, 2)))
        places.append(simulation.world.pose[0, 0, :2].copy())
    assert info(simulation, "path_length") == pytest.approx(np.hypot(*np.diff(places, axis=0).T).sum(), abs=1e-12)


# ------------------------------------------------------------------------------------------------ odometry


def in_the_frame_of_the_start(poses: F64) -> F64:
    """Poses (n, 3) as seen from the first of them."""
    x, y, heading = poses[0]
    moved = poses[:, :2] - [x, y]
    turn = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
    return np.column_stack([moved @ turn.T, np.angle(np.exp(1j * (poses[:, 2] - heading)))])


def random_drive(simulation: Simulation, steps: int, seed: int = 0) -> tuple[F64, F64]:
    """True poses (steps + 1, 3) and odometry under random actions."""
    rng = np.random.default_rng(seed)
    true, own = [simulation.world.pose[0, 0].copy()], [simulation.world.odometry[0, 0].copy()]
    for _ in range(steps):
        simulation.step(rng.uniform(-1, 1, (1, 1, 2)))
        true.append(simulation.world.pose[0, 0].copy())
        own.append(simulation.world.odometry[0, 0].copy())
    return np.array(true), np.array(own)


@pytest.mark.parametrize("kinematics", ROBOTS)
def test_odometry_without_noise_is_the_true_pose_in_the_frame_of_the_start(kinematics: str) -> None:
    simulation = make(robot=ROBOTS[kinematics], world={**WIDE, "start": [3.0, -4.0, 2.2]})
    simulation.reset(seeds=[0])
    true, own = random_drive(simulation, 300)
    expected = in_the_frame_of_the_start(true)
    assert np.abs(own[:, :2] - expected[:, :2]).max() < 1e-9
    assert np.abs(np.angle(np.exp(1j * (own[:, 2] - expected[:, 2])))).max() < 1e-9
    assert part(simulation, "pose") == pytest.approx(own[-1], abs=1e-5)


def test_a_translation_bias_lengthens_every_way_by_its_share() -> None:
    simulation = make(odometry={"translation_bias": 0.05}, world={**WIDE, "start": [0, 0, 1.0]})
    simulation.reset(seeds=[0])
    true, own = random_drive(simulation, 100)
    assert own[:, :2] == pytest.approx(1.05 * in_the_frame_of_the_start(true)[:, :2], abs=1e-9)


def test_a_rotation_bias_turns_the_heading_by_the_distance_gone() -> None:
    simulation = make(odometry={"rotation_bias": 0.02})
    simulation.reset(seeds=[0])
    for number in range(1, 300):
        simulation.step([[[1.0, 0.0]]])
        assert simulation.world.odometry[0, 0, 2] == pytest.approx(0.02 * number * STEP, abs=1e-9)
    # The believed way is a polygon that turns by 0.002 rad after each chord of 0.1 m.
    angles = 0.002 * np.arange(299)
    expected = [0.1 * np.cos(angles).sum(), 0.1 * np.sin(angles).sum()]
    assert simulation.world.odometry[0, 0, :2] == pytest.approx(expected, abs=1e-9)


def test_a_robot_that_only_turns_or_stands_collects_no_drift() -> None:
    noise = {"translation_noise": 0.5, "rotation_noise": 0.5, "translation_bias": 0.5, "rotation_bias": 0.5}
    robot = {**ROBOTS["differential"], "max_reverse": 0.0}
    simulation = make(robot=robot, odometry=noise)
    simulation.reset(seeds=[0])
    for number in range(1, 15):
        simulation.step([[[-1.0, 1.0]]])
        assert simulation.world.odometry[0, 0] == pytest.approx([0.0, 0.0, 0.15 * number], abs=1e-12)


@pytest.mark.parametrize("pieces", [1, 8])
def test_the_variance_of_odometry_grows_with_the_distance_whatever_the_pieces(pieces: int) -> None:
    """1,500 robots go 0.8 m straight on, in one step of 0.8 m or in eight: the deviations are the same."""
    count, sigma, turn = 1500, 0.1, 0.05
    odometry = {"translation_noise": sigma, "rotation_noise": turn}
    # The robot of one step is as fast as that needs.
    simulation = make(count, robot={"max_speed": 8.0 / pieces}, odometry=odometry)
    simulation.reset(seeds=list(range(count)))
    for _ in range(pieces):
        simulation.step(np.tile([1.0, 0.0], (count, 1, 1)))
    own = simulation.world.odometry[:, 0]
    bound = 4.0 / math.sqrt(2.0 * count)  # of a relative standard deviation
    assert own[:, 2].std() == pytest.approx(turn * math.sqrt(0.8), rel=bound)
    assert own[:, 0].std() == pytest.approx(sigma * math.sqrt(0.8), rel=bound + 0.01)  # 0.01: by turning, second order
    assert abs(own[:, 2].mean()) < 4.0 * turn * math.sqrt(0.8 / count)
    assert abs(own[:, 0].mean() - 0.8) < 4.0 * sigma * math.sqrt(0.8 / count) + 0.8 * turn**2
    assert abs(np.corrcoef(own[:, 0], own[:, 2])[0, 1]) < 4.0 / math.sqrt(count)
    if pieces == 8:
        # Heading errors carry the robot sideways: var = sum over i of (0.1 m)^2 turn^2 0.1 m (7 - i)^2 ...
        share = sum((7 - i) ** 2 for i in range(7))
        assert own[:, 1].std() == pytest.approx(0.1 * turn * math.sqrt(0.1 * share), rel=bound + 0.01)
    else:
        assert np.abs(own[:, 1]).max() < 1e-12


def test_noise_of_odometry_leaves_the_truth_alone() -> None:
    plain, noisy = make(robot=ROBOTS["differential"]), make(robot=ROBOTS["differential"], odometry=NOISY["odometry"])
    for simulation in (plain, noisy):
        simulation.reset(seeds=[0])
    true, own = random_drive(plain, 100)
    also_true, drifted = random_drive(noisy, 100)
    assert (true == also_true).all()
    assert np.abs(own - drifted).max() > 0.01


@pytest.mark.parametrize("sensing", ["beacon", "odometry"])
def test_a_goal_sensed_by_odometry_stands_still_in_the_robots_own_frame(sensing: str) -> None:
    world = {**WIDE, "start": [2.0, 1.0, 0.7], "goal": [12.0, -7.0]}
    simulation = make(robot=ROBOTS["differential"], world=world, odometry=NOISY["odometry"], goal={"sensing": sensing})
    simulation.reset(seeds=[0])
    rng = np.random.default_rng(0)
    for _ in range(150):
        simulation.step(rng.uniform([-0.2, -1], [1, 1], (1, 1, 2)))
        pose = simulation.world.pose[0, 0] if sensing == "beacon" else simulation.world.odometry[0, 0]
        goal = np.array([12.0, -7.0])
        if sensing == "odometry":
            goal = in_the_frame_of_the_start(np.array([[2.0, 1.0, 0.7], [12.0, -7.0, 0.0]]))[1, :2]
        expected = in_the_frame_of_the_start(np.array([pose, [*goal, 0.0]]))[1, :2]
        assert part(simulation, "goal") == pytest.approx(expected, abs=1e-5)
    drift = (
        simulation.world.odometry[0, 0, :2]
        - in_the_frame_of_the_start(np.array([[2.0, 1.0, 0.7], simulation.world.pose[0, 0]]))[1, :2]
    )
    assert np.hypot(*drift) > 0.05, "odometry and truth are apart here"


# ------------------------------------------------------------------------------------------------ observation

ALL_FACES = ["static", "dynamic", "moving_target", "rush", "maze", "crossing_robots", "two_boxes", "u_trap"]


@pytest.mark.parametrize("name", ALL_FACES)
def test_observations_lie_in_their_space_and_are_finite(name: str) -> None:
    simulation = Simulation(
        name, count=8, overrides={f"odometry.{key}": value for key, value in NOISY["odometry"].items()}
    )
    space = observation.flat_space(simulation.fields)
    rng = np.random.default_rng(0)
    seen = simulation.reset(seeds=list(range(8)))
    for _ in range(150):
        assert np.isfinite(seen).all()
        assert (seen >= space.low).all() and (seen <= space.high).all()
        seen = simulation.step(rng.uniform(-1, 1, (8, simulation.robots, 2))).observation
        done = np.nonzero(~simulation.world.active.any(axis=1))[0]
        if len(done):
            simulation.reset(done)


@pytest.mark.parametrize("kinematics", ROBOTS)
def test_peers_are_the_other_robots_in_my_frame(kinematics: str) -> None:
    places = [{"start": [-3, 0, 0.3]}, {"start": [0, -3, 1.9]}, {"start": [3, 1, -2.5]}]
    simulation = make(robot=ROBOTS[kinematics], robots=places)
    simulation.reset(seeds=[0])
    rng = np.random.default_rng(0)
    before = simulation.world.pose[0].copy()
    for _ in range(10):
        simulation.step(rng.uniform(-1, 1, (1, 3, 2)))
        poses = simulation.world.pose[0].copy()
        velocities = simulation.world.velocity[0]
        for me in range(3):
            peers = part(simulation, "peers", robot=me).reshape(2, 4)
            x, y, heading = poses[me]
            frame = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
            for row, other in enumerate(robot for robot in range(3) if robot != me):
                assert peers[row, :2] == pytest.approx(frame @ (poses[other, :2] - [x, y]), abs=1e-5)
                if kinematics == "holonomic":
                    moved = (poses[other, :2] - before[other, :2]) / STEP
                else:  # at the end of an arc the velocity points along the new heading
                    moved = velocities[other, 0] * np.array([math.cos(poses[other, 2]), math.sin(poses[other, 2])])
                assert peers[row, 2:] == pytest.approx(frame @ moved, abs=1e-5)
        before = poses


def test_observations_handed_out_do_not_share_memory_with_the_core() -> None:
    simulation = make(count=3)
    first = simulation.reset(seeds=[0, 1, 2])
    kept = first.copy()
    result = simulation.step(np.ones((3, 1, 2)))
    assert (first == kept).all()
    later = [array.copy() for array in result]
    values = simulation.info()
    kept_info = {name: array.copy() for name, array in values.items()}
    simulation.step(np.ones((3, 1, 2)))
    assert all((a == b).all() for a, b in zip(result, later, strict=True))
    assert all((values[name] == kept_info[name]).all() for name in values)


# ------------------------------------------------------------------------------------------------ bad input


@pytest.mark.parametrize(
    "actions, words",
    [
        (np.zeros((2, 2)), r"shape \(2, 2\), expected \(2, 1, 2\)"),
        (np.zeros((3, 1, 2)), r"shape \(3, 1, 2\), expected \(2, 1, 2\)"),
        ([[[0.0, math.nan]], [[0.0, 0.0]]], "finite, got nan"),
        ([[[0.0, 0.0]], [[math.inf, 0.0]]], "finite, got inf"),
    ],
)
def test_actions_of_a_wrong_shape_or_not_finite_are_refused_and_change_nothing(actions: Any, words: str) -> None:
    simulation = make(count=2)
    simulation.reset(seeds=[0, 1])
    before = simulation.world.floats.copy()
    with pytest.raises(ValueError, match=words):
        simulation.step(actions)
    assert (simulation.world.floats == before).all()


@pytest.mark.parametrize(
    ("settings", "count", "said"), [({}, 2, "2 worlds of 1"), ({"robots": {"count": 2}}, 1, "1 worlds of 2")]
)
def test_one_world_of_one_robot_is_stepped_by_itself(settings: dict[str, Any], count: int, said: str) -> None:
    simulation = make(count=count, world={"family": "field"}, **settings)
    simulation.reset()
    with pytest.raises(ValueError, match=said):
        simulation.step_one(0.0, 0.0)


@pytest.mark.parametrize("seed", [-1, 2**63, 0.5, "3"])
def test_a_seed_that_is_no_whole_number_from_0_on_is_refused(seed: Any) -> None:
    with pytest.raises(ValueError, match="a seed is an integer from 0"):
        make().reset(seeds=[seed])


def test_too_many_or_too_few_seeds_are_refused() -> None:
    with pytest.raises(ValueError, match="got 3 seeds for 2 rows"):
        make(count=2).reset(seeds=[0, 1, 2])


@pytest.mark.parametrize("count, threads", [(0, 1), (1, 0), (-2, 1)])
def test_no_worlds_or_no_threads_are_refused(count: int, threads: int) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        make(count, threads)


# ------------------------------------------------------------------------------------------------ determinism


def numbers_of(simulation: Simulation, row: int) -> list[Any]:
    """All that a row shows after a step."""
    values = simulation.info()
    shown = [simulation.world.observation[row].tolist(), simulation.world.pose[row].tolist()]
    return shown + [values[name][row].tolist() for name in sorted(values)]


def play(
    simulation: Simulation, seeds: list[int], actions: dict[int, F64], order: list[int] | None = None
) -> dict[int, list[Any]]:
    """Two episodes of each seed in rows of their own, 150 steps, reset when done.

    Args:
        seeds: one a row.
        actions: by seed, (150, R, 2).
        order: rows in the order in which they are stepped, singly or all at once where None.
    """
    simulation.reset(seeds=seeds)
    history: dict[int, list[Any]] = {seed: [numbers_of(simulation, row)] for row, seed in enumerate(seeds)}
    for step in range(150):
        batch = np.array([actions[seed][step] for seed in seeds])
        if order is None:
            simulation.step(batch)
        else:
            for row in order:
                simulation.step(batch[[row]], np.array([row]))
        done = np.nonzero(~simulation.world.active.any(axis=1))[0]
        if len(done):
            simulation.reset(done)
        for row, seed in enumerate(seeds):
            history[seed].append(numbers_of(simulation, row))
    return history


DETERMINISM: dict[str, Any] = {
    "field": {
        "world": {
            "family": "field",
            "moving": 0.5,
            "speeds": [0.2, 1.0],
            "target_motion": {"law": "random_walk", "speed": 0.5},
        }
    },
    "maze": {"world": {"family": "maze"}},
    "robots": {"world": {"family": "field", "obstacles": 8, "moving": 0.5}, "robots": {"count": 3}},
}


@pytest.mark.parametrize("name", DETERMINISM)
def test_a_row_depends_on_its_seed_and_actions_only(name: str) -> None:
    """Not on the batch, the row's number, the threads, the order of the rows or the room for more."""
    scenario = {"robot": ROBOTS["differential"], **NOISY, **DETERMINISM[name], "time": {"limit": 8.0}}
    seeds = [11, 12, 13, 14, 15, 16, 17]
    rng = np.random.default_rng(0)
    robots = 3 if name == "robots" else 1
    actions = {seed: rng.uniform([-0.3, -1], [1, 1], (150, robots, 2)) for seed in seeds}
    expected = play(Simulation(scenario, count=7), seeds, actions)
    assert play(Simulation(scenario, count=7, threads=3), seeds, actions) == expected
    assert play(Simulation(scenario, count=7), seeds[::-1], actions) == expected
    assert play(Simulation(scenario, count=7), seeds, actions, order=[3, 1, 0, 6, 2, 5, 4]) == expected
    for seed in seeds[:3]:
        assert play(Simulation(scenario), [seed], actions) == {seed: expected[seed]}
    assert len({str(history[-1]) for history in expected.values()}) == len(seeds)


def test_episodes_count_up_from_a_seed_and_an_unseeded_row_goes_on() -> None:
    simulation = make(count=3, world={"family": "field"})
    simulation.reset(seeds=[5, None, 5])
    assert simulation.world.seed.tolist()[::2] == [5, 5] and simulation.world.episode.tolist() == [0, 0, 0]
    simulation.reset(np.array([2]))
    assert simulation.world.episode.tolist() == [0, 0, 1]
    simulation.reset()
    assert simulation.world.episode.tolist() == [1, 1, 2]
    simulation.reset(seeds=[None, None, 5])
    assert simulation.world.episode.tolist() == [2, 2, 0] and simulation.world.seed.tolist()[::2] == [5, 5]


# Of seed 0 episode 1 finds no place for its obstacles, of seed 2 episode 0.
CROWDED = {
    "family": "field",
    "bounds": [-6, -6, 6, 6],
    "obstacles": 28,
    "sizes": [0.4, 0.9],
    "separation": 6.0,
    "solvable": 0.3,
}


def refused_once() -> Simulation:
    """Two rows in their first episodes; the next one of the first row has been refused."""
    simulation = make(count=2, world=CROWDED)
    simulation.reset(seeds=[0, 1])
    simulation.step(np.full((2, 1, 2), 0.5))
    before = simulation.snapshot()[0]
    with pytest.raises(ValueError, match="seed 0, episode 1: only"):
        simulation.reset()
    for was, now in zip(before[1:4], simulation.snapshot()[0][1:4], strict=True):
        np.testing.assert_array_equal(was, now)
    return simulation


def test_a_next_episode_that_found_no_place_is_passed_over_and_those_of_other_rows_are_not() -> None:
    simulation = refused_once()
    simulation.reset()
    assert simulation.world.episode.tolist() == [2, 1] and simulation.world.seed.tolist() == [0, 1]
    expected = make(world=CROWDED)
    expected.reset(seeds=[1])
    assert (expected.reset()[0] == simulation.observations()[1]).all()
    simulation.reset(np.array([0]))
    assert simulation.world.episode.tolist() == [3, 1], "once only"


def test_an_episode_that_was_asked_for_and_refused_leaves_the_next_one_as_it_was() -> None:
    simulation = refused_once()
    with pytest.raises(ValueError, match="seed 2, episode 0"):
        simulation.reset(seeds=[2, 1])
    simulation.reset()
    assert simulation.world.episode.tolist() == [2, 1] and simulation.world.seed.tolist() == [0, 1]


def test_what_was_refused_goes_with_snapshots_pickles_and_copies() -> None:
    simulation, other, branch = refused_once(), make(count=2, world=CROWDED), make(world=CROWDED)
    other.restore(simulation.snapshot())
    branch.restore(simulation.branches(1).snapshot())
    for twin in (other, pickle.loads(pickle.dumps(simulation)), simulation.branches(1), branch, simulation):
        twin.reset(np.array([0]))
        assert twin.world.episode[0] == 2
    of_another_seed = refused_once().branches(1, futures="own")
    assert of_another_seed.snapshot()[1].tolist() == [1]


def test_a_state_that_tells_no_more_than_which_rows_have_episodes_is_restored() -> None:
    simulation = refused_once()
    world, ahead = simulation.snapshot()
    older: Any = (world, ahead > 0)
    simulation.restore(older)
    with pytest.raises(ValueError, match="seed 0, episode 1: only"):
        simulation.reset()


def test_a_world_drawn_in_python_that_is_refused_is_passed_over_too(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = scenarios.draw_layout

    def draw(scenario: Any, seed: int, episode: int) -> Any:
        if (seed, episode) == (1, 1):
            raise ValueError("no start and goal")
        return drawn(scenario, seed, episode)

    monkeypatch.setattr(scenarios, "draw_layout", draw)
    simulation = make(count=3, world={"family": "maze"})
    simulation.reset(seeds=[0, 1, 2])
    with pytest.raises(ValueError, match="no start and goal"):
        simulation.reset()
    assert simulation.world.episode.tolist() == [0, 0, 0]
    simulation.reset()
    assert simulation.world.episode.tolist() == [1, 2, 1]


def test_a_first_reset_without_seed_draws_one_from_entropy() -> None:
    simulation, other = make(count=4), make(count=4)
    simulation.reset()
    other.reset()
    seeds = [*simulation.world.seed.tolist(), *other.world.seed.tolist()]
    assert len(set(seeds)) == 8 and min(seeds) >= 0


@pytest.mark.parametrize("threads", [1, 2])
def test_a_pickled_simulation_continues_bit_for_bit(threads: int) -> None:
    simulation = Simulation({**NOISY, **DETERMINISM["robots"]}, count=4, threads=threads)
    simulation.reset(seeds=[0, 1, 2, 3])
    rng = np.random.default_rng(0)
    simulation.step(rng.uniform(-1, 1, (4, 3, 2)))
    copy = pickle.loads(pickle.dumps(simulation))
    for _ in range(20):
        actions = rng.uniform(-1, 1, (4, 3, 2))
        one, other = simulation.step(actions), copy.step(actions)
        assert all((a == b).all() for a, b in zip(one, other, strict=True))
    assert (simulation.reset() == copy.reset()).all()
    simulation.close()
    copy.close()


FORKED = """
import os, signal, numpy as np
from bug_gym.simulation import Simulation

one = Simulation("empty", count=4, threads=2)
one.reset(seeds=range(4))
actions = np.full((4, 1, 2), 0.5)
one.step(actions)
read, write = os.pipe()
for has_work in (True, False):
    if os.fork() == 0:
        signal.alarm(60)  # ends a child that waits for threads that it does not have
        if has_work:
            os.write(write, one.step(actions).observation.tobytes())
        one.close()
        os._exit(0)
os.close(write)
with os.fdopen(read, "rb") as child:
    print(child.read() == one.step(actions).observation.tobytes(), os.wait()[1], os.wait()[1])
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no process forks here")
def test_a_simulation_with_threads_goes_on_in_a_forked_process() -> None:
    run = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "0", "0"], run.stderr


# ------------------------------------------------------------------------------------------------ invariance


def turned(points: Any, angle: float, shift: tuple[float, float]) -> list[list[float]]:
    """Points (n, 2) turned about the origin and then shifted."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    moved: list[list[float]] = (np.array(points) @ turn.T + shift).tolist()
    return moved


def course(angle: float, shift: tuple[float, float], goal: list[float], robot: str) -> dict[str, Any]:
    """An explicit world far from its border, turned and shifted as a whole."""
    [[gx, gy], [cx, cy], at, way, other, start] = turned(
        [goal, [3.0, 0.3], [1.2, -3.0], [1.2, 5.0], [6.0, 2.5], [0, 0]], angle, shift
    )
    [velocity] = turned([[-0.1, -0.6]], angle, (0.0, 0.0))
    triangle = [[-0.3, -0.3], [0.4, -0.2], [0.0, 0.5]]
    movers = [
        {"shape": {"circle": 0.3}, "at": at, "motion": {"law": "waypoints", "points": [way, at], "speed": 0.5}},
        {
            "shape": {"polygon": turned(triangle, angle, (0.0, 0.0))},
            "at": other,
            "motion": {"law": "bounce", "velocity": velocity},
        },
    ]
    return {
        "robot": {**ROBOTS[robot], "max_acceleration": 4.0, "circles": [[0.0, 0.0, 0.2], [0.1, 0.05, 0.15]]},
        "lidar": {"beams": 24, "range": 5.0},
        "goal": {"radius": 0.3},
        "world": {
            "family": "explicit",
            "bounds": [-200, -200, 200, 200],
            "circles": [[cx, cy, 0.5]],
            "polygons": [turned([[4.5, -2], [5, -2], [5.2, 1.4], [4.4, 1.2]], angle, shift)],
            "movers": movers,
            "start": [*start, angle],
            "goal": [gx, gy],
        },
    }


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(
    "angle, shift", [(0.0, (31.0, -17.0)), (1.0, (0.0, 0.0)), (-2.5, (40.0, 12.0)), (math.pi, (-5.0, 3.0))]
)
def test_a_turned_and_shifted_world_gives_the_same_run(robot: str, angle: float, shift: tuple[float, float]) -> None:
    outcomes = set()
    for seed in range(30):
        rng = np.random.default_rng(seed)
        goal = rng.uniform([2.0, -3.0], [3.0, -1.0]).tolist()
        drift = rng.uniform([0.0, -0.7], [1.0, 0.2])
        actions = np.clip(drift + rng.uniform(-0.4, 0.4, (80, 2)), -1, 1)
        here, there = Simulation(course(0.0, (0.0, 0.0), goal, robot)), Simulation(course(angle, shift, goal, robot))
        here.reset(seeds=[0])
        there.reset(seeds=[0])
        for action in actions:
            here.step(action[None, None])
            there.step(action[None, None])
            assert info(here, "outcome") == info(there, "outcome")
            assert part(here, "ranges") == pytest.approx(part(there, "ranges"), abs=1e-4)
            for name in ("goal", "pose", "velocity"):
                gap = part(here, name) - part(there, name)
                gap[2:] = np.angle(np.exp(1j * gap[2:]))
                assert np.abs(gap).max() < 1e-5
            if info(here, "outcome") != "running":
                break
        for name in ("path_length", "min_clearance", "goal_distance", "time"):
            assert info(here, name) == pytest.approx(info(there, name), abs=1e-9)
        outcomes.add(info(here, "outcome"))
    assert len(outcomes) > 1, "all of these runs end alike"


@pytest.mark.parametrize(("is_compiled", "lines"), [(False, 1), (True, 0)])
def test_a_process_tells_once_that_it_compiles_and_not_where_there_is_nothing_to_compile(
    is_compiled: bool, lines: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    announce_compilation.cache_clear()
    told.clear()
    monkeypatch.setattr(kernels, "is_compiled", lambda types: is_compiled)
    for _ in range(3):
        make()
    assert [record.message.split(",")[0] for record in caplog.records] == lines * ["compiling the simulation's kernels"]
