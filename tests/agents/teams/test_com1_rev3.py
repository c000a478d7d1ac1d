"""Com1-Rev3: the worked facts on the paper's map, who makes room for whom, and when the mission ends."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import Ring, run_episode, tolerance
from numpy.typing import NDArray

import bug_gym
from bug_gym import log
from bug_gym.agents import make_policy
from bug_gym.agents.bugs.com1 import Com1
from bug_gym.agents.bugs.rev3 import Rev3
from bug_gym.agents.teams.com1_rev3 import Com1Rev3
from bug_gym.agents.teams.partners import SeeThrough
from bug_gym.config import ONI_WANG_PLACES, ONI_WANG_POLYGON, dump, load
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.policy import MisfitError
from bug_gym.reproductions import cylinder_claims
from bug_gym.reproductions.team_runs import TeamRun, run_team
from bug_gym.reproductions.team_worlds import Across, alone, random_world, team_scenario
from bug_gym.simulation import Simulation

# A robot that sees the goal from each place from which an ideal one does.
PAPER = {"lidar.beams": 360, "lidar.range": 15.0, "time.limit": 600.0}

# Winner, its way when it is named, where the other stops, the winner's total and the sum of both, on the rounded contour
# at 1 m; both start at one place, turn left first and have no bodies to one another.
FACTS: dict[str, tuple[int, float, tuple[float, float], float, float]] = {
    "AC": (1, 24.93, (13.52, 9.00), 28.38, 53.31),
    "AD": (0, 36.22, (21.00, 2.75), 42.82, 79.05),
    "BA": (1, 50.04, (15.00, 0.96), 56.38, 106.41),
    "BC": (1, 93.21, (7.79, -8.00), 96.66, 189.87),
    "CA": (1, 21.75, (9.65, -8.00), 28.08, 49.83),
    "CD": (0, 54.09, (7.00, -1.62), 60.09, 114.17),
    "DC": (1, 65.07, (7.79, -8.00), 68.52, 133.59),
}
# Both ways are the same: way when the first is named, its total, and the sum.
TIES = {
    "AB": (11.52, 17.10, 28.62),
    "BD": (22.78, 31.68, 54.46),
    "CB": (7.46, 10.90, 18.36),
    "DA": (33.78, 44.90, 78.68),
    "DB": (51.66, 57.24, 108.91),
}


def on_the_map(route: str, *, angle: float = 0.0, mirrored: bool = False, **parameters: Any) -> TeamRun:
    """Two robots without bodies on a route of the paper's map, which may be mirrored, then turned and shifted."""
    overrides: dict[str, Any] = {**PAPER, "world.start": route[0], "world.goal": route[1]}
    if angle or mirrored:
        start, goal = (moved(ONI_WANG_PLACES[letter], angle, mirrored) for letter in route)
        heading = math.atan2(goal[1] - start[1], goal[0] - start[0])
        polygon = [moved(corner, angle, mirrored) for corner in ONI_WANG_POLYGON]
        world = {"family": "explicit", "bounds": [-60, -60, 60, 60], "polygons": [polygon]}
        overrides = {**PAPER, "world": {**world, "start": [*start, heading], "goal": start and goal}}
    sides = "right" if mirrored else "left"
    settings = {"clearance": 1.0, "sides": sides, "partner_rule": "ghost", "hold_distance": 0.0, **parameters}
    return run_team("com1_rev3", "oni_wang" if "world.start" in overrides else {}, overrides, ghosts=True, **settings)


def moved(place: tuple[float, float], angle: float, mirrored: bool) -> list[float]:
    x, y = place[0], -place[1] if mirrored else place[1]
    shift = (3.7, -2.9)
    return [math.cos(angle) * x - math.sin(angle) * y + shift[0], math.sin(angle) * x + math.cos(angle) * y + shift[1]]


VARIANTS = [(0.0, False), (0.83, False), (-2.2, True)]


