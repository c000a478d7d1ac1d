"""Bug1 for two: it meets behind an obstacle, and goes on from the nearer nearest point; and what Com1-Rev3 saves."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import bug_gym
from bug_gym.agents import make_policy
from bug_gym.policy import MisfitError
from bug_gym.reproductions.com1_rev3 import MEETING, allowed
from bug_gym.reproductions.cylinder_claims import mission
from bug_gym.reproductions.team_runs import run_team
from bug_gym.reproductions.team_worlds import Across, obstacles_across, random_world, team_scenario
from bug_gym.simulation import Simulation

SIZES = obstacles_across(9)
GHOSTS: dict[str, dict[str, Any]] = {
    "com1_rev3": {"partner_rule": "ghost", "hold_distance": 0.0},
    "bug1_pair": {},
}


def both_ways(policy: str, one: Across) -> float:
    run = run_team(policy, one.scenario(), ghosts=True, clearance=one.clearance, **GHOSTS[policy])
    assert "success" in run.outcomes
    return float(run.lengths.sum())


# ------------------------------------------------------------------------------------------ closed forms


def test_the_closed_forms_are_the_worked_numbers() -> None:
    # A slab 4 m deep from 5 m to the left to 3 m to the right of the way, 8 m from the start and 8 m from the goal, at
    # a clearance of 0.5 m: 1 m off the axis.
    slab = Across(before=7.5, behind=7.5, half=4.5, depth=5.0, offset=-1.0, clearance=0.5)
    assert slab.com1_rev3() == pytest.approx(39.518, abs=1e-3)
    assert slab.bug1_pair() == pytest.approx(53.642, abs=5e-4)
    # On a disc of radius 1 the pair that meets takes so much more.
    for behind, more in ((0.5, 1.064), (1.0, 1.362), (2.0, 1.633), (5.0, 1.891)):
        disc = Across(before=3.0, behind=behind, half=1.0)
        assert disc.bug1_pair() - disc.com1_rev3() == pytest.approx(more, abs=5e-4)


@pytest.mark.parametrize("one", SIZES, ids=lambda one: "disc" if one.is_disc else f"rectangle {one.offset:.1f}")
def test_both_ways_together_are_as_long_as_the_formulas_say(one: Across) -> None:
    pair, base = both_ways("com1_rev3", one), both_ways("bug1_pair", one)
    assert pair == pytest.approx(one.com1_rev3(), abs=allowed(one.com1_rev3()))
    # The two stop before they touch, and the one behind does not come as far as the one that leads.
    least = one.bug1_pair() - 2.0 * MEETING - allowed(one.bug1_pair())
    assert least <= base <= one.bug1_pair() + allowed(one.bug1_pair())
    assert pair < base


def test_on_a_disc_the_difference_is_not_always_a_quarter_of_the_circumference() -> None:
    near = Across(before=4.0, behind=1.0, half=3.0)
    assert 0.0 < near.bug1_pair() - near.com1_rev3() < 0.25 * near.perimeter
    assert 0.0 < both_ways("bug1_pair", near) - both_ways("com1_rev3", near) < 0.25 * near.perimeter
    far = Across(before=4.0, behind=9.0, half=3.0)
    assert far.bug1_pair() - far.com1_rev3() > 0.25 * far.perimeter


# ------------------------------------------------------------------------------------------ the meeting


def test_each_walks_half_the_perimeter_and_the_finder_goes_on_alone() -> None:
    one = Across(before=5.0, behind=4.0, half=4.0, depth=4.0, offset=1.5)
    run = run_team("bug1_pair", one.scenario(), ghosts=True, clearance=1.0)
    assert [memory.meetings for memory in run.memories] == [1, 1]
    met = next(step for step, modes in enumerate(run.modes) if "return_to_closest" in modes)
    walked = np.hypot(*np.diff(run.paths[: met + 1, :, :2], axis=0).transpose(2, 0, 1)).sum(axis=0)
    half = one.before + 0.5 * one.perimeter
    assert walked == pytest.approx([half, half], abs=0.5 * MEETING + allowed(half))
    # The nearer nearest point lies straight behind the obstacle; who has passed it leads back to it.
    winner = run.winner
    assert winner is not None and run.memories[1 - winner].is_behind
    left = run.memories[winner].own.leaves[-1]
    assert left[0] == pytest.approx(one.before + one.depth, abs=0.2) and left[1] == pytest.approx(0.0, abs=0.2)
    # So does the partner, also where it has to go on with the hand on the wall.
    follower = run.memories[1 - winner]
    assert math.dist(follower.frame.to_team(follower.own.closest.place), run.memories[winner].frame.to_team(left)) < 0.2


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("bearing", [-2.5, -1.9, 1.0, 1.4, 1.8, 2.2])
def test_robots_that_meet_at_a_corner_have_met(bearing: float, kinematics: str) -> None:
    """Their directions of travel lie at a right angle there: each took the other for an obstacle, and the two left together,
    the hand of each on the other's body."""
    box = [[[4.0, -1.5], [5.5, -1.5], [5.5, 1.0], [4.0, 1.0]]]
    beside = (2.0 * math.cos(bearing), 2.0 * math.sin(bearing), 0.0)
    scenario = team_scenario(box, [(0.0, 0.0, 0.0), beside], (9.0, 0.5), limit=100.0)
    scenario["robot"]["kinematics"] = kinematics
    run = run_team("bug1_pair", scenario)
    assert "success" in run.outcomes and run.least_gap > 0.5
    perimeter = 8.0 + 2.0 * math.pi * 0.35
    assert run.lengths.max() < 12.0 + 1.5 * perimeter


