"""TangentBug and its local tangent graph: optimal round convex obstacles, complete everywhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from episodes import (
    CLOSED_FORM_SENSORS,
    RING_ROUND_THE_START,
    Disc,
    Ring,
    Slab,
    UTrap,
    canonical_world,
    goal_distances,
    run_episode,
    slab_and_target_that_leaves,
    tolerance,
)

from bug_gym.agents import make_policy
from bug_gym.agents.walls.tangent_graph import TangentGraph
from bug_gym.config import load
from bug_gym.observation import width
from bug_gym.shortest_path import reachable, shortest_path
from bug_gym.view import Sensors, View

SHORTEST = {
    "slab": min(Slab().shortest("left"), Slab().shortest("right")),
    "disc": Disc().shortest(),
    "u_trap": UTrap().shortest(),
}
ROUTES = [a + b for a in "ABCD" for b in "ABCD" if a != b]
FAR = {"lidar": {"beams": 360, "range": 60.0}, "time": {"limit": 600.0}}


def seen_from_afar(world: str, **changes: Any) -> dict[str, Any]:
    """A canonical world, seen whole from everywhere; its border is out of sight."""
    scenario = canonical_world(world, **changes)
    return {**scenario, **FAR, "world": {**scenario["world"], "bounds": [-90, -90, 90, 90]}}


# ------------------------------------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("angle", [0.0, 0.83])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("world", SHORTEST)
def test_with_unlimited_sight_the_way_is_the_shortest(world: str, turn: str, angle: float, mirrored: bool) -> None:
    scenario = seen_from_afar(world, angle=angle, mirrored=mirrored)
    episode = run_episode("tangent_bug", scenario, turn=turn, clearance=0.5)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(SHORTEST[world], abs=tolerance(SHORTEST[world]))


@pytest.mark.parametrize("r_max", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("world", SHORTEST)
def test_with_short_sight_the_way_is_longer_but_leads_there(world: str, r_max: float) -> None:
    episode = run_episode("tangent_bug", canonical_world(world), clearance=0.5, r_max=r_max)
    assert episode.outcome == "success"
    assert 0.99 * SHORTEST[world] <= episode.full_length <= 2.0 * SHORTEST[world]


@pytest.mark.parametrize(("leave_rule", "is_taken"), [("any", True), ("front", False)])
def test_the_rule_front_passes_by_a_place_nearer_to_the_goal_that_lies_behind(leave_rule: str, is_taken: bool) -> None:
    """From A to B of the paper's map it leaves the wall backwards once, seeing 5 m."""
    places = {"world.start": "A", "world.goal": "B"}
    settings = {**CLOSED_FORM_SENSORS, **places}
    episode = run_episode("tangent_bug", "oni_wang", settings, clearance=1.0, r_max=5.0, leave_rule=leave_rule)
    assert episode.outcome == "success"
    steps = np.diff(episode.path[:, :2], axis=0)
    leaving = [k for k in range(1, len(episode.modes)) if episode.modes[k] == "leaving" != episode.modes[k - 1]]
    backwards = [bool(steps[k] @ steps[k - 1] < 0.0) for k in leaving if k < len(steps)]
    assert any(backwards) == is_taken


def test_a_target_that_has_gone_further_away_is_measured_anew() -> None:
    episode = run_episode("tangent_bug", slab_and_target_that_leaves(), clearance=0.5, r_max=1.0)
    assert (episode.outcome, episode.verdict) == ("success", "")
    # Round by the longer half of the slab at most, and no lap.
    assert episode.length <= 34.0 + 0.5 * Slab().perimeter


@pytest.mark.parametrize("turn", ["left", "right"])
def test_equal_ways_round_a_disc_are_decided_by_the_turn(turn: str) -> None:
    episode = run_episode("tangent_bug", seen_from_afar("disc"), turn=turn, clearance=0.5)
    y = episode.path[:, 1]
    assert (y.max() > 3.0) == (turn == "left") and (y.min() < -3.0) == (turn == "right")


