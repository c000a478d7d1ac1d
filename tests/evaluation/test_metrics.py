"""Quantities of one episode: rows, SPL, interception, turns."""

import json
from collections.abc import Callable
from dataclasses import replace
from math import inf, isnan, nan, pi, radians, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.evaluation.rows import EpisodeRow, earliest_intercept, spl, turns_and_turning

FloatArray = NDArray[np.float64]
TURN = np.array([[0.6, -0.8], [0.8, 0.6]])
"""A rotation."""
ROW = EpisodeRow(
    policy="bug2",
    scenario="two_boxes",
    seed=3,
    robot=0,
    outcome="success",
    verdict="",
    success=True,
    time=12.5,
    steps=125,
    path_length=11.0,
    goal_distance=0.25,
    shortest_path_length=10.0,
    spl=10.0 / 11.0,
    time_ratio=nan,
    min_clearance=0.125,
    turns=2,
    total_turning=3.0,
    decision_time_mean=0.001,
    decision_time_p99=0.002,
    decision_time_total=0.125,
)


def refuse_constant(text: str) -> float:
    """Fail on what Python's JSON reads but strict JSON does not have."""
    raise AssertionError(f"{text} is not JSON")


def through_json(row: EpisodeRow) -> EpisodeRow:
    """The row after a journey through strict JSON."""
    return EpisodeRow.from_dict(json.loads(json.dumps(row.as_dict()), parse_constant=refuse_constant))


def test_a_row_survives_strict_json() -> None:
    assert replace(through_json(ROW), time_ratio=0.0) == replace(ROW, time_ratio=0.0)


def test_nan_and_infinity_stay_apart_through_json() -> None:
    back = through_json(replace(ROW, shortest_path_length=inf, spl=nan, min_clearance=inf))
    assert back.shortest_path_length == inf and back.min_clearance == inf
    assert isnan(back.spl) and isnan(back.time_ratio)


def test_fields_of_a_row_come_in_the_order_of_the_contract() -> None:
    identity = ["policy", "scenario", "seed", "robot", "outcome", "verdict", "success"]
    motion = ["time", "steps", "path_length", "goal_distance", "shortest_path_length", "spl", "time_ratio"]
    manner = ["min_clearance", "turns", "total_turning"]
    decisions = ["decision_time_mean", "decision_time_p99", "decision_time_total"]
    assert list(ROW.as_dict()) == identity + motion + manner + decisions


def test_a_whole_number_in_json_is_a_float_where_a_float_belongs() -> None:
    time = EpisodeRow.from_dict({**ROW.as_dict(), "time": 12}).time
    assert time == 12.0 and type(time) is float


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("seed", 3.0),
        ("seed", True),
        ("seed", "3"),
        ("seed", -1),
        ("steps", None),
        ("policy", 7),
        ("success", 1),
        ("success", False),
        ("outcome", "crashed"),
        ("time", True),
        ("time", "12.5"),
        ("time", None),
        ("time", "inf"),
        ("time", -0.1),
        ("path_length", nan),
        ("goal_distance", inf),
        ("spl", 1.5),
        ("spl", -0.5),
        ("min_clearance", -inf),
        ("turns", -1),
    ],
)
def test_a_field_of_wrong_type_or_range_is_refused_by_name(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=field):
        EpisodeRow.from_dict({**ROW.as_dict(), field: value})


def test_a_missing_key_and_an_unknown_key_are_named() -> None:
    data = ROW.as_dict()
    data["tiem"] = data.pop("time")
    with pytest.raises(ValueError, match=r"missing: \['time'\], unknown: \['tiem'\]"):
        EpisodeRow.from_dict(data)


def test_a_row_that_is_no_mapping_is_refused() -> None:
    with pytest.raises(ValueError, match="mapping"):
        EpisodeRow.from_dict(["bug2"])  # type: ignore[arg-type]


def test_a_row_made_in_code_is_checked_too() -> None:
    with pytest.raises(ValueError, match="seed must be of type int"):
        replace(ROW, seed=np.int64(3))  # type: ignore[arg-type]


def test_a_clearance_may_be_negative() -> None:
    assert replace(ROW, min_clearance=-0.01).min_clearance == -0.01


