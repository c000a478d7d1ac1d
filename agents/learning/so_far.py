"""The best model of a training that has not ended, as a folder that can be played: of one that is stopped it is what is left.

Each lies in a folder of its own, `best-STEPS`, which appears whole; only then the one before goes. So a kill at any moment
leaves a whole one, and never files of two.
"""

from __future__ import annotations

import copy
import re
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from stable_baselines3.common.policies import BasePolicy

from bug_gym.agents.learning.folder import CONFIG, Point
from bug_gym.agents.learning.models import write_agent
from bug_gym.agents.learning.progress import Progress
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.learning.settings import AnySettings
from bug_gym.files import moved_when_done

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
    """

    def __init__(
        self,
        folder: Path,
        settings: AnySettings,
        robot: RobotModel,
        seed: int,
        data: Mapping[str, Any] | None = None,
    ) -> None:
        self._folder, self._settings, self._robot, self._seed, self._data = folder, settings, robot, seed, data
        self._written: Point | None = None
        self._written_at = -WRITE_EACH

    def keep(self, network: BasePolicy, progress: Progress, *, is_end: bool = False) -> None:
        """Write the best model, where it is another than the one written last.

        Args:
            network: of the model in training, which stays as it is.
            progress: with the weights that did best.
            is_end: whether the training is stopped, so that it is now or never.
        """
        best = progress.best_point
        is_due = is_end or time.monotonic() >= self._written_at + WRITE_EACH
        if best is None or best == self._written or not is_due:
            return
        path = self._folder / f"best-{best.steps}"
        if not path.exists():  # a training that goes on may come by the same validation again
            self._write(path, network, progress)
        for other in sorted(self._folder.glob("best-*")):
            if other != path:
                _remove(other)
        self._written, self._written_at = best, time.monotonic()

    def _write(self, path: Path, network: BasePolicy, progress: Progress) -> None:
        mine = copy.deepcopy(network)
        mine.load_state_dict(progress.best)
        assert progress.best_point is not None
        run = {"curve": [asdict(point) for point in progress.points], "best": asdict(progress.best_point)}
        with moved_when_done(self._folder / ".best.partial", path) as stage:
            write_agent(
                stage, mine, self._settings, self._robot, {str(self._seed): {**run, "held_out": {}}}, self._data
            )

    def clear(self) -> None:
        """Remove them: the model itself is there."""
        for path in self._folder.glob("best-*"):
            _remove(path)


def _remove(path: Path) -> None:
    """Remove a model, and nothing that only has the name of one."""
    if re.fullmatch(r"best-\d+", path.name) and not path.is_symlink() and (path / CONFIG).is_file():
        shutil.rmtree(path)