# ------------------------------------------------------------------------------------------------- no way, and mazes


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("range_", [2.0, 5.0, 60.0])
def test_a_goal_shut_in_is_unreachable_within_a_lap_and_a_quarter(range_: float, turn: str) -> None:
    settings = {**CLOSED_FORM_SENSORS, "lidar.range": range_, "world.bounds": [-70, -70, 90, 70]}
    episode = run_episode("tangent_bug", "ring", settings, clearance=0.5, turn=turn)
    assert episode.verdict == "unreachable"
    assert Ring().lap <= episode.length <= 1.25 * (5.5 + Ring().lap)


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("range_", [2.0, 5.0, 60.0])
def test_shut_in_itself_it_says_so_within_a_lap_and_a_quarter(range_: float, turn: str) -> None:
    settings = {**CLOSED_FORM_SENSORS, "lidar.range": range_, "world": RING_ROUND_THE_START}
    episode = run_episode("tangent_bug", "ring", settings, clearance=0.5, turn=turn)
    assert episode.verdict == "unreachable"
    assert Ring().lap_inside <= episode.length <= 1.25 * (Ring().first_inside + Ring().lap_inside)


@pytest.mark.parametrize("range_", [2.0, 5.0, 50.0])
@pytest.mark.parametrize("route", ROUTES)
def test_all_routes_of_oni_and_wang_are_found(route: str, range_: float) -> None:
    settings = {**CLOSED_FORM_SENSORS, "lidar.range": range_, "world.start": route[0], "world.goal": route[1]}
    episode = run_episode("tangent_bug", "oni_wang", settings, clearance=1.0)
    assert episode.outcome == "success"
    layout = episode.simulation.world.layout(0)
    obstacles = (layout.circles, layout.polygons, layout.border)
    shortest = shortest_path(*obstacles, episode.path[0, :2], layout.goals[0], radius=0.85)
    assert episode.full_length >= shortest.length


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("beams", [64, 180])
@pytest.mark.parametrize("seed", range(4))
def test_random_worlds_are_solved(kinematics: str, beams: int, seed: int) -> None:
    settings = {"robot.kinematics": kinematics, "world.obstacles": 60, "lidar.beams": beams, "time.limit": 600.0}
    assert run_episode("tangent_bug", "static", settings, seed=seed).outcome == "success"


HARD: dict[str, tuple[str, int, dict[str, Any]]] = {
    # Walls across a passage were taken for one obstacle, and d_followed from the one that was not followed.
    "two walls taken for one": ("maze", 21, {"world.loops": 0.3, "lidar.beams": 180}),
    "two walls taken for one, far from both": ("maze", 59, {"world.loops": 0.3, "lidar.beams": 180}),
    # The end of the wall to follow was hidden by another one, which was followed instead.
    "the end of the wall is hidden": ("maze", 179, {"world.loops": 0.3, "lidar.beams": 180}),
    # As the robot turned, other beams met other walls, and it turned to and fro between two nodes.
    "nodes that come and go with the heading": ("maze", 4, {"world.loops": 0.3, "lidar.beams": 180}),
    "few beams that come and go with the heading": ("static", 0, {"world.obstacles": 60, "lidar.beams": 64}),
    # The way to where it left for passed a corner so closely that noise put the corner into it.
    "a corner beside the way": ("maze", 56, {"robot.kinematics": "holonomic", "lidar.beams": 180}),
}


@pytest.mark.parametrize("case", HARD)
def test_worlds_that_have_defeated_it_are_solved(case: str) -> None:
    scenario, seed, settings = HARD[case]
    episode = run_episode("tangent_bug", scenario, {**settings, "time.limit": 2000.0}, seed=seed)
    assert episode.outcome == "success"


