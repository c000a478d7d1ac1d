"""Recorded ways of pedestrians, from csv files: `time_s,pedestrian,x_m,y_m`, a line a record."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bug_gym.limits import DATA, EPOCH, FAR, SMALL, read_file
from bug_gym.schema.errors import shortened
from bug_gym.worlds.kept import Kept, only_itself

HEADER = ["time_s", "pedestrian", "x_m", "y_m"]


@dataclass(frozen=True)
class Track:
    """The way of one pedestrian."""

    pedestrian: str
    """Name or number."""
    records: NDArray[np.float64]
    """Time [s], x, y [m] of each record (k, 3), in the order of time."""


@dataclass(frozen=True)
class Recording:
    """The ways of all pedestrians of a file."""

    tracks: tuple[Track, ...]
    """In the order in which the file names them."""

    @property
    def times(self) -> tuple[float, float]:
        """Time of the first and of the last record [s]."""
        ends = [track.records[[0, -1], 0] for track in self.tracks]
        return float(min(first for first, _ in ends)), float(max(last for _, last in ends))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of all records [m]."""
        places = np.concatenate([track.records[:, 1:] for track in self.tracks])
        (xmin, ymin), (xmax, ymax) = places.min(axis=0).tolist(), places.max(axis=0).tolist()
        return xmin, ymin, xmax, ymax

    def flow(self) -> float:
        """Direction in which most pedestrians walk, one way or the other [rad, from 0 to pi]."""
        ways = np.array([track.records[-1, 1:] - track.records[0, 1:] for track in self.tracks])
        x, y = ways.T
        # Doubled angles make the two ways one.
        angle = 0.5 * math.atan2(float(2.0 * (x * y).sum()), float((x * x - y * y).sum()))
        return angle % math.pi

    def within(self, box: tuple[float, float, float, float]) -> Recording:
        """What of the recording lies within xmin, ymin, xmax, ymax [m]; who leaves and comes back is one more track."""
        xmin, ymin, xmax, ymax = box
        pieces = []
        for track in self.tracks:
            _, x, y = track.records.T
            inside = (xmin <= x) & (x <= xmax) & (ymin <= y) & (y <= ymax)
            ends = np.flatnonzero(np.diff(inside)) + 1
            parts = zip(np.split(track.records, ends), np.split(inside, ends), strict=True)
            pieces += [Track(track.pedestrian, part) for part, is_inside in parts if is_inside.all()]
        return Recording(tuple(pieces))


def _read(path: str) -> Recording:
    """The recording in a csv file.

    Raises:
        ValueError: not such a file; the message names the line.
    """
    records: dict[str, list[tuple[float, float, float]]] = {}
    for line, row in _rows(path):
        pedestrian, record = _record(row, f"{path}, line {line}")
        track = records.setdefault(pedestrian, [])
        if track and record[0] <= track[-1][0]:
            raise ValueError(
                f"{path}, line {line}: got time {record[0]:g} of pedestrian {pedestrian}, expected one after "
                f"{track[-1][0]:g}, that of the record before"
            )
        if track and record[0] - track[-1][0] < SMALL:
            raise ValueError(
                f"{path}, line {line}: got {record[0] - track[-1][0]:g} s between two records of pedestrian {pedestrian}, "
                f"expected at least {SMALL:g}"
            )
        track.append(record)
    if not records:
        raise ValueError(f"{path}: no record in it")
    return Recording(tuple(Track(pedestrian, np.array(track)) for pedestrian, track in records.items()))


load_recording = Kept(_read, only_itself)
"""The recording in a csv file, by its path; a ValueError names the line that is none."""


def _rows(path: str) -> Iterator[tuple[int, list[str]]]:
    """Rows of a csv file below its header, each with the number of its line."""
    try:
        text = read_file(Path(path), DATA).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not a csv file ({error.reason})") from None
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from None
    reader = csv.reader(text.splitlines(), strict=True)
    try:
        header = next(reader, [])
        if [name.strip() for name in header] != HEADER:
            came = shortened(",".join(header), 200)
            raise ValueError(f"{path}, line 1: got the header {came}, expected {','.join(HEADER)!r}")
        for row in reader:
            yield reader.line_num, row
    except csv.Error as error:
        raise ValueError(f"{path}, line {reader.line_num}: not csv ({error})") from None


def _record(row: list[str], label: str) -> tuple[str, tuple[float, float, float]]:
    """Pedestrian, and time, x, y of one row; `label` names it in errors."""
    if len(row) != len(HEADER) or not all(field.strip() for field in row):
        raise _not_a_record(row, label, f"{len(HEADER)} columns, none of them empty")
    time, pedestrian, x, y = row
    try:
        record = float(time), float(x), float(y)
    except ValueError:
        raise _not_a_record(row, label, "numbers for time, x and y") from None
    if not all(map(math.isfinite, record)):
        raise _not_a_record(row, label, "finite numbers")
    if abs(record[0]) > EPOCH or max(map(abs, record[1:])) > FAR:
        raise _not_a_record(row, label, f"times up to {EPOCH:g} s and places up to {FAR:g} m")
    return pedestrian.strip(), record


def _not_a_record(row: list[str], label: str, expected: str) -> ValueError:
    return ValueError(f"{label}: got {shortened(','.join(row), 200)}, expected {expected}")