@pytest.mark.parametrize(("angle", "mirrored"), VARIANTS)
@pytest.mark.parametrize("route", FACTS)
def test_the_worked_facts_of_the_papers_map(route: str, angle: float, mirrored: bool) -> None:
    winner, won_after, place, total, both = FACTS[route]
    run = on_the_map(route, angle=angle, mirrored=mirrored)
    assert run.winner == winner and run.outcomes[winner] == "success"
    assert run.won_after == pytest.approx(won_after, abs=tolerance(won_after))
    assert run.lengths[winner] == pytest.approx(total, abs=tolerance(total))
    assert run.lengths.sum() == pytest.approx(both, abs=tolerance(both))
    stopped = run.paths[-1, 1 - winner, :2]
    expected = moved(place, angle, mirrored) if angle or mirrored else place
    assert math.dist(stopped, expected) <= tolerance(won_after)


@pytest.mark.parametrize("route", TIES)
def test_equal_ways_go_to_the_first_robot(route: str) -> None:
    won_after, total, both = TIES[route]
    run = on_the_map(route)
    assert run.winner == 0
    np.testing.assert_array_equal(run.paths[: run.named_at + 1, 0], run.paths[: run.named_at + 1, 1])
    assert run.won_after == pytest.approx(won_after, abs=tolerance(won_after))
    assert run.lengths[0] == pytest.approx(total, abs=tolerance(total))
    assert run.lengths.sum() == pytest.approx(both, abs=tolerance(both))


@pytest.mark.parametrize("route", [*FACTS, *TIES])
def test_with_hold_the_winners_stay_and_ties_go_to_com1(route: str) -> None:
    run = on_the_map(route, hold_distance=1.5)
    winner, total = (FACTS[route][0], FACTS[route][3]) if route in FACTS else (0, TIES[route][1])
    assert run.winner == winner
    assert run.lengths[winner] == pytest.approx(total, abs=tolerance(total))
    assert run.memories[1].holds >= 1 and run.memories[0].holds == 0
    # 2 m at the start, and at the next corner until they are 2 m apart again: 2.83 m on square corners.
    assert run.memories[1].held == pytest.approx(2.83, abs=0.3)


def test_with_hold_com1_wins_later_from_a_to_d() -> None:
    run = on_the_map("AD", hold_distance=1.5)
    later = 37.87 - 37.31  # than without, on square corners
    expected = FACTS["AD"][1] + later
    assert run.won_after == pytest.approx(expected, abs=tolerance(expected))
    assert math.dist(run.paths[-1, 1, :2], (21.0, 0.46)) <= tolerance(expected)


# ------------------------------------------------------------------------------------------ the stop rule


@pytest.mark.parametrize(("radius", "beams"), [(2.5, 240), (5.0, 60), (5.0, 1440), (12.0, 240)])
def test_on_a_disc_a_winner_is_named_at_the_tangent_however_large_the_disc(radius: float, beams: int) -> None:
    # What a disc of 5 cm more would need to pass is free sqrt(2 m R) after the tangent only: 1 m late at R = 12 m.
    disc = Across(before=4.0, behind=5.0, half=radius)
    scenario = {**disc.scenario(), "lidar": {"beams": beams, "range": 20.0}}
    settings: dict[str, Any] = {"clearance": 1.0, "partner_rule": "ghost", "hold_distance": 0.0}
    run = run_team("com1_rev3", scenario, ghosts=True, **settings)
    tangent, leg = disc.leaving()
    assert run.winner == 0
    assert run.won_after == pytest.approx(tangent, abs=0.15)  # a step, and half the gap between the points of a scan
    assert run.lengths[0] == pytest.approx(tangent + leg, abs=0.03)
    assert run.lengths[1] == pytest.approx(run.won_after)