def test_robots_on_either_side_of_a_thin_wall_do_not_meet_through_it() -> None:
    # Two ways along a wall of 0.2 m, hands on it, in opposite directions: the wall is between them.
    wall = [[[6, -8], [6.2, -8], [6.2, 8], [6, 8]]]
    scenario = team_scenario(wall, [(4.0, -1.0, 0.0), (4.0, 1.0, 0.0)], (12.0, 0.0))
    run = run_team("bug1_pair", scenario, clearance=0.5)
    assert run.outcomes.count("success") == 1 and run.memories[0].meetings == 1
    met = next(step for step, modes in enumerate(run.modes) if "return_to_closest" in modes)
    assert (run.paths[met, :, 0] > 6.2).all(), "they meet behind it"


@pytest.mark.parametrize(("aside", "laps", "meetings"), [(0.6, 0.5, 1), (1.0, 1.0, 2)])
def test_two_halves_that_begin_at_one_place_prove_that_there_is_no_way(
    aside: float, laps: float, meetings: int
) -> None:
    """Where the hit points lie too far apart both turn round, and the halves that begin there prove it."""
    world = {"family": "ring", "bounds": [-5, -10, 20, 10], "start": [0, 0, 0], "goal": [10.3, 0.2], "centre": [10, 0]}
    starts = [{"start": [0.0, -aside, 0.0]}, {"start": [0.0, aside, 0.0]}]
    settings = {"mission": "first", "lidar": {"beams": 360, "range": 10.0}, "time": {"limit": 600.0}}
    run = run_team("bug1_pair", {**settings, "world": world, "robots": starts}, clearance=0.5)
    assert run.verdicts == ("unreachable", "unreachable")
    assert [memory.meetings for memory in run.memories] == [meetings] * 2
    perimeter = 4.0 * 8.0 + 2.0 * math.pi * 0.5
    assert run.lengths == pytest.approx([5.5 + laps * perimeter] * 2, abs=1.5)


def walls_with_a_door(kinematics: str, door: float) -> dict[str, Any]:
    """A room with a wall across, in which a door lies between the places where two robots meet it."""
    walls = [[[side * 0.5 * door, 2], [side * 4.5, 2], [side * 4.5, 2.3], [side * 0.5 * door, 2.3]] for side in (-1, 1)]
    world = {"family": "explicit", "bounds": [-4, -3, 4, 12], "polygons": walls, "start": [0, 0, 1.5708]}
    robot = {"kinematics": kinematics}
    rest = {"robots": {"count": 2}, "mission": "first", "time": {"limit": 300.0}}
    return {"robot": robot, "world": world | {"goal": [0, 11]}, **rest}


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("door", [1.0, 1.4])
def test_a_door_between_the_two_hit_points_is_found(kinematics: str, door: float) -> None:
    run = run_team("bug1_pair", walls_with_a_door(kinematics, door))
    assert "success" in run.outcomes and run.verdicts == ("", "")


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_wall_without_a_door_is_no_way(kinematics: str) -> None:
    run = run_team("bug1_pair", walls_with_a_door(kinematics, 0.0))
    assert run.verdicts == ("unreachable", "unreachable")


@pytest.mark.parametrize("seed", [5046, 5054])
def test_where_a_robot_alone_arrives_a_pair_does_not_say_that_there_is_no_way(seed: int) -> None:
    overrides = {"robots.count": 2, "mission": "first", "time.limit": 600.0}
    run = run_team("bug1_pair", "cellular_automaton", overrides, seed=seed)
    assert "success" in run.outcomes