def cell(seed: int) -> dict[str, Any]:
    """A turned square room of four walls, with one wall missing in every third world, start or goal in it; discs about."""
    rng = np.random.default_rng(seed)
    angle, half, thick = rng.uniform(0.0, 6.28), rng.uniform(1.3, 2.2), 0.3
    outer = half + thick
    boxes = [(-outer, half, outer, outer), (-outer, -outer, outer, -half), (half, -outer, outer, outer)]
    boxes += [] if seed % 3 == 0 else [(-outer, -outer, -half, outer)]
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    walls = [(np.array([[a, b], [c, b], [c, d], [a, d]]) @ turn).tolist() for a, b, c, d in boxes]
    places = rng.uniform(-9.0, 9.0, (40, 2))
    clear = np.hypot(*places.T) > 5.5
    outside, discs = places[clear][0], places[clear][1:9]
    discs = discs[np.hypot(*(discs - outside).T) > 1.5]
    world = {"family": "explicit", "bounds": [-11, -11, 11, 11], "polygons": walls}
    world["circles"] = [[x, y, 0.6] for x, y in discs.tolist()]
    start, goal = (outside.tolist(), [0.1, 0.0]) if seed % 2 else ([0.1, 0.0], outside.tolist())
    return {"world": {**world, "start": [*start, 1.0], "goal": goal}, "time": {"limit": 600.0}}


@pytest.mark.parametrize("seed", range(9))
def test_its_verdict_is_that_of_the_map(seed: int) -> None:
    scenario = cell(seed)
    scenario["lidar"] = {"noise": 0.01}
    episode = run_episode("tangent_bug", scenario, seed=seed)
    layout = episode.simulation.world.layout(0)
    ends = episode.path[0, :2], layout.goals[0]
    answers = {reachable(layout.circles, layout.polygons, layout.border, *ends, radius=r) for r in (0.24, 0.31)}
    if len(answers) == 1:  # a gap between two radii and two clearances may count either way
        assert (episode.outcome == "success") == answers.pop()
    assert episode.outcome == "success" or episode.verdict == "unreachable"


# ----------------------------------------------------------------------------------------------------- its own rules


@pytest.mark.parametrize("seed", range(5))
def test_motion_to_goal_brings_it_nearer_in_every_step(seed: int) -> None:
    settings = {"robot.kinematics": "holonomic", "world.obstacles": 60, "lidar.noise": 0.0, "lidar.beams": 180}
    episode = run_episode("tangent_bug", "static", settings, seed=seed)
    falls = -np.diff(goal_distances(episode))
    going = np.array([mode == "motion_to_goal" for mode in episode.modes[: len(falls)]])
    assert going.any() and (falls[going] > 0.0).all()


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(4))
def test_distances_to_the_goal_fall_from_hit_to_leave_to_hit(kinematics: str, seed: int) -> None:
    settings = {"robot.kinematics": kinematics, "world.loops": 0.3, "lidar.beams": 180, "time.limit": 600.0}
    memory = run_episode("tangent_bug", "maze", settings, seed=seed).memory
    hits, leaves = ([math.dist(place, memory.target) for place in places] for places in (memory.hits, memory.leaves))
    assert len(hits) - len(leaves) in (0, 1) and hits
    distances = [distance for pair in zip(hits, leaves, strict=False) for distance in pair]
    assert all(after <= before for before, after in pairwise(distances))
    assert all(after < before for before, after in pairwise(hits))


def test_looking_no_farther_than_r_max_is_having_a_lidar_of_that_range() -> None:
    settings = {**CLOSED_FORM_SENSORS, "lidar.range": 10.0}
    short = run_episode("tangent_bug", "u_trap", {**settings, "lidar.range": 4.0}, clearance=0.5)
    long = run_episode("tangent_bug", "u_trap", settings, clearance=0.5, r_max=4.0)
    assert long.length == pytest.approx(short.length, rel=1e-3)


