"""Learned predictors in play: an ONNX graph run by onnxruntime for all tracks at once, without torch.

They answer what BugGym/Prediction-v0 asks. The shipped ones lie in agents/trained; prediction_training makes them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.observation import Sensors

from .model_folder import TRAINED_FOLDER, open_graph
from .prediction import Prediction, place_deviation
from .prediction_features import HORIZONS, WIDTH, decode, encode
from .tracking import Tracks

F64 = NDArray[np.float64]

GRAPH, WEIGHTS, CONFIG = "predictor.onnx", "predictor.safetensors", "predictor.json"
"""Files of a predictor: what is played, what can be trained on, and what made it."""


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
        # An error is a distance, a spread that of one coordinate.
        self._errors = np.concatenate([[0.0], np.array(self.config["errors"]) / np.sqrt(2.0)])

    def predict(self, tracks: Tracks, times: F64) -> Prediction:
        """Where the network says that movers go; what doesn't move stays.

        The spread is the error that the network had in its validation, beside that of the place now.
        """
        moving = np.flatnonzero(tracks.moving)
        places = np.repeat(tracks.position[:, None], len(times), axis=1)
        spread = np.repeat(place_deviation(tracks)[:, None], len(times), axis=1)
        if len(moving):
            movers = tracks.select(moving)
            features = encode(movers, self.sensors.angles, self.sensors.range)
            (answers,) = self._session.run(None, {"observation": features})
            places[moving] = decode(answers, movers, times)
            grown = np.interp(times, np.concatenate([[0.0], HORIZONS]), self._errors)
            spread[moving] = np.hypot(spread[moving], grown)
        return Prediction(places, spread)


def read_config(folder: Path) -> dict[str, Any]:
    """What a predictor's file says of it.

    Raises:
        ValueError: it is missing, damaged, or of a predictor that is told other things.
    """
    path = folder / CONFIG
    try:
        config: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise ValueError(f"no trained predictor in {folder}: it has no {CONFIG}") from None
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    if missing := {"width", "horizons", "errors", "sha256"} - config.keys():
        raise ValueError(f"{path} is damaged: it lacks {', '.join(sorted(missing))}")
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
