"""The potential field: forces against numerical gradients, obstacles against a plain search, where a field alone ends."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from episodes import canonical_world, goal_distances, run_episode
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.agents.potential_field.field import Field, FieldMemory, FieldParameters, Forces, Obstacle
from bug_gym.agents.potential_field.forces import (
    LEAST_CLOSING,
    LEAST_GAP,
    Gains,
    attractive_force,
    attractive_potential,
    repulsive_force,
    repulsive_potential,
)
from bug_gym.agents.potential_field.local_minimum import MinimumMemory, is_caught, travel_direction
from bug_gym.agents.potential_field.nearest_points import find_nearest_points
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

GAINS = Gains(
    attraction=1.3,
    exponent=1,
    velocity=0.4,
    repulsion=0.2,
    influence=1.0,
    acceleration=1.1,
    floor=0.05,
    floor_gap=0.5,
    radius=0.2,
)
STEP = 1e-6


def negative_gradient(potential: Any, place: NDArray[np.float64], velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """-d/dp - d/dv of a potential of the robot's place and velocity, by central differences."""
    found = np.zeros(2)
    for axis, off in enumerate(np.eye(2) * STEP):
        found[axis] -= (potential(place + off, velocity) - potential(place - off, velocity)) / (2.0 * STEP)
        found[axis] -= (potential(place, velocity + off) - potential(place, velocity - off)) / (2.0 * STEP)
    return found


@pytest.mark.parametrize("exponent", [1, 2])
def test_the_attraction_is_the_gradient_of_its_potential(exponent: Any) -> None:
    gains, rng = replace(GAINS, exponent=exponent), np.random.default_rng(0)
    for _ in range(50):
        place, velocity, target, target_velocity = rng.uniform(-3.0, 3.0, (4, 2))

        def potential(p: Any, v: Any, t: Any = target, w: Any = target_velocity) -> float:
            return attractive_potential(gains, tuple(t - p), tuple(w - v))

        force = attractive_force(gains, tuple(target - place), tuple(target_velocity - velocity))
        assert force == pytest.approx(negative_gradient(potential, place, velocity), rel=1e-5, abs=1e-6)


def test_the_repulsion_is_the_gradient_of_its_potential() -> None:
    rng, seen = np.random.default_rng(1), [0, 0, 0]
    while min(seen) < 40:
        place, velocity, other_velocity = rng.uniform(-1.0, 1.0, (3, 2))
        offset, relative = -place, velocity - other_velocity
        distance = float(np.hypot(*offset))
        closing = float(relative @ offset) / distance
        gap = distance - GAINS.radius
        room = gap - closing**2 / (2.0 * GAINS.acceleration)
        edges = (
            closing - LEAST_CLOSING,
            room - LEAST_GAP,
            gap - LEAST_GAP,
            room - GAINS.influence,
            gap - GAINS.floor_gap,
        )
        if min(map(abs, edges)) < 1e-3 or min(room, gap) < LEAST_GAP:
            continue
        seen[0] += closing > LEAST_CLOSING and room < GAINS.influence
        seen[1] += closing < 0.0 and gap < GAINS.floor_gap
        seen[2] += closing > LEAST_CLOSING and gap < GAINS.floor_gap

        def potential(p: Any, v: Any, w: Any = other_velocity) -> float:
            return repulsive_potential(GAINS, tuple(-p), tuple(v - w))

        force = repulsive_force(GAINS, tuple(offset), tuple(relative))
        assert force == pytest.approx(negative_gradient(potential, place, velocity), rel=1e-4, abs=1e-5)


def test_what_goes_away_and_is_not_near_repels_nothing() -> None:
    assert repulsive_force(GAINS, (0.9, 0.0), (-0.5, 0.3)) == (0.0, 0.0)
    assert repulsive_force(GAINS, (0.9, 0.0), (0.5, 0.0))[0] < 0.0


def test_a_robot_that_cannot_brake_any_more_is_pushed_but_not_without_bound() -> None:
    force = repulsive_force(GAINS, (0.21, 0.0), (3.0, 0.0))
    assert math.isfinite(force[0]) and force[0] < -10.0


def clusters_by_hand(points: NDArray[np.float64], reach: float, gap: float) -> set[tuple[float, float]]:
    """The nearest point of each cluster of a ring of points: walked from a place where one ends."""
    inside = np.hypot(*points.T) <= reach
    joined = [
        inside[i] and inside[(i + 1) % len(points)] and np.hypot(*(points[i] - points[(i + 1) % len(points)])) <= gap
        for i in range(len(points))
    ]
    groups: list[list[int]] = []
    begin = next((i + 1 for i, is_joined in enumerate(joined) if not is_joined), 0)
    for number in range(len(points)):
        i = (begin + number) % len(points)
        if not inside[i]:
            continue
        if groups and groups[-1][-1] == (i - 1) % len(points) and joined[i - 1]:
            groups[-1].append(i)
        else:
            groups.append([i])
    nearest = [points[min(group, key=lambda i: float(np.hypot(*points[i])))] for group in groups]
    return {(float(x), float(y)) for x, y in nearest}


