"""Learned predictors in play: an ONNX graph run by onnxruntime for all tracks at once, without torch.

They answer what BugGym/Prediction-v0 asks. The shipped ones lie in agents/trained; `training` makes them.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from bug_gym.agents.learning.folder import (
    TRAINED_FOLDER,
    Checksum,
    checksums_of,
    open_graph,
    read_record,
    require_answers,
)
from bug_gym.agents.prediction.features import ANSWERS, HORIZONS, WIDTH, decode, encode
from bug_gym.agents.prediction.predictor import Prediction, place_deviation
from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import F64
from bug_gym.schema.errors import shortened, wrong
from bug_gym.schema.values import Count, NotNegative, Number, Part
from bug_gym.view import Sensors

GRAPH, WEIGHTS, CONFIG = "predictor.onnx", "predictor.safetensors", "predictor.json"
"""Files of a predictor: what is played, what can be trained on, and what made it."""
WIDEST = 65_536
"""Of a layer."""


def _with_layers(value: dict[str, Any]) -> dict[str, Any]:
    hidden = value.get("hidden")
    if not isinstance(hidden, list) or not all(type(width) is int and 1 <= width <= WIDEST for width in hidden):
        raise wrong(f"got {shortened(hidden)}, expected a list of widths of layers from 1 to {WIDEST}", "hidden")
    return value


class PredictorRecord(Part):
    """What predictor.json says of a predictor."""

    kind: Literal["ppo", "reinforce", "supervised"]
    """How it was trained."""
    width: Count
    """How many numbers it is told of a mover."""
    horizons: tuple[Number, ...]
    """How far ahead it is asked [s]."""
    errors: Annotated[tuple[NotNegative, ...], Field(min_length=len(HORIZONS), max_length=len(HORIZONS))]
    """Its errors in validation at those horizons [m]."""
    settings: Annotated[dict[str, Any], AfterValidator(_with_layers)]
    """Of its training: see settings.PredictorSettings."""
    sources: tuple[str, ...]
    """What it learned from."""
    samples: dict[str, Count]
    """How many samples there were, by use."""
    held_out: dict[str, dict[str, Any]]
    """How it did in held-out worlds, by name."""
    curve: tuple[dict[str, Any], ...]
    """Its validations."""
    repeats: dict[str, tuple[dict[str, Any], ...]]
    """Those of the same training with other seeds, by seed."""
    machine: dict[str, Any]
    """What it was trained on."""
    sha256: Annotated[dict[str, Checksum], checksums_of(GRAPH, WEIGHTS)]
    """Checksums of its files, by name."""


class LearnedPredictor:
    """A trained network that corrects the Kalman filter's velocity at four horizons.

    Args:
        sensors: what a driver knows of the robot whose tracks are predicted.
        folder: of the model.

    Raises:
        ValueError: no such model, or its files are damaged.
        ImportError: onnxruntime is not installed.
    """

    def __init__(self, sensors: Sensors, folder: Path) -> None:
        self.sensors = sensors
        self.config = read_config(folder)
        self._session = open_graph(folder / GRAPH, self.config["sha256"][GRAPH])
        require_answers(self._session, folder / GRAPH, WIDTH, [(ANSWERS,)])
        # The mean of a distance in the plane is so many times the deviation of one coordinate, if they are a Gaussian's.
        self._errors = np.concatenate([[0.0], np.array(self.config["errors"]) / math.sqrt(0.5 * math.pi)])

    def predict(self, tracks: Tracks, times: F64) -> Prediction:
        """Where the network says that movers go; what doesn't move stays.

        The spread is the error that the network had in its validation, beside that of the place now. Beyond the last horizon
        the mean velocity until then goes on, and so does the error of it.
        """
        moving = np.flatnonzero(tracks.moving)
        places = np.repeat(tracks.position[:, None], len(times), axis=1)
        spread = np.repeat(place_deviation(tracks)[:, None], len(times), axis=1)
        if len(moving):
            movers = tracks.select(moving)
            features = encode(movers, self.sensors.angles, self.sensors.range)
            places[moving] = decode(self.answer(features), movers, times)
            grown = np.interp(times, np.concatenate([[0.0], HORIZONS]), self._errors)
            grown *= np.maximum(times / HORIZONS[-1], 1.0)
            spread[moving] = np.hypot(spread[moving], grown)
        return Prediction(places, spread)

    def answer(self, features: NDArray[np.float32]) -> NDArray[np.floating]:
        """Answers (n, ANSWERS) for what is told of n movers (n, WIDTH)."""
        (answers,) = self._session.run(None, {"observation": features})
        answered: NDArray[np.floating] = answers
        return answered


def read_config(folder: Path) -> dict[str, Any]:
    """What a predictor's file says of it.

    Raises:
        ValueError: it is missing, damaged, or of a predictor that is told other things.
    """
    path = folder / CONFIG
    config = read_record(path, "predictor", PredictorRecord)
    if config["width"] != WIDTH or config["horizons"] != HORIZONS.tolist():
        raise ValueError(f"{path} is of a predictor that is told {config['width']} numbers, expected {WIDTH}")
    return config


class RLPredictor(LearnedPredictor):
    """The shipped one trained by reinforcement."""

    def __init__(self, sensors: Sensors) -> None:
        super().__init__(sensors, TRAINED_FOLDER / "rl_predictor")


class SupervisedPredictor(LearnedPredictor):
    """The shipped one trained by supervision."""

    def __init__(self, sensors: Sensors) -> None:
        super().__init__(sensors, TRAINED_FOLDER / "supervised_predictor")
