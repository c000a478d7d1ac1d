"""What the arguments of several commands have in common."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from bug_gym.assignments import assignments as assignments  # for the commands
from bug_gym.checks import checked_time, shortened
from bug_gym.files import out_path
from bug_gym.limits import MOST

if TYPE_CHECKING:
    from bug_gym.evaluation.entries import PolicyEntry
    from bug_gym.workers import Workers


TRUST = (
    "import and run the code that scenarios name: functions of reward_terms and observation_fields, families of worlds; and "
    "policies that a training names"
)


def at_least_one(text: str) -> int:
    """A whole number from 1 to MOST."""
    with suppress(ValueError):
        if 1 <= (number := int(text)) <= MOST:
            return number
    raise argparse.ArgumentTypeError(f"got {shortened(text)}, expected a whole number from 1 to {MOST:,}")


def above_zero(text: str) -> float:
    """A finite number above 0."""
    try:
        return checked_time("it", float(text))
    except ValueError:
        raise argparse.ArgumentTypeError(f"got {shortened(text)}, expected a number above 0") from None


def told_path(text: str) -> Path:
    """The path that a text names, with `~` for a home, which a shell leaves as it is behind `--out=`."""
    try:
        return out_path(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """A scenario with its seed and overrides, and the size of its picture."""
    parser.add_argument("scenario", metavar="SCENARIO", help="name or path of a scenario")
    add_world(parser)


def add_world(parser: argparse.ArgumentParser) -> None:
    """The seed and the overrides of a scenario, whether its code is trusted, and the size of its picture."""
    parser.add_argument("--seed", type=int, default=0, help="seed of the world (default: 0)")
    parser.add_argument("--size", type=int, default=600, help="longer side of the picture in pixels (default: 600)")
    add_overrides(parser)
    add_trust(parser)


def add_trust(parser: argparse.ArgumentParser) -> None:
    """`--trust`, without which no code is run that a scenario names."""
    parser.add_argument("--trust", action="store_true", help=TRUST)


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """`--set KEY=VALUE`, values that replace the scenario's."""
    parser.add_argument(
        "--set",
        dest="overrides",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="replace a value of the scenario, such as lidar.beams=180; may come several times",
    )


def add_workers(parser: argparse.ArgumentParser, number: Callable[[str], int] = int) -> None:
    """`--workers N`, or `--cluster ADDRESS` in its place."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--workers", type=number, default=1, help="processes (default: 1)")
    group.add_argument(
        "--cluster", metavar="ADDRESS", help="have a Ray cluster do the work: HOST:PORT of its head, or auto"
    )


@contextmanager
def workers_of(options: argparse.Namespace) -> Iterator[Workers]:
    """Who does the work that these options speak of.

    Raises:
        ImportError: Ray is not installed.
        ValueError: there is no such cluster.
    """
    if options.cluster is None:
        yield options.workers
        return
    from bug_gym.cluster import connected  # only where it is asked for

    with connected(options.cluster) as cluster:
        yield cluster


def split_policies(text: str) -> list[str]:
    """The policies of NAME[:PARAMETER=VALUE...],..., still as text; blanks about commas are none of theirs.

    Raises:
        ValueError: nothing stands before, between or behind commas.
    """
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise ValueError(f"got an empty name in {shortened(text)}, expected names of policies with a comma between two")
    return names


def policy_entries(text: str) -> list[PolicyEntry]:
    """The policies of NAME[:PARAMETER=VALUE...],..., each called so by tables, too."""
    return [policy_entry(name) for name in split_policies(text)]


def policy_entry(text: str) -> PolicyEntry:
    """A policy from NAME[:PARAMETER=VALUE...], which is also what tables call it."""
    from bug_gym.evaluation.entries import PolicyEntry  # loads the compiler

    return PolicyEntry.of(text)
