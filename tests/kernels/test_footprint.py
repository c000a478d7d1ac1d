"""Bodies of several circles: passages, turns on the spot and the rod in the corner, each against its closed form."""

from __future__ import annotations

import math
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.compiling import for_python
from bug_gym.config import ScenarioError, load
from bug_gym.kernels import contact, neighbours
from bug_gym.simulation import Simulation

F64 = NDArray[np.float64]

EARLY = 1e-5
"""So much the chords of a circle that swings leave its arc at most, and so much is added to its radius [m]: see body.SWING."""


def contact_of_robot_0(f: Any, k: Any, s: Any, footprint: Any, columns: Any, index: Any) -> float:
    return contact.obstacle_contact(f, k, s, footprint, neighbours.near_bodies(f, k, s, columns), 0, 1.0, index)[0]


first_contact = for_python(contact_of_robot_0)


def make(body: list[list[float]], *, step: float = 0.1, **world: Any) -> Simulation:
    drive = {"kinematics": "differential", "max_reverse": 1.0, "max_turn_rate": 1.5, "circles": body}
    layout = {"family": "explicit", "start": [0, 0, 0], "goal": [8, 8], **world}
    simulation = Simulation({"robot": drive, "lidar": {"beams": 1}, "time": {"step": step}, "world": layout})
    simulation.reset(seeds=[0])
    return simulation


def outcome(simulation: Simulation, robot: int = 0) -> str:
    return str(simulation.info()["outcome"][0, robot])


def turn_on_the_spot(simulation: Simulation, rate: float = 1.0, steps: int = 20) -> float:
    """Turns until something is touched or the steps are over; the heading there."""
    for _ in range(steps):
        simulation.step([[[0.0, rate]]])
        if outcome(simulation) != "running":
            break
    return float(simulation.world.pose[0, 0, 2])


def rod(half: float, radius: float, count: int) -> list[list[float]]:
    """A row of circles along x, its outer centres `half` from the middle [m]."""
    return [[x, 0.0, radius] for x in np.linspace(-half, half, count).tolist()]


# ---------------------------------------------------------------------------------------------- passages


@pytest.mark.parametrize(("spare", "expected"), [(1e-6, "running"), (-1e-6, "collision")])
def test_a_straight_passage_is_passable_lengthwise_where_it_is_wider_than_two_radii(
    spare: float, expected: str
) -> None:
    half = 0.2 + 0.5 * spare
    walls = [[[2, half], [5, half], [5, 3], [2, 3]], [[2, -3], [5, -3], [5, -half], [2, -half]]]
    simulation = make(rod(0.6, 0.2, 4), polygons=walls)
    for _ in range(65):
        simulation.step([[[1.0, 0.0]]])
    assert outcome(simulation) == expected
    if expected == "collision":  # the first circle meets the corners of the mouth
        depth = math.sqrt(0.2**2 - half**2)
        assert simulation.world.pose[0, 0, 0] == pytest.approx(2.0 - depth - 0.6, abs=1e-9)


def test_the_same_body_does_not_pass_sideways() -> None:
    walls = [[[2, 0.5], [5, 0.5], [5, 3], [2, 3]], [[2, -3], [5, -3], [5, -0.5], [2, -0.5]]]
    lengthwise = rod(0.6, 0.2, 4)
    for circles, passes in ((lengthwise, True), ([[y, x, radius] for x, y, radius in lengthwise], False)):
        simulation = make(circles, polygons=walls)
        for _ in range(65):
            simulation.step([[[1.0, 0.0]]])
        assert (outcome(simulation) == "running") == passes


# ---------------------------------------------------------------------------------------------- turns on the spot


@pytest.mark.parametrize("step", [0.02, 0.1, 0.7])
@pytest.mark.parametrize("offset", [0.3, 0.5])
def test_a_turn_beside_a_wall_ends_at_the_angle_at_which_the_circle_reaches_it(step: float, offset: float) -> None:
    wall = 0.35
    simulation = make([[0, 0, 0.1], [offset, 0, 0.1]], step=step, polygons=[[[-4, wall], [4, wall], [4, 2], [-4, 2]]])
    heading = turn_on_the_spot(simulation, steps=100)
    angle = math.asin((wall - 0.1) / offset)
    early = EARLY / (offset * math.cos(angle))
    assert outcome(simulation) == "collision"
    assert angle - early <= heading <= angle + 1e-9


