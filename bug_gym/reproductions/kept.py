"""What a long reproduction has found so far, in a file: one that was stopped goes on where it was.

The first line says which code finds it: versions, this package's source, and what policies from outside are made of. Then comes
a line of JSON a run, in order of arrival. Runs of other code are not counted: the file is refused.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from pydantic import TypeAdapter, ValidationError

from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.evaluation.plan import versions
from bug_gym.evaluation.results_folder import other_run
from bug_gym.files import append, from_json, one_writer, replaced_when_done, writable

Run = TypeVar("Run", bound=NamedTuple)

VERSIONS, POLICIES = "versions", "policies"
"""Keys of the first line; under the second the digests of policies from outside, by name."""
CURE = "name another file, or remove this one"


def code_of(policies: Iterable[str]) -> dict[str, str]:
    """Digests of what policies from outside are made of, by name; a policy of this package has none of its own."""
    found = {policy: PolicyEntry.of(policy).code for policy in policies}
    return {policy: code for policy, code in found.items() if code}


class Kept(Generic[Run]):
    """The runs of a file, and those that are added to it.

    Args:
        path: of the file, which may be missing; None: nothing is kept beyond this process.
        kind: of which each run is.
        key: what tells two runs apart.
        code: digests of policies from outside that are to drive, by name.

    Raises:
        ValueError: other code has found the runs of the file, or nobody knows which; a line holds no such run, or says of one
            what an earlier line does not; or the file cannot be written. The last line may be torn, as a kill leaves it.
    """

    def __init__(
        self, path: Path | None, kind: type[Run], key: Callable[[Run], Any], code: Mapping[str, str] | None = None
    ) -> None:
        self.path = path and writable(path)
        self._key = key
        self.found: dict[Any, Run] = {}
        """By key."""
        *whole, torn = self.path.read_bytes().split(b"\n") if self.path and self.path.exists() else [b""]
        first = self._agreed(whole[0] if whole else None, code or {})
        read = TypeAdapter(kind)
        for number, line in enumerate(whole[1:], start=2):
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
        if self.path and (torn or whole[:1] != [first]):
            with replaced_when_done(self.path) as partial:
                partial.write_bytes(b"".join(line + b"\n" for line in (first, *whole[1:])))

    def _agreed(self, line: bytes | None, code: Mapping[str, str]) -> bytes:
        """The first line as it is to be: that of the file, with the policies that are new to it.

        Raises:
            ValueError: it is of other code, or says nothing of code.
        """
        there: Any = {VERSIONS: versions(), POLICIES: {}}
        if line is not None:
            try:
                there = from_json(line)
            except ValueError as error:
                raise ValueError(f"{self.path}: line 1: {error}; {CURE}") from None
            if not isinstance(there, dict) or {*there} != {VERSIONS, POLICIES} or not isinstance(there[POLICIES], dict):
                raise ValueError(f"{self.path}: line 1 does not say which code has found these runs; {CURE}")
        known = {name: there[POLICIES].get(name, digest) for name, digest in code.items()}
        here = {VERSIONS: versions(), POLICIES: code}
        if other := other_run({VERSIONS: there[VERSIONS], POLICIES: known}, here):
            raise ValueError(f"{self.path} holds {other}; {CURE}")
        return json.dumps({**here, POLICIES: {**there[POLICIES], **code}}).encode()

    def __contains__(self, key: object) -> bool:
        return key in self.found

    def add(self, runs: Iterable[Run]) -> None:
        """Keep some runs; they are on the disk when this returns."""
        new = list(runs)
        self.found |= {self._key(run): run for run in new}
        if self.path:
            append(self.path, "".join(json.dumps(run._asdict()) + "\n" for run in new).encode())


@contextmanager
def kept_runs(
    path: Path | None, kind: type[Run], key: Callable[[Run], Any], policies: Sequence[str]
) -> Iterator[Kept[Run]]:
    """The runs of a file, which is kept to this process; who interrupts it is told that they are there.

    Args:
        path: of the file, which may be missing; None: nothing is kept beyond this process.
        kind: of which each run is.
        key: what tells two runs apart.
        policies: who drives.

    Raises:
        ValueError: another process adds to the file; or as of `Kept`.
    """
    with one_writer(writable(path)) if path else nullcontext():
        kept = Kept(path, kind, key, code_of(policies))
        try:
            yield kept
        except KeyboardInterrupt as error:
            if path:
                error.add_note(f"{path} keeps {len(kept.found)} runs, the same command goes on")
            raise
