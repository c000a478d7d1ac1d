"""Differential robots of scripted policies: arcs that are free, no dithering, and the pace of holonomic ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from episodes import run_episode
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bug_gym import kernels
from bug_gym.agents.scan.contour_ahead import contour_ahead
from bug_gym.config import load
from bug_gym.geometry import F64
from bug_gym.policy import braking_radius
from bug_gym.reproductions.barn import PARAMETERS
from bug_gym.reproductions.bug_no_way import problem
from bug_gym.reproductions.claims import CLEARANCE
from bug_gym.reproductions.cylinder_claims import is_shut
from bug_gym.reproductions.cylinder_claims import scenario as cylinders
from bug_gym.simulation import Simulation
from bug_gym.steering import Course, heading_error, look_ahead, steered_action
from bug_gym.view import Sensors, View

coordinates = st.floats(-2.0, 2.0)
points = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=12)


def least_gap(px: F64, py: F64, bend: float, side: int, turn: float) -> float:
    """Least distance of points to a disc's centre on an arc, looked at in many places of it [m]."""
    angle = np.linspace(0.0, turn, 4000)
    x, y = bend * np.sin(angle), side * bend * (1.0 - np.cos(angle))
    return float(np.hypot(px[:, None] - x, py[:, None] - y).min())


@settings(max_examples=300, deadline=None)
@given(points, st.floats(0.02, 3.0), st.sampled_from([-1, 1]), st.floats(0.1, 6.2))
def test_a_disc_turns_as_far_as_it_touches_nothing(
    scan: list[tuple[float, float]], bend: float, side: int, most: float
) -> None:
    radius = 0.3
    px, py = np.array([p[0] for p in scan]), np.array([p[1] for p in scan])
    if np.hypot(px, py).min() <= radius:
        return  # those it touches already are looked at below
    free = kernels.free_turn(px, py, bend, side, radius, most)
    assert 0.0 <= free <= most
    slip = 1e-5 + (bend * most / 4000) ** 2 / radius
    assert least_gap(px, py, bend, side, free) >= radius - 1e-9
    if free < most:
        assert least_gap(px, py, bend, side, free) <= radius + slip + bend * most / 4000


def test_a_point_that_is_touched_already_blocks_only_who_comes_nearer() -> None:
    def free(x: float, y: float) -> float:
        return float(kernels.free_turn(np.array([x]), np.array([y]), 0.5, 1, 0.3, 1.0))

    assert free(0.2, 0.0) == 0.0 and free(-0.2, 0.1) == 1.0


@settings(max_examples=200, deadline=None)
@example([(0.375, 0.0)], 0.0, 0.5)  # straight on, and a thing there
@given(points, st.floats(-1.2, 1.2), st.floats(0.05, 0.5))
def test_the_arc_to_a_course_is_free_and_close_to_it_and_within_the_limits(
    scan: list[tuple[float, float]], bearing: float, aside: float
) -> None:
    px, py = np.array([p[0] for p in scan]), np.array([p[1] for p in scan])
    if np.hypot(px, py).min() <= 0.3:
        return
    line = np.array([(0.0, 0.0), (1.4 * math.cos(bearing), 1.4 * math.sin(bearing))])
    speed, bend = kernels.pursue(px, py, line, 0.1, np.empty((15, 2)), 1.0, 1.5, 0.3, aside, 0.0)
    assert 0.0 <= speed <= 1.0
    if speed == 0.0:
        return
    side = 1 if bend > 0.0 else -1
    assert speed / abs(bend) <= 1.5 + 1e-9
    # To the nearest place of the line, 0.1 m away, in any case.
    assert least_gap(px, py, abs(bend), side, min(0.1 / abs(bend), math.pi)) >= 0.3 - 1e-6


@pytest.mark.parametrize("hand", [0, 1, -1])
def test_a_step_ends_before_what_is_seen_though_the_course_ends_nearer(hand: int) -> None:
    wall = [[0.29, -1.0], [0.5, -1.0], [0.5, 1.0], [0.29, 1.0]]  # 0.09 m before the body, which goes 0.1 m in a step
    world = {"family": "explicit", "polygons": [wall], "start": [0, 0, 0], "goal": [4, 0]}
    simulation = Simulation({"robot": {"kinematics": "differential"}, "lidar": {"beams": 360}, "world": world})
    view = View(simulation.reset(seeds=[0])[0, 0], Sensors.of(simulation.scenario))
    course = Course(np.array([[0.0, 0.0], [0.02, 0.0]]), 0.1, hand)
    speed, rate = steered_action(view, (1.0, 0.0), course, braking_radius(view.sensors), None)
    simulation.step(np.array([[[speed, rate]]]))
    assert simulation.info()["outcome"][0, 0] == "running"
    assert simulation.info()["path_length"][0, 0] > 0.02  # it goes on as far as it can


