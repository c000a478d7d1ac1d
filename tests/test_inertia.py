"""Robots with inertia stop before what they see, whatever an algorithm asks for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from compiled import for_python
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely import LineString, MultiPoint

from bug_gym import kernels
from bug_gym import kinematics as kinematics_of
from bug_gym.agents import make_policy
from bug_gym.config import Scenario, load
from bug_gym.evaluation import evaluate
from bug_gym.geometry import velocity_along, wrap
from bug_gym.inertia import (
    LEAST_PACE,
    LEAST_ROOM,
    POST,
    are_cut_at_once,
    farthest_way,
    needs_care,
    pace_in_sight,
    speed_within,
    stoppable_action,
    stoppable_actions,
    stopping_radius,
    way_to_stand,
)
from bug_gym.kernels import stopping
from bug_gym.kinematics import Drive
from bug_gym.navigation_env import NavigationEnv
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.reproductions import still_things
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

passes_side: Any = for_python(stopping.passes_side)

SPEEDS, ACCELERATIONS, STEPS = st.floats(0.0, 3.0), st.floats(0.1, 10.0), st.sampled_from([0.05, 0.1, 0.2])


def driven_and_braked(speed: float, acceleration: float, step: float) -> float:
    """Way of a step at a speed and of all that follow while the robot brakes, one by one [m]."""
    way = 0.0
    while speed > 1e-12:
        way += speed * step
        speed = max(speed - acceleration * step, 0.0)
    return way


@given(SPEEDS, ACCELERATIONS, STEPS)
def test_the_way_to_stand_is_that_of_braking_step_by_step(speed: float, acceleration: float, step: float) -> None:
    way = speed * step + kernels.stopping_way(speed, acceleration, step)
    assert way == pytest.approx(driven_and_braked(speed, acceleration, step), abs=1e-9)


@given(st.floats(0.0, 20.0), ACCELERATIONS, STEPS)
def test_at_the_speed_within_a_way_the_robot_stands_at_its_end(way: float, acceleration: float, step: float) -> None:
    drive = Drive("holonomic", 5.0, 0.0, 0.0, step, acceleration)
    speed = speed_within(drive, way)
    needed = driven_and_braked(speed, acceleration, step)
    assert needed == pytest.approx(way, abs=1e-9) if speed < 5.0 else needed <= way + 1e-9


def test_a_robot_without_inertia_may_always_go_at_full_speed() -> None:
    assert speed_within(Drive("holonomic", 1.5, 0.0, 0.0, 0.1), 0.01) == 1.5


coordinates = st.floats(-2.0, 2.0)


@settings(max_examples=300)
@given(st.lists(st.tuples(coordinates, coordinates), max_size=12), coordinates, coordinates, coordinates, coordinates)
def test_clear_of_points_is_what_a_swept_disc_says(
    points: list[tuple[float, float]], x: float, y: float, wx: float, wy: float
) -> None:
    radius, margin = 0.3, 0.1
    px, py = np.array([p[0] for p in points]), np.array([p[1] for p in points])
    told = kernels.keeps_clear(px, py, np.array([[0.0, 0.0, radius]]), x, y, 0.0, wx, wy, margin, 0.0, 0)
    apart = [point for point in points if math.hypot(*point) >= radius + margin]
    if len(apart) < len(points) or not points:
        return  # those are another test's
    distance = MultiPoint(points).distance(LineString([(0, 0), (x, y), (x + wx, y + wy)]))
    if abs(distance - radius - margin) > 1e-9:
        assert told == (distance > radius + margin)


def test_a_point_that_is_too_near_lets_the_body_go_away_and_along_but_no_nearer() -> None:
    px, py = np.array([0.35]), np.array([0.0])

    def clear(x: float, y: float) -> bool:
        return bool(kernels.keeps_clear(px, py, np.array([[0.0, 0.0, 0.3]]), x, y, 0.0, 0.0, 0.0, 0.1, 0.0, 0))

    assert clear(-0.2, 0.0) and clear(0.0, 0.2) and clear(0.0, -0.2)
    assert not clear(0.02, 0.0)


@given(st.floats(0.301, 0.399), st.floats(-math.pi, math.pi), st.floats(-0.3, 0.3))
def test_who_stands_may_go_on_standing_and_turn_on_the_spot_however_near_a_point_is(
    away: float, bearing: float, turn: float
) -> None:
    point = np.array([away * math.cos(bearing)]), np.array([away * math.sin(bearing)])
    assert kernels.keeps_clear(*point, np.array([[0.0, 0.0, 0.3]]), 0.0, 0.0, turn, 0.0, 0.0, 0.1, 0.0, 1)


@pytest.mark.parametrize("step", [9e-4, 1e-4, 1e-6])
def test_who_creeps_does_not_come_nearer_to_it_either(step: float) -> None:
    px, py, circles = np.array([0.35]), np.array([0.0]), np.array([[0.0, 0.0, 0.3]])
    assert not kernels.keeps_clear(px, py, circles, step, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0)
    assert kernels.keeps_clear(px, py, circles, 0.01 * step, step, 0.0, 0.0, 0.0, 0.1, 0.0, 0)  # along it, nearly


def test_what_lies_between_two_beams_is_reckoned_with() -> None:
    px, py = np.array([2.0]), np.array([0.42])
    circles = np.array([[0.0, 0.0, 0.3]])
    assert kernels.keeps_clear(px, py, circles, 0.1, 0.0, 0.0, 3.0, 0.0, 0.1, 0.0, 1)
    assert not kernels.keeps_clear(px, py, circles, 0.1, 0.0, 0.0, 3.0, 0.0, 0.1, math.radians(1.0), 1)
    assert kernels.keeps_clear(
        px, py, circles, 0.1, 0.0, 0.0, 3.0, 0.0, 0.1, math.radians(1.0), 0
    )  # known to be there only


def integrated(speed: float, asked: Velocity, acceleration: float, step: float, *, keeps_arc: bool) -> list[float]:
    """Where a step ends, how far it turns, and the way to stand after it, gone in a thousand parts."""
    driven = min(max(asked[0], speed - acceleration * step), speed + acceleration * step)
    rate = asked[1] if not keeps_arc else (asked[1] * driven / asked[0] if asked[0] else 0.0)
    x = y = turn = 0.0
    for _ in range(1000):
        middle = turn + 0.5 * rate * step / 1000
        x, y = x + driven * step / 1000 * math.cos(middle), y + driven * step / 1000 * math.sin(middle)
        turn += rate * step / 1000
    way = math.copysign(driven_and_braked(abs(driven), acceleration, step) - abs(driven) * step, driven)
    return [x, y, turn, way * math.cos(turn), way * math.sin(turn)]


@settings(max_examples=50)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0), st.booleans(), ACCELERATIONS, STEPS)
def test_a_step_on_an_arc_and_the_way_to_stand_are_what_many_small_parts_give(
    speed: float, asked: float, rate: float, keeps_arc: bool, acceleration: float, step: float
) -> None:
    if keeps_arc and abs(asked) < 0.01:
        rate = 0.0  # no wheels turn so far
    told = kernels.arc_and_stop(speed, asked, rate, keeps_arc, acceleration, step)
    expected = integrated(speed, (asked, rate), acceleration, step, keeps_arc=keeps_arc)
    assert told == pytest.approx(expected, rel=1e-5, abs=1e-6)


@settings(max_examples=100)
@given(
    st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=12),
    st.floats(0.0, 2.0),
    st.floats(0.0, 2.0),
    st.floats(-3.0, 3.0),
    st.booleans(),
    ACCELERATIONS,
)
def test_of_a_wish_the_greatest_part_is_driven_that_keeps_clear(
    points: list[tuple[float, float]], speed: float, wished: float, rate: float, keeps_arc: bool, acceleration: float
) -> None:
    px, py, circles = np.array([p[0] for p in points]), np.array([p[1] for p in points]), np.array([[0.1, 0.0, 0.3]])
    part = kernels.clear_part(
        px, py, circles, speed, wished, rate, keeps_arc, acceleration, 0.1, 0.05, 0.01, 7, 0.03, 4
    )

    def is_clear(of_four: int) -> bool:
        asked = of_four / 4 * wished, rate * (of_four / 4 if keeps_arc else 1.0)
        motion = kernels.arc_and_stop(speed, *asked, keeps_arc, acceleration, 0.1)
        return bool(kernels.keeps_clear(px, py, circles, *motion, 0.05, 0.03 if of_four > 2 else 0.01, 7))

    assert part == max((of_four for of_four in range(5) if is_clear(of_four)), default=-1)


@pytest.mark.parametrize("room", [0.0, 0.1])
def test_what_some_of_several_robots_ask_for_is_cut_as_of_each_alone(room: float) -> None:
    robot = {"robot.kinematics": "differential", "robot.max_acceleration": 1.0, "lidar.beams": 360, "lidar.noise": 0.0}
    sensors, rng, shares = Sensors.of(load("static", robot)), np.random.default_rng(0), []
    assert are_cut_at_once(sensors)
    for _ in range(60):
        rows = np.zeros((5, sensors.width), dtype=np.float32)
        for row in rows:
            row[sensors.always_seen[0]] = sensors.range
            row[sensors.always_seen[0]][rng.integers(360, size=3)] = rng.uniform(0.25, 1.2, 3)
            row[sensors.always_seen[1]][-2:] = rng.uniform(0.0, 1.0), 0.0
        views = View.of_rows(rows, sensors, sensors.radius)
        asked = sorted(rng.choice(5, rng.integers(1, 6), replace=False).tolist())
        wishes = [velocity_along(rng.uniform(-0.5, 0.5), 1.0) for _ in asked]
        for row, wish, action in zip(asked, wishes, stoppable_actions(views, asked, wishes, room), strict=True):
            alone = stoppable_action(View(rows[row], sensors), wish, room)
            np.testing.assert_array_equal(action, alone)
            shares.append(float(alone[0]))
    assert len(set(shares)) > 10


def test_the_points_of_a_scan_are_those_of_beams_that_saw_something() -> None:
    angles, ranges = np.arange(4) * 0.5 * math.pi, np.array([1.0, 5.0, 2.0, 4.9])
    places = np.empty((2, 4))
    count = kernels.scan_points(ranges, np.stack([np.cos(angles), np.sin(angles)]), 5.0, places)
    assert places[:, :count] == pytest.approx(np.array([[1.0, -2.0, 0.0], [0.0, 0.0, -4.9]]))


SPACING = 2.0 * math.pi / 32


def met_by_beams(
    corner: float, away: float, angle: float, lean: float, phase: float
) -> list[tuple[NDArray[np.float64], int]]:
    """What 32 beams meet of a wedge, whose tip lies so far off [m] along a bearing: points, and which side each is of."""
    tip = np.array(velocity_along(away, corner))
    met = []
    for number in range(32):
        way = np.array(velocity_along(phase + number * SPACING, 1.0))
        reaches = [math.inf, math.inf]
        for side, turned in enumerate((-0.5 * angle, 0.5 * angle)):
            along = np.array(velocity_along(away + lean + turned, 1.0))
            cross = way[0] * along[1] - way[1] * along[0]
            reach = (tip[0] * along[1] - tip[1] * along[0]) / cross if abs(cross) > 1e-9 else -1.0
            if reach > 0.0 and (reach * way - tip) @ along >= 0.0:
                reaches[side] = reach
        if min(reaches) < 5.0:
            met.append((min(reaches) * way, reaches.index(min(reaches))))
    return met


def is_shown(met: Sequence[tuple[NDArray[np.float64], int]], away: float) -> bool:
    """Whether both sides of a wedge are met near its tip, one of them twice."""
    in_turn = sorted(met, key=lambda one: wrap(math.atan2(one[0][1], one[0][0]) - away))
    near = [math.dist(one, other) < 0.4 for (one, _), (other, _) in itertools.pairwise(in_turn)]
    changes = [number for number, ((_, one), (_, other)) in enumerate(itertools.pairwise(in_turn)) if one != other]
    if len(changes) != 1 or not near[changes[0]]:
        return False
    return any(near[max(changes[0] - 1, 0) : changes[0]]) or any(near[changes[0] + 1 : changes[0] + 2])


BEARINGS = st.floats(-3.1, 3.1)


@settings(max_examples=500)
@example(0.201171875, -0.9375, 1.5, 0.5, 0.5, 0.5)  # its tip lies before where the side would meet the next beam
@example(0.201171875, 0.9375, 1.5, -0.5, -0.5, -0.5)
@given(st.floats(0.201, 0.3), BEARINGS, st.floats(0.6, 2.6), st.floats(-0.5, 0.5), BEARINGS, BEARINGS)
def test_a_step_that_passes_corners_touches_no_tip_of_which_two_beams_meet_a_side(
    corner: float, away: float, angle: float, lean: float, phase: float, ahead: float
) -> None:
    met = met_by_beams(corner, away, angle, lean, phase)
    px, py = np.array([place for place, _ in met]).reshape(-1, 2).T.copy()
    body, (x, y) = np.array([[0.0, 0.0, 0.2]]), velocity_along(ahead, 0.03)
    told = bool(kernels.passes_corners(px, py, body, x, y, 0.3, 0.4, 2.1 * SPACING, 0.0, True))
    told = told and bool(kernels.keeps_clear(px, py, body, x, y, 0.3, 0.0, 0.0, 0.0, 0.0, 0))
    tip = np.array(velocity_along(away, corner))
    nearest = LineString([(0.0, 0.0), (x, y)]).distance(MultiPoint([tip]))
    if told and is_shown(met, away):
        assert nearest >= 0.2 - 1e-6
    if nearest >= corner - 1e-9 and math.cos(ahead - away) < -0.7:
        assert told  # away from all of it


PLACES = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))


@settings(max_examples=500)
@example((0.0, 0.0), (0.3, 0.0), (0.15, 0.21), (0.15, 0.5), 0.2)  # its end lies beside the way
@example((0.0, 0.0), (0.5, 0.0), (0.25, -0.4), (0.25, 0.4), 0.2)  # and here both ends do
@given(PLACES, PLACES, PLACES, PLACES, st.floats(0.05, 0.3))
def test_who_passes_a_side_comes_too_near_to_no_point_of_it_and_no_nearer_to_what_is(
    middle: tuple[float, float],
    step: tuple[float, float],
    first: tuple[float, float],
    last: tuple[float, float],
    least: float,
) -> None:
    told = passes_side(*middle, *step, *first, *last, least, 0.0)
    side = np.linspace(first, last, 2001)
    ahead = np.clip((side - middle) @ step / max(np.dot(step, step), 1e-12), 0.0, 1.0)
    start, distance = np.hypot(*(side - middle).T), np.hypot(*(side - middle - np.outer(ahead, step)).T)
    if (distance < np.minimum(start, least) - 1e-6).any():
        assert not told
    near = start < least + 1e-3
    if (distance[~near] > least + 1e-3).all() and ((side[near] - middle) @ step < -1e-9).all():
        assert told


@settings(max_examples=300)
@given(BEARINGS, st.floats(0.05, 1.5), st.floats(0.25, 0.5), st.floats(0.5, 2.6), st.floats(0.0, 0.15))
def test_a_step_that_passes_corners_touches_no_right_angled_one_between_two_points_that_scatter(
    away: float, share: float, distance: float, along: float, length: float
) -> None:
    """Any place of Thales' circle over two points, against a swept disc."""
    first = np.array(velocity_along(away, distance))
    second = first + np.array(velocity_along(away + along, 0.09))
    middle, (x, y) = 0.5 * (first + second), 0.5 * (second - first)
    cos, sin = math.cos(2.0 * share), math.sin(2.0 * share)
    corner = middle + np.array([cos * x - sin * y, sin * x + cos * y])
    assert (first - corner) @ (second - corner) == pytest.approx(0.0, abs=1e-12)
    body, step = np.array([[0.0, 0.0, 0.2]]), velocity_along(away, length)
    px, py = np.array([first[0], second[0]]), np.array([first[1], second[1]])
    told = bool(kernels.passes_corners(px, py, body, *step, 0.3, 0.4, 1.0, 0.0, False))
    if told and math.hypot(*middle) > 0.2 + 0.045:
        assert LineString([(0.0, 0.0), step]).distance(LineString([first, corner, second])) >= 0.2 - 1e-9
    assert kernels.passes_corners(
        px, py, body, *step, 0.3, 0.08, 1.0, 0.0, False
    )  # so far apart they are not of one thing


