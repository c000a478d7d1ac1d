"""How path, time and clearance of the successes are spread: small histograms as SVG."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np

from bug_gym.evaluation.page.markup import Cell, Markup, element, joined, table
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import path_ratio
from bug_gym.evaluation.text_table import NOTHING

BINS = 24
"""Bars of a histogram."""
BAR, HEIGHT = 5, 24
"""Width of a bar and height of the tallest, in units of the drawing."""
FAR = 98.0
"""Percentile of all values at which the axis ends; what is beyond stands in the last bar."""


class Measure(NamedTuple):
    """A quantity whose spread is drawn."""

    name: str
    of: Callable[[EpisodeRow], float]
    digits: int


MEASURES = (
    Measure("path / shortest", path_ratio, 2),
    Measure("time [s]", lambda row: row.time, 1),
    Measure("clearance [m]", lambda row: row.min_clearance, 3),
)


def distributions(rows: Sequence[EpisodeRow]) -> Markup:
    """A table a scenario: a line a policy, a histogram a measure, all policies on the same axis."""
    by_scenario: dict[str, dict[str, list[EpisodeRow]]] = {}
    for row in rows:
        mine = by_scenario.setdefault(row.scenario, {}).setdefault(row.policy, [])
        if row.success:
            mine.append(row)
    parts = [
        element("details", element("summary", scenario), _table(policies), open=len(by_scenario) == 1)
        for scenario, policies in by_scenario.items()
    ]
    return joined(parts)


def _table(policies: dict[str, list[EpisodeRow]]) -> Markup:
    values = {
        measure: {
            policy: [value for value in map(measure.of, rows) if isfinite(value)] for policy, rows in policies.items()
        }
        for measure in MEASURES
    }
    measured = {measure: found for measure, found in values.items() if any(found.values())}
    axes = {measure: _axis([value for mine in found.values() for value in mine]) for measure, found in measured.items()}
    header = [
        f"{measure.name}, {low:.{measure.digits}f} to {high:.{measure.digits}f}"
        for measure, (low, high) in axes.items()
    ]
    lines = [
        [
            Cell(policy),
            Cell(str(len(rows))),
            *(_cell(measure, found[policy], axes[measure]) for measure, found in measured.items()),
        ]
        for policy, rows in policies.items()
    ]
    return table(["policy", "successes", *header], lines)


def _axis(values: Sequence[float]) -> tuple[float, float]:
    """From where to where the histograms of a measure go."""
    return min(values), float(np.percentile(values, FAR))


def _cell(measure: Measure, values: Sequence[float], axis: tuple[float, float]) -> Cell:
    if not values:
        return Cell(NOTHING)
    low, middle, high = np.percentile(values, [25.0, 50.0, 75.0])
    told = f"{middle:.{measure.digits}f} ({low:.{measure.digits}f} to {high:.{measure.digits}f})"
    return Cell(joined([histogram(values, axis), " ", element("small", told)]))


def counts(values: Sequence[float], axis: tuple[float, float]) -> list[int]:
    """How many values lie in each of BINS equal parts of an axis; what lies beyond its end is in the last one."""
    low, high = axis
    if high <= low:
        return [len(values), *([0] * (BINS - 1))]
    inside = np.clip(values, low, high)
    places = np.minimum((BINS * ((inside - low) / (high - low))).astype(int), BINS - 1)
    return [int(count) for count in np.bincount(places, minlength=BINS)]


def histogram(values: Sequence[float], axis: tuple[float, float]) -> Markup:
    """The values as bars, the tallest as high as the drawing."""
    found = counts(values, axis)
    tallest = max(found)
    heights = [round(HEIGHT * count / tallest, 1) for count in found]
    bars = "".join(
        f"M{place * BAR} {HEIGHT}v-{height:g}h{BAR - 1}v{height:g}z" for place, height in enumerate(heights) if height
    )
    floor = element("path", d=f"M0 {HEIGHT + 0.5}h{BAR * BINS}", class_="floor")
    box = f"0 0 {BAR * BINS} {HEIGHT + 1}"
    return element("svg", element("path", d=bars), floor, viewBox=box, class_="bars", aria_hidden="true")