@pytest.mark.parametrize("seed", range(4))
def test_from_the_stop_on_one_robot_moves_and_it_is_the_nearer_one(seed: int) -> None:
    run = run_team("com1_rev3", random_world(seed), seed=seed, clearance=1.0)
    winner = run.winner
    assert winner is not None and run.outcomes[winner] == "success"
    goal = run.simulation.world.layout(0).goals[0]
    named = run.paths[run.named_at, :, :2]
    distances = np.hypot(*(named - goal).T)
    assert distances[winner] == distances.min()
    moved_after = np.hypot(*(run.paths[-1, :, :2] - named).T)
    assert (moved_after > 1e-9).tolist() == [robot == winner for robot in range(2)]
    assert all(modes[1 - winner] == "stopped" for modes in run.modes[run.named_at :])


def test_where_both_see_the_goal_at_once_the_nearer_one_goes_alone() -> None:
    scenario = team_scenario([], [(0.0, 0.0, 0.0), (1.0, 4.0, 0.0)], (8.0, 1.0))
    run = run_team("com1_rev3", scenario, clearance=1.0)
    assert run.winner == 1 and run.named_at == 0 and run.lengths[0] == 0.0
    assert run.lengths[1] == pytest.approx(math.hypot(7.0, 3.0), abs=0.1)


def test_a_winner_that_falls_silent_on_its_way_wins_no_longer() -> None:
    scenario = team_scenario([], [(0.0, 0.0, 0.0), (1.0, 4.0, 0.0)], (8.0, 1.0))
    env = bug_gym.parallel_env({**scenario, "mission": "all"})
    policy: Any = make_policy("com1_rev3", env)
    seen, _ = env.reset(seed=0)
    actions, state = policy.predict(seen)
    assert state[0].winner == 1 and np.abs(actions["robot_0"]).max() == 0.0
    actions, state = policy.predict({"robot_0": seen["robot_0"]}, state)
    assert state[0].winner == 0 and np.abs(actions["robot_0"]).max() > 0.5


def test_a_winner_whose_way_turns_out_to_be_blocked_wins_no_longer() -> None:
    """A disc comes to stand in its way, and beside the other's."""
    scenario = team_scenario([], [(0.0, 0.0, 0.0), (1.0, 4.0, 0.0)], (8.0, 1.0))
    motion = {"law": "waypoints", "points": [[5.0, 9.0], [5.0, 2.3]], "speed": 3.0, "stop": True}
    scenario["world"]["movers"] = [{"shape": {"circle": 0.6}, "at": [5.0, 9.0], "motion": motion}]
    run = run_team("com1_rev3", scenario, clearance=0.5)
    assert run.winner == 1 and "success" in run.outcomes
    modes = [one for one, _ in run.modes], [other for _, other in run.modes]
    blocked = modes[1].index("boundary_following")
    assert set(modes[0][run.named_at : blocked]) == {"stopped"}
    assert modes[0][blocked + 1] == "motion_to_goal" and run.lengths[0] > 0.0


def test_a_winner_that_has_arrived_keeps_the_others_standing() -> None:
    scenario = team_scenario([], [(0.0, 0.0, 0.0), (1.0, 4.0, 0.0)], (8.0, 1.0))
    env = bug_gym.parallel_env({**scenario, "mission": "all"})
    policy: Any = make_policy("com1_rev3", env)
    seen, _ = env.reset(seed=0)
    state: Any = None
    for _ in range(120):
        actions, state = policy.predict({agent: seen[agent] for agent in env.agents}, state)
        seen, *_ = env.step(actions)
    assert env.agents == ["robot_0"] and state[0].mode == "stopped"
    np.testing.assert_array_equal(env.simulation.world.pose[0, 0, :2], [0.0, 0.0])


def test_a_winner_holds_for_nobody_who_has_stopped_beside_it() -> None:
    """Else one that comes later in the order would hold for ever: who has stopped never gets out of its way."""
    scenario = team_scenario([], [(0.0, 0.0, 0.0), (1.2, 0.3, 0.0)], (8.0, 1.0))
    run = run_team("com1_rev3", scenario, clearance=1.0, max_steps=200)
    assert run.winner == 1 and run.outcomes[1] == "success" and run.lengths[0] == 0.0
    assert all(modes == ("stopped", "motion_to_goal") for modes in run.modes[run.named_at + 1 :])
    assert run.lengths[1] == pytest.approx(math.hypot(6.8, 0.7), abs=0.1)


