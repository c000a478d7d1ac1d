"""The best model of a training that has not ended, as a folder that can be played: of one that is stopped it is what is left.

Each lies in a folder of its own, `best-STEPS`, which appears whole; only then the one before goes. So a kill at any moment
leaves a whole one, and never files of two. A run that begins again finds what the one before has left: its model stays until
there is one that did as well, and its curve gets another name. The model of a run that --minutes have ended stays likewise.
"""

from __future__ import annotations

import logging
import re
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.policies import BasePolicy

from bug_gym.agents.learning.folder import (
    CONFIG,
    GRAPH,
    WEIGHTS,
    Point,
    models_so_far,
    place_of,
    read_checked,
    read_config,
)
from bug_gym.agents.learning.models import gather, write_agent
from bug_gym.agents.learning.progress import CURVE, Progress
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.learning.settings import AnySettings
from bug_gym.files import moved_when_done, put_aside

logger = logging.getLogger("bug_gym")

WRITE_EACH = 60.0
"""Time between two of them [s]: a training's first validations may each be better than the last, and each takes a second to
write."""


class BestSoFar:
    """Writes the best model of a training into its folder, at most one each WRITE_EACH; when it is stopped the very best.

    Args:
        folder: of the training.
        settings: of the training.
        robot: that it is for.
        seed: of the training.
        data: of an offline training: what its episodes were collected of.
        dataset: of one that was given its episodes: where they came from.
        goes_on: whether the run goes on where the one before was stopped, so that it comes by the same validations again.
    """

    def __init__(
        self,
        folder: Path,
        settings: AnySettings,
        robot: RobotModel,
        seed: int,
        data: Mapping[str, Any] | None = None,
        dataset: str | None = None,
        *,
        goes_on: bool = False,
    ) -> None:
        self._folder, self._settings, self._robot, self._seed = folder, settings, robot, seed
        self._data, self._dataset, self._goes_on = data, dataset, goes_on
        self._written: Point | None = None
        self._written_at = -WRITE_EACH

    def keep(self, network: BasePolicy, progress: Progress, *, is_end: bool = False) -> None:
        """Write the best model, where it is another than the one written last, and none that is there did better.

        Args:
            network: of the model in training, which stays as it is.
            progress: with the weights that did best.
            is_end: whether the training is stopped, so that it is now or never.
        """
        best = progress.best_point
        is_due = is_end or time.monotonic() >= self._written_at + WRITE_EACH
        if best is None or best == self._written or not is_due:
            return
        path, place = self._folder / f"best-{best.steps}", (best.success, best.steps)
        there = {other: place_of(other) for other in models_so_far(self._folder)}
        best_there = max(there.values(), default=(-1.0, -1))
        if best_there > place or (best_there == place and self._goes_on):
            return
        if path.exists():  # of an earlier run: under another name of the same kind until this one is whole
            if path not in there:  # no model: it is somebody else's
                return
            _remove(path.with_name(f"best-0{best.steps}"))
            put_aside(path, f"best-0{best.steps}")
        self._write(path, network, progress)
        for other in sorted(models_so_far(self._folder)):
            if other != path:
                _remove(other)
        self._written, self._written_at = best, time.monotonic()

    def _write(self, path: Path, network: BasePolicy, progress: Progress) -> None:
        assert progress.best_point is not None
        run = {"curve": [asdict(point) for point in progress.points], "best": asdict(progress.best_point)}
        runs = {str(self._seed): {**run, "held_out": {}}}
        with moved_when_done(self._folder / ".best.partial", path) as stage, lent(network, progress.best):
            write_agent(stage, network, self._settings, self._robot, runs, self._data, self._dataset)

    def put_by_ended(self, progress: Progress) -> None:
        """Keep the model of a run that --minutes have ended, where it did better than the one that is to take its place.

        A run that goes on from the checkpoint does not come by that model's last validation, which the end alone had asked for.
        """
        if not (self._folder / CONFIG).exists():
            return
        config, best = read_config(self._folder), progress.best_point
        assert best is not None
        ended = config["runs"][str(config["seed"])]["best"]
        path = self._folder / f"best-{ended['steps']}"
        if ended["success"] <= best.success or path.exists():
            return
        with suppress(ValueError):  # of a damaged one nothing is lost
            for name in (GRAPH, WEIGHTS):
                read_checked(self._folder / name, config["sha256"][name])
            with moved_when_done(self._folder / ".best.partial", path) as stage:
                gather([self._folder], stage)

    def clear(self, progress: Progress) -> None:
        """Remove them, as the model itself is there, but for those of an earlier run that did better."""
        best = progress.best_point
        assert best is not None
        for path in models_so_far(self._folder):
            if place_of(path) <= (best.success, best.steps):
                _remove(path)
            else:
                logger.warning(
                    "%s of an earlier run did better in its validation than the model in %s", path, self._folder
                )


def keep_earlier_curve(folder: Path) -> None:
    """Name the curve of an earlier run `curve-STEPS.csv`, by its last validation: a run that begins again writes its own."""
    path = folder / CURVE
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    steps = lines[-1].partition(",")[0] if lines else ""
    if steps.isdecimal():
        put_aside(path, f"curve-{steps}.csv")


@contextmanager
def lent(network: BasePolicy, weights: Mapping[str, torch.Tensor]) -> Iterator[None]:
    """Let a network have other weights for a while: one that is stopped while it learns cannot be copied."""
    own = {name: value.detach().clone() for name, value in network.state_dict().items()}
    is_training = network.training
    network.load_state_dict(weights)
    try:
        yield
    finally:
        network.load_state_dict(own)
        network.set_training_mode(is_training)


def _remove(path: Path) -> None:
    """Remove a model, and nothing that only has the name of one."""
    if re.fullmatch(r"best-\d+", path.name) and not path.is_symlink() and (path / CONFIG).is_file():
        shutil.rmtree(path)
