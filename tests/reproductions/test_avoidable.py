"""Which collisions could have been avoided, in worlds where it is plain."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.reproductions.avoidable import appeared, is_avoidable


def scenario(motion: dict[str, Any], at: list[float], **world: Any) -> dict[str, Any]:
    """A robot of 0.2 m and 1 m/s at the origin, its goal 4.5 m ahead, and a mover of 0.3 m."""
    mover = {"shape": {"circle": 0.3}, "at": at, "motion": motion}
    family = {"family": "explicit", "bounds": [-0.5, -5, 5, 5], "start": [0, 0, 0], "goal": [4.5, 0], **world}
    return {"robot": {"kinematics": "holonomic", "radius": 0.2}, "world": {**family, "movers": [mover]}}


def oncoming(distance: float, **world: Any) -> dict[str, Any]:
    return scenario({"law": "bounce", "velocity": [-1.0, 0.0]}, [distance, 0.0], **world)


def crash(described: dict[str, Any]) -> EpisodeRow:
    (row,) = evaluate(["go_to_goal"], described, episodes=1)
    assert row.outcome == "collision"
    return row


def test_with_room_to_step_aside_a_collision_is_avoidable() -> None:
    described = oncoming(3.0)
    assert is_avoidable("go_to_goal", described, crash(described))


def test_in_a_dead_end_that_the_mover_fills_it_is_not() -> None:
    # They meet after 0.5 s. A second later the mover is at the origin, over the whole width; the wall is 0.5 m behind.
    described = oncoming(1.5, bounds=[-0.5, -0.35, 5.0, 0.35])
    assert not is_avoidable("go_to_goal", described, crash(described))


def test_in_a_longer_dead_end_it_is() -> None:
    # They meet after 1.25 s; a second later the robot can be at the end, 0.7 m before the mover.
    described = oncoming(3.0, bounds=[-0.5, -0.35, 5.0, 0.35])
    assert is_avoidable("go_to_goal", described, crash(described))


@pytest.mark.parametrize(("since", "sudden"), [(0.0, False), (0.5, False), (1.0, True)])
def test_who_came_within_a_second_of_the_collision_came_out_of_nowhere(since: float, sudden: bool) -> None:
    # It comes at 1 m/s from 4 m ahead, and the robot goes to meet it: they touch after 1.75 s.
    points = [[since, 4.0 - since, 0.0], [4.0, 0.0, 0.0]]
    described = scenario({"law": "replay", "points": points}, points[0][1:])
    row = crash(described)
    assert row.time == pytest.approx(1.75, abs=0.1)
    assert appeared("go_to_goal", described, row) is sudden
    assert is_avoidable("go_to_goal", described, row)


def test_only_collisions_are_asked_about() -> None:
    described = oncoming(3.0)
    row = replace(crash(described), outcome="timeout")
    for ask in (is_avoidable, appeared):
        with pytest.raises(ValueError, match="not in a collision"):
            ask("go_to_goal", described, row)