def test_a_turn_inside_a_disc_that_holds_the_body_touches_nothing_and_comes_as_near_as_it_must() -> None:
    """In-place rotation needs a free disc: the farthest circle sweeps 0.5 + 0.1 m, the walls stand 0.001 m farther."""
    simulation = make([[0.5, 0, 0.1]], polygons=[[[-4, 0.601], [4, 0.601], [4, 2], [-4, 2]]])
    turn_on_the_spot(simulation, steps=50)
    assert outcome(simulation) == "running"
    assert simulation.info()["min_clearance"][0, 0] == pytest.approx(0.001, abs=EARLY)


@pytest.mark.parametrize("reach", [0.0005, -0.0005])
def test_a_thing_on_the_arc_between_two_steps_is_met_and_one_just_beyond_it_is_not(reach: float) -> None:
    """A step of 1.05 rad: the chord would pass the arc's middle 0.07 m inside it."""
    angle = 0.525
    place = [math.cos(angle) * (0.6 - reach), math.sin(angle) * (0.6 - reach), 0.05]
    simulation = make([[0.5, 0, 0.05]], step=0.7, circles=[place])
    turn_on_the_spot(simulation, steps=1)
    if reach < 0.0:
        assert outcome(simulation) == "running"
        assert simulation.info()["min_clearance"][0, 0] == pytest.approx(-reach, abs=EARLY)
        return
    assert outcome(simulation) == "collision"
    heading = float(simulation.world.pose[0, 0, 2])
    gap = math.dist((0.5 * math.cos(heading), 0.5 * math.sin(heading)), place[:2]) - 0.1
    assert 0.0 <= gap <= 2.0 * EARLY


def test_a_mover_that_meets_a_swinging_body_stops_it_where_the_two_touch() -> None:
    at = (0.2, 0.9)
    mover = {"shape": {"circle": 0.1}, "at": at, "motion": {"law": "bounce", "velocity": [0.0, -1.0]}}
    simulation = make([[0.5, 0, 0.1]], step=0.5, movers=[mover])
    turn_on_the_spot(simulation)
    assert outcome(simulation) == "collision"
    heading = float(simulation.world.pose[0, 0, 2])
    time = heading / 1.5  # the heading tells when it stopped
    mover_place = (at[0], at[1] - time)
    gap = math.dist((0.5 * math.cos(heading), 0.5 * math.sin(heading)), mover_place) - 0.2
    assert -1e-9 <= gap <= EARLY * 4.0


def test_two_long_robots_that_turn_toward_one_another_touch_at_the_closed_form_angle() -> None:
    """Mirror images 0.8 m apart: their outer circles meet where 2 * 0.5 * sin(angle) = 0.8 - 2 * 0.1."""
    places = [{"start": [0, 0, 0]}, {"start": [0, 0.8, 0]}]
    drive = {"kinematics": "differential", "max_turn_rate": 1.5, "max_reverse": 1.0, "circles": [[0.5, 0, 0.1]]}
    world = {"family": "empty", "start": [0, 0, 0], "goal": [8, 8]}
    simulation = Simulation(
        {"robot": drive, "lidar": {"beams": 1}, "time": {"step": 0.3}, "world": world, "robots": places}
    )
    simulation.reset(seeds=[0])
    for _ in range(3):
        simulation.step([[[0.0, 1.0], [0.0, -1.0]]])
    angle = math.asin(0.6)
    assert [outcome(simulation, robot) for robot in range(2)] == ["collision", "collision"]
    for robot, side in ((0, 1.0), (1, -1.0)):
        heading = side * simulation.world.pose[0, robot, 2]
        assert angle - 4.0 * EARLY <= heading <= angle + 1e-9


def body_gap(simulation: Simulation, posts: list[list[float]]) -> float:
    """Distance of the first robot's body from that of the second one, or from posts x, y, radius where it is alone [m]."""
    poses = simulation.world.pose[0].tolist()
    ours, *others = (np.array(simulation.scenario.robot.body(tuple(pose))) for pose in poses)
    them = others[0] if others else np.array(posts)
    apart = np.hypot(*(ours[:, None, :2] - them[None, :, :2]).transpose(2, 0, 1))
    return float((apart - ours[:, None, 2] - them[None, :, 2]).min())


