"""What offline trainings learn from: datasets of `bug-gym collect` as arrays, collected first where there are none."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import bug_gym
from bug_gym.agents.learning.recorded import Recorded
from bug_gym.agents.learning.settings import FromData
from bug_gym.config import Scenario
from bug_gym.evaluation.collection import MIXED, collect
from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.evaluation.minari_files import open_dataset, read_identity, require_minari
from bug_gym.files import released
from bug_gym.held_out import TRAINING_SEEDS
from bug_gym.observation import as_flat, fields, width
from bug_gym.references import source_digest
from bug_gym.scenario_code import data_digest, own_code

COLLECTED = Path("results", "datasets")
"""Folder of the datasets that trainings have had collected: POLICIES-EPISODES-DIGEST, see `_digest`."""
LONGEST = 200
"""Bytes of the names of policies in the name of a folder."""


def episodes_for(
    settings: FromData,
    dataset: str | os.PathLike[str] | None = None,
    *,
    root: Path = COLLECTED,
    workers: int = 1,
    progress: bool = False,
) -> Recorded:
    """The episodes that a training learns from.

    Args:
        settings: of the training.
        dataset: folder of a dataset, or its name where Minari finds it; None: what the settings say, collected first where
            it is not there, in worlds that no evaluation sees.
        root: folder of the datasets that are collected.
        workers: processes that share that work.
        progress: whether to show a bar on the terminal.

    Raises:
        ImportError: no Minari.
        ValueError: no dataset, a damaged one, or one of another scenario or version than the training's.
    """
    require_minari()
    (scenario,) = settings.loaded
    if dataset is None:
        return read_episodes(_collected(settings, scenario, root, workers, progress=progress), scenario)
    return read_episodes(_folder_of(dataset), scenario)


def _collected(settings: FromData, scenario: Scenario, root: Path, workers: int, *, progress: bool) -> Path:
    """Folder of the dataset that a training's settings tell of; a few policies' each in one of its own."""
    data = settings.data
    entries = [PolicyEntry.of(policy) for policy in data.policies]
    place = root / f"{_name_of(data.policies)}-{data.episodes}-{_digest(scenario, entries)}"
    names = collect(
        scenario,
        entries,
        place,
        episodes=data.episodes,
        seed=TRAINING_SEEDS,
        forms=("flat",),
        expert=data.policies[0],
        workers=workers,
        progress=progress,
    )
    return place / (names[0] if len(entries) == 1 else next(name for name in names if f"/{MIXED}_flat-" in name))


def _name_of(policies: Sequence[str]) -> str:
    """Policies in the name of a folder, which has at most 255 bytes: of many the first ones, and a digest of all of them."""
    name = "+".join(policies).replace(":", "_").replace(os.sep, "_")
    if len(name.encode()) <= LONGEST:
        return name
    digest = hashlib.sha256(json.dumps(list(policies)).encode()).hexdigest()[:8]
    return f"{name.encode()[:LONGEST].decode(errors='ignore')}-{digest}"


def _digest(scenario: Scenario, entries: Sequence[PolicyEntry]) -> str:
    """What tells a dataset from others of the same policies: version, scenario, and the code and files that it is made of."""
    codes = [own_code(scenario), data_digest(scenario), *(entry.code for entry in entries)]
    told = [released(bug_gym.__version__), source_digest(), scenario.digest, *codes]
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:8]


def _folder_of(dataset: str | os.PathLike[str]) -> Path:
    """The folder of a dataset: its path, or what Minari knows by that name."""
    folder = Path(dataset).expanduser()
    if folder.exists():
        return folder
    from minari.storage import get_dataset_path

    known = Path(get_dataset_path(str(dataset)))
    if not known.exists():
        raise ValueError(f"no dataset {dataset}: neither a folder nor a name of Minari's, which would lie in {known}")
    return known


def read_episodes(folder: Path, scenario: Scenario) -> Recorded:
    """The episodes of a dataset that `bug-gym collect` has written, with Dict or flat observations.

    Raises:
        ImportError: no Minari.
        ValueError: no dataset, a damaged one, or one of another scenario or version of this package.
    """
    dataset = open_dataset(folder, scenario)
    table = fields(scenario)
    parts: dict[str, list[Any]] = {"observations": [], "actions": [], "rewards": [], "terminated": []}
    try:
        for episode in dataset.iterate_episodes():
            seen = episode.observations
            parts["observations"].append(as_flat(seen, table) if isinstance(seen, Mapping) else seen)
            parts["actions"].append(episode.actions)
            parts["rewards"].append(episode.rewards)
            parts["terminated"].append(bool(episode.terminations[-1]))
    except (OSError, KeyError, IndexError, RuntimeError) as error:
        raise ValueError(f"{folder} is damaged: {error}") from None
    _require_fit(folder, parts, width(table))
    return Recorded(
        np.concatenate(parts["observations"]).astype(np.float32),
        np.concatenate(parts["actions"]).astype(np.float32),
        np.concatenate(parts["rewards"]).astype(np.float64),
        np.array([len(actions) for actions in parts["actions"]], dtype=np.int64),
        np.array(parts["terminated"]),
        read_identity(folder),
    )


def _require_fit(folder: Path, parts: Mapping[str, list[Any]], expected: int) -> None:
    """Raise a ValueError where arrays do not fit each other, the robot's observation or its actions."""
    for seen, actions, rewards in zip(parts["observations"], parts["actions"], parts["rewards"], strict=True):
        steps = len(rewards)
        if np.shape(seen) != (steps + 1, expected) or np.shape(actions) != (steps, 2) or steps < 1:
            shapes = f"observations {np.shape(seen)} and actions {np.shape(actions)}"
            wanted = f"({steps + 1}, {expected}) and ({steps}, 2)"
            raise ValueError(f"{folder} has {shapes} in an episode of {steps} steps, expected {wanted}")
        if not all(np.isfinite(values).all() for values in (seen, actions, rewards)):
            raise ValueError(f"{folder} holds a number that is not finite")
