"""The ladder of detection radii (eq. 6, Table 1)."""

from __future__ import annotations

import numpy as np
import pytest

from bug_gym.agents.hd_bug.ladder import Ladder


def test_three_dense_steps_enlarge_the_detection_radius_and_two_do_not() -> None:
    ladder = Ladder()
    climbed = []
    for density in (0.9, 0.9, 0.2, 0.9, 0.9, 0.9):
        ladder.update(density)
        climbed.append(ladder.k)
    assert climbed == [2, 2, 2, 2, 2, 3]


def test_ten_sparse_steps_reduce_the_detection_radius() -> None:
    ladder = Ladder()
    ks = []
    for _ in range(20):
        ladder.update(0.0)
        ks.append(ladder.k)
    assert ks == [2] * 9 + [1] * 10 + [0]


@pytest.mark.parametrize(("density", "end"), [(0.1499, 0), (0.15, 2), (0.4, 2), (0.4001, 3)])
def test_it_is_dense_above_two_fifths_of_short_beams_and_sparse_below_15_percent(density: float, end: int) -> None:
    ladder = Ladder()
    for _ in range(20):
        ladder.update(density)
    assert ladder.k == end


def test_the_ladder_has_four_rungs() -> None:
    for density, end in ((1.0, 3), (0.0, 0)):
        ladder = Ladder()
        for _ in range(100):
            ladder.update(density)
        assert ladder.k == end


@pytest.mark.parametrize("seed", range(3))
def test_it_goes_rung_by_rung_among_four(seed: int) -> None:
    ladder = Ladder()
    rungs = [ladder.k]
    for density in np.repeat(np.random.default_rng(seed).choice([0.05, 0.3, 0.9], 200), 7):
        ladder.update(float(density))
        rungs.append(ladder.k)
    assert set(np.diff(rungs)) == {-1, 0, 1} and 0 <= min(rungs) < max(rungs) <= 3