@pytest.mark.parametrize(("robots", "bound"), [(1, 2.0 * EARLY), (2, 4.0 * EARLY)])
def test_a_contact_comes_too_early_by_what_each_swinging_body_adds_and_by_its_chords(robots: int, bound: float) -> None:
    """What lies within an arc is met farthest from it: the chord is EARLY nearer to it, and EARLY is added to the radius."""
    rng = np.random.default_rng(0)
    body = [[0.3, 0, 0.1], [-0.3, 0, 0.1], [0, 0.3, 0.05]]
    drive = {"kinematics": "differential", "max_reverse": 1.0, "max_turn_rate": 1.5, "circles": body}
    gaps = []
    for _ in range(400):
        way, turn, heading = rng.uniform(-np.pi, np.pi, 3).tolist()
        x, y = (rng.uniform(0.1, 0.9) * np.array([math.cos(way), math.sin(way)])).tolist()
        posts = [[0.6 * x, 0.6 * y, 0.03]] if robots == 1 else []
        world = {"family": "explicit", "circles": posts, "start": [0, 0, turn], "goal": [8, 8]}
        parts: dict[str, Any] = {"robot": drive, "lidar": {"beams": 1}, "time": {"step": 0.3}, "world": world}
        if robots == 2:
            parts["robots"] = [{"start": [0, 0, turn]}, {"start": [x, y, heading]}]
        try:
            simulation = Simulation(parts)
        except ScenarioError:  # it begins in the post
            continue
        simulation.reset(seeds=[0])
        if body_gap(simulation, posts) <= 0.0:
            continue
        for _ in range(10):
            simulation.step(rng.choice([-1.0, 0.0, 1.0], (1, robots, 2)))
        if {outcome(simulation, robot) for robot in range(robots)} == {"collision"}:
            gaps.append(body_gap(simulation, posts))
    assert len(gaps) > 40 and min(gaps) >= -1e-9
    assert 0.6 * bound < max(gaps) <= bound


@pytest.mark.parametrize("robots", [3, 5])
def test_of_several_robots_that_run_into_one_another_none_ends_within_another(robots: int) -> None:
    """One step each of bodies that turn, close together at random."""
    rng = np.random.default_rng(7)
    count, body = 100, [[0.25, 0.0, 0.12], [-0.25, 0.0, 0.12]]
    drive = {"kinematics": "differential", "max_reverse": 1.0, "max_turn_rate": 3.0, "circles": body}
    world = {"family": "empty", "bounds": [-9, -9, 9, 9], "start": [0, 0, 0], "goal": [8, 8]}
    places = [{"start": [float(3 * number - 6), 0, 0]} for number in range(robots)]
    parts = {"robot": drive, "lidar": {"beams": 1}, "time": {"step": 0.4}, "world": world, "robots": places}
    simulation = Simulation(parts, count)
    simulation.reset(seeds=range(count))
    begun, met = simulation.save(), 0
    for _ in range(60):
        simulation.restore(begun)
        poses = rng.uniform([-0.9, -0.9, -np.pi], [0.9, 0.9, np.pi], (count, robots, 3))
        free = least_gaps(poses, body) > 0.0
        simulation.world.pose[free] = poses[free]
        simulation.step(rng.uniform(-1.0, 1.0, (count, robots, 2)))
        met += ((simulation.info()["outcome"] == "collision").sum(axis=1) > 2).sum()
        assert least_gaps(simulation.world.pose, body).min() >= -1e-9
    assert met > 10


def least_gaps(poses: F64, body: list[list[float]]) -> F64:
    """Smallest distance (n,) of any two bodies at poses (n, R, 3) [m]."""
    x, y, radius = np.array(body).T
    cos, sin = np.cos(poses[..., 2:]), np.sin(poses[..., 2:])
    circles = np.stack([poses[..., :1] + cos * x - sin * y, poses[..., 1:2] + sin * x + cos * y], axis=-1)
    gaps = []
    for a, b in combinations(range(poses.shape[1]), 2):
        apart = np.hypot(*np.moveaxis(circles[:, a, :, None] - circles[:, b, None], -1, 0))
        gaps.append((apart - radius[:, None] - radius).min(axis=(1, 2)))
    least: F64 = np.array(gaps).min(axis=0)
    return least


