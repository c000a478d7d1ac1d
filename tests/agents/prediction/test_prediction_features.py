"""What a learned predictor is told, and what its answers mean: inverses, symmetries, closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.prediction.features import (
    ANSWERS,
    HEADINGS,
    HORIZONS,
    KALMAN_ERRORS,
    LAGS,
    OWN,
    SECTORS,
    TO_ROBOT,
    TOP_SPEED,
    WIDTH,
    answers_for,
    cost_of,
    decode,
    encode,
    errors_of,
    mirrored_answers,
    mirrored_features,
)
from bug_gym.agents.tracking.tracker import Tracks

F64 = NDArray[np.float64]

BEAMS = 72
ANGLES = 2.0 * np.pi * np.arange(BEAMS) / BEAMS
RANGE = 6.0
SECTORS_AT = OWN + 2 * len(LAGS) + TO_ROBOT
HEADINGS_AT = SECTORS_AT + SECTORS
TOUCH_AT = HEADINGS_AT + len(HEADINGS)


def tracks_of(
    position: F64, velocity: F64, pose: tuple[float, float, float] = (0.0, 0.0, 0.0), ranges: F64 | None = None
) -> Tracks:
    """Movers that have gone straight, seen from a pose; a scan of nothing unless ranges are given."""
    count = len(position)
    times = 0.1 * np.arange(-31, 1)
    return Tracks(
        id=np.arange(1, count + 1),
        position=position,
        velocity=velocity,
        radius=np.full(count, 0.4),
        covariance=np.tile(np.diag([0.01, 0.01, 0.04, 0.04]), (count, 1, 1)),
        centre=np.tile(np.diag([0.01, 0.01]), (count, 1, 1)),
        moving=np.ones(count, dtype=np.bool_),
        age=np.full(count, 2.0),
        unseen=np.zeros(count),
        innovation=np.ones(count),
        history=position[:, None] + velocity[:, None] * times[:, None],
        history_times=np.tile(times, (count, 1)),
        beam_track=np.full(BEAMS, -1),
        ranges=np.full(BEAMS, RANGE) if ranges is None else ranges,
        pose=pose,
    )


def some_tracks(seed: int = 0) -> Tracks:
    """Movers and a scan at random."""
    rng = np.random.default_rng(seed)
    return tracks_of(
        rng.uniform(-4.0, 4.0, (5, 2)), rng.uniform(-1.0, 1.0, (5, 2)), (0.5, -0.3, 0.7), rng.uniform(0.5, RANGE, BEAMS)
    )


def test_an_answer_of_zero_is_the_filters_prediction() -> None:
    tracks, times = some_tracks(), np.linspace(0.0, 6.0, 13)
    places = decode(np.zeros((5, ANSWERS)), tracks, times)
    assert places == pytest.approx(tracks.position[:, None] + tracks.velocity[:, None] * times[:, None])


def test_the_right_answers_stand_for_the_places_asked() -> None:
    tracks = some_tracks()
    places = np.random.default_rng(1).uniform(-5.0, 5.0, (5, len(HORIZONS), 2))
    assert decode(answers_for(places, tracks), tracks, HORIZONS) == pytest.approx(places)


def test_between_the_horizons_a_prediction_lies_between() -> None:
    tracks = tracks_of(np.zeros((1, 2)), np.array([[1.0, 0.0]]))
    answers = np.zeros((1, ANSWERS))
    answers[0, 1::2] = [0.0, 0.2, 0.2, 0.2]  # to the left, by 0.3 m/s from 1.6 s on
    places = decode(answers, tracks, np.array([1.2, 2.4, 6.0]))
    assert places[0] == pytest.approx(np.array([[1.2, 0.15 * 1.2], [2.4, 0.3 * 2.4], [6.0, 0.3 * 6.0]]))


def test_errors_are_the_distances_of_the_places() -> None:
    tracks, rng = some_tracks(), np.random.default_rng(2)
    given, right = rng.uniform(-1.0, 1.0, (2, 5, ANSWERS))
    gaps = decode(given, tracks, HORIZONS) - decode(right, tracks, HORIZONS)
    assert errors_of(given, right) == pytest.approx(np.hypot(gaps[..., 0], gaps[..., 1]))


def test_answers_are_cut_to_their_bounds() -> None:
    right = np.zeros((1, ANSWERS))
    assert np.array_equal(errors_of(right + 5.0, right), errors_of(right + 1.0, right))
    assert errors_of(right + [5.0, 0.0] * len(HORIZONS), right)[0] == pytest.approx(TOP_SPEED * HORIZONS)


def test_a_prediction_as_good_as_the_filter_on_the_average_costs_one() -> None:
    assert cost_of(KALMAN_ERRORS[None]) == pytest.approx([1.0])


def test_what_is_told_is_the_same_wherever_the_world_lies() -> None:
    plain, (x, y, angle) = some_tracks(), (3.0, -5.0, 2.0)
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    px, py = np.array(plain.pose[:2]) @ turn + [x, y]
    moved = plain._replace(
        position=plain.position @ turn + [x, y],
        velocity=plain.velocity @ turn,
        history=plain.history @ turn + [x, y],
        pose=(float(px), float(py), plain.pose[2] + angle),
    )
    assert encode(moved, ANGLES, RANGE) == pytest.approx(encode(plain, ANGLES, RANGE), abs=1e-5)


def test_a_mirrored_world_is_told_as_the_mirror_image() -> None:
    plain, mirror = some_tracks(), np.array([1.0, -1.0])
    moved = plain._replace(
        position=plain.position * mirror,
        velocity=plain.velocity * mirror,
        history=plain.history * mirror,
        ranges=np.roll(plain.ranges[::-1], 1),
        pose=(plain.pose[0], -plain.pose[1], -plain.pose[2]),
    )
    features = encode(plain, ANGLES, RANGE)
    assert encode(moved, ANGLES, RANGE) == pytest.approx(mirrored_features(features), abs=1e-5)
    places = np.random.default_rng(1).uniform(-5.0, 5.0, (5, len(HORIZONS), 2))
    answers = answers_for(places, plain).astype(np.float32)
    assert answers_for(places * mirror, moved) == pytest.approx(mirrored_answers(answers), abs=1e-5)


def test_the_past_of_what_goes_straight_is_its_velocity() -> None:
    features = encode(tracks_of(np.array([[1.0, 2.0]]), np.array([[0.3, -0.4]])), ANGLES, RANGE)[0]
    past = features[OWN : OWN + 2 * len(LAGS)].reshape(-1, 2)
    assert past == pytest.approx(np.tile([0.5 / TOP_SPEED, 0.0], (len(LAGS), 1)), abs=1e-6)


def test_a_wall_ahead_is_told_with_its_direction_and_the_time_to_it() -> None:
    # The robot stands at the origin, a wall at x = 3; the mover comes along y = 0 at 0.5 m/s.
    cos = np.cos(ANGLES)
    ranges = np.where(cos > 0.6, 3.0 / np.maximum(cos, 0.6), RANGE)
    features = encode(tracks_of(np.array([[1.0, 0.0]]), np.array([[0.5, 0.0]]), ranges=ranges), ANGLES, RANGE)[0]
    # 1.6 m to go for a disc of 0.4 m; a wall across has twice 90 degrees
    assert features[HEADINGS_AT] == pytest.approx(1.6 / 0.5 / HORIZONS[-1], abs=1e-6)
    assert features[TOUCH_AT : TOUCH_AT + 4] == pytest.approx([0.0, -1.0, 0.0, 1.0], abs=1e-6)
    ahead, behind = features[SECTORS_AT], features[SECTORS_AT + SECTORS // 2]
    assert ahead > 0.0 and behind == 0.0


def test_hits_on_the_mover_itself_are_not_its_surroundings() -> None:
    tracks = some_tracks()
    mine = tracks._replace(beam_track=np.zeros(BEAMS, dtype=np.int64))
    features = encode(mine, ANGLES, RANGE)
    assert (features[0, SECTORS_AT:HEADINGS_AT] == 0.0).all()
    assert (features[0, HEADINGS_AT:TOUCH_AT] == 1.0).all()
    assert (features[1, SECTORS_AT:HEADINGS_AT] > 0.0).any()


def test_the_others_are_told_nearest_first() -> None:
    position = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [9.0, 9.0]])
    features = encode(tracks_of(position, np.tile([1.0, 0.0], (4, 1))), ANGLES, RANGE)[0]
    others = features[TOUCH_AT + 4 :].reshape(-1, 6)
    assert others[:, :2] == pytest.approx(np.array([[0.0, 0.25], [0.5, 0.0], [0.0, 0.0]]))
    assert others[:, 5].tolist() == [1.0, 1.0, 0.0]  # the last is out of sight


def test_all_is_told_in_bounds_whatever_the_tracks_are() -> None:
    still = tracks_of(
        np.zeros((3, 2)), np.zeros((3, 2)), ranges=np.zeros(BEAMS)
    )  # one upon the other, and on the robot
    for tracks in (*map(some_tracks, range(5)), still):
        features = encode(tracks, ANGLES, RANGE)
        assert features.shape == (len(tracks.id), WIDTH) and features.dtype == np.float32
        assert np.isfinite(features).all() and np.abs(features).max() <= 3.0
