"""Rev2 as Oni and Wang tell it and Rev3, their improvement of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from episodes import (
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

from bug_gym.agents import make_policy
from bug_gym.agents.bugs.rev3 import Rev3Memory
from bug_gym.simulation import Simulation
from bug_gym.view import View

SLAB, DISC, TRAP = Slab(), Disc(), UTrap()
BETTER = "follow_wall_to_better_take_off"
LENGTHS: dict[str, Callable[[str], float]] = {
    "slab": SLAB.until_free,
    "disc": lambda turn: DISC.until_free(),
    "u_trap": lambda turn: TRAP.until_free(),
}


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(("angle", "mirrored"), [(0.0, False), (0.83, False), (0.83, True)])
@pytest.mark.parametrize("world", LENGTHS)
@pytest.mark.parametrize("policy", ["rev2", "rev3"])
def test_the_way_has_the_length_of_its_closed_form(
    policy: str, world: str, angle: float, mirrored: bool, turn: str
) -> None:
    episode = run_episode(policy, canonical_world(world, angle=angle, mirrored=mirrored), turn=turn, clearance=0.5)
    expected = LENGTHS[world](OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


# ------------------------------------------------------------------------------------------ no way


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(
    ("policy", "parameters", "laps"),
    [("rev2", {}, 1), ("rev3", {}, 2), ("rev3", {"guard": True, "mspdg": "all"}, 2), ("rev3", {"early_stop": True}, 1)],
)
def test_a_goal_shut_in_is_unreachable_after_so_many_laps(
    policy: str, parameters: dict[str, Any], laps: int, turn: str
) -> None:
    episode = run_episode(policy, "ring", CLOSED_FORM_SENSORS, clearance=0.5, turn=turn, **parameters)
    expected = Ring().first + laps * Ring().lap
    assert episode.verdict == "unreachable"
    assert expected - 0.3 * laps <= episode.length <= 1.03 * expected


@pytest.mark.parametrize(("policy", "verdict"), [("rev2", "looping"), ("rev3", "unreachable")])
def test_shut_in_itself_rev2_cycles_and_rev3_finds_out(policy: str, verdict: str) -> None:
    episode = run_episode(policy, "ring", {**CLOSED_FORM_SENSORS, "world": RING_ROUND_THE_START}, clearance=0.5)
    assert episode.verdict == verdict


# A room whose wall reaches back behind an obstacle: the way out of it leads past the hook at its end, where the robot
# heads for the goal again and hits that obstacle, further from the goal than its last hit point on the wall.
ROOM = [[1.5, -5.5], [16, -5.5], [16, -5], [2, -5], [2, 5], [15.5, 5], [15.5, 2], [16, 2], [16, 5.5], [1.5, 5.5]]
HOOK_WORLD = {
    "lidar": {"beams": 360, "range": 10.0},
    "time": {"limit": 900.0},
    "world": {
        "family": "explicit",
        "bounds": [-10, -15, 30, 15],
        "polygons": [ROOM],
        "circles": [[9, 2.7, 1.0]],
        "start": [13, 3.9, 0],
        "goal": [0, 0],
    },
}


@pytest.mark.parametrize("mspdg", ["two", "all"])
def test_a_hit_point_elsewhere_nearer_to_the_goal_is_no_proof_that_there_is_no_way(mspdg: str) -> None:
    episode = run_episode("rev3", HOOK_WORLD, clearance=0.5, mspdg=mspdg)
    goal_distances = np.hypot(*episode.path[:, :2].T)
    assert BETTER in episode.modes, "it meets a saved hit point"
    begin = episode.modes.index(BETTER)
    end = begin + next(k for k, mode in enumerate(episode.modes[begin:]) if mode != BETTER)
    assert goal_distances[begin:end].min() > goal_distances[:begin].min(), "nothing there is as near as the wall was"
    assert episode.outcome == "success"


class Decision(NamedTuple):
    """What Rev3 keeps after a decision."""

    memory: Rev3Memory
    """Only read it before the next one: it changes."""
    view: View
    """What it has seen."""
    is_free: bool
    """Whether it is at a wall with a free way to the goal."""


def decisions(scenario: Any, overrides: dict[str, Any], seed: int = 0, **parameters: Any) -> Iterator[Decision]:
    """The decisions of Rev3 until the episode ends, or it gives a verdict."""
    simulation = Simulation(scenario, 1, overrides=overrides)
    agent: Any = make_policy("rev3", simulation, **parameters)
    observation, state = simulation.reset(seeds=[seed]), None
    while True:
        action, state = agent.predict(observation[:, 0], state)
        memory, view = state[0], View(observation[0, 0], agent.sensors)
        is_free = memory.contour is not None and agent.boundary.is_free(
            view, view.goal_bearing, view.goal_distance, memory.contour
        )
        yield Decision(memory, view, is_free)
        step = simulation.step(action[:, None])
        if memory.verdict or (step.terminated | step.truncated).any():
            return
        observation = step.observation


def test_a_lap_without_a_better_take_off_lowers_the_demand_to_the_nearest_place_with_a_free_way() -> None:
    nearest, was_lowered = math.inf, False
    for memory, view, is_free in decisions(HOOK_WORLD, {}, clearance=0.5):
        distance = view.goal_distance
        if was_lowered and memory.contour is None:
            break
        was_lowered = memory.is_searching and memory.is_lowered
        if memory.is_searching and is_free and not was_lowered:
            nearest = min(nearest, distance)
    assert was_lowered and memory.contour is None
    # Two steps are what "nearer" has to be, one it may have gone since.
    assert nearest < distance <= nearest + 0.3


def test_taken_literally_it_calls_that_goal_unreachable_which_can_be_reached() -> None:
    episode = run_episode("rev3", HOOK_WORLD, clearance=0.5, literal=True)
    assert (episode.outcome, episode.verdict) == ("running", "unreachable")


# ------------------------------------------------------------------------------------------ the map of Oni and Wang

# Ideal lengths at a clearance of 1 m, turning left first, rounded contour.
ROUTES = {"AB": 17.10, "AC": 28.38, "AD": 139.25, "BA": 56.37, "BC": 96.66, "BD": 31.68}
ROUTES |= {"CA": 28.09, "CB": 10.90, "CD": 109.79, "DA": 44.90, "DB": 57.24, "DC": 68.52}
REV2_FAILS = ("AD", "CD")


def oni_wang(policy: str, route: str, **parameters: Any) -> Episode:
    """A route of the map at its clearance."""
    places = {"world.start": route[0], "world.goal": route[1]}
    return run_episode(policy, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0, **parameters)


@pytest.mark.parametrize("route", ROUTES)
def test_the_routes_of_rev2(route: str) -> None:
    episode = oni_wang("rev2", route)
    if route in REV2_FAILS:
        assert episode.verdict == "looping"
        return
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(ROUTES[route], abs=tolerance(ROUTES[route]))


@pytest.mark.parametrize("parameters", [{}, {"mspdg": "all", "early_stop": True}, {"guard": True}], ids=str)
@pytest.mark.parametrize("route", ROUTES)
def test_the_routes_of_rev3(route: str, parameters: dict[str, Any]) -> None:
    episode = oni_wang("rev3", route, **parameters)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(ROUTES[route], abs=tolerance(ROUTES[route]))
    assert BETTER in episode.modes or route not in REV2_FAILS


def test_from_a_to_d_rev3_meets_the_hit_point_before_the_last_and_leaves_the_outer_wall_nearer_to_the_goal() -> None:
    episode = oni_wang("rev3", "AD")
    memory = episode.memory
    m, s, q, t = (4.0, 0.0), (12.0, 3.75), (21.0, -1.5), (21.0, 3.0)
    assert memory.hit_sides == [1, -1, 1, -1]
    for place, expected in zip(memory.hits, (m, s, q, t), strict=True):
        assert math.dist(place, expected) <= 0.3
    # As near to D (27, 0) as q is, on the outer side of the wall.
    expected = (24.0, -math.sqrt(math.dist(memory.hits[2], (27.0, 0.0)) ** 2 - 3.0**2))
    assert math.dist(memory.leaves[-1], expected) <= 0.3
    assert math.dist(memory.leaves[-1], (27.0, 0.0)) < min(math.dist(place, (27.0, 0.0)) for place in (q, t))


# ------------------------------------------------------------------------------------------ longer cycles

MAZE = {"robot.kinematics": "holonomic", "lidar.beams": 180, "time.limit": 4000.0}
CYCLES = (5, 9, 17)
"""Mazes where the paper's robot goes round four or more hit points."""