# ---------------------------------------------------------------------------------------------- long arcs

LOOP = 10.0 / (2.0 * math.pi)
"""Radius of the circle of a robot that goes 10 m and turns once in a step [m]."""


def loop(*, step: float = 1.0, start: tuple[float, float, float] = (0.0, 0.0, 0.0), **parts: Any) -> Simulation:
    """A robot of 10 m/s that turns once in a second, to its left about (0, LOOP) where it starts at the origin."""
    drive = {"kinematics": "differential", "max_speed": 10.0, "max_turn_rate": 2.0 * math.pi, **parts.pop("robot", {})}
    world = {"family": "explicit", "start": list(start), "goal": [9, 9], **parts.pop("world", {})}
    described = {"robot": drive, "lidar": {"beams": 1}, "time": {"step": step}, "world": world, **parts}
    simulation = Simulation(described)
    simulation.reset(seeds=[0])
    return simulation


def test_a_robot_that_goes_once_round_in_a_step_has_gone_all_the_way_and_was_near_what_it_passed() -> None:
    simulation = loop()
    simulation.step([[[1.0, 1.0]]])
    assert simulation.world.pose[0, 0] == pytest.approx(np.zeros(3), abs=1e-12)
    assert simulation.info()["path_length"][0, 0] == pytest.approx(10.0)
    assert simulation.info()["min_clearance"][0, 0] == pytest.approx(10.0 - 2.0 * LOOP - 0.2, abs=EARLY)


@pytest.mark.parametrize("body", [{}, {"circles": [[0, 0, 0.2]]}, {"circles": [[-0.1, 0, 0.05], [0, 0, 0.2]]}])
@pytest.mark.parametrize("height", [0.3, 1.0, 2.0, 3.3])
def test_a_wall_beside_the_chord_of_a_step_stops_the_robot_where_its_arc_comes_to_it(
    height: float, body: dict[str, Any]
) -> None:
    wall = [[-9, height], [9, height], [9, 9], [-9, 9]]
    simulation = loop(robot=body, world={"polygons": [wall], "goal": [8, -8]})
    simulation.step([[[1.0, 1.0]]])
    angle = math.acos(1.0 - (height - 0.2) / LOOP)  # where it has risen by the height less its radius
    x, y, heading = simulation.world.pose[0, 0].tolist()
    assert outcome(simulation) == "collision"
    assert height - 0.2 - 2.0 * EARLY <= y <= height - 0.2 + 1e-12
    assert math.hypot(x, y - LOOP) == pytest.approx(LOOP, abs=1e-12)
    assert heading == pytest.approx(angle, abs=2.0 * EARLY / (LOOP * math.sin(angle)))
    assert simulation.info()["path_length"][0, 0] == pytest.approx(LOOP * (heading % (2.0 * math.pi)))


def test_a_goal_beside_the_chord_of_a_step_is_reached_where_the_arc_comes_to_it() -> None:
    simulation = loop(world={"goal": [0.0, 2.0 * LOOP]})
    simulation.step([[[1.0, 1.0]]])
    assert outcome(simulation) == "success"
    assert simulation.info()["goal_distance"][0, 0] == pytest.approx(0.3, abs=2.0 * EARLY)
    angle = math.pi - 2.0 * math.asin(0.5 * 0.3 / LOOP)
    assert simulation.world.pose[0, 0, 2] == pytest.approx(angle, abs=2.0 * EARLY / LOOP)


def test_a_mover_is_met_where_it_and_the_arc_are_at_the_same_time() -> None:
    """It comes to the top of the circle when the robot is there, after half of the step, and is elsewhere before and after."""
    mover = {"shape": {"circle": 0.1}, "at": [-4.0, 2.0 * LOOP], "motion": {"law": "bounce", "velocity": [8.0, 0.0]}}
    late = {**mover, "at": [-7.0, 2.0 * LOOP]}
    for one, expected in ((mover, "collision"), (late, "running")):
        simulation = loop(world={"movers": [one]})
        simulation.step([[[1.0, 1.0]]])
        assert outcome(simulation) == expected
        if expected == "collision":
            x, y, heading = simulation.world.pose[0, 0].tolist()
            time = heading % (2.0 * math.pi) / (2.0 * math.pi)
            gap = math.dist((x, y), (-4.0 + 8.0 * time, 2.0 * LOOP)) - 0.3
            assert 0.0 <= gap <= 2.0 * EARLY


