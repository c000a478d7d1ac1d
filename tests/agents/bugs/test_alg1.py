"""Alg1, Alg2, Rev1 and Rev2 after Noborio: bugs that turn round once where they meet an earlier hit or leave point."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from episodes import (
    CLOSED_FORM_SENSORS,
    OTHER,
    Disc,
    Episode,
    Slab,
    UTrap,
    canonical_world,
    goal_distances,
    in_world,
    run_episode,
    scene,
    tolerance,
)
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.polygon import orient

from bug_gym.agents import make_policy
from bug_gym.agents.bugs.alg1 import Alg1
from bug_gym.agents.walls.marks import Mark
from bug_gym.agents.walls.turning_round import hit_and_trace, walk_back
from bug_gym.simulation import Simulation
from bug_gym.view import View

SLAB, DISC, TRAP = Slab(), Disc(), UTrap()
ALL: dict[str, tuple[str, dict[str, Any]]] = {
    "alg1": ("alg1", {}),
    "alg2": ("alg2", {}),
    "rev1": ("rev1", {}),
    "rev2_noborio": ("rev2", {"variant": "noborio"}),
}
ON_THE_LINE = ("alg1", "rev1")
ALTERNATING = ("rev1", "rev2_noborio")

Length = Callable[[str], float]
UNTIL_LINE: dict[str, Length] = {
    "slab": SLAB.until_line,
    "disc": lambda turn: DISC.until_line(),
    "u_trap": lambda turn: TRAP.until_line(),
}
UNTIL_FREE: dict[str, Length] = {
    "slab": SLAB.until_free,
    "disc": lambda turn: DISC.until_free(),
    "u_trap": lambda turn: TRAP.until_free(),
}


def run(name: str, scenario: Any, overrides: dict[str, Any] | None = None, **parameters: Any) -> Episode:
    """An episode of one of ALL."""
    policy, own = ALL[name]
    return run_episode(policy, scenario, overrides, **own, **parameters)


# ------------------------------------------------------------------------------------------ closed forms


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(("angle", "mirrored"), [(0.0, False), (0.83, False), (0.83, True)])
@pytest.mark.parametrize("world", UNTIL_LINE)
@pytest.mark.parametrize("name", ALL)
def test_the_way_has_the_length_of_its_closed_form(
    name: str, world: str, angle: float, mirrored: bool, turn: str
) -> None:
    episode = run(name, canonical_world(world, angle=angle, mirrored=mirrored), turn=turn, clearance=0.5)
    length = (UNTIL_LINE if name in ON_THE_LINE else UNTIL_FREE)[world]
    expected = length(OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


# ------------------------------------------------------------------------------------------ the map of Oni and Wang

# Lengths on the rounded contour at a clearance of 1 m, turning left. On ten routes no earlier point is met: there Alg1
# walks like Bug2 and Alg2 like Com1; the other routes are put together from pieces of the contour below.
BUG2_ROUTES = {"AB": 19.14, "AD": 53.29, "BA": 133.42, "BC": 118.42, "BD": 34.14}
BUG2_ROUTES |= {"CB": 12.14, "CD": 62.28, "DA": 48.14, "DB": 59.28, "DC": 90.28}
COM1_ROUTES = {"AB": 17.10, "AD": 42.82, "BA": 130.68, "BC": 116.42, "BD": 31.68}
COM1_ROUTES |= {"CB": 10.90, "CD": 60.09, "DA": 44.90, "DB": 57.24, "DC": 87.54}

CORNERS = [(5, 4), (6, 4), (6, -9), (22, -9), (22, 7), (14, 7)]
CORNERS += [(14, -2), (13, -2), (13, 8), (23, 8), (23, -10), (5, -10)]
CONTOUR = orient(Polygon(CORNERS).buffer(1.0, quad_segs=90)).exterior
A, C, D = (0.0, 0.0), (17.0, 0.0), (27.0, 0.0)
# Where the x axis, on which all places lie, meets the contour, from west to east.
M, U, N, V, EAST, W = (4.0, 0.0), (7.0, 0.0), (12.0, 0.0), (15.0, 0.0), (21.0, 0.0), (24.0, 0.0)


def left(begin: tuple[float, float], end: tuple[float, float]) -> float:
    """Way along the contour with the wall on the right: clockwise [m]."""
    return float((CONTOUR.project(Point(begin)) - CONTOUR.project(Point(end))) % CONTOUR.length)


def right(begin: tuple[float, float], end: tuple[float, float]) -> float:
    """Way along the contour with the wall on the left [m]."""
    return left(end, begin)


def tangent(corner: tuple[float, float], goal: tuple[float, float], side: int) -> tuple[float, float]:
    """Where a robot with the wall on its right (+1) or left (-1) leaves a corner's arc straight to the goal."""
    angle = math.atan2(goal[1] - corner[1], goal[0] - corner[0]) + side * math.acos(1.0 / math.dist(corner, goal))
    return corner[0] + math.cos(angle), corner[1] + math.sin(angle)


