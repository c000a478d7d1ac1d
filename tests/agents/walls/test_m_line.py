"""Bugs that keep to the M-line, where its end is not where their goal is."""

from __future__ import annotations

import pytest
from episodes import run_episode


@pytest.mark.parametrize("name", ["bug2", "alg1", "rev1"])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("drift", [0.014, 0.0145])
def test_who_has_come_to_the_end_of_a_line_that_has_drifted_goes_on_to_its_goal(
    name: str, kinematics: str, drift: float
) -> None:
    # The heading drifts with the way, so that the goal, 8 m away, seems to go aside by 32 m times as much: farther than its
    # radius, and less than a target has to go to count as one that moves.
    assert 0.3 < 32.0 * drift < 0.5
    world = {"family": "empty", "start": [-4, 0, 0], "goal": [4, 0]}
    scene = {"robot": {"kinematics": kinematics}, "odometry": {"rotation_bias": drift}, "world": world}
    assert run_episode(name, scene).outcome == "success"
