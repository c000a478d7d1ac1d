"""The tracker's Kalman filter against its matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from compiled import for_python
from tracked import world_of

from bug_gym.agents.tracking import filter as kalman
from bug_gym.agents.tracking import told
from bug_gym.agents.tracking.discs import LEAST_SHAPE
from bug_gym.agents.tracking.layout import (
    FIT,
    FX,
    FY,
    HISTORY,
    ID,
    IS_MOVING,
    NUMBERS,
    RADIUS_VARIANCE,
    SHAPE_VARIANCE,
    STATE,
    VX,
    VY,
    ZXX,
    ZXY,
    ZYY,
    X,
    Y,
)
from bug_gym.agents.tracking.told import COVARIANCE
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.config import load
from bug_gym.view import Sensors

predict_tracks = for_python(kalman.predict_tracks)
gain = for_python(kalman.gain)
measure = for_python(kalman.measure)
write_centre = for_python(told.write_centre)
MEAN = [X, Y, VX, VY]
H = np.eye(2, 4)
"""What is measured of a track: its place."""


def some_track(rng: np.random.Generator) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The state of a track with any mean and covariance."""
    state, root = np.zeros(STATE), rng.normal(0.0, 0.3, (4, 4))
    state[MEAN], state[np.array(COVARIANCE)] = rng.normal(0.0, 2.0, 4), root @ root.T + 0.01 * np.eye(4)
    return state


def some_noise(rng: np.random.Generator) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The covariance (2, 2) of a measurement."""
    root = rng.normal(0.0, 0.1, (2, 2))
    noise: np.ndarray[Any, np.dtype[np.float64]] = root @ root.T + 0.001 * np.eye(2)
    return noise


@pytest.mark.parametrize("dt", [0.1, 0.7])
def test_a_prediction_carries_the_covariance_on_by_f_p_ft_and_the_noise_of_an_acceleration(dt: float) -> None:
    """At constant velocity, with an acceleration of 0.4 m/s^2 that lasts for the step: place dt^2 / 2, velocity dt of it."""
    rng = np.random.default_rng(0)
    memory = Tracker(Sensors.of(load(world_of([])))).start().arrays()
    before = np.zeros((3, 4, 4))
    means = rng.normal(0.0, 2.0, (3, 4))
    for m in range(3):
        root = rng.normal(0.0, 0.3, (4, 4))
        before[m] = root @ root.T
        memory.numbers[m, ID] = m + 1
        memory.state[m, [X, Y, VX, VY]] = means[m]
        memory.state[m, COVARIANCE] = before[m]
    predict_tracks(memory, dt)
    f = np.array([[1.0, 0.0, dt, 0.0], [0.0, 1.0, 0.0, dt], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    g = np.array([[0.5 * dt * dt, 0.0], [0.0, 0.5 * dt * dt], [dt, 0.0], [0.0, dt]])
    for m in range(3):
        np.testing.assert_allclose(memory.state[m, [X, Y, VX, VY]], f @ means[m], atol=1e-12)
        np.testing.assert_allclose(memory.state[m, COVARIANCE], f @ before[m] @ f.T + 0.4**2 * g @ g.T, atol=1e-12)
    assert not memory.state[3:].any()  # where there is no track nothing is carried on


def test_a_measured_place_moves_a_track_by_kalmans_gain() -> None:
    """K = P H^T (H P H^T + R)^-1; the mean goes on by K (z - H x), and of the covariance (I - K H) P is left."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        state, noise, place = some_track(rng), some_noise(rng), rng.normal(0.0, 2.0, 2)
        mean, covariance = state[MEAN].copy(), state[np.array(COVARIANCE)].copy()
        gain(state, place[0], place[1], noise[0, 0], noise[0, 1], noise[1, 1])
        k = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + noise)
        np.testing.assert_allclose(state[MEAN], mean + k @ (place - H @ mean), atol=1e-9)
        np.testing.assert_allclose(state[np.array(COVARIANCE)], (np.eye(4) - k @ H) @ covariance, atol=1e-9)


@pytest.mark.parametrize("moves", [True, False])
@pytest.mark.parametrize("share", [0.9, 4.0])
def test_beyond_the_gate_a_mover_has_swerved_and_of_a_still_thing_another_side_has_come_into_view(
    share: float, moves: bool
) -> None:
    """Then the mover's place and velocity are less sure, and the still thing's measurement is; `share` is of the gate."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        state, noise = some_track(rng), some_noise(rng)
        expected, fit, numbers = state.copy(), np.zeros(FIT), np.zeros(NUMBERS, dtype=np.int64)
        fit[[ZXX, ZXY, ZYY]], numbers[IS_MOVING] = noise[[0, 0, 1], [0, 1, 1]], moves
        spread = H @ state[np.array(COVARIANCE)] @ H.T + noise
        off = np.linalg.cholesky(spread) @ [math.sqrt(share * kalman.GATE), 0.0]
        fit[[FX, FY]] = state[[X, Y]] + off
        history = np.zeros((HISTORY, 3))
        measure(state, numbers, fit, history, 0.0, 0.0, 1.0)
        if share > 1.0 and moves:
            wider = np.diag([kalman.SWERVE_PLACE**2] * 2 + [kalman.SWERVE**2] * 2)
            expected[np.array(COVARIANCE)] += wider
        elif share > 1.0:
            noise *= share
        gain(expected, fit[FX], fit[FY], noise[0, 0], noise[0, 1], noise[1, 1])
        columns = [*MEAN, *np.array(COVARIANCE).ravel()]
        np.testing.assert_allclose(state[columns], expected[columns], atol=1e-9)
        assert history[0].tolist() == [fit[FX], fit[FY], 1.0]


@pytest.mark.parametrize("bearing", [0.0, 0.5, 2.0, -1.3])
def test_a_centre_is_as_unsure_as_its_side_its_size_along_the_line_of_sight_and_its_outline(bearing: float) -> None:
    """Seen from the robot: the filter's covariance turned there, and two variances on the diagonal."""
    rng = np.random.default_rng(0)
    state, robot = some_track(rng), rng.normal(0.0, 3.0, 2)
    away, aside = np.array([math.cos(bearing), math.sin(bearing)]), np.array([-math.sin(bearing), math.cos(bearing)])
    state[[X, Y]] = robot + 2.5 * away
    seen_so = np.column_stack([away, aside])

    def added(size: float, shape: float, ends: int) -> np.ndarray[Any, np.dtype[np.float64]]:
        state[RADIUS_VARIANCE], state[SHAPE_VARIANCE] = size**2, LEAST_SHAPE**2 + shape**2
        centre = np.empty((2, 2))
        write_centre(state, ends, float(robot[0]), float(robot[1]), centre)
        turned: np.ndarray[Any, np.dtype[np.float64]] = (
            seen_so.T @ (centre - state[np.array(COVARIANCE)][:2, :2]) @ seen_so
        )
        return turned

    moves, deep, wide, hidden = told.RADIUS_MOVES, told.OUTLINE_DEEP, told.OUTLINE_WIDE, told.UNSEEN_END
    assert added(0.0, 0.0, 2) == pytest.approx(np.zeros((2, 2)), abs=1e-12)
    assert added(0.2, 0.0, 2) == pytest.approx(np.diag([(moves * 0.2) ** 2, 0.0]), abs=1e-12)
    assert added(0.0, 0.1, 2) == pytest.approx(np.diag([(deep * 0.1) ** 2, (wide * 0.1) ** 2]), abs=1e-12)
    for ends in (0, 1):
        assert added(0.0, 0.0, ends) == pytest.approx(hidden**2 * np.eye(2), abs=1e-12)
