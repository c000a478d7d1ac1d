"""What the light area of a scan may claim: no more than the beams beside a heading saw, and nothing where none look."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bug_gym.agents.hd_bug.light import ANGLES, HEADINGS, are_before_walls, are_in_sight, fill_walls, measure_light

REACH = 5.0
NOTHING = np.empty(0)


@pytest.mark.parametrize("beams", [180, 90, 64, 7])
def test_the_light_is_no_longer_than_either_of_the_beams_beside_its_heading(beams: int) -> None:
    """No points are given, so that nothing else bounds it."""
    ranges, heading = np.random.default_rng(beams).uniform(1.0, REACH, beams), 0.0123
    apart, light = 2.0 * math.pi / beams, np.empty(HEADINGS)
    first = -0.7
    measure_light(NOTHING, NOTHING, ranges, first, apart, heading, 0.2, REACH, light)
    bearings = first + apart * np.arange(beams)
    off = np.abs(np.remainder(bearings - (ANGLES[:, None] - heading) + math.pi, 2.0 * math.pi) - math.pi)
    beside = np.argsort(off, axis=1)[:, :2]
    np.testing.assert_array_equal(light, ranges[beside].min(axis=1))


@pytest.mark.parametrize("heading", [0.0, 2.5])
@pytest.mark.parametrize("width", [0.5 * math.pi, 1.5 * math.pi])
def test_where_no_beam_looks_it_is_dark(width: float, heading: float) -> None:
    bearings = np.linspace(-0.5 * width, 0.5 * width, 60)
    apart, light = float(bearings[1] - bearings[0]), np.empty(HEADINGS)
    measure_light(NOTHING, NOTHING, np.full(60, REACH), -0.5 * width, apart, heading, 0.2, REACH, light)
    off = np.abs(np.remainder(ANGLES - heading + math.pi, 2.0 * math.pi) - math.pi)
    assert (light[off < 0.5 * width - 1e-6] == REACH).all() and (light[off > 0.5 * width + 1e-6] == 0.0).all()


def test_the_gap_between_the_last_beam_and_the_first_is_filled_as_well() -> None:
    """What neither of its two neighbours moves is still."""
    px, py = np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, 1.0])
    x, y, still = np.empty(50), np.empty(50), np.empty(50, dtype=np.bool_)
    flags = np.array([True, True, False])
    count = fill_walls(px, py, np.zeros(3, dtype=np.int64), flags, 0.25, x, y, still)
    between = (np.abs(x[:count] - y[:count]) < 1e-9) & (x[:count] > 0.0) & (x[:count] < 1.0)
    assert between.sum() == 5  # 1.41 m in six parts
    moves = (x[:count] == 1.0) & (y[:count] > 0.0) | between
    np.testing.assert_array_equal(still[:count], ~moves)


def test_one_of_two_that_sees_the_other_is_enough_for_a_way() -> None:
    """One is at (1, 1), the others 2 m away from it to all four sides; two of them look that far to where it is."""
    turns = np.arange(4) * 0.5 * math.pi
    places = np.concatenate([[[1.0, 1.0]], [1.0, 1.0] + 2.0 * np.column_stack([np.cos(turns), np.sin(turns)])])
    lights = np.full((5, HEADINGS), 0.1)
    ahead, back = np.cos(ANGLES) > 0.9, np.cos(ANGLES) < -0.9
    lights[0, np.sin(ANGLES) > 0.9] = 2.1  # it sees the one to the left
    lights[1, back], lights[3, back] = 2.1, 2.1  # the one ahead sees it, the one behind looks away from it
    lights[4, ahead] = 2.1
    result = np.zeros(5, dtype=np.bool_)
    are_in_sight(places, lights, 0, result)
    np.testing.assert_array_equal(result, [True, True, True, False, False])


def test_an_end_of_sight_is_no_wall() -> None:
    light = np.where(np.cos(ANGLES) > 0.0, REACH, 2.0)
    points, found = np.array([[REACH + 0.1, 0.0], [-2.1, 0.0], [-2.5, 0.0]]), np.zeros(3, dtype=np.bool_)
    are_before_walls(np.zeros((1, 2)), light[None], points, REACH, 0.3, found)
    np.testing.assert_array_equal(found, [False, True, False])
