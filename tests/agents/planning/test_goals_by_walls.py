"""Goals so near to walls that the body's centre cannot come to them, but within their radius."""

from __future__ import annotations

import pytest

from bug_gym.evaluation import evaluate

CELLS = ["a_star", "theta_star", "bfs", "dijkstra", "bidirectional_a_star", "d_star", "d_star_lite"]
CORNER_BUGS = ["point_bug", "k_bug", "e_bug", "critical_point_bug", "modified_critical_point_bug"]


def described(kinematics: str, goal: tuple[float, float]) -> dict[str, object]:
    """An empty room of 10 m by 10 m, the robot of 0.2 m in its middle."""
    world = {"family": "explicit", "bounds": [-5, -5, 5, 5], "start": [0, 0, 0], "goal": [*goal]}
    lidar = {"beams": 180, "range": 20.0}
    return {"robot": {"kinematics": kinematics}, "lidar": lidar, "time": {"limit": 30.0}, "world": world}


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("beside", [4.9, 4.93, 4.95])
def test_a_way_over_cells_ends_within_the_radius_of_a_goal_in_a_corner(kinematics: str, beside: float) -> None:
    rows = evaluate(CELLS, described(kinematics, (beside, beside)), episodes=1)
    assert [row.outcome for row in rows] == ["success"] * len(CELLS)


def test_where_cells_find_none_they_say_so() -> None:
    # 6 cm to spare: a body of 0.2 m comes to (4.8, 4.8), 0.24 m from the goal.
    rows = evaluate(CELLS, described("holonomic", (4.97, 4.97)), episodes=1)
    assert {(row.outcome, row.verdict) for row in rows} == {("gave_up", "stuck")}


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("beside", [4.71, 4.75, 4.8, 4.9])
def test_corner_bugs_drive_straight_to_a_goal_by_a_wall(kinematics: str, beside: float) -> None:
    rows = evaluate(CORNER_BUGS, described(kinematics, (beside, 0.0)), episodes=1)
    for row in rows:
        assert row.success and row.path_length == pytest.approx(beside - 0.3, abs=0.11)
