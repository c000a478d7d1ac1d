"""ORCA: half planes against closed facts, no contact among robots that run it, and everyone gets past everyone."""

from __future__ import annotations

import copy
import itertools
import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

import bug_gym
from bug_gym import kernels, kinematics
from bug_gym.agents import make_policy
from bug_gym.agents.reciprocal import orca
from bug_gym.agents.reciprocal.bodies import (
    BODY,
    GAP_SHARE,
    RADIUS,
    SHARE,
    find_bodies,
    is_among,
    share_out,
    take_out_disc,
)
from bug_gym.agents.reciprocal.borders import BORDER, LATE_DRIVE, move_borders
from bug_gym.agents.reciprocal.half_planes import CHOSEN, choose_velocities
from bug_gym.config import load
from bug_gym.geometry import F64
from bug_gym.policy import Memory
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

R = 0.2
NOTHING_SEEN = np.full(8, 5.0)


def chosen(
    bodies: list[list[float]],
    velocity: tuple[float, float],
    wish: tuple[float, float],
    *,
    scan: F64 = NOTHING_SEEN,
    margin: float = 0.0,
    speed: float = 1.0,
    horizon: float = 3.0,
    deceleration: float = math.inf,
) -> tuple[float, float, bool]:
    """What a disc robot chooses among bodies [x, y, vx, vy, radius, share, share of the gap]."""
    angles = 2.0 * math.pi * np.arange(len(scan)) / len(scan)
    table = np.array(bodies, dtype=float).reshape(-1, BODY)
    robot = np.array([R, 0.0, margin, speed, horizon, 0.1, deceleration, 0.2, 0.0])
    lines, spare = np.empty((2, 3 * (len(scan) + 2 * len(table) + 2)))
    ranges, made, counts = scan[None], np.empty((1, CHOSEN)), np.array([len(table)])
    ask = np.array([velocity]), np.array([wish])
    choose_velocities(
        ranges, ranges, np.cos(angles), np.sin(angles), 5.0, table[None], counts, robot, *ask, lines, spare, made
    )
    x, y, is_disturbed, slow_x, slow_y = made[0].tolist()
    assert (slow_x, slow_y) == (x, y)  # it goes any way without turning
    return x, y, is_disturbed > 0.0


def least_gap(place: Any, velocity: Any, horizon: float) -> float:
    """Least distance from a point that moves straight to the origin within a time: by the parabola of its square."""
    px, py = place
    vx, vy = velocity
    square = vx * vx + vy * vy
    when = 0.0 if square == 0.0 else min(max(-(px * vx + py * vy) / square, 0.0), horizon)
    return math.hypot(px + when * vx, py + when * vy)


# ------------------------------------------------------------------------------------------------ closed facts


def test_far_from_everyone_the_wish_is_done() -> None:
    # At 1 m/s each, bodies 6.5 m apart do not come together within 3 s.
    assert chosen([[6.5, 0.0, -1.0, 0.0, R, 0.5, 0.5]], (1.0, 0.0), (1.0, 0.0)) == (1.0, 0.0, False)
    assert chosen([], (0.3, 0.1), (0.2, -0.7)) == (0.2, -0.7, False)


def test_two_who_both_run_it_come_no_nearer_than_their_radii_within_the_horizon() -> None:
    rng = np.random.default_rng(0)
    passed = 0
    for _ in range(500):
        bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(0.6, 4.0)
        place = distance * np.array([math.cos(bearing), math.sin(bearing)])
        own, its = rng.uniform(-1.0, 1.0, (2, 2))
        wishes = rng.uniform(-0.7, 0.7, (2, 2))
        # A great top speed: whatever change is needed can be had.
        first = chosen([[*place, *its, R, 0.5, 0.5]], tuple(own), tuple(wishes[0]), speed=50.0)
        second = chosen([[*-place, *own, R, 0.5, 0.5]], tuple(its), tuple(wishes[1]), speed=50.0)
        relative = np.array(second[:2]) - np.array(first[:2])
        assert least_gap(place, relative, 3.0) >= 2.0 * R - 1e-9
        passed += first[2]
    assert 50 < passed < 450  # some had to change what they would do, and some had not


def test_each_does_half_and_who_meets_something_that_does_nothing_does_all() -> None:
    # Head on, a little to the left: both turn away. u is what one that shares nothing has to change by.
    place, its = [3.0, 0.1], [-1.0, 0.0]
    whole = np.array(chosen([[*place, *its, R, 1.0, 0.5]], (1.0, 0.0), (1.0, 0.0), speed=50.0)[:2])
    half = np.array(chosen([[*place, *its, R, 0.5, 0.5]], (1.0, 0.0), (1.0, 0.0), speed=50.0)[:2])
    np.testing.assert_allclose(half - [1.0, 0.0], 0.5 * (whole - [1.0, 0.0]), atol=1e-12)
    assert least_gap(place, np.array(its) - whole, 3.0) == pytest.approx(2.0 * R, abs=1e-9)
    assert whole[1] < 0.0  # the other is on the left


