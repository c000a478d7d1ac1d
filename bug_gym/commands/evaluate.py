"""`bug-gym evaluate`: policies in the same worlds, measured."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from bug_gym.commands.arguments import (
    add_overrides,
    add_trust,
    add_workers,
    assignments,
    policy_entries,
    told_path,
    workers_of,
)

if TYPE_CHECKING:
    from rich.console import Console

    from bug_gym.evaluation.rows import EpisodeRow
    from bug_gym.evaluation.summary import Summary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    task = parser.add_mutually_exclusive_group(required=True)
    task.add_argument("--suite", help="name or path of a suite")
    task.add_argument("--scenario", action="append", help="name or path of a scenario; may come several times")
    parser.add_argument(
        "--policies",
        help="NAME[:PARAMETER=VALUE...],..., a NAME also my_module:MyBug or my_bug.py:MyBug (default: the suite's, or all)",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        help="worlds of each scenario that a suite does not drive in once (default: the suite's, or 50)",
    )
    parser.add_argument("--seed", type=int, help="seed of the first world (default: the suite's, or 0)")
    add_workers(parser)
    parser.add_argument(
        "--baseline",
        help="policy that the others are compared with (default: the most successful one that does not read the map)",
    )
    parser.add_argument(
        "--no-privileged", dest="privileged", action="store_false", help="leave out policies that read the map"
    )
    parser.add_argument("--data", type=told_path, help="somebody else's data that a suite needs")
    parser.add_argument(
        "--out",
        type=told_path,
        help="folder for rows, summary and report; goes on with a run cut off, or asked for more",
    )
    parser.add_argument(
        "--pictures", action="store_true", help="draw a typical episode of each policy and scenario into --out, too"
    )
    parser.add_argument("--replays", type=int, help="most episodes, failures, that the report replays (default: 24)")
    parser.add_argument(
        "--replay-successes", action="store_true", help="a success of each policy and scenario is among them"
    )
    add_trust(parser)
    parser.add_argument("--details", action="store_true", help="print all tables, and the paired differences")
    parser.add_argument(
        "--repair",
        action="store_true",
        help="drop lines of --out that stand there twice, or that this run cannot have, as of a policy mended since",
    )
    add_overrides(parser)


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from rich.console import Console

    from bug_gym.evaluation import FailedPolicyError, evaluate  # loads the compiler
    from bug_gym.evaluation.matrix import print_matrix  # loads the compiler
    from bug_gym.evaluation.replays import REPLAYS  # loads the compiler
    from bug_gym.evaluation.report import print_text_table  # loads the compiler
    from bug_gym.evaluation.suites import load_suite  # loads the compiler
    from bug_gym.evaluation.summary import summarise  # loads the compiler
    from bug_gym.evaluation.teams import team_tables  # loads the compiler

    if options.replays is not None and options.out is None:
        raise ValueError("got --replays and no folder, expected one (--out FOLDER), whose report replays them")
    failed = None
    with workers_of(options) as workers:
        try:
            rows = evaluate(
                policy_entries(options.policies) if options.policies else None,
                load_suite(options.suite) if options.suite else options.scenario,
                episodes=options.episodes,
                seed=options.seed,
                workers=workers,
                out=options.out,
                overrides=assignments(options.overrides),
                progress=True,
                data=options.data,
                baseline=options.baseline,
                repair=options.repair,
                privileged=options.privileged,
                trust=options.trust,
                pictures=options.pictures,
                replays=REPLAYS if options.replays is None else options.replays,
                replay_successes=options.replay_successes,
            )
        except FailedPolicyError as error:
            if options.out is None:
                error.add_note("a traceback: --out FOLDER")
            if not error.rows:
                raise
            rows, failed = error.rows, error  # what is there is told first
    console, summaries = Console(), summarise(rows)
    print_matrix(summaries, console)
    for team in team_tables(rows):
        print_text_table(*team, console)
    if options.details:
        _print_details(rows, summaries, options.baseline, console)
    _tell_files(options)
    if failed is not None:
        raise failed


def _print_details(rows: list[EpisodeRow], summaries: list[Summary], baseline: str | None, console: Console) -> None:
    """Every other table: those of the scenarios, and the paired differences, those of teams too."""
    from bug_gym.evaluation.report import print_differences, print_table, print_text_table  # loads the compiler
    from bug_gym.evaluation.summary import PRIVILEGED, compare, default_baseline  # loads the compiler
    from bug_gym.evaluation.teams import team_differences  # loads the compiler

    if baseline is not None and all(row.policy != baseline for row in rows):
        baseline += PRIVILEGED
    if baseline is None or all(row.policy != baseline for row in rows):  # it may have failed
        baseline = default_baseline(rows)
    print_table(summaries, console)
    print_differences(compare(rows, baseline), console)
    for table in team_differences(rows, baseline):
        print_text_table(*table, console)


def _tell_files(options: argparse.Namespace) -> None:
    """How to see more, and where the files lie."""
    from bug_gym.evaluation.page import PAGE  # loads the compiler

    if not options.details:
        files = "" if options.out else "; rows, summary and a report: --out FOLDER"
        print(f"all tables and the differences between policies: --details{files}")
    if options.out:
        has_pictures = any(options.out.glob("pictures/*.png"))
        print(f"report: {options.out / PAGE}")
        print(f"{'rows, summary and pictures' if has_pictures else 'rows and summary'}: {options.out}")
