"""Sampled futures of movers: as predicted until they turn, straight on afterwards, anywhere, left as likely as right."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.futures import COUNT, MOVERS, Futures, sample_futures

F64 = NDArray[np.float64]

SPACING, TIMES = 0.1, 30
WHEN = SPACING * np.arange(1, TIMES + 1)


def straight_on(position: F64, velocity: F64) -> F64:
    """Where movers go at a constant velocity (T, N, 2)."""
    return position[:, None] + WHEN[None, :, None] * velocity[:, None]


def futures(rate: float, *, many: int = MOVERS, seed: int = 0, first: int = 1) -> tuple[Futures, F64, F64]:
    """Futures of movers drawn at random, their velocities, and where they are predicted."""
    rng = np.random.default_rng(seed)
    position, velocity = rng.uniform(-3.0, 3.0, (many, 2)), rng.uniform(-1.0, 1.0, (many, 2))
    predicted = straight_on(position, velocity)
    radii = np.full((many, TIMES), 0.3)
    return (
        sample_futures(np.arange(first, first + many), position, velocity, predicted, radii, SPACING, rate),
        velocity,
        predicted,
    )


def turned(found: Futures, predicted: F64) -> NDArray[np.bool_]:
    """Whether a mover has left its predicted way (T, N, K)."""
    return np.hypot(found.x - predicted[:, :, :1], found.y - predicted[:, :, 1:]) > 1e-9


def test_who_never_turns_goes_as_predicted() -> None:
    found, _, predicted = futures(0.0)
    assert not turned(found, predicted).any()


def test_speeds_stay_and_nobody_turns_twice() -> None:
    found, velocity, _ = futures(2.0)
    places = np.stack([found.x, found.y], axis=-1)
    here = np.broadcast_to(found.position[:, None, None], (MOVERS, 1, COUNT, 2))
    before = here - SPACING * velocity[:, None, None]
    steps = np.diff(np.concatenate([before, here, places], axis=1), axis=1)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])[:, None, None]
    np.testing.assert_allclose(
        np.hypot(steps[..., 0], steps[..., 1]), SPACING * np.broadcast_to(speed, steps.shape[:3])
    )
    bends = np.hypot(*np.moveaxis(np.diff(steps, axis=1), -1, 0)) > 1e-9
    assert bends.sum(axis=1).max() == 1 and bends.any(axis=1).mean() > 0.95


@pytest.mark.parametrize("rate", [0.3, 1.0, 3.0])
def test_as_many_have_turned_as_the_rate_says(rate: float) -> None:
    found, _, predicted = futures(rate)
    share = turned(found, predicted).mean(axis=2)
    # A turn within a step shows at its end; times are spread over COUNT / 2 strata.
    late, soon = 1.0 - np.exp(-rate * (WHEN - SPACING)), 1.0 - np.exp(-rate * WHEN)
    assert (share >= late[None] - 2.0 / COUNT - 1e-9).all() and (share <= soon[None] + 2.0 / COUNT + 1e-9).all()


def test_it_turns_anywhere_and_left_as_often_as_right() -> None:
    found, velocity, _ = futures(100.0)  # all turn at once
    course = np.arctan2(np.diff(found.y[:, -2:], axis=1), np.diff(found.x[:, -2:], axis=1))[:, 0]
    turns = np.sort(
        np.mod(course - np.arctan2(velocity[:, 1], velocity[:, 0])[:, None] + math.pi, 2.0 * math.pi), axis=1
    )
    # Mirror images: the headings of a half are evenly spread, and so are those of the other one.
    np.testing.assert_allclose(turns + turns[:, ::-1], 2.0 * math.pi)
    assert np.diff(turns, axis=1).max() <= 4.0 * math.pi / COUNT + 1e-9


def test_every_second_future_is_the_mirror_image_of_the_one_before() -> None:
    found, velocity, predicted = futures(1.0)
    course = np.arctan2(velocity[:, 1], velocity[:, 0])[:, None, None]
    start = predicted[:, 0] - SPACING * velocity
    dx, dy = found.x - start[:, None, :1], found.y - start[:, None, 1:]
    along, beside = np.cos(course) * dx + np.sin(course) * dy, np.cos(course) * dy - np.sin(course) * dx
    np.testing.assert_allclose(along[..., ::2], along[..., 1::2], atol=1e-9)
    np.testing.assert_allclose(beside[..., ::2], -beside[..., 1::2], atol=1e-9)


def test_a_mover_keeps_its_ways_of_turning_and_others_have_their_own() -> None:
    one, velocity, _ = futures(1.0, many=2)
    same, *_ = futures(1.0, many=2)
    np.testing.assert_array_equal(one.x, same.x)
    renumbered, *_ = futures(1.0, many=2, first=2)
    assert not np.array_equal(one.x[0], renumbered.x[0])


def test_nobody_is_farther_than_its_reach() -> None:
    found, *_ = futures(1.0)
    far = np.hypot(found.x - found.position[:, :1, None], found.y - found.position[:, 1:, None])
    np.testing.assert_allclose(far.max(axis=2), found.reach)
