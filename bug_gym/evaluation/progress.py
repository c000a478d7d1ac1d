"""How far the work is, on the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")

Track = Callable[[Iterable[T], str, int], Iterable[T]]
"""Lets items through and shows how many of a total have come, under a title."""


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

    columns = (TextColumn("{task.description:<14}", markup=False), BarColumn(), MofNCompleteColumn())
    times = (TextColumn("elapsed"), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
    with Progress(*columns, *times, console=Console(stderr=True)) as bar:
        yield lambda items, title, total: bar.track(items, total=total, description=title) if total else items
