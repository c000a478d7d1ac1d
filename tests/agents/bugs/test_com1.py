"""Com1, Class1 and Bug0+ against closed forms, the ring, the map of Oni and Wang, and their rules in words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from episodes import (
    CLOSED_FORM_SENSORS,
    OTHER,
    RING_ROUND_THE_START,
    Disc,
    Ring,
    Slab,
    UTrap,
    canonical_world,
    goal_distances,
    run_episode,
    tolerance,
)
from test_bug0 import BUG0_ROUTES

from bug_gym.agents import make_policy
from bug_gym.config import load

SLAB, DISC, TRAP = Slab(), Disc(), UTrap()
STEP = 0.1
CLOSER = ["com1", "class1"]
"""Those that leave only nearer to the goal."""
ALL = [*CLOSER, "bug0_plus"]

CASES = [
    ("slab", SLAB.until_free),
    ("disc", lambda turn: DISC.until_free()),
    ("u_trap", lambda turn: TRAP.until_free()),
]


def explicit(
    polygons: list[Any], start: list[float], goal: list[float], *, bounds: tuple[float, ...] = (-35, -35, 35, 35)
) -> dict[str, Any]:
    """A scenario with these polygons and the sensors of the closed forms."""
    world = {"family": "explicit", "bounds": list(bounds), "polygons": polygons, "start": start, "goal": goal}
    return {"lidar": {"beams": 360, "range": 10.0}, "time": {"limit": 600.0}, "world": world}


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("angle", [0.0, 0.83])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("world", "length"), CASES, ids=lambda case: case if isinstance(case, str) else "")
@pytest.mark.parametrize("policy", ALL)
def test_the_way_has_the_length_of_its_closed_form(
    policy: str, world: str, length: Any, turn: str, angle: float, mirrored: bool
) -> None:
    scenario = canonical_world(world, angle=angle, mirrored=mirrored)
    episode = run_episode(policy, scenario, turn=turn, clearance=0.5)
    expected = length(OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("policy", CLOSER)
def test_behind_a_high_slab_it_leaves_on_the_circle_through_the_hit_point(policy: str) -> None:
    high = Slab(left=12.0)
    scenario = explicit([[[8, -3], [12, -3], [12, 12], [8, 12]]], [0, 0, 0], [20, 0])
    episode = run_episode(policy, scenario, turn="left", clearance=0.5)
    hit_distance, behind = high.distance - high.x1 + high.c, high.distance - high.x2 - high.c
    height = math.sqrt(hit_distance**2 - behind**2)
    round_the_top = 2.0 * high.left + math.pi * high.c + high.x2 - high.x1
    expected = high.x1 - high.c + round_the_top - height + hit_distance
    assert height < high.left  # below the corner, where the way to the goal is free already
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


def test_class1_passes_by_a_free_way_where_it_has_been_nearer_before_and_com1_takes_it() -> None:
    # A wall with an arm toward the goal; on the arm's end a wall leans back, and its tip is further than the arm's end.
    wall = [[8, -10], [9, -10], [9, 5], [8, 5]]
    arm = [[8, 4], [16.2, 4], [16.2, 5], [8, 5]]
    leaning = [[16, 4.5], [16.2, 5], [14.2, 9], [13.8, 9], [15.8, 4.5]]
    scenario = explicit([wall, arm, leaning], [0, 0, 0], [20, 0])
    episodes = {policy: run_episode(policy, scenario, turn="left", clearance=0.5) for policy in CLOSER}
    before, at = {}, {}
    for policy, episode in episodes.items():
        assert episode.outcome == "success"
        left = episode.modes.index("motion_to_goal", episode.modes.index("boundary_following"))
        distances = goal_distances(episode)
        before[policy], at[policy] = distances[:left].min(), distances[left]
    assert at["com1"] > before["com1"] + 1.0
    assert at["class1"] < before["class1"]


@pytest.mark.parametrize(("early_stop", "laps"), [(False, 2), (True, 1)])
def test_bug0_plus_asks_for_a_second_lap_unless_it_may_stop_early(early_stop: bool, laps: int) -> None:
    episode = run_episode("bug0_plus", "ring", CLOSED_FORM_SENSORS, clearance=0.5, early_stop=early_stop)
    expected = Ring().first + laps * Ring().lap
    assert episode.verdict == "unreachable"
    assert expected - 0.3 <= episode.length <= 1.03 * expected


def test_bug0_plus_shut_in_itself_ends_as_unreachable_where_bug0_loops() -> None:
    sensors = {**CLOSED_FORM_SENSORS, "world": RING_ROUND_THE_START}
    assert run_episode("bug0", "ring", sensors, clearance=0.5).verdict == "looping"
    assert run_episode("bug0_plus", "ring", sensors, clearance=0.5).verdict == "unreachable"


def leaning_plate(foot: tuple[float, float], angle: float) -> list[list[float]]:
    """A plate of 2.5 m that stands on a wall along +x, at an angle to it [rad]."""
    cos, sin = math.cos(angle), math.sin(angle)
    corners = np.array([[-0.2, 0.0], [2.5, 0.0], [2.5, 0.4], [-0.2, 0.4]])
    turned: list[list[float]] = (corners @ np.array([[cos, sin], [-sin, cos]]) + foot).tolist()
    return turned


ROOM = [[[6, -4], [14, -4], [14, -3], [6, -3]], [[6, 3], [14, 3], [14, 4], [6, 4]]]
ROOM += [[[6, -4], [7, -4], [7, 4], [6, 4]], [[13, -4], [14, -4], [14, 4], [13, 4]]]
"""Four walls about [7, 13] x [-3, 3]."""


@pytest.mark.parametrize("opening", [20.0, 35.0, 50.0])
@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(
    ("start", "goal", "foot"),
    [
        ((0, 1), (10, 1), (7, 4)),
        ((9.03, 1), (20, 1), (7, -3)),
        ((11, -2.2), (4, -3.5), (8, -3)),
        ((3, -1), (10, 1), (7, 4)),
    ],
    ids=["outside", "inside", "inside, hit in the wedge", "outside, from below"],
)
@pytest.mark.parametrize("policy", ["bug1", "bug2", *CLOSER])
def test_a_lap_that_leads_into_a_narrow_wedge_is_closed_all_the_same(
    policy: str,
    start: tuple[float, float],
    goal: tuple[float, float],
    foot: tuple[float, float],
    turn: str,
    opening: float,
) -> None:
    """In the wedge's end the robot turns by nearly half a turn, which must not count as one to the other side."""
    polygons = [*ROOM, leaning_plate(foot, math.radians(opening))]
    heading = math.atan2(goal[1] - start[1], goal[0] - start[0])
    episode = run_episode(policy, explicit(polygons, [*start, heading], [*goal]), turn=turn, clearance=0.5)
    solid = shapely.union_all([shapely.Polygon(polygon) for polygon in polygons]).buffer(0.5)
    free = shapely.get_parts(shapely.box(-35, -35, 35, 35).difference(solid))
    (ring,) = [part for part in free if part.contains(shapely.Point(start))]
    contour = ring.interiors[0] if ring.interiors else ring.exterior
    assert episode.verdict == "unreachable"
    lap = episode.length - episode.memory.hit_odometers[-1]
    assert contour.length - 0.5 <= lap <= 1.03 * contour.length + 0.2