@pytest.mark.parametrize("seed", CYCLES)
def test_a_cycle_over_more_than_two_hit_points_ends_as_looping(seed: int) -> None:
    episode = run_episode("rev3", "maze", MAZE, seed=seed)
    assert episode.verdict == "looping"
    # The last two hit points, with their sides, come in this order for the third time.
    hits = np.column_stack([episode.memory.hits, episode.memory.hit_sides])
    pairs = np.hstack([hits[:-1], hits[1:]])
    assert np.sum(np.abs(pairs - pairs[-1]).max(axis=1) < 0.5) == 3


def test_hit_points_before_one_nearer_than_all_belong_to_no_cycle() -> None:
    """In this maze a pair comes the third time, but has been left nearer to the goal than all hit points in between."""
    assert run_episode("rev3", "maze", MAZE, seed=26, mspdg="all").outcome == "success"


@pytest.mark.parametrize("seed", CYCLES)
def test_the_guard_ends_such_cycles(seed: int) -> None:
    assert run_episode("rev3", "maze", MAZE, seed=seed, guard=True).outcome == "success"


@pytest.mark.parametrize("seed", CYCLES)
def test_a_better_take_off_is_nearer_than_the_last_two_hit_points_or_than_all(seed: int) -> None:
    nearer_than_all: dict[str, list[bool]] = {"two": [], "all": []}
    for saved, found in nearer_than_all.items():
        was_searching, leaves = False, 0
        hits: list[tuple[float, float]] = []
        for memory, view, _ in decisions("maze", MAZE, seed, mspdg=saved):
            if len(memory.leaves) > leaves and was_searching:
                of_hits = [math.dist(hit, view.goal_position) for hit in hits]
                assert view.goal_distance < min(of_hits[-2:])
                found.append(view.goal_distance < min(of_hits))
            leaves, hits = len(memory.leaves), memory.hits[:]
            was_searching = memory.is_searching and not memory.is_lowered
    assert nearer_than_all["all"] and all(nearer_than_all["all"])
    assert not all(nearer_than_all["two"])


