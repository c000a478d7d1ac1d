"""A curriculum: the worlds of a training, in stages, each of which ends when enough of its validation worlds are solved.

Stages follow one another as in Narvekar et al. 2020, "Curriculum learning for reinforcement learning domains" (the sequence
of tasks is given, a task ends at a threshold of success); a share of the worlds stays of the stages before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

from pydantic import model_validator

from bug_gym.config import Scenario
from bug_gym.schema.errors import wrong
from bug_gym.schema.values import Part, Share


class Stage(Part):
    """Some worlds to learn in, before the next stage's."""

    scenarios: tuple[str | dict[str, Any], ...] = ()
    """Scenarios of the stage; none: those of the training."""
    overrides: dict[str, Any] = {}
    """Values by dotted key that replace those of every scenario, after the training's own overrides."""
    success: Share | None = None
    """Share of successes in the stage's validation worlds from which on the next stage begins; the last stage has none."""
    share: Share = 1.0
    """Share of all worlds that are of this stage while it lasts; the others are of the stages before it, evenly."""

    @model_validator(mode="after")
    def _has_worlds(self) -> Self:
        if self.share <= 0.0:
            raise wrong(f"got {self.share}, expected more than 0: a stage has worlds of its own", "share")
        return self


Curriculum = tuple[Stage, ...]
"""The stages in their order; empty: there are none, the worlds stay the same."""


def require_stages(stages: Curriculum) -> None:
    """Raise a fault where stages cannot follow one another."""
    for number, stage in enumerate(stages):
        is_last = number == len(stages) - 1
        if is_last != (stage.success is None):
            expected = "none, for it is the last stage" if is_last else "a share at which the next stage begins"
            raise wrong(f"got {stage.success}, expected {expected}", f"curriculum.{number}.success")
    if stages and stages[0].share != 1.0:
        raise wrong(f"got {stages[0].share}, expected 1: no stage comes before it", "curriculum.0.share")


Rows = list[tuple[Scenario, int]]
"""Scenarios, and how many rows are of each."""


def shared_evenly(scenarios: Sequence[Scenario], rows: int) -> Rows:
    """Each scenario with its share of some rows."""
    return [(scenario, rows // len(scenarios) + (n < rows % len(scenarios))) for n, scenario in enumerate(scenarios)]


def rows_of_stage(stages: Curriculum, scenarios: Sequence[Sequence[Scenario]], number: int, rows: int) -> Rows:
    """How many of some rows each scenario has in a stage: its own first, then those of the stages before it.

    Args:
        stages: of the curriculum.
        scenarios: those of each stage.
        number: of the stage.
        rows: how many there are.
    """
    own = rows if number == 0 else max(round(stages[number].share * rows), 1)
    shared = shared_evenly(scenarios[number], own)
    earlier = [scenario for before in scenarios[:number] for scenario in before]
    if rest := rows - own:
        shared += [(scenario, some) for scenario, some in shared_evenly(earlier, rest) if some]
    return shared