def test_spl_is_the_share_of_the_path_that_was_needed() -> None:
    assert spl(success=True, shortest=6.0, taken=8.0) == 0.75


def test_spl_of_a_path_shorter_than_the_shortest_is_one() -> None:
    assert spl(success=True, shortest=6.0, taken=5.7) == 1.0


def test_spl_of_a_failure_is_zero() -> None:
    assert spl(success=False, shortest=6.0, taken=6.0) == 0.0


def test_spl_of_a_start_at_the_goal_is_one() -> None:
    assert spl(success=True, shortest=0.0, taken=0.0) == 1.0


@pytest.mark.parametrize("shortest", [nan, inf])
@pytest.mark.parametrize("success", [True, False])
def test_spl_without_a_shortest_path_is_undefined_whatever_the_outcome(success: bool, shortest: float) -> None:
    assert isnan(spl(success=success, shortest=shortest, taken=5.0))


@pytest.mark.parametrize(("shortest", "taken"), [(-1.0, 5.0), (5.0, -1.0), (5.0, nan), (5.0, inf)])
def test_spl_refuses_impossible_lengths(shortest: float, taken: float) -> None:
    with pytest.raises(ValueError, match="lengths"):
        spl(success=True, shortest=shortest, taken=taken)


# A target 10 m ahead of a robot of 1 m/s, with the target's velocity and the time of meeting: the closed form is the
# smaller positive root of (|v|^2 - 1) t^2 + 20 v_x t + 100 = 0.
CLOSED_FORMS = [
    ((0.0, 0.0), 10.0),
    ((0.0, 0.5), 10.0 / sqrt(0.75)),
    ((0.5, 0.0), 20.0),
    ((-0.5, 0.0), 20.0 / 3.0),
    ((0.0, 1.0), inf),
    ((1.0, 0.0), inf),
    ((-1.0, 0.0), 5.0),
    ((0.6, 0.8), inf),
    ((-0.6, 0.8), 100.0 / 12.0),
    ((-2.0, 0.0), 10.0 / 3.0),
]


@pytest.mark.parametrize("times", [np.array([0.0, 40.0]), np.arange(401) / 10.0, np.array([0.0, 0.7, 9.0, 13.1, 40.0])])
@pytest.mark.parametrize(("velocity", "expected"), CLOSED_FORMS)
def test_intercept_of_a_steady_target_is_the_closed_form(
    velocity: tuple[float, float], expected: float, times: FloatArray
) -> None:
    track = np.array([10.0, 0.0]) + times[:, None] * np.array(velocity)
    assert earliest_intercept([0.0, 0.0], track, times, 1.0) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("velocity", "expected"), CLOSED_FORMS)
def test_intercept_does_not_depend_on_where_the_scene_lies(velocity: tuple[float, float], expected: float) -> None:
    times = np.linspace(0.0, 40.0, 81)
    track = (np.array([10.0, 0.0]) + times[:, None] * np.array(velocity)) @ TURN.T + [3.0, -4.0]
    assert earliest_intercept([3.0, -4.0], track, times, 1.0) == pytest.approx(expected, rel=1e-9)


def test_intercept_counts_from_the_first_sample_on_the_clock_of_the_samples() -> None:
    assert earliest_intercept([0.0, 0.0], [[4.0, 0.0], [4.0, 0.0]], [100.0, 110.0], 2.0) == pytest.approx(102.0)


def test_intercept_within_a_capture_radius_is_that_much_nearer() -> None:
    track, times = [[10.0, 0.0], [30.0, 0.0]], [0.0, 40.0]
    # The gap of 10 - 0.3 m closes at 1 - 0.5 m/s.
    assert earliest_intercept([0.0, 0.0], track, times, 1.0, capture_radius=0.3) == pytest.approx(9.7 / 0.5)


def test_intercept_right_on_the_last_sample_is_one() -> None:
    times = np.arange(8) * 0.1
    track = np.full((8, 2), [0.7, 0.0])
    assert earliest_intercept([0.0, 0.0], track, times, 1.0) == pytest.approx(0.7)


def test_intercept_finds_a_fast_target_that_passes_between_two_samples() -> None:
    # From (5, -100) to (5, 100) in 20 s: out of reach at both samples, at the robot's height after 10 s.
    time = earliest_intercept([0.0, 0.0], [[5.0, -100.0], [5.0, 100.0]], [0.0, 20.0], 1.0)
    assert time == pytest.approx((1000.0 - sqrt(1000.0**2 - 99.0 * 10025.0)) / 99.0)


