"""VisBug-21 and VisBug-22 against closed forms, Bug2, the ring, the map of Oni and Wang; what they take for visible."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from compiled import for_python
from episodes import (
    CANONICAL_POLYGONS,
    CLOSED_FORM_SENSORS,
    OTHER,
    RING_ROUND_THE_START,
    Disc,
    Episode,
    Ring,
    Slab,
    UTrap,
    canonical_world,
    run_episode,
    tolerance,
)
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon

from bug_gym.agents import make_policy
from bug_gym.agents.scan import joined as chains
from bug_gym.simulation import Simulation

POLICIES = ["vis_bug_21", "vis_bug_22"]

is_seen_free = for_python(chains.is_seen_free)
SLAB, DISC, TRAP = Slab(), Disc(), UTrap()
WITH_EYES: dict[str, Callable[[str], float]] = {
    "slab": SLAB.shortest,
    "disc": lambda turn: DISC.shortest(),
    "u_trap": lambda turn: TRAP.shortest(),
}
"""The taut string round the side of the turn: all of the obstacle that Bug2 would walk round is seen from the start."""
AS_BUG2: dict[str, Callable[[str], float]] = {
    "slab": SLAB.until_line,
    "disc": lambda turn: DISC.until_line(),
    "u_trap": lambda turn: TRAP.until_line(),
}
SEES_ALL = {"beams": 720, "range": 30.0}


def seen_world(world: str, *, lidar: dict[str, Any] = SEES_ALL, **placing: Any) -> dict[str, Any]:
    """A canonical world with another scanner."""
    return canonical_world(world, **placing) | {"lidar": lidar}


# ---------------------------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(("angle", "mirrored"), [(0.0, False), (0.0, True), (0.83, False), (0.83, True)])
@pytest.mark.parametrize("world", WITH_EYES)
@pytest.mark.parametrize("policy", POLICIES)
def test_with_unlimited_sight_the_way_is_the_taut_string(
    policy: str, world: str, turn: str, angle: float, mirrored: bool
) -> None:
    episode = run_episode(policy, seen_world(world, angle=angle, mirrored=mirrored), turn=turn, clearance=0.5)
    expected = WITH_EYES[world](OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("world", WITH_EYES)
@pytest.mark.parametrize("policy", POLICIES)
def test_with_a_vision_range_of_the_clearance_the_way_is_bug2s(policy: str, world: str, turn: str) -> None:
    episode = run_episode(policy, seen_world(world), turn=turn, clearance=0.5, vision_range=0.5)
    expected = AS_BUG2[world](turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("vision_range", [0.8, 2.0, 5.0])
@pytest.mark.parametrize("world", WITH_EYES)
@pytest.mark.parametrize("policy", POLICIES)
def test_some_sight_gives_a_way_between_bug2s_and_the_taut_string(policy: str, world: str, vision_range: float) -> None:
    episode = run_episode(policy, seen_world(world), clearance=0.5, vision_range=vision_range)
    shortest, bug2 = WITH_EYES[world]("left"), AS_BUG2[world]("left")
    assert episode.outcome == "success"
    assert shortest - tolerance(shortest) <= episode.full_length <= bug2 + tolerance(bug2)


# ---------------------------------------------------------------------------------------------- the map of Oni and Wang

# Lengths at a clearance of 1 m on the rounded contour: the shortest way, and Bug2's that turns left.
ROUTES = {"AB": (14.685, 19.14), "AC": (24.340, 137.57), "AD": (36.206, 53.29), "BA": (14.685, 133.42)}
ROUTES |= {"BC": (9.664, 118.42), "BD": (29.919, 34.14), "CA": (24.340, 145.57), "CB": (9.664, 12.14)}
ROUTES |= {"CD": (38.577, 62.28), "DA": (36.206, 48.14), "DB": (29.919, 59.28), "DC": (38.577, 90.28)}


def run_route(policy: str, route: str, **parameters: Any) -> Episode:
    """A policy from one letter of the map to another."""
    places = {"world.start": route[0], "world.goal": route[1]}
    return run_episode(policy, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0, **parameters)


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("policy", POLICIES)
def test_each_route_of_oni_and_wang_is_reached_no_later_than_by_bug2(policy: str, route: str) -> None:
    episode = run_route(policy, route)
    shortest, bug2 = ROUTES[route]
    assert episode.outcome == "success"
    assert shortest - tolerance(shortest) <= episode.full_length <= bug2 + tolerance(bug2)


@pytest.mark.parametrize("route", ["AC", "BD", "CB", "DC"])
@pytest.mark.parametrize("policy", POLICIES)
def test_without_sight_the_routes_of_oni_and_wang_are_bug2s(policy: str, route: str) -> None:
    episode = run_route(policy, route, vision_range=1.0)
    _, bug2 = ROUTES[route]
    assert episode.full_length == pytest.approx(bug2, abs=tolerance(bug2))


@pytest.mark.parametrize("route", ["AC", "CA", "DC"])
@pytest.mark.parametrize("policy", POLICIES)
def test_hit_and_leave_points_come_nearer_to_the_goal_and_lie_on_the_m_line(policy: str, route: str) -> None:
    memory = run_route(policy, route).memory
    line = memory.scout.m_line
    hits = [math.dist(place, line.goal) for place in memory.hits]
    leaves = [math.dist(place, line.goal) for place in memory.leaves]
    assert len(hits) >= 2 and len(leaves) >= len(hits) - 1
    assert all(hit > leave for hit, leave in zip(hits, leaves, strict=False))
    assert all(leave >= hit - 1e-9 for leave, hit in zip(leaves, hits[1:], strict=False))
    # The crossing lies within the scout's step that ends at the point.
    assert max(abs(line.offset(place)) for place in [*memory.hits, *memory.leaves]) <= 0.1


# ---------------------------------------------------------------------------------------------- no way

OUTSIDE, INSIDE = Ring().first + Ring().lap, Ring().first_inside + Ring().lap_inside
"""To the ring and once round it [m]."""


def ring(*, inside: bool) -> dict[str, Any]:
    """What the scenario "ring" is changed by; `inside`: round the start instead of the goal."""
    return {**CLOSED_FORM_SENSORS, "world": RING_ROUND_THE_START} if inside else CLOSED_FORM_SENSORS


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("policy", POLICIES)
def test_a_goal_shut_in_is_unreachable_when_the_lap_is_seen(policy: str, turn: str) -> None:
    episode = run_episode(policy, "ring", ring(inside=False), clearance=0.5, turn=turn)
    # Of a square's boundary at most two sides are seen from one place.
    assert episode.verdict == "unreachable"
    assert 0.5 * OUTSIDE <= episode.length <= 1.25 * OUTSIDE


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("policy", POLICIES)
def test_a_robot_shut_in_sees_the_whole_lap_at_once(policy: str, turn: str) -> None:
    episode = run_episode(policy, "ring", ring(inside=True), clearance=0.5, turn=turn)
    assert (episode.verdict, episode.length < 1.0) == ("unreachable", True)


@pytest.mark.parametrize(("inside", "lap"), [(False, OUTSIDE), (True, INSIDE)])
@pytest.mark.parametrize("policy", POLICIES)
def test_without_sight_the_lap_is_walked(policy: str, inside: bool, lap: float) -> None:
    episode = run_episode(policy, "ring", ring(inside=inside), clearance=0.5, vision_range=0.5)
    assert episode.verdict == "unreachable"
    assert lap - 1.2 <= episode.length <= 1.03 * lap  # the scout closes it two steps before the robot, past the gate


def slit_box(rng: np.random.Generator, *, is_open: bool) -> list[Any]:
    """A box somewhere with walls of 0.4 m, shut or with a slit of 1 m in one wall; its centre and its polygon."""
    centre, half, angle = rng.uniform(-5.0, 5.0, 2), rng.uniform(1.5, 2.5), rng.uniform(0.0, 2.0 * math.pi)
    slit, outer = rng.uniform(0.6 - half, half - 0.6), half + 0.4
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])

    def place(points: Any) -> Any:
        return (np.array(points) @ turn + centre).tolist()

    shell = [(-outer, outer), (-outer, -outer), (outer, -outer), (outer, outer)]
    hole = [(half, half), (half, -half), (-half, -half), (-half, half)]
    if not is_open:
        return [centre.tolist(), {"shell": place(shell), "holes": [place(hole)]}]
    right, left = slit + 0.5, slit - 0.5
    return [centre.tolist(), place([(right, half), *hole, (left, half), (left, outer), *shell, (right, outer)])]


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("is_open", [True, False])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("policy", POLICIES)
def test_a_box_is_called_shut_exactly_when_it_is(policy: str, seed: int, is_open: bool, kinematics: str) -> None:
    centre, box = slit_box(np.random.default_rng(seed), is_open=is_open)
    places: list[Any] = [centre, [-9.0, -9.0] if seed % 2 else [9.0, 9.0]]
    start, goal = places if seed < 2 else reversed(places)
    world = {"family": "explicit", "bounds": [-10, -10, 10, 10], "polygons": [box]}
    world |= {"start": [*start, 0.3], "goal": goal}
    lidar = {"beams": 180, "range": 10.0, "noise": 0.01}
    scenario = {"robot": {"kinematics": kinematics}, "lidar": lidar, "time": {"limit": 400.0}, "world": world}
    episode = run_episode(policy, scenario, seed=seed)
    assert (episode.outcome, episode.verdict) == (("success", "") if is_open else ("running", "unreachable"))


# ---------------------------------------------------------------------------------------------- random worlds


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("policy", POLICIES)
def test_random_fields_are_crossed_without_a_collision(policy: str, seed: int, kinematics: str) -> None:
    changes = {"robot.kinematics": kinematics, "world.obstacles": 60, "lidar.beams": 128, "time.limit": 300.0}
    assert run_episode(policy, "static", changes, seed=seed).outcome == "success"


# 36: the scout crosses the M-line far from the goal, which must not draw it back; 39: the goal is seen and lost again.
@pytest.mark.parametrize(("seed", "kinematics"), [(36, "holonomic"), (39, "holonomic"), (39, "differential")])
@pytest.mark.parametrize("policy", POLICIES)
def test_mazes_are_crossed_without_a_collision(policy: str, seed: int, kinematics: str) -> None:
    changes = {"robot.kinematics": kinematics, "time.limit": 2000.0}
    assert run_episode(policy, "maze", changes, seed=seed).outcome == "success"


@pytest.mark.parametrize("policy", POLICIES)
def test_few_beams_do_not_lay_the_hand_on_a_wall_far_away(policy: str) -> None:
    # In this world the obstacle on the way is so small that 32 beams see it at some distances and lose it at others.
    assert run_episode(policy, "static", {"lidar.beams": 32}, seed=10).outcome == "success"


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("policy", POLICIES)
def test_a_moving_target_is_caught(policy: str, seed: int) -> None:
    assert run_episode(policy, "moving_target", {"time.limit": 120.0}, seed=seed).outcome == "success"


# ---------------------------------------------------------------------------------------------- the two rules


def test_visbug_22_takes_a_short_cut_that_visbug_21_must_not() -> None:
    # A room round the start, its lower right corner open. Bug2 turns left, so the side where the opening is seen is not
    # the main semiplane; through it the M-line is seen behind the wall, but for the block not the goal.
    #
    #   +-----------------------+
    #   | +-------------------+ |
    #   | |                   | |
    #   | |      S ---------- | | -------------- # G
    #   | |                   +-+               ##
    #   | +---------+
    #   +-----------+
    room = [[12, -1], [12, 4], [-4, 4], [-4, -5], [5, -5], [5, -4], [-3, -4], [-3, 3], [11, 3], [11, -1]]
    block = [[18, -0.9], [19, -0.9], [19, -0.3], [18, -0.3]]
    world = {"family": "explicit", "bounds": [-10, -12, 25, 12], "polygons": [room, block]}
    scenario = {"lidar": SEES_ALL, "time": {"limit": 200.0}, "world": {**world, "start": [0, 0, 0], "goal": [20, 0]}}
    first, second = (run_episode(policy, scenario, clearance=0.5) for policy in POLICIES)
    assert first.outcome == second.outcome == "success"
    # VisBug-22: to the opening and on to the line. VisBug-21: out of it and round the room, 36 m of outer walls.
    assert second.full_length < 26.0
    assert first.full_length > 36.0


# ---------------------------------------------------------------------------------------------- what is visible


@pytest.mark.parametrize("vision_range", [2.0, 6.0])
@pytest.mark.parametrize("policy", POLICIES)
def test_t_i_is_in_sight_and_within_the_vision_range(policy: str, vision_range: float) -> None:
    simulation = Simulation(seen_world("u_trap"))
    agent = make_policy(policy, simulation, clearance=0.5, vision_range=vision_range)
    obstacle, step = Polygon(CANONICAL_POLYGONS["u_trap"]), 0.1
    observation, state = simulation.reset(seeds=[0]), None
    for _ in range(600):
        action, state = agent.predict(observation[:, 0], state)
        assert state is not None
        memory = state[0]
        here = simulation.world.pose[0, 0, :2]
        target = (20.0, 0.0) if memory.is_goal_seen else memory.scout.place
        assert math.dist(here, target) <= vision_range + step
        assert LineString([here, target]).distance(obstacle) >= 0.4
        transition = simulation.step(action[:, None])
        observation = transition.observation
        if transition.terminated.any():
            break
    assert simulation.info()["outcome"][0, 0] == "success"


def scan_of(ranges: list[float]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Ranges of beams all round, with the cosines and sines of their angles."""
    angles = 2.0 * np.pi * np.arange(len(ranges)) / len(ranges)
    return np.array(ranges), np.cos(angles), np.sin(angles)