def test_leaving_to_the_front_only_still_arrives() -> None:
    settings = {"world.loops": 0.3, "lidar.beams": 180, "time.limit": 600.0}
    assert run_episode("tangent_bug", "maze", settings, seed=3, leave_rule="front").outcome == "success"


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"r_max": 0.1}, "above the clearance of 0.3 m, got 0.1"),
        ({"leave_rule": "back"}, "'front', 'any'"),
        ({"turn": "up"}, "'left', 'right'"),
        ({"clearance": 0.1}, "above the body's radius"),
    ],
)
def test_bad_parameters_are_refused_with_what_is_allowed(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_policy("tangent_bug", load("slab"), **parameters)


# ------------------------------------------------------------------------------------------ the local tangent graph

RADIUS = 0.4


def graph_of(segments: Sequence[tuple[float, float, float, float]], *, beams: int = 360) -> TangentGraph:
    """The graph of walls x1, y1, x2, y2 seen from the origin, with the goal 8 m ahead."""
    sensors = Sensors.of(load({"lidar": {"beams": beams, "range": 10.0}, "world": {"family": "empty"}}))
    flat = np.zeros(width(sensors.fields), dtype=np.float32)
    flat[:beams] = 10.0
    for number, angle in enumerate(sensors.angles):
        cos, sin = math.cos(angle), math.sin(angle)
        for x1, y1, x2, y2 in segments:
            # t along the beam and s along the wall, of their intersection
            ex, ey = x2 - x1, y2 - y1
            cross = cos * ey - sin * ex
            if cross != 0.0:
                t, s = (x1 * ey - y1 * ex) / cross, (x1 * sin - y1 * cos) / cross
                if t > 0.0 and 0.0 <= s <= 1.0:
                    flat[number] = min(flat[number], t)
    flat[beams : beams + 2] = 8.0, 0.0
    return TangentGraph(View(flat, sensors), RADIUS)


def test_each_end_of_a_wall_is_passed_along_the_tangent_of_its_last_point() -> None:
    graph = graph_of([(4.0, -2.0, 4.0, 3.0)])
    for side in (1, -1):
        node = graph.end(graph.blocking_run, side)
        assert node is not None
        x, y = node.contact
        away = math.hypot(x, y)
        assert x == pytest.approx(4.0, abs=1e-5) and abs(y - (3.0 if side > 0 else -2.0)) < 0.1
        assert node.bearing == pytest.approx(math.atan2(y, x) + side * math.asin(RADIUS / away))
        assert node.distance == pytest.approx(math.sqrt(away**2 - RADIUS**2))
        assert math.dist(node.place, node.contact) == pytest.approx(RADIUS)


@pytest.mark.parametrize(("gap", "runs"), [(0.6, 1), (1.2, 2)])
def test_a_gap_parts_a_wall_where_the_disc_passes(gap: float, runs: int) -> None:
    graph = graph_of([(3.0, -3.0, 3.0, -0.5 * gap), (3.0, 0.5 * gap, 3.0, 3.0)])
    assert len(set(graph.run_of[graph.run_of >= 0].tolist())) == runs


def test_a_wall_that_the_beams_meet_at_a_small_angle_hangs_together() -> None:
    """Along a wall 0.5 m beside the robot the last points lie over 2 m apart."""
    graph = graph_of([(-9.0, -0.5, 9.0, -0.5)])
    assert set(graph.run_of[graph.run_of >= 0].tolist()) == {graph.run_at((0.0, -0.5))}


def test_what_stands_behind_the_end_of_a_wall_is_not_that_wall() -> None:
    """The wall's last points and the plate's first are nearly in line, but the wall would be met 3 m behind the plate."""
    graph = graph_of([(1.0, -0.45, 7.0, -0.45), (9.4, -0.4, 9.4, 2.0)], beams=180)
    assert graph.run_at((3.0, -0.45)) != graph.run_at((9.4, 1.0))


@pytest.mark.parametrize("range_", [25.0, 60.0])
def test_a_border_in_sight_does_not_lengthen_a_wall(range_: float) -> None:
    """The robot was sent round the whole obstacle, whose far end seemed to lie on the border."""
    overrides = {"world.bounds": [-3, -14, 31, 13], "world.start": "A", "world.goal": "D", "lidar.range": range_}
    episode = run_episode("tangent_bug", "oni_wang", {**overrides, "lidar.beams": 360})
    layout = episode.simulation.world.layout(0)
    way = shortest_path(layout.circles, layout.polygons, layout.border, (0.0, 0.0), layout.goals[0], radius=0.2)
    assert way.length <= episode.full_length <= 1.05 * way.length


def test_an_end_behind_something_nearer_is_the_way_past_that() -> None:
    """The far wall goes on behind a near plate on the left; the disc passes the plate on its right."""
    graph = graph_of([(7.0, -1.0, 7.0, 4.0), (3.0, 1.0, 3.0, 2.0)])
    node = graph.end(graph.blocking_run, 1)
    assert node is not None
    x, y = node.contact
    assert (x, y) == pytest.approx((3.0, 1.0), abs=0.06)
    assert node.bearing == pytest.approx(math.atan2(y, x) - math.asin(RADIUS / math.hypot(x, y)))


def test_walls_all_round_have_no_end_and_nothing_in_sight_no_run() -> None:
    room = graph_of([(3.0, -3.0, 3.0, 3.0), (3.0, 3.0, -3.0, 3.0), (-3.0, 3.0, -3.0, -3.0), (-3.0, -3.0, 3.0, -3.0)])
    assert room.end(room.blocking_run, 1) is None and room.end(room.blocking_run, -1) is None
    empty = graph_of([])
    assert empty.blocking_run == -1 and empty.run_at((1.0, 0.0)) == -1 and empty.nearest_of(-1) is None


def test_distances_to_the_goal_are_those_of_a_plain_search() -> None:
    graph = graph_of([(4.0, -2.0, 4.0, 3.0), (-2.0, -3.0, 2.0, -3.0)])
    run = graph.blocking_run
    assert graph.goal_distance_of(run) == pytest.approx(math.dist((4.0, 0.0), graph.goal), abs=0.02)
    nearest = math.inf
    for bearing, free, other in zip(graph.bearings, graph.free, graph.run_of, strict=True):
        if other != run:
            ways = np.linspace(0.0, min(free, 5.0), 400)
            nearest = min(nearest, np.hypot(ways * np.cos(bearing) - 8.0, ways * np.sin(bearing)).min())
    distance, place = graph.nearest_to_goal(without=run, limit=5.0)
    assert distance == pytest.approx(nearest, abs=0.02)
    assert math.dist(place, graph.goal) == pytest.approx(distance)
    assert math.hypot(*place) <= 5.0 + 1e-9


@pytest.mark.parametrize("beams", [90, 360])
def test_free_ways_are_those_of_the_scan_and_each_run_is_one_stretch_of_headings(beams: int) -> None:
    graph = graph_of([(2.0, -1.0, 2.0, 0.5), (5.0, 0.0, 5.0, 6.0), (-4.0, -4.0, -1.0, -4.0)], beams=beams)
    for bearing, free in zip(graph.bearings, graph.free, strict=True):
        along = graph.x * math.cos(bearing) + graph.y * math.sin(bearing)
        lateral = graph.y * math.cos(bearing) - graph.x * math.sin(bearing)
        near = (along > 0.0) & (np.abs(lateral) < RADIUS)
        expected = min([10.0, *(along[near] - np.sqrt(RADIUS**2 - lateral[near] ** 2)).tolist()])
        assert free == pytest.approx(max(expected, 0.0), abs=1e-9)
    for run in set(graph.run_of.tolist()) - {-1}:
        inside = graph.run_of == run
        assert np.count_nonzero(inside & ~np.roll(inside, 1)) == 1
