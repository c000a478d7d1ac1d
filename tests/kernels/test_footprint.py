"""Bodies of several circles: passages, turns on the spot and the rod in the corner, each against its closed form."""

from __future__ import annotations

import math
from itertools import pairwise
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


# ---------------------------------------------------------------------------------------------- arcs, sampled


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
            before = simulation.world.pose[0, 0].copy()
            action = rng.uniform(-1.0, 1.0, 2)
            simulation.step([[action]])
            speed, rate = action[0], 1.5 * action[1]
            chord = 0.5 * speed * np.sinc(0.25 * rate / np.pi)
            middle = before[2] + 0.25 * rate
            motion = np.array([chord * math.cos(middle), chord * math.sin(middle), 0.5 * rate])
            gaps = np.array(
                [gap_at(simulation, before + share * motion, obstacles) for share in np.linspace(0, 1, 201)]
            )
            moved = simulation.world.pose[0, 0] - before
            if outcome(simulation) == "collision":
                share = math.hypot(moved[0], moved[1]) / abs(chord)
                assert 0.0 <= gap_at(simulation, before + share * motion, obstacles) < 3.0 * EARLY
                assert (gaps[np.linspace(0, 1, 201) < share - 1e-9] > 0.0).all()
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