@pytest.mark.parametrize(
    ("start", "goal", "turn", "opening"),
    [
        ((11.0, -2.2), (4, -3.5), "right", 16.0),
        ((12.06, 0.0), (4, -4), "right", 8.0),
        ((11.0, -2.2), (4, -3.5), "left", 34.0),
    ],
)
@pytest.mark.parametrize("policy", ["bug1", "bug2", *CLOSER])
def test_a_lap_that_begins_or_turns_in_the_end_of_a_wedge_is_closed(
    policy: str, start: tuple[float, float], goal: tuple[float, float], turn: str, opening: float
) -> None:
    """Here a gate next to the corner was never passed again, or a turn was taken for one to the other side."""
    polygons = [*ROOM, leaning_plate((8, -3), math.radians(opening))]
    heading = math.atan2(goal[1] - start[1], goal[0] - start[0])
    scenario = explicit(polygons, [*start, heading], [*goal])
    scenario["time"]["limit"] = 130.0
    assert run_episode(policy, scenario, turn=turn, clearance=0.5).verdict == "unreachable"


# Ideal lengths on the map of Oni and Wang at a clearance of 1 m, turning left, rounded contour. The record of Class1
# and the hit point of Com1 are the same thing there.
COM1_ROUTES = {"AB": 17.10, "AC": 128.98, "AD": 42.82, "BA": 130.68, "BC": 116.42, "BD": 31.68}
COM1_ROUTES |= {"CA": 138.74, "CB": 10.90, "CD": 60.09, "DA": 44.90, "DB": 57.24, "DC": 87.54}


