"""Long bodies among movers: what is swept while they turn, and a passage in which a mover crosses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

from bug_gym.agents.hd_bug.roll_out import Movers
from bug_gym.agents.hd_bug_map.give_way import KEPT, followed, time_of_contact, turning_time
from bug_gym.agents.hd_bug_map.policy import HDBugMap
from bug_gym.geometry import F64
from bug_gym.kinematics import Drive

BODY = [[-0.4, 0.0, 0.22], [0.0, 0.0, 0.22], [0.4, 0.0, 0.22]]
FOOTPRINT = np.array(BODY)
TIMES: F64 = 0.1 * np.arange(1, 31, dtype=np.float64)
DRIVE = Drive("differential", 1.0, 0.3, 1.5, 0.1)


def movers(places: F64, radius: float) -> Movers:
    """One disc that is at places (K, 2)."""
    return Movers(places[None], np.full((1, len(places)), radius))


def test_a_body_that_turns_sweeps_what_it_would_pass_if_it_did_not() -> None:
    beside = movers(np.tile([0.0, 0.75], (len(TIMES), 1)), 0.1)
    standing = np.zeros((len(TIMES), 3))
    assert math.isinf(time_of_contact(FOOTPRINT, standing, beside, TIMES))
    turning = followed(DRIVE, (0.0, 0.0, 0.0), np.array([[0.0, 0.0, 0.5 * math.pi]]), 0.25, TIMES)
    # The front circle comes to (0, 0.4): 0.03 m from the disc.
    met = time_of_contact(FOOTPRINT, turning, beside, TIMES)
    assert 0.5 < met < turning_time(DRIVE, 0.5 * math.pi)


@pytest.mark.parametrize("speed", [0.3, 1.0, 2.0])
def test_a_disc_that_comes_straight_on_is_met_when_its_way_is_over(speed: float) -> None:
    coming = movers(np.column_stack([3.0 - speed * TIMES, np.zeros(len(TIMES))]), 0.3)
    met = time_of_contact(FOOTPRINT, np.zeros((len(TIMES), 3)), coming, TIMES)
    due = (3.0 - 0.4 - 0.22 - 0.3 - KEPT) / speed
    # It is looked at twenty times a second.
    assert due <= met <= due + 0.051 if due < TIMES[-1] else math.isinf(met)


def test_poses_are_followed_with_the_turns_between_them() -> None:
    poses = np.array([[0.0, 0.0, -0.3], [0.4 * math.cos(-0.3), 0.4 * math.sin(-0.3), -0.3]])
    path = followed(DRIVE, (0.0, 0.0, 0.0), poses, 0.25, TIMES)
    turned = turning_time(DRIVE, 0.3)
    assert turned >= 0.3 / DRIVE.max_turn_rate
    for time, (x, y, heading) in zip(TIMES, path, strict=True):
        gone = min(max(time - turned, 0.0) * 0.25, 0.4)
        assert (x, y) == pytest.approx((gone * math.cos(-0.3), gone * math.sin(-0.3)))
        assert heading == pytest.approx(-0.3 * min(time / turned, 1.0))


def crossed(place: float) -> dict[str, Any]:
    """A passage 1 m wide and 2.4 m long behind which a disc goes to and fro; it begins at y = `place` [m]."""
    walls = [
        [[0.0, -6.0], [2.4, -6.0], [2.4, -0.5], [0.0, -0.5]],
        [[0.0, 0.5], [2.4, 0.5], [2.4, 6.0], [0.0, 6.0]],
    ]
    motion = {"law": "waypoints", "speed": 0.4, "points": [[3.3, 5.0], [3.3, -5.0]]}
    return {
        "robot": {"kinematics": "differential", "circles": BODY, "max_reverse": 0.3},
        "lidar": {"beams": 180, "range": 8.0},
        "time": {"limit": 60.0},
        "world": {
            "family": "explicit",
            "bounds": [-1.0, -6.0, 8.0, 6.0],
            "polygons": walls,
            "movers": [{"at": [3.3, place], "shape": {"circle": 0.3}, "motion": motion}],
            "start": [0.8, 0.0, 0.0],
            "goal": [6.0, 2.0],
        },
    }


@pytest.mark.parametrize("place", [-4.6, -4.0, -3.4, -2.8])
def test_a_long_body_lets_a_mover_by_that_it_would_meet_where_it_turns(
    place: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run_episode("hd_bug_map", crossed(place)).outcome == "success"
    monkeypatch.setattr(HDBugMap, "_turn", lambda self, scene, memory, velocity: velocity)
    assert run_episode("hd_bug_map", crossed(place)).outcome == "collision"
