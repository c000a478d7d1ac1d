"""The network of a learned predictor, what its answers cost, and the validations of a training."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from bug_gym.agents.learning.diverging import NotFiniteError
from bug_gym.agents.prediction.features import (
    ANSWERS,
    HORIZONS,
    KALMAN_ERRORS,
    TOP_SPEED,
    WIDTH,
    cost_of,
    errors_of,
)
from bug_gym.agents.prediction.samples import Samples


class Answering(nn.Module):
    """A network (n, WIDTH) -> (n, ANSWERS) in [-1, 1]."""

    def __init__(self, layers: nn.Module) -> None:
        super().__init__()
        self.layers = layers

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """The answers."""
        return torch.clamp(self.layers(features), -1.0, 1.0)


def network(hidden: Sequence[int]) -> nn.Sequential:
    """Layers of the widths given, with rectifiers between; its first answers are near 0, the filter's."""
    widths = [WIDTH, *hidden]
    layers: list[nn.Module] = []
    for before, after in zip(widths, widths[1:], strict=False):
        layers += [nn.Linear(before, after), nn.ReLU()]
    last = nn.Linear(widths[-1], ANSWERS)
    nn.init.uniform_(last.weight, -1e-3, 1e-3)
    nn.init.zeros_(last.bias)
    return nn.Sequential(*layers, last)


def costs_at_horizons(given: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    """The terms (..., HORIZONS) whose mean is features.cost_of, of answers (..., ANSWERS)."""
    gaps = given - right
    squares = gaps.square().reshape(*gaps.shape[:-1], len(HORIZONS), 2)
    distances = torch.sqrt(squares.sum(dim=-1) + 1e-12)
    return distances * torch.as_tensor(TOP_SPEED * HORIZONS / KALMAN_ERRORS, dtype=distances.dtype)


def validation_errors(model: nn.Module, samples: Samples) -> NDArray[np.float64]:
    """Mean distances (HORIZONS,) of a model's predicted places from the true ones [m]."""
    with torch.no_grad():
        given = model(torch.from_numpy(samples.features)).numpy()
    means: NDArray[np.float64] = errors_of(given, samples.answers).mean(axis=0)
    return means


class Curve:
    """Validations of a training; keeps the weights that did best."""

    def __init__(self, model: nn.Module, samples: Samples) -> None:
        self.model, self.samples = model, samples
        self.begun, self.cpu_begun = time.perf_counter(), time.process_time()
        self.points: list[dict[str, Any]] = []
        self.best: dict[str, torch.Tensor] = {}
        self.best_errors: NDArray[np.float64] = np.full(len(HORIZONS), np.inf)

    def add(self, step: int) -> None:
        """Validate after so many samples.

        Raises:
            NotFiniteError: the model answers with numbers that are none.
        """
        errors = validation_errors(self.model, self.samples)
        if not np.isfinite(errors).all():
            raise NotFiniteError(f"after {step:,} samples its errors in validation are {errors.tolist()}")
        cost = float(cost_of(errors[None])[0])
        self.points.append(
            {
                "samples": step,
                "seconds": round(time.perf_counter() - self.begun, 1),
                "cpu_seconds": round(time.process_time() - self.cpu_begun, 1),
                "cost": round(cost, 4),
                "errors": [round(error, 4) for error in errors.tolist()],
            }
        )
        if cost < cost_of(self.best_errors[None])[0]:
            self.best_errors = errors
            self.best = {name: value.detach().clone() for name, value in self.model.state_dict().items()}
