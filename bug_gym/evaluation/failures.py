"""What becomes of a policy that fails on its way: the others go on, and the evaluation ends with a word about it."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bug_gym.evaluation.entries import PolicyEntry, PolicyNote, ScenarioEntry
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.references import told_of


@dataclass(frozen=True)
class Failure:
    """A policy that has failed in a scenario; plain text, as an exception of a caller's may not come out of a worker."""

    policy: str
    """Its label."""
    scenario: str
    """Label of the scenario."""
    told: str
    """What came, from where, and in which worlds, in one line."""
    traceback: str = field(default="", compare=False, repr=False)
    """The way through the code to what came, as Python prints it: for who mends the policy."""
    finished: int = 0
    """Worlds that the policy had finished there; their rows do not count."""
    error: Exception | None = field(default=None, compare=False, repr=False)
    """The exception, where it was raised in this process."""

    @classmethod
    def of(cls, error: Exception, policy: PolicyEntry, scenario: ScenarioEntry) -> Failure:
        """What a policy has raised, or what its answer was refused with.

        Raises:
            Exception: the error itself, where it is not a policy's.
        """
        if not any(isinstance(note, PolicyNote) for note in getattr(error, "__notes__", ())):
            raise error
        way = "".join(traceback.format_exception(error))
        return cls(policy.label, scenario.label, told_of(error), way, error=error)

    def as_text(self) -> Failure:
        """The same as any process can read it."""
        return replace(self, error=None)

    def with_finished(self, rows: Sequence[EpisodeRow]) -> Failure:
        """The same with the number of worlds that the policy has rows of there."""
        mine = {row.seed for row in rows if (row.policy, row.scenario) == (self.policy, self.scenario)}
        return replace(self, finished=len(mine))

    @property
    def uncounted(self) -> str:
        """The worlds that it had finished, in words; "" where there are none."""
        worlds = "1 world" if self.finished == 1 else f"{self.finished} worlds"
        return f"not counted: {worlds} that it had finished" if self.finished else ""


class FailedPolicyError(ValueError):
    """Policies have failed on their way; all others have been driven to the end, and what is asked for is written.

    Args:
        failures: at least one, the first of each policy and scenario.
        rows: of the others.
        place: file with the tracebacks, where there is one.
    """

    def __init__(self, failures: Sequence[Failure], rows: Sequence[EpisodeRow], place: Path | None = None) -> None:
        first, *others = failures
        more = [f"{one.policy} in {one.scenario}{one.uncounted and f' ({one.uncounted})'}" for one in others]
        parts = [
            first.told,
            first.uncounted,
            more and f"failed, too: {', '.join(more)}",
            place and f"traceback: {place}",
        ]
        super().__init__("; ".join(str(part) for part in parts if part))
        self.failures = tuple(failures)
        """What has failed, by scenario and policy."""
        self.rows = list(rows)
        """All rows but those of a policy in a scenario where it failed."""
        self.place = place
        """File with the tracebacks, None where there is none."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled with what it is made of; exceptions of a caller's stay behind, they may not come out of a worker."""
        notes = {"__notes__": list(self.__notes__)} if hasattr(self, "__notes__") else None
        return type(self), (tuple(one.as_text() for one in self.failures), self.rows, self.place), notes