@pytest.mark.parametrize("route", COM1_ROUTES)
@pytest.mark.parametrize("policy", CLOSER)
def test_the_routes_of_oni_and_wang(policy: str, route: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    episode = run_episode(policy, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0)
    expected = COM1_ROUTES[route]
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("route", BUG0_ROUTES)
def test_bug0_plus_arrives_on_the_routes_where_bug0_does_and_on_the_others(route: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    episode = run_episode("bug0_plus", "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0)
    expected = BUG0_ROUTES[route]
    assert episode.outcome == "success"
    if expected is not None:
        assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("route", ["AC", "BA", "BC", "CA", "CD", "DC"])
def test_bug0_plus_leaves_a_better_take_off_nearer_than_its_last_two_hit_points(route: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    episode = run_episode("bug0_plus", "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0)
    assert "wall_following_to_better_take_off" in episode.modes
    last_two = goal_distances(episode, episode.memory.hits)[-2:]
    (leave,) = goal_distances(episode, episode.memory.leaves)[-1:]
    assert leave < min(last_two)


def test_bug0_plus_that_follows_past_the_hit_point_before_the_last_makes_no_third() -> None:
    # From D its second wall leads it back to where it met the first; Bug0 goes on to its second hit point again.
    places = {"world.start": "D", "world.goal": "C"}
    episode = run_episode("bug0_plus", "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0)
    assert len(episode.memory.hits) == 2


def test_bug0_plus_forgets_its_hit_points_when_the_target_has_left() -> None:
    """Shut in, it stirs until the robot has gone round once, then leaves through the wall and goes 20 m away."""
    points = [[10.3, 0.2], [10.3, 0.5]] * 30 + [[35.0, 0.2]]
    motion = {"law": "waypoints", "points": points, "speed": 0.3, "stop": True}
    world: dict[str, Any] = {"family": "explicit", "bounds": [-5, -20, 40, 20], "polygons": ROOM, "start": [0, 0, 0]}
    world |= {"target": {"at": points[0], "motion": motion}}
    episode = run_episode("bug0_plus", {"world": world}, CLOSED_FORM_SENSORS, clearance=0.5)
    assert "wall_following_to_better_take_off" in episode.modes
    assert (episode.outcome, episode.verdict) == ("success", "")


def test_bug0_plus_gets_out_of_the_trap_in_which_bug0_that_leaves_in_any_direction_stays() -> None:
    episodes = {
        policy: run_episode(policy, canonical_world("u_trap"), clearance=0.5, leave_rule="any")
        for policy in ("bug0", "bug0_plus")
    }
    assert episodes["bug0"].verdict == "looping"
    assert episodes["bug0_plus"].outcome == "success"


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("policy", CLOSER)
def test_distances_to_the_goal_fall_from_hit_to_leave_to_hit(policy: str, kinematics: str, seed: int) -> None:
    overrides = {"robot.kinematics": kinematics, "world.obstacles": 60, "time.limit": 600.0}
    episode = run_episode(policy, "static", overrides, seed=seed)
    hits, leaves = goal_distances(episode, episode.memory.hits), goal_distances(episode, episode.memory.leaves)
    assert episode.outcome == "success"
    distances = [distance for pair in zip(hits, leaves, strict=True) for distance in pair]
    assert all(after < before for before, after in zip(distances, distances[1:], strict=False))


@pytest.mark.parametrize("policy", CLOSER)
def test_a_target_that_has_gone_further_away_is_measured_anew(policy: str) -> None:
    """It goes from 10 to 30 m: no place is nearer to it now than the hit point was to its old place."""
    motion = {"law": "waypoints", "points": [[18.0, 0.0], [34.0, 0.0]], "speed": 0.8, "stop": True}
    scenario = canonical_world("slab")
    del scenario["world"]["goal"]
    scenario["world"] |= {"target": {"at": [18.0, 0.0], "motion": motion}, "bounds": [-5, -20, 40, 20]}
    episode = run_episode(policy, scenario, clearance=0.5)
    assert (episode.outcome, episode.verdict) == ("success", "")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"leave_rule": "back"}, "'front', 'any'"),
        ({"turn": "up"}, "'left', 'right'"),
        ({"clearance": 0.1}, "above the body's radius"),
        ({"clearance": -1.0}, "above the body's radius"),
    ],
)
@pytest.mark.parametrize("policy", ALL)
def test_bad_parameters_are_refused_with_what_is_allowed(policy: str, parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_policy(policy, load("slab"), **parameters)
