"""OperativeCriticalPointBug and ModifiedCriticalPointBug in whole episodes."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from episodes import Episode, canonical_world, run_episode, scene, tolerance, with_mover

from bug_gym import kernels
from bug_gym.agents import make_policy
from bug_gym.agents.bugs.operative_critical_point_bug import OperativeCriticalPointBug, Sight
from bug_gym.agents.critical_points.circle import leg_along, leg_to
from bug_gym.agents.critical_points.looks import SHIFTS
from bug_gym.agents.critical_points.meeting import Mover
from bug_gym.agents.critical_points.memory import CriticalPoint, LastEnd
from bug_gym.agents.walls.boundary import WAIT
from bug_gym.config import load
from bug_gym.policy import STANDING
from bug_gym.simulation import Simulation
from bug_gym.view import View

C = 0.5
FAR = {"lidar.beams": 720, "lidar.range": 60.0}
KINEMATICS = ["holonomic", "differential"]
BOTH = ["modified_critical_point_bug", "operative_critical_point_bug"]


# ------------------------------------------------------------------------------------------------ the slab


def test_perpendicular_sub_goals_lead_round_the_slab_by_the_computed_way() -> None:
    episode = run_episode("ocpb", canonical_world("slab"), FAR, clearance=C, sub_goal="perpendicular")
    first, second = episode.memory.critical_points
    # The last beam that meets a corner falls short of it by less than the spacing of beams.
    assert math.dist(first, (7.8244, -3.4682)) <= 0.1 and math.dist(second, (12.0557, -3.4969)) <= 0.15
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(21.4699, abs=tolerance(21.47) / 3.0)


def test_sub_goals_as_printed_lead_into_the_slab() -> None:
    episode = run_episode("ocpb", canonical_world("slab"), FAR, clearance=C, sub_goal="printed")
    assert math.dist(episode.memory.critical_points[0], (8.1756, -2.8244)) <= 0.1
    assert episode.outcome == "collision"


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("shape", ["slab", "disc", "u_trap"])
def test_legs_that_are_looked_at_again_touch_nothing_and_are_no_longer_than_the_sub_goals(
    shape: str, kinematics: str
) -> None:
    episode = run_episode("ocpb", canonical_world(shape), {**FAR, "robot.kinematics": kinematics}, clearance=C)
    longest = {"slab": 21.47, "disc": 21.3, "u_trap": 23.2}[shape]
    assert episode.outcome == "success" and episode.min_clearance > 0.0
    assert episode.full_length <= longest + tolerance(longest)


@pytest.mark.parametrize("velocity", [(0.0, 0.4), (0.0, -0.4), (0.3, 0.3), (-0.4, 0.0), (0.4, 0.0)])
def test_in_the_open_it_never_stands_before_a_target_that_moves(velocity: tuple[float, float]) -> None:
    """Pure pursuit of a target at v takes at most the distance over the difference of speeds, and the turns of half a round."""
    target = {"at": [10, 0], "motion": {"law": "bounce", "velocity": list(velocity)}}
    world = {"family": "explicit", "bounds": [-60, -60, 60, 60], "start": [0, 0, 0], "target": target}
    episode = run_episode("ocpb", {"world": world, "robot": {"kinematics": "differential"}, "time": {"limit": 60.0}})
    drive = episode.simulation.scenario.robot
    assert episode.outcome == "success"
    assert 0.1 * len(episode.path) <= 10.0 / (1.0 - math.hypot(*velocity)) + math.pi / float(drive.max_turn_rate)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turn", ["left", "right"])
def test_of_two_equal_sub_goals_that_on_the_side_of_the_turn_is_taken(turn: str, mirrored: bool) -> None:
    episode = run_episode("ocpb", canonical_world("disc", mirrored=mirrored), clearance=C, turn=turn, max_steps=60)
    assert (episode.memory.critical_points[0][1] > 0.0) == (turn == "left")


# ------------------------------------------------------------------------------------------------ gaps

R = 0.4
SPARE = 0.03


def door(width: float) -> dict[str, Any]:
    """A wall across the world at x = 5, with a door amid it."""
    half = 0.5 * width
    walls = [[[4.8, -8], [5.2, -8], [5.2, -half], [4.8, -half]], [[4.8, half], [5.2, half], [5.2, 8], [4.8, 8]]]
    return scene(polygons=walls)


def two_discs(width: float) -> dict[str, Any]:
    """Two discs beside the way at x = 5."""
    return scene(circles=[[5.0, 0.5 * width + 1.0, 1.0], [5.0, -0.5 * width - 1.0, 1.0]])


def goes_between(episode: Episode, width: float) -> bool:
    """Whether the way crosses the line x = 5 within a gap amid it."""
    x, y = episode.path[:, 0], episode.path[:, 1]
    after = np.flatnonzero((x[:-1] < 5.0) & (x[1:] >= 5.0))
    return bool((np.abs(y[after]) < 0.5 * width).any())


def from_aside(world: dict[str, Any], degrees: float) -> dict[str, Any]:
    """The same with start and goal on a line through the gap, that much from the front."""
    dx, dy = 3.5 * math.cos(math.radians(degrees)), 3.5 * math.sin(math.radians(degrees))
    world["world"] |= {"start": [5 - dx, -dy, math.radians(degrees)], "goal": [5 + dx, dy]}
    return world


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("degrees", [0.0, 30.0, 45.0])
@pytest.mark.parametrize("make", [door, two_discs])
def test_a_gap_wider_than_the_circle_is_taken_and_a_narrower_one_refused(
    make: Any, degrees: float, kinematics: str
) -> None:
    for width, is_taken in ((2.0 * R + SPARE, True), (2.0 * R - SPARE, False)):
        world = from_aside(make(width), degrees)
        episode = run_episode("ocpb", world, {"robot.kinematics": kinematics, "lidar.beams": 720}, clearance=R)
        assert episode.min_clearance > 0.0
        if make is door:
            assert (episode.outcome == "success") == is_taken
            assert goes_between(episode, width) == is_taken
        else:
            assert episode.outcome == "success"
            # From 45 degrees the near disc covers the way, and the sub-goal beyond it is nearer to the goal.
            assert goes_between(episode, width) == (is_taken and degrees < 45.0)


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("behind", [1.0, 1.5, 2.0])
def test_between_discs_from_45_degrees_a_gap_is_taken_where_the_goal_is_behind_it_and_a_narrower_one_refused(
    behind: float, kinematics: str
) -> None:
    for width, is_taken in ((2.0 * R + SPARE, True), (2.0 * R - SPARE, False)):
        world = from_aside(two_discs(width), 45.0)
        world["world"]["goal"] = [5.0 + behind, 0.0]
        episode = run_episode("ocpb", world, {"robot.kinematics": kinematics, "lidar.beams": 720}, clearance=R)
        assert episode.outcome == "success" and episode.min_clearance > 0.0
        assert goes_between(episode, width) == is_taken


def test_without_safe_point_a_gap_between_body_and_circle_is_taken() -> None:
    width = 2.0 * R - 0.1
    assert goes_between(run_episode("ocpb", two_discs(width), clearance=R, safe_point=False), width)
    assert not goes_between(run_episode("ocpb", two_discs(width), clearance=R), width)


def test_a_pole_beside_the_track_stops_nobody_but_by_the_printed_rule() -> None:
    pole = scene(circles=[[5.0, 0.8, 0.15]])
    assert run_episode("ocpb", pole, clearance=R).full_length == pytest.approx(10.0, abs=0.01)
    # Its own two ends are nearer to each other than the circle is wide.
    assert run_episode("ocpb", pole, clearance=R, gap_rule="two_nearest").verdict in ("stuck", "looping")


# ------------------------------------------------------------------------------------------------ moving obstacles


CROSSINGS = {
    "at its own speed": ([5.0, -5.0], [0.0, 1.0]),
    "slower": ([6.0, -3.0], [0.0, 0.5]),
    "faster": ([7.0, -7.0], [0.0, 1.1]),
    "slanting": ([8.0, 4.0], [-0.3, -0.6]),
}


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("case", CROSSINGS)
def test_a_crossing_obstacle_is_found_and_passed_behind(case: str, kinematics: str) -> None:
    at, velocity = CROSSINGS[case]
    episode = run_episode("ocpb", with_mover(at, velocity), {"robot.kinematics": kinematics}, clearance=C)
    assert episode.outcome == "success"
    assert len(episode.memory.movers) == len(episode.memory.avoided) == 1
    # Behind it: the robot leaves its line against the mover's course.
    aside = episode.path[np.abs(episode.path[:, 1]).argmax(), 1]
    assert aside * velocity[1] < 0.0 and abs(aside) > 0.2


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize(("at", "velocity"), [([9.0, 0.0], [-0.6, 0.0]), ([2.5, 0.0], [0.3, 0.0])])
def test_head_on_and_overtaking_it_gives_way(at: list[float], velocity: list[float], kinematics: str) -> None:
    episode = run_episode("ocpb", with_mover(at, velocity), {"robot.kinematics": kinematics}, clearance=C)
    assert episode.outcome == "success" and len(episode.memory.avoided) == 1
    assert np.abs(episode.path[:, 1]).max() > 0.4


def test_an_obstacle_that_is_gone_by_then_is_left_alone() -> None:
    episode = run_episode("ocpb", with_mover([8.0, -1.5], [0.0, 0.7]), clearance=C)
    assert episode.outcome == "success"
    assert len(episode.memory.movers) == 1 and not episode.memory.avoided
    assert episode.full_length == pytest.approx(10.0, abs=0.01)


def beginning(scenario: dict[str, Any], policy: str = "ocpb") -> tuple[Any, View, Any]:
    """A holonomic bug, what it sees at first, and its memory of that."""
    simulation = Simulation(scenario | {"robot": {"kinematics": "holonomic"}})
    bug: Any = make_policy(policy, simulation, clearance=C)
    view, memory = View(simulation.reset(seeds=[0])[0, 0], bug.sensors), bug.start()
    if policy == "ocpb":
        bug._advance(view, memory)
    return bug, view, memory


@pytest.mark.parametrize("policy", ["ocpb", "modified_critical_point_bug"])
@pytest.mark.parametrize(("x", "meets"), [(5.0, True), (9.0, True), (12.0, False)])
def test_an_obstacle_is_met_on_the_way_to_the_goal_and_not_beyond_it(x: float, meets: bool, policy: str) -> None:
    """It crosses the line through start and goal when the robot would be there, at 1 m/s each."""
    bug, view, memory = beginning(scene(), policy)
    mover = Mover(7, (x, -x), (0.0, 1.0), 0.4)
    if policy == "ocpb":
        assert bug._meetings(view, memory, Sight([mover], None, *view.points)) == meets
    else:
        bug._note_meetings(view, memory, [mover])
    assert list(memory.virtual) == ([7] if meets else [])


def test_who_is_avoided_already_may_come_as_near_as_along_a_leg() -> None:
    """Beside it the robot would turn back else."""
    bug, view, memory = beginning(scene())
    middle = 0.5 * (bug.near + bug.circle.radius) + 0.4
    sight = Sight([Mover(7, (8.0, middle), (-1.0, 0.0), 0.4)], None, *view.points)
    assert bug._meetings(view, memory, sight) and not bug._meetings(view, memory, sight)
    sight = Sight([Mover(7, (8.0, middle - 0.5 * bug.circle.radius), (-1.0, 0.0), 0.4)], None, *view.points)
    assert bug._meetings(view, memory, sight) and bug._meetings(view, memory, sight)


@pytest.mark.parametrize("late", [False, True])
def test_a_leg_that_takes_too_long_is_given_up_and_its_sub_goal_not_taken_again(late: bool) -> None:
    bug, view, memory = beginning(scene())
    place, open_point = (3.0, 2.0), LastEnd((3.0, 2.0 - C), 1)
    memory.time = 9.0
    critical = CriticalPoint(place, open_point, 8.9 if late else 9.1)
    memory.critical = critical
    velocity = bug._go_on(view, memory, Sight([], None, *view.points), critical)
    leg = leg_to(bug.circle, place, turns=False)
    assert leg is not None and bug._is_new(view, memory, leg) == (not late)
    assert (velocity is None and memory.critical is None) == late


def test_sub_goals_of_open_points_that_have_given_one_come_last() -> None:
    """Of the two ends of a slab that of the nearer sub-goal comes first, until it has led to one."""
    bug, view, memory = beginning(canonical_world("slab"))
    reading = bug.scanner.read(view, None, ())
    first, *others = bug._in_order(view, memory, reading, only_virtual=False)
    memory.used.append(LastEnd(view.to_odometry(*first.end.point), -first.end.side))
    assert bug._in_order(view, memory, reading, only_virtual=False)[0] == first
    memory.used.append(LastEnd(view.to_odometry(*first.end.point), first.end.side))
    assert bug._in_order(view, memory, reading, only_virtual=False) == [*others, first] and others


def test_by_the_printed_times_the_same_obstacle_is_missed_or_a_false_alarm() -> None:
    # Both need six seconds; with the robot's distance in its place the obstacle would need twelve.
    missed = with_mover([6.0, -3.0], [0.0, 0.5])
    assert run_episode("ocpb", missed, clearance=C, max_steps=25).memory.avoided
    assert not run_episode("ocpb", missed, clearance=C, max_steps=25, timing="printed").memory.avoided
    # It is as fast as the robot, and long gone when that comes to its track.
    harmless = with_mover([8.0, -1.5], [0.0, 1.0])
    assert not run_episode("ocpb", harmless, clearance=C, max_steps=13).memory.avoided
    assert run_episode("ocpb", harmless, clearance=C, max_steps=13, timing="printed").memory.avoided


def at(speed: float) -> dict[str, float]:
    """A robot of this speed [m/s]."""
    return {"robot.max_speed": speed, "robot.max_reverse": 0.0}


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("radius", [0.3, 0.6, 1.0])
def test_a_still_disc_that_is_passed_never_moves_at_any_speed(radius: float, noise: float) -> None:
    for speed in (0.25, 0.5, 1.0, 2.0):
        world = scene(circles=[[5.0, radius + 0.7, radius]])
        episode = run_episode("ocpb", world, {"lidar.noise": noise, **at(speed)}, safety=0.1)
        assert episode.outcome == "success"
        assert not episode.memory.movers
    # The open points of the same disc slide: the printed rule takes it for a moving one.
    printed = run_episode("ocpb", world, {"lidar.noise": noise, **at(0.5)}, classify="open_points")
    assert printed.memory.movers


def test_of_a_thing_shifted_once_nothing_is_said() -> None:
    """The sets do the telling: while one look alone has seen the shift, the obstacle is not dynamic."""
    simulation = Simulation(with_mover([7.0, -5.0], [0.0, 0.5]), 1)
    agent = make_policy("ocpb", simulation, clearance=C)
    observation, state, found = simulation.reset(seeds=[0]), None, math.inf
    for step in range(30):
        action, state = agent.predict(observation[:, 0], state)
        assert state is not None
        memory: Any = state[0]
        if memory.movers:
            found = min(found, 0.1 * step)
        assert not memory.movers or (memory.sets.looks[:, SHIFTS] == 2.0).any()
        observation = simulation.step(action[:, None]).observation
    # Two looks, the least time apart; at this speed it shifts by the threshold in a tenth of a second.
    assert 0.6 <= found <= 1.5


# ------------------------------------------------------------------------------------------------ bodies, worlds

LONG = [[0.0, 0.0, 0.2], [0.25, 0.0, 0.2], [0.5, 0.0, 0.2]]


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("shape", ["slab", "disc"])
def test_a_body_whose_circle_lies_ahead_of_the_axle_goes_round(shape: str, kinematics: str) -> None:
    overrides = {"robot.circles": LONG, "robot.kinematics": kinematics}
    episode = run_episode("ocpb", canonical_world(shape), overrides, safety=0.15)
    assert episode.outcome == "success" and episode.min_clearance > 0.0
    assert episode.memory.circle[2] == pytest.approx(0.45 + 0.15)


STILL = {"world.shapes": "circles", "lidar.beams": 360, "lidar.noise": 0.0, "lidar.range": 10.0, "time.limit": 900.0}
"""A field of still discs, some gaps between them narrower than the circle: nothing is promised."""


def narrow_passages(episode: Episode, width: float) -> int:
    """How often the way leads between two discs nearer to each other than a width [m]."""
    layout = episode.simulation.world.layout(0)
    path, count = episode.path[:, :2], 0
    for (x, y, r), (u, v, s) in itertools.combinations(layout.circles.tolist(), 2):
        apart = math.hypot(u - x, v - y)
        if apart - r - s >= width - 1e-3:
            continue
        ux, uy = (u - x) / apart, (v - y) / apart
        p, q = np.array([x + r * ux, y + r * uy]), np.array([u - s * ux, v - s * uy])
        side = (path - p) @ np.array([-uy, ux])
        along = (path - p) @ np.array([ux, uy])
        crossed = side[:-1] * side[1:] < 0.0
        share = side[:-1] / np.where(crossed, side[:-1] - side[1:], 1.0)
        at = along[:-1] + share * (along[1:] - along[:-1])
        count += int((crossed & (at > 0.0) & (at < math.dist(p, q))).sum())
    return count


WORLDS = 8
"""Of the 1,000 worlds that the reproduction runs."""


@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_in_random_still_worlds_it_touches_nothing_and_takes_no_gap_below_the_circle(kinematics: str) -> None:
    passed_without = 0
    for seed in range(WORLDS):
        overrides = {
            **STILL,
            "world.obstacles": 90,
            "world.separation": 14.0,
            "world.solvable": None,
            "robot.kinematics": kinematics,
        }
        episode = run_episode("ocpb", "static", overrides, seed=seed, clearance=R)
        assert episode.outcome == "success" or episode.verdict in ("stuck", "looping")
        assert episode.min_clearance > 0.0
        assert narrow_passages(episode, 2.0 * R) == 0
        free = run_episode("ocpb", "static", overrides, seed=seed, clearance=R, safe_point=False)
        passed_without += narrow_passages(free, 2.0 * R)
    assert passed_without > 0


@pytest.mark.parametrize("policy", BOTH)
@pytest.mark.parametrize("seed", range(4))
def test_in_a_field_without_narrow_gaps_they_arrive(policy: str, seed: int) -> None:
    episode = run_episode(
        policy, "static", {"world.obstacles": 40, "lidar.noise": 0.02, "lidar.dropout": 0.02}, seed=seed
    )
    assert episode.outcome == "success" and episode.min_clearance > 0.0


@pytest.mark.parametrize("offset", np.linspace(0.0, 0.09, 10).round(3).tolist())
def test_where_the_goals_disc_is_less_than_a_step_away_and_a_whole_step_is_not_free_it_arrives(offset: float) -> None:
    """A post beside the goal's place lets the robot come within 0.28 m of it, and the goal's radius is 0.3 m."""
    post = {"circles": [[9.93, -0.13, 0.02]], "start": [offset, 0, 0], "goal": [10, 0]}
    scenario = scene(**post) | {"robot": {"kinematics": "holonomic"}, "goal": {"radius": 0.3}}
    assert run_episode("ocpb", scenario, clearance=0.3).outcome == "success"


def test_it_gives_up_before_what_stands_a_hand_ahead_for_too_long() -> None:
    """Where its tracker takes it for a mover that has come to stand: the leg is free, and the next step isn't."""
    simulation = Simulation(scene(circles=[[0.5, 0.0, 0.2]]))
    policy: Any = make_policy("ocpb", simulation)
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    leg = leg_along(policy.circle, 0.0, 5.0, turns=False)
    for _ in range(math.ceil(WAIT / policy.sensors.drive.step)):
        assert memory.verdict == ""
        assert policy._drive(view, memory, leg, "motion_to_critical_point") == STANDING
    policy._drive(view, memory, leg, "motion_to_critical_point")
    assert memory.verdict == "stuck"


@pytest.mark.parametrize("policy", BOTH)
def test_shut_in_they_know_no_further(policy: str) -> None:
    ring = {"family": "ring", "bounds": [-15, -15, 25, 15], "centre": [10, 0], "inside": "start"}
    world = {"world": {**ring, "start": [10, 0, 0], "goal": [0, 0]}, "lidar": {"beams": 360, "range": 60.0}}
    episode = run_episode(policy, world, clearance=C)
    assert (episode.verdict, episode.length) == ("stuck", 0.0)


INCOMPLETE = [
    *("bug0", "bug0_plus", "rev2", "rev3", "point_bug", "k_bug", "e_bug", "critical_point_bug"),
    *(*BOTH, "apf", "apf_wall_following"),
]


@pytest.mark.parametrize("policy", INCOMPLETE)
def test_before_a_ring_round_the_goal_all_end_with_a_verdict_with_noise_too(policy: str) -> None:
    """At 10 m sight ends on the walls, and some went on from one such end to the next for ever."""
    episode = run_episode(policy, "ring", {"lidar.range": 10.0, "lidar.noise": 0.03}, seed=1)
    assert episode.outcome == "running"
    assert episode.verdict in ("stuck", "looping", "unreachable")


def test_a_leg_is_chosen_a_deviation_of_the_ranges_wider_than_it_must_stay() -> None:
    for noise in (0.0, 0.01, 0.02):
        policy = make_policy("operative_critical_point_bug", load("ring", {"lidar.noise": noise}))
        assert isinstance(policy, OperativeCriticalPointBug)
        assert policy.take - policy.keep >= noise - 0.05 * (policy.circle.radius - policy.circle.body)
        assert policy.keep < policy.take <= policy.circle.radius


@pytest.mark.parametrize(("noise", "seed"), [(0.03, 304), (0.03, 306), (0.02, 303), (0.02, 309)])
def test_noise_at_the_far_end_of_a_leg_does_not_turn_it_round_again_and_again(noise: float, seed: int) -> None:
    """It turned on the spot so long that the scenario's 240 s were over before its verdict."""
    overrides = {"robot.kinematics": "differential", "lidar.range": 10.0, "lidar.noise": noise}
    episode = run_episode("operative_critical_point_bug", "ring", overrides, seed=seed)
    assert (episode.outcome, episode.verdict) == ("running", "looping")


# ------------------------------------------------------------------------------------------------ what it costs


@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_the_cost_of_a_way_is_its_length_and_its_turns_in_seconds(kinematics: str) -> None:
    overrides = {"robot.kinematics": kinematics, **at(0.5)}
    episode = run_episode("ocpb", canonical_world("slab"), overrides, clearance=C)
    # What the last action did comes after the last decision.
    until = episode.path[:-1]
    length = np.hypot(*np.diff(until[:, :2], axis=0).T).sum()
    turned = np.abs(np.diff(np.unwrap(until[:, 2]))).sum()
    rate = episode.simulation.scenario.robot.max_turn_rate
    cost = episode.memory.cost
    assert cost.moving == pytest.approx(length / 0.5, rel=1e-3)
    assert cost.rotating == pytest.approx(turned / rate if kinematics == "differential" else 0.0, rel=1e-2, abs=1e-9)
    assert cost.total == pytest.approx(cost.moving + cost.rotating + cost.detecting)


def test_a_mover_that_is_found_costs_the_time_between_two_looks_once() -> None:
    """It is left alone, so that nothing is waited for."""
    episode = run_episode("ocpb", with_mover([8.0, -1.5], [0.0, 0.7]), clearance=C)
    policy: Any = make_policy("ocpb", episode.simulation, clearance=C)
    assert len(episode.memory.movers) == 1 and "waiting" not in episode.modes
    assert episode.memory.cost.detecting == pytest.approx(policy.interval)
    assert run_episode("ocpb", canonical_world("slab"), clearance=C).memory.cost.detecting == 0.0


def test_what_is_waited_for_costs_as_long_as_it_is() -> None:
    simulation = Simulation(scene(circles=[[0.5, 0.0, 0.2]]))
    policy: Any = make_policy("ocpb", simulation)
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    for number in range(1, 20):
        policy._drive(view, memory, leg_along(policy.circle, 0.0, 5.0, turns=False), "motion_to_critical_point")
        assert memory.cost.detecting == pytest.approx(number * policy.sensors.drive.step)


def test_a_differential_robot_turns_on_the_spot_and_goes_straight() -> None:
    episode = run_episode("ocpb", canonical_world("slab"), {"robot.kinematics": "differential"}, clearance=C)
    way = np.hypot(*np.diff(episode.path[:, :2], axis=0).T)
    turn = np.abs(np.diff(episode.path[:, 2]))
    assert (turn[way > 1e-3] <= math.radians(1.0) + 1e-6).all()