def hit(begin: tuple[float, float], goal: tuple[float, float]) -> tuple[float, float]:
    """Where the straight way from a place of the contour to the goal meets the contour next."""
    crossings = LineString([begin, goal]).intersection(CONTOUR).geoms
    return min(
        ((point.centroid.x, point.centroid.y) for point in crossings if point.distance(Point(begin)) > 0.1),
        key=lambda place: math.dist(place, begin),
    )


def alg2_from_a_to_c() -> float:
    """Meets the first hit point M on the lap from the second one, and goes back the whole way."""
    leave = tangent((6, 4), C, 1)
    second = hit(leave, C)
    last = tangent((14, -2), C, -1)
    way = 4.0 + left(M, leave) + math.dist(leave, second)
    return way + 2.0 * left(second, M) + right(second, last) + math.dist(last, C)


def alg2_from_c_to_a() -> float:
    leave = tangent((13, -2), A, 1)
    second = hit(leave, A)
    last = tangent((5, 4), A, -1)
    way = 2.0 + left(V, leave) + math.dist(leave, second)
    return way + 2.0 * left(second, V) + right(second, last) + math.dist(last, A)


def rev2_from_a_to_c() -> float:
    """The second hit point is followed with the wall on the left at once."""
    leave = tangent((6, 4), C, 1)
    second = hit(leave, C)
    last = tangent((14, -2), C, -1)
    return 4.0 + left(M, leave) + math.dist(leave, second) + right(second, last) + math.dist(last, C)


def rev2_from_c_to_a() -> float:
    leave = tangent((13, -2), A, 1)
    second = hit(leave, A)
    last = tangent((5, 4), A, -1)
    return 2.0 + left(V, leave) + math.dist(leave, second) + right(second, last) + math.dist(last, A)


def rev2_from_a_to_d() -> float:
    """Turns round at the second leave point; leaves the outer wall as near to the goal as the third hit point was."""
    first = tangent((6, 4), D, 1)
    second = hit(first, D)
    leave = tangent((14, -2), D, -1)
    third = hit(leave, D)
    way = 4.0 + left(M, first) + math.dist(first, second) + right(second, leave) + math.dist(leave, third)
    nearest = math.dist(third, D)
    last = (24.0, -math.sqrt(nearest**2 - 3.0**2))
    return way + 2.0 * left(third, leave) + right(third, last) + nearest


