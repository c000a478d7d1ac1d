"""`bug-gym train`: a learned policy, from a training of configs/train or of a YAML file."""

from __future__ import annotations

import argparse
import shlex
from functools import partial
from pathlib import Path
from typing import Any

from bug_gym.checks import needed_from
from bug_gym.commands.arguments import (
    above_zero,
    add_trust,
    add_workers,
    assignments,
    at_least_one,
    told_path,
    workers_of,
)
from bug_gym.files import file_name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("name", metavar="NAME", help="a training (bug-gym list trainings), or the path of a YAML file")
    parser.add_argument("--out", type=told_path, help="folder of the model (default: results/train/NAME)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first model (default: 0)")
    parser.add_argument("--seeds", type=at_least_one, default=1, help="how many models, a seed each (default: 1)")
    parser.add_argument(
        "--steps", type=at_least_one, help="environment steps, offline those of the gradient (default: the training's)"
    )
    parser.add_argument("--minutes", type=above_zero, help="end after so many minutes of training (default: all steps)")
    parser.add_argument(
        "--threads", type=at_least_one, help="threads of torch (default: one for each core, offline one)"
    )
    add_trust(parser)
    add_workers(parser, at_least_one)
    parser.add_argument("--start-from", metavar="MODEL", help="name or folder of a model of ours to begin with")
    parser.add_argument(
        "--curriculum",
        metavar="NAME",
        help="learn by the stages of another training, or of the key `curriculum` of a YAML file",
    )
    parser.add_argument(
        "--dataset",
        metavar="DATASET",
        help="what an offline training learns from: folder or name of a dataset of `bug-gym collect` "
        "(default: the training's, collected first where it is not there)",
    )
    parser.add_argument(
        "--set",
        dest="overrides",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="replace a value of the training, such as gamma=0.98; may come several times",
    )
    parser.set_defaults(told_left=str)  # nothing, until it is known what is trained


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    with needed_from("train", "training", whole=True):
        from bug_gym.agents.learning.training import left_to_train, told_left, train_seeds  # loads torch
    from bug_gym.agents.learning.settings import OfflineSettings, load_settings, read_curriculum  # loads the compiler

    overrides = assignments(options.overrides) | ({"n_timesteps": options.steps} if options.steps else {})
    overrides |= {"start_from": options.start_from} if options.start_from else {}
    overrides |= {"curriculum": read_curriculum(options.curriculum)} if options.curriculum else {}
    settings = load_settings(options.name, overrides, trust=options.trust)
    options.out = options.out or Path("results", "train", file_name(settings.name))
    arguments: dict[str, Any] = {"seeds": range(options.seed, options.seed + options.seeds), "minutes": options.minutes}
    if options.dataset is not None and not isinstance(settings, OfflineSettings):
        raise ValueError(f"{settings.name} learns in worlds: only offline trainings take a dataset")
    is_elsewhere = options.cluster is not None or options.workers > 1
    options.told_left = partial(told_left, settings, options.out, **arguments, is_elsewhere=is_elsewhere)
    left_to_train(settings, options.out, **arguments, is_elsewhere=is_elsewhere)  # before anything is collected for it
    with workers_of(options) as workers:
        arguments["workers"] = workers
        if isinstance(settings, OfflineSettings):
            best = _train_offline(settings, options, arguments)
        else:
            best = train_seeds(settings, options.out, threads=options.threads, progress=True, **arguments)
    print(f"{best}: play it with --policies {shlex.quote(f'{best}/')}")


def _train_offline(settings: Any, options: argparse.Namespace, arguments: dict[str, Any]) -> Path:
    """Train on a dataset, or DAgger on its expert's answers."""
    from bug_gym.agents.learning.offline import train_offline_seeds  # loads torch
    from bug_gym.agents.learning.settings import DaggerSettings  # loads the compiler
    from bug_gym.evaluation.datasets import episodes_for  # loads the compiler

    if isinstance(settings, DaggerSettings):
        if options.dataset is not None:
            raise ValueError(f"{settings.name} learns from its expert's answers, it takes no dataset")
        episodes = None
    else:
        episodes = episodes_for(settings, options.dataset, progress=True)
    arguments |= {"episodes": episodes, "dataset": options.dataset, "threads": options.threads or 1}
    return train_offline_seeds(settings, options.out, progress=True, **arguments)
