"""Trainings in other processes of this machine or on the nodes of a cluster: a training fills a core, many fill a cluster.

What a training leaves comes back as bytes and is written where it was asked for, so nodes need no disk in common. A training
whose process or node is lost begins anew, not from a checkpoint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from bug_gym.agents.learning.checkpoints import CHECKPOINT
from bug_gym.agents.learning.folder import CONFIG
from bug_gym.agents.learning.settings import AnySettings
from bug_gym.files import HOLDER, LOCK, replaced_when_done
from bug_gym.workers import Workers, each


class Job(NamedTuple):
    """A training, and where its model goes."""

    train: Callable[..., Any]
    """Trains: of settings, folder and `seed`."""
    settings: AnySettings
    """What to train."""
    seed: int
    """Of the network and the worlds."""
    folder: Path
    """On the machine that asks."""


def train_each(jobs: Sequence[Job], workers: Workers) -> Iterator[Job]:
    """Have trainings done, and write what each leaves into its folder; yields them in order of arrival.

    The folders, or one about them, are the caller's alone meanwhile (`one_writer`).
    """
    for number, files in each(_train, list(enumerate(jobs)), workers):
        write_files(jobs[number].folder, files)
        yield jobs[number]


def _train(numbered: tuple[int, Job]) -> tuple[int, dict[str, bytes]]:
    """A training in a folder of its own, and the files that it leaves, by name."""
    number, job = numbered
    with TemporaryDirectory() as stage:
        job.train(job.settings, stage, seed=job.seed)
        left = [
            file for file in Path(stage).iterdir() if file.is_file() and file.name not in (CHECKPOINT, LOCK, HOLDER)
        ]
        return number, {file.name: file.read_bytes() for file in left}


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a model's files, the one last that says that it is whole."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in sorted(files, key=lambda name: (name == CONFIG, name)):
        with replaced_when_done(folder / name) as partial:
            partial.write_bytes(files[name])
