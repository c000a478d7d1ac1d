"""What all robots of a world did together: its mission. A robot alone has its own.

Robots of a world are not independent of one another, so whatever is said with an interval counts missions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, nan

import numpy as np

from bug_gym.evaluation.rows import EpisodeRow


@dataclass(frozen=True, slots=True)
class Mission:
    """The rows of all robots of a world that one policy drove, in order of first appearance."""

    rows: tuple[EpisodeRow, ...]
    """One a robot."""

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return self.rows[0].scenario

    @property
    def ends_with_first(self) -> bool:
        """Whether the first arrival is the mission; else all robots have to arrive."""
        return self.rows[0].mission == "first"

    @property
    def winner(self) -> EpisodeRow | None:
        """The robot that arrived first, of equals the one with the smaller number; None where none did."""
        return min((row for row in self.rows if row.success), key=lambda row: (row.time, row.robot), default=None)

    @property
    def success(self) -> bool:
        """Whether the mission was accomplished: by the first that arrives, or by all."""
        return any(row.success for row in self.rows) if self.ends_with_first else all(row.success for row in self.rows)

    @property
    def spl(self) -> float:
        """SPL of the robot that arrived first, 0 where none did, or the mean of all; NaN where none is known."""
        known = [row.spl for row in self.rows if not isnan(row.spl)]
        if not known:
            return nan
        if self.ends_with_first:
            return self.winner.spl if self.winner else 0.0
        return float(np.mean(known))


def missions(rows: Sequence[EpisodeRow]) -> list[Mission]:
    """The missions of some rows, in order of first appearance."""
    worlds: dict[tuple[str, str, int], list[EpisodeRow]] = {}
    for row in rows:
        worlds.setdefault((row.policy, row.scenario, row.seed), []).append(row)
    return [Mission(tuple(robots)) for robots in worlds.values()]
