"""What a long reproduction has found so far, in a file: one that was stopped goes on where it was.

A line of JSON a run, in order of arrival. The file does not know which code found what: who changes a policy takes its lines
out, or begins another file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from pydantic import TypeAdapter, ValidationError

from bug_gym.files import append, from_json, replaced_when_done, writable

Run = TypeVar("Run", bound=NamedTuple)


class Kept(Generic[Run]):
    """The runs of a file, and those that are added to it.

    Args:
        path: of the file, which may be missing; None: nothing is kept beyond this process.
        kind: of which each run is.
        key: what tells two runs apart.

    Raises:
        ValueError: a line holds no such run, or says of one what an earlier line does not; or the file cannot be written. The
            last line may be torn, as a kill leaves it.
    """

    def __init__(self, path: Path | None, kind: type[Run], key: Callable[[Run], Any]) -> None:
        self.path = path and writable(path)
        self._key = key
        self.found: dict[Any, Run] = {}
        """By key."""
        *whole, torn = self.path.read_bytes().split(b"\n") if self.path and self.path.exists() else [b""]
        read = TypeAdapter(kind)
        for number, line in enumerate(whole, start=1):
            try:
                run = read.validate_python(from_json(line), strict=True)
                if self.found.setdefault(key(run), run) != run:
                    raise ValueError("contradicts what an earlier line says")
            except ValidationError as error:
                fault = error.errors(include_url=False)[0]
                where = ".".join(map(str, fault["loc"]))
                raise ValueError(f"{self.path}: line {number}: {where}: {fault['msg']}") from None
            except ValueError as error:
                raise ValueError(f"{self.path}: line {number}: {error}") from None
        if torn and self.path:
            with replaced_when_done(self.path) as partial:
                partial.write_bytes(b"".join(line + b"\n" for line in whole))

    def __contains__(self, key: object) -> bool:
        return key in self.found

    def add(self, runs: Iterable[Run]) -> None:
        """Keep some runs; they are on the disk when this returns."""
        new = list(runs)
        self.found |= {self._key(run): run for run in new}
        if self.path:
            append(self.path, "".join(json.dumps(run._asdict()) + "\n" for run in new).encode())