def joined(
    ranges: NDArray[np.float64], *, is_round: bool = True, reach: float = 5.0, gap: float = 1.0, spacing: float = 0.25
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What `join_scan` makes of a scan all round: points of walls, and places up to which they may go on."""
    values, cos, sin = scan_of(ranges.tolist())
    points = np.empty((2, round(len(ranges) * (3 + gap / spacing))))
    count, total = chains.join_scan(values, cos, sin, reach, is_round, gap, spacing, points[0], points[1])
    return points[:, :count], points[:, count:total]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("is_round", [True, False])
def test_neighbours_nearer_than_the_gap_are_joined_by_a_line_of_points(seed: int, is_round: bool) -> None:
    rng = np.random.default_rng(seed)
    ranges, cos, sin = scan_of(np.where(rng.random(40) < 0.2, 5.0, rng.uniform(2.0, 4.0, 40)).tolist())
    expected, ends = [], []
    for i in np.flatnonzero(ranges < 5.0):
        here = ranges[i] * np.array([cos[i], sin[i]])
        for way in (1, -1):
            j = int(i + way)
            if not is_round and not 0 <= j < 40:
                continue
            j %= 40
            there = ranges[j] * np.array([cos[j], sin[j]])
            gap = float(np.hypot(*(there - here)))
            if ranges[j] < 5.0 and gap <= 1.0 and way == 1:
                pieces = math.floor(gap / 0.25) + 1
                expected += [here + (there - here) * k / pieces for k in range(1, pieces)]
            if ranges[j] == 5.0 or (gap > 1.0 and ranges[j] > ranges[i]):
                ends.append(ranges[i] * np.array([cos[j], sin[j]]))
        expected.append(here)
    points, places = joined(ranges, is_round=is_round)
    np.testing.assert_allclose(sorted(points.T.tolist()), sorted(np.array(expected).tolist()), atol=1e-12)
    np.testing.assert_allclose(sorted(places.T.tolist()), sorted(np.array(ends).tolist()), atol=1e-12)


def test_a_wall_that_ends_between_two_beams_hides_the_place_beside_its_last_point_only_when_one_must_be_sure() -> None:
    ranges = np.full(90, 10.0)
    ranges[10:30] = 4.0
    # Past the last point by a little more than the disc's radius: the next beam is 4 m x 4 degrees = 0.28 m aside.
    bearing = math.radians(29 * 4.0) + math.asin(0.35 / 4.0)
    place = (8.0 * math.cos(bearing), 8.0 * math.sin(bearing))
    points, ends = joined(ranges, reach=10.0)

    def is_visible(px: NDArray[np.float64], py: NDArray[np.float64]) -> bool:
        return is_seen_free(*place, ranges, 0.0, math.radians(4.0), True, px, py, 0.3)

    assert is_visible(*points)
    assert not is_visible(*np.concatenate([points, ends], axis=1))


def is_seen(place: tuple[float, float], ranges: list[float], radius: float, *, reach: float = 10.0) -> bool:
    """Whether a place is seen free past the points of a scan all round."""
    values, cos, sin = scan_of(ranges)
    seen = values < reach
    x, y = (values * cos)[seen], (values * sin)[seen]
    angle_step = 2.0 * math.pi / len(ranges)
    return bool(is_seen_free(*place, values, 0.0, angle_step, True, x, y, radius))


def test_a_place_behind_a_wall_is_not_seen_even_between_two_of_its_points() -> None:
    # Two beams 0.17 rad apart meet a wall 4 m and 6 m away: a disc of radius 0.3 fits between the points.
    ranges = [10.0] * 36
    ranges[1], ranges[2] = 4.0, 6.0
    bearing = 1.5 * 2.0 * math.pi / 36.0
    assert not is_seen((5.0 * math.cos(bearing), 5.0 * math.sin(bearing)), ranges, 0.3)
    assert is_seen((3.5 * math.cos(bearing), 3.5 * math.sin(bearing)), ranges, 0.3)


@pytest.mark.parametrize(("radius", "expected"), [(0.45, True), (0.55, False)])
def test_a_place_is_seen_past_a_point_as_far_aside_as_the_disc_is_wide(radius: float, expected: bool) -> None:
    ranges = [10.0] * 360
    ranges[30] = 1.0  # 0.5 m beside the way ahead
    assert is_seen((4.0, 0.0), ranges, radius) is expected


def test_the_first_visible_place_of_a_row_is_found() -> None:
    ranges, cos, sin = scan_of([10.0] * 360)
    ranges[:20] = 3.0  # a wall from 0 to 20 degrees
    seen = ranges < 10.0
    scan = (ranges, 0.0, math.radians(1.0), True, (ranges * cos)[seen], (ranges * sin)[seen], 0.2)
    # Places (5, k): hidden until the wall's end at 19 degrees with the disc's radius, asin(0.2 / 3), beyond it.
    first = math.ceil(5.0 * math.tan(math.radians(19.0) + math.asin(0.2 / 3.0)) / 0.1)
    assert chains.first_seen_free((5.0, 0.0), (0.0, 0.1), 60, 8.0, *scan) == first
    assert chains.first_seen_free((5.0, 0.0), (0.0, 0.1), first, 8.0, *scan) == -1
    assert chains.first_seen_free((5.0, 0.0), (0.0, 0.1), 60, 5.0, *scan) == -1


@pytest.mark.parametrize("vision_range", [0.29, -1.0, math.nan])
@pytest.mark.parametrize("policy", POLICIES)
def test_a_vision_range_below_the_clearance_is_refused(policy: str, vision_range: float) -> None:
    with pytest.raises(ValueError, match="vision_range must be at least the clearance of 0.3"):
        make_policy(policy, Simulation("static"), clearance=0.3, vision_range=vision_range)
