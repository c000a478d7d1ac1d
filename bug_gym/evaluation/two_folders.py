"""What has changed between two results folders: the same policies in the same worlds, as before and after an edit.

Pairs are missions of one policy in one world, told by their labels and seeds. Worlds that cannot be the same are not compared.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import inf, isclose, isnan
from pathlib import Path
from typing import Any, NamedTuple

from bug_gym.config import checked
from bug_gym.evaluation.matrix import percent
from bug_gym.evaluation.missions import missions
from bug_gym.evaluation.records import Manifest
from bug_gym.evaluation.report import MEASURES, told_difference
from bug_gym.evaluation.results_folder import MANIFEST, ROWS, differences, without_places
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import COMPARED, OVERALL, PairedDifference, paired_difference
from bug_gym.evaluation.text_table import TextTable
from bug_gym.files import from_json, out_path, replaced_when_done

SAME_LENGTH = 1e-6
"""Share by which two shortest paths of one world may differ: rounding of other versions of what finds them."""


@dataclass(frozen=True, slots=True)
class Change:
    """What has become of one policy in one scenario, or in all."""

    policy: str
    """Label of the policy."""
    scenario: str
    """Label of the scenario, or OVERALL."""
    n: int
    """Missions that both folders have."""
    same: int
    """Those of them that are the same in all but the times of decisions."""
    before: int
    """Accomplished in the old folder."""
    after: int
    """Accomplished in the new one."""
    lost: tuple[tuple[str, int], ...]
    """Scenario and seed of those accomplished in the old folder alone."""
    won: tuple[tuple[str, int], ...]
    """Scenario and seed of those accomplished in the new folder alone."""
    differences: tuple[PairedDifference, ...]
    """New minus old in each of `summary.COMPARED`."""

    def as_dict(self) -> dict[str, Any]:
        """Fields in order, fit for strict JSON as those of a row are."""
        return {**asdict(self), "differences": [one.as_dict() for one in self.differences]}


class Comparison(NamedTuple):
    """Two results folders side by side."""

    changes: list[Change]
    """By policy and scenario, in the old folder's order; OVERALL last of a policy with several scenarios."""
    notes: list[str]
    """What differs in what was asked, and what was not compared, a line each."""


class _Kept(NamedTuple):
    """What a results folder holds."""

    path: Path
    manifest: dict[str, Any]
    rows: list[EpisodeRow]


def read_rows(folder: str | os.PathLike[str]) -> list[EpisodeRow]:
    """The rows of a results folder, in order of arrival: of those worlds that are done, where the run is not at its end.

    Nothing is written, and the folder need not be of this code: `evaluate(..., out=folder)` refuses one that is not.

    Raises:
        ValueError: it is no results folder, or damaged.
    """
    return _read(folder).rows


def compare_folders(old: str | os.PathLike[str], new: str | os.PathLike[str]) -> Comparison:
    """What has changed from one results folder to another, in worlds that both have.

    Raises:
        ValueError: one is no results folder, or damaged; or nothing in them can be compared.
    """
    before, after = _read(old), _read(new)
    notes = list(_told_differences(before.manifest, after.manifest))
    shared = []
    for label in _in_both("scenario", before, after, notes):
        other = _other_worlds(label, before, after)
        if other:
            notes.append(f"not compared: scenario {label}, {other}")
        else:
            shared.append(label)
    policies = _in_both("policy", before, after, notes)
    kept, now = (
        [row for row in folder.rows if row.scenario in shared and row.policy in policies] for folder in (before, after)
    )
    notes += _told_lacking(before.path, kept, now)
    notes += _told_lacking(after.path, now, kept)
    found = changes(kept, now)
    if not found:
        why = "; ".join(notes) or "no policy drove in the same world in both"
        raise ValueError(f"{before.path} and {after.path} have nothing in common: {why}")
    return Comparison(found, notes)