ALG1_TURNS = {
    "AC": 4.0 + left(M, U) + 5.0 + 2.0 * left(N, M) + right(N, V) + 2.0,
    "CA": 2.0 + left(V, N) + 5.0 + 2.0 * left(U, V) + right(U, M) + 4.0,
}
REV1_TURNS = {
    "AC": 4.0 + left(M, U) + 5.0 + right(N, V) + 2.0,
    "AD": 4.0 + left(M, U) + 5.0 + right(N, V) + 6.0 + 2.0 * left(EAST, V) + right(EAST, W) + 3.0,
    "CA": 2.0 + left(V, N) + 5.0 + right(U, M) + 4.0,
}
ROUTES = {
    "alg1": BUG2_ROUTES | ALG1_TURNS,
    "alg2": COM1_ROUTES | {"AC": alg2_from_a_to_c(), "CA": alg2_from_c_to_a()},
    "rev1": BUG2_ROUTES | REV1_TURNS,
    "rev2_noborio": COM1_ROUTES | {"AC": rev2_from_a_to_c(), "AD": rev2_from_a_to_d(), "CA": rev2_from_c_to_a()},
}
TURNING = {("alg1", "AC"), ("alg1", "CA"), ("alg2", "AC"), ("alg2", "CA"), ("rev1", "AD"), ("rev2_noborio", "AD")}


def oni_wang(name: str, route: str, **parameters: Any) -> Episode:
    """A route of the map at its clearance."""
    places = {"world.start": route[0], "world.goal": route[1]}
    return run(name, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0, **parameters)


def test_the_pieces_of_the_contour_give_the_known_lengths_with_square_corners() -> None:
    # 177 and 129 m with 12 and 4 convex corners on the way; a round one is 2 - pi/2 m shorter.
    corner = 2.0 - 0.5 * math.pi
    assert ALG1_TURNS["AC"] == pytest.approx(177.0 - 12 * corner, abs=0.01)
    assert ALG1_TURNS["CA"] == pytest.approx(129.0 - 4 * corner, abs=0.01)
    assert REV1_TURNS["AD"] == pytest.approx(161.0 - 8 * corner, abs=0.01)


@pytest.mark.parametrize(("name", "route"), [(name, route) for name in ALL for route in ROUTES[name]])
def test_the_routes_of_oni_and_wang(name: str, route: str) -> None:
    episode = oni_wang(name, route)
    expected = ROUTES[name][route]
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))
    assert ("walking_back" in episode.modes) == ((name, route) in TURNING)


# ------------------------------------------------------------------------------------------ crossings

COVE = [(-4, 5), (6, 5), (6, -4), (5, -4), (5, 4), (-3, 4), (-3, -8), (15, -8), (15, 4), (10, 4), (10, -2)]
COVE += [(9, -2), (9, 5), (16, 5), (16, -9), (-4, -9)]
"""Turning left at (4.5, 0), a robot on its way to (22, 0) comes by the M-line behind the start, before the wall at x = 15 and
on the far side of a plate at x = 10, before it gets out between that and the first wall."""


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("name", "hits"), [("bug2", 2), ("alg1", 1), ("rev1", 1)])
def test_a_crossing_is_passed_by_that_is_farther_than_one_at_a_wall(name: str, hits: int, mirrored: bool) -> None:
    """Bug2 leaves at x = 10.5, nearer to the goal than where it hit; Alg1 has been nearer, where the wall was in the way."""
    sign = -1 if mirrored else 1
    world = {"family": "explicit", "bounds": [-9, -14, 27, 14], "polygons": [[(x, sign * y) for x, y in COVE]]}
    scenario = {
        "lidar": {"beams": 360},
        "time": {"limit": 300.0},
        "world": {**world, "start": [0, 0, 0], "goal": [22, 0]},
    }
    episode = run_episode(name, scenario, turn="right" if mirrored else "left", clearance=0.5)
    assert episode.outcome == "success"
    assert len(episode.memory.hits) == len(episode.memory.leaves) == hits
    assert math.dist(episode.memory.leaves[-1], (16.5, 0.0)) <= 0.15


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", ["bug2", "alg1", "rev1"])
def test_a_crossing_on_a_face_that_leads_away_is_taken_as_published_and_passed_by_with_the_rule_front(
    name: str, mirrored: bool
) -> None:
    """The face behind the obstacle leans toward the start, so that along it the goal lies 117 degrees aside."""
    sign = -1 if mirrored else 1
    polygon = [[8, sign * -3], [10, sign * -3], [14, sign * 5], [8, sign * 5]]
    world = {
        "family": "explicit",
        "bounds": [-9, -14, 30, 14],
        "polygons": [polygon],
        "start": [0, 0, 0],
        "goal": [22, 0],
    }
    scenario = {"lidar": {"beams": 360}, "time": {"limit": 300.0}, "world": world}
    behind = (11.5 + 0.5 * math.hypot(1.0, 0.5), 0.0)
    turn = "right" if mirrored else "left"
    published = run_episode(name, scenario, clearance=0.5, turn=turn)
    assert published.outcome == "success"
    assert math.dist(published.memory.leaves[0], behind) <= 0.15
    front = run_episode(name, scenario, clearance=0.5, turn=turn, leave_rule="front")
    assert front.length > published.length + 5.0


