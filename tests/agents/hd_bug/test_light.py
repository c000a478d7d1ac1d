"""Light areas and doors against geometry worked out by hand and by shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.doors import MOST_DOORS, find_doors
from bug_gym.agents.hd_bug.light import (
    ANGLES,
    HEADINGS,
    are_before_walls,
    are_behind_walls,
    fill_walls,
    light_toward,
    measure_light,
)

F64 = NDArray[np.float64]
REACH, RADIUS, BEAMS = 5.0, 0.27, 360
BEARINGS = np.linspace(0.0, 2.0 * math.pi, BEAMS, endpoint=False)


def scan(walls: shapely.Geometry) -> F64:
    """Ranges (B,) from the origin."""
    ranges = np.full(BEAMS, REACH)
    for i, angle in enumerate(BEARINGS):
        ray = shapely.LineString([(0.0, 0.0), (REACH * math.cos(angle), REACH * math.sin(angle))])
        met = ray.intersection(walls)
        if not met.is_empty:
            ranges[i] = shapely.distance(met, shapely.Point(0.0, 0.0))
    return ranges


def lit(ranges: F64, heading: float = 0.0) -> tuple[F64, F64, F64]:
    """Light area (K,) and the scan points x (k,), y (k,), world axes."""
    seen = ranges < REACH
    x, y = ranges[seen] * np.cos(BEARINGS[seen]), ranges[seen] * np.sin(BEARINGS[seen])
    light = np.empty(HEADINGS)
    measure_light(x, y, ranges, 0.0, 2.0 * math.pi / BEAMS, heading, RADIUS, REACH, light)
    return light, x, y


def doors_of(light: F64, x: F64, y: F64) -> tuple[F64, F64]:
    """The doors at jumps and those at the ends of sight, (k, 5) each."""
    found = np.empty((MOST_DOORS, 5))
    jumps, count = find_doors(light, 0.0, 0.0, x, y, RADIUS, REACH, 0.1, found)
    return found[:jumps], found[jumps:count]


WALL = shapely.box(2.0, -4.0, 2.2, 1.0)


def test_the_light_is_how_far_the_disc_can_go() -> None:
    ranges = scan(WALL)
    light, x, y = lit(ranges)
    points = shapely.MultiPoint(np.column_stack([x, y]))
    for k in range(0, HEADINGS, 5):
        direction = np.array([math.cos(ANGLES[k]), math.sin(ANGLES[k])])
        ahead = shapely.LineString([(0.0, 0.0), (light[k] - 1e-6) * direction])
        assert ahead.distance(points) >= RADIUS - 1e-6
        further = shapely.LineString([(0.0, 0.0), (light[k] + 0.01) * direction])
        beam = ranges[[2 * k, 2 * k + 1]].min()
        assert light[k] >= REACH or further.distance(points) < RADIUS or light[k] == pytest.approx(beam)


def test_a_robot_that_turns_has_the_same_light() -> None:
    ranges = scan(WALL)
    turn = 30  # beams, so that each sees what another saw
    turned, _, _ = lit(np.roll(ranges, -turn), heading=turn * 2.0 * math.pi / BEAMS)
    np.testing.assert_allclose(turned, lit(ranges)[0], atol=1e-9)


def test_behind_the_end_of_a_wall_there_is_a_door_and_nowhere_else() -> None:
    jumps, ends = doors_of(*lit(scan(WALL)))
    assert len(jumps) > 0
    light, x, y = lit(scan(WALL))
    points = shapely.MultiPoint(np.column_stack([x, y]))
    for vx, vy, qx, qy, room in jumps.tolist():
        assert math.hypot(vx, vy) <= light_toward(light, math.atan2(vy, vx), False) + 1e-9
        assert math.hypot(qx, qy) > light_toward(light, math.atan2(qy, qx), True)
        assert shapely.LineString([(vx, vy), (qx, qy)]).distance(points) == pytest.approx(room)
        assert math.dist((vx, vy), (qx, qy)) == pytest.approx(1.1 * RADIUS) and room >= 0.95 * RADIUS
    assert any(qy < 1.6 for _, vy, _, qy, _ in jumps.tolist() if vy > 0.0)
    for vx, vy, *_ in ends.tolist():
        assert math.hypot(vx, vy) == pytest.approx(REACH)


def test_in_a_room_without_an_exit_there_is_no_door() -> None:
    room = shapely.box(-3.0, -2.0, 2.0, 2.5).boundary.buffer(0.05)
    jumps, ends = doors_of(*lit(scan(room)))
    assert len(ends) == 0 and len(jumps) == 0


def test_a_room_with_an_exit_has_its_doors_there() -> None:
    room = shapely.box(-3.0, -2.0, 2.0, 2.5).boundary.buffer(0.05).difference(shapely.box(0.0, 2.0, 1.0, 3.0))
    jumps, ends = doors_of(*lit(scan(room)))
    assert len(jumps) + len(ends) > 0
    assert all(-0.5 < vx < 2.2 and vy > 2.0 for vx, vy, *_ in [*jumps.tolist(), *ends.tolist()])


def test_in_the_open_there_is_a_door_at_least_every_metre_and_a_half_of_the_horizon() -> None:
    light, x, y = lit(np.full(BEAMS, REACH))
    _, ends = doors_of(light, x, y)
    turns = np.sort(np.arctan2(ends[:, 1], ends[:, 0]))
    gaps = np.diff(np.append(turns, turns[0] + 2.0 * math.pi))
    assert REACH * gaps.max() <= 1.5
    np.testing.assert_allclose(np.hypot(ends[:, 2], ends[:, 3]), REACH + 1.1 * RADIUS)


def test_a_wall_met_at_a_small_angle_is_filled_in_and_two_walls_are_not_joined() -> None:
    px, py = np.array([1.0, 2.0, 4.0, 4.0]), np.array([1.0, 1.0, 1.0, -2.0])
    piece, still = np.array([0, 0, 0, 1]), np.array([True, True, False, True])
    x, y, is_still = np.empty(100), np.empty(100), np.empty(100, dtype=np.bool_)
    count = fill_walls(px, py, piece, still, 0.25, x, y, is_still)
    first = np.flatnonzero(y[:count] == 1.0)
    assert count == 4 + 8 + 1 + 1 and len(first) == 4 + 8 + 1
    np.testing.assert_allclose(np.diff(np.sort(x[first])), 0.25)
    # Between a point of a wall and one of a mover nothing is still.
    assert not is_still[:count][(x[:count] > 2.0) & (y[:count] == 1.0)].any()
    short = np.empty(5), np.empty(5), np.empty(5, dtype=np.bool_)
    assert fill_walls(px, py, piece, still, 0.25, *short) == 5


def test_right_behind_a_wall_is_known_and_behind_an_end_of_sight_is_not() -> None:
    light, _, _ = lit(scan(WALL))
    points = np.array([[2.0, 0.0], [2.6, 0.0], [-5.2, 0.0]])
    found = np.zeros(3, dtype=np.bool_)
    are_before_walls(np.zeros((1, 2)), light[None], points, REACH, 1.3 * RADIUS, found)
    np.testing.assert_array_equal(found, [True, False, False])


NEAR, JUMP, BEHIND = 1.5, 0.3, 0.5


@pytest.mark.parametrize("turn", [0, 1, 44, 137])
@pytest.mark.parametrize(
    ("wall", "place", "is_behind"),
    [
        (shapely.box(1.0, -6.0, 1.2, 6.0), 1.1, True),  # the disc stops 0.73 m away, and so much and 0.5 m is 1.23 m
        (shapely.box(1.0, -6.0, 1.2, 6.0), 1.2, True),
        (shapely.box(1.0, -6.0, 1.2, 6.0), 1.3, False),
        (shapely.box(2.0, -6.0, 2.2, 6.0), 2.1, False),  # it is farther off than 1.5 m
        (shapely.MultiPolygon([shapely.box(1.0, 0.4, 1.2, 6.0), shapely.box(1.0, -6.0, 1.2, -0.4)]), 1.2, False),
        (shapely.box(1.0, 0.2, 1.2, 6.0), 1.2, False),  # it ends there
    ],
)
def test_behind_a_wall_seen_from_nearby_is_known_unless_there_may_be_a_gap(
    wall: shapely.Geometry, place: float, is_behind: bool, turn: int
) -> None:
    light, _, _ = lit(scan(wall))
    angle = ANGLES[turn]
    node = np.array([[3.0, -2.0]])
    q = node + place * np.array([[math.cos(angle), math.sin(angle)]])
    found = np.zeros(1, dtype=np.bool_)
    are_behind_walls(node, np.roll(light, turn)[None], q, REACH, NEAR, JUMP, BEHIND, found)
    assert found[0] == is_behind


def test_one_node_that_has_seen_the_wall_is_enough_and_what_was_told_stays() -> None:
    seen, _, _ = lit(scan(shapely.box(1.0, -6.0, 1.2, 6.0)))
    places, lights = np.array([[0.0, 0.0], [0.0, 9.0]]), np.stack([seen, np.full(HEADINGS, REACH)])
    points = np.array([[1.1, 0.0], [1.1, 9.0], [-1.1, 0.0]])
    for order in ([0, 1], [1, 0]):
        found = np.array([False, False, True])
        are_behind_walls(places[order], lights[order], points, REACH, NEAR, JUMP, BEHIND, found)
        np.testing.assert_array_equal(found, [True, False, True])


@pytest.mark.parametrize("reach", [1.0, 1.5])
def test_where_sight_ends_nearby_there_is_no_wall(reach: float) -> None:
    found = np.zeros(1, dtype=np.bool_)
    light = np.full((1, HEADINGS), reach)
    are_behind_walls(np.zeros((1, 2)), light, np.array([[reach + 0.1, 0.0]]), reach, NEAR, JUMP, BEHIND, found)
    assert not found[0]
