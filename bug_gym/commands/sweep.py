"""`bug-gym sweep`: trainings with other values each, from a sweep of configs/sweeps or of a YAML file."""

from __future__ import annotations

import argparse
import shlex
from functools import partial
from pathlib import Path

from bug_gym.checks import needed_from
from bug_gym.commands.arguments import add_trust, add_workers, at_least_one, told_path, workers_of
from bug_gym.files import file_name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("name", metavar="NAME", help="a sweep (bug-gym list sweeps), or the path of a YAML file")
    parser.add_argument("--out", type=told_path, help="folder of its models (default: results/sweeps/NAME)")
    add_trust(parser)
    add_workers(parser, at_least_one)


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    with needed_from("train", "training", whole=True):
        from bug_gym.agents.learning.sweeps import sweep  # loads torch
    from rich.console import Console

    from bug_gym.agents.learning.sweep_settings import load_sweep  # loads the compiler

    settings = load_sweep(options.name, trust=options.trust)
    options.out = options.out or Path("results", "sweeps", file_name(settings.name))
    console = Console(stderr=True)
    report = partial(console.print, markup=False, highlight=False, soft_wrap=True)  # a line is a line, in a log too
    with workers_of(options) as workers:
        best = sweep(settings, options.out, workers=workers, report=report)
    model = best / "seed-0"
    print(f"{model}: play it with --policies {shlex.quote(f'{model}/')}; all trials: {options.out / 'sweep.csv'}")