@pytest.mark.parametrize("track", [[[1.0, 1.0], [9.0, 1.0]], [[1.0, 1.0]]])
def test_intercept_of_a_target_already_there_is_the_start(track: list[list[float]]) -> None:
    assert earliest_intercept([1.0, 1.0], track, 5.0 + np.arange(len(track)), 1.0) == 5.0


def test_intercept_of_a_single_sample_away_from_the_robot_is_never() -> None:
    assert earliest_intercept([0.0, 0.0], [[1.0, 1.0]], [0.0], 1.0) == inf


@pytest.mark.parametrize("seed", range(20))
def test_intercept_is_the_first_time_at_which_the_target_is_in_reach(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 0.5, 60))
    track = rng.uniform(-8.0, 8.0, 2) + np.cumsum(rng.normal(0.0, 0.4, (60, 2)), axis=0)
    start, speed, radius = rng.uniform(-8.0, 8.0, 2), 0.8, 0.2

    def out_of_reach(clock: FloatArray) -> FloatArray:
        x, y = (np.interp(clock, times, track[:, axis]) for axis in (0, 1))
        return np.asarray(np.hypot(x - start[0], y - start[1]) - radius - speed * (clock - times[0]))

    met = earliest_intercept(start, track, times, speed, capture_radius=radius)
    before = np.linspace(times[0], min(met, times[-1]), 5000, endpoint=False)
    assert (out_of_reach(before) > 0.0).all()
    assert met == inf or out_of_reach(np.array([met]))[0] == pytest.approx(0.0, abs=1e-9)


def test_random_tracks_are_met_in_some_cases_and_not_in_others() -> None:
    rng = np.random.default_rng(0)
    times = np.linspace(0.0, 10.0, 11)
    tracks = rng.uniform(-8.0, 8.0, (40, 11, 2))
    met = [earliest_intercept([0.0, 0.0], track, times, 0.3) < inf for track in tracks]
    assert 0 < sum(met) < len(met)


@pytest.mark.parametrize(
    ("start", "track", "times", "speed", "radius"),
    [
        ([0.0], [[1.0, 0.0]], [0.0], 1.0, 0.0),
        ([0.0, 0.0], [[1.0, 0.0]], [0.0, 1.0], 1.0, 0.0),
        ([0.0, 0.0], np.empty((0, 2)), [], 1.0, 0.0),
        ([0.0, 0.0], [[1.0, nan]], [0.0], 1.0, 0.0),
        ([0.0, 0.0], [[1.0, 0.0], [2.0, 0.0]], [1.0, 1.0], 1.0, 0.0),
        ([0.0, 0.0], [[1.0, 0.0]], [0.0], 0.0, 0.0),
        ([0.0, 0.0], [[1.0, 0.0]], [0.0], inf, 0.0),
        ([0.0, 0.0], [[1.0, 0.0]], [0.0], 1.0, -0.1),
    ],
)
def test_intercept_refuses_bad_input(start: Any, track: Any, times: Any, speed: float, radius: float) -> None:
    with pytest.raises(ValueError):
        earliest_intercept(start, track, times, speed, capture_radius=radius)


def drive(corners: list[tuple[float, float]], spacing: float = 0.1) -> FloatArray:
    """A path sampled evenly along the legs between corners, the corners themselves included."""
    legs = [
        np.linspace(start, end, max(2, round(float(np.hypot(*np.subtract(end, start))) / spacing)), endpoint=False)
        for start, end in zip(corners[:-1], corners[1:], strict=True)
    ]
    return np.vstack([*legs, np.array([corners[-1]])])


POLYLINES = [
    ([(0, 0), (6, 0)], 0, 0.0),
    ([(0, 0), (4, 0), (4, 4)], 1, pi / 2),
    ([(0, 0), (4, 0), (4, 4), (0, 4), (0, 0)], 3, 3 * pi / 2),
    ([(0, 0), (2, 2), (4, 0), (6, 2), (8, 0)], 3, 3 * pi / 2),
    ([(0, 0), (5, 0), (0, 0)], 1, pi),
    ([(0, 0), (5, 0), (1, 0), (3, 0)], 2, 2 * pi),
    ([(0, 0), (5, 0), (10, 5 * np.tan(radians(10.0)))], 0, radians(10.0)),
    ([(0, 0), (5, 0), (10, 5 * np.tan(radians(20.0)))], 1, radians(20.0)),
]