def test_the_course_is_followed_at_full_speed_through_a_right_angle_where_there_is_room() -> None:
    corner = np.array([(0.0, 0.0), (0.7, 0.0), (0.7, 3.0)])
    none = np.empty(0)
    speed, bend = kernels.pursue(none, none, corner, 0.1, np.empty((15, 2)), 1.0, 1.5, 0.3, 0.3, 0.0)
    assert speed == 1.0 and bend >= 1.0 / 1.5


def test_a_robot_that_turns_toward_what_lies_behind_it_does_not_turn_round() -> None:
    for bearing in np.radians([155.0, 179.0, -179.0, -155.0]):
        velocity = math.cos(bearing), math.sin(bearing)
        assert heading_error(velocity, 1.5) > 0.0 and heading_error(velocity, -1.5) < 0.0
        assert math.cos(heading_error(velocity, 1.5)) == pytest.approx(math.cos(bearing))


def test_toward_what_lies_beside_it_a_robot_turns_the_shorter_way() -> None:
    """Whichever way it turns now: 137 degrees back take less time than 223 on."""
    for bearing in np.radians([137.0, -137.0]):
        velocity = math.cos(bearing), math.sin(bearing)
        for rate in (-1.5, 0.0, 1.5):
            assert heading_error(velocity, rate) == pytest.approx(bearing)


def test_it_looks_as_far_as_a_turn_at_full_speed_needs() -> None:
    drive = Sensors.of(load("empty", {"robot.kinematics": "differential"})).drive
    assert look_ahead(drive) >= 2.0 * drive.max_speed / drive.max_turn_rate


def turns_to_and_fro(heading: F64) -> int:
    """How often a robot that turns by more than 2 degrees a step turns the other way the next time."""
    change = (np.diff(heading) + math.pi) % (2.0 * math.pi) - math.pi
    ways = np.sign(change[np.abs(change) > math.radians(2.0)])
    return int((np.diff(ways) != 0.0).sum())


STRAIGHT = {
    "robot": {"kinematics": "differential"},
    "lidar": {"beams": 180},
    "time": {"limit": 60.0},
    "world": {
        "family": "explicit",
        "bounds": [0, 0, 16, 8],
        "start": [2, 3, math.pi],
        "goal": [14, 3],
        "polygons": [[[1, 0], [15, 0], [15, 2.4], [1, 2.4]]],
    },
}


@pytest.mark.parametrize("name", ["tangent_bug", "hd_bug_map"])
def test_beside_a_straight_wall_it_does_not_turn_to_and_fro(name: str) -> None:
    """It starts with its back to the goal."""
    episode = run_episode(name, STRAIGHT)
    assert episode.outcome == "success"
    assert turns_to_and_fro(episode.path[:, 2]) <= 3


@pytest.mark.parametrize(
    ("name", "scenario", "seeds"),
    [("tangent_bug", "static", 6), ("hd_bug_map", "static", 4), ("hd_bug_map", "rooms", 3)],
)
def test_a_differential_robot_keeps_nine_tenths_of_the_holonomic_pace(name: str, scenario: str, seeds: int) -> None:
    paces: dict[str, list[float]] = {"holonomic": [], "differential": []}
    for kinematics, pace in paces.items():
        for seed in range(seeds):
            episode = run_episode(name, scenario, {"robot.kinematics": kinematics}, seed=seed)
            assert episode.outcome == "success"
            pace.append(episode.length / (0.1 * (len(episode.path) - 1)))
    assert np.mean(paces["differential"]) >= 0.9 * np.mean(paces["holonomic"])


@pytest.mark.parametrize(("world", "seeds", "share"), [("rooms", (0, 1, 3), 0.9), ("maze", (3, 6), 0.87)])
def test_along_walls_a_differential_robot_nearly_keeps_the_holonomic_pace(
    world: str, seeds: tuple[int, ...], share: float
) -> None:
    """Of Bug2; one that doesn't round corners keeps 0.82 in rooms, one that rounds none after a spiral 0.82 in mazes."""
    paces = []
    for kinematics in ("holonomic", "differential"):
        robot = {"robot.kinematics": kinematics, "time.limit": 600.0}
        episodes = [run_episode("bug2", world, robot, seed=seed) for seed in seeds]
        assert all(episode.outcome == "success" for episode in episodes)
        paces.append(sum(len(episode.path) - 1 for episode in episodes))
    assert paces[0] >= share * paces[1]


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        pytest.param("bug2", 1, id="goal in a corner"),
        pytest.param("bug2", 73, id="small room with a door"),
        pytest.param("com1", 93, id="small room that is shut"),
        pytest.param("class1", 26, id="small disc"),
        pytest.param("bug2", 5, id="shut"),
        pytest.param("dist_bug", 3, id="shut too"),
        pytest.param("dist_bug", 4, id="blind gap"),
        pytest.param("rev1", 4, id="blind gap twice"),
    ],
)
def test_rounded_corners_hide_no_way_and_make_none(name: str, seed: int) -> None:
    """In the first a corner that is cut holds the goal, in the next two arcs lead past a door, in the fourth past a gate; the
    last have a blind gap, out of whose widest place each way is narrower.
    """
    world = problem(seed)
    robot = {"robot.kinematics": "differential"}
    episode = run_episode(name, world.scenario, robot, clearance=CLEARANCE)
    assert episode.min_clearance > 0.0
    assert (episode.outcome, episode.verdict) == (("success", "") if world.has_way else ("running", "unreachable"))


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        ("bug1", 34),
        ("bug2", 78),
        ("alg1", 74),
        ("dist_bug", 88),
        ("rev1", 74),
        ("alg2", 31),
        ("com1", 219),
        ("bug2", 7),
    ],
)
def test_among_cylinders_that_stand_close_together_corners_are_kept_to(name: str, seed: int) -> None:
    """Rounded, arcs led the hand to another cylinder, across a gap that is hardly one; or back to where none goes straight.

    In the last two a lap proves nothing, and from then on corners are kept to.
    """
    shut = is_shut(seed)
    world = load(cylinders("holonomic", shut=shut), {"robot.kinematics": "differential"})
    episode = run_episode(name, world, seed=seed, **PARAMETERS["holonomic"])
    assert (episode.outcome, episode.verdict) == (("running", "unreachable") if shut else ("success", ""))


