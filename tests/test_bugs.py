"""What holds for every bug of the table, beyond what holds for every policy."""

from __future__ import annotations

import math
from typing import Any

import pytest
import shapely
from episodes import CLOSED_FORM_SENSORS, run_episode

from bug_gym.agents import AGENTS

BUGS = [name for name, agent in AGENTS.items() if agent.family == "bug" and name not in ("com", "hd_bug")]

INSIDE = {"family": "ring", "bounds": [-15, -15, 25, 15], "centre": [10, 0], "inside": "start"}
INSIDE |= {"start": [10, 0, 0], "goal": [0, 0]}
WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "hook": ("hook", {}),
    "ring round the goal": ("ring", {}),
    "ring round the start": ("ring", {"world": INSIDE}),
}


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("policy", BUGS)
def test_noise_and_dropout_change_no_outcome(policy: str, world: str) -> None:
    """Here for the worlds of which the files of the single bugs do not say it already."""
    name, overrides = WORLDS[world]
    sensors = {**CLOSED_FORM_SENSORS, **overrides}
    plain = run_episode(policy, name, sensors, clearance=0.4)
    noisy = run_episode(policy, name, {**sensors, "lidar.noise": 0.02, "lidar.dropout": 0.01}, clearance=0.4)
    assert (noisy.outcome, noisy.verdict) == (plain.outcome, plain.verdict)
    assert plain.outcome == "success" or plain.verdict


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
    assert run_episode(policy, "dynamic", overrides, seed=seed).verdict == ""


LAPPING = ["bug0", "bug1", "bug2", "com1", "class1", "alg1", "alg2", "rev1", "rev2", "dist_bug", "tangent_bug"]
FIRST, LAP = 5.5, 4.0 * 8.0 + 2.0 * math.pi * 0.5
"""To the ring, and round it at 0.5 m [m]."""


def longest(policy: str, laps: float) -> float:
    """The longest way of so many laps [m]; one who goes to a wall where it ends in sight walks further round it."""
    return (1.25 if policy == "tangent_bug" else 1.03) * (FIRST + laps * LAP)


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
    assert FIRST + 1.5 * LAP <= episode.length <= longest(policy, 3.0)


# ---------------------------------------------------------------------------------------------- no way


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