def change_table(found: Sequence[Change]) -> TextTable:
    """A table of changes; a column without a value is left out."""
    measures = [measure for measure in MEASURES if measure.on_screen]
    columns: list[list[str]] = [
        ["policy", *(one.policy for one in found)],
        ["scenario", *("all scenarios" if one.scenario == OVERALL else one.scenario for one in found)],
        ["worlds", *(str(one.n) for one in found)],
        ["the same", *(str(one.same) for one in found)],
        ["before [%]", *(percent(one.before / one.n, one.n) for one in found)],
        ["after [%]", *(percent(one.after / one.n, one.n) for one in found)],
        ["lost", *(str(len(one.lost)) for one in found)],
        ["won", *(str(len(one.won)) for one in found)],
    ]
    for measure in measures:
        by_change = [next(one for one in change.differences if one.field == measure.field) for change in found]
        cells = [told_difference(one, measure, change.n) for one, change in zip(by_change, found, strict=True)]
        columns.append([measure.name, *cells])
        if measure.field == "success":
            columns.append(["p", *(f"{one.p_value:.2g}" for one in by_change)])
    return TextTable.of_columns("new minus old in the same worlds", columns)


def changes(old: Sequence[EpisodeRow], new: Sequence[EpisodeRow]) -> list[Change]:
    """What has changed from one set of rows to another, by policy and scenario; of missions that both have.

    Raises:
        ValueError: a row stands twice.
    """
    was, now = _by_pair(old), _by_pair(new)
    found = []
    for policy in dict.fromkeys(policy for policy, _ in was):
        shared = [pair for pair in was if pair[0] == policy and pair in now]
        single = [change for pair in shared if (change := _change(*pair, was[pair], now[pair]))]
        found += single
        if len(single) > 1:
            compared = [(policy, one.scenario) for one in single]
            together = ([row for pair in compared for row in rows[pair]] for rows in (was, now))
            whole = _change(policy, OVERALL, *together)
            found += [whole] if whole else []
    return found


def _by_pair(rows: Sequence[EpisodeRow]) -> dict[tuple[str, str], list[EpisodeRow]]:
    """Rows by policy and scenario."""
    pairs: dict[tuple[str, str], list[EpisodeRow]] = {}
    for row in rows:
        pairs.setdefault((row.policy, row.scenario), []).append(row)
    return pairs


def _change(policy: str, scenario: str, old: Sequence[EpisodeRow], new: Sequence[EpisodeRow]) -> Change | None:
    """What has changed between rows of one policy; None where they have no world in common."""
    before, after = ({(one.scenario, one.rows[0].seed): one for one in missions(rows)} for rows in (old, new))
    common = [world for world in before if world in after]
    if not common:
        return None
    return Change(
        policy=policy,
        scenario=scenario,
        n=len(common),
        same=sum(list(map(_content, before[w].rows)) == list(map(_content, after[w].rows)) for w in common),
        before=sum(before[world].success for world in common),
        after=sum(after[world].success for world in common),
        lost=tuple(sorted(world for world in common if before[world].success and not after[world].success)),
        won=tuple(sorted(world for world in common if after[world].success and not before[world].success)),
        differences=tuple(paired_difference(new, old, field) for field in COMPARED),
    )


def _content(row: EpisodeRow) -> dict[str, Any]:
    """What of a row a second run of the same code would say again."""
    return {name: value for name, value in row.as_dict().items() if "decision_time" not in name}


def _in_both(kind: str, before: _Kept, after: _Kept, notes: list[str]) -> list[str]:
    """Labels that rows of both folders have; of those that one lacks a note is taken."""
    was, now = (list(dict.fromkeys(getattr(row, kind) for row in folder.rows)) for folder in (before, after))
    for folder, here, there in ((before, was, now), (after, now, was)):
        if lacking := [label for label in here if label not in there]:
            notes.append(f"not compared: {kind} {', '.join(lacking)}, in {folder.path} alone")
    return [label for label in was if label in now]


def _told_lacking(folder: Path, rows: Sequence[EpisodeRow], others: Sequence[EpisodeRow]) -> Iterator[str]:
    """Worlds of a folder that the other one lacks, as of a run that was cut off; policies that lack as many in one line."""
    there = {(row.policy, row.scenario, row.seed) for row in others}
    worlds = dict.fromkeys((row.policy, row.scenario, row.seed) for row in rows)
    counts = Counter((policy, scenario) for policy, scenario, seed in worlds if (policy, scenario, seed) not in there)
    policies: dict[tuple[str, int], list[str]] = {}
    for (policy, scenario), count in counts.items():
        policies.setdefault((scenario, count), []).append(policy)
    for (scenario, count), labels in policies.items():
        told = "1 world" if count == 1 else f"{count} worlds"
        yield f"not compared: {told} of {', '.join(labels)} in {scenario}, in {folder} alone"