def test_the_contour_ahead_ends_where_the_hand_would_come_to_something_else() -> None:
    """Along a wall, which goes on round a corner in the first, and in the second behind a gap too narrow to pass."""
    along = [(0.1 * k, -0.3) for k in range(-10, 13)]
    corner = [(1.3, -0.3 + 0.1 * k) for k in range(1, 20)]
    for gap, leads_on in ((0.2, True), (0.6, False)):
        wall = [(x, y) for x, y in along if x <= 1.3 - gap + 1e-9] + corner
        px, py = np.array(wall).T
        places = np.empty((16, 3))
        count = contour_ahead(px, py, (0.0, 0.0, 0.0), 1, 0.1, 0.3, 0.28, places)
        assert (count == len(places)) is leads_on, (gap, count)


def time_along(chain: list[tuple[float, float]]) -> float:
    """In what time arcs and turns go along a chain that begins at the origin along x [s], at 1 m/s and 1.5 rad/s."""
    samples, none = np.empty((17, 3)), np.empty(0)
    places = np.array([(-0.2, 0.0), *chain])  # the second sample of it is the chain's first place
    kernels.round_corners(none, none, places, 0.1, samples, 1.0, 1.5, 0.3, 0.3, 0.1, 1)
    assert samples[1, :2] == pytest.approx([0.0, 0.0])
    return float(samples[1, 2])


def test_a_straight_piece_takes_its_time() -> None:
    straight, corner = [(0.0, 0.0), (1.5, 0.0)], [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0)]
    assert time_along(straight) == pytest.approx(1.5)
    # A turn and both legs, unless an arc saves some; the turn alone and the air line in any case.
    assert max(math.pi / 3.0, math.hypot(0.5, 1.0)) <= time_along(corner) <= math.pi / 3.0 + 1.5


def test_a_slow_arc_is_begun_in_time_before_a_dead_end() -> None:
    """Three sides of a square of 0.6 m: a half circle of 0.3 m takes less time than two turns on the spot. Still less take two
    arcs of 0.5 m, up to the side across and on from there, with a turn on the spot between them: they end farther on.
    """
    dead_end = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.6), (-0.3, 0.6)]
    none, places = np.empty(0), np.array(dead_end)
    speed, bend = kernels.round_corners(none, none, places, 0.1, np.empty((15, 3)), 1.0, 1.5, 0.3, 0.3, 0.1, 1)
    assert 0.25 <= bend <= 0.5 and speed == pytest.approx(1.5 * bend)
    half_circle, two_arcs = math.pi / 1.5 + 0.3, math.pi / 1.5 + 0.1
    assert math.pi / 1.5 < time_along(dead_end) <= two_arcs + 1e-6 < half_circle


def test_an_arc_toward_the_wall_keeps_closer_to_its_contour() -> None:
    """To the right, so with the wall on the right; the tight one goes straight on until it may turn."""
    corner = np.array([(0.0, 0.0), (0.6, 0.0), (0.6, -3.0)])
    none = np.empty(0)

    def bend(hand: int) -> float:
        return abs(kernels.round_corners(none, none, corner, 0.1, np.empty((25, 3)), 1.0, 1.5, 0.3, 0.3, 0.05, hand)[1])

    assert bend(-1) < 2.0 and bend(1) > 10.0


def test_an_arc_of_the_course_is_free() -> None:
    line = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 3.0)])
    px, py = np.array([0.55]), np.array([0.3])  # beyond the corner
    speed, bend = kernels.round_corners(px, py, line, 0.1, np.empty((15, 3)), 1.0, 1.5, 0.3, 0.3, 0.3, 1)
    if speed > 0.0:
        assert least_gap(px, py, abs(bend), 1 if bend > 0.0 else -1, min(0.1 / abs(bend), math.pi)) >= 0.3 - 1e-6
