"""A plugin of pytest that writes down what every exception said that a test caught: see record.py.

One line a text, into a file of each process in the folder $RECORD_ERRORS, without what changes from run to run.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
VARYING = (
    (re.compile(r"/\S*?/pytest-of-[^/\s]+/pytest-\d+(?:/popen-gw\d+)?(?:/[^/\s'\":,)]+)?"), "<tmp>"),
    (re.compile(re.escape(sys.prefix)), "<environment>"),
    (re.compile(re.escape(str(ROOT))), "<root>"),
    (re.compile(r"\b0x[0-9a-f]{6,}"), "<address>"),
)
"""What changes from run to run, and what stands for it; a test's own folder has the test's name."""

caught = pytest.raises


def lasting_text(error: BaseException) -> str:
    """Type and text of an exception in one line."""
    text = "\n".join([f"{type(error).__name__}: {error}", *getattr(error, "__notes__", ())])
    for pattern, name in VARYING:
        text = pattern.sub(name, text)
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text.replace("\\", "\\\\"))


def write_down(error: BaseException) -> None:
    """Add an exception to this process's file."""
    with (Path(os.environ["RECORD_ERRORS"]) / f"{os.getpid()}.txt").open("a", encoding="utf-8") as file:
        file.write(f"{lasting_text(error)}\n")


@contextmanager
def recorded_raises(*arguments: Any, **settings: Any) -> Iterator[Any]:
    """`pytest.raises` as a context, which writes down what it caught."""
    with caught(*arguments, **settings) as info:
        yield info
    write_down(info.value)


def pytest_configure() -> None:
    """Take the place of `pytest.raises`."""
    pytest.raises = recorded_raises  # type: ignore[assignment]