# ------------------------------------------------------------------------------------------ no way


def test_what_rev3_finds_out_alone_ends_nothing_as_it_is_not_complete() -> None:
    simulation = Simulation(team_scenario([[[9, -9], [10, -9], [10, 9], [9, 9]]], [(0, 0, 0), (0, 4, 0)], (20.0, 0.0)))
    policy: Any = make_policy("com1_rev3", simulation)
    flat = simulation.reset(seeds=[0])[0]
    _, state = policy.predict(flat)
    state[1].own.verdict = "unreachable"
    actions, state = policy.predict(flat, state)
    assert [memory.verdict for memory in state] == ["", ""]
    assert np.abs(actions[0]).max() > 0.5 and np.abs(actions[1]).max() == 0.0, "Com1 goes on to decide"
    state[0].own.verdict = "unreachable"
    _, state = policy.predict(flat, state)
    assert [memory.verdict for memory in state] == ["unreachable", "unreachable"]


def test_com1s_lap_proves_that_there_is_no_way() -> None:
    scenario = {"mission": "first", "lidar": {"beams": 360, "range": 10.0}, "time": {"limit": 600.0}}
    world = {"family": "ring", "bounds": [-5, -10, 20, 10], "start": [0, 0, 0], "goal": [10.3, 0.2], "centre": [10, 0]}
    starts = [{"start": [0.0, -1.0, 0.0]}, {"start": [0.0, 1.0, 0.0]}]
    run = run_team("com1_rev3", {**scenario, "world": world, "robots": starts}, clearance=0.5)
    assert run.verdicts == ("unreachable", "unreachable") and run.winner is None
    solo = run_episode("com1", {**scenario, "world": world, "robots": starts[:1]}, clearance=0.5, turn="right")
    assert run.lengths[0] == pytest.approx(solo.length, abs=0.1)
    assert run.lengths[0] <= 1.03 * (Ring().first + Ring().lap) + 0.6


@pytest.mark.parametrize(
    ("robot", "seed"),
    [
        *(("holonomic", seed) for seed in (11, 23, 35, 39, 83, 167, 183, 255)),
        *(("jackal", seed) for seed in (7, 15, 79)),
    ],
)
def test_robots_shut_in_close_together_find_out_as_com1_does_alone(robot: str, seed: int) -> None:
    """Each going round the other spoils the lap that would prove it: so one of them comes after the other."""
    answer = cylinder_claims.mission("com1_rev3", robot, seed)
    assert (answer.outcome, answer.verdict) == ("gave_up", "unreachable")


@pytest.mark.parametrize(("robot", "seed"), [("jackal", 1216), ("jackal", 1606), ("holonomic", 882)])
def test_a_way_behind_a_partner_that_one_has_gone_round_is_found(robot: str, seed: int) -> None:
    """A lap does not prove it away; and who wins while it follows makes room for nobody who has stopped (882)."""
    answer = cylinder_claims.mission("com1_rev3", robot, seed)
    assert (answer.outcome, answer.verdict) == ("success", "")


def test_who_follows_and_is_the_first_to_see_the_goal_goes_there() -> None:
    simulation = Simulation(
        team_scenario([[[9, -9], [10, -9], [10, 9], [9, 9]]], [(-3.0, 0, 0), (0, 0, 0)], (5.0, 0.0))
    )
    policy: Any = make_policy("com1_rev3", simulation)
    flat, state = simulation.reset(seeds=[0])[0], policy.start(2)
    state[1].following, state[1].gone_round = 0, 2  # for good
    for _ in range(120):
        actions, state = policy.predict(flat, state)
        after = simulation.step(actions[None])
        flat = after.observation[0]
        if after.terminated.any():
            break
    assert simulation.info()["outcome"][0, 1] == "success"


