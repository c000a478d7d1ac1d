"""Ways that a robot drives whose brake keeps more room than its body needs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

from bug_gym.agents import AGENTS
from bug_gym.agents.planning.gaps import ROUNDED, narrow_places, pushed_off, to_obstacles
from bug_gym.agents.planning.smoothing import Solids
from bug_gym.geometry import F64
from bug_gym.reproductions import cylinder_claims

PLANNERS = [name for name, line in AGENTS.items() if line.privileged]
OVER_CELLS = ("bfs", "dijkstra", "a_star", "bidirectional_a_star", "d_star", "d_star_lite", "theta_star")
NEED = 0.28
NO_EDGES = np.zeros((0, 4))


def pair(gap: float) -> Solids:
    """Two discs of 0.1 m whose surfaces are so far apart, above and below the x axis [m]."""
    y = 0.5 * gap + 0.1
    return Solids(np.array([[1.0, y, 0.1], [1.0, -y, 0.1]]), NO_EDGES, NEED)


def room_of(places: F64, solids: Solids) -> F64:
    """How far places (n, 2) are from the nearest obstacle (n,) [m]."""
    room: F64 = to_obstacles(places, solids)[1].min(axis=1)
    return room


def test_distances_are_those_from_surfaces_of_discs_and_from_sides() -> None:
    solids = Solids(np.array([[3.0, 0.0, 1.0]]), np.array([[-1.0, -1.0, -1.0, 1.0]]), NEED)
    apart, away = to_obstacles(np.array([[0.0, 0.0], [0.0, 4.0]]), solids)
    np.testing.assert_allclose(away, [[1.0, 2.0], [math.hypot(1.0, 3.0), 4.0]])
    np.testing.assert_allclose(apart[0], [[-1.0, 0.0], [2.0, 0.0]])
    np.testing.assert_allclose(apart[1], [[-1.0, -3.0], [3.0 * 0.8, -4.0 * 0.8]])


@pytest.mark.parametrize("beside", [-0.06, -0.02, 0.0, 0.05])
def test_a_way_too_near_to_one_obstacle_is_pushed_off_it(beside: float) -> None:
    solids = Solids(np.array([[1.0, -0.36 - beside, 0.1]]), NO_EDGES, NEED)
    places = pushed_off(np.array([[0.0, 0.0], [2.0, 0.0]]), solids)
    assert places[0].tolist() == [0.0, 0.0] and places[-1].tolist() == [2.0, 0.0]
    fine = np.concatenate([np.linspace(a, b, 50) for a, b in zip(places, places[1:], strict=False)])
    assert room_of(fine, solids).min() >= NEED - ROUNDED
    if beside >= 0.02:
        assert len(places) == 2  # there was room


@pytest.mark.parametrize("gap", [0.5, 0.54, 0.559, 0.6])
def test_between_two_obstacles_the_way_is_pushed_to_the_middle_at_least(gap: float) -> None:
    solids = pair(gap)
    off = 0.5 * gap - 0.2
    places = pushed_off(np.array([[0.0, off], [2.0, off]]), solids)
    fine = np.concatenate([np.linspace(a, b, 50) for a, b in zip(places, places[1:], strict=False)])
    assert room_of(fine, solids).min() == pytest.approx(min(0.5 * gap, NEED), abs=1e-3)


@pytest.mark.parametrize(("gap", "narrow"), [(0.5, 1), (0.559, 1), (0.561, 0), (1.0, 0)])
def test_a_gap_is_narrow_where_the_disc_does_not_fit(gap: float, narrow: int) -> None:
    found = narrow_places(np.array([[0.0, 0.0], [2.0, 0.0]]), pair(gap))
    assert len(found) == narrow
    if narrow:
        np.testing.assert_allclose(found, [[1.0, 0.0]], atol=0.011)


def test_who_stands_near_to_something_may_go_away_from_it_and_not_nearer() -> None:
    solids = pair(0.5)
    assert len(narrow_places(np.array([[1.0, 0.0], [3.0, 0.0]]), solids)) == 0
    np.testing.assert_allclose(narrow_places(np.array([[0.9, 0.0], [3.0, 0.0]]), solids), [[1.0, 0.0]], atol=0.011)
    assert len(narrow_places(np.array([[0.9, 0.0], [0.0, 0.0]]), solids)) == 0


def gated(*gaps: tuple[float, float]) -> dict[str, Any]:
    """A wall across the world with gaps: from where to where [m]."""
    ends = [-4.5, *(y for gap in gaps for y in gap), 4.5]
    walls = zip(ends[::2], ends[1::2], strict=True)
    return {
        "robot": {"kinematics": "differential", "radius": 0.25},
        "world": {
            "family": "explicit",
            "bounds": [-2, -4, 8, 4],
            "polygons": [[[3, low], [3.2, low], [3.2, high], [3, high]] for low, high in walls],
            "start": [0, 0, 0],
            "goal": [6, 0],
        },
    }


def told(name: str) -> dict[str, Any]:
    """Parameters of a planner, whose cells are small enough for the gaps."""
    return {"resolution": 0.025} if name in OVER_CELLS else {}


NARROW = (-0.26, 0.26)
"""The body of 0.25 m passes, the brake, which keeps 0.27 m, does not let it."""
PASSED = (2.0, 2.555)
"""0.2775 m on either side: more than the brake keeps, less than any way beside it does."""


@pytest.mark.parametrize("name", [name for name in PLANNERS if name != "rrt_star"])  # chance seldom finds such a gap
def test_a_gap_that_the_brake_does_not_pass_is_left_for_one_that_it_does(name: str) -> None:
    episode = run_episode(name, gated(NARROW, PASSED), **told(name))
    assert episode.outcome == "success" and episode.min_clearance > 0.0


@pytest.mark.parametrize("name", PLANNERS)
def test_where_all_gaps_are_too_narrow_for_the_brake_it_says_so_soon(name: str) -> None:
    episode = run_episode(name, gated(NARROW), **told(name))
    assert (episode.outcome, episode.verdict) == ("running", "stuck")
    assert len(episode.modes) < (30 if name == "rrt_star" else 3)  # that draws several times before it gives up


@pytest.mark.parametrize(
    ("name", "seed"),
    [("a_star", 126), ("bfs", 273), ("d_star_lite", 302), ("d_star", 364), ("d2t_dijkstra", 396), ("dijkstra", 426)],
)
def test_no_planner_stands_for_good_before_a_cylinder_that_its_way_comes_too_near_to(name: str, seed: int) -> None:
    ((policy, robot, *_, outcome, _),) = cylinder_claims.answers(name, "jackal", [seed])
    assert (policy, robot, outcome) == (name, "jackal", "success")