@pytest.mark.parametrize(("corners", "turns", "turning"), POLYLINES)
def test_turns_of_a_polyline_are_its_corners(corners: Any, turns: int, turning: float) -> None:
    counted, total = turns_and_turning(drive(corners))
    assert counted == turns and total == pytest.approx(turning, abs=1e-9)


@pytest.mark.parametrize(("corners", "turns", "turning"), POLYLINES)
def test_jitter_below_the_tolerance_adds_no_turn(corners: Any, turns: int, turning: float) -> None:
    path = drive(corners)
    path += np.random.default_rng(1).uniform(-0.012, 0.012, path.shape)
    counted, total = turns_and_turning(path)
    assert counted == turns
    # Each end of a leg of at least 2 m may be off by the tolerance of 0.05 m, and a corner lies between two legs.
    assert total == pytest.approx(turning, abs=4 * 0.05 / 2.0 * max(turns, 1))


def test_jitter_is_counted_where_no_tolerance_is_given_to_it() -> None:
    path = drive([(0.0, 0.0), (6.0, 0.0)])
    path += np.random.default_rng(1).uniform(-0.012, 0.012, path.shape)
    assert turns_and_turning(path, tolerance=0.0)[1] > 1.0


@pytest.mark.parametrize(("aside", "turns"), [(0.04, 0), (0.07, 3), (0.1, 3)])
def test_a_swerve_counts_from_5_cm_on(aside: float, turns: int) -> None:
    """Out and back over twice 0.2 m: out by the angle, back by twice that, and into the line again."""
    counted, total = turns_and_turning(drive([(0, 0), (2, 0), (2.2, aside), (2.4, 0), (4.4, 0)]))
    assert counted == turns
    assert total == pytest.approx(4.0 * np.arctan(aside / 0.2) if turns else 0.0, abs=1e-9)


@pytest.mark.parametrize("sweep", [pi / 2, pi, 1.5 * pi])
def test_a_smooth_bend_turns_by_its_angle_less_at_most_half_a_chord_at_either_end(sweep: float) -> None:
    radius, tolerance = 2.0, 0.05
    angle = np.linspace(0.0, sweep, 400)
    _, total = turns_and_turning(radius * np.column_stack([np.cos(angle), np.sin(angle)]), tolerance)
    # Chords of a circle turn by their angle, of which a chord within the tolerance spans at most this.
    chord = 2.0 * np.arccos(1.0 - tolerance / radius)
    assert sweep - chord - 1e-9 <= total <= sweep


@pytest.mark.parametrize("change", [lambda path: path @ TURN.T + [7.0, -2.0], lambda path: path[::-1]])
def test_turns_do_not_depend_on_where_the_path_lies_or_which_way_it_goes(
    change: Callable[[FloatArray], FloatArray],
) -> None:
    path = drive([(0, 0), (4, 1), (5, 5), (1, 6), (3, 9)])
    turns, total = turns_and_turning(path)
    changed_turns, changed_total = turns_and_turning(change(path))
    assert turns == changed_turns == 3
    assert changed_total == pytest.approx(total, abs=1e-9)


@pytest.mark.parametrize("path", [[(1.0, 2.0)], [(1.0, 2.0)] * 5, [(1.0, 2.0), (3.0, 4.0)]])
def test_a_path_with_no_corner_to_turn_at_has_no_turns(path: Any) -> None:
    assert turns_and_turning(path) == (0, 0.0)


@pytest.mark.parametrize(
    ("path", "tolerance"),
    [([], 0.05), ([1.0, 2.0], 0.05), ([(1.0, 2.0, 3.0)], 0.05), ([(1.0, nan)], 0.05), ([(1.0, 2.0)], -0.1)],
)
def test_turns_refuse_bad_input(path: Any, tolerance: float) -> None:
    with pytest.raises(ValueError):
        turns_and_turning(path, tolerance)
