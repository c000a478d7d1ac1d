"""What a predictor is and what it answers: what HD-BUG and the map planner ask, and plain and learned ones have.

It knows the tracks of one robot and nothing else; what it says is a place and a spread for each track and time.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import F64


class Prediction(NamedTuple):
    """Where T tracks will be at K times; in the odometry frame."""

    places: F64
    """Centres (T, K, 2) [m]."""
    spread: F64
    """Standard deviation of each coordinate (T, K), of the side that faces the robot: `Tracks.covariance` carried on [m]."""


class Predictor(Protocol):
    """What they ask of a predictor."""

    def predict(self, tracks: Tracks, times: F64) -> Prediction:
        """Where the tracks will be `times` (K,) [s] from now, none of them negative."""
        ...


def place_deviation(tracks: Tracks) -> F64:
    """Standard deviation of each coordinate of the places (T,), the radius as it is said [m]."""
    deviation: F64 = np.sqrt(0.5 * (tracks.covariance[:, 0, 0] + tracks.covariance[:, 1, 1]))
    return deviation
