"""Policies in the same worlds, measured: `evaluate` makes one row an episode and robot, paired by seed.

A suite (configs/suites/*.yaml) names scenarios and seeds as data. A result folder holds manifest.json (what was asked),
rows.jsonl (one row a line, in order of arrival), the summary, report.html with some episodes to replay, and where it is asked
for a picture of a typical episode for each policy and scenario. A run that was cut off goes on where it stopped: rows on disk
are done.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any

from bug_gym.checks import checked_count, shortened
from bug_gym.evaluation.by_name import differing_names
from bug_gym.evaluation.failures import FailedPolicyError, Failure
from bug_gym.evaluation.page import PAGE, write_page
from bug_gym.evaluation.pictures import draw_typical
from bug_gym.evaluation.plan import Plan, make_plan
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.replays import REPLAYS, chosen, record_episode, replays_of, wanted
from bug_gym.evaluation.report import write_summary
from bug_gym.evaluation.results_folder import opened
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import PRIVILEGED, compare, default_baseline, summarise
from bug_gym.evaluation.two_folders import compare_folders, read_rows
from bug_gym.evaluation.work import drive_missing, known_lengths, missing_worlds, require_sendable
from bug_gym.workers import Workers, are_several, checked_workers, on_this_machine

__all__ = ["FailedPolicyError", "compare_folders", "evaluate", "make_plan", "read_rows", "record_episode"]

logger = logging.getLogger("bug_gym")


def evaluate(
    policies: Any,
    scenario_or_suite: Any,
    episodes: int | None = None,
    seed: int | None = None,
    workers: Workers = 1,
    out: str | os.PathLike[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: bool = False,
    data: str | os.PathLike[str] | None = None,
    baseline: str | None = None,
    repair: bool = False,
    privileged: bool = True,
    trust: bool = False,
    pictures: bool = False,
    replays: int = REPLAYS,
    replay_successes: bool = False,
) -> list[EpisodeRow]:
    """Drive policies through the same worlds and measure each episode.

    Args:
        policies: a list of names with or without options (`bug2:turn=right`), Specs, paths of models, classes, "module:Class"
            or "file.py:Class", (label, one of those, parameters), dicts with label, name and parameters, or objects with
            `predict`; one of them; or None for those of the suite, or all that are registered.
        scenario_or_suite: a scenario or a list of them, each a name, path, dict or Scenario; or a suite, likewise.
        episodes: worlds of each scenario; None: as many as the suite says, 50 without one.
        seed: of the first world, the others count up; None: as the suite says, 0 without one.
        workers: processes that share the work, or a cluster that does (`bug_gym.cluster.connected`). Times of decisions
            are fair where each process has a core of its own.
        out: a folder for the rows as they come, the summary and the report. A run that was cut off goes on from it, and
            one that asks for more; one process at a time writes there.
        overrides: values by dotted key that replace those of every scenario.
        progress: whether to show a bar on the terminal.
        data: path of the data that a suite needs and that is not part of this package.
        baseline: label of the policy that the summary compares the others with, with or without the mark of those that
            read the map; None: the most successful one that does not read it, see `summary.default_baseline`.
        repair: whether lines of `out` that this run cannot have, as of a policy from outside that was mended since, or has
            twice, are dropped; else they are an error.
        privileged: whether policies that read the map take part; tables mark them.
        trust: whether what scenarios name (functions, families of worlds) may be imported, which runs the code
            of their modules; workers import them too.
        pictures: whether to draw a typical episode of each policy and scenario into `out`, too.
        replays: most episodes that are driven once more for the report: of each policy and scenario the first failure of
            each kind, see `replays.chosen`.
        replay_successes: whether a success of each policy and scenario is among them, too.

    Returns:
        One row an episode and robot, by scenario, policy, seed and robot.

    Raises:
        ValueError: an unknown name, a policy that does not fit, a caller's file that was changed after it was imported
            (where `out` or workers need it), or `out` is of another run or source of this package, in use or damaged.
        FailedPolicyError: a policy fails on its way. The others have been driven to the end then, and `out` is written: the
            error has their rows. Of a policy and a scenario where it failed none count, as its worlds would be others than
            theirs; those that were done stay in `out`, with the tracebacks in failed.txt.
    """
    workers, replays = checked_workers(workers), checked_count("replays", replays, least=0)
    into = {"repair": repair, "pictures": pictures, "replay_successes": replay_successes}
    if out is None and (asked := [name for name, is_asked in into.items() if is_asked]):
        raise ValueError(f"got {asked[0]} and no folder, expected one in `out` (--out FOLDER), for what it is about")
    plan = make_plan(
        policies,
        scenario_or_suite,
        episodes=episodes,
        seed=seed,
        overrides=overrides,
        data=data,
        privileged=privileged,
        trust=trust,
    )
    if are_several(workers):
        require_sendable(plan)
        plan.require_as_imported()
    labels = [policy.label for policy in plan.policies]
    if baseline is not None and baseline not in labels and f"{baseline}{PRIVILEGED}" in labels:
        baseline = f"{baseline}{PRIVILEGED}"
    if baseline is not None and baseline not in labels:
        raise ValueError(f"baseline must be one of {', '.join(labels)}, came {shortened(baseline)}")
    with ExitStack() as stack:
        folder = None if out is None else stack.enter_context(opened(out, plan, repair=repair))
        rows = [] if folder is None else list(folder.rows)
        track = stack.enter_context(progress_bar(shown=progress))
        missing = missing_worlds(plan, rows)
        lengths = known_lengths(missing, folder, workers, track)
        failed: dict[tuple[str, str], Failure] = {}
        for world in drive_missing(missing, lengths, workers, track):
            if isinstance(world, Failure):
                if (world.scenario, world.policy) not in failed and len(missing) > 1:
                    logger.warning("%s; the others go on", world.told)
                failed.setdefault((world.scenario, world.policy), world)
                continue
            if folder is not None:
                folder.add_rows(world)
            rows.extend(world)
        failures = [
            failed[pair].with_finished(rows)
            for scenario, policy in plan.pairs()
            if (pair := (scenario.label, policy.label)) in failed
        ]
        tracebacks = None if folder is None else folder.write_failures(failures)
        rows = _in_order(plan, [row for row in rows if (row.scenario, row.policy) not in failed])
        if folder is not None and rows:
            if baseline is None or all(row.policy != baseline for row in rows):  # it may have failed everywhere
                baseline = default_baseline(rows)
            summaries, differences = summarise(rows), compare(rows, baseline)
            named = differing_names(plan.policies, plan.scenarios)
            write_summary(folder.path, rows, summaries, differences, named)
            title = plan.suite or ", ".join(entry.label for entry in plan.scenarios)
            looked_at = wanted(plan, chosen(rows, replays, successes=replay_successes))
            recorded = replays_of(looked_at, workers, track)
            write_page(folder.path / PAGE, title, rows, summaries, differences, recorded, named=named)
            if pictures:
                draw_typical(plan, rows, folder.path / "pictures", on_this_machine(workers), track)
    if failures:
        raise FailedPolicyError(failures, rows, tracebacks) from failures[0].error
    return rows


def _in_order(plan: Plan, rows: Sequence[EpisodeRow]) -> list[EpisodeRow]:
    scenarios = {entry.label: number for number, entry in enumerate(plan.scenarios)}
    policies = {entry.label: number for number, entry in enumerate(plan.policies)}
    return sorted(rows, key=lambda row: (scenarios[row.scenario], policies[row.policy], row.seed, row.robot))