def test_a_lap_with_a_hand_on_a_partner_that_has_given_up_proves_nothing() -> None:
    simulation = Simulation(
        team_scenario([[[9, -9], [10, -9], [10, 9], [9, 9]]], [(2.0, 0, 0), (0, 0, 0)], (20.0, 0.0))
    )
    policy: Any = make_policy("com1_rev3", simulation)
    flat = simulation.reset(seeds=[0])[0]
    _, state = policy.predict(flat)
    state[0].own.verdict = "looping"
    while state[1].own.contour is None:
        actions, state = policy.predict(flat, state)
        flat = simulation.step(actions[None]).observation[0]
    assert state[1].squeezed and state[1].own.mode == "boundary_following"


def test_robots_shut_in_close_together_do_not_go_in_circles_behind_one_another_for_ever() -> None:
    shut = load(cylinder_claims.scenario("holonomic", shut=True), {"robots.count": 2})
    run = run_team("com1_rev3", dump(shut), seed=7)
    assert all(run.verdicts) and set(run.verdicts) <= {"looping", "unreachable"}


@pytest.mark.parametrize(
    ("goals", "first", "count"),
    [((0, 0, 0, 0), 0, 1), ((0, 0, 0, 0), 1, 1), ((0, 0, 0, 0), 2, 0), ((0, 1, 2, 3), 0, 0)],
    ids=["Com1", "another Com1", "Rev3", "goals of their own"],
)
def test_who_has_been_gone_round_comes_after_one_that_is_complete_where_all_seek_one_goal(
    goals: tuple[int, ...], first: int, count: int
) -> None:
    starts = [(0.0, 4.0 * number, 0.0) for number in range(4)]
    scenario = team_scenario([[[9, -9], [10, -9], [10, 18], [9, 18]]], starts, (20.0, 0.0))
    for place, goal in zip(scenario["robots"], goals, strict=True):
        place["goal"] = [20.0, 4.0 * goal]
    simulation = Simulation(scenario)
    policy: Any = make_policy("com1_rev3", simulation)
    flat = simulation.reset(seeds=[0])[0]
    _, state = policy.predict(flat)
    state[first].is_detouring, state[first].before, state[first].passing = True, state[first].own, {3}
    _, state = policy.predict(flat, state)  # they are far from one another: it has passed
    assert not state[first].is_detouring and state[3].gone_round == count


# ------------------------------------------------------------------------------------------ making room


def farthest(places: NDArray[np.float64], line: NDArray[np.float64]) -> float:
    """Greatest distance of places (n, 2) to a way (m, 2) [m]."""
    begin, way = line[:-1], np.diff(line, axis=0)
    square = np.maximum((way * way).sum(axis=1), 1e-12)
    gaps = []
    for place in places:
        share = np.clip(((place - begin) * way).sum(axis=1) / square, 0.0, 1.0)
        gaps.append(np.hypot(*(begin + share[:, None] * way - place).T).min())
    return float(max(gaps))


@pytest.mark.parametrize("seed", range(12))
def test_two_robots_never_touch_and_com1_drives_its_solo_curve(seed: int) -> None:
    scenario = random_world(seed)
    run = run_team("com1_rev3", scenario, seed=seed, clearance=1.0)
    assert "success" in run.outcomes and "collision" not in run.outcomes
    assert run.least_gap >= 0.5, "twice the radius of 0.25 m"
    solo = run_episode("com1", alone(scenario, 0), seed=seed, clearance=1.0, turn="right")
    if not run.memories[0].detoured:
        assert farthest(run.paths[:, 0, :2], solo.path[:, :2]) <= 0.1