@pytest.mark.parametrize("kinematics", ["differential", "ackermann"])
def test_one_long_step_is_as_many_short_ones(kinematics: str) -> None:
    """On arcs all of them: the longer one leaves its chord by metres, the shorter ones by 7 mm."""
    drive = {"kinematics": kinematics, "max_speed": 3.0, "max_turn_rate": 2.0, "wheelbase": 1.0, "max_steering": 0.6}
    odometry = {"translation_bias": 0.1, "rotation_bias": 0.1}
    long, short = (loop(step=step, robot=drive, odometry=odometry) for step in (1.0, 0.1))
    for turn in (0.4, -1.0, 0.9):
        long.step([[[1.0, turn]]])
        for _ in range(10):
            short.step([[[1.0, turn]]])
        for name in ("pose", "path_length"):
            assert long.world.array(name)[0] == pytest.approx(short.world.array(name)[0], abs=1e-9)
        assert long.info()["min_clearance"] == pytest.approx(short.info()["min_clearance"], abs=2.0 * EARLY)
    assert long.info()["path_length"][0, 0] == pytest.approx(9.0)


def test_odometry_drifts_with_the_length_of_the_arc() -> None:
    simulation = loop(odometry={"rotation_bias": 0.01})
    simulation.step([[[1.0, 1.0]]])
    assert simulation.world.array("odometry")[0, 2] == pytest.approx(0.01 * 10.0, abs=1e-9)


def test_a_radius_that_is_drawn_is_each_worlds_own_on_an_arc() -> None:
    drive = {"kinematics": "differential", "max_speed": 10.0, "max_turn_rate": 6.0, "radius": {"uniform": [0.1, 0.5]}}
    world = {"family": "empty", "start": [0, 0, 0], "goal": [8, -8]}
    parts = {"robot": drive, "lidar": {"beams": 1}, "time": {"step": 1.0}, "world": world}
    simulation = Simulation(parts, 20)
    simulation.reset(seeds=range(20))
    simulation.step(np.ones((20, 1, 2)))
    for row, nearest in enumerate(simulation.info()["min_clearance"][:, 0].tolist()):
        assert nearest == pytest.approx(10.0 - 20.0 / 6.0 - simulation.drawn(row)["robot.radius"], abs=EARLY)


@pytest.mark.parametrize("body", [None, [[0.3, 0.0, 0.1], [-0.3, 0.1, 0.1]]])
@pytest.mark.parametrize("robots", [1, 2, 3])
def test_on_long_arcs_robots_end_where_a_dense_sampling_of_them_first_touches(
    robots: int, body: list[list[float]] | None
) -> None:
    rng = np.random.default_rng(robots)
    circles = body or [[0.0, 0.0, 0.2]]
    posts = [[-3.0, 1.0, 0.3], [2.0, -2.5, 0.5], [1.5, 2.0, 0.2]]
    drive = {"kinematics": "differential", "max_speed": 6.0, "max_reverse": 3.0, "max_turn_rate": 5.0}
    drive |= {"circles": body} if body else {}
    world = {"family": "explicit", "bounds": [-6, -6, 6, 6], "circles": posts, "start": [0, 0, 0], "goal": [5.5, 5.5]}
    places = [{"start": [float(3 * number - 4), -5.0, 0]} for number in range(robots)]
    parts = {"robot": drive, "lidar": {"beams": 1}, "world": world, "robots": places, "goal": {"radius": 1e-6}}
    count, shares = 200, np.linspace(0.0, 1.0, 401)
    simulation = Simulation({**parts, "time": {"step": 0.8}}, count)
    simulation.reset(seeds=range(count))
    poses = rng.uniform([-5.5, -5.5, -np.pi], [5.5, 5.5, np.pi], (count, robots, 3))
    free = gaps_of(poses, circles, posts) > 0.0
    simulation.world.pose[:] = poses
    simulation.world.array("min_clearance")[:] = 99.0  # of this step only
    actions = rng.uniform(-1.0, 1.0, (count, robots, 2))
    simulation.step(actions)
    speed, turn = 0.8 * (-3.0 + 4.5 * (actions[..., 0] + 1.0)), 0.8 * 5.0 * actions[..., 1]
    # How far each has come, by its way; who touched nothing went all of it.
    stops = simulation.info()["path_length"] / np.abs(speed)
    outcomes = simulation.info()["outcome"]
    assert stops[outcomes == "running"] == pytest.approx(1.0)
    least = np.full(count, np.inf)
    for share in shares:
        gone = np.minimum(share, stops)
        half = 0.5 * gone * turn
        chord = gone * speed * np.sinc(half / np.pi)
        middle = poses[..., 2] + half
        way = np.stack([chord * np.cos(middle), chord * np.sin(middle), 2.0 * half], axis=-1)
        least = np.minimum(least, gaps_of(poses + way, circles, posts))
    ends = simulation.world.pose
    touching = gaps_of(ends, circles, posts)
    assert least[free].min() >= -1e-9, "nothing is passed through"
    met = free & (outcomes == "collision").any(axis=1)
    assert touching[met & (robots == 1)].max(initial=0.0) <= 2.0 * EARLY, "it ends where it touches"
    assert min(met.sum(), (free & ~met).sum()) > 10
    clear = simulation.info()["min_clearance"].min(axis=1)
    assert (clear[free & ~met] <= least[free & ~met] + 2.0 * EARLY).all()
    assert (clear[free & ~met] >= least[free & ~met] - 0.02).all(), "what lies between two samples is little nearer"


