"""Numbers over time as few letters: whole units, changes from frame to frame, deflate, base64."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

MILLI, CENTI = 1e-3, 1e-2
"""What a whole number counts: places in millimetres, headings in milliradians; ranges and drawings in centimetres."""


def whole(values: ArrayLike, unit: float) -> list[int]:
    """Values of any shape as one row of whole numbers of a unit."""
    return [int(value) for value in np.rint(np.asarray(values, dtype=np.float64) / unit).ravel()]


def changes(frames: Sequence[ArrayLike], unit: float) -> list[int]:
    """Values (T, ...) of some frames: those of each place one after the other, the first and then what was added to it.

    The whole numbers are rounded before they are subtracted, so that errors do not add up.
    """
    table = np.rint(np.asarray(frames, dtype=np.float64).reshape(len(frames), -1) / unit).astype(np.int64)
    return [int(value) for value in np.diff(table, axis=0, prepend=0).T.ravel()]


def runs(numbers: Sequence[int]) -> list[int]:
    """Numbers as first, count, first, count, ... of those that follow one another: 4 5 6 9 as 4 3 9 1."""
    found: list[int] = []
    for number in numbers:
        if found and number == found[-2] + found[-1]:
            found[-1] += 1
        else:
            found += [number, 1]
    return found


def packed(data: Mapping[str, Any]) -> str:
    """Plain data as letters that can stand in a page as they are."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return base64.b64encode(zlib.compress(text.encode(), level=9)).decode()


def unpacked(letters: str) -> dict[str, Any]:
    """What was `packed`."""
    return dict(json.loads(zlib.decompress(base64.b64decode(letters))))