@pytest.mark.parametrize(("robots", "seed"), [(4, 0), (4, 17), (4, 24), (4, 113), (8, 0), (8, 18)])
def test_many_robots_never_touch_and_never_stand_for_ever(robots: int, seed: int) -> None:
    run = run_team("com1_rev3", random_world(seed, robots), robots=robots, seed=seed, clearance=1.0)
    assert "success" in run.outcomes and "collision" not in run.outcomes
    assert run.least_gap >= 0.5


def test_hold_begins_below_its_distance_and_ends_at_the_other_one() -> None:
    starts = [(0.0, 0.0, 0.0), (0.0, 1.45, 0.0)]
    env = bug_gym.parallel_env({**team_scenario([[[9, -9], [10, -9], [10, 9], [9, 9]]], starts, (20.0, 0.0))})
    policy: Any = make_policy("com1_rev3", env)
    seen, _ = env.reset(seed=0)
    away, state = {"robot_0": np.array([0.0, -0.5]), "robot_1": np.zeros(2)}, None
    modes = {}
    for _ in range(14):
        _, state = policy.predict(seen, state)
        poses = env.simulation.world.pose[0]
        modes[round(math.dist(poses[0, :2], poses[1, :2]), 2)] = state[1].mode
        seen, *_ = env.step(away)
    assert all((mode == "hold") == (gap < 2.0) for gap, mode in modes.items())
    assert min(modes) == 1.45 and max(modes) > 2.0


@pytest.mark.parametrize(("distance", "is_held"), [(1.4, True), (1.499, True), (1.501, False), (1.9, False)])
def test_a_robot_that_does_not_hold_yet_does_so_only_below_its_distance(distance: float, is_held: bool) -> None:
    scenario = team_scenario(
        [[[9, -9], [10, -9], [10, 9], [9, 9]]], [(0.0, 0.0, 0.0), (0.0, distance, 0.0)], (20.0, 0.0)
    )
    env = bug_gym.parallel_env(scenario)
    policy: Any = make_policy("com1_rev3", env)
    _, state = policy.predict(env.reset(seed=0)[0])
    assert (state[1].mode == "hold") == is_held and state[0].mode == "motion_to_goal"


@pytest.mark.parametrize("room", [1, -1])
def test_room_is_made_on_or_back_whichever_leads_farther_away_within_a_metre(room: int) -> None:
    """One way leads round to the robot that waits and the other straight off; the first step of either is away from it."""
    starts = [(-0.65, 0.0, 0.0), (0.0, 0.0, 0.0)]
    simulation = Simulation(team_scenario([[[9, -9], [10, -9], [10, 9], [9, 9]]], starts, (20.0, 0.0)))
    policy: Any = make_policy("com1_rev3", simulation)
    state = policy.start(2)
    trace = [(0.0, -1.0), (0.0, 0.0), (0.0, 0.3), (-0.7, 0.3)]
    state[1].trace = trace[::-room]
    state[1].at = state[1].trace.index((0.0, 0.0))
    actions, state = policy.predict(simulation.reset(seeds=[0])[0], state)
    assert state[0].mode == "waiting" and state[1].mode == "making_room"
    assert state[1].room == room and actions[1][1] < -0.5


def test_what_a_partner_hides_is_seen_by_it() -> None:
    rng = np.random.default_rng(4)
    wrong: list[bool] = []
    for seed in range(40):
        scenario = random_world(seed)
        start = scenario["robots"][0]["start"]
        # The partner stands anywhere near, with room for its body.
        x, y = start[0] + rng.uniform(0.7, 1.5), start[1] + rng.uniform(-0.8, 0.8)
        near = {**scenario, "robots": [scenario["robots"][0], {"start": [x, y, float(rng.uniform(-3, 3))]}]}
        simulation = Simulation(near)
        team: Any = make_policy("com1_rev3", simulation)
        flat = simulation.reset(seeds=[0])[0]
        _, state = team.predict(flat)
        with_partner = state[0].view.ranges
        seen = SeeThrough(team.sensors, 2).seen(state, [True, False], [False, True])[0].view.ranges
        single = Simulation(alone(scenario, 0)).reset(seeds=[0])[0, 0, : len(seen)]
        changed = np.flatnonzero(np.abs(with_partner - single) > 1e-4)
        wrong += (np.abs(seen - single)[changed] > 0.05).tolist()
    # The partner may miss the last hand's breadth of a wall's end, or a wall at a small angle to its beams.
    assert len(wrong) > 500 and np.mean(wrong) <= 0.05


