"""Ranges that a beam alone missed are filled in where they are of a wall, and nowhere else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bug_gym.agents.scan.open_ways import fill_in
from bug_gym.geometry import F64

REACH = 5.0


def filled(ranges: F64, spacing: float, *, error: float = 1e-9, gap: float = 1e-9, wraps: bool = False) -> F64:
    """What `fill_in` makes of a scan."""
    result = np.empty_like(ranges)
    fill_in(ranges, REACH, spacing, error, gap, wraps, result)
    return result


def wall(rng: np.random.Generator) -> tuple[F64, float]:
    """Ranges of a straight wall that all beams of a scanner meet, and their spacing [rad]."""
    beams = int(rng.integers(20, 90))
    angles = np.linspace(-1.0, 1.0, beams)
    return rng.uniform(0.3, 2.0) / np.cos(angles + rng.uniform(-0.1, 0.1)), float(angles[1] - angles[0])


def test_a_beam_that_alone_missed_a_straight_wall_has_the_range_that_it_would_have_had() -> None:
    rng = np.random.default_rng(0)
    for _ in range(500):
        true, spacing = wall(rng)
        seen, missed = true.copy(), rng.choice(np.arange(2, len(true) - 2, 3))
        seen[missed] = REACH
        np.testing.assert_allclose(filled(seen, spacing), true, rtol=1e-9)


@pytest.mark.parametrize("missed", [0, 1, -2, -1])
def test_at_the_ends_of_a_scanner_that_does_not_look_all_round_no_line_is_known(missed: int) -> None:
    true, spacing = wall(np.random.default_rng(1))
    true[missed] = REACH
    np.testing.assert_array_equal(filled(true, spacing), true)


@pytest.mark.parametrize("shift", [0, 1, -1, -2])
def test_a_line_over_the_ends_counts_all_round_only(shift: int) -> None:
    spacing, ranges = 0.1, np.full(30, 3.0)
    line = 1.0 / np.cos(spacing * np.arange(-2.0, 3.0) + 0.3)
    true = line[2]
    line[2] = REACH
    ranges[np.arange(shift - 2, shift + 3) % 30] = line  # the one in the middle missed the wall
    assert filled(ranges, spacing)[shift] == REACH
    assert filled(ranges, spacing, wraps=True)[shift] == pytest.approx(true)


def test_all_round_the_last_beam_is_the_first_ones_neighbour() -> None:
    ranges = np.full(36, 1.0)
    ranges[0] = REACH
    spacing = 2.0 * math.pi / 36
    apart = 2.0 * math.sin(spacing)
    assert filled(ranges, spacing, gap=1.01 * apart, wraps=True)[0] == pytest.approx(math.cos(spacing))
    assert filled(ranges, spacing, gap=1.01 * apart)[0] == REACH


def test_between_two_posts_it_is_open_if_a_disc_passes_and_filled_in_if_none_does() -> None:
    rng = np.random.default_rng(2)
    for _ in range(500):
        left, right, spacing = rng.uniform(0.3, 3.0), rng.uniform(0.3, 3.0), rng.uniform(0.02, 0.3)
        ranges = np.full(9, REACH)
        ranges[3], ranges[5] = right, left
        apart = math.sqrt(left**2 + right**2 - 2.0 * left * right * math.cos(2.0 * spacing))
        assert filled(ranges, spacing, gap=0.999 * apart)[4] == REACH
        between = filled(ranges, spacing, gap=1.001 * apart)[4]
        # on the straight line from the one to the other
        aside = np.array([math.cos(spacing), math.sin(spacing)])
        one, other = right * aside * (1.0, -1.0), left * aside
        across = (other[0] - one[0]) * (0.0 - one[1]) - (other[1] - one[1]) * (between - one[0])
        assert abs(across) < 1e-9


def test_two_beams_that_missed_side_by_side_are_left_open() -> None:
    true, spacing = wall(np.random.default_rng(3))
    true[7:9] = REACH
    np.testing.assert_array_equal(filled(true, spacing, error=10.0, gap=10.0), true)