def test_a_corner_between_few_beams_is_not_touched_by_who_creeps_past_it() -> None:
    """Found by still-things: a wall's end (1670), and the tip of a triangle, beside which a beam is lost (416)."""
    drives = [("rev2", 1670), ("rev3", 1670), ("bug1", 416), ("bug2", 416)]
    assert [drive for drive in drives if still_things.drive(*drive).outcome == "collision"] == []


@given(st.floats(0.25, 0.6), BEARINGS, st.integers(3, 8))
def test_what_lies_between_others_of_one_thing_is_no_end_of_it(distance: float, away: float, count: int) -> None:
    """A straight side, met by some beams in turn: beside its first and its last point it may go on unseen."""
    bearings = [(number - 0.5 * (count - 1)) * SPACING for number in range(count)]
    places = [velocity_along(away + bearing, distance / math.cos(bearing)) for bearing in bearings]
    px, py = np.array(places).T.copy()
    kernels.are_between(px, py, 0.6, 2.1 * SPACING, between := np.empty(count, dtype=np.bool_))
    assert between.tolist() == [False, *[True] * (count - 2), False]


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(
    ("beams", "names"), [(32, ("bug0", "bug1", "bug2", "hd_bug")), (24, ("dist_bug", "hd_bug_map"))]
)
def test_few_beams_stop_nobody_for_ever(kinematics: str, beams: int, names: Sequence[str]) -> None:
    """Who is too near to a thing to go on along it slides away from it, and goes on."""
    robot = {"robot.kinematics": kinematics, "lidar.beams": beams}
    rows = evaluate(list(names), ["static", "u_trap"], episodes=6, overrides=robot)
    assert [(row.policy, row.scenario, row.seed, row.outcome) for row in rows if not row.success] == []


