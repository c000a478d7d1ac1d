"""Ways for long bodies: every pose on them is free, a passage is taken lengthwise, too narrow ones are not."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from episodes import run_episode

from bug_gym.agents.hd_bug_map.poses import find_poses, turn_to
from bug_gym.agents.mapping.lazy_theta import Search
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.config import load
from bug_gym.reproductions import barn

BODY = [[-0.4, 0.0, 0.22], [0.0, 0.0, 0.22], [0.4, 0.0, 0.22]]
MARGIN = 0.03


def wall_with_gap(gap: float, heading: float) -> dict[str, Any]:
    half = 0.5 * gap
    walls = [
        [[0.0, -6.0], [0.3, -6.0], [0.3, -half], [0.0, -half]],
        [[0.0, half], [0.3, half], [0.3, 6.0], [0.0, 6.0]],
    ]
    return {
        "robot": {"kinematics": "differential", "circles": BODY, "max_reverse": 0.3},
        "lidar": {"beams": 180, "range": 8.0},
        "time": {"limit": 60.0},
        "world": {
            "family": "explicit",
            "bounds": [-6.0, -6.0, 8.0, 6.0],
            "polygons": walls,
            "start": [-4.0, -2.0, heading],
            "goal": [6.0, 2.0],
        },
    }


@pytest.mark.parametrize("heading", [0.0, 1.2])
def test_a_long_robot_turns_and_goes_lengthwise_through_a_passage_narrower_than_its_length(heading: float) -> None:
    episode = run_episode("hd_bug_map", wall_with_gap(0.8, heading))
    assert episode.outcome == "success"


def test_a_passage_narrower_than_the_body_is_no_way() -> None:
    episode = run_episode("hd_bug_map", wall_with_gap(0.4, 0.0))
    assert episode.verdict == "unreachable"


@pytest.mark.slow
def test_a_long_body_turns_into_no_wall_beside_it_where_its_poses_lead_no_farther() -> None:
    """Driven as a disc it did, in 6 of the first 10 of these mazes."""
    world = {"family": "maze", "bounds": [-17.33, -17.33, 17.33, 17.33], "passage": 3.38, "wall": 0.4, "loops": 0.1}
    body = {"kinematics": "differential", "circles": [[x, 0.0, 0.3] for x in (-1.0, -0.6, -0.2, 0.2, 0.6, 1.0)]}
    lidar, limit = {"beams": 180, "range": 12.4}, {"limit": 400.0}
    episode = run_episode(
        "hd_bug_map", {"robot": body, "world": world, "lidar": lidar, "time": limit, "goal": {"radius": 0.39}}, seed=3
    )
    assert episode.outcome == "success"


@pytest.mark.parametrize(("max_reverse", "outcome"), [(0.3, "success"), (0.0, "running")])
def test_a_long_body_in_a_dead_end_in_which_it_cannot_turn_backs_out(max_reverse: float, outcome: str) -> None:
    walls = [[[0.0, y], [3.0, y], [3.0, y + 0.3], [0.0, y + 0.3]] for y in (-0.75, 0.45)]
    walls.append([[3.0, -0.75], [3.3, -0.75], [3.3, 0.75], [3.0, 0.75]])
    scenario = wall_with_gap(1.0, 0.0)
    scenario["robot"]["max_reverse"] = max_reverse
    scenario["world"] |= {"polygons": walls, "start": [2.0, 0.0, 0.0], "goal": [-4.0, 0.0]}
    episode = run_episode("hd_bug_map", scenario)
    assert episode.outcome == outcome
    assert episode.verdict == ("" if max_reverse else "stuck")


def test_where_a_circle_of_the_body_passes_and_the_body_finds_no_way_nothing_is_proven() -> None:
    walls = [[[0.0, y], [0.2, y], [0.2, y + 1.3], [0.0, y + 1.3]] for y in (-1.475, 0.175)]
    world = {"family": "explicit", "bounds": [-2.0, -1.5, 2.5, 1.5], "start": [-1.0, 0.0, 0.0], "goal": [1.8, 0.0]}
    episode = run_episode(
        "hd_bug_map", barn.faithful() | {"world": world | {"polygons": walls}, "goal": {"radius": 0.3}}
    )
    assert (episode.outcome, episode.verdict) == ("running", "stuck")


def test_who_stands_too_near_to_turn_goes_on_where_the_disc_passes_at_the_least_clearance(shared_data: Path) -> None:
    described = barn.scenario("faithful", str(shared_data / "barn_worlds.jsonl"), 213)
    episode = run_episode(
        "hd_bug_map", load(described["scenario"], described["overrides"]), seed=0, **barn.PARAMETERS["faithful"]
    )
    assert episode.outcome == "success"


@pytest.mark.parametrize("seed", range(8))
def test_every_pose_between_start_and_goal_keeps_the_circles_off_the_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-4.0, 4.0, (25, 2))
    start, goal = np.array([-5.0, -5.0, 0.3]), (5.0, 5.0)
    cell = 0.06
    grid = PointMap((0.0, 0.0), 8.0, cell, 0.22 + MARGIN + cell, Search())
    angles = np.arctan2(points[:, 1] + 5.0, points[:, 0] + 5.0)
    order = np.argsort(angles)
    ranges = np.hypot(points[:, 0] + 5.0, points[:, 1] + 5.0)[order]
    for bearing, distance in zip(angles[order], ranges, strict=True):
        grid.add_scan((-5.0, -5.0), 0.0, np.array([bearing]), np.array([distance]), 100.0, 0.0, np.ones(1, dtype=bool))
    footprint = np.array(BODY)
    poses = find_poses(grid, footprint, tuple(start.tolist()), goal, 0.2)
    assert poses is not None
    remembered = shapely.MultiPoint(grid.points())
    assert math.dist(poses[-1, :2], goal) <= 0.2
    for before, after in zip(poses[:-1], poses[1:], strict=True):
        turn = turn_to(before[2], after[2])
        for share in np.linspace(0.0, 1.0, 40):
            x, y = before[:2] + share * (after[:2] - before[:2])
            heading = before[2] + share * turn
            for ahead, left, radius in BODY:
                cx = x + math.cos(heading) * ahead - math.sin(heading) * left
                cy = y + math.sin(heading) * ahead + math.cos(heading) * left
                assert remembered.distance(shapely.Point(cx, cy)) >= radius
