"""DistBug against closed forms, the ring, the map of Oni and Wang and what its STEP promises."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from episodes import (
    CLOSED_FORM_SENSORS,
    OTHER,
    Disc,
    Slab,
    UTrap,
    canonical_world,
    goal_distances,
    run_episode,
    slab_and_target_that_leaves,
    tolerance,
)

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.simulation import Simulation
from bug_gym.view import View

SLAB, DISC, TRAP = Slab(), Disc(), UTrap()
CASES = [
    ("slab", SLAB.until_free),
    ("disc", lambda turn: DISC.until_free()),
    ("u_trap", lambda turn: TRAP.until_free()),
]
ROUTES = [a + b for a in "ABCD" for b in "ABCD" if a != b]


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("angle", [0.0, 0.83])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("world", "length"), CASES, ids=lambda case: case if isinstance(case, str) else "")
def test_the_way_has_the_length_of_its_closed_form(
    world: str, length: Any, turn: str, angle: float, mirrored: bool
) -> None:
    scenario = canonical_world(world, angle=angle, mirrored=mirrored)
    episode = run_episode("dist_bug", scenario, turn=turn, clearance=0.5)
    expected = length(OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("leave_rule", ["any", "front"])
@pytest.mark.parametrize("r_max", [0.5, 2.0, None])
def test_where_the_goal_comes_into_sight_first_neither_range_nor_rule_matter(
    leave_rule: str, r_max: float | None
) -> None:
    episode = run_episode("dist_bug", "u_trap", CLOSED_FORM_SENSORS, clearance=0.5, leave_rule=leave_rule, r_max=r_max)
    assert episode.full_length == pytest.approx(TRAP.until_free(), abs=tolerance(TRAP.until_free()))


@pytest.mark.parametrize("range_", [2.0, 5.0])
@pytest.mark.parametrize("route", ROUTES)
def test_all_routes_of_oni_and_wang_are_found(route: str, range_: float) -> None:
    settings = {**CLOSED_FORM_SENSORS, "lidar.range": range_, "world.start": route[0], "world.goal": route[1]}
    episode = run_episode("dist_bug", "oni_wang", settings, clearance=1.0)
    assert episode.outcome == "success"
    assert episode.min_clearance >= 1.0 - 0.15 - 0.2  # of the body, within 5 % of the clearance and one step


@pytest.mark.parametrize("step", [0.25, 0.5, 1.5])
def test_each_hit_is_nearer_to_the_goal_than_the_one_before_by_step(step: float) -> None:
    """From A to C with long sight it leaves the far wall several times for a place a little nearer on the next."""
    places = {"world.start": "A", "world.goal": "C", "lidar.range": 50.0}
    episode = run_episode("dist_bug", "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0, step=step)
    distances = [math.dist(hit, episode.memory.target) for hit in episode.memory.hits]
    assert episode.outcome == "success" and len(distances) >= 2
    assert all(after <= before - step + 0.1 for before, after in pairwise(distances))
    assert len(distances) <= distances[0] / step


def leaning_plate(angle: float) -> dict[str, Any]:
    """A plate across the way whose upper end leans toward the start by so much, away from it below 0 [rad]."""
    cos, sin = math.cos(angle), math.sin(angle)
    corners = [(-0.5, -3.0), (0.5, -3.0), (0.5, 3.0), (-0.5, 3.0)]
    plate = [[8.0 + cos * x - sin * y, sin * x + cos * y] for x, y in corners]
    world = {"family": "explicit", "bounds": [-5, -10, 25, 10], "start": [0, 0, 0], "goal": [16, 0]}
    return {"world": {**world, "polygons": [plate]}}


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(("angle", "side"), [(0.5, -1), (-0.5, 1)])
@pytest.mark.parametrize("rule", [{}, {"side_rule": "goal"}], ids=["by default", "told"])
def test_the_side_rule_goal_takes_the_way_that_turns_less(
    rule: dict[str, Any], angle: float, side: int, turn: str
) -> None:
    """Kamon and Rivlin's choice, the better one: toward the start leans the upper end, so down, to the right."""
    episode = run_episode("dist_bug", leaning_plate(angle), turn=turn, **rule)
    assert episode.outcome == "success"
    assert episode.memory.hit_sides[0] == side


@pytest.mark.parametrize(("turn", "side"), [("left", 1), ("right", -1)])
@pytest.mark.parametrize("angle", [0.5, -0.5])
def test_the_side_rule_fixed_takes_that_of_the_turn_wherever_the_wall_leads(angle: float, turn: str, side: int) -> None:
    episode = run_episode("dist_bug", leaning_plate(angle), turn=turn, side_rule="fixed")
    assert episode.outcome == "success"
    assert episode.memory.hit_sides[0] == side


