"""What an evaluation says of robots that share a world: one row an episode, and differences between teams.

The winner is the robot that arrived first. Ways of all robots together stand for energy (Oni and Wang, section 4.2).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bug_gym.evaluation.missions import Mission, missions
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.text_table import NOTHING, TextTable
from bug_gym.intervals import means, stratified_bootstrap, wilson_interval

DEADLOCK = 10.0
"""Robots that have not moved for so long when the time was up had stopped for good [s]."""


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
    mission: str
    """Whose arrival the mission asks for: of "all" robots, or of the "first"."""
    success: bool
    """Whether the mission was accomplished."""
    winner: int
    """Number of the robot that arrived first, -1 where none did."""
    time: float
    """When it arrived [s]; NaN where none did."""
    length: float
    """Length of its way [m]; likewise."""
    last_time: float
    """When all had arrived [s]; NaN where not all did."""
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
    """Whether robots were still under way when the time was up, and none of these had moved for a while."""


def team_rows(rows: Sequence[EpisodeRow]) -> list[TeamRow]:
    """The rows of worlds with several robots, one an episode, in order of first appearance."""
    return [_team_row(mission) for mission in missions(rows) if len(mission.rows) > 1]


def _team_row(mission: Mission) -> TeamRow:
    robots, winner = mission.rows, mission.winner
    arrived = [row for row in robots if row.success]
    late = [row for row in robots if row.outcome == "timeout"]
    return TeamRow(
        policy=robots[0].policy,
        scenario=mission.scenario,
        seed=robots[0].seed,
        robots=len(robots),
        mission=robots[0].mission,
        success=mission.success,
        winner=-1 if winner is None else winner.robot,
        time=math.nan if winner is None else winner.time,
        length=math.nan if winner is None else winner.path_length,
        last_time=max(row.time for row in robots) if len(arrived) == len(robots) else math.nan,
        total_length=math.fsum(row.path_length for row in robots),
        arrived=len(arrived),
        collided=sum(row.outcome == "collision" for row in robots),
        holds=sum(row.holds for row in robots),
        held_time=math.fsum(row.held_time for row in robots),
        robots_gap=min(row.robots_gap for row in robots),
        deadlock=bool(late) and all(row.standing_time >= DEADLOCK for row in late),
    )


MISSIONS = {"first": "the first that arrives ends the mission", "all": "all are to arrive"}
"""What the missions of `EpisodeRow.mission` are, for the title of a table."""

COLUMNS: dict[str, Callable[[Sequence[TeamRow]], str]] = {
    "policy": lambda rows: rows[0].policy,
    "missions [%]": lambda rows: _share([row.success for row in rows]),
    "robots [%]": lambda rows: _of_all(rows, f"{100 * np.mean([row.arrived / row.robots for row in rows]):.0f}"),
    "first [s]": lambda rows: _mean([row.time for row in rows]),
    "last [s]": lambda rows: _of_all(rows, _mean([row.last_time for row in rows])),
    "winner [m]": lambda rows: _mean([row.length for row in rows]),
    "together [m]": lambda rows: _mean([row.total_length for row in rows if row.success]),
    "wins": lambda rows: _wins(rows),
    "holds": lambda rows: _mean([row.holds for row in rows]),
    "held [s]": lambda rows: _mean([row.held_time for row in rows]),
    "least gap [m]": lambda rows: f"{min(row.robots_gap for row in rows):.2f}",
    "collisions": lambda rows: str(sum(row.collided > 0 for row in rows)),
    "deadlocks": lambda rows: str(sum(row.deadlock for row in rows)),
}
"""Columns of the table of teams: means over worlds, of times and ways over those in which a robot, or all, arrived."""


def team_tables(rows: Sequence[EpisodeRow]) -> list[TextTable]:
    """A table a scenario with several robots: a line a policy; no column in which nothing was measured."""
    groups: dict[str, dict[str, list[TeamRow]]] = {}
    for row in team_rows(rows):
        groups.setdefault(row.scenario, {}).setdefault(row.policy, []).append(row)
    tables = []
    for scenario, policies in groups.items():
        one = next(iter(policies.values()))[0]
        filled = [[name, *(cell(mine) for mine in policies.values())] for name, cell in COLUMNS.items()]
        title = f"{scenario}: {one.robots} robots, {MISSIONS[one.mission]}"
        tables.append(TextTable.of_columns(title, filled))
    return tables


COMPARED = {
    "missions [%]": "success",
    "first [s]": "time",
    "last [s]": "last_time",
    "winner [m]": "length",
    "together [m]": "total_length",
    "holds": "holds",
    "held [s]": "held_time",
    "gap [m]": "robots_gap",
}
"""Columns of the table of differences, and the fields that they compare: those of EVERYWHERE in all worlds."""
EVERYWHERE = ("success", "holds", "held_time", "robots_gap")
"""Fields that say something of every mission; the others do where both were accomplished."""


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
    columns = list(zip(["policy", "worlds", *COMPARED], *lines, strict=True))
    return [TextTable.of_columns(f"teams' difference to {baseline} in the same worlds", columns)]


def _difference(pairs: Sequence[tuple[TeamRow, TeamRow]], field: str, *, resamples: int, seed: int) -> str:
    """Mean of a field of the first minus that of the second, with its interval."""
    strata: dict[str, list[float]] = {}
    for one, other in pairs:
        gap = float(getattr(one, field)) - float(getattr(other, field))
        if math.isfinite(gap) and (field in EVERYWHERE or (one.success and other.success)):
            strata.setdefault(one.scenario, []).append(100.0 * gap if field == "success" else gap)
    if not strata:
        return NOTHING
    interval = stratified_bootstrap(list(strata.values()), means, resamples=resamples, seed=seed)
    mean = float(np.mean([value for values in strata.values() for value in values]))
    digits = 0 if field == "success" else 2
    told, low, high = (f"{value:+.{digits}f}" for value in (mean, interval.low, interval.high))
    return told if math.isnan(interval.low) else f"{told} [{low}, {high}]"


def _share(values: Sequence[bool]) -> str:
    interval = wilson_interval(sum(values), len(values))
    share, low, high = (100.0 * value for value in (sum(values) / len(values), interval.low, interval.high))
    return f"{share:.0f} [{low:.0f}, {high:.0f}]"


def _mean(values: Sequence[float]) -> str:
    known = [value for value in values if math.isfinite(value)]
    return f"{np.mean(known):.2f}" if known else NOTHING


def _of_all(rows: Sequence[TeamRow], told: str) -> str:
    """What says something of missions that ask for all robots only."""
    return NOTHING if rows[0].mission == "first" else told


def _wins(rows: Sequence[TeamRow]) -> str:
    """How often each robot arrived first, where that is the mission."""
    if rows[0].mission == "all":
        return NOTHING
    return " : ".join(str(sum(row.winner == robot for row in rows)) for robot in range(rows[0].robots))
