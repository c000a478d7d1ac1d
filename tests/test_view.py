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


@given(
    st.lists(st.one_of(st.just(REACH), st.floats(0.25, 4.9)), min_size=BEAMS, max_size=BEAMS),
    st.floats(-7.0, 7.0),
    st.sampled_from([0.1, math.radians(45.0), math.radians(120.0), math.pi]),
)
def test_the_nearest_point_is_the_plain_rules(ranges: list[float], bearing: float, half_width: float) -> None:
    view = view_of(ranges, dropout=0.0)
    x, y = view.points
    square = x * x + y * y
    if half_width < math.pi:
        ahead = x * math.cos(bearing) + y * math.sin(bearing) >= math.cos(half_width) * np.sqrt(square)
        square = np.where(ahead, square, np.inf)
    if np.isfinite(square.min(initial=np.inf)):
        index = square.argmin()
        expected = math.sqrt(square[index]), math.atan2(y[index], x[index])
    else:
        expected = math.inf, bearing
    assert view.nearest(bearing, half_width) == expected


@given(
    st.lists(st.one_of(st.just(REACH), st.floats(0.25, 4.9)), min_size=BEAMS, max_size=BEAMS),
    st.floats(-5.0, 5.0),
    st.floats(-5.0, 5.0),
)
def test_the_point_nearest_to_a_place_is_the_plain_rules(ranges: list[float], ahead: float, left: float) -> None:
    view = view_of(ranges, dropout=0.0)
    x, y = view.points
    square = (x - ahead) ** 2 + (y - left) ** 2
    expected = (x[square.argmin()], y[square.argmin()]) if len(x) else None
    assert view.point_nearest_to(ahead, left) == expected


@given(st.data(), st.sampled_from([0.0, 0.05]), st.sampled_from([2.0 * math.pi, math.radians(270.0)]))
def test_views_that_are_read_at_once_are_those_of_each_alone(data: st.DataObject, dropout: float, fov: float) -> None:
    ranges = st.lists(st.one_of(st.just(REACH), st.floats(0.0, 4.9)), min_size=BEAMS, max_size=BEAMS)
    sensors = view_of([REACH] * BEAMS, dropout=dropout, fov=fov).sensors
    rows = np.zeros((3, sensors.width), dtype=np.float32)
    for row in rows:
        row[sensors.always_seen[1]] = data.draw(st.lists(st.floats(-3.0, 3.0, width=32), min_size=7, max_size=7))
        row[sensors.always_seen[0]] = data.draw(ranges)
    for row, view in zip(rows, View.of_rows(rows, sensors, RADIUS), strict=True):
        alone = View(row, sensors)
        assert (view.goal, view.pose, view.velocity) == (alone.goal, alone.pose, alone.velocity)
        np.testing.assert_array_equal(view.ranges, alone.ranges)
        np.testing.assert_array_equal(view.points, alone.points)
        for radius in (RADIUS, 1.5 * RADIUS):
            assert view.free_ahead(radius) == alone.free_ahead(radius) == alone.free_distance(0.0, radius)


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_views_are_not_read_where_any_number_is_not_finite(number: float) -> None:
    sensors = view_of([REACH] * BEAMS, dropout=0.0).sensors
    for place in (0, BEAMS, sensors.width - 1):
        rows = np.zeros((2, sensors.width), dtype=np.float32)
        rows[1, place] = number
        with pytest.raises(ValueError, match="not finite"):
            View.of_rows(rows, sensors, RADIUS)
