"""The folder in which the rows of a plan are kept as they come, so that a run that was cut off goes on.

manifest.json says what was asked, rows.jsonl has one row a line in order of arrival, shortest_paths.jsonl one world.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from bug_gym.evaluation.lengths import Lengths, World
from bug_gym.evaluation.plan import Plan
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.files import replaced_when_done

ROWS, LENGTHS = "rows.jsonl", "shortest_paths.jsonl"
"""Files of a result folder that grow as the work goes on."""

T = TypeVar("T")


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