def gaps_of(poses: F64, body: list[list[float]], posts: list[list[float]]) -> F64:
    """Smallest distance (n,) of bodies at poses (n, R, 3) to posts, a border of 6 m and one another [m]."""
    x, y, radius = np.array(body).T
    cos, sin = np.cos(poses[..., 2:]), np.sin(poses[..., 2:])
    circles = np.stack([poses[..., :1] + cos * x - sin * y, poses[..., 1:2] + sin * x + cos * y], axis=-1)
    centres, radii = np.array(posts)[:, :2], np.array(posts)[:, 2]
    away = np.linalg.norm(circles[..., None, :] - centres, axis=-1) - radii - radius[:, None]
    gaps: F64 = np.minimum(away.min(axis=(1, 2, 3)), (6.0 - np.abs(circles).max(axis=-1) - radius).min(axis=(1, 2)))
    return np.minimum(gaps, least_gaps(poses, body)) if poses.shape[1] > 1 else gaps


@pytest.mark.parametrize("speed", [1.0, 1.59])
def test_the_chord_stands_for_an_arc_that_lies_beside_it_by_no_more_than_3_mm(speed: float) -> None:
    simulation = loop(step=0.1, robot={"max_speed": speed, "max_turn_rate": 1.5})
    simulation.step([[[1.0, 1.0]]])
    chord = 2.0 * speed / 1.5 * math.sin(0.5 * 0.15)
    assert simulation.info()["path_length"][0, 0] == pytest.approx(chord, abs=1e-12)
    assert not simulation.scenario.goes_on_arcs


# ---------------------------------------------------------------------------------------------- arcs, sampled


def on_arc(begin: F64, way: float, turn: float, share: float) -> F64:
    """Motion x, y, heading of a share of an arc so long [m] that turns by so much [rad]."""
    half = 0.5 * share * turn
    chord = share * way * np.sinc(half / np.pi)
    return np.array([chord * math.cos(begin[2] + half), chord * math.sin(begin[2] + half), 2.0 * half])


