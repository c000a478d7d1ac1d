"""What worlds are read from: kept between episodes, and read again where a file has changed since."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Generic, NamedTuple, TypeAlias, TypeVar

T = TypeVar("T")

MOST_KEPT = 8
"""Paths of which a reader keeps what it has read; the oldest makes room for another."""

State: TypeAlias = tuple[int, int, int] | None
"""What tells a file from what it was: its number, its length and when it was last written; None: it is gone."""


class _Reading(NamedTuple, Generic[T]):
    """What was read, and how its files were then."""

    value: T
    states: dict[Path, State]


class Kept(Generic[T]):
    """A reader that reads a path once, and anew where one of its files is another one than it was.

    A file that is gone is no reason to read again: whoever drives in its worlds goes on with what was read.

    Args:
        read: what reads a path.
        files: the files and folders that it has read for it, by the path and what came out.
    """

    def __init__(self, read: Callable[[str], T], files: Callable[[Path, T], Iterable[Path]]) -> None:
        self._read, self._files = read, files
        self._readings: dict[str, _Reading[T]] = {}

    def __call__(self, path: str) -> T:
        """What a path holds."""
        kept = self._readings.get(path)
        if kept is not None and all(_state(file) in (None, before) for file, before in kept.states.items()):
            return kept.value
        source = Path(path)
        before = _state(source)  # before it is read: what is written meanwhile is seen the next time
        value = self._read(path)
        states = {file: _state(file) for file in self._files(source, value)}
        self._readings.pop(path, None)
        self._readings[path] = _Reading(value, {**states, source: before})
        if len(self._readings) > MOST_KEPT:
            del self._readings[next(iter(self._readings))]
        return value

    def files(self, path: str) -> tuple[Path, ...]:
        """The files that were read for a path, in the order of their names."""
        self(path)
        return tuple(sorted(file for file in self._readings[path].states if not file.is_dir()))


def only_itself(path: Path, value: object) -> tuple[Path, ...]:
    """The files of a reader that reads nothing but the path itself."""
    return (path,)


def _state(file: Path) -> State:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns
