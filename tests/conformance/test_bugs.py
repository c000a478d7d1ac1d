"""What holds for every bug of the table, beyond what holds for every policy."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
from episodes import CLOSED_FORM_SENSORS, RING_ROUND_THE_START, Episode, Ring, canonical_world, run_episode
from numpy.typing import NDArray

from bug_gym.agents import AGENTS

BUGS = [name for name, agent in AGENTS.items() if agent.family == "bug" and name not in ("com", "ocpb", "hd_bug")]

VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    **{name: (name, {}) for name in BUGS},
    "rev2_noborio": ("rev2", {"variant": "noborio"}),
    "minimum_risk": ("minimum_risk", {}),
    "apf": ("apf", {}),
}
"""All bugs, those of their variants that are algorithms of their own, and two that are no bugs and follow no wall."""

FOLLOWS_NO_WALL = ("minimum_risk", "apf")
"""They have no clearance to keep."""

CAUGHT = "apf"
"""A field alone: it arrives or is stuck, and before a disc straight ahead noise decides which."""


def run(name: str, scenario: Any, overrides: dict[str, Any] | None = None, **settings: Any) -> Episode:
    """An episode of one of VARIANTS."""
    policy, parameters = VARIANTS[name]
    if policy in FOLLOWS_NO_WALL:
        settings = {key: value for key, value in settings.items() if key != "clearance"}
    return run_episode(policy, scenario, overrides, **parameters, **settings)


# ---------------------------------------------------------------------------------------------- near the goal, beside corners

COURSES = ["bug0", "bug1", "bug2", "com1", "alg2", "rev3", "dist_bug", "tangent_bug"]
"""Some of those whose differential robot takes up its line in arcs."""


@pytest.mark.parametrize("name", COURSES)
@pytest.mark.parametrize(("turn_rate", "goal_radius"), [(0.8, 0.3), (1.5, 0.1), (2.0, 0.05)])
def test_a_goal_within_the_turning_circle_is_reached(name: str, turn_rate: float, goal_radius: float) -> None:
    """A robot that went on in arcs at full speed would go round it for ever."""
    robot = {"kinematics": "differential", "max_turn_rate": turn_rate}
    for number in range(8):
        bearing, distance = 2.0 * np.pi * number / 8, (0.6, 0.9, 1.25)[number % 3]
        goal = [distance * np.cos(bearing), distance * np.sin(bearing)]
        world = {"family": "explicit", "bounds": [-10, -10, 10, 10], "start": [0, 0, 0], "goal": goal}
        scenario = {"robot": robot, "lidar": {"beams": 90}, "goal": {"radius": goal_radius}, "world": world}
        episode = run(name, scenario)
        # An arc to a goal square to the heading is half a circle over the way; Bug2 keeps to its line besides.
        assert episode.outcome == "success" and episode.full_length <= 0.5 * np.pi * distance + 0.4, number


@pytest.mark.parametrize("name", [*COURSES, "vis_bug_21", "e_bug"])
@pytest.mark.parametrize(
    "robot",
    [
        {"kinematics": "differential", "max_speed": 0.5},
        {"kinematics": "differential", "max_speed": 0.4, "max_acceleration": 0.5},
        {"kinematics": "holonomic", "max_speed": 0.4, "max_acceleration": 2.0},
    ],
    ids=lambda robot: " ".join(map(str, robot.values())),
)
def test_nobody_stands_before_a_corner_beside_its_line(name: str, robot: dict[str, Any]) -> None:
    """Which the way to the goal passes a little farther than the body, and a little nearer than the clearance."""
    for beside in np.arange(0.196, 0.26, 0.008).tolist():
        corner = [[4.0, beside], [5.0, beside], [5.0, beside + 2.0], [4.0, beside + 2.0]]
        world = {
            "family": "explicit",
            "bounds": [-2, -5, 9, 5],
            "polygons": [corner],
            "start": [0, 0, 0],
            "goal": [8, 0],
        }
        scenario = {"robot": {"radius": 0.2, **robot}, "lidar": {"beams": 180, "range": 8.0}, "world": world}
        assert run(name, scenario, {"time.limit": 100.0}).outcome == "success", beside


@pytest.mark.parametrize("name", ["com1", "alg2", "dist_bug", "vis_bug_21"])
def test_lost_beams_make_no_lap_longer(name: str) -> None:
    """A beam without a return is no free sight in which something stands a moment later: the lap would prove nothing."""
    wall = [[5.0, -8.0], [5.2, -8.0], [5.2, 8.0], [5.0, 8.0]]
    world = {"family": "explicit", "bounds": [-8, -8, 8, 8], "polygons": [wall], "start": [0, 0.3, 0], "goal": [7, 0.4]}
    scenario = {"robot": {"kinematics": "differential"}, "lidar": {"beams": 180, "range": 6.0}, "world": world}
    whole, lossy = (run(name, scenario, {"lidar.dropout": dropout, "time.limit": 400.0}) for dropout in (0.0, 0.1))
    assert whole.verdict == lossy.verdict == "unreachable"
    assert lossy.length <= 1.15 * whole.length


NO_RETURN = ["tangent_bug", "point_bug", "e_bug", "k_bug", "critical_point_bug", "vis_bug_21", "com1"]


@pytest.mark.parametrize("name", NO_RETURN)
@pytest.mark.parametrize("reach", [1.4, 2.8, 5.6])
def test_a_beam_that_meets_nothing_is_no_wall_at_any_range(name: str, reach: float) -> None:
    """As float32, in which ranges are told, 1.4, 2.8 and 5.6 are less than they are."""
    assert float(np.float32(reach)) < reach
    world = {"family": "explicit", "bounds": [-15, -15, 15, 15], "start": [-6, 0, 1], "goal": [6, 0.5]}
    scenario = {"robot": {"kinematics": "differential"}, "lidar": {"beams": 90, "range": reach}, "world": world}
    episode = run(name, scenario)
    assert episode.outcome == "success" and episode.full_length <= 12.5


# ---------------------------------------------------------------------------------------------- noise

CLOSED_FORM_WORLDS: dict[str, tuple[Any, dict[str, Any], float]] = {
    "slab": (canonical_world("slab"), {}, 0.5),
    "disc": (canonical_world("disc"), {}, 0.5),
    "u_trap": (canonical_world("u_trap"), {}, 0.5),
    "hook": ("hook", CLOSED_FORM_SENSORS, 0.4),
    "ring round the goal": ("ring", CLOSED_FORM_SENSORS, 0.4),
    "ring round the start": ("ring", {**CLOSED_FORM_SENSORS, "world": RING_ROUND_THE_START}, 0.4),
}
"""Scenario, what is changed in it, clearance [m]."""


FAR_SIGHTED = ("point_bug", "k_bug", "e_bug", "critical_point_bug", "modified_critical_point_bug")
"""They take an end of sight for an end of an obstacle; the sensor of their papers sees as far as the world goes."""

FAR = 60.0
"""Range of that sensor [m]; with the 10 m of the closed forms it cuts off walls."""

GREEDY = "operative_critical_point_bug"
"""Its paper's sensor sees far too. With a short sight noise decides which end of sight is the nearest to the goal, and what
lies behind the first choice decides whether it arrives."""

NOISE = {"lidar.noise": 0.02, "lidar.dropout": 0.01}


def ending(
    name: str, world: str, noise: dict[str, float], seed: int = 0, *, sight: float | None = None
) -> tuple[str, str]:
    """Outcome and verdict in one of CLOSED_FORM_WORLDS.

    "looping" and "stuck" are one: the robot knows no further, and claims nothing of the world. Which of them comes
    first depends on the order in which it meets the same corners.
    """
    scenario, overrides, clearance = CLOSED_FORM_WORLDS[world]
    reach = {"lidar.range": sight} if sight is not None else {}
    episode = run(name, scenario, {**overrides, **reach, **noise}, seed=seed, clearance=clearance)
    return episode.outcome, "gave up" if episode.verdict in ("looping", "stuck") else episode.verdict


@cache
def ending_without_noise(name: str, world: str, sight: float | None = None) -> tuple[str, str]:
    """`ending` in the same world, seen as it is."""
    return ending(name, world, {}, sight=sight)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("world", CLOSED_FORM_WORLDS)
@pytest.mark.parametrize("name", VARIANTS)
def test_noise_and_dropout_change_no_outcome(name: str, world: str, seed: int) -> None:
    sight = FAR if name in (*FAR_SIGHTED, GREEDY) else None
    plain, noisy = ending_without_noise(name, world, sight), ending(name, world, NOISE, seed, sight=sight)
    if name == CAUGHT:
        assert {plain, noisy} <= {("success", ""), ("running", "gave up")}
        return
    assert noisy == plain
    assert plain in (("success", ""), ("running", "unreachable"), ("running", "gave up"))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("world", [world for world in CLOSED_FORM_WORLDS if world != "ring round the goal"])
@pytest.mark.parametrize("name", FAR_SIGHTED)
def test_nor_where_a_short_sight_cuts_off_the_walls(name: str, world: str, seed: int) -> None:
    plain = ending_without_noise(name, world)
    assert ending(name, world, NOISE, seed) == plain
    assert plain in (("success", ""), ("running", "unreachable"), ("running", "gave up"))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("world", CLOSED_FORM_WORLDS)
def test_with_a_short_sight_the_greedy_one_arrives_or_says_that_it_knows_no_further(world: str, seed: int) -> None:
    found = ending(GREEDY, world, NOISE, seed)
    assert found in (("success", ""), ("running", "gave up"))
    if world in ("slab", "disc", "u_trap"):
        assert found[0] == "success"


DECEIVED: dict[str, tuple[str, str, float, int]] = {
    # Two noisy ranges foretold the third badly, and a wall at a small angle fell into two.
    "a wall in two": ("e_bug", "hook", FAR, 22),
    "a wall in two, nearest to the goal": ("critical_point_bug", "hook", FAR, 15),
    # As much noise would have let any range pass for foretold: a corner grew together with what lay far behind it.
    "a wall seen edge-on": ("k_bug", "hook", FAR, 9),
    # An end that seemed to move along its wall was remembered where it came to rest, and chosen again where it began.
    "an end that moves": ("critical_point_bug", "u_trap", 10.0, 2),
    "an end that moves, at once": ("critical_point_bug", "u_trap", 10.0, 28),
    # The way out was out of sight for one look, for want of a return, and that was the look that counted.
    "a look without a return": ("e_bug", "hook", 10.0, 24),
}


@pytest.mark.parametrize("case", DECEIVED)
def test_noise_that_has_deceived_them_does_so_no_more(case: str) -> None:
    name, world, sight, seed = DECEIVED[case]
    assert ending(name, world, NOISE, seed, sight=sight) == ending_without_noise(name, world, sight)


# ---------------------------------------------------------------------------------------------- among movers

# Each of these took a lap for proof in which something had moved.
MOVED = {
    "bug1": [289],
    "bug2": [29, 143, 174, 289, 291],
    "com1": [241, 289],
    "alg1": [29, 174, 291],
    "rev3": [292],
    "dist_bug": [289],
    "tangent_bug": [174],
}


@pytest.mark.parametrize(("policy", "seed"), [(policy, seed) for policy, seeds in MOVED.items() for seed in seeds])
def test_a_lap_in_which_something_moved_proves_nothing(policy: str, seed: int) -> None:
    overrides = {"robot.kinematics": "holonomic", "time.limit": 120.0}
    # Whoever has gone round and round says so; that is no claim about the goal.
    assert run_episode(policy, "dynamic", overrides, seed=seed).verdict in ("", "looping")


LAPPING = ["bug0", "bug1", "bug2", "com1", "class1", "alg1", "alg2", "rev1", "rev2", "dist_bug", "tangent_bug"]
RING = Ring()


def longest(policy: str, laps: float) -> float:
    """The longest way of so many laps [m]; one who goes to a wall where it ends in sight walks further round it."""
    return (1.25 if policy == "tangent_bug" else 1.03) * (RING.first + laps * RING.lap)


def ring_with_a_mover(points: list[list[float]]) -> dict[str, Any]:
    """A ring round the goal, straight ahead, and a disc that goes along way points and stops at the last one."""
    shell, hole = ([[10 - r, -r], [10 + r, -r], [10 + r, r], [10 - r, r]] for r in (4.0, 3.5))
    motion = {"law": "waypoints", "points": points, "speed": 0.4, "stop": True}
    world = {"family": "explicit", "bounds": [-10, -20, 30, 20], "start": [0, 0, 0], "goal": [10.3, 0.2]}
    world |= {"polygons": [{"shell": shell, "holes": [hole]}]}
    return {"world": {**world, "movers": [{"shape": {"circle": 0.4}, "at": points[0], "motion": motion}]}}


@pytest.mark.parametrize("policy", LAPPING)
def test_a_mover_far_from_the_lap_does_not_spoil_its_proof(policy: str) -> None:
    far = [[-6.0, -16.0], [-6.0, 16.0]] * 5
    episode = run_episode(policy, ring_with_a_mover(far), CLOSED_FORM_SENSORS, clearance=0.5)
    assert episode.verdict == "unreachable"
    assert episode.length <= longest(policy, 1.0)


@pytest.mark.parametrize("policy", LAPPING)
def test_after_a_mover_has_come_to_rest_the_next_lap_is_the_proof(policy: str) -> None:
    """It goes up and down beside the wall that the robot follows until about the middle of the first lap."""
    beside = [*[[4.0, 1.5], [4.0, 4.0]] * 4, [-8.0, 15.0]]
    episode = run_episode(policy, ring_with_a_mover(beside), CLOSED_FORM_SENSORS, clearance=0.5)
    assert episode.verdict == "unreachable"
    assert RING.first + 1.5 * RING.lap <= episode.length <= longest(policy, 3.0)


@pytest.mark.parametrize("world", ["slab", "u_trap"])
@pytest.mark.parametrize("name", VARIANTS)
def test_a_target_that_walks_away_is_never_called_unreachable(name: str, world: str) -> None:
    motion = {"law": "waypoints", "points": [[20.0, 0.0], [20.0, 9.0], [20.0, -9.0]], "speed": 0.3}
    scenario = canonical_world(world)
    del scenario["world"]["goal"]
    scenario["world"] |= {"target": {"at": [20.0, 0.0], "motion": motion}}
    episode = run(name, scenario, clearance=0.5)
    found = episode.outcome, episode.verdict
    assert found == ("success", "") or (name == CAUGHT and found == ("running", "stuck"))


# ---------------------------------------------------------------------------------------------- no way

ONE_LAP = ["bug0", "bug1", "bug2", "com1", "class1", "alg1", "alg2", "rev1", "rev2", "rev2_noborio", "dist_bug"]


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("range_", [2.0, 10.0])
@pytest.mark.parametrize("name", ONE_LAP)
def test_a_goal_shut_in_is_unreachable_after_one_lap(name: str, range_: float, turn: str) -> None:
    episode = run(name, "ring", {**CLOSED_FORM_SENSORS, "lidar.range": range_}, clearance=0.5, turn=turn)
    expected = RING.first + RING.lap
    assert episode.verdict == "unreachable"
    assert expected - 0.3 <= episode.length <= 1.03 * expected


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("name", [name for name in ONE_LAP if name not in ("bug0", "rev2")])
def test_shut_in_itself_it_says_so_after_one_lap(name: str, turn: str) -> None:
    """Without a distance test Bug0 and Rev2 leave the wall where it turns away from the goal, and loop."""
    settings = {**CLOSED_FORM_SENSORS, "world": RING_ROUND_THE_START}
    episode = run(name, "ring", settings, clearance=0.5, turn=turn)
    expected = RING.first_inside + RING.lap_inside
    assert episode.verdict == "unreachable"
    assert expected - 0.3 <= episode.length <= 1.03 * expected


@pytest.mark.parametrize("policy", ["bug1", "bug2", "com1", "dist_bug", "tangent_bug", "vis_bug_21"])
def test_shut_in_by_a_crooked_wall_with_the_goal_behind_a_corner_they_give_up(policy: str) -> None:
    """Beside an obtuse corner a step toward the goal is free, over and over; that once was taken for a way out."""
    corners = [(-1.3, 3.3), (1.5, 3.7), (2.9, 3.0), (1.9, 2.3), (1.5, 0.8), (-0.4, 0.7)]
    wall = shapely.LinearRing(corners).buffer(0.25, join_style="mitre")
    rings = [shapely.get_coordinates(ring)[:-1].tolist() for ring in (wall.exterior, *wall.interiors)]
    world = {"family": "explicit", "bounds": [-8, -8, 8, 8], "start": [1.2, 2.4, 0.0], "goal": [-4.9, 5.4]}
    world |= {"polygons": [{"shell": rings[0], "holes": rings[1:]}]}
    assert run_episode(policy, {"world": world}, CLOSED_FORM_SENSORS, clearance=0.3).verdict == "unreachable"


@pytest.mark.parametrize("policy", ["bug2", "vis_bug_21", "vis_bug_22"])
def test_a_goal_beside_a_wall_is_found_where_only_the_contour_leads_past_it(policy: str) -> None:
    """VisBug once cut the corner in which the goal lay, and went on round the world."""
    world = {"family": "explicit", "bounds": [-6, -6, 6, 6], "start": [3.0, -3.5, 2.0], "goal": [-1.0, 5.9]}
    world |= {"circles": [[-0.1, 5.8, 0.6], [0.7, 1.1, 0.95]]}
    episode = run_episode(policy, {"world": world}, CLOSED_FORM_SENSORS, clearance=0.3)
    assert episode.outcome == "success"


# ---------------------------------------------------------------------------------------------------------- boxed in

BOXED_IN = ["bug1", "bug2", "com1", "dist_bug", "tangent_bug", "vis_bug_21"]

ROOF = [[-3.0, 0.15], [0.0, 0.25], [3.0, 0.15], [3.0, 1.0], [-3.0, 1.0]]
"""Between this and its mirror image a robot of 0.2 m stands in the widest place of a blind gap: each step leads into a
narrower one, and only backing is left."""


def between_roofs(until: float | None) -> dict[str, Any]:
    """The goal lies behind the one of the roofs, which is there up to a time [s]; None: for ever."""
    world = {"family": "explicit", "bounds": [-8, -8, 8, 8], "start": [0, 0, 0], "goal": [0, 5]}
    floor = [[x, -y] for x, y in ROOF]
    if until is None:
        return {"world": {**world, "polygons": [ROOF, floor]}}
    stands = {"law": "replay", "points": [[0.0, 0.0, 0.0], [until, 0.0, 0.0]]}
    return {"world": {**world, "polygons": [floor], "movers": [{"shape": {"polygon": ROOF}, "motion": stands}]}}


def steps_taken(episode: Episode) -> NDArray[np.int64]:
    """The numbers of the steps in which the robot moved."""
    return np.flatnonzero(np.hypot(*np.diff(episode.path[:, :2], axis=0).T) > 1e-6)


@pytest.mark.parametrize("policy", BOXED_IN)
def test_boxed_in_it_waits_backs_once_and_waits_again(policy: str) -> None:
    """10 s each time, of 0.1 s a step; after a step back it comes to the wide place again, and is stuck."""
    episode = run_episode(policy, between_roofs(None), {"lidar.beams": 360})
    taken = steps_taken(episode)
    assert episode.verdict == "stuck"
    assert 1 <= len(taken) <= 2 and taken[0] == 100
    assert len(episode.path) - 1 >= taken[-1] + 100


@pytest.mark.parametrize("policy", BOXED_IN)
def test_who_goes_away_within_that_time_is_waited_for(policy: str) -> None:
    episode = run_episode(policy, between_roofs(8.0), {"lidar.beams": 360})
    assert episode.outcome == "success"
    assert steps_taken(episode)[0] >= 79


@pytest.mark.parametrize("policy", BOXED_IN)
def test_in_a_pocket_of_a_step_they_say_unreachable(policy: str) -> None:
    """Four posts leave gaps for the body but none at the clearance; to go to and fro between two places is a lap there."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        far, first = rng.uniform(0.56, 0.63), rng.uniform(0.0, 2.0 * math.pi)
        bearings = first + 0.5 * math.pi * np.arange(4)
        assert 0.4 < math.sqrt(2.0) * far - 2.0 * 0.2 < 2.0 * 0.3
        world = {"family": "explicit", "bounds": [-6, -6, 6, 6], "start": [0.0, 0.0, 0.0], "goal": [5.0, 1.0]}
        world |= {"circles": [[far * math.cos(bearing), far * math.sin(bearing), 0.2] for bearing in bearings]}
        overrides = {**CLOSED_FORM_SENSORS, "time.limit": 100.0}
        assert run_episode(policy, {"world": world}, overrides, clearance=0.3).verdict == "unreachable"
