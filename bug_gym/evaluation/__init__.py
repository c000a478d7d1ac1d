"""Policies in the same worlds, measured: `evaluate` makes one row an episode and robot, paired by seed.

A suite (configs/suites/*.yaml) names scenarios and seeds as data. A result folder holds manifest.json (what was asked),
rows.jsonl (one row a line, in order of arrival), the summary and a picture of a typical episode for each policy and
scenario. A run that was cut off goes on where it stopped: rows on disk are done.
"""

from __future__ import annotations

import itertools
import json
import logging
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from bug_gym.config import ScenarioError, load
from bug_gym.drawing.brush import load_pygame
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import load_pillow, save_png
from bug_gym.evaluation.intervals import compare, summarise
from bug_gym.evaluation.report import write_summary
from bug_gym.evaluation.rollout import Lengths, Rollout, World, is_privileged, portrait, shortest_lengths
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.suites import Plan, PolicyEntry, ScenarioEntry, as_suite
from bug_gym.files import replaced_when_done
from bug_gym.policy import MisfitError

logger = logging.getLogger("bug_gym")

CHUNK = 8
"""Seeds of a job: what a kill can cost a worker, and how finely workers share the work."""

ROWS, LENGTHS = "rows.jsonl", "shortest_paths.jsonl"
"""Files of a result folder that grow as the work goes on."""

T = TypeVar("T")
J = TypeVar("J")
R = TypeVar("R")


def make_plan(
    policies: Any,
    scenario_or_suite: Any,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    data: str | os.PathLike[str] | None = None,
) -> Plan:
    """What to evaluate, from the arguments of `evaluate`, each policy tried once in each scenario.

    Raises:
        ValueError: an unknown name, a label that comes twice, or a policy that fits none of the scenarios.
    """
    suite, name = as_suite(scenario_or_suite)
    scenarios, found = [], suite.overrides(data)
    for number, item in enumerate(suite.scenarios):
        try:
            scenario = load(item.scenario, {**item.overrides, **found, **(overrides or {})})
        except ScenarioError as error:
            raise ScenarioError(f"{name}: scenarios.{number}: {error}" if name else str(error)) from None
        seeds = item.seeds or suite.seeds
        first, count = seeds.first if seed is None else seed, seeds.count if episodes is None else episodes
        if first < 0 or count < 1:
            raise ValueError(f"expected a seed from 0 on and at least one episode, got {first} and {count}")
        scenarios.append(ScenarioEntry(item.label or scenario.name, scenario, range(first, first + count)))
    by_default = policies is None and not suite.policies
    if by_default:
        from bug_gym.agents import playable_names

        policies = playable_names()
    elif policies is None:
        policies = suite.policies
    elif isinstance(policies, (str, Mapping)) or hasattr(policies, "predict"):
        policies = [policies]
    entries = [PolicyEntry.of(policy) for policy in policies]
    if not entries:
        raise ValueError("no policies to evaluate")
    _require_distinct("scenarios", [entry.label for entry in scenarios])
    _require_distinct("policies", [entry.label for entry in entries])
    labelled, left_out = _rehearse(entries, scenarios)
    lost = [entry for entry in labelled if all((entry.label, scenario.label) in left_out for scenario in scenarios)]
    if lost and not by_default:
        raise MisfitError(left_out[lost[0].label, scenarios[0].label])
    kept = tuple(entry for entry in labelled if entry not in lost)
    return Plan(name, kept, tuple(scenarios), frozenset(left_out))


def _require_distinct(what: str, labels: Sequence[str]) -> None:
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ValueError(f"two {what} are called {twice[0]!r}: give them labels")


def _rehearse(
    entries: Sequence[PolicyEntry], scenarios: Sequence[ScenarioEntry]
) -> tuple[list[PolicyEntry], dict[tuple[str, str], str]]:
    """One step of each policy in each scenario, before anything is written: what is wrong fails here.

    It also leaves compiled code in numba's cache, where workers find it. Policies that read the map are labelled so. A
    learned policy that was made for another robot is left out of the scenario: why, by label of policy and scenario.
    """
    labelled = list(entries)
    left_out = {}
    for scenario in scenarios:
        for number, entry in enumerate(entries):
            try:
                rollout = Rollout(entry, scenario, scenario.seeds[:1])
            except MisfitError as error:
                left_out[entry.label, scenario.label] = str(error)
                continue
            rollout.advance()
            if is_privileged(rollout.policy):
                labelled[number] = replace(entry, label=f"{entry.label} (privileged)")
        if misfits := [policy for policy, label in left_out if label == scenario.label]:
            logger.warning("%s is not for the robot of: %s", scenario.label, ", ".join(misfits))
    return labelled, left_out


