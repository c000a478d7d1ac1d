"""`bug-gym benchmark`: speeds on this machine."""

from __future__ import annotations

import argparse

from bug_gym.commands.arguments import above_zero, told_path
from bug_gym.files import writable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("--repeats", type=int, default=5, help="times that each speed is measured (default: 5)")
    parser.add_argument("--seconds", type=above_zero, default=0.5, help="how long each time (default: 0.5)")
    parser.add_argument("--worlds", type=int, default=1024, help="worlds side by side (default: 1024)")
    parser.add_argument("--out", type=told_path, help="JSON to write")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.benchmark import run_benchmark  # loads the compiler

    out = options.out and writable(options.out)
    run_benchmark(repeats=options.repeats, seconds=options.seconds, worlds=options.worlds, out=out)