FEW_BEAMS = [
    (16, 3.0, ("alg2", "com1", "tangent_bug", "vis_bug_21", "hd_bug_map")),
    (18, 1.0, ("com1", "tangent_bug", "a_star", "d2t_eaco")),
    (36, 3.0, ("d2t_eaco", "d2t_dijkstra")),
]


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(("beams", "acceleration", "names"), FEW_BEAMS)
def test_few_beams_and_inertia_stop_nobody_for_ever_beside_a_box(
    kinematics: str, beams: int, acceleration: float, names: Sequence[str]
) -> None:
    """A way by which the brake would make the robot stand, for what may lie between two beams, counts as none."""
    box = {"family": "explicit", "bounds": [-8, -8, 8, 8], "polygons": [[[-1, -2], [1, -2], [1, 3], [-1, 3]]]}
    scenario = {
        "robot": {"kinematics": kinematics, "max_acceleration": acceleration},
        "lidar": {"beams": beams, "range": 10.0},
        "world": {**box, "start": [-6, 0, 0], "goal": [6, 0.3]},
    }
    rows = evaluate(list(names), [scenario], episodes=1)
    assert [(row.policy, row.outcome) for row in rows if not row.success] == []


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("beams", [48, 64, 90])
@pytest.mark.parametrize("slope", [0.02, 0.05, 0.1])
def test_inertia_stops_no_bug_for_ever_at_a_wall_that_its_way_to_the_goal_nears_little_by_little(
    kinematics: str, beams: int, slope: float
) -> None:
    """The way ends, and the wall is hit, before the brake makes the robot stand for what may lie between two beams."""
    beside = 0.25 + 0.05 + slope * 3.0  # the way comes to the contour after 3 m
    wall = [[-3.0, -beside - 3.0 * slope], [7.0, -beside + 7.0 * slope], [7.0, -beside - 2.0], [-3.0, -beside - 2.0]]
    scenario = {
        "robot": {"kinematics": kinematics, "radius": 0.25, "max_speed": 0.5, "max_acceleration": 2.0},
        "lidar": {"beams": beams, "range": 4.0},
        "world": {
            "family": "explicit",
            "bounds": [-4, -8, 14, 8],
            "polygons": [wall],
            "start": [0, 0, 0],
            "goal": [10, 0],
        },
    }
    rows = evaluate(["bug2", "com1", "tangent_bug"], [scenario], episodes=1)
    assert [(row.policy, row.outcome) for row in rows if not row.success] == []