# ---------------------------------------------------------------------------------------------------------------------
# The result folder
# ---------------------------------------------------------------------------------------------------------------------


class ResultFolder:
    """Where the rows of one plan are kept as they come.

    Args:
        path: a folder that is missing or empty, or that of an earlier run of the same plan with policies by name.
        plan: what is evaluated.

    Raises:
        ValueError: the folder is of another run, or its files are damaged.
    """

    def __init__(self, path: str | os.PathLike[str], plan: Plan) -> None:
        self.path = Path(path)
        manifest_path, manifest = self.path / "manifest.json", plan.manifest()
        if manifest_path.exists():
            differences = list(_differences(_read_json(manifest_path), manifest))
            if differences:
                raise ValueError(f"{self.path} holds another run: {'; '.join(differences[:3])}")
            objects = [policy.label for policy in plan.policies if policy.policy is not None]
            if objects:
                raise ValueError(
                    f"{self.path} holds a run of {objects[0]}: nobody can tell whether it is the same object"
                )
        elif self.path.exists() and not _is_empty(self.path):
            raise ValueError(f"{self.path} holds something else, expected a new folder or that of an earlier run")
        else:
            self.path.mkdir(parents=True, exist_ok=True)
            with replaced_when_done(manifest_path) as partial:
                partial.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
        self.rows: list[EpisodeRow] = _read_lines(self.path / ROWS, EpisodeRow.from_dict)
        """Rows of the worlds that are done."""
        self.lengths: Lengths = dict(_read_lines(self.path / LENGTHS, _length_from_dict))
        """Shortest paths that are known."""
        self._drop_partial_world({scenario.label: scenario.scenario.robots.count for scenario in plan.scenarios})

    def _drop_partial_world(self, robots: Mapping[str, int]) -> None:
        """Rows of a world are written at once, its last robot last: a kill may have cut them short."""
        count = len(self.rows)
        while self.rows and self.rows[-1].robot + 1 != robots.get(self.rows[-1].scenario):
            self.rows.pop()
        if len(self.rows) < count:
            with replaced_when_done(self.path / ROWS) as partial:
                partial.write_text("".join(_line(row.as_dict()) for row in self.rows), encoding="utf-8")

    def add_rows(self, rows: Sequence[EpisodeRow]) -> None:
        """Keep the rows of one world; they are on the disk when this returns."""
        _append(self.path / ROWS, "".join(_line(row.as_dict()) for row in rows))

    def add_lengths(self, world: World, lengths: Sequence[float]) -> None:
        """Keep the shortest paths of one world."""
        # As text, because JSON has neither infinity nor NaN.
        record = {"scenario": world[0], "seed": world[1], "lengths": [repr(length) for length in lengths]}
        _append(self.path / LENGTHS, _line(record))


def _length_from_dict(record: Any) -> tuple[World, list[float]]:
    try:
        return (record["scenario"], record["seed"]), [float(length) for length in record["lengths"]]
    except (KeyError, TypeError) as error:
        raise ValueError(f"got {record!r}, expected scenario, seed and lengths") from error


def _line(record: Mapping[str, Any]) -> str:
    return json.dumps(record, allow_nan=False) + "\n"


def _append(path: Path, text: str) -> None:
    with path.open("ab") as file:
        file.write(text.encode())
        file.flush()
        os.fsync(file.fileno())


def _read_lines(path: Path, parse: Callable[[Any], T]) -> list[T]:
    """What a file holds, one JSON value a line; a last line that a kill has cut short is taken out of the file.

    Raises:
        ValueError: another line is damaged.
    """
    if not path.exists():
        return []
    *lines, torn = path.read_bytes().split(b"\n")
    values = []
    for number, line in enumerate(lines, start=1):
        try:
            values.append(parse(json.loads(line)))
        except ValueError as error:
            raise ValueError(f"{path}: line {number}: {error}") from None
    if torn:
        os.truncate(path, sum(len(line) + 1 for line in lines))
    return values


def _is_empty(folder: Path) -> bool:
    """Whether nobody has left anything in a folder, but for the beginning of a manifest."""
    return folder.is_dir() and all(".partial" in path.name for path in folder.iterdir())


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None


