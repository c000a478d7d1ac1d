"""What the reproductions of HD-BUG share: seeds apart from those parameters were set on, and lines of results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.result import Settings

FIRST_SEED = 10_000
"""First seed of every figure; the parameters of HD-BUG and of the map planner were set on seeds below 1,000."""

ROBOT = {"kinematics": "holonomic", "radius": 0.2, "max_speed": 1.0}
"""The paper's point robot gets a body; its top speed is the paper's."""


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


def of(rows: Sequence[EpisodeRow], **fields: object) -> list[EpisodeRow]:
    """The rows whose fields have these values."""
    return [row for row in rows if all(getattr(row, name) == value for name, value in fields.items())]


def mean(values: Sequence[float]) -> float:
    """Arithmetic mean; NaN of nothing."""
    return math.fsum(values) / len(values) if values else math.nan


def path_ratio(row: EpisodeRow) -> float:
    """Path over shortest path. The shortest path leads to the goal's centre, so what is left to it is added."""
    return (row.path_length + row.goal_distance) / row.shortest_path_length


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
        "missed_seeds": [[row.scenario, row.seed] for row in rows if not row.success],
        "time": finite(mean([row.time for row in reached])),
        "path_length": finite(mean([row.path_length for row in reached])),
        "path_ratio": finite(mean([path_ratio(row) for row in reached])),
        "turns": finite(mean([float(row.turns) for row in reached])),
        "time_ratio": finite(mean([row.time_ratio for row in reached])),
        "decision_time_mean": mean([row.decision_time_mean for row in rows]),
        "decision_time_p99": mean([row.decision_time_p99 for row in rows]),
        "decision_time_total": mean([row.decision_time_total for row in rows]),
    }


def finite(value: float) -> float | None:
    """None for what JSON can't say."""
    return value if math.isfinite(value) else None