def test_without_a_place_step_nearer_it_leaves_from_the_nearest_point_after_a_lap() -> None:
    """Two plates, sight of 0.6 m and a STEP that nothing fulfils: each costs one lap and a half, as with Bug1."""
    plates = [[[x, -2], [x + 1, -2], [x + 1, 2], [x, 2]] for x in (5, 9)]
    world = {"family": "explicit", "bounds": [-9, -9, 19, 9], "start": [0, 0, 0], "goal": [14, 0], "polygons": plates}
    scenario = {"lidar": {"beams": 360}, "time": {"limit": 200.0}, "world": world}
    episode = run_episode("dist_bug", scenario, clearance=0.5, step=50.0, r_max=0.6)
    lap = 2.0 * (1.0 + 4.0) + 2.0 * math.pi * 0.5
    expected = 4.5 + 1.5 * lap + 2.0 + 1.5 * lap + 3.5
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("turn", ["left", "right"])
def test_a_goal_in_sight_is_gone_to_whatever_the_step(turn: str) -> None:
    episode = run_episode("dist_bug", canonical_world("slab"), turn=turn, clearance=0.5, step=50.0)
    expected = SLAB.until_free(turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_leave_is_measured_by_the_nearest_that_the_boundary_has_come_and_not_by_the_hit_point(mirrored: bool) -> None:
    """A wall with an arm toward the goal; from the arm's end another leans back, whose tip is as near as the hit point."""
    wall: list[list[float]] = [[8, -10], [9, -10], [9, 5], [8, 5]]
    arm: list[list[float]] = [[8, 4], [16.2, 4], [16.2, 5], [8, 5]]
    leaning: list[list[float]] = [[16, 4.5], [16.2, 5], [14.2, 9], [13.8, 9], [15.8, 4.5]]
    sign = -1 if mirrored else 1
    polygons = [[[x, sign * y] for x, y in polygon] for polygon in (wall, arm, leaning)]
    world = {"family": "explicit", "bounds": [-35, -35, 35, 35], "polygons": polygons}
    scenario = {
        "lidar": {"beams": 360},
        "time": {"limit": 200.0},
        "world": {**world, "start": [0, 0, 0], "goal": [20, 0]},
    }
    step, r_max, turn = 0.5, 1.5, "right" if mirrored else "left"
    episode = run_episode("dist_bug", scenario, clearance=0.5, turn=turn, step=step, r_max=r_max)
    assert episode.outcome == "success"
    distances = goal_distances(episode)
    at = episode.modes.index("boundary_following")
    left = episode.modes.index("motion_to_goal", at)
    nearest = distances[at : left + 1].min()
    assert distances[at : left + 1].max() > nearest + r_max + 1.0, "it comes by the tip"
    # The way that it sees is no longer than r_max.
    assert distances[left] - r_max <= nearest - step


def test_a_target_that_has_gone_further_away_is_measured_anew() -> None:
    episode = run_episode("dist_bug", slab_and_target_that_leaves(), clearance=0.5, r_max=2.0)
    assert (episode.outcome, episode.verdict) == ("success", "")
    # Round by the left half of the slab, and no lap.
    assert episode.length <= 34.0 + 0.5 * SLAB.perimeter


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(4))
def test_random_worlds_are_solved(kinematics: str, seed: int) -> None:
    settings = {"robot.kinematics": kinematics, "world.obstacles": 60, "lidar.beams": 180, "time.limit": 600.0}
    episode = run_episode("dist_bug", "static", settings, seed=seed)
    assert episode.outcome == "success"


@pytest.mark.parametrize("seed", [6, 17, 32, 82])
def test_a_robot_that_swerves_into_what_it_saw_a_way_past_still_arrives(seed: int) -> None:
    """In these mazes a differential robot leaves in a curve, and meets a wall before the scan said so."""
    settings = {"world.loops": 0.3, "lidar.beams": 180, "time.limit": 600.0}
    assert run_episode("dist_bug", "maze", settings, seed=seed).outcome == "success"


def test_a_scan_that_promised_too_much_is_believed_half_as_far_until_a_hit_is_nearer_than_all_before() -> None:
    simulation = Simulation(canonical_world("slab"))
    policy: Any = make_policy("dist_bug", simulation, r_max=8.0)
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    here, step = view.goal_distance, policy.boundary.step

    def trust_after_hit(promised: float) -> float:
        """How far the scan is believed after a hit here, where the next wall was seen so far from the goal [m]."""
        memory.promised = promised
        policy._hit(view, memory)
        return float(memory.trust)

    assert [trust_after_hit(promised) for promised in (math.inf, here - 3.0 * step)] == [math.inf, 4.0]
    assert [trust_after_hit(promised) for promised in (here - step, here - 3.0 * step)] == [4.0, 2.0]
    memory.best = here + 1.0
    assert trust_after_hit(here) == math.inf


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"side_rule": "best"}, "'fixed', 'goal'"),
        ({"step": 0.0}, "above 0 m, got 0.0"),
        ({"step": math.nan}, "above 0 m, got nan"),
        ({"r_max": -1.0}, "above 0 m, got -1.0"),
        ({"leave_rule": "back"}, "'front', 'any'"),
    ],
)
def test_bad_parameters_are_refused_with_what_is_allowed(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_policy("dist_bug", load("slab"), **parameters)