@given(
    st.integers(12, 360), st.floats(0.1, 0.5), st.floats(0.0, 0.03), st.floats(0.0, 0.2), st.sampled_from([-1.0, 1.0])
)
def test_a_robot_with_inertia_comes_as_near_to_a_point_beside_it_as_the_stopping_radius(
    beams: int, radius: float, noise: float, room: float, side: float
) -> None:
    scenario = {"robot": {"radius": radius, "max_acceleration": 1.0}, "lidar": {"beams": beams, "noise": noise}}
    sensors = Sensors.of(load(scenario))
    least = stopping_radius(sensors, room)
    margin, gap = max(room, LEAST_ROOM + noise), 0.5 * sensors.beam_spacing
    nearer = side * 0.002
    for beside, comes in ((least + 0.004, True), (least + 0.0005, False)):
        point = np.array([0.0]), np.array([side * beside])
        assert kernels.keeps_clear(*point, sensors.circles, 0.0, nearer, 0.0, 0.0, 0.0, margin, gap, 1) is comes


# -- Whatever is asked for ---------------------------------------------------------------------------------------------


class Ram(ScriptedPolicy):
    """Full speed at the nearest thing in sight, for ever: what no algorithm should ask for."""

    def start(self) -> Memory:
        return Memory()

    def act(self, view: View, memory: Memory) -> Velocity:
        _, bearing = view.nearest()
        return velocity_along(bearing, self.sensors.drive.max_speed)


