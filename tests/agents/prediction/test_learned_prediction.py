"""The shipped learned predictors, and what is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

from bug_gym.agents.learning.folder import TRAINED_FOLDER
from bug_gym.agents.prediction import make_predictor
from bug_gym.agents.prediction.features import HORIZONS
from bug_gym.agents.prediction.learned import CONFIG, GRAPH, LearnedPredictor
from bug_gym.agents.prediction.samples import displacement_errors, law_world, moments
from bug_gym.config import load
from bug_gym.held_out import VALIDATION_SEEDS
from bug_gym.view import Sensors

SHIPPED = ("rl", "supervised")
SENSORS = Sensors.of(load("dynamic"))


@pytest.mark.parametrize("kind", SHIPPED)
def test_a_shipped_predictor_is_small(kind: str) -> None:
    folder = TRAINED_FOLDER / f"{kind}_predictor"
    assert sum(path.stat().st_size for path in folder.iterdir()) <= 2**20


@pytest.mark.parametrize("name", ["rl", "supervised"])
def test_beyond_the_last_horizon_the_error_of_the_mean_velocity_goes_on(name: str) -> None:
    scenario = law_world("crowd", VALIDATION_SEEDS)
    tracks = next(moments(scenario, VALIDATION_SEEDS, every=5)).tracks
    times = HORIZONS[-1] * np.array([0.0, 1.0, 2.0, 3.0])
    places, spread = make_predictor(name, Sensors.of(scenario)).predict(tracks, times)
    ways = places - places[:, :1]
    assert np.allclose(ways[:, 2], 2.0 * ways[:, 1]) and np.allclose(ways[:, 3], 3.0 * ways[:, 1])
    grown = np.sqrt(spread**2 - spread[:, :1] ** 2)  # beside the error of the place now
    assert (grown[:, 1] > 0.0).all()
    assert np.allclose(grown[:, 2:], grown[:, 1:2] * [2.0, 3.0])


@pytest.mark.parametrize("name", SHIPPED)
def test_errors_of_a_gaussian_of_the_spread_are_in_the_mean_those_of_the_validation(name: str) -> None:
    scenario = law_world("crowd", VALIDATION_SEEDS)
    tracks = next(moments(scenario, VALIDATION_SEEDS, every=5)).tracks
    _, spread = make_predictor(name, Sensors.of(scenario)).predict(tracks, np.concatenate([[0.0], HORIZONS]))
    grown = np.sqrt(spread[0, 1:] ** 2 - spread[0, 0] ** 2)
    errors = grown[:, None, None] * np.random.default_rng(0).normal(size=(len(HORIZONS), 100_000, 2))
    config = json.loads((TRAINED_FOLDER / f"{name}_predictor" / CONFIG).read_text(encoding="utf-8"))
    assert np.hypot(errors[..., 0], errors[..., 1]).mean(axis=1) == pytest.approx(config["errors"], rel=0.01)


@pytest.mark.parametrize("kind", SHIPPED)
@pytest.mark.parametrize("law", ["random_walk", "evade"])
def test_a_shipped_predictor_knows_better_than_the_filter_where_movers_turn(kind: str, law: str) -> None:
    errors = []
    for seed in range(VALIDATION_SEEDS, VALIDATION_SEEDS + 4):
        scenario = law_world(law, seed)
        predictors = [make_predictor(name, Sensors.of(scenario)) for name in ("kalman", kind)]
        for tracks, places in moments(scenario, seed, every=10):
            found = [displacement_errors(one.predict(tracks, HORIZONS).places, places) for one in predictors]
            errors.append(np.stack(found, axis=1))
    by_filter, learned = np.concatenate(errors).mean(axis=(0, 2))
    assert learned < 0.9 * by_filter


@pytest.mark.parametrize(
    "damage", ["no config", "broken config", "empty config", "other graph", "no graph", "other task"]
)
def test_a_damaged_predictor_is_refused(damage: str, tmp_path: Path) -> None:
    folder = shutil.copytree(TRAINED_FOLDER / "rl_predictor", tmp_path / "model")
    config = folder / CONFIG
    if damage == "no config":
        config.unlink()
    elif damage == "broken config":
        config.write_text("{", encoding="utf-8")
    elif damage == "empty config":
        config.write_text("{}", encoding="utf-8")
    elif damage == "other graph":
        (folder / GRAPH).write_bytes((folder / GRAPH).read_bytes()[:-1])
    elif damage == "no graph":
        (folder / GRAPH).unlink()
    else:
        config.write_text(json.dumps(json.loads(config.read_text("utf-8")) | {"width": 3}), encoding="utf-8")
    with pytest.raises(ValueError, match="damaged|no trained predictor|no file|told 3 numbers"):
        LearnedPredictor(SENSORS, folder)
