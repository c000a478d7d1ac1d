"""Files of the DynaBARN benchmark: lines of JSON with walls, and with movers on tracks of keyframes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bug_gym.geometry import F64
from bug_gym.limits import STEEP
from bug_gym.worlds.barn_files import load_lines
from bug_gym.worlds.kept import Kept, only_itself
from bug_gym.worlds.keyframes import Keyframes

FAREST = 1_000.0
"""Greatest coordinate and radius [m]."""
LEAST_GAP = 1e-3
"""Least time between two keys [s]."""
LEAST_PERIOD = 1.0
"""Of a track [s]."""
MOST_KEYS = 10_000
"""Of all movers of a world."""


@dataclass(frozen=True)
class DynaBarnMap:
    """One world of DynaBARN."""

    start: tuple[float, float, float]
    """x, y [m], heading [rad]."""
    goal: tuple[float, float]
    """x, y [m]."""
    walls: tuple[F64, ...]
    """Corners (k, 2) of each wall [m]."""
    movers: tuple[tuple[float, Keyframes], ...]
    """Radius [m] and track of each mover."""


def _read(path: str) -> dict[int, DynaBarnMap]:
    """Worlds by number, from a .jsonl with one world a line.

    Raises:
        ValueError: a line that is no such world (its number is in the message), or none at all.
    """
    worlds = load_lines(Path(path), "DynaBARN", _from_json)
    if not worlds:
        raise ValueError(f"{path}: no DynaBARN world found (expected a .jsonl with one world a line)")
    return worlds


load_dynabarn = Kept(_read, only_itself)
"""Worlds by number, from a .jsonl with one world a line; a ValueError names the line that is none."""


def _from_json(data: dict[str, Any]) -> DynaBarnMap:
    x, y, heading = _numbers(data["start"], (3,), "the start", most=STEEP).tolist()
    goal_x, goal_y = _numbers(data["goal"], (2,), "the goal").tolist()
    _numbers([x, y], (2,), "the start")
    walls = tuple(_numbers(wall["polygon"], (-1, 2), "a wall") for wall in data["walls"])
    if any(len(wall) < 3 for wall in walls):
        raise ValueError("a wall has fewer than 3 corners")
    movers = tuple(_mover(mover) for mover in data["movers"])
    keys = sum(len(track.times) for _, track in movers)
    if keys > MOST_KEYS:
        raise ValueError(f"got {keys:,} keyframes, expected at most {MOST_KEYS:,}")
    return DynaBarnMap((x, y, heading), (goal_x, goal_y), walls, movers)


def _mover(data: dict[str, Any]) -> tuple[float, Keyframes]:
    """Radius [m] and track of a mover."""
    radius = float(data["radius"])
    if not LEAST_GAP <= radius <= FAREST:
        raise ValueError(f"got the radius {radius:g}, expected a number from {LEAST_GAP:g} to {FAREST:g}")
    keys = _numbers(data["keyframes"], (-1, 3), "the keyframes", most=STEEP)
    _numbers(keys[:, 1:].tolist(), (-1, 2), "the keyframes' places")
    times = keys[:, 0]
    if len(keys) < 2 or times[0] != 0.0 or np.diff(times).min() < LEAST_GAP or times[-1] < LEAST_PERIOD:
        came = f"{len(keys)} keyframes at times from {times[:1].tolist()} to {times[-1:].tolist()}"
        raise ValueError(f"got {came}, expected times that rise from 0 to {LEAST_PERIOD:g} s or more")
    return radius, Keyframes(times, keys[:, 1:])


def _numbers(values: Any, shape: tuple[int, ...], what: str, *, most: float = FAREST) -> F64:
    """Finite numbers of a shape (-1: any), none beyond `most`."""
    numbers = np.array(values, dtype=np.float64)
    if numbers.ndim != len(shape) or any(n not in (-1, m) for n, m in zip(shape, numbers.shape, strict=True)):
        raise ValueError(f"{what} has shape {numbers.shape}, expected {shape} (-1: any)")
    if not np.isfinite(numbers).all() or abs(numbers).max(initial=0.0) > most:
        raise ValueError(f"{what} holds a number that is not finite, or beyond {most:g}")
    return numbers
