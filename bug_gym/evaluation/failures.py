"""What becomes of a policy that fails on its way: the others go on, and the evaluation ends with a word about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
        return cls(policy.label, scenario.label, told_of(error), error)

    def as_text(self) -> Failure:
        """The same as any process can read it."""
        return replace(self, error=None)


class FailedPolicyError(ValueError):
    """Policies have failed on their way; all others have been driven to the end, and what is asked for is written.

    Args:
        failures: at least one, the first of each policy and scenario.
        rows: of the others.
    """

    def __init__(self, failures: Sequence[Failure], rows: Sequence[EpisodeRow]) -> None:
        first, *others = failures
        more = ", ".join(f"{one.policy} in {one.scenario}" for one in others)
        super().__init__(f"{first.told}{f'; failed, too: {more}' if more else ''}")
        self.failures = tuple(failures)
        """What has failed, by scenario and policy."""
        self.rows = list(rows)
        """All rows but those of a policy in a scenario where it failed."""