def test_the_paper_s_partner_rule_goes_round_the_partner() -> None:
    # Rev3 stands right before Com1 from the first: it is nearer than 1.5 m and holds.
    wall = [[[9, -9], [10, -9], [10, 9], [9, 9]]]
    scenario = team_scenario(wall, [(0.0, 0.0, 0.0), (1.3, 0.0, 0.0)], (20.0, 0.0))
    paper = run_team("com1_rev3", scenario, clearance=0.5, partner_rule="paper", max_steps=60)
    solo = run_team("com1_rev3", scenario, clearance=0.5, max_steps=60)
    assert np.abs(paper.paths[:, 0, 1]).max() > 0.4 and paper.least_gap >= 0.5
    assert np.abs(solo.paths[:30, 0, 1]).max() < 0.05 and solo.least_gap >= 0.5
    assert math.dist(paper.paths[10, 1, :2], (1.3, 0.0)) == 0.0, "the partner stands"


def test_a_silent_partner_is_an_obstacle_where_it_stands() -> None:
    wall = [[[9, -9], [10, -9], [10, 9], [9, 9]]]
    scenario = team_scenario(wall, [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)], (20.0, 0.0))
    env = bug_gym.parallel_env({**scenario, "mission": "all"})
    policy: Any = make_policy("com1_rev3", env)
    seen, _ = env.reset(seed=0)
    actions, state = policy.predict(seen)
    gaps = []
    for _ in range(80):
        seen, *_ = env.step({"robot_0": actions["robot_0"], "robot_1": np.zeros(2)})
        actions, state = policy.predict({"robot_0": seen["robot_0"]}, state)
        poses = env.simulation.world.pose[0]
        gaps.append(math.dist(poses[0, :2], poses[1, :2]))
    assert min(gaps) > 0.5 and poses[0, 0] > 4.0, "it went round"
    assert len(state[0].own.hits) >= 1


# ------------------------------------------------------------------------------------------ who is who


