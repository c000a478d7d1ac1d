"""Predictors: closed forms on tracks made by hand, and the table of names."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.prediction import PREDICTORS, make_predictor, predictor_names
from bug_gym.agents.prediction.plain import last_velocities
from bug_gym.agents.prediction.predictor import Prediction
from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.config import load
from bug_gym.view import Sensors

F64 = NDArray[np.float64]

SENSORS = Sensors.of(load("dynamic"))
TIMES = np.array([0.0, 0.8, 1.6, 3.2, 4.8])
PLAIN = ("none", "constant_velocity", "kalman")


def tracks_of(
    position: F64, velocity: F64, *, moving: bool | NDArray[np.bool_] = True, unseen: float = 0.0, history: int = 16
) -> Tracks:
    """Tracks that have gone straight for `history` measurements of 0.1 s."""
    count = len(position)
    times = 0.1 * np.arange(1 - history, 1)
    p = np.diag([0.01, 0.01, 0.04, 0.04])
    p[0, 2] = p[2, 0] = p[1, 3] = p[3, 1] = 0.005
    seen = position - unseen * velocity
    return Tracks(
        id=np.arange(1, count + 1),
        position=position,
        velocity=velocity,
        radius=np.full(count, 0.3),
        covariance=np.tile(p, (count, 1, 1)),
        centre=np.tile(p[:2, :2], (count, 1, 1)),
        moving=np.broadcast_to(np.asarray(moving), (count,)).copy(),
        age=np.full(count, 2.0),
        unseen=np.full(count, unseen),
        innovation=np.ones(count),
        history=seen[:, None] + velocity[:, None] * times[:, None],
        history_times=np.tile(10.0 + times - unseen, (count, 1)),
        beam_track=np.full(len(SENSORS.angles), -1),
        ranges=np.full(len(SENSORS.angles), SENSORS.range),
        pose=(0.0, 0.0, 0.0),
    )


POSITION = np.array([[1.0, 2.0], [-3.0, 0.5], [2.0, -2.0]])
VELOCITY = np.array([[0.5, 0.0], [-0.3, 0.4], [0.0, -1.0]])


def predict(name: str, tracks: Tracks) -> Prediction:
    """What a predictor says of tracks at TIMES."""
    return make_predictor(name, SENSORS).predict(tracks, TIMES)


def test_without_prediction_things_stay() -> None:
    places = predict("none", tracks_of(POSITION, VELOCITY)).places
    assert np.array_equal(places, np.repeat(POSITION[:, None], len(TIMES), axis=1))


@pytest.mark.parametrize("name", ["constant_velocity", "kalman"])
@pytest.mark.parametrize("unseen", [0.0, 0.3])
def test_what_goes_straight_is_predicted_to_go_on(name: str, unseen: float) -> None:
    places = predict(name, tracks_of(POSITION, VELOCITY, unseen=unseen)).places
    assert places == pytest.approx(POSITION[:, None] + VELOCITY[:, None] * TIMES[:, None])


@pytest.mark.parametrize(("unseen", "by_centres"), [(0.4, True), (0.6, False)])
def test_what_is_hidden_for_longer_than_half_a_second_goes_on_as_the_filter_says(
    unseen: float, by_centres: bool
) -> None:
    """Its last centres are old then; the filter says here that it has turned round."""
    tracks = tracks_of(POSITION, VELOCITY, unseen=unseen)._replace(velocity=-VELOCITY)
    places = predict("constant_velocity", tracks).places
    assert places == pytest.approx(
        POSITION[:, None] + (VELOCITY if by_centres else -VELOCITY)[:, None] * TIMES[:, None]
    )


@pytest.mark.parametrize("name", PLAIN)
def test_still_things_are_predicted_to_stay(name: str) -> None:
    places = predict(name, tracks_of(POSITION, VELOCITY, moving=False)).places
    assert np.array_equal(places, np.repeat(POSITION[:, None], len(TIMES), axis=1))


@pytest.mark.parametrize("name", PLAIN)
def test_still_things_are_later_as_sure_as_they_are_now(name: str) -> None:
    spread = predict(name, tracks_of(POSITION, VELOCITY, moving=False)).spread
    assert spread == pytest.approx(np.full((len(POSITION), len(TIMES)), 0.1))


@pytest.mark.parametrize("name", PREDICTORS)
def test_every_predictor_says_where_each_track_will_be_and_how_surely(name: str) -> None:
    places, spread = predict(name, tracks_of(POSITION, VELOCITY))
    assert places.shape == (3, len(TIMES), 2) and spread.shape == (3, len(TIMES))
    assert np.isfinite(places).all() and (spread > 0.0).all()
    assert (np.diff(spread, axis=1) >= 0.0).all()


@pytest.mark.parametrize("name", PREDICTORS)
def test_no_tracks_give_no_predictions(name: str) -> None:
    places, spread = predict(name, tracks_of(np.zeros((0, 2)), np.zeros((0, 2))))
    assert places.shape == (0, len(TIMES), 2) and spread.shape == (0, len(TIMES))


@pytest.mark.parametrize("name", PREDICTORS)
def test_a_track_is_predicted_whatever_the_others_are(name: str) -> None:
    whole = tracks_of(POSITION, VELOCITY, moving=np.array([True, False, True]))
    places = predict(name, whole).places
    for index in range(3):
        alone = predict(name, whole.select(np.array([index]))).places
        assert alone[0] == pytest.approx(places[index], abs=1e-5)


def test_the_kalman_filters_spread_is_its_covariance_carried_on() -> None:
    spread = predict("kalman", tracks_of(POSITION[:1], VELOCITY[:1])).spread[0]
    assert spread[0] == pytest.approx(0.1)
    # p + 2 t c + t^2 v, and an acceleration of 0.3 m/s^2
    t = TIMES[1]
    assert spread[1] ** 2 == pytest.approx(0.01 + 0.01 * t + 0.04 * t**2 + 0.25 * 0.09 * t**4)


def test_the_spread_at_constant_velocity_is_that_of_the_two_centres_that_tell_it() -> None:
    """A velocity from two places w apart, with a variance p each, has 2 p / w^2; after t it adds t^2 of that to p."""
    tracks = tracks_of(POSITION[:2], VELOCITY[:2], moving=np.array([True, False]))
    moving, still = predict("constant_velocity", tracks).spread
    p, w = 0.01, 0.5
    assert moving**2 == pytest.approx(p + TIMES**2 * (2.0 * p / w**2))
    assert still**2 == pytest.approx(np.full(len(TIMES), p))


def test_the_last_velocity_is_that_of_the_last_half_second() -> None:
    tracks = tracks_of(POSITION, VELOCITY)
    turned = tracks.history.copy()
    turned[:, :-6] += 5.0  # what was before counts no more
    velocity, between = last_velocities(tracks._replace(history=turned))
    assert velocity == pytest.approx(VELOCITY) and between == pytest.approx(np.full(3, 0.5))


def test_a_track_measured_once_has_no_last_velocity() -> None:
    tracks = tracks_of(POSITION, VELOCITY)
    once = tracks._replace(history=np.repeat(POSITION[:, None], 16, axis=1), history_times=np.full((3, 16), 10.0))
    velocity, between = last_velocities(once)
    assert (velocity == 0.0).all() and (between == 0.0).all()


def test_an_unknown_predictor_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"did you mean 'kalman'\? \(known: none, constant_velocity, kalman"):
        make_predictor("kalmann", SENSORS)


def test_the_plain_predictors_are_in_the_table() -> None:
    assert set(PLAIN) <= set(predictor_names())