def test_each_cluster_of_a_scan_gives_its_nearest_point() -> None:
    rng = np.random.default_rng(2)
    for _ in range(200):
        angles = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
        ranges = np.repeat(rng.uniform(0.3, 3.0, 8), 3) + rng.uniform(0.0, 0.2, 24)
        points = np.roll(np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)]), rng.integers(24), axis=0)
        found = np.empty((24, 2))
        count = find_nearest_points(
            np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1]), 2.0, 0.8, found
        )
        assert {(float(x), float(y)) for x, y in found[:count]} == clusters_by_hand(points, 2.0, 0.8)


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_without_obstacles_the_distance_falls_at_every_step(kinematics: str) -> None:
    world = {"family": "empty", "start": [0, 0, 2.0], "goal": [8, 3]}
    episode = run_episode("apf", {"world": world}, {"robot.kinematics": kinematics})
    distances = goal_distances(episode)
    turned = int(np.argmax(np.diff(distances) < 0.0))
    assert episode.outcome == "success" and (np.diff(distances[turned:]) < 0.0).all()


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_field_alone_ends_in_the_pocket_of_the_u_and_says_stuck(kinematics: str) -> None:
    episode = run_episode("apf", canonical_world("u_trap"), {"robot.kinematics": kinematics})
    assert (episode.outcome, episode.verdict) == ("running", "stuck")
    x, y, _ = episode.path[-1]
    assert 5.0 < x < 11.0 and abs(y) < 3.0 and episode.min_clearance > 0.05


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_who_is_held_off_farther_than_its_influence_knows_that_it_is_stuck(kinematics: str) -> None:
    """What may lie in the way of a step holds the robot farther off than the field would."""
    robot = {"robot.kinematics": kinematics, "robot.max_speed": 2.0, "robot.radius": 0.4, "time.step": 0.2}
    episode = run_episode("apf", canonical_world("u_trap"), {**robot, "time.limit": 60.0}, influence=0.02)
    assert episode.verdict == "stuck"
    assert episode.min_clearance > 2.0 * 0.02  # the influence, and half of it each for two ways of braking


def test_without_the_floor_a_robot_that_turns_comes_nearer_to_what_it_is_stuck_before() -> None:
    """Whoever stands comes no nearer, so that the repulsion by what does is gone."""
    scenario, robot = canonical_world("u_trap"), {"robot.kinematics": "differential"}
    with_floor, without = (run_episode("apf", scenario, robot, floor=floor) for floor in (0.05, 1e-9))
    assert with_floor.verdict == without.verdict == "stuck"
    assert with_floor.min_clearance > 2.0 * without.min_clearance > 0.0


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_disc_that_comes_head_on_at_the_speed_of_the_paper_is_let_pass(kinematics: str, speed: float) -> None:
    motion = {"law": "waypoints", "points": [[6.0, 0.2], [-6.0, 0.2]], "speed": 0.3, "stop": True}
    world = {"family": "explicit", "bounds": [-10, -10, 20, 10], "start": [0, 0, 0], "goal": [12, 0]}
    world |= {"movers": [{"shape": {"circle": 0.4}, "at": [6.0, 0.2], "motion": motion}]}
    settings = {"robot.kinematics": kinematics, "robot.max_speed": speed, "lidar.beams": 180, "time.limit": 120.0}
    episode = run_episode("apf", {"world": world}, settings)
    assert episode.outcome == "success" and episode.min_clearance > 0.1


BAD: list[tuple[dict[str, Any], str]] = [
    ({"attraction": 0.0}, "attraction must be above 0, got 0.0"),
    ({"repulsion": -0.2}, "repulsion must be above 0, got -0.2"),
    ({"velocity_gain": -1.0}, "velocity_gain must be above 0, got -1.0"),
    ({"braking": 0.0}, "braking must be above 0, got 0.0"),
    ({"floor": math.inf}, "floor must be above 0 and finite, got inf"),
    ({"exponent": 3}, "exponent must be one of"),
    ({"influence": 9.0}, "would do"),
]


