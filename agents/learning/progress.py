"""What a training knows besides its model: its validations, which weights did best in them, and the time spent."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch
from stable_baselines3.common.logger import TensorBoardOutputFormat

from bug_gym.agents.learning.folder import Entered, Point
from bug_gym.files import replaced_when_done

CURVE = "curve.csv"
"""File of a training's folder that holds its validations."""


@dataclass
class Progress:
    """What a training knows besides its model."""

    points: list[Point] = field(default_factory=list)
    """Validations so far."""
    best: dict[str, torch.Tensor] = field(default_factory=dict)
    """Weights of the policy that did best in them."""
    best_point: Point | None = None
    """How it did."""
    entered: list[Entered] = field(default_factory=list)
    """Stages of its curriculum that have begun, but for the first."""
    seconds: float = 0.0
    """Time spent on training [s]."""
    cpu_seconds: float = 0.0
    """The same in time of processors [s]."""


def write_curve(path: Path, points: Sequence[Point]) -> None:
    """Write validations as CSV."""
    with replaced_when_done(path) as partial, Path(partial).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(Point.__annotations__))
        writer.writeheader()
        writer.writerows(asdict(point) for point in points)


class Events(TensorBoardOutputFormat):
    """TensorBoard's events of a run, which hide those that an earlier run of the training has written of what is to come.

    Args:
        folder: where they go.
        begin: steps of the training at which the run begins.
    """

    def __init__(self, folder: Path, begin: int) -> None:
        from torch.utils.tensorboard import SummaryWriter

        # SB3's own way of making one would begin a file of events that hides nothing.
        self.writer = SummaryWriter(log_dir=str(folder), purge_step=begin)
        self._is_closed = False
