"""The comparison of predictors behind `bug-gym reproduce predictors`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bug_gym.reproductions import reproduction
from bug_gym.reproductions.predictors import ASKED, SCENES, TIMES, check, has_turned, other_scene, summary
from bug_gym.reproductions.result import Settings

NAMES = ("kalman", "rl")


def test_a_turn_is_a_turn() -> None:
    angles = np.radians([0.0, 25.0, 35.0, 180.0])
    begin = np.zeros((len(angles), 2))
    first = np.tile([1.0, 0.0], (len(angles), 1))
    last = first + np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert has_turned(begin, np.stack([first, last], axis=1)).tolist() == [False, False, True, True]


def test_errors_are_means_over_tracks_and_over_the_times_up_to_each() -> None:
    # Two worlds of 1 and 3 tracks; the error grows by 1 m each 0.8 s, and the second predictor's is half.
    growing = np.arange(1.0, len(TIMES) + 1)
    worlds = [np.tile(growing * np.array([[1.0], [0.5]]), (tracks, 1, 1)).swapaxes(0, 1) for tracks in (1, 3)]
    found = summary(worlds, NAMES)
    assert (found["tracks"], found["worlds"]) == (4, 2)
    for name, share in zip(NAMES, (1.0, 0.5), strict=True):
        assert [one["value"] for one in found["final"][name]] == pytest.approx([share * growing[k] for k in ASKED])
        means = [share * growing[: k + 1].mean() for k in ASKED]
        assert [one["value"] for one in found["mean"][name]] == pytest.approx(means)
    assert all(one == {"value": 0.5, "low": 0.5, "high": 0.5} for one in found["mean_ratio"]["rl"])


def test_an_interval_holds_the_value() -> None:
    rng = np.random.default_rng(0)
    found = summary([rng.uniform(0.5, 2.0, (2, tracks, len(TIMES))) for tracks in (3, 5, 8, 2, 6)], NAMES)
    for kind in ("mean", "final"):
        for name in NAMES:
            assert all(one["low"] <= one["value"] <= one["high"] for one in found[kind][name])


def test_claims_are_of_the_learned_one_against_the_filter() -> None:
    ratio = {"mean_ratio": {"rl": [{"value": 0.95, "low": 0.9, "high": 1.0}]}}
    found = {"crowd": ratio, "ETH": ratio}
    assert [holds for _, holds in check(found, NAMES)] == [False, True]
    # An interval on both sides of 1 tells nothing, and so shows nothing.
    wide = {"ETH": {"mean_ratio": {"rl": [{"value": 1.1, "low": 0.6, "high": 1.6}]}}}
    assert [holds for _, holds in check(wide, NAMES)] == [False]
    assert not list(check(found, ("none", "kalman")))


def test_every_predictor_is_asked_under_every_law() -> None:
    pytest.importorskip("onnxruntime")
    result = reproduction("predictors")(Settings(seeds=1))
    for one in result.data["errors"].values():
        assert set(one["final"]) == {"none", "constant_velocity", "kalman", "supervised", "rl"}
        for values in one["final"].values():
            assert all(0.0 < value["value"] < 20.0 for value in values)
    assert "no recorded pedestrians" in " ".join(result.notes)


@pytest.mark.slow
def test_predictors_are_trained_with_one_scene_and_asked_in_the_other(shared_data: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
    scenes = {scene: shared_data / name for scene, name in SCENES.items()}
    found = other_scene(scenes, Settings(seeds=3))
    assert list(found) == ["hotel", "ETH"]
    for tested, seen in (("hotel", "ETH"), ("ETH", "hotel")):
        names = {"supervised", "rl", f"supervised, trained on with {seen}", f"rl, trained on with {seen}"}
        assert set(found[tested]["mean_ratio"]) == names


def test_the_data_must_hold_the_scenes(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"pedestrians_eth\.csv"):
        reproduction("predictors")(Settings(seeds=1, data=tmp_path))
