"""The folder in which the rows of a plan are kept as they come, so that a run that was cut off goes on.

So does one of which more is asked than before: what is there is what it would be in a new folder.

manifest.json says what was asked, rows.jsonl has one row a line in order of arrival, shortest_paths.jsonl one world, and
failed.txt the tracebacks of policies that failed. All but the last is checked when it is read back: nothing that this plan
cannot have made reaches a summary. A kill leaves at most a torn last line and, where a world has several robots, a last
world without all of them; both go without a word.
"""

from __future__ import annotations

import json
import logging
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isclose, isnan
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from bug_gym.config import checked
from bug_gym.evaluation.entries import ScenarioEntry
from bug_gym.evaluation.failures import Failure
from bug_gym.evaluation.lengths import Lengths, World
from bug_gym.evaluation.plan import SOURCE, Plan
from bug_gym.evaluation.records import LengthsRecord, Manifest
from bug_gym.evaluation.rows import EpisodeRow, spl
from bug_gym.files import HOLDER, LOCK, PARTIAL, append, from_json, one_writer, out_path, replaced_when_done, writable
from bug_gym.naming import nearest_hint
from bug_gym.scenario_code import own_code
from bug_gym.schema.errors import shortened

logger = logging.getLogger("bug_gym")

MANIFEST = "manifest.json"
"""What was asked."""
ROWS, LENGTHS = "rows.jsonl", "shortest_paths.jsonl"
"""Files of a result folder that grow as the work goes on."""
FAILED = "failed.txt"
"""Tracebacks of policies that have failed in the last run."""
DROPPED = "dropped.jsonl"
"""Where a repair keeps the lines that it drops."""
MOST_TOLD = 10
"""Lines of a kind that a repair tells by number."""

T = TypeVar("T")