def _differences(there: Any, here: Any, key: str = "") -> Iterator[str]:
    """What differs between a manifest on disk and ours, by dotted key."""
    if isinstance(there, dict) and isinstance(here, dict):
        for name in dict.fromkeys([*there, *here]):
            yield from _differences(there.get(name), here.get(name), f"{key}.{name}".lstrip("."))
    elif there != here:
        texts = ("missing" if value is None else json.dumps(value) for value in (there, here))
        was, now = (text if len(text) <= 60 else f"{text[:57]}..." for text in texts)
        yield f"{key} was {was}, is now {now}"


# ---------------------------------------------------------------------------------------------------------------------
# evaluate
# ---------------------------------------------------------------------------------------------------------------------

Track = Callable[[Iterable[T], str, int], Iterable[T]]
"""Lets items through and shows how many of a total have come, under a title."""


class _Job(NamedTuple):
    """Some worlds to drive in with one policy."""

    policy: PolicyEntry
    scenario: ScenarioEntry
    seeds: tuple[int, ...]
    lengths: Lengths


def evaluate(
    policies: Any,
    scenario_or_suite: Any,
    episodes: int | None = None,
    seed: int | None = None,
    workers: int = 1,
    out: str | os.PathLike[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: bool = False,
    data: str | os.PathLike[str] | None = None,
    baseline: str | None = None,
) -> list[EpisodeRow]:
    """Drive policies through the same worlds and measure each episode.

    Args:
        policies: a list of names, (label, name, parameters), dicts with those keys, or objects with `predict`; one
            of them; or None for those of the suite, or all that are registered.
        scenario_or_suite: a scenario or a list of them, each a name, path, dict or Scenario; or a suite, likewise.
        episodes: worlds of each scenario; None: as many as the suite says, 50 without one.
        seed: of the first world, the others count up; None: as the suite says, 0 without one.
        workers: processes that share the work. Times of decisions are fair where each has a core of its own.
        out: a folder for the rows as they come, the summary and pictures. A run that was cut off goes on from it.
        overrides: values by dotted key that replace those of every scenario.
        progress: whether to show a bar on the terminal.
        data: path of the data that a suite needs and that is not part of this package.
        baseline: label of the policy that the summary compares the others with; None: the first one.

    Returns:
        One row an episode and robot, by scenario, policy, seed and robot.

    Raises:
        ValueError: an unknown name, a policy that does not fit, or `out` is of another run.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    plan = make_plan(policies, scenario_or_suite, episodes=episodes, seed=seed, overrides=overrides, data=data)
    labels = [policy.label for policy in plan.policies]
    if baseline is not None and baseline not in labels:
        raise ValueError(f"baseline must be one of {', '.join(labels)}, came {baseline!r}")
    folder = None if out is None else ResultFolder(out, plan)
    rows = [] if folder is None else list(folder.rows)
    with progress_bar(shown=progress) as track:
        missing = _missing(plan, rows)
        lengths = _shortest_lengths(missing, folder, workers, track)
        for world in _drive_missing(missing, lengths, workers, track):
            if folder is not None:
                folder.add_rows(world)
            rows.extend(world)
        rows = _in_order(plan, rows)
        if folder is not None:
            write_summary(folder.path, rows, summarise(rows), compare(rows, baseline or rows[0].policy))
            _draw_typical(plan, rows, folder.path / "pictures", workers, track)
    return rows


def _in_order(plan: Plan, rows: Sequence[EpisodeRow]) -> list[EpisodeRow]:
    scenarios = {entry.label: number for number, entry in enumerate(plan.scenarios)}
    policies = {entry.label: number for number, entry in enumerate(plan.policies)}
    return sorted(rows, key=lambda row: (scenarios[row.scenario], policies[row.policy], row.seed, row.robot))


def _missing(plan: Plan, rows: Sequence[EpisodeRow]) -> list[tuple[PolicyEntry, ScenarioEntry, list[int]]]:
    """Seeds without rows, by scenario and policy that fits it."""
    done = {(row.policy, row.scenario, row.seed) for row in rows}
    return [
        (policy, scenario, [seed for seed in scenario.seeds if (policy.label, scenario.label, seed) not in done])
        for scenario, policy in plan.pairs()
    ]


def _shortest_lengths(
    missing: Sequence[tuple[PolicyEntry, ScenarioEntry, list[int]]],
    folder: ResultFolder | None,
    workers: int,
    track: Track[Any],
) -> Lengths:
    """Shortest paths of all worlds to drive in, once a world; a moving target has none."""
    lengths = {} if folder is None else dict(folder.lengths)
    wanted = {
        (scenario.label, seed): scenario
        for _, scenario, seeds in missing
        for seed in seeds
        if not scenario.has_moving_target and (scenario.label, seed) not in lengths
    }
    found = _each(_shortest_length, [(scenario, seed) for (_, seed), scenario in wanted.items()], workers)
    for world, robots in track(found, "shortest paths", len(wanted)):
        if folder is not None:
            folder.add_lengths(world, robots)
        lengths[world] = robots
    return lengths


def _shortest_length(job: tuple[ScenarioEntry, int]) -> tuple[World, list[float]]:
    scenario, seed = job
    return (scenario.label, seed), shortest_lengths(scenario, seed)


def _drive_missing(
    missing: Sequence[tuple[PolicyEntry, ScenarioEntry, list[int]]], lengths: Lengths, workers: int, track: Track[Any]
) -> Iterable[list[EpisodeRow]]:
    """The rows of each missing world."""
    numbered = []
    for policy, scenario, seeds in missing:
        chunk = CHUNK if workers > 1 else len(seeds)
        for first in range(0, len(seeds), max(chunk, 1)):
            some = tuple(seeds[first : first + chunk])
            mine = {world: lengths[world] for seed in some if (world := (scenario.label, seed)) in lengths}
            numbered.append((first, _Job(policy, scenario, some, mine)))
    # The first seeds of all policies come first, so that what an interrupted run leaves can be compared.
    jobs = [job for _, job in sorted(numbered, key=lambda item: item[0])]
    worlds = itertools.chain.from_iterable(_each(_drive_lazily if workers == 1 else _drive, jobs, workers))
    return track(worlds, "episodes", sum(len(job.seeds) for job in jobs))


def _drive_lazily(job: _Job) -> Iterator[list[EpisodeRow]]:
    return Rollout(job.policy, job.scenario, job.seeds, lengths=job.lengths).worlds()


def _drive(job: _Job) -> list[list[EpisodeRow]]:
    return list(_drive_lazily(job))


def _each(function: Callable[[J], R], jobs: Sequence[J], workers: int) -> Iterator[R]:
    """What a function makes of each job, in order of arrival."""
    if workers == 1 or len(jobs) < 2:
        yield from map(function, jobs)
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=workers, return_as="generator_unordered")
        yield from parallel(delayed(function)(job) for job in jobs)


@contextmanager
def progress_bar(*, shown: bool) -> Iterator[Track[Any]]:
    """A way to show how far things are on the terminal, or not to."""
    if not shown:
        yield lambda items, title, total: items
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description:<14}"), BarColumn(), MofNCompleteColumn())
    times = (TextColumn("elapsed"), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
    with Progress(*columns, *times, console=Console(stderr=True)) as bar:
        yield lambda items, title, total: bar.track(items, total=total, description=title) if total else items


# ---------------------------------------------------------------------------------------------------------------------
# Pictures
# ---------------------------------------------------------------------------------------------------------------------


class _Picture(NamedTuple):
    """An episode to draw into a file."""

    policy: PolicyEntry
    scenario: ScenarioEntry
    seed: int
    path: Path


def _draw_typical(plan: Plan, rows: Sequence[EpisodeRow], folder: Path, workers: int, track: Track[Any]) -> None:
    """A picture of a typical episode of each policy in each scenario; those that are there already are kept."""
    try:
        load_pygame()
        load_pillow()
    except ImportError as error:
        logger.warning("no pictures: %s", error)
        return
    folder.mkdir(exist_ok=True)
    wanted = []
    for scenario, policy in plan.pairs():
        mine = [row for row in rows if (row.scenario, row.policy) == (scenario.label, policy.label)]
        path = folder / (re.sub(r"[^\w.-]+", "_", f"{scenario.label}-{policy.label}") + ".png")
        if not path.exists():
            wanted.append(_Picture(policy, scenario, typical(mine).seed, path))
    for _ in track(_each(_draw, wanted, workers), "pictures", len(wanted)):
        pass


def typical(rows: Sequence[EpisodeRow]) -> EpisodeRow:
    """The success with the median path, or the first row where there is no success."""
    solved = sorted((row for row in rows if row.success), key=lambda row: row.path_length)
    return solved[(len(solved) - 1) // 2] if solved else rows[0]


def _draw(picture: _Picture) -> None:
    rollout = Rollout(picture.policy, picture.scenario, [picture.seed])
    save_png(picture.path, portrait(rollout, Canvas(rollout.simulation, title=picture.policy.label)))
