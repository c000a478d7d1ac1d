"""A sweep: the same policies and worlds while one number of the scenario changes; a table and curves of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, NamedTuple

from bug_gym.evaluation import evaluate
from bug_gym.evaluation.summary import Summary, summarise
from bug_gym.reproductions.replayable import Replayable, replayable
from bug_gym.reproductions.result import Curves, Settings, Table

TURNED: dict[str, dict[str, Any]] = dict.fromkeys(("u_trap", "hook"), {"world.rotation": "random"})
"""Scenarios that draw nothing by themselves, and what has them draw."""


@dataclass(frozen=True)
class Sweep:
    """What changes, and where it is tried."""

    title: str
    label: str
    """What the number is, with its unit."""
    values: Sequence[float]
    overrides: Sequence[Mapping[str, Any]]
    """What each value means for the scenario."""
    scenarios: Sequence[str]
    """Scenarios that are pooled for each value, traps turned as each seed says: else all seeds would have one world."""


class Swept(NamedTuple):
    """What came of a sweep."""

    sweep: Sweep
    summaries: dict[str, list[Summary]]
    """Of each policy, one a value, over all scenarios together."""
    episodes: list[Replayable]


def run(sweep: Sweep, policies: Sequence[str], seeds: int, settings: Settings) -> Swept:
    """Drive all policies with each value."""
    found = Swept(sweep, {policy: [] for policy in policies}, [])
    for value, overrides in zip(sweep.values, sweep.overrides, strict=True):
        scenarios: list[dict[str, Any]] = [
            {"scenario": name, "overrides": {**TURNED.get(name, {}), **overrides}} for name in sweep.scenarios
        ]
        suite = {"name": f"sweep-{value:g}", "scenarios": scenarios, "seeds": {"count": seeds}}
        rows = evaluate(list(policies), suite, workers=settings.workers, progress=settings.progress)
        # One stratum a scenario; the last summaries are those over all of them.
        for summary in summarise(rows, resamples=200)[-len(policies) :]:
            found.summaries[summary.policy].append(summary)
        found.episodes.extend(replayable(rows, policies, scenarios, f"{{}}, {sweep.title}: {value:g}"))
    return found


def tables(found: Swept) -> list[Table]:
    """Success with its interval, contacts, and path over shortest path, against the value."""
    sweep = found.sweep
    header = ["policy", *(f"{value:g}" for value in sweep.values)]
    success = [
        [policy, *(f"{100 * s.success:.0f} [{100 * s.success_low:.0f}, {100 * s.success_high:.0f}]" for s in summaries)]
        for policy, summaries in found.summaries.items()
    ]
    contacts = [
        [policy, *(f"{100 * s.collision:.0f}" for s in summaries)] for policy, summaries in found.summaries.items()
    ]
    ratio = [
        [policy, *(f"{s.path_ratio:.2f}" if isfinite(s.path_ratio) else "-" for s in summaries)]
        for policy, summaries in found.summaries.items()
    ]
    return [
        Table(f"{sweep.title}: success [%] with its 95 % interval against {sweep.label}", header, success),
        Table(f"{sweep.title}: runs that end in a contact [%] against {sweep.label}", header, contacts),
        Table(f"{sweep.title}: path over shortest path of the successes against {sweep.label}", header, ratio),
    ]


def curves(found: Swept) -> Curves:
    """Success against the value, to draw."""
    lines = {
        policy: [(s.success, s.success_low, s.success_high) for s in summaries]
        for policy, summaries in found.summaries.items()
    }
    return Curves(found.sweep.title, found.sweep.label, "success", list(found.sweep.values), lines)


def numbers(found: Swept) -> dict[str, Any]:
    """The sweep as JSON can hold it."""
    sweep = found.sweep
    series = {
        policy: [
            {
                "n": s.n,
                "success": s.success,
                "success_interval": [s.success_low, s.success_high],
                "collision": s.collision,
                "path_ratio": s.path_ratio if isfinite(s.path_ratio) else None,
            }
            for s in summaries
        ]
        for policy, summaries in found.summaries.items()
    }
    return {"label": sweep.label, "values": list(sweep.values), "scenarios": list(sweep.scenarios), "policies": series}