# ------------------------------------------------------------------------------------------ turning round


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_the_way_back_is_the_way_it_came_and_ends_at_the_hit_point(kinematics: str) -> None:
    places = {"world.start": "A", "world.goal": "C", "robot.kinematics": kinematics}
    episode = run("alg2", "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0)
    back = np.array([mode == "walking_back" for mode in episode.modes])
    first, last = np.flatnonzero(back)[[0, -1]]
    came = LineString(episode.path[: first + 1, :2])
    assert back[first : last + 1].all(), "it turns round once"
    assert max(came.distance(Point(place)) for place in episode.path[first : last + 1, :2]) < 0.1
    assert math.dist(episode.path[last + 1, :2], in_world(episode, episode.memory.hits)[-1]) <= 0.1


def test_where_the_way_back_is_blocked_the_other_hand_takes_the_wall() -> None:
    simulation = Simulation("slab", 1, overrides={**CLOSED_FORM_SENSORS, "world.start": [7.7, 0.0, 0.0]})
    policy = make_policy("alg1", simulation, clearance=0.5)
    assert isinstance(policy, Alg1)
    flat: NDArray[np.float32] = simulation.reset(seeds=[0])[0, 0]
    view, memory = View(flat, policy.sensors), policy.start()
    hit_and_trace(policy.boundary, view, memory, 1, view.goal_bearing)
    memory.is_turning = True
    memory.trace = [Mark((1.0, 0.0), (0.8, 0.3))]  # inside the slab
    assert walk_back(policy.boundary, view, memory) is None
    assert memory.contour is not None and (memory.contour.side, memory.contour.wall) == (-1, (0.8, 0.3))
    assert not memory.is_turning


@pytest.mark.parametrize("moved", [False, True])
def test_through_a_gap_that_the_body_alone_passes_it_goes_back_where_nothing_has_moved(moved: bool) -> None:
    """It came through it; where something has moved it may be narrower by now."""
    beside = 0.26
    discs = [[0.1, side * (beside + 0.3), 0.3] for side in (1, -1)]
    simulation = Simulation(scene(circles=discs) | {"robot": {"kinematics": "holonomic", "radius": 0.2}})
    policy = make_policy("alg1", simulation, clearance=0.5)
    assert isinstance(policy, Alg1)
    boundary = policy.boundary
    assert boundary.body_radius < beside < boundary.safe_radius
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    hit_and_trace(boundary, view, memory, 1, 0.0).is_disturbed = moved
    memory.is_turning = True
    memory.trace = [Mark((1.0, 0.0), (1.0, 0.5)), Mark((0.1, 0.0), (0.1, beside))]
    assert (walk_back(boundary, view, memory) is None) == moved
    assert memory.is_turning == (not moved)


# ------------------------------------------------------------------------------------------ what always holds

MAZE = {"robot.kinematics": "holonomic", "lidar.beams": 180, "time.limit": 4000.0}
FIELD = {"robot.kinematics": "holonomic", "lidar.beams": 180, "time.limit": 400.0, "world.obstacles": 60}


@pytest.fixture(
    scope="module", params=[*((n, "maze", s) for n in ALL for s in (3, 7)), *((n, "static", 21) for n in ALL)]
)
def wandering(request: pytest.FixtureRequest) -> tuple[str, Episode]:
    """A long way through a maze, or one among many obstacles."""
    name, world, seed = request.param
    return name, run(name, world, MAZE if world == "maze" else FIELD, seed=seed)


def test_it_arrives_without_touching_anything(wandering: tuple[str, Episode]) -> None:
    _, episode = wandering
    assert episode.outcome == "success"
    assert episode.min_clearance > 0.0


def test_hit_and_leave_points_come_ever_nearer_to_the_goal(wandering: tuple[str, Episode]) -> None:
    _, episode = wandering
    hits, leaves = goal_distances(episode, episode.memory.hits), goal_distances(episode, episode.memory.leaves)
    assert len(hits) == len(leaves) >= 1
    assert np.all(leaves < hits)
    assert np.all(hits[1:] <= leaves[:-1])  # the same place where two obstacles almost touch


def test_the_side_is_kept_or_alternates(wandering: tuple[str, Episode]) -> None:
    name, episode = wandering
    count = len(episode.memory.hits)
    expected = [(-1) ** k for k in range(count)] if name in ALTERNATING else [1] * count
    assert episode.memory.hit_sides == expected


@pytest.mark.parametrize("name", ON_THE_LINE)
def test_they_leave_on_the_m_line(name: str) -> None:
    episode = run(name, "maze", MAZE, seed=3)
    robot, time = episode.simulation.scenario.robot, episode.simulation.scenario.time
    offsets = [abs(episode.memory.line.offset(place)) for place in episode.memory.leaves]
    assert offsets and max(offsets) <= robot.max_speed * time.step


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("name", ALL)
def test_noise_of_the_ranges_changes_no_outcome(name: str, kinematics: str) -> None:
    scenario = canonical_world("u_trap")
    scenario["lidar"] |= {"noise": 0.02, "dropout": 0.01}
    scenario["robot"] = {"kinematics": kinematics}
    assert run(name, scenario, clearance=0.5).outcome == "success"


@pytest.mark.parametrize("name", ALL)
def test_marks_met_on_the_way_to_another_place_of_the_target_are_forgotten(name: str) -> None:
    """It stirs until the robot has left the slab, then goes 16 m farther."""
    points = [[18.0, 0.0], [18.0, 0.3]] * 24 + [[34.0, 0.0]]
    motion = {"law": "waypoints", "points": points, "speed": 0.6, "stop": True}
    scenario = canonical_world("slab")
    del scenario["world"]["goal"]
    scenario["world"] |= {"target": {"at": points[0], "motion": motion}, "bounds": [-5, -20, 40, 20]}
    episode = run(name, scenario, clearance=0.5)
    assert episode.outcome == "success"
    assert len(episode.memory.leaves) == 1 and not episode.memory.marks


@pytest.mark.parametrize("name", ALL)
def test_a_target_that_moves_is_never_called_unreachable(name: str) -> None:
    for seed in range(4):
        assert run(name, "moving_target", seed=seed).verdict == ""


# ------------------------------------------------------------------------------------------ parameters


@pytest.mark.parametrize(
    ("parameters", "allowed"),
    [
        ({"clearance": 0.2}, "above the body's radius"),
        ({"clearance": -1.0}, "above the body's radius"),
        ({"turn": "up"}, "'left', 'right'"),
        ({"leave_rule": "back"}, "'front', 'any'"),
    ],
)
@pytest.mark.parametrize("policy", ["alg1", "alg2", "rev1", "rev2"])
def test_bad_parameters_are_refused(policy: str, parameters: dict[str, Any], allowed: str) -> None:
    with pytest.raises(ValueError, match=allowed):
        make_policy(policy, "slab", **parameters)


def test_an_unknown_variant_of_rev2_is_refused() -> None:
    with pytest.raises(ValueError, match="'s001', 'noborio'"):
        make_policy("rev2", "slab", variant="s002")