def test_half_of_the_robots_drive_by_com1_and_of_either_half_the_turns_alternate() -> None:
    policy = make_policy("com1_rev3", Simulation(random_world(0, 8)))
    assert isinstance(policy, Com1Rev3)
    assert [type(law) for law in policy.laws] == [Com1] * 4 + [Rev3] * 4
    assert [law.side for law in policy.laws] == [-1, 1, -1, 1, 1, -1, 1, -1]
    left = make_policy("com1_rev3", Simulation(random_world(0, 2)), sides="left")
    assert isinstance(left, Com1Rev3) and [law.side for law in left.laws] == [1, 1]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"hold_distance": 2.5}, "from 0 to go_distance"),
        ({"hold_distance": -1.0}, "from 0 to go_distance"),
        ({"sides": "both"}, "sides must be one of"),
        ({"clearance": 0.1}, "clearance"),
        ({"colour": "red"}, "no parameter 'colour'"),
    ],
)
def test_parameters_that_cannot_be_are_refused(parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make_policy("com1_rev3", Simulation(random_world(0)), **parameters)


def test_one_robot_is_too_few() -> None:
    with pytest.raises(MisfitError, match="2 robots or more"):
        make_policy("com1_rev3", "static")


@pytest.mark.parametrize("name", ["com1_rev3", "swarm_bug2"])
def test_starts_nearer_than_two_metres_are_told_once(name: str, caplog: pytest.LogCaptureFixture) -> None:
    log.told.clear()
    for apart in (1.997, 0.6):
        scenario = team_scenario([], [(0.0, 0.0, 0.0), (0.0, apart, 0.0)], (8.0, 1.0))
        simulation = Simulation(scenario)
        make_policy(name, simulation).predict(simulation.reset(seeds=[0])[0])
    assert [record.message.count("1.997 m apart, expected at least 2 m") for record in caplog.records] == [1]


def test_robots_that_come_near_on_their_way_have_not_started_there(caplog: pytest.LogCaptureFixture) -> None:
    """SB3's `evaluate_policy` goes on to call rows of which it has counted enough episodes first observations."""
    log.told.clear()
    starts = [(0.0, 0.0, 0.5 * math.pi), (0.0, 4.0, -0.5 * math.pi)]
    simulation = Simulation(team_scenario([], starts, (8.0, 1.0)))
    policy, seen = make_policy("com1_rev3", simulation), simulation.reset(seeds=[0])[0]
    while math.dist(*simulation.world.pose[0, :, :2]) > 1.0:
        policy.predict(seen, None, np.ones(2, dtype=bool))
        seen = simulation.step(np.tile([0.5, 0.0], (1, 2, 1))).observation[0]
    assert not caplog.records


@pytest.mark.parametrize("limits", [{}, {"max_acceleration": 1.0}], ids=["at once", "with inertia"])
@pytest.mark.parametrize("bearing", [0.3, 1.57, -1.57])
@pytest.mark.parametrize("apart", [0.501, 0.51])
@pytest.mark.parametrize("name", ["com1_rev3", "bug1_pair"])
def test_robots_that_start_body_to_body_drive_off(
    name: str, apart: float, bearing: float, limits: dict[str, float]
) -> None:
    """A differential robot brakes for the body beside it, which its law does not see; one of them had a free way."""
    beside = (apart * math.cos(bearing), apart * math.sin(bearing), 0.0)
    scenario = team_scenario([], [(0.0, 0.0, 0.0), beside], (9.0, 0.0), limit=30.0)
    scenario["robot"] |= {"kinematics": "differential", **limits}
    run = run_team(name, scenario)
    assert "success" in run.outcomes and run.least_gap > 0.5


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("name", ["com1_rev3", "bug1_pair"])
def test_robots_that_start_body_to_body_do_not_touch_within_their_first_step(name: str, side: float) -> None:
    """Half a step brings the one past the other, 1 mm nearer than their bodies are wide; after the whole step they are off."""
    box = [[[4, -1], [5, -1], [5, 1], [4, 1]]]  # nobody sees the goal, so both set out
    scenario = team_scenario(box, [(0.0, 0.0, 0.0), (0.045, 0.499 * side, 0.0)], (9.0, 0.0), limit=60.0)
    scenario["robot"]["kinematics"] = "holonomic"
    run = run_team(name, scenario)
    assert "success" in run.outcomes and run.least_gap > 0.5


@pytest.mark.parametrize("seed", [1, 4, 5, 6])
def test_sixteen_robots_that_change_places_do_not_lock_one_another_in(seed: int) -> None:
    """One that goes round others and holds keeps nobody from making room; who is held up beside its way back leaves it; and
    no boundary is followed that began on a partner, once that has gone on."""
    overrides = {"robots.count": 16, "robot.kinematics": "differential", "time.limit": 240.0}
    rows = evaluate(["com1_rev3"], "circle_swap", episodes=1, seed=seed, overrides=overrides)
    assert {row.outcome for row in rows} == {"success"}, [(row.robot, row.outcome) for row in rows if not row.success]


def test_robots_with_inertia_that_pass_through_one_another_brake_for_nobody() -> None:
    """They have bodies here, which meet in a corridor."""
    source = load("corridor_swap", {"robots.count": 2, "robot.max_acceleration": 1.0})
    for rule, outcome in (("ghost", "collision"), ("solo", "success")):
        entry = PolicyEntry(rule, "com1_rev3", {"partner_rule": rule, "hold_distance": 0.0})
        assert {row.outcome for row in evaluate([entry], source, episodes=1)} == {outcome}
