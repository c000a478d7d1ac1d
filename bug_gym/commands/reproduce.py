"""`bug-gym reproduce`: what a paper reports, run again."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from bug_gym.commands.arguments import add_workers, at_least_one, split_policies, told_path, workers_of
from bug_gym.files import commit, replaced_when_done, writable
from bug_gym.reproductions import reproduction, require_use
from bug_gym.reproductions.result import Reproduction, Settings

if TYPE_CHECKING:
    from bug_gym.workers import Workers

NOT_HELD = 3
"""Exit code where a claim is false, for whoever asks for one; no other end of the command has it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("name", metavar="NAME", help="what to run again (bug-gym list reproductions)")
    parser.add_argument("--seeds", type=at_least_one, help="seeds of each claim (default: all of them)")
    parser.add_argument("--policies", help="NAME,... where a reproduction leaves the choice")
    parser.add_argument(
        "--data",
        type=told_path,
        help="data that a reproduction needs; file in which a long one keeps what it finds, and goes on",
    )
    add_workers(parser, at_least_one)
    parser.add_argument(
        "--out",
        type=told_path,
        help="JSON to write, with the commit that made it; curves as PNG and a page as HTML beside it",
    )
    parser.add_argument(
        "--strict",
        action="store_true",
        help="exit with 3 where a claim is found false (default: 0, it is a result, too); 1 and 2 are errors",
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code."""
    from bug_gym.drawing.clips import PNG  # loads the compiler

    out = options.out and writable(options.out, [".json"])
    if out:
        for suffix in (PNG, ".html"):
            writable(out.with_suffix(suffix))
    reproduce = reproduction(options.name)
    made_at = commit() if out else ""  # of what is imported: hours later other source may lie here
    policies = tuple(split_policies(options.policies)) if options.policies else ()
    require_use(options.name, Settings(options.seeds, data=options.data, policies=policies))
    with workers_of(options) as workers:
        result = reproduce(Settings(options.seeds, workers, options.data, progress=True, policies=policies))
    told: list[str] = []
    try:  # files first: where nobody reads the tables, printing them ends the command
        for line in _written(out, result, options, made_at) if out else ():
            told.append(line)
    finally:  # and tables also where a file could not be written
        _print(result)
        for line in told:
            print(line)
    return NOT_HELD if options.strict and result.holds is False else 0


def _print(result: Reproduction) -> None:
    """Print tables, notes and the verdict."""
    from rich.console import Console

    from bug_gym.evaluation.report import print_text_table  # loads the compiler

    console = Console()
    for table in result.tables:
        print_text_table(table.title, table.header, table.rows, console)
    for note in result.notes:
        console.print(note, markup=False, highlight=False)
    if result.holds is not None:
        console.print("every claim holds" if result.holds else "NOT every claim holds", style="bold")


def _written(out: Path, result: Reproduction, options: argparse.Namespace, made_at: str) -> Iterator[str]:
    """Write numbers, page and curves; gives a line about a file once it is there."""
    from bug_gym.drawing.clips import PNG  # loads the compiler
    from bug_gym.evaluation.curves import draw_curves  # loads the compiler

    with replaced_when_done(out) as partial:
        Path(partial).write_text(result.as_json(made_at), encoding="utf-8")
    yield f"numbers: {out}"
    page = out.with_suffix(".html")
    with workers_of(options) as workers:
        _write_page(page, result, workers)
    yield f"report: {page}"
    if result.curves:  # after the numbers, which are not lost where matplotlib is missing
        draw_curves(out.with_suffix(PNG), result.curves)


def _write_page(path: Path, result: Reproduction, workers: Workers) -> None:
    """The page about a reproduction: its tables, some of its episodes to watch, and what its rows say."""
    from bug_gym.evaluation.page import write_page  # loads the compiler
    from bug_gym.evaluation.page.findings import results, watched  # loads the compiler
    from bug_gym.evaluation.summary import compare, default_baseline, summarise  # loads the compiler
    from bug_gym.reproductions.replayable import played, replays  # loads the compiler

    rows, shown = result.rows, played(result.episodes)
    recorded = replays(shown, workers)
    tables = [(table.title, table.header, table.rows) for table in result.tables]
    first = [results(tables, result.notes, result.holds), *watched(shown, recorded)]
    differences = compare(rows, default_baseline(rows)) if rows else []
    write_page(path, result.name, rows, summarise(rows) if rows else [], differences, recorded, first)
