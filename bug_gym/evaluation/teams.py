"""What an evaluation says of robots that share a world: one row an episode, and differences between teams.

The winner is the robot that arrived first. Ways of all robots together stand for energy (Oni and Wang, section 4.2).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.intervals import means, stratified_bootstrap, wilson_interval

DEADLOCK = 10.0
"""Robots of which none has moved for so long when the time was up had stopped one another [s]."""

NOTHING = "–"
"""Stands where nothing was measured."""


@dataclass(frozen=True)
class TeamRow:
    """One episode of all robots of a world."""

    policy: str
    """Name of the policy."""
    scenario: str
    """Name of the scenario."""
    seed: int
    """Seed of the world."""
    robots: int
    """How many robots there are."""
    winner: int
    """Number of the robot that arrived first, -1 where none did."""
    time: float
    """When it arrived [s]; NaN where none did."""
    length: float
    """Length of its way [m]; likewise."""
    total_length: float
    """Length of the ways of all robots together [m]."""
    arrived: int
    """How many robots arrived."""
    collided: int
    """How many robots touched something."""
    holds: int
    """How often robots stopped for one another."""
    held_time: float
    """How long they stood so, all together [s]."""
    robots_gap: float
    """Smallest distance between two robots, centre to centre [m]."""
    deadlock: bool
    """Whether none arrived, and none had moved for a while when the time was up."""

    @property
    def success(self) -> bool:
        """Whether a robot arrived."""
        return self.winner >= 0


def team_rows(rows: Sequence[EpisodeRow]) -> list[TeamRow]:
    """The rows of worlds with several robots, one an episode, in order of first appearance."""
    worlds: dict[tuple[str, str, int], list[EpisodeRow]] = {}
    for row in rows:
        worlds.setdefault((row.policy, row.scenario, row.seed), []).append(row)
    return [_team_row(key, robots) for key, robots in worlds.items() if len(robots) > 1]


def _team_row(key: tuple[str, str, int], robots: Sequence[EpisodeRow]) -> TeamRow:
    arrived = [row for row in robots if row.success]
    winner = min(arrived, key=lambda row: (row.time, row.robot), default=None)
    is_over = any(row.outcome == "timeout" for row in robots)
    return TeamRow(
        policy=key[0],
        scenario=key[1],
        seed=key[2],
        robots=len(robots),
        winner=-1 if winner is None else winner.robot,
        time=math.nan if winner is None else winner.time,
        length=math.nan if winner is None else winner.path_length,
        total_length=math.fsum(row.path_length for row in robots),
        arrived=len(arrived),
        collided=sum(row.outcome == "collision" for row in robots),
        holds=sum(row.holds for row in robots),
        held_time=math.fsum(row.held_time for row in robots),
        robots_gap=min(row.robots_gap for row in robots),
        deadlock=winner is None and is_over and all(row.standing_time >= DEADLOCK for row in robots),
    )


class TextTable(NamedTuple):
    """A table for people."""

    title: str
    header: list[str]
    lines: list[list[str]]


COLUMNS: dict[str, Callable[[Sequence[TeamRow]], str]] = {
    "policy": lambda rows: rows[0].policy,
    "arrives [%]": lambda rows: _share([row.success for row in rows]),
    "time [s]": lambda rows: _mean([row.time for row in rows]),
    "winner [m]": lambda rows: _mean([row.length for row in rows]),
    "all [m]": lambda rows: _mean([row.total_length for row in rows if row.success]),
    "wins": lambda rows: _wins(rows),
    "holds": lambda rows: _mean([row.holds for row in rows]),
    "held [s]": lambda rows: _mean([row.held_time for row in rows]),
    "least gap [m]": lambda rows: f"{min(row.robots_gap for row in rows):.2f}",
    "collisions": lambda rows: str(sum(row.collided > 0 for row in rows)),
    "deadlocks": lambda rows: str(sum(row.deadlock for row in rows)),
}
"""Columns of the table of teams: means over episodes, of times and ways over those in which a robot arrived."""


def team_tables(rows: Sequence[EpisodeRow]) -> list[TextTable]:
    """A table a scenario with several robots: a line a policy."""
    groups: dict[str, dict[str, list[TeamRow]]] = {}
    for row in team_rows(rows):
        groups.setdefault(row.scenario, {}).setdefault(row.policy, []).append(row)
    return [
        TextTable(
            f"{scenario}: the first of {next(iter(policies.values()))[0].robots} robots",
            list(COLUMNS),
            [[cell(mine) for cell in COLUMNS.values()] for mine in policies.values()],
        )
        for scenario, policies in groups.items()
    ]


COMPARED = {"arrives": "success", "time [s]": "time", "winner [m]": "length", "all [m]": "total_length"}
"""Columns of the table of differences, and the fields that they compare; all but the first where both arrived."""


def team_differences(
    rows: Sequence[EpisodeRow], baseline: str, *, resamples: int = 2000, seed: int = 0
) -> list[TextTable]:
    """Paired differences of teams to the baseline in the same worlds, with 95 % intervals (bootstrap of the pairs)."""
    by_policy: dict[str, dict[tuple[str, int], TeamRow]] = {}
    for row in team_rows(rows):
        by_policy.setdefault(row.policy, {})[row.scenario, row.seed] = row
    reference = by_policy.pop(baseline, {})
    lines = []
    for policy, mine in by_policy.items():
        pairs = [(row, reference[world]) for world, row in mine.items() if world in reference]
        if pairs:
            cells = [_difference(pairs, field, resamples=resamples, seed=seed) for field in COMPARED.values()]
            lines.append([policy, str(len(pairs)), *cells])
    if not lines:
        return []
    return [TextTable(f"difference to {baseline} in the same worlds", ["policy", "worlds", *COMPARED], lines)]


def _difference(pairs: Sequence[tuple[TeamRow, TeamRow]], field: str, *, resamples: int, seed: int) -> str:
    """Mean of a field of the first minus that of the second, with its interval."""
    strata: dict[str, list[float]] = {}
    for one, other in pairs:
        if field == "success" or (one.success and other.success):
            strata.setdefault(one.scenario, []).append(float(getattr(one, field)) - float(getattr(other, field)))
    if not strata:
        return NOTHING
    interval = stratified_bootstrap(list(strata.values()), means, resamples=resamples, seed=seed)
    mean = float(np.mean([value for values in strata.values() for value in values]))
    if math.isnan(interval.low):
        return f"{mean:+.2f}"
    return f"{mean:+.2f} [{interval.low:+.2f}, {interval.high:+.2f}]"


def _share(values: Sequence[bool]) -> str:
    interval = wilson_interval(sum(values), len(values))
    share, low, high = (100.0 * value for value in (sum(values) / len(values), interval.low, interval.high))
    return f"{share:.0f} [{low:.0f}, {high:.0f}]"


def _mean(values: Sequence[float]) -> str:
    known = [value for value in values if math.isfinite(value)]
    return f"{np.mean(known):.2f}" if known else NOTHING


def _wins(rows: Sequence[TeamRow]) -> str:
    """How often each robot arrived first."""
    return " : ".join(str(sum(row.winner == robot for row in rows)) for robot in range(rows[0].robots))
