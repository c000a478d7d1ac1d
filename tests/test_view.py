"""What a policy sees of a scan: its points, of a scanner that loses beams too."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bug_gym.config import load
from bug_gym.observation import width
from bug_gym.view import Sensors, View

BEAMS, REACH, RADIUS = 64, 5.0, 0.2


def view_of(ranges: list[float], *, dropout: float, fov: float = 2.0 * math.pi) -> View:
    """What a robot sees with these ranges [m]."""
    lidar = {"beams": len(ranges), "range": REACH, "fov": fov, "dropout": dropout}
    robot = {"robot.kinematics": "differential", "robot.radius": RADIUS}
    sensors = Sensors.of(load("static", robot | {f"lidar.{key}": value for key, value in lidar.items()}))
    flat = np.zeros(width(sensors.fields), dtype=np.float32)
    flat[sensors.always_seen[0]] = ranges
    return View(flat, sensors)


def at_a_wall(distance: float) -> list[float]:
    """Ranges [m] of a robot before a straight wall without end, ahead of it."""
    ahead = np.cos(np.arange(BEAMS) * (2.0 * math.pi / BEAMS))
    return [min(distance / cos, REACH) if cos > 1e-9 else REACH for cos in ahead.tolist()]


@pytest.mark.parametrize("lost", [0, 3, BEAMS - 3])
def test_a_lost_beam_at_a_wall_leaves_no_gap(lost: int) -> None:
    ranges = at_a_wall(0.6)
    whole = view_of(ranges, dropout=0.01)
    bearing = 2.0 * math.pi * lost / BEAMS
    ranges[lost] = REACH
    bridged, open_to_it = view_of(ranges, dropout=0.01), view_of(ranges, dropout=0.0)
    assert len(bridged.points[0]) == len(whole.points[0]) == len(open_to_it.points[0]) + 1
    # It is taken to be as near as the nearer one of its neighbours.
    nearer = min(ranges[lost - 1], ranges[(lost + 1) % BEAMS])
    assert bridged.free_distance(bearing, 0.01) == pytest.approx(nearer - 0.01, abs=1e-5)
    assert open_to_it.free_distance(bearing, 0.01) > whole.free_distance(bearing, 0.01) + 0.01


@given(st.lists(st.one_of(st.just(REACH), st.floats(0.25, 4.9)), min_size=BEAMS, max_size=BEAMS), st.booleans())
def test_what_is_bridged_is_where_no_body_passes(ranges: list[float], is_round: bool) -> None:
    fov = 2.0 * math.pi if is_round else math.radians(270.0)
    seen, told = (view_of(ranges, dropout=dropout, fov=fov) for dropout in (0.0, 0.05))
    angles, reach = seen.sensors.angles, np.array(ranges, dtype=np.float32).astype(float)
    places = {
        i: reach[i] * np.array([math.cos(angles[i]), math.sin(angles[i])]) for i in range(BEAMS) if reach[i] < REACH
    }
    expected = []
    for i in range(BEAMS):
        around = [(i + way) % BEAMS for way in (-1, 1) if is_round or 0 <= i + way < BEAMS]
        if i in places:
            expected.append(places[i])
        elif len(around) == 2 and all(j in places for j in around):
            one, other = (places[j] for j in around)
            if math.dist(one, other) < 2.0 * RADIUS:
                expected.append(min(reach[j] for j in around) * np.array([math.cos(angles[i]), math.sin(angles[i])]))
    assert np.column_stack(told.points) == pytest.approx(np.array(expected).reshape(-1, 2), abs=1e-9)
    assert np.column_stack(seen.points) == pytest.approx(np.array(list(places.values())).reshape(-1, 2), abs=1e-9)