def gap_at(simulation: Simulation, pose: F64, obstacles: list[list[float]]) -> float:
    """Distance from the body at a pose to circles x, y, radius [m]."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return float(
        min(
            math.dist((pose[0] + cos * ox - sin * oy, pose[1] + sin * ox + cos * oy), (x, y)) - radius - own
            for ox, oy, own in simulation.world.footprint.tolist()
            for x, y, radius in obstacles
        )
    )


def test_random_drives_touch_and_clear_what_a_dense_sampling_of_their_steps_does() -> None:
    """Every step, however long, ends where the sampled body first touches, and never after it."""
    rng = np.random.default_rng(4)
    circles = [[-0.5, 0.1, 0.15], [0.0, 0.0, 0.2], [0.6, -0.1, 0.12]]
    ends = {"running": 0, "collision": 0}
    for _ in range(60):
        obstacles = [[*place, 0.2] for place in rng.uniform(-2.5, 2.5, (12, 2)).tolist()]
        obstacles = [one for one in obstacles if math.hypot(one[0], one[1]) > 1.0]
        simulation = make(circles, step=0.5, circles=obstacles)
        for _ in range(4):
            before, gone = simulation.world.pose[0, 0].copy(), simulation.info()["path_length"][0, 0]
            action = rng.uniform(-1.0, 1.0, 2)
            simulation.step([[action]])
            way, turn = 0.5 * action[0], 0.5 * 1.5 * action[1]
            shares = np.linspace(0.0, 1.0, 201)
            gaps = np.array([gap_at(simulation, before + on_arc(before, way, turn, u), obstacles) for u in shares])
            if outcome(simulation) == "collision":
                share = (simulation.info()["path_length"][0, 0] - gone) / abs(way)
                end = before + on_arc(before, way, turn, share)
                assert 0.0 <= gap_at(simulation, end, obstacles) < 3.0 * EARLY
                assert (gaps[shares < share - 1e-9] > 0.0).all()
                break
            assert gaps.min() > 0.0
            assert simulation.info()["min_clearance"][0, 0] <= gaps.min() + EARLY
        ends[outcome(simulation)] += 1
    assert min(ends.values()) > 10


# ---------------------------------------------------------------------------------------------- the rod in the corner


def longest_rod(a: float, b: float, radius: float = 0.0) -> float:
    """Distance of the outer centres of the longest rod of a radius that passes a right angle of two passages [m].

    Its ends slide along the outer walls; at an angle t its middle line is (a - r) sin t + (b - r) cos t - l sin t cos t
    from the inner corner, which must not be less than its radius r.
    """
    angles = np.linspace(0.01, 0.5 * math.pi - 0.01, 200_001)
    sin, cos = np.sin(angles), np.cos(angles)
    lengths: F64 = ((a - radius) * sin + (b - radius) * cos - radius) / (sin * cos)
    return float(lengths.min())


def touches(simulation: Simulation, before: list[float], after: list[float]) -> bool:
    """Whether the body touches something while it goes straight, and turns evenly, from pose to pose."""
    world = simulation.world
    world.pose[0, 0] = before
    world.array("next_pose")[0] = after
    columns, index = world.make_scratch()
    first = first_contact(world.floats[0], world.ints[0], world.spec[0], world.footprint, columns, index[1:])
    return bool(first <= 1.0)


def test_the_longest_thin_rod_is_as_long_as_the_closed_form_says() -> None:
    for a, b in ((1.0, 1.0), (1.0, 1.5), (0.4, 2.0)):
        assert longest_rod(a, b) == pytest.approx((a ** (2 / 3) + b ** (2 / 3)) ** 1.5, abs=1e-6)


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (1.0, 1.5)])
@pytest.mark.parametrize(("spare", "passes"), [(0.01, True), (-0.01, False)])
def test_a_rod_passes_a_right_angle_where_it_is_no_longer_than_the_closed_form(
    a: float, b: float, spare: float, passes: bool
) -> None:
    radius, off_the_wall, moves = 0.05, 1e-4, 400
    extent = longest_rod(a, b, radius) - spare
    walls = [
        [[a, b], [6, b], [6, 6], [a, 6]],
        [[-1, -1], [0, -1], [0, 7], [-1, 7]],
        [[0, -1], [7, -1], [7, 0], [0, 0]],
    ]
    circles = rod(0.5 * extent, radius, 2 * round(extent / 0.04) + 1)  # so near one another that they make a rod
    simulation = make(circles, polygons=walls, start=[3, 0.5 * b, 0], goal=[0.5 * a, 5])
    inner, half = radius + off_the_wall, 0.5 * extent
    angles = np.linspace(0.0, 0.5 * math.pi, moves + 1).tolist()
    poses = [[inner + half * math.cos(t), inner + half * math.sin(t), -t] for t in angles]
    touched = [touches(simulation, *pair) for pair in pairwise(poses)]
    assert any(touched) != passes


def test_a_footprint_without_circles_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"robot\.circles: got \[\], expected a list of at least 1"):
        load({"robot": {"circles": []}})
