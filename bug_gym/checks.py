"""Checks of what callers hand in (seeds, counts, numbers), and of what is installed.

An error says in one line what came and what was expected.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from bug_gym.naming import nearest_hint

NOT_REAL = "cSUVMm"
"""Kinds of arrays that NumPy would turn into real numbers, though they are none: complex, text, records, dates."""


def checked_seed(value: object) -> int:
    """A seed of worlds as an int, NumPy's integers too.

    Raises:
        ValueError: it is no integer from 0 to 2**63 - 1.
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 0 <= value < 2**63:
        raise ValueError(f"a seed is an integer from 0 to 2**63 - 1, got {shortened(value)}")
    return int(value)


def checked_count(name: str, value: object, *, least: int = 1, most: int | None = None) -> int:
    """How many of something, as an int, NumPy's integers too.

    Raises:
        ValueError: it is no integer, or one below `least` or above `most`.
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise ValueError(f"{name} must be an integer, got {shortened(value)}")
    if value < least:
        raise ValueError(f"{name} must be at least {least}, got {shortened(value)}")
    if most is not None and value > most:
        raise ValueError(f"{name} must be at most {most:,}, got {shortened(value)}")
    return int(value)


def checked_time(name: str, value: object) -> float:
    """A time that something may take, above 0 and finite.

    Raises:
        ValueError: it is no such number.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ValueError(f"{name} must be a number above 0, got {shortened(value)}")
    if not 0.0 < value <= sys.float_info.max:
        raise ValueError(f"{name} must be a number above 0, got {shortened(value)}")
    return float(value)


def row_numbers(name: str, values: Any, count: int) -> NDArray[np.int64]:
    """Numbers (n,) of rows, of which there are so many.

    Raises:
        ValueError: they are no integers in one row of numbers, or there is no such row.
    """
    numbers = np.asarray(values)
    if numbers.ndim != 1 or (numbers.size and numbers.dtype.kind not in "iu"):
        raise ValueError(f"{name} are numbers of rows (n,), got shape {numbers.shape} of {numbers.dtype}")
    outside = numbers[(numbers < 0) | (numbers >= count)]
    if outside.size:
        raise ValueError(f"{name} are from 0 to {count - 1}, got {outside[0]}")
    return numbers.astype(np.int64)


def checked_options(options: object, known: Collection[str] | None) -> Mapping[str, Any]:
    """The options of a `reset`, none by default; known: their names, None where any may be.

    Raises:
        ValueError: they are no mapping, or have a key that is not known.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ValueError(f"options is a dict or None, got {shortened(options)}")
    if known is not None and (unknown := unknown_options(options, known)):
        raise ValueError(unknown)
    return options


def unknown_options(options: Mapping[Any, Any], known: Collection[str]) -> str:
    """What to say about the first key of a `reset`'s options that is not known; "" where all are."""
    for key in options:
        if key not in known:
            return f"unknown option {shortened(key)}{nearest_hint(key, known)} (known: {', '.join(known) or 'none'})"
    return ""


def real_numbers(what: str, values: Any) -> NDArray[np.float64]:
    """Values as an array of real numbers.

    Raises:
        ValueError: they are complex, text or no numbers at all.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind not in NOT_REAL:
            return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):  # what is ragged, or holds objects that are no numbers
        pass
    raise ValueError(f"{what} must be real numbers, got {_in_short(values)}")


def _in_short(values: object) -> str:
    """A value as an error shows it in its line: of an array its shape and kind."""
    return f"shape {values.shape} of {values.dtype}" if isinstance(values, np.ndarray) else shortened(values)


def shortened(value: object, most: int = 80) -> str:
    """A value as an error shows it: at most so many characters of its `repr`, in one line."""
    try:
        text = " ".join(map(str.strip, repr(value).split("\n")))
    except ValueError:  # a whole number of more digits than Python writes out
        text = "a number of thousands of digits"
    except RecursionError:
        text = "what is nested too deep to show"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def float32_numbers(what: str, values: Any) -> NDArray[np.float32]:
    """Values as an array of float32, the same one where they are that already.

    Raises:
        ValueError: they are complex, text or no numbers at all.
    """
    if isinstance(values, np.ndarray) and values.dtype == np.float32:
        return values
    return real_numbers(what, values).astype(np.float32)


@contextmanager
def needed_from(extra: str, what: str, *, whole: bool = False) -> Iterator[None]:
    """Around imports of what an extra installs.

    Args:
        extra: its name.
        what: what needs it.
        whole: whether all packages of the extra are looked for first, so that none is missed after hours of work.

    Raises:
        ImportError: a package is missing; the message names it, the extra, and how to install that.
    """
    missing = missing_of(extra) if whole else []
    if missing:
        raise ImportError(_needed(extra, what, ", ".join(missing)))
    try:
        yield
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        if package == "bug_gym":  # a fault of our own
            raise
        raise ImportError(_needed(extra, what, package)) from error


def _needed(extra: str, what: str, packages: str) -> str:
    return f"{what} needs {packages}, of the extra `{extra}`: {install_command(extra)}"


def install_command(extra: str) -> str:
    """What installs an extra, from where the package itself was installed: a checkout, an address, or the package index."""
    try:
        installed = metadata.distribution("bug_gym")
    except metadata.PackageNotFoundError:
        installed = None
    if installed is None or installed.read_text("WHEEL") is None:  # run from a folder, not installed
        return f"pip install -e '{Path(__file__).parents[1]}[{extra}]'"
    told = installed.read_text("direct_url.json")
    if told is None:  # it came from the index
        return f"pip install 'bug-gym[{extra}]'"
    origin = json.loads(told)
    if origin.get("dir_info", {}).get("editable"):
        folder = re.sub(r"^/(?=[A-Za-z]:)", "", unquote(urlsplit(origin["url"]).path))  # of Windows: /C:/...
        return f"pip install -e '{folder}[{extra}]'"
    kind = f"{origin['vcs_info']['vcs']}+" if "vcs_info" in origin else ""
    return f"pip install 'bug-gym[{extra}] @ {kind}{origin['url']}'"


def missing_of(extra: str) -> list[str]:
    """The packages of an extra that are not installed, as our own metadata lists them."""
    try:
        required = metadata.requires("bug_gym") or []
    except metadata.PackageNotFoundError:  # run from a folder, not installed
        return []
    own = [line for line in required if re.search(rf"extra\s*==\s*['\"]{re.escape(extra)}['\"]", line)]
    names = [found[0] for line in own if (found := re.match(r"[\w.-]+", line))]
    return [name for name in names if not any(metadata.distributions(name=name))]
