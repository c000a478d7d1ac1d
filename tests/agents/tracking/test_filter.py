"""The tracker's Kalman filter against its matrices."""

from __future__ import annotations

import numpy as np
import pytest
from compiled import for_python
from tracked import world_of

from bug_gym.agents.tracking import filter as kalman
from bug_gym.agents.tracking.layout import ID, VX, VY, X, Y
from bug_gym.agents.tracking.told import COVARIANCE
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.config import load
from bug_gym.view import Sensors

predict_tracks = for_python(kalman.predict_tracks)


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
