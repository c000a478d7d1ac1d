"""Bug1 against closed forms, the ring, the map of Oni and Wang, and its rule in words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from episodes import (
    CLOSED_FORM_SENSORS,
    OTHER,
    Disc,
    Slab,
    UTrap,
    canonical_world,
    goal_distances,
    in_world,
    run_episode,
    tolerance,
)

from bug_gym.agents import make_policy
from bug_gym.config import load

SLAB, DISC, TRAP = Slab(), Disc(), UTrap()
STEP = 0.1

CASES = [
    ("slab", "shortest", lambda turn: SLAB.full_lap(turn, same_way=False)),
    ("slab", "same", lambda turn: SLAB.full_lap(turn, same_way=True)),
    ("disc", "shortest", lambda turn: DISC.full_lap()),
    ("u_trap", "shortest", lambda turn: TRAP.full_lap()),
]


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("angle", [0.0, 0.83])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("world", "rule", "length"), CASES, ids=lambda case: case if isinstance(case, str) else "")
def test_the_way_has_the_length_of_its_closed_form(
    world: str, rule: str, length: Any, turn: str, angle: float, mirrored: bool
) -> None:
    scenario = canonical_world(world, angle=angle, mirrored=mirrored)
    episode = run_episode("bug1", scenario, turn=turn, clearance=0.5, return_rule=rule)
    expected = length(OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("world", ["slab", "disc", "u_trap"])
def test_it_leaves_where_the_contour_is_nearest_to_the_goal(world: str, turn: str) -> None:
    episode = run_episode("bug1", canonical_world(world, angle=0.4), turn=turn, clearance=0.5)
    layout = episode.simulation.world.layout(0)
    shapes = [shapely.Polygon(rings[0]) for rings in layout.polygons]
    shapes += [shapely.Point(x, y).buffer(radius, quad_segs=64) for x, y, radius in layout.circles]
    distance = shapely.union_all(shapes).buffer(0.5, quad_segs=64).distance(shapely.Point(layout.goals[0]))
    (leave,) = in_world(episode, episode.memory.leaves)
    assert math.dist(leave, layout.goals[0]) == pytest.approx(distance, abs=STEP + 0.02 * distance)


def test_the_shorter_way_back_is_at_most_half_a_lap() -> None:
    for turn in ("left", "right"):
        episode = run_episode("bug1", canonical_world("slab"), turn=turn, clearance=0.5)
        assert episode.modes.count("return_to_closest") * STEP <= 0.5 * SLAB.perimeter + 3 * STEP


def test_the_same_way_back_goes_on_in_the_direction_of_the_lap() -> None:
    episode = run_episode("bug1", canonical_world("slab"), turn="left", clearance=0.5, return_rule="same")
    returning = np.flatnonzero(np.array(episode.modes) == "return_to_closest")
    assert episode.path[returning[0] + 10, 1] > episode.path[returning[0], 1] + 5 * STEP  # up, as on the lap


def triangle_of_walls(tip: float, length: float = 10.0, thickness: float = 0.4) -> list[list[list[float]]]:
    """Three walls about an isosceles triangle with an angle [rad] at the origin, which opens along +x."""
    cos, sin = math.cos(0.5 * tip), math.sin(0.5 * tip)
    corners = [(0.0, 0.0), (length * cos, -length * sin), (length * cos, length * sin)]
    ways = [shapely.LineString([corners[i], corners[i - 1]]) for i in range(3)]
    walls = [way.buffer(thickness, cap_style="square") for way in ways]
    return [[list(point) for point in wall.exterior.coords[:-1]] for wall in walls]


@pytest.mark.parametrize("goal", [[-4.0, 0.0], [0.7, 2.05], [0.7, -2.05]])
@pytest.mark.parametrize("turn", ["left", "right"])
def test_shut_in_before_an_acute_corner_it_gives_up(goal: list[float], turn: str) -> None:
    """The corner of the contour is nearest to the goal, which lies behind one wall there, but away from the other."""
    world = {"family": "explicit", "bounds": [-8, -8, 14, 8], "polygons": triangle_of_walls(math.radians(50))}
    world |= {"start": [7, 0, 0], "goal": goal}
    episode = run_episode("bug1", {"world": world}, CLOSED_FORM_SENSORS, turn=turn, clearance=0.5)
    assert episode.verdict == "unreachable"


# Ideal lengths on the map of Oni and Wang at a clearance of 1 m, turning left, rounded contour.
SAME_WAY = {"AB": 212.85, "AC": 204.71, "AD": 242.99, "BA": 271.99, "BC": 272.99, "BD": 172.71}
SAME_WAY |= {"CA": 222.99, "CB": 150.71, "CD": 200.85, "DA": 186.71, "DB": 252.99, "DC": 244.85}
SHORTER_WAY = {"AB": 212.85, "AC": 204.71, "AD": 186.71, "BA": 157.71, "BC": 150.71, "BD": 172.71}
SHORTER_WAY |= {"CA": 204.71, "CB": 150.71, "CD": 200.85, "DA": 186.71, "DB": 172.71, "DC": 180.85}


@pytest.mark.parametrize("route", SAME_WAY)
@pytest.mark.parametrize(("rule", "routes"), [("same", SAME_WAY), ("shortest", SHORTER_WAY)], ids=["same", "shortest"])
def test_the_routes_of_oni_and_wang(rule: str, routes: dict[str, float], route: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    episode = run_episode("bug1", "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0, return_rule=rule)
    expected = routes[route]
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(4))
def test_distances_to_the_goal_fall_from_hit_to_leave_to_hit(kinematics: str, seed: int) -> None:
    overrides = {"robot.kinematics": kinematics, "world.obstacles": 60, "time.limit": 600.0}
    episode = run_episode("bug1", "static", overrides, seed=seed)
    hits, leaves = goal_distances(episode, episode.memory.hits), goal_distances(episode, episode.memory.leaves)
    assert episode.outcome == "success"
    distances = [distance for pair in zip(hits, leaves, strict=True) for distance in pair]
    assert all(after < before + 1e-3 for before, after in zip(distances, distances[1:], strict=False))


def test_a_gap_as_wide_as_the_noise_leaves_it_is_no_dead_end() -> None:
    """Between two discs there, the nearest point of one stands a step before the other."""
    overrides = {"robot.kinematics": "holonomic", "lidar.beams": 180, "world.obstacles": 60, "time.limit": 600.0}
    assert run_episode("bug1", "static", overrides, seed=144).outcome == "success"


def test_something_that_came_into_the_way_back_is_waited_for_and_walked_round() -> None:
    # It is 2 m above the top of the slab while the lap passes there, and close to it when the way back does.
    ways = [[10.0, 9.5], [10.0, 6.0]]
    motion = {"law": "waypoints", "points": ways, "speed": 0.1, "stop": True}
    scenario = canonical_world("slab")
    scenario["world"] |= {"movers": [{"shape": {"circle": 0.4}, "at": ways[0], "motion": motion}]}
    episode = run_episode("bug1", scenario, turn="left", clearance=0.5, return_rule="same")
    assert episode.outcome == "success"
    assert "return_along_wall" in episode.modes and len(episode.memory.leaves) == 1


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"return_rule": "longest"}, "'shortest', 'same'"),
        ({"turn": "up"}, "'left', 'right'"),
        ({"clearance": 0.1}, "above the body's radius"),
        ({"clearance": -1.0}, "above the body's radius"),
    ],
)
def test_bad_parameters_are_refused_with_what_is_allowed(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_policy("bug1", load("slab"), **parameters)
