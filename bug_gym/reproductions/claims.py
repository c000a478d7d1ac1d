"""What the reproductions of HD-BUG share: seeds apart from those parameters were set on, and lines of results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import paired_difference, path_ratio
from bug_gym.intervals import exact_mcnemar, wilson_interval
from bug_gym.reproductions.result import Settings

FIRST_SEED = 10_000
"""First seed of every figure; parameters were set on other seeds."""

ROBOT = {"kinematics": "holonomic", "radius": 0.2, "max_speed": 1.0}
"""The paper's point robot gets a body; its top speed is the paper's."""

CLEARANCE = 0.3
"""What bugs keep without being told in the worlds of these claims, the radius and one step [m]: of all, so that nobody goes
shorter ways for daring more."""


def run(
    policies: Sequence[str | Mapping[str, Any]],
    scenarios: Sequence[Mapping[str, Any]],
    seeds: int,
    settings: Settings,
    *,
    name: str,
    first: int = FIRST_SEED,
) -> list[EpisodeRow]:
    """Drive all policies through the same worlds."""
    suite = {"name": name, "scenarios": list(scenarios), "seeds": {"first": first, "count": seeds}}
    return evaluate(list(policies), suite, workers=settings.workers, progress=settings.progress)


def entry(policy: str) -> str | dict[str, Any]:
    """A policy of a suite; the map planner at the clearance that HD-BUG and the bugs have."""
    return {"name": policy, "parameters": {"clearance": CLEARANCE}} if policy == "hd_bug_map" else policy


def of(rows: Sequence[EpisodeRow], **fields: object) -> list[EpisodeRow]:
    """The rows whose fields have these values."""
    return [row for row in rows if all(getattr(row, name) == value for name, value in fields.items())]


def mean(values: Sequence[float]) -> float:
    """Arithmetic mean; NaN of nothing."""
    return math.fsum(values) / len(values) if values else math.nan


def share(rows: Sequence[EpisodeRow]) -> tuple[float, float, float]:
    """Success with its 95 % interval."""
    reached = sum(row.success for row in rows)
    return (reached / len(rows), *wilson_interval(reached, len(rows)))


def as_percent(rows: Sequence[EpisodeRow]) -> str:
    """Success with its 95 % interval in percent."""
    value, low, high = (100.0 * number for number in share(rows))
    return f"{value:.1f} [{low:.1f}, {high:.1f}]"


def numbers(rows: Sequence[EpisodeRow]) -> dict[str, Any]:
    """What JSON keeps of the episodes of one policy in one kind of world."""
    value, low, high = share(rows)
    reached = [row for row in rows if row.success]
    outcomes: dict[str, int] = {}
    for row in rows:
        label = f"{row.outcome} {row.verdict}".strip()
        outcomes[label] = outcomes.get(label, 0) + 1
    return {
        "n": len(rows),
        "success": value,
        "success_interval": [low, high],
        "outcomes": outcomes,
        "missed_seeds": sorted([row.scenario, row.seed] for row in rows if not row.success),
        "time": finite(mean([row.time for row in reached])),
        "path_length": finite(mean([row.path_length for row in reached])),
        "path_ratio": finite(mean([path_ratio(row) for row in reached])),
        "turns": finite(mean([float(row.turns) for row in reached])),
        "time_ratio": finite(mean([row.time_ratio for row in reached])),
        "decision_time_mean": mean([row.decision_time_mean for row in rows]),
        "decision_time_p99": mean([row.decision_time_p99 for row in rows]),
        "decision_time_total": mean([row.decision_time_total for row in rows]),
    }


def paired(mine: Sequence[EpisodeRow], other: Sequence[EpisodeRow]) -> dict[str, Any]:
    """What JSON keeps of one policy minus another in the same worlds: success, and path and time where both arrive.

    Each difference has its 95 % interval by bootstrap. p is that of McNemar's exact test for success, and for path and time
    that of the exact sign test, which leaves ties out.
    """
    return {name: _difference(mine, other, name) for name in ("success", "path_length", "time")}


def _difference(mine: Sequence[EpisodeRow], other: Sequence[EpisodeRow], field: str) -> dict[str, Any]:
    """One field of `paired`."""
    found = paired_difference(mine, other, field)
    theirs = {(row.scenario, row.seed): row for row in other}
    pairs = [(row, theirs[row.scenario, row.seed]) for row in mine if (row.scenario, row.seed) in theirs]
    gaps = [getattr(a, field) - getattr(b, field) for a, b in pairs if field == "success" or (a.success and b.success)]
    return {
        "n": found.n,
        "mean": finite(found.mean),
        "interval": [finite(found.low), finite(found.high)],
        "p_value": exact_mcnemar(sum(gap > 0 for gap in gaps), sum(gap < 0 for gap in gaps)) if gaps else None,
    }


def told(difference: Mapping[str, Any], scale: float = 1.0, digits: int = 2) -> list[str]:
    """Mean, interval and p of a difference of `paired` as the cells of a table; a share in percent has scale 100."""
    mean, p_value = difference["mean"], difference["p_value"]
    if mean is None:
        return ["-", "-", "-"]
    low, high = difference["interval"]
    interval = "-" if low is None else f"[{scale * low:+.{digits}f}, {scale * high:+.{digits}f}]"
    return [f"{scale * mean:+.{digits}f}", interval, f"{p_value:.2g}"]


def finite(value: float) -> float | None:
    """None for what JSON can't say."""
    return value if math.isfinite(value) else None