@contextmanager
def opened(path: str | os.PathLike[str], plan: Plan, *, repair: bool = False) -> Iterator[ResultFolder]:
    """The folder of a plan, kept to this process as long as it is open.

    Args:
        path: a folder that is missing or empty, or that of an earlier run of the same plan, or a part of it, with policies by
            name.
        plan: what is evaluated.
        repair: whether lines that this plan cannot have are dropped, as of a policy from outside whose code has changed since,
            and what stands twice; else they are an error.

    Raises:
        ValueError: the folder is of another run or in use, or its files are damaged.
    """
    folder = out_path(path)
    _require_ours(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with one_writer(folder):
        _require_ours(folder)  # somebody may have been there just now
        yield ResultFolder(folder, plan, repair=repair)


def _require_ours(folder: Path) -> None:
    """Refuse a folder that somebody else has left something in; what a start that was cut off has left is ours."""
    for name in (MANIFEST, ROWS, LENGTHS, DROPPED, FAILED):
        if folder.is_dir():
            writable(folder / name)
    if (folder / MANIFEST).exists() or not os.path.lexists(folder):
        return
    if not folder.is_dir() or any(not _is_beginning(path.name) for path in folder.iterdir()):
        raise ValueError(f"{folder} holds something else, expected a new folder or that of an earlier run")


def _is_beginning(name: str) -> bool:
    return name in (LOCK, HOLDER) or re.fullmatch(rf"\.[0-9a-f]{{16}}{re.escape(PARTIAL)}\.json", name) is not None


class ResultFolder:
    """Where the rows of one plan are kept as they come; see `opened`."""

    def __init__(self, path: Path, plan: Plan, *, repair: bool) -> None:
        self.path = path
        self._plan = plan
        self._scenarios = {scenario.label: scenario for scenario in plan.scenarios}
        self._pairs = {(scenario.label, policy.label) for scenario, policy in plan.pairs()}
        manifest = plan.manifest()
        self._mended: set[str] = set()
        is_other = self._agree_on_manifest(manifest, repair=repair)
        rows, lengths = self._read_rows(), self._read_lengths()
        self._require_agreement(rows, lengths)
        self._require_whole_worlds(rows)
        self.rows: list[EpisodeRow] = rows.settled(repair=repair)
        """Rows of the worlds that are done."""
        self.lengths: Lengths = dict(lengths.settled(repair=repair))
        """Shortest paths that are known."""
        if is_other:  # from here on; a folder that is damaged stays what it was
            write_manifest(self.path / MANIFEST, manifest)

    def add_rows(self, rows: Sequence[EpisodeRow]) -> None:
        """Keep the rows of one world; they are on the disk when this returns."""
        append(self.path / ROWS, "".join(_line(row.as_dict()) for row in rows).encode())

    def add_lengths(self, world: World, lengths: Sequence[float]) -> None:
        """Keep the shortest paths of one world."""
        record = {"scenario": world[0], "seed": world[1], "lengths": [repr(length) for length in lengths]}
        append(self.path / LENGTHS, _line(record).encode())

    def write_failures(self, failures: Sequence[Failure]) -> Path | None:
        """Keep the tracebacks of failures in place of an earlier run's; returns the file, None where there is no failure."""
        path = self.path / FAILED
        if not failures:
            path.unlink(missing_ok=True)
            return None
        with replaced_when_done(path) as partial:
            partial.write_text("\n".join(f"{one.told}\n\n{one.traceback}" for one in failures), encoding="utf-8")
        return path

    def _agree_on_manifest(self, manifest: Mapping[str, Any], *, repair: bool) -> bool:
        """Write down what is asked, or find that the same was asked before, or less: its rows are the same in both.

        A repair takes down policies whose code has changed since, as those whose rows are to be dropped.

        Returns:
            Whether it was less, or of other code.
        """
        path = self.path / MANIFEST
        is_new = not path.exists()
        there = kept_manifest(path, manifest)
        if is_new:
            return False
        checked(Manifest, there, f"{path} is damaged")
        before, now = without_places(there), without_places(manifest)
        mended = with_code(before, now)
        if other := other_run(grown(mended if repair else before, now), now):
            if not other_run(grown(now, before), before):
                told = next(differences(before, now))
                raise ValueError(
                    f"{self.path} holds more than is asked: {told}; ask for all of it, or name another folder"
                )
            repaired = ", --repair drops its rows" if not other_run(grown(mended, now), now) else ""
            raise ValueError(f"{self.path} holds {other}; name another folder{repaired}, or remove this one")
        self._mended = {label for label, about in mended["policies"].items() if about != before["policies"][label]}
        objects = [policy.label for policy in self._plan.policies if policy.is_nameless]
        if objects:
            told = f"{objects[0]} is an object, and nobody can tell whether it is the same as in another run"
            raise ValueError(f"{self.path} holds an earlier run: {told}")
        for entry in self._plan.scenarios:
            if nameless := [key for key, digest in own_code(entry.scenario).items() if not digest]:
                told = (
                    f"{nameless[0]} is written in no file, and nobody can tell whether it is the same as in another run"
                )
                raise ValueError(f"{self.path} holds an earlier run: {told}")
        return before != now

    def _read_lengths(self) -> _Lines[tuple[World, list[float]]]:
        lines = _Lines(self.path / LENGTHS, self._length_of)
        lines.require_distinct(key=lambda value: value[0], content=lambda value: list(map(repr, value[1])))
        return lines

    def _length_of(self, data: Any) -> tuple[World, list[float]]:
        record = checked(LengthsRecord, data, "shortest path")
        scenario = self._scenario_of(record.scenario, record.seed)
        if scenario.has_moving_target:
            raise ValueError(
                f"scenario: got {shortened(record.scenario)}, which has a moving target and no shortest path"
            )
        if len(record.lengths) != (robots := scenario.scenario.robots.count):
            raise ValueError(f"lengths: got {len(record.lengths)} of them, expected {robots}, one a robot")
        return (record.scenario, record.seed), [float(length) for length in record.lengths]

    def _read_rows(self) -> _Lines[EpisodeRow]:
        lines = _Lines(self.path / ROWS, self._row_of)
        for number, row in list(lines.values.items()):
            if row.policy in self._mended:
                lines.fault(number, f"of the code that {shortened(row.policy)} had before", "of other code")
        lines.require_distinct(
            key=lambda row: (row.policy, row.scenario, row.seed, row.robot),
            content=lambda row: {name: value for name, value in row.as_dict().items() if "decision_time" not in name},
        )
        return lines

    def _row_of(self, data: Any) -> EpisodeRow:
        row = EpisodeRow.from_dict(data)
        scenario = self._scenario_of(row.scenario, row.seed)
        if (row.scenario, row.policy) not in self._pairs:
            known = [policy for label, policy in self._pairs if label == row.scenario]
            hint = nearest_hint(row.policy, known)
            raise ValueError(f"policy: got {shortened(row.policy)}, expected one of those in {row.scenario}{hint}")
        if row.robot >= (robots := scenario.scenario.robots.count):
            raise ValueError(f"robot: got {row.robot}, expected a number below {robots}")
        taken = row.path_length + row.goal_distance
        expected = spl(success=row.success, shortest=row.shortest_path_length, taken=taken)
        if isnan(row.spl) != isnan(expected) or not (isnan(expected) or isclose(row.spl, expected, abs_tol=1e-9)):
            raise ValueError(f"spl: got {row.spl}, expected {expected} by the row's lengths")
        if not scenario.has_moving_target and not isnan(row.time_ratio):
            raise ValueError(f"time_ratio: got {row.time_ratio}, expected none: the target stands still")
        return row

    def _scenario_of(self, label: str, seed: int) -> ScenarioEntry:
        """The scenario of a line, which has such a world."""
        scenario = self._scenarios.get(label)
        if scenario is None:
            known = ", ".join(self._scenarios)
            hint = nearest_hint(label, self._scenarios)
            raise ValueError(f"scenario: got {shortened(label)}, expected one of {known}{hint}")
        if seed not in scenario.seeds:
            raise ValueError(f"seed: got {seed}, expected one from {scenario.seeds[0]} to {scenario.seeds[-1]}")
        return scenario

    def _require_agreement(self, rows: _Lines[EpisodeRow], lengths: _Lines[tuple[World, list[float]]]) -> None:
        """Find rows that contradict the shortest paths. Nobody knows which are right: a repair drops both.

        Of a world the other robots' rows go with them: what is left would seem to lack a robot.
        """
        known = {world: (line, found) for line, (world, found) in lengths.values.items()}
        worlds: dict[tuple[str, str, int], dict[int, EpisodeRow]] = {}
        for number, row in rows.values.items():
            worlds.setdefault((row.policy, row.scenario, row.seed), {})[number] = row
        kind = "contradicting the other file"
        for (_, scenario, seed), robots in worlds.items():
            line, found = known.get((scenario, seed), (0, []))
            for number, row in robots.items() if found else ():
                came = row.shortest_path_length
                if repr(found[row.robot]) != repr(came):
                    why = f"shortest_path_length: got {came}, {LENGTHS} says {found[row.robot]}"
                    for other in robots:
                        rows.fault(other, kind, why if other == number else f"of a world with line {number}, {why}")
                    lengths.fault(line, kind, f"{ROWS} says {came} in line {number}")
                    break

    def _require_whole_worlds(self, lines: _Lines[EpisodeRow]) -> None:
        """Rows of a world are written at once: a kill may have cut the last ones short, and no others."""
        worlds: dict[tuple[str, str, int], list[int]] = {}
        for number, row in lines.values.items():
            worlds.setdefault((row.policy, row.scenario, row.seed), []).append(number)
        last = max(lines.values, default=0)
        for (policy, scenario, seed), numbers in worlds.items():
            robots = self._scenarios[scenario].scenario.robots.count
            if len(numbers) == robots:
                continue
            for number in numbers:
                if last in numbers:
                    lines.cut(number)
                else:
                    why = f"{policy} in {scenario}, seed {seed}, has {len(numbers)} of {robots} robots"
                    lines.fault(number, "of a world without all its robots", why)


class _Fault(NamedTuple):
    """What is wrong with a line."""

    kind: str
    """As a repair tells it of several lines."""
    text: str
    """As an error tells it of the line."""


class _Lines(Generic[T]):
    """A file of one JSON value a line, read back.

    Args:
        path: of the file, which may be missing.
        parse: makes a value of what a line holds, or raises a ValueError.
    """

    def __init__(self, path: Path, parse: Callable[[Any], T]) -> None:
        self.path = path
        *self._texts, self._torn = path.read_bytes().split(b"\n") if path.exists() else [b""]
        self.values: dict[int, T] = {}
        """Good lines by number, the first being 1."""
        self._faults: dict[int, _Fault] = {}
        self._cut: set[int] = set()
        for number, text in enumerate(self._texts, start=1):
            try:
                self.values[number] = parse(from_json(text))
            except ValueError as error:
                self._faults[number] = _Fault("no line of this run", "; ".join(str(error).splitlines()))

    def require_distinct(self, key: Callable[[T], object], content: Callable[[T], object]) -> None:
        """Find lines that are about the same as an earlier one, and tell those that say the same from others."""
        first: dict[object, int] = {}
        for number, value in list(self.values.items()):
            before = first.setdefault(key(value), number)
            if before != number:
                same = content(value) == content(self.values[before])
                kind = "there twice" if same else "contradicting an earlier line, which is kept"
                told = "says again what" if same else "contradicts what"
                self.fault(number, kind, f"{told} line {before} says")

    def fault(self, number: int, kind: str, text: str) -> None:
        """Take a line for wrong."""
        self.values.pop(number, None)
        self._faults[number] = _Fault(kind, text)

    def cut(self, number: int) -> None:
        """Take a line for what a kill has left."""
        del self.values[number]
        self._cut.add(number)

    def settled(self, *, repair: bool) -> list[T]:
        """The values of the good lines, which are all that is left in the file.

        Raises:
            ValueError: a line is wrong, and nobody asked for a repair.
        """
        if self._faults and not repair:
            number = min(self._faults)
            others = f" ({len(self._faults)} such lines)" if len(self._faults) > 1 else ""
            raise ValueError(f"{self.path}: line {number}: {self._faults[number].text}{others}; --repair drops it")
        if self._faults:
            dropped = b"".join(self._texts[number - 1] + b"\n" for number in sorted(self._faults))
            append(self.path.with_name(DROPPED), dropped)
        if self._faults or self._cut or self._torn:
            with replaced_when_done(self.path) as partial:
                partial.write_bytes(b"".join(self._texts[number - 1] + b"\n" for number in sorted(self.values)))
        if self._faults:
            logger.warning("%s", self._told())
        return list(self.values.values())

    def _told(self) -> str:
        """What a repair has dropped, in one line."""
        kinds: dict[str, list[int]] = {}
        for number, fault in sorted(self._faults.items()):
            kinds.setdefault(fault.kind, []).append(number)
        parts = []
        for kind, numbers in kinds.items():
            more = f" and {len(numbers) - MOST_TOLD} more" if len(numbers) > MOST_TOLD else ""
            parts.append(f"{len(numbers)} {kind} (line {', '.join(map(str, numbers[:MOST_TOLD]))}{more})")
        whole = len(self._texts)
        return f"{self.path}: dropped {len(self._faults)} of {whole} lines, {'; '.join(parts)}; they are in {DROPPED}"


def _line(record: Mapping[str, Any]) -> str:
    return json.dumps(record, allow_nan=False) + "\n"


def kept_manifest(path: Path, manifest: Mapping[str, Any]) -> Any:
    """What the manifest on disk says; where there is none yet, it is written, and says what is handed in.

    Raises:
        ValueError: it is no JSON.
    """
    if not path.exists():
        write_manifest(path, manifest)
        return manifest
    try:
        return from_json(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None


def write_manifest(path: Path, manifest: Mapping[str, Any]) -> None:
    """Write what is asked, whole or not at all."""
    with replaced_when_done(path) as partial:
        partial.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")


def grown(there: Mapping[str, Any], here: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest on disk, as if it had asked what ours asks beyond it: scenarios, policies, and seeds about those it has."""
    scenarios = {**here["scenarios"], **there["scenarios"]}
    for label in there["scenarios"].keys() & here["scenarios"].keys():
        about, now = there["scenarios"][label], here["scenarios"][label]["seeds"]
        first, count = about["seeds"]["first"], about["seeds"]["count"]
        if now["first"] <= first and first + count <= now["first"] + now["count"]:
            scenarios[label] = {**about, "seeds": now}
    return {**there, "scenarios": scenarios, "policies": {**here["policies"], **there["policies"]}}


def with_code(there: Mapping[str, Any], here: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest on disk, as if its policies from outside were of the code that they are of now."""
    policies = dict(there["policies"])
    for label in there["policies"].keys() & here["policies"].keys():
        was, now = there["policies"][label], here["policies"][label]
        if "code" in was and "code" in now:
            policies[label] = {**was, "code": now["code"]}
    return {**there, "policies": policies}


def without_places(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest without where the files of its scenarios' worlds lie: what is in them says `data`.

    The digest of such a scenario goes with its path, which it is of, too: all its other values stand in `scenario`, and the
    source says what they are where it has none. What `path` means to a family from outside nobody knows: it stays.
    """
    scenarios = dict(manifest["scenarios"])
    for label, about in scenarios.items():
        world = about["scenario"].get("world")
        if about.get("data") and not about.get("code") and isinstance(world, dict):
            placeless = {key: value for key, value in world.items() if key != "path"}
            scenario = {**about["scenario"], "world": placeless}
            scenarios[label] = {**{key: about[key] for key in about if key != "digest"}, "scenario": scenario}
    return {**manifest, "scenarios": scenarios}


def other_run(there: Any, here: Any) -> str:
    """What a folder holds by its manifest, where that is another run than ours; "" where it is the same."""
    changes = list(differences(there, here))
    told = "; ".join(changes[:3])
    if changes and all(change.partition(" was ")[0].rpartition(".")[2] == SOURCE for change in changes):
        return f"what another source of bug_gym has made, whose code has changed since ({told})"
    return f"another run: {told}" if changes else ""


def differences(there: Any, here: Any, key: str = "") -> Iterator[str]:
    """What differs between a manifest on disk and ours, by dotted key."""
    if isinstance(there, dict) and isinstance(here, dict):
        for name in dict.fromkeys([*there, *here]):
            yield from differences(there.get(name), here.get(name), f"{key}.{name}".lstrip("."))
    elif there != here:
        texts = ("missing" if value is None else json.dumps(value) for value in (there, here))
        was, now = (text if len(text) <= 60 else f"{text[:57]}..." for text in texts)
        yield f"{key} was {was}, is now {now}"
