"""What every reproduction takes and gives."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bug_gym
from bug_gym.checks import checked_count
from bug_gym.limits import MOST_SEEDS
from bug_gym.workers import Workers

if TYPE_CHECKING:
    from bug_gym.evaluation.rows import EpisodeRow
    from bug_gym.reproductions.replayable import Replayable


@dataclass(frozen=True)
class Settings:
    """How much of a reproduction to run, and with what."""

    seeds: int | None = None
    """Seeds of each claim; None: all of them."""
    workers: Workers = 1
    """Processes that share the work, or a cluster."""
    data: Path | None = None
    """File or folder of somebody else's data that some reproductions need, or file in which a long one keeps what it finds."""
    progress: bool = False
    """Whether to show a progress bar."""
    policies: tuple[str, ...] = ()
    """Policies to run where a reproduction leaves the choice; empty: its own."""

    def __post_init__(self) -> None:
        """Refuse seeds that are no number of them.

        Raises:
            ValueError: no integer from 1 to MOST_SEEDS.
        """
        if self.seeds is not None:
            checked_count("seeds", self.seeds, most=MOST_SEEDS)


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Curves:
    """Lines to draw, each point with its interval."""

    title: str
    x_label: str
    y_label: str
    x: Sequence[float]
    lines: Mapping[str, Sequence[tuple[float, float, float]]]
    """Value, low and high at each x, by name."""
    y_range: tuple[float, float] = (-0.02, 1.02)
    """Where the y axis begins and ends."""


@dataclass(frozen=True)
class Reproduction:
    """What a reproduction found."""

    name: str
    tables: Sequence[Table]
    """What is printed."""
    notes: Sequence[str] = ()
    """Footnotes."""
    data: dict[str, Any] = field(default_factory=dict)
    """All numbers, as JSON can hold them."""
    holds: bool | None = None
    """Whether every claim that was checked holds; None: it claims nothing."""
    curves: Sequence[Curves] = ()
    """What is drawn beside the JSON."""
    rows: Sequence[EpisodeRow] = ()
    """The rows behind it, where one set of policies drove in one set of scenarios; the page compares the policies."""
    episodes: Sequence[Replayable] = ()
    """The episodes that its tables count, some of which the page plays; empty where they count something else."""

    def as_json(self, commit: str) -> str:
        """The numbers with what they were made by, as JSON text."""
        record = {
            "name": self.name,
            "holds": self.holds,
            "bug_gym": bug_gym.__version__,
            "commit": commit,
            "python": platform.python_version(),
            **self.data,
        }
        return json.dumps(record, indent=1, allow_nan=False) + "\n"
