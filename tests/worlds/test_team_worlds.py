"""Worlds made for several robots: where they start, where they go, and that they can."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from measured import free_room

from bug_gym.config import load
from bug_gym.geometry import F64
from bug_gym.scenarios import draw_layout
from bug_gym.shortest_path import reachable
from bug_gym.worlds.layout import Layout

TEAM_SCENARIOS = (
    "crossing_robots",
    "oni_wang_pair",
    "circle_swap",
    "random_crossings",
    "corridor_swap",
    "warehouse_team",
    "rectangle_pair",
    "disc_pair",
)


def layouts(name: str, seeds: int, **overrides: Any) -> list[Layout]:
    scenario = load(name, {key.replace("__", "."): value for key, value in overrides.items()})
    return [draw_layout(scenario, seed, 0) for seed in range(seeds)]


def least_distance(points: F64) -> float:
    return min(math.dist(one, other) for one, other in itertools.combinations(points.tolist(), 2))


@pytest.mark.parametrize("name", TEAM_SCENARIOS)
def test_every_robot_starts_free_and_has_a_way_to_its_goal(name: str) -> None:
    scenario = load(name)
    assert scenario.robots.count > 1
    for layout in layouts(name, 5):
        assert least_distance(layout.starts[:, :2]) >= 2.0 * scenario.robot.reach
        goals = np.broadcast_to(layout.goals, (len(layout.starts), 2))
        for start, goal in zip(layout.starts[:, :2], goals, strict=True):
            assert free_room(layout, start) >= scenario.robot.reach - 1e-9
            assert reachable(
                layout.circles, layout.polygons, layout.border, start, goal, radius=scenario.robot.reach + 0.1
            )


@pytest.mark.parametrize("robots", [1, 2, 5, 16])
def test_robots_of_a_circle_swap_stand_evenly_and_face_their_goals_opposite(robots: int) -> None:
    [layout] = layouts("circle_swap", 1, robots__count=robots, world__jitter=0.0, world__rotation=0.5)
    angles = np.arctan2(layout.starts[:, 1], layout.starts[:, 0])
    expected = 0.5 + 2.0 * math.pi * np.arange(robots) / robots
    np.testing.assert_allclose(np.exp(1j * angles), np.exp(1j * expected), atol=1e-12)
    np.testing.assert_allclose(np.hypot(*layout.starts[:, :2].T), 4.0)
    np.testing.assert_allclose(layout.goals, -layout.starts[:, :2], atol=1e-12)
    headings = np.exp(1j * layout.starts[:, 2])
    np.testing.assert_allclose(headings, -np.exp(1j * expected), atol=1e-12)


@pytest.mark.parametrize("robots", [1, 2, 3, 5])
def test_ways_of_random_crossings_cross_about_the_middle_at_any_angle(robots: int) -> None:
    nearest, farthest, aside = [], [], []
    for layout in layouts("random_crossings", 200, robots__count=robots):
        starts, goals = layout.starts[:, :2], layout.goals
        np.testing.assert_allclose(layout.starts[:, 2], np.arctan2(*(goals - starts).T[::-1]))
        assert (np.abs(np.hypot(*starts.T) - 5.0) <= 1.0).all() and (np.abs(np.hypot(*goals.T) - 5.0) <= 1.0).all()
        ahead = np.column_stack([np.cos(layout.starts[:, 2]), np.sin(layout.starts[:, 2])])
        aside += np.abs(starts[:, 0] * ahead[:, 1] - starts[:, 1] * ahead[:, 0]).tolist()
        angles = np.sort(np.arctan2(starts[:, 1], starts[:, 0]))
        gaps = np.append(np.diff(angles), angles[0] + 2.0 * math.pi - angles[-1])
        nearest.append(gaps.min())
        farthest.append(gaps.max())
    # A start is drawn from a disc of 1 m, which is seen from the middle at asin(1 / 5) to either side of its place.
    assert min(nearest) >= math.pi / robots - 2.0 * math.asin(0.2)
    assert np.mean(aside) > 0.2 and max(aside) <= 1.0 + 1e-9
    if robots > 1:
        assert min(nearest) < 1.2 * math.pi / robots and max(farthest) > 2.6 * math.pi / robots


def test_a_circle_swap_draws_its_rotation_and_each_start() -> None:
    drawn = layouts("circle_swap", 60, robots__count=8)
    assert len({tuple(layout.starts[0]) for layout in drawn}) == 60
    away = np.abs(np.concatenate([np.hypot(*layout.starts[:, :2].T) for layout in drawn]) - 4.0)
    assert 0.08 < away.max() <= 0.1
    for layout in drawn:
        np.testing.assert_allclose(layout.goals, -layout.starts[:, :2], atol=1e-12)


def test_robots_that_would_overlap_on_the_circle_are_an_error() -> None:
    # 2 * 4 * sin(pi / 64) = 0.39 m from robot to robot
    with pytest.raises(ValueError, match="64 robots that reach 0.2 m overlap on a circle of 4 m"):
        layouts("circle_swap", 1, robots__count=64)


@pytest.mark.parametrize("name", ["circle_swap", "random_crossings"])
def test_the_most_robots_that_an_error_tells_have_room_and_one_more_has_not(name: str) -> None:
    with pytest.raises(ValueError, match=r"jitter .*, evenly .*, expected at most \d+$") as caught:
        layouts(name, 1, robots__count=200)
    most = int(str(caught.value).rsplit(" ", 1)[1])
    layouts(name, 1, robots__count=most)
    with pytest.raises(ValueError, match=f"expected at most {most}$"):
        layouts(name, 1, robots__count=most + 1)


def test_written_places_go_before_those_that_a_world_draws() -> None:
    places = [{"start": [1, 2, 0], "goal": [3, 3]}, {"start": [-1, 2, 0]}]
    scenario = load({"world": {"family": "circle_swap"}, "robots": places})
    layout = draw_layout(scenario, 0, 0)
    assert layout.starts.tolist() == [[1, 2, 0], [-1, 2, 0]]
    np.testing.assert_allclose(layout.goals, [[3, 3], [4, 0]], atol=1e-12)


def test_robots_of_a_store_keep_their_distances_and_racks_their_places() -> None:
    for layout in layouts("warehouse_team", 20):
        assert len(layout.polygons) == 12
        x, y = np.concatenate([rings[0] for rings in layout.polygons]).T
        assert (x.min(), y.min(), x.max(), y.max()) == pytest.approx((-9.6, -6.6, 9.6, 6.6))
        assert least_distance(layout.starts[:, :2]) >= 1.5 and least_distance(layout.goals) >= 1.5
        assert np.hypot(*(layout.starts[:, :2] - layout.goals).T).min() >= 8.0
        assert min(free_room(layout, goal) for goal in layout.goals) >= 0.3 - 1e-9


def test_a_store_with_too_many_robots_says_so() -> None:
    with pytest.raises(ValueError, match="robot .* after 1000 tries; none of 20 draws had room for 30 robots"):
        layouts("warehouse_team", 1, robots__count=30, world__spacing=6.0)


@pytest.mark.parametrize(
    ("name", "measures"),
    [
        # half side, depth, and the ways before and behind, at 0.5 m from the wall
        ("rectangle_pair", (5.5, 5.0, 7.5, 7.5)),
        ("disc_pair", (3.5, 7.0, 6.5, 6.5)),
    ],
)
def test_the_obstacles_of_the_equations_have_their_measures(name: str, measures: tuple[float, ...]) -> None:
    [layout] = layouts(name, 1)
    start, goal = layout.starts[:, :2].mean(axis=0), layout.goals[0]
    assert np.hypot(*(layout.starts[:, :2] - start).T).tolist() == [1.0, 1.0]
    corners = [*(ring for rings in layout.polygons for ring in rings)]
    corners += [np.array([[x - r, y - r], [x + r, y + r]]) for x, y, r in layout.circles.tolist()]
    (xmin, ymin), (xmax, ymax) = np.min(corners[0], axis=0) - 0.5, np.max(corners[0], axis=0) + 0.5
    assert ymin == -ymax and start[1] == goal[1] == 0.0
    assert (ymax, xmax - xmin, xmin - start[0], goal[0] - xmax) == measures
