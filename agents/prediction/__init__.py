"""Where tracked things will be: the table of predictors, and `make_predictor`.

The interface that all of them have is in predictor; who needs only that, or one class, imports it from there: the
modules below don't know the table.
"""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import cast

from bug_gym.agents.prediction.predictor import Predictor
from bug_gym.checks import shortened
from bug_gym.naming import nearest_hint
from bug_gym.view import Sensors

PREDICTORS: dict[str, str] = {
    "none": "plain:NoPrediction",
    "constant_velocity": "plain:ConstantVelocity",
    "kalman": "plain:Kalman",
    "supervised": "learned:SupervisedPredictor",
    "rl": "learned:RLPredictor",
}
"""Name -> module here : class."""


def predictor_names() -> list[str]:
    """Names that `make_predictor` takes."""
    return list(PREDICTORS)


def make_predictor(name: str, sensors: Sensors) -> Predictor:
    """Make a predictor.

    Args:
        name: one of `predictor_names()`, or the path of a folder that `training` wrote.
        sensors: what a driver knows of the robot whose tracks are predicted.

    Raises:
        ValueError: no such predictor; the message offers the nearest name.
    """
    if "/" in name or os.sep in name:
        learned = importlib.import_module(".learned", __name__)
        return cast(Predictor, learned.LearnedPredictor(sensors, Path(name).expanduser()))
    if name not in PREDICTORS:
        hint = nearest_hint(name, PREDICTORS)
        raise ValueError(f"unknown predictor {shortened(name)}{hint} (known: {', '.join(PREDICTORS)})")
    module, class_name = PREDICTORS[name].split(":")
    predictor = getattr(importlib.import_module(f".{module}", __name__), class_name)
    return cast(Predictor, predictor(sensors))