@pytest.mark.parametrize("deceleration", [math.inf, 1.0])
def test_no_step_closes_more_than_the_share_of_the_gap(deceleration: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        bodies = []
        for _ in range(6):
            bearing, gap = rng.uniform(-math.pi, math.pi), rng.exponential(0.1)
            x, y = (2.0 * R + gap) * np.array([math.cos(bearing), math.sin(bearing)])
            bodies.append([x, y, *rng.uniform(-1.0, 1.0, 2), R, 0.5, 0.5])
        vx, vy, _ = chosen(bodies, (0.0, 0.0), tuple(rng.uniform(-1.0, 1.0, 2)), margin=0.1, deceleration=deceleration)
        for x, y, *_ in bodies:
            distance = math.hypot(x, y)
            closing = max((vx * x + vy * y) / distance, 0.0)
            way = 0.1 * closing + (0.0 if deceleration == math.inf else closing**2 / (2.0 * deceleration))
            assert way <= 0.5 * (distance - 2.0 * R) + 1e-9


def test_walls_hold_where_bodies_leave_nothing() -> None:
    # A wall all along the right at 0.21 m, and a body that comes from the left.
    angles = 2.0 * math.pi * np.arange(64) / 64
    scan = np.where(np.sin(angles) < -0.05, np.minimum(0.21 / np.maximum(-np.sin(angles), 1e-9), 5.0), 5.0)
    vx, vy, is_disturbed = chosen([[0.0, 0.6, 0.0, -1.0, R, 1.0, 1.0]], (0.0, 0.0), (0.5, 0.0), scan=scan)
    assert is_disturbed and vy >= -0.05 - 1e-9  # 0.01 m in two steps


@pytest.mark.parametrize("bearing", [0.0, 1.1, -2.0])
def test_two_that_are_nearer_than_they_would_like_keep_the_room_that_there_is(bearing: float) -> None:
    """They come no nearer; nor do they have to part at once, as those have to that overlap."""
    cos, sin = math.cos(bearing), math.sin(bearing)
    body = [0.45 * cos, 0.45 * sin, 0.0, 0.0, R, 0.5, 0.5]
    for ahead, aside in ((0.0, 0.5), (0.0, -0.5), (-0.4, 0.3)):
        wish = (ahead * cos - aside * sin, ahead * sin + aside * cos)
        assert chosen([body], (0.0, 0.0), wish, margin=0.1)[:2] == pytest.approx(wish, abs=1e-6)
    vx, vy, is_disturbed = chosen([body], (0.0, 0.0), (0.5 * cos, 0.5 * sin), margin=0.1)
    assert is_disturbed and cos * vx + sin * vy <= 1e-6


@pytest.mark.parametrize("deceleration", [math.inf, 1.0])
@pytest.mark.parametrize("gap", [0.01, 0.05, 0.15])
def test_walls_are_come_up_to_as_if_steps_were_twice_as_long(gap: float, deceleration: float) -> None:
    scan = NOTHING_SEEN.copy()
    scan[0] = R + gap  # straight ahead
    speed, _, is_disturbed = chosen([], (0.0, 0.0), (1.0, 0.0), scan=scan, deceleration=deceleration)
    assert 0.2 * speed + speed**2 / (2.0 * deceleration) == pytest.approx(gap) and not is_disturbed


def test_nothing_seen_hides_no_one_who_is_beyond_the_scan() -> None:
    """Others are told, not seen: at 1 m/s each, 5.9 m apart, they meet within 3 s."""
    assert chosen([[5.9, 0.0, -1.0, 0.0, R, 0.5, 0.5]], (1.0, 0.0), (1.0, 0.0))[2]


def test_who_has_settled_is_not_touched_though_no_beam_meets_it() -> None:
    vx, vy, _ = chosen([[2.0 * R + 0.05, 0.0, 0.0, 0.0, R, 0.0, 0.5]], (0.0, 0.0), (1.0, 0.0))
    assert 0.1 * vx == pytest.approx(0.5 * 0.05) and vy == 0.0


# ------------------------------------------------------------------------------------------------ who is there


def test_the_scan_without_the_others_is_that_of_a_world_without_them() -> None:
    settings = {"lidar": {"beams": 90, "range": 6.0}}
    wall = [[3, -3], [4, -3], [4, 3], [3, 3]]
    world = {"family": "explicit", "bounds": [-5, -5, 5, 5], "polygons": [wall], "start": [0, 0, 0.4], "goal": [-4, 0]}
    others = [[1.5, 0.5, 1.0], [-2.0, 1.0, 0.0], [0.0, -0.7, 0.0]]
    crew = Simulation({**settings, "world": world, "robots": [{"start": p} for p in [world["start"], *others]]})
    alone = Simulation({**settings, "world": world})
    seen, bare = crew.reset(seeds=[0])[0, 0], alone.reset(seeds=[0])[0, 0, :90].astype(float)
    policy: Any = make_policy("orca", crew)
    view, memory = View(seen, policy.sensors), policy.start()
    on_body = view.ranges < bare - 1e-6
    assert 8 < on_body.sum() < 60
    there = policy.who_is_there([view], [memory])
    (bodies,), (clean,) = there.of_each, there.views
    np.testing.assert_array_equal(bodies[:, :RADIUS], seen[-12:].reshape(3, 4))
    assert (bodies[:, RADIUS] == R).all() and (bodies[:, GAP_SHARE] == 0.5).all()
    np.testing.assert_array_equal(clean.ranges, np.where(on_body, 6.0, view.ranges))
    np.testing.assert_array_equal(clean.points, view.with_ranges(clean.ranges).points)
    settled = policy.start()
    settled.at_rest = np.full(3, 100.0)  # still things stay
    assert policy.who_is_there([view], [settled]).views[0] is view


def test_what_moves_is_avoided_where_it_is_and_taken_out_of_the_scan() -> None:
    start, motion = (0.5, -0.5, 0.7), {"law": "bounce", "velocity": [-0.5, 0.1]}
    world = {"family": "explicit", "bounds": [-9, -9, 9, 9], "start": start, "goal": [-8, 0]}
    world["movers"] = [{"shape": {"circle": 0.3}, "at": [2.0, 1.5], "motion": motion}]
    alone = Simulation({"lidar": {"beams": 180, "range": 6.0, "noise": 0.0}, "world": world})
    observation = alone.reset(seeds=[0])[0, 0]
    policy: Any = make_policy("orca", alone)
    memory = policy.start()
    for _ in range(16):
        view = View(observation, policy.sensors)
        there = policy.who_is_there([view], [memory])
        memory.steps += 1
        now = float(alone.world.time[0])
        observation = alone.step(np.zeros((1, 1, 2)))[0][0, 0]
    (bodies,), (clean,) = there.of_each, there.views
    cos, sin = math.cos(start[2]), math.sin(start[2])
    dx, dy = 2.0 - 0.5 * now - start[0], 1.5 + 0.1 * now - start[1]
    expected = (cos * dx + sin * dy, cos * dy - sin * dx, -0.5 * cos + 0.1 * sin, 0.1 * cos + 0.5 * sin)
    np.testing.assert_allclose(bodies[0, :RADIUS], expected, atol=0.1)
    assert bodies.shape == (1, BODY) and bodies[0, SHARE] == bodies[0, GAP_SHARE] == 1.0
    assert (view.ranges < 5.99).sum() >= 5 and not (clean.ranges < 5.99).any()  # nothing else is there


def test_what_is_known_less_well_is_taken_out_with_more_about_it() -> None:
    angles = 2.0 * math.pi * np.arange(8) / 8
    directions = np.stack([np.cos(angles), np.sin(angles)])
    known = np.array([R, 0.1, 5.0, 5.0, 0.03, 0.1, 0.0, 1.0])
    told = np.array([[2.0, 0.0, 0.5, 0.0, 0.0, 2.0, 0.5, 0.0]], dtype=np.float32)
    # A mover overlaps the second robot, and is it; another one is to the left behind, where the first one's frame lies.
    movers = np.array([[[1.0, 3.2, 0.5, 0.0, R], [-1.0, 1.0, 0.0, 0.5, R]]])
    for off, robots_go, mover_goes in ((0.02, True, True), (0.07, False, True), (0.12, False, False)):
        ranges = np.full((1, 8), 4.0)
        ranges[0, [0, 2]], ranges[0, 4] = 2.0 - R - off, 2.0 - R - off
        bodies, clean, points = np.empty((1, 4, BODY)), np.empty((1, 8)), np.empty((1, 2, 8))
        found = np.array([[2, 0, 0]])
        scan = known, ranges, directions, bodies, clean, points, found
        find_bodies(told, np.zeros((1, 2)), movers, np.array([[1.0, 1.0, 0.0]]), *scan)
        assert found[0].tolist() == [3, 2 * robots_go + mover_goes, 8 - 2 * robots_go - mover_goes if mover_goes else 0]
        np.testing.assert_allclose(bodies[0, 2], [-2.0, 0.0, 0.0, 0.5, R, 1.0, 1.0], atol=1e-12)
        assert (clean[0] == 5.0).nonzero()[0].tolist() == ([0, 2] if robots_go else []) + ([4] if mover_goes else [])


def test_who_is_there_is_found_for_many_as_for_each_alone() -> None:
    crew = Simulation("dynamic", 2, overrides={"robots.count": 3, "robot.kinematics": "holonomic"})
    policy: Any = make_policy("orca", crew)
    flat, state, movers = crew.reset(seeds=[0, 1]).reshape(6, -1), [policy.start() for _ in range(6)], 0
    for step in range(60):
        views, alone = [View(row, policy.sensors) for row in flat], copy.deepcopy(state)
        there = policy.who_is_there(views, state)
        for row, memory in enumerate(alone):
            one = policy.who_is_there([views[row]], [memory])
            np.testing.assert_array_equal(there.of_each[row], one.of_each[0])
            np.testing.assert_array_equal(there.views[row].ranges, one.views[0].ranges)
            np.testing.assert_array_equal(state[row].at_rest, memory.at_rest)
            state[row].steps += 1
            movers += len(one.of_each[0]) - 2
        moves = np.zeros((2, 3, 2))
        moves[:, 0, 0] = 1.0 if step < 30 else 0.0  # some robots rest for longer than others
        flat = crew.step(moves)[0].reshape(6, -1)
    assert movers > 0 and len({float(memory.at_rest[0]) for memory in state}) > 1


@pytest.mark.parametrize("seed", range(200))
def test_who_goes_ahead_while_it_turns_closes_no_more_than_its_share_of_a_gap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle, away = rng.uniform(-0.4, 0.4), rng.uniform(0.42, 0.6)
    bearing = rng.uniform(-0.8, 0.8)
    body = [away * math.cos(bearing), away * math.sin(bearing), 0.0, 0.0, R, 0.0, 0.5]
    robot = np.array([R, 0.0, 0.0, 1.0, 3.0, 0.1, math.inf, 0.2, 1.5])
    scan, made = np.full((1, 8), 5.0), np.empty((1, CHOSEN))
    ask = np.zeros((1, 2)), np.array([[math.cos(angle), math.sin(angle)]])
    beams = 2.0 * math.pi * np.arange(8) / 8
    wall = scan, scan, np.cos(beams), np.sin(beams), 5.0
    choose_velocities(*wall, np.array([[body]]), np.array([1]), robot, *ask, np.empty(60), np.empty(60), made)
    x, y, _, slow_x, slow_y = made[0].tolist()
    speed, slow, error = math.hypot(x, y), math.hypot(slow_x, slow_y), math.atan2(y, x)
    assert slow <= speed + 1e-12 and math.atan2(slow_y, slow_x) == pytest.approx(error)
    if abs(error) <= kinematics.TURN_IN_PLACE and speed > 0.0:
        chord = 0.5 * kernels.turn_rate(error, 0.1, 1.5) * 0.1
        closing = math.cos(chord - bearing)
        limit = 0.5 * (away - 2.0 * R) / 0.1 / closing if closing > 0.0 else math.inf
        assert slow == pytest.approx(max(min(speed, limit), 1e-6 * speed))


def test_beams_off_a_body_are_taken_out_and_no_others() -> None:
    rng = np.random.default_rng(0)
    angles = 2.0 * math.pi * np.arange(120) / 120
    directions = np.stack([np.cos(angles), np.sin(angles)])
    taken = 0
    for _ in range(40):
        ranges, place = rng.uniform(0.2, 6.0, 120).clip(max=5.0), tuple(rng.uniform(-4.0, 4.0, 2))
        reach, expected = rng.uniform(0.2, 0.8), ranges.copy()
        for beam, (x, y) in enumerate((directions * ranges).T):
            if ranges[beam] < 5.0 and math.hypot(x - place[0], y - place[1]) <= reach:
                expected[beam] = 4.5
        count = take_out_disc(ranges, directions, 5.0, 4.5, place, reach)
        np.testing.assert_array_equal(ranges, expected)
        assert count == (expected == 4.5).sum()
        taken += count
    assert taken > 10


def test_who_stands_takes_no_share_and_then_is_a_still_thing() -> None:
    peers, at_rest = np.zeros((3, BODY)), np.zeros(3)
    peers[0, 2:4], peers[1, 2:4] = (0.3, -0.4), (0.005, 0.005)  # the third stands
    for step in range(1, 25):
        share_out(peers, at_rest, 0.125)
        is_settled = step > 16
        assert peers[:, SHARE].tolist() == [0.5, 0.0 if is_settled else 1.0, 0.0 if is_settled else 1.0], step
    peers[2, 3] = 1.0
    share_out(peers, at_rest, 0.125)
    assert peers[:, SHARE].tolist() == [0.5, 0.0, 0.5] and at_rest[2] == 0.0


def test_a_track_that_overlaps_a_robot_is_taken_for_it() -> None:
    peers, tracks = np.zeros((2, BODY)), np.zeros((3, BODY))
    peers[:, 0], peers[:, RADIUS] = (2.0, -2.0), R
    tracks[:, 0], tracks[:, 1], tracks[:, RADIUS] = (2.0, -2.0, 2.0), (0.29, 0.31, -1.0), 0.1
    assert [is_among(track, peers) for track in tracks] == [True, False, False]


def test_a_robot_behind_a_wall_is_no_reason_to_turn_aside() -> None:
    scan = np.full(64, 1.0)
    behind = [[1.6, 0.0, -1.0, 0.0, R, 0.5, 0.5]]
    assert not chosen(behind, (0.0, 0.0), (0.7, 0.0), scan=scan)[2]
    assert chosen(behind, (0.0, 0.0), (0.7, 0.0), scan=np.full(64, 5.0))[2]


def test_a_robot_gets_no_farther_off_its_line_than_its_radius_is_enlarged_by() -> None:
    scenario = load("empty", {"robot.kinematics": "differential"})
    sensors = Sensors.of(scenario)
    error, aside = kinematics.TURN_IN_PLACE, 0.0
    for _ in range(100_000):  # in small steps, at top speed times the cosine, as the robot is steered
        rate = kinematics.turn_rate(sensors.drive, error)
        aside += 1e-4 * math.cos(error) * math.sin(error)
        error -= 1e-4 * rate
    assert 0.5 * orca.off_the_line(sensors) < aside <= orca.off_the_line(sensors)


# ------------------------------------------------------------------------------------------------ drives


class Drive:
    """What came of episodes of several robots."""

    def __init__(self, scenario: Any, overrides: dict[str, Any], *, seeds: int = 1, **parameters: Any) -> None:
        simulation = Simulation(scenario, seeds, overrides=overrides)
        simulation.reset(seeds=range(seeds))
        policy, robots = make_policy("orca", simulation, **parameters), simulation.robots
        pairs = list(itertools.combinations(range(robots), 2))
        self.nearest, state = math.inf, None
        while simulation.world.active.any():
            actions, state = policy.predict(simulation.observations().reshape(seeds * robots, -1), state)
            simulation.advance(actions.reshape(seeds, robots, 2))
            place = simulation.world.pose[..., :2]
            for one, other in pairs:
                self.nearest = min(self.nearest, float(np.hypot(*(place[:, one] - place[:, other]).T).min()))
        info = simulation.info()
        self.outcomes, self.times = set(info["outcome"].ravel().tolist()), info["time"]


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(("robots", "seeds"), [(2, 8), (4, 4), (8, 2), (16, 1)])
def test_robots_change_places_across_a_circle_without_a_contact(robots: int, seeds: int, kinematics: str) -> None:
    drive = Drive("circle_swap", {"robots.count": robots, "robot.kinematics": kinematics}, seeds=seeds)
    assert drive.outcomes == {"success"}
    assert drive.nearest >= 2.0 * R
    assert drive.times.max() <= 4.0 * 7.7  # 8 m less the goal's radius, at 1 m/s


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_two_head_on_by_symmetry_pass(kinematics: str) -> None:
    places = [{"start": [-3, 0, 0], "goal": [3, 0]}, {"start": [3, 0, math.pi], "goal": [-3, 0]}]
    scenario = {"robot": {"kinematics": kinematics}, "world": {"family": "empty"}, "robots": places}
    drive = Drive(scenario, {})
    assert drive.outcomes == {"success"} and drive.nearest >= 2.0 * R


@pytest.mark.parametrize("held_up", [0.0, 0.3, 1.0])
def test_a_wish_is_turned_to_the_right_by_a_share_of_86_degrees_for_what_is_held_up(held_up: float) -> None:
    policy: Any = make_policy("orca", "circle_swap")
    angles = []
    for seed in range(200):
        x, y = policy._sidestep(orca.OrcaMemory(wish=(0.6, 0.0), held_up=held_up, seed=seed))
        assert math.hypot(x, y) == pytest.approx(0.6)
        angles.append(math.atan2(y, x))
    assert -1.5 * held_up <= min(angles) <= -1.4 * held_up and -0.1 * held_up <= max(angles) <= 0.0


def test_an_angle_is_kept_for_a_second_and_then_drawn_anew() -> None:
    policy: Any = make_policy("orca", "circle_swap")
    assert policy.sensors.drive.step == 0.1
    drawn = [
        policy._sidestep(orca.OrcaMemory(wish=(0.6, 0.0), held_up=1.0, seed=7, steps=steps)) for steps in range(60)
    ]
    assert len(set(drawn)) == 6 and all(len(set(drawn[10 * leg : 10 * leg + 10])) == 1 for leg in range(6))


def test_robots_draw_angles_of_their_own() -> None:
    crew = Simulation("circle_swap", overrides={"robots.count": 6})
    policy: Any = make_policy("orca", crew)
    memories = [policy.start() for _ in range(6)]
    policy.who_is_there([View(row, policy.sensors) for row in crew.reset(seeds=[0])[0]], memories)
    assert len({memory.seed for memory in memories}) == 6


def test_who_is_held_up_by_walls_alone_does_not_turn_aside() -> None:
    wall = [[2.0, -2.0], [2.5, -2.0], [2.5, 2.0], [2.0, 2.0]]
    world = {"family": "explicit", "bounds": [-4, -4, 8, 4], "polygons": [wall], "start": [0, 0, 0], "goal": [6, 0]}
    episode = run_episode("orca", {"world": world}, way="goal", max_steps=60)
    assert episode.path[-1, 0] > 1.7 and np.abs(episode.path[:, 1]).max() < 1e-6


class ShutIn:
    """A bug that finds out at once that there is no way."""

    def start(self) -> Memory:
        return Memory(mode="go")

    def act(self, view: View, memory: Memory) -> tuple[float, float]:
        memory.verdict = "unreachable"
        return 0.5, 0.1


def test_what_a_bug_has_found_out_counts_only_if_no_one_pushed_the_robot_about_meanwhile() -> None:
    policy: Any = orca.Orca(Sensors.of(load("circle_swap")))
    policy.bug = ShutIn()
    view, memory = View(Simulation("circle_swap").reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    policy._wish(view, memory)
    assert memory.verdict == "unreachable"
    anew: list[Memory] = []

    class Open(ShutIn):
        def act(self, view: View, memory: Memory) -> tuple[float, float]:
            if memory.mode == "go":  # the one that was begun first
                return super().act(view, memory)
            anew.append(memory)
            return 0.3, 0.0

    policy.bug = Open()
    memory = policy.start()
    memory.was_disturbed = True
    policy.bug.start = lambda: Memory(mode="anew")
    wish = policy._wish(view, memory)
    assert (memory.verdict, memory.was_disturbed, wish) == ("", False, (0.3, 0.0)) and memory.bug is anew[0]
    memory.bug = Memory(mode="go")  # what this one finds out, undisturbed, is true
    policy._wish(view, memory)
    assert memory.verdict == "unreachable"


def test_a_robot_with_a_verdict_stands() -> None:
    policy: Any = orca.Orca(Sensors.of(load("empty")))
    policy.bug = ShutIn()
    view, memory = View(Simulation("empty").reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    assert policy.act(view, memory) == (0.0, 0.0) and memory.verdict == "unreachable"


def test_a_robot_that_has_to_turn_is_enlarged_by_what_it_gets_off_its_line_and_so_is_the_other() -> None:
    for overrides, own, kept in (
        ({"robot.kinematics": "holonomic"}, {}, 0.0),
        ({"robot.kinematics": "differential"}, {"enlargement": 0.1}, 0.2),
        ({"robot.kinematics": "differential"}, {}, None),
    ):
        policy: Any = make_policy("orca", load("circle_swap", overrides), **own)
        expected = 2.0 * orca.off_the_line(policy.sensors) if kept is None else kept
        assert policy.margin == pytest.approx(orca.SKIN + expected)


@pytest.mark.parametrize("max_acceleration", [None, 1.0])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_robots_that_all_want_to_one_place_do_not_touch(kinematics: str, max_acceleration: float | None) -> None:
    angles = 2.0 * math.pi * np.arange(10) / 10 + 0.1
    starts = [[3.0 * math.cos(a), 3.0 * math.sin(a), 1.3 * a] for a in angles.tolist()]
    scenario = {
        "robot": {"kinematics": kinematics, "max_acceleration": max_acceleration},
        "time": {"limit": 15.0},
        "goal": {"radius": 0.05},
        "world": {"family": "empty", "goal": [0, 0]},
        "robots": [{"start": start} for start in starts],
    }
    drive = Drive(scenario, {})
    assert "collision" not in drive.outcomes and drive.nearest >= 2.0 * R


@pytest.mark.parametrize("max_acceleration", [0.5, 1.0])
def test_eight_who_can_hardly_slow_down_do_not_touch_in_the_middle(max_acceleration: float) -> None:
    robot = {"robot.kinematics": "holonomic", "robot.max_acceleration": max_acceleration}
    drive = Drive("circle_swap", {"robots.count": 8, **robot}, seeds=5)
    assert drive.outcomes == {"success"} and drive.nearest >= 2.0 * R


@pytest.mark.parametrize(("max_acceleration", "latency"), [(None, 0.3), (1.0, 0.3), (1.0, 0.0)])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_those_with_inertia_do_not_touch_either(
    kinematics: str, max_acceleration: float | None, latency: float
) -> None:
    robot = {"robot.kinematics": kinematics, "robot.max_acceleration": max_acceleration, "robot.latency": latency}
    for robots in (2, 6):
        drive = Drive("circle_swap", {"robots.count": robots, "lidar.noise": 0.0, **robot}, seeds=2, way="goal")
        assert drive.outcomes == {"success"} and drive.nearest >= 2.0 * R
    starts = [[1.0, 0.0, 3.0], [-1.0, 0.0, 0.0], [0.0, 1.2, -1.5], [0.3, -1.2, 1.5], [2.0, 0.7, 3.0]]
    world = {"family": "empty", "goal": [0, 0]}  # all of them want to one place, and near one another they begin
    scenario = {"time": {"limit": 15.0}, "goal": {"radius": 0.05}, "world": world}
    drive = Drive({**scenario, "robots": [{"start": start} for start in starts]}, robot)
    assert "collision" not in drive.outcomes and drive.nearest >= 2.0 * R


@pytest.mark.parametrize("seed", range(12))
def test_two_who_do_as_they_like_behind_their_borders_never_touch_however_late_that_acts(seed: int) -> None:
    """They go as fast as they can at one another, past it or at random, up to the border; each works it out by itself."""
    rng, step, late, kept = np.random.default_rng(seed), 0.1, 3, R + 0.01
    drive = np.array([kept, 1.0, math.inf, step * late])
    assert len(drive) == LATE_DRIVE
    places, velocities, poses = (
        np.array([[0.0, 0.0], rng.uniform(0.45, 1.5, 2)]),
        np.zeros((2, 2)),
        rng.uniform(-3, 3, 2),
    )
    borders, pending, aim = np.zeros((2, 1, BORDER)), np.zeros((2, late, 2)), rng.uniform(-2, 2, (2, 2))
    nearest, turned = math.inf, 0.0
    for number in range(400):
        if number % 20 == 0:  # one goes where the other is, or both anywhere
            aim = places[::-1].copy() if rng.random() < 0.5 else rng.uniform(-2, 2, (2, 2))
        asked = np.zeros((2, 2))
        before = borders.copy()
        for own, its in ((0, 1), (1, 0)):
            cos, sin = math.cos(poses[own]), math.sin(poses[own])  # each in a frame of its own
            into, body = np.array([[cos, -sin], [sin, cos]]), np.zeros((1, BODY))
            body[0, :2], body[0, 2:4] = (places[its] - places[own]) @ into, velocities[its] @ into
            pose = np.array([*places[own], poses[own]])
            move_borders(borders[own], body, pose, math.hypot(*velocities[own]), drive)
            x, y, along = borders[own, 0]
            then = places[own] + step * pending[own].sum(axis=0)
            room = along - kept - x * then[0] - y * then[1]
            assert room >= -1e-9  # to stand is always left
            wish = rng.uniform(0.3, 1.0) * (aim[own] - then) / max(math.hypot(*(aim[own] - then)), 1e-6)
            over = max(wish @ (x, y) - max(room, 0.0) / step, 0.0)
            asked[own] = wish - over * np.array([x, y])
        np.testing.assert_allclose(borders[1, 0], [-borders[0, 0, 0], -borders[0, 0, 1], -borders[0, 0, 2]], atol=1e-6)
        turned += abs(before[0, 0, 0] * borders[0, 0, 1] - before[0, 0, 1] * borders[0, 0, 0])
        velocities, pending = pending[:, 0].copy(), np.concatenate([pending[:, 1:], asked[:, None]], axis=1)
        places = places + step * velocities
        nearest = min(nearest, math.hypot(*(places[0] - places[1])))
    assert nearest >= 2.0 * kept - 1e-6 and turned > 1.0  # and they get past one another


def test_what_would_lead_over_a_border_is_not_sent() -> None:
    late = {"robot.kinematics": "holonomic", "robot.latency": 0.2, "robots.count": 2}
    simulation = Simulation("circle_swap", overrides=late)
    policy: Any = make_policy("orca", simulation)
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    x, y, forward = *view.pose[:2], np.array([1.0, 0.0], dtype=np.float32)
    view.under_way = []  # it stands until this acts
    for left, goes in ((0.11, True), (0.09, False)):  # a step is 0.1 m
        memory.borders = np.array([[1.0, 0.0, x + policy.late.kept + left]])
        expected = forward if goes else [0.0, 0.0]
        assert view.heading == 0.0 and y == 0.0
        np.testing.assert_array_equal(policy.last_word(view, memory, forward), expected)


def test_borders_are_kept_only_among_others_by_those_with_inertia() -> None:
    late, slow = {"robot.latency": 0.2, "robots.count": 2}, {"robot.max_acceleration": 1.0, "robots.count": 2}
    for overrides, discrete, has in ((late, False, True), (slow, False, True), (late, True, False), ({}, False, False)):
        policy = orca.Orca(Sensors.of(load("circle_swap", overrides)), discrete=discrete)
        assert (policy.late is not None) is has
    alone: Any = make_policy("orca", load("static", {"robot.latency": 0.2}))
    assert alone.late is None


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(("scenario", "robots"), [("corridor_swap", 4), ("warehouse_team", 8), ("crossing_robots", 4)])
def test_among_walls_it_takes_its_way_from_a_bug(scenario: str, robots: int, kinematics: str) -> None:
    drive = Drive(scenario, {"robots.count": robots, "robot.kinematics": kinematics})
    assert drive.outcomes == {"success"} and drive.nearest >= 2.0 * R


def test_straight_to_the_goal_a_wall_is_the_end_of_the_way() -> None:
    alone = {"robots.count": 1, "time.limit": 40.0}
    assert Drive("rectangle_pair", alone, way="goal").outcomes == {"timeout"}
    assert Drive("rectangle_pair", {"robots.count": 1}, way="hd_bug").outcomes == {"success"}


def test_it_goes_round_a_robot_that_stands_on_its_way() -> None:
    # The other is where it wants to be, in a passage of 1.2 m, and never moves. What is left beside it, 0.7 m, is less than
    # a differential robot would like: without the bug, which takes who rests for a wall, it would stand there for ever.
    walls = [[[-3, 0.6], [3, 0.6], [3, 2], [-3, 2]], [[-3, -2], [3, -2], [3, -0.6], [-3, -0.6]]]
    world = {"family": "explicit", "bounds": [-6, -2, 6, 2], "polygons": walls, "start": [0, 0, 0], "goal": [4, 0]}
    places = [{"start": [-5, 0, 0], "goal": [5, 0]}, {"start": [0, -0.3, 0], "goal": [0.1, -0.3]}]
    for kinematics_ in ("holonomic", "differential"):
        drive = Drive({"robot": {"kinematics": kinematics_}, "world": world, "robots": places}, {})
        assert drive.outcomes == {"success"} and drive.nearest >= 2.0 * R


def test_movers_that_do_not_look_are_avoided_through_tracks() -> None:
    def successes(**parameters: Any) -> int:
        return sum(run_episode("orca", "crossing", seed=seed, **parameters).outcome == "success" for seed in range(6))

    assert successes() >= 5 and successes(sees_movers=False) <= 3


def test_it_says_that_there_is_no_way_where_its_bug_does() -> None:
    assert run_episode("orca", "ring").verdict == "unreachable"


def test_it_drives_robots_of_a_parallel_env() -> None:
    env = bug_gym.parallel_env("circle_swap", robots=3)
    policy: Any = make_policy("orca", env)
    observations, infos = env.reset(seed=0)
    state = None
    while env.agents:
        actions, state = policy.predict(observations, state)
        observations, _, _, _, told = env.step(actions)
        observations = {agent: observations[agent] for agent in env.agents}
        infos |= told
    assert all(info["is_success"] for info in infos.values())


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"way": "bug2"}, "way"),
        ({"horizon": 0.0}, "horizon must be positive, got 0.0"),
        ({"enlargement": -0.1}, "enlargement must be at least 0, got -0.1"),
    ],
)
def test_parameters_that_cannot_be_are_refused(parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make_policy("orca", "circle_swap", **parameters)


def test_columns_of_a_body_are_all_used() -> None:
    assert sorted({0, 1, 2, 3, RADIUS, SHARE, GAP_SHARE}) == list(range(BODY))