@pytest.mark.parametrize("policy", ["apf", "apf_wall_following"])
@pytest.mark.parametrize(("parameters", "message"), BAD)
def test_bad_gains_are_refused_in_one_line(policy: str, parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        make_policy(policy, Simulation("static", overrides={"lidar.range": 5.0}), **parameters)
    assert "\n" not in str(caught.value)


def test_a_scanner_that_sees_less_far_than_the_influence_is_refused_with_what_would_do() -> None:
    simulation = Simulation("static", overrides={"lidar.range": 1.1, "robot.radius": 0.2})
    with pytest.raises(ValueError, match=r"influence of at most 0.9 m would do, or a lidar.range of 1.2 m or more"):
        make_policy("apf", simulation)
    make_policy("apf", simulation, influence=0.9)


# ---------------------------------------------------------------------------------------------- what is felt


def felt(
    world: dict[str, Any], moves: list[tuple[float, float]], **overrides: Any
) -> tuple[Field, View, FieldMemory, Forces]:
    """The field, the last view, the memory and the forces after some actions, from (0, 0) with the heading 0."""
    world = {"family": "explicit", "bounds": [-9, -9, 9, 9], "start": [0, 0, 0], "goal": [8, 0], **world}
    settings = {"lidar.beams": 720, "lidar.noise": 0.0, "time.step": 0.1, **overrides}
    simulation = Simulation({"world": world}, overrides=settings)
    sensors = Sensors.of(simulation.scenario)
    field, memory = Field(FieldParameters(), sensors, safe_radius=sensors.radius), FieldMemory()
    view = View(simulation.reset(seeds=[0])[0, 0], sensors)
    forces = field.feel(view, memory)
    for move in moves:
        view = View(simulation.step([[move]]).observation[0, 0], sensors)
        forces = field.feel(view, memory)
    return field, view, memory, forces


def test_what_stands_has_the_robots_own_velocity_turned_round_however_it_moves() -> None:
    wall = {"polygons": [[[1.9, -5], [2.9, -5], [2.9, 5], [1.9, 5]]]}
    for moves in ([(0.0, 0.0)], [(0.8, 0.0)] * 3, [(0.8, 0.0)] * 8, [(0.4, 0.6)] * 8):
        _, view, _, forces = felt(wall, moves)
        (one,) = forces.obstacles
        assert not one.is_moving and one.velocity == view.own_velocity
        assert view.own_velocity == pytest.approx(moves[-1], abs=1e-5)


@pytest.mark.parametrize("turn", [0.0, 0.5, -0.5])
def test_what_moves_has_its_own_velocity_though_the_robot_turns(turn: float) -> None:
    """A disc that comes straight on: its nearest point goes as fast as it does."""
    motion = {"law": "bounce", "velocity": [-0.5, 0.0]}
    disc = {"movers": [{"shape": {"circle": 0.4}, "at": [2.4, 0.0], "motion": motion}]}
    _, view, _, forces = felt(disc, [(0.0, turn)] * 8, **{"robot.kinematics": "differential", "robot.max_reverse": 1.0})
    (one,) = forces.obstacles
    assert abs(view.heading) >= (0.5 if turn else 0.0), (
        "it has turned by more than the disc's place could be mistaken for"
    )
    toward = (math.cos(view.heading), -math.sin(view.heading))
    assert one.is_moving
    assert one.velocity[0] * toward[0] + one.velocity[1] * toward[1] == pytest.approx(0.5, abs=0.02)
    # Two beams are 1.8 cm apart at 2 m, in half a second.
    assert one.velocity == pytest.approx((0.5 * toward[0], 0.5 * toward[1]), abs=0.08)


def test_what_stands_behind_the_goal_is_not_felt() -> None:
    wall = {"polygons": [[[1.5, -5], [2.5, -5], [2.5, 5], [1.5, 5]]]}
    assert len(felt({**wall, "goal": [-8, 0]}, [])[-1].obstacles) == 1
    assert len(felt({**wall, "goal": [1.0, 0]}, [])[-1].obstacles) == 0


@pytest.mark.parametrize("distance", [0.4, 0.8, 3.0])
@pytest.mark.parametrize("target_speed", [0.0, 0.3])
def test_the_speed_falls_with_the_distance_to_the_target_but_not_below_its_own(
    distance: float, target_speed: float
) -> None:
    field, view, _, _ = felt(
        {"goal": [distance, 0]}, [], **{"robot.kinematics": "differential", "robot.max_speed": 0.9}
    )
    x, y = field.velocity(view, Forces((1.0, 0.0), (1.0, 0.0), [], target_speed))
    assert x == pytest.approx(min(0.9, 0.9 * distance + target_speed), abs=1e-6) and y == pytest.approx(0.0, abs=1e-6)


# ---------------------------------------------------------------------------------------------- local minima


def looks(
    total: tuple[float, float], direction: float, *, blocked: bool = True, count: int = 1, first: bool = True
) -> MinimumMemory:
    """What the watch for local minima finds in some looks at the same place, the target straight ahead: first or last."""
    simulation = Simulation({"world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}})
    view = View(simulation.reset(seeds=[0])[0, 0], Sensors.of(simulation.scenario))
    wall = Obstacle(place=(0.8, 0.0), velocity=(0.0, 0.0), is_moving=not blocked)
    forces, memory = Forces((1.0, 0.0), total, [wall], 0.0), MinimumMemory()
    is_found = False
    for _ in range(count):
        is_found = is_caught(view, memory, forces, direction)
        if is_found and first:
            break
    if not is_found:
        memory.why = ""
    return memory


def test_two_looks_at_forces_that_cancel_are_a_minimum_and_one_is_not() -> None:
    assert looks((0.04, 0.0), 0.0, count=2).why == "force"
    assert looks((0.04, 0.0), 0.0, count=1).why == ""
    assert looks((0.2, 0.0), 0.0, count=2).why == ""


def test_a_robot_that_travels_away_from_the_target_is_in_a_minimum() -> None:
    assert looks((0.2, 0.0), math.radians(100.0), count=2).why == "away"
    assert looks((0.2, 0.0), math.radians(80.0), count=2).why == ""


def test_three_seconds_without_progress_are_a_minimum() -> None:
    assert looks((0.2, 0.0), 0.0, count=40).why == "swing"
    assert looks((0.2, 0.0), 0.0, count=20).why == ""


def test_after_three_seconds_it_is_a_swing_whatever_else_it_is() -> None:
    """Who has just left a wall lets the other two wait, and stood for ever."""
    assert looks((0.04, 0.0), 0.0, count=40, first=False).why == "swing"
    assert looks((0.04, 0.0), 0.0, count=20, first=False).why == "force"


@pytest.mark.parametrize(
    ("cancels", "found"),
    [("110", "010"), ("101", "001"), ("1001", "0000"), ("100101", "000001"), ("0111", "0011"), ("11001", "01000")],
)
def test_two_of_the_last_three_looks_make_a_minimum_and_the_last_is_one_of_them(cancels: str, found: str) -> None:
    simulation = Simulation({"world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}})
    view = View(simulation.reset(seeds=[0])[0, 0], Sensors.of(simulation.scenario))
    wall, memory = Obstacle(place=(0.8, 0.0), velocity=(0.0, 0.0), is_moving=False), MinimumMemory()
    totals = [0.0 if look == "1" else 0.5 for look in cancels]
    looks = [is_caught(view, memory, Forces((1.0, 0.0), (total, 0.0), [wall], 0.0), 0.0) for total in totals]
    assert looks == [look == "1" for look in found]


def test_what_moves_makes_no_minimum() -> None:
    assert looks((0.0, 0.0), math.pi, blocked=False, count=100).why == ""


@pytest.mark.parametrize(("away", "is_found"), [(0.29, False), (0.31, True)])
def test_within_the_goals_radius_nothing_is_a_minimum(away: float, is_found: bool) -> None:
    sensors = Sensors.of(Simulation("static", overrides={"goal.radius": 0.3}).scenario)
    view: Any = SimpleNamespace(goal_distance=away, goal_bearing=0.0, sensors=sensors)
    wall, memory = Obstacle(place=(0.8, 0.0), velocity=(0.0, 0.0), is_moving=False), MinimumMemory()
    forces = Forces((1.0, 0.0), (0.0, 0.0), [wall], 0.0)
    assert [is_caught(view, memory, forces, 0.0) for _ in range(2)] == [False, is_found]


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_direction_of_travel_is_that_of_the_last_three_tenths_of_a_second_and_of_who_stands_the_heading(
    heading: float,
) -> None:
    world = {"family": "empty", "start": [0, 0, heading], "goal": [8, 0]}
    simulation = Simulation({"world": world}, overrides={"time.step": 0.1, "robot.kinematics": "holonomic"})
    sensors, memory = Sensors.of(simulation.scenario), MinimumMemory()
    found = [travel_direction(View(simulation.reset(seeds=[0])[0, 0], sensors), memory)]
    for move in [(0.0, 1.0)] * 4 + [(-0.5, -0.5)] * 4 + [(0.0, 0.0)] * 4:
        observation = simulation.step([[move]]).observation[0, 0]
        found.append(travel_direction(View(observation, sensors), memory))
    assert found[0] == found[-1] == 0.0
    assert found[4] == pytest.approx(0.5 * math.pi, abs=1e-4)
    assert found[5] > 0.5 * math.pi and found[8] == pytest.approx(-0.75 * math.pi, abs=1e-4)