# ------------------------------------------------------------------------------------------------ parameters


@pytest.mark.parametrize(
    "parameters",
    [{"safety": 0.0}, {"safety": -1.0}, {"safety": math.nan}, {"clearance": 0.2}, {"jump": 0.0}, {"sub_goal": "up"}],
)
def test_bad_parameters_are_refused(parameters: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(parameters))):
        make_policy("ocpb", Simulation("static"), **parameters)


def test_the_circle_is_given_in_one_way_only() -> None:
    with pytest.raises(ValueError, match="safety or clearance, got both"):
        make_policy("ocpb", Simulation("static"), safety=0.1, clearance=0.3)


def test_what_it_shows_are_circle_points_and_virtual_obstacles() -> None:
    episode = run_episode("ocpb", with_mover([5.0, -5.0], [0.0, 1.0]), clearance=C, max_steps=25)
    drawing = make_policy("ocpb", episode.simulation, clearance=C).draw(episode.memory)  # type: ignore[attr-defined]
    labels = {point[2] for point in drawing.points} | {area[1] for area in drawing.areas}
    assert labels >= {"circle", "virtual", "open_point", "sub_goal", "chosen", "meeting"}
    outline = next(area[0] for area in drawing.areas if area[1] == "virtual")
    virtual = next(iter(episode.memory.virtual.values()))
    for x, y in outline.tolist():
        assert kernels.point_wall_distance(x, y, *virtual.begin, *virtual.end) == pytest.approx(virtual.radius)
