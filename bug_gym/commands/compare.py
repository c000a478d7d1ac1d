"""`bug-gym compare`: what has changed from one results folder to another."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bug_gym.commands.arguments import told_path
from bug_gym.files import writable

if TYPE_CHECKING:
    from bug_gym.evaluation.two_folders import Change

MOST_TOLD = 10
"""Seeds that are told of what a policy has lost or won in a scenario."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument(
        "old", metavar="OLD", type=told_path, help="results folder of `evaluate --out`, before the change"
    )
    parser.add_argument("new", metavar="NEW", type=told_path, help="the one after it")
    parser.add_argument("--out", type=told_path, help="JSON to write: all differences, and each world lost and won")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from rich.console import Console

    from bug_gym.evaluation.by_name import RENDER_ONE  # loads the compiler
    from bug_gym.evaluation.report import FEWER_PAIRS, print_text_table  # loads the compiler
    from bug_gym.evaluation.two_folders import change_table, compare_folders, write_comparison  # loads the compiler

    if options.out:
        _require_outside(writable(options.out), (options.old, options.new))

    comparison = compare_folders(options.old, options.new)
    if options.out:
        write_comparison(options.out, comparison)
    console = Console()
    title, header, lines = change_table(comparison.changes)
    print_text_table(title, header, lines, console)
    if any(cell.endswith(")") for line in lines for cell in line[2:]):
        print(FEWER_PAIRS)
    told = _told_seeds(comparison.changes)
    for line in [*told, *comparison.notes]:
        print(line)
    if told:
        print(f"to see one: {RENDER_ONE}")
    if options.out:
        print(f"all differences, and each world lost and won: {options.out}")


def _require_outside(file: Path, folders: Sequence[Path]) -> None:
    """Raise a ValueError where a file would lie in one of some folders, perhaps in the place of one of theirs."""
    for folder in folders:
        if file.resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"--out: {file} lies in the results folder {folder}, expected a file outside of both")


def _told_seeds(changes: Sequence[Change]) -> list[str]:
    """Which worlds were lost and won, a line of each policy and scenario with any."""
    from bug_gym.evaluation.summary import OVERALL  # loads the compiler

    lines = []
    for change in changes:
        for kind, worlds in (("lost", change.lost), ("won", change.won)):
            if worlds and change.scenario != OVERALL:
                more = f" and {len(worlds) - MOST_TOLD} more" if len(worlds) > MOST_TOLD else ""
                seeds = ", ".join(str(seed) for _, seed in worlds[:MOST_TOLD])
                lines.append(f"{change.policy} in {change.scenario} {kind} seed {seeds}{more}")
    return lines