def least_clearance(scenario: Scenario, policy: ScriptedPolicy, seed: int, seconds: float) -> float:
    """How near the body comes to something in an episode [m]; 0: it touches."""
    env = NavigationEnv(scenario, observation="flat")
    observation, info = env.reset(seed=seed)
    state: Any = None
    for _ in range(math.ceil(seconds / scenario.time.step)):
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    return float(info["min_clearance"])


ROBOTS = [
    {"kinematics": kinematics, "max_speed": speed, "max_acceleration": acceleration}
    for kinematics in ("holonomic", "differential")
    for speed, acceleration in ((2.0, 0.5), (1.0, 1.0), (2.0, 5.0))
]
WORLDS: list[Any] = [
    {"world": {"family": "field", "obstacles": 30, "moving": 0}},
    {"world": {"family": "forest"}},
    "maze",
]


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: "-".join(map(str, robot.values())))
@pytest.mark.parametrize("world", WORLDS, ids=["field", "forest", "maze"])
def test_even_who_runs_at_everything_touches_nothing_still(world: Any, robot: dict[str, Any]) -> None:
    scenario = load(world, {**{f"robot.{key}": value for key, value in robot.items()}, "lidar.beams": 360})
    policy = Ram(Sensors.of(scenario))
    assert needs_care(policy.sensors)
    clearances = [least_clearance(scenario, policy, seed, 15.0) for seed in range(4)]
    assert min(clearances) > 0.0
    assert min(clearances) < 0.5  # it was near