def test_the_guard_minds_a_hit_point_met_again_with_the_same_side_only() -> None:
    """In this maze it meets an early hit point again with the other side: it goes on as the paper's robot does."""
    is_met_otherwise, hits = False, 0
    for memory, _, _ in decisions("maze", MAZE, 3, guard=True):
        if len(memory.hits) > hits:
            hits = len(memory.hits)
            *earlier, (here, side) = zip(memory.hits, memory.hit_sides, strict=True)
            met = [other for place, other in earlier[:-2] if math.dist(place, here) <= 0.1]
            if met and side not in met and math.dist(here, memory.hits[-2]) > 1.0 < math.dist(here, memory.hits[-3]):
                is_met_otherwise = True
                assert not memory.is_searching
    assert is_met_otherwise


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(4))
def test_with_its_guard_rev3_arrives_in_mazes_without_touching_anything(seed: int, kinematics: str) -> None:
    episode = run_episode("rev3", "maze", {**MAZE, "robot.kinematics": kinematics}, seed=seed, guard=True)
    assert episode.outcome == "success"
    assert episode.min_clearance > 0.0
    assert episode.memory.hit_sides == [(-1) ** k for k in range(len(episode.memory.hits))]


@pytest.mark.parametrize("policy", ["rev2", "rev3"])
def test_a_target_that_moves_is_never_called_unreachable(policy: str) -> None:
    for seed in range(4):
        assert run_episode(policy, "moving_target", seed=seed).verdict != "unreachable"


@pytest.mark.parametrize(
    ("parameters", "allowed"),
    [
        ({"clearance": 0.2}, "above the body's radius"),
        ({"turn": "up"}, "'left', 'right'"),
        ({"leave_rule": "back"}, "'front', 'any'"),
        ({"mspdg": "three"}, "'two', 'all'"),
    ],
)
def test_bad_parameters_are_refused(parameters: dict[str, Any], allowed: str) -> None:
    with pytest.raises(ValueError, match=allowed):
        make_policy("rev3", "slab", **parameters)
