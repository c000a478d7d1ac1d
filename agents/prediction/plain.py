"""The plain predictors: things stay, go on as they last went, or go on as the tracker's Kalman filter says.

Nothing is learnt here. They are what learned predictors are measured against; the spread of the filter's prediction is
its covariance carried on at constant velocity (Bar-Shalom, Li and Kirubarajan 2001).
"""

from __future__ import annotations

import numpy as np

from bug_gym.agents.prediction.predictor import Prediction, place_deviation
from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import F64
from bug_gym.view import Sensors

WINDOW = 0.5
"""Time between the two centres whose difference is a velocity [s]."""
ACCELERATION = 0.3
"""Acceleration that a mover may take, one standard deviation of each component [m/s^2]."""


def last_velocities(tracks: Tracks, window: float = WINDOW) -> tuple[F64, F64]:
    """Velocities (T, 2) [m/s] from the last measured centre and one a window before it, and the time between (T,) [s].

    A track that was measured once has none: 0.
    """
    times = tracks.history_times
    if len(times) == 0:
        return np.zeros((0, 2)), np.zeros(0)
    passed = times[:, -1:] - times
    # The youngest that is a window old; the oldest where none is.
    before = np.maximum((passed >= window - 1e-9).sum(axis=1) - 1, 0)
    rows = np.arange(len(times))
    between = passed[rows, before]
    way = tracks.history[:, -1] - tracks.history[rows, before]
    return way / np.maximum(between, 1e-9)[:, None], between


class NoPrediction:
    """Things stay where they are."""

    def __init__(self, sensors: Sensors) -> None:
        pass

    def predict(self, tracks: Tracks, times: F64) -> Prediction:
        """The places of now."""
        places = np.repeat(tracks.position[:, None], len(times), axis=1)
        return Prediction(places, np.repeat(place_deviation(tracks)[:, None], len(times), axis=1))


class ConstantVelocity:
    """Movers go on as their last measured centres went: no filter."""

    def __init__(self, sensors: Sensors) -> None:
        pass

    def predict(self, tracks: Tracks, times: F64) -> Prediction:
        """The last centre and the velocity of the last half second."""
        velocity, between = last_velocities(tracks)
        moving = tracks.moving & (tracks.unseen <= WINDOW)
        velocity = np.where(moving[:, None], velocity, tracks.velocity * tracks.moving[:, None])
        last = np.where(moving[:, None], tracks.history[:, -1] + velocity * tracks.unseen[:, None], tracks.position)
        places = last[:, None] + velocity[:, None] * times[:, None]
        share = times / np.maximum(between, WINDOW)[:, None]
        spread = place_deviation(tracks)[:, None] * np.sqrt(1.0 + 2.0 * share * share * tracks.moving[:, None])
        return Prediction(places, spread)


class Kalman:
    """Movers go on at the velocity that the tracker's Kalman filter gives them."""

    def __init__(self, sensors: Sensors) -> None:
        pass

    def predict(self, tracks: Tracks, times: F64) -> Prediction:
        """The filter's place and velocity, with its covariance carried on."""
        moving = tracks.moving[:, None]
        places = tracks.position[:, None] + (tracks.velocity * moving)[:, None] * times[:, None]
        p = tracks.covariance
        place = 0.5 * (p[:, 0, 0] + p[:, 1, 1])[:, None]
        cross = 0.5 * (p[:, 0, 2] + p[:, 1, 3])[:, None]
        speed = 0.5 * (p[:, 2, 2] + p[:, 3, 3])[:, None]
        grown = 2.0 * times * cross + times**2 * speed + 0.25 * ACCELERATION**2 * times**4
        return Prediction(places, np.sqrt(np.maximum(place + grown * moving, 0.0)))