class Straight(ScriptedPolicy):
    """Full speed ahead, for ever."""

    def start(self) -> Memory:
        return Memory()

    def act(self, view: View, memory: Memory) -> Velocity:
        return velocity_along(-view.heading, self.sensors.drive.max_speed)


def before_a_post(robot: dict[str, Any], beams: int, aside: float) -> Scenario:
    """A robot that has room to gather speed before a round post, a little to the side of its way.

    Not so far that it would but graze it: at the edge of what a beam meets as much as lies between two beams stays unseen, of
    which robots reckon with half.
    """
    corners = [2.0 * math.pi * number / 24 for number in range(24)]
    post = [[8.0 + 0.5 * POST * math.cos(angle), aside + 0.5 * POST * math.sin(angle)] for angle in corners]
    world = {"family": "explicit", "bounds": [-2, -8, 30, 8], "polygons": [post], "start": [0, 0, 0], "goal": [25, 0]}
    lidar = {"beams": beams, "range": 10.0}
    return load({"robot": {"radius": 0.2, "max_turn_rate": 3.0, **robot}, "lidar": lidar, "world": world})


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(("beams", "acceleration"), [(24, 4.0), (32, 1.0), (64, 0.5)])
def test_a_post_between_two_beams_is_seen_in_time(
    kinematics: str, beams: int, acceleration: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = {"kinematics": kinematics, "max_speed": 3.0, "max_acceleration": acceleration}
    posts = [before_a_post(robot, beams, aside) for aside in np.linspace(-0.2, 0.2, 9)]

    def clearances() -> list[float]:
        return [least_clearance(post, Straight(Sensors.of(post)), 0, 12.0) for post in posts]

    slow = clearances()
    assert min(slow) > 0.0
    assert min(slow) < 0.1  # it came near
    monkeypatch.setattr("bug_gym.inertia.pace_in_sight", lambda sensors: sensors.drive.max_speed)
    monkeypatch.setattr("bug_gym.inertia._first_clear", lambda view, ahead, asked, room: asked[0])
    assert min(clearances()) == 0.0  # at top speed it would not have been, but for a turn at the last moment


def test_the_pace_in_sight_is_that_from_which_the_robot_stands_before_the_post() -> None:
    def pace(beams: int, **robot: Any) -> tuple[float, Sensors]:
        sensors = Sensors.of(
            load("static", {"lidar.beams": beams, **{f"robot.{key}": value for key, value in robot.items()}})
        )
        return pace_in_sight(sensors), sensors

    slowed, sensors = pace(32, max_speed=2.0, max_acceleration=1.0)
    met = 0.5 * POST / math.sin(math.pi / 32) - 0.5 * POST - sensors.radius
    way = driven_and_braked(slowed, 1.0, sensors.drive.step)
    assert way < met and way > met - 0.05
    assert pace(360, max_speed=2.0, max_acceleration=1.0)[0] == 2.0  # dense beams hide no post
    assert pace(32, max_speed=2.0)[0] == 2.0  # who stops at once needs no slowness
    creeping, _ = pace(12, max_speed=2.0, max_acceleration=1.0)
    assert creeping == 2.0 > LEAST_PACE * 2.0  # no pace worth driving shows it in time


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("name", ["bug2", "tangent_bug", "vis_bug_21"])
def test_bugs_with_inertia_arrive_and_touch_nothing_still(name: str, kinematics: str) -> None:
    robot = {"robot.kinematics": kinematics, "robot.max_speed": 1.5, "robot.max_acceleration": 1.0, "time.limit": 120.0}
    scenario = load({"world": {"family": "forest"}}, robot)
    for seed in range(3):
        env = NavigationEnv(scenario, observation="flat")
        policy = make_policy(name, env)
        observation, info = env.reset(seed=seed)
        state, done = None, False
        while not done:
            action, state = policy.predict(observation, state)
            observation, _, terminated, truncated, info = env.step(action)
            done = terminated or truncated
        assert info["outcome"] == "success"


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(
    "robot", [{"max_acceleration": 0.7}, {"latency": 0.3}, {"max_acceleration": 0.7, "latency": 0.2}]
)
def test_the_way_to_stand_is_the_one_that_the_robot_then_drives(kinematics: str, robot: dict[str, float]) -> None:
    world = {"family": "empty", "bounds": [-30, -30, 30, 30], "start": [0, 0, 0], "goal": [25, 0]}
    scenario = load({"robot": {"kinematics": kinematics, **robot}, "world": world})
    sensors, simulation, rng = Sensors.of(scenario), Simulation(scenario, 1), np.random.default_rng(2)
    drive = sensors.drive
    stand = kinematics_of.steering(drive, (0.0, 0.0))
    flat, under_way = simulation.reset(seeds=[0])[0, 0], list[Any]()
    for number in range(10):
        for _ in range(int(rng.integers(1, 15))):
            action = rng.uniform(-1.0, 1.0, 2).astype(np.float32)
            flat, under_way = simulation.step(action[None, None]).observation[0, 0], [*under_way, action]
        latest = under_way[len(under_way) - drive.latency :]
        view = View(flat, sensors, latest)
        action = rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        foreseen = way_to_stand(view, kinematics_of.asked_velocity(drive, action))
        assert np.linalg.norm(np.diff(foreseen, axis=0), axis=1).sum() <= farthest_way(sensors) + 1e-6
        for place in foreseen[1:]:
            flat, under_way = simulation.step(action[None, None]).observation[0, 0], [*under_way, action]
            assert view.to_robot(*View(flat, sensors).position) == pytest.approx(place, abs=1e-4), number
            action = stand