@pytest.mark.parametrize(
    ("robot", "seed"), [("holonomic", 1492), ("jackal", 963), ("jackal", 1056), ("jackal", 1087), ("jackal", 1805)]
)
def test_a_pair_among_thin_cylinders_ends_as_the_world_says(robot: str, seed: int) -> None:
    """A nearest point in a niche, with the partner before it (1492, 963, 1087); a gap in which a partner stands, whose body
    is in sight of one that is about to go round it (1056, 1805)."""
    answer = mission("bug1_pair", robot, seed)
    assert (answer.outcome, answer.verdict) == (("success", "") if answer.has_way else ("gave_up", "unreachable"))


@pytest.mark.parametrize(("robot", "seed"), [("holonomic", 91), ("jackal", 19), ("jackal", 647)])
def test_two_that_follow_one_another_round_a_wall_come_to_an_end(robot: str, seed: int) -> None:
    """Who goes round its partner proves nothing: two that had got past one another did so for ever, one behind the other."""
    answer = mission("bug1_pair", robot, seed)
    assert not answer.has_way and answer.outcome == "gave_up"


def test_who_goes_round_its_partner_for_the_ninth_time_goes_in_circles() -> None:
    """At places a metre apart, none of which is the same; a new goal is a new way."""
    team: Any = make_policy("bug1_pair", Simulation(walls_with_a_door("holonomic", 1.0), 1))
    memory = team.start(2)[0]
    places = [SimpleNamespace(position=(float(x), 0.0), goal_position=(20.0, 0.0)) for x in range(9)]
    assert [team.begin_detour(0, view, memory) for view in places] == 8 * [True] + [False]
    assert memory.own.verdict == "looping"
    fresh = team.start(2)[0]
    assert all(team.begin_detour(0, view, fresh) for view in places[:8])
    elsewhere: Any = SimpleNamespace(position=(8.0, 0.0), goal_position=(20.0, 5.0))
    assert team.begin_detour(0, elsewhere, fresh) and fresh.own.verdict == ""


def test_who_is_shut_in_by_a_partner_that_has_given_up_does_not_say_that_there_is_no_way() -> None:
    scenario = walls_with_a_door("holonomic", 0.9)
    scenario["robots"] = [{"start": [0.0, 0.0, 1.5708]}, {"start": [0.0, 2.15, 1.5708]}]
    scenario["world"] |= {
        "bounds": [-4, -3, 4, 30],
        "goal": [0, 29],
    }  # out of sight: else the second one would be sent there
    simulation = Simulation(scenario, 1)
    team: Any = make_policy("bug1_pair", simulation)
    seen, state = simulation.reset(seeds=[0])[0], None
    for _ in range(3000):
        actions, state = team.predict(seen, state)
        state[1].own.verdict = "looping"
        if state[0].verdict:
            break
        seen = simulation.step(actions[None]).observation[0]
    assert state is not None and [memory.verdict for memory in state] == ["looping", "looping"]


def test_where_the_goal_is_not_seen_yet_the_second_follows_two_metres_behind() -> None:
    walls = [[[x, -3], [x + 1, -3], [x + 1, 3], [x, 3]] for x in (5, 14)]
    scenario = team_scenario(walls, [(0.0, -1.0, 0.0), (0.0, 1.0, 0.0)], (22.0, 0.0))
    run = run_team("bug1_pair", scenario, clearance=1.0)
    assert run.outcomes.count("success") == 1
    assert [memory.meetings for memory in run.memories] == [2, 2], "behind each of the two obstacles"
    assert any("hold" in modes for modes in run.modes)
    assert run.least_gap >= 0.5


@pytest.mark.parametrize("seed", range(10))
def test_the_two_never_touch_and_never_stand_for_ever(seed: int) -> None:
    run = run_team("bug1_pair", random_world(seed), seed=seed, clearance=1.0)
    assert "success" in run.outcomes and "collision" not in run.outcomes
    assert run.least_gap >= 0.5


def test_it_drives_two_robots_and_no_others() -> None:
    for source in ("static", random_world(0, 4)):
        with pytest.raises(MisfitError, match=r"drives 2 robots, the scenario has [14]"):
            make_policy("bug1_pair", source)


def test_a_partner_that_answers_every_other_step_is_not_driven_into() -> None:
    env = bug_gym.parallel_env("oni_wang_pair")
    team: Any = make_policy("bug1_pair", env)
    seen, _ = env.reset(seed=0)
    state, outcomes = None, set()
    for step in itertools.count():
        told = {agent: seen[agent] for agent in env.agents if agent == "robot_0" or step % 2 == 0}
        actions, state = team.predict(told, state)
        still = np.zeros(2, np.float32)
        seen, _, _, _, infos = env.step({agent: actions.get(agent, still) for agent in env.agents})
        outcomes |= {info["outcome"] for info in infos.values()}
        if not env.agents:
            break
    assert "success" in outcomes and "collision" not in outcomes