def _other_worlds(label: str, before: _Kept, after: _Kept) -> str:
    """How a scenario or its worlds are others in one folder than in the other; "" where nothing says so."""
    was, now = (
        {key: value for key, value in without_places(folder.manifest)["scenarios"][label].items() if key != "seeds"}
        for folder in (before, after)
    )
    if was != now:
        told = next(differences(was, now))
        defaults = "what it leaves to its defaults has changed, " if told.startswith("digest ") else ""
        return f"which is another one: {defaults}{told}"
    kept, later = ([row for row in folder.rows if row.scenario == label] for folder in (before, after))
    lengths = {(row.seed, row.robot): row.shortest_path_length for row in kept}
    for row in later:
        other = row.shortest_path_length
        length = lengths.get((row.seed, row.robot), other)
        if not (isnan(length) or isnan(other) or isclose(length, other, rel_tol=SAME_LENGTH)):
            was_long, is_long = ("none" if one == inf else f"{one:.6g} m" for one in (length, other))
            return f"whose worlds are others: the shortest path of seed {row.seed} was {was_long}, is now {is_long}"
    return ""


def _told_differences(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[str]:
    """Where it differs what was asked of policies that both have, and what their rows depend on."""
    for key in ("policies", "versions"):
        was, now = before[key], after[key]
        common = [name for name in was if name in now] if key == "policies" else list(dict.fromkeys([*was, *now]))
        yield from differences({name: was.get(name) for name in common}, {name: now.get(name) for name in common}, key)


def _read(folder: str | os.PathLike[str]) -> _Kept:
    """What a results folder holds, its torn end left out."""
    path = out_path(folder)
    if not (path / MANIFEST).is_file():
        raise ValueError(
            f"{path} is no results folder: expected {MANIFEST} in it, as `evaluate --out {path}` writes it"
        )
    try:
        manifest = from_json((path / MANIFEST).read_bytes())
    except ValueError as error:
        raise ValueError(f"{path / MANIFEST} is damaged: {error}") from None
    checked(Manifest, manifest, f"{path / MANIFEST} is damaged")
    file, rows = path / ROWS, []
    first: dict[tuple[str, str, int, int], int] = {}
    for number, text in enumerate(file.read_bytes().split(b"\n")[:-1] if file.exists() else [], start=1):
        try:
            row = EpisodeRow.from_dict(from_json(text))
            if row.scenario not in manifest["scenarios"]:
                raise ValueError(f"scenario: got {row.scenario!r}, {MANIFEST} has none of that name")
            before = first.setdefault((row.policy, row.scenario, row.seed, row.robot), number)
            if before != number:
                raise ValueError(f"robot {row.robot} of that world stands in line {before}, too")
        except ValueError as error:
            raise ValueError(f"{file}: line {number}: {'; '.join(str(error).splitlines())}") from None
        rows.append(row)
    return _Kept(path, manifest, _whole_worlds(rows, manifest["scenarios"]))


def _whole_worlds(rows: Sequence[EpisodeRow], scenarios: Mapping[str, Any]) -> list[EpisodeRow]:
    """Rows of worlds of which all robots are there; a kill may have cut the last one short."""
    counts = Counter((row.policy, row.scenario, row.seed) for row in rows)
    robots = {label: _robots_of(about["scenario"].get("robots")) for label, about in scenarios.items()}
    return [row for row in rows if counts[row.policy, row.scenario, row.seed] == robots[row.scenario]]


def _robots_of(robots: Any) -> int:
    """How many robots a scenario has, as a manifest says: each by itself, by their count, or nothing of one alone."""
    return len(robots) if isinstance(robots, list) else robots.get("count", 1) if isinstance(robots, Mapping) else 1


def write_comparison(path: str | os.PathLike[str], comparison: Comparison) -> None:
    """Write a comparison as strict JSON, whole or not at all: NaN is null, infinity the string "inf"."""
    data = {"changes": [change.as_dict() for change in comparison.changes], "notes": comparison.notes}
    with replaced_when_done(out_path(path)) as partial:
        partial.write_text(json.dumps(data, indent=2, allow_nan=False) + "\n", encoding="utf-8")
