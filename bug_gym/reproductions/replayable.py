"""The episodes behind a reproduction's numbers, so that its page can play some of them: failures, or typical ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.page.recorded import Key
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.replays import Wanted, chosen, replays_of
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import PRIVILEGED
from bug_gym.workers import Workers

MOST = 12
"""Episodes that a page plays."""
TYPICAL = 4
"""Those of a page on which nothing failed."""


class Replayable(NamedTuple):
    """An episode, how it ended, and what it is driven with once more."""

    policy: str
    """What the page calls the policy."""
    scenario: str
    """What the page calls the scenario."""
    seed: int
    """Seed of the world, or what the page calls it by."""
    success: bool
    """Whether the tables count it as it should be: there may be no way, and a policy that says so is right."""
    outcome: str
    """How it ended."""
    verdict: str
    """What is said of that, "" where nothing."""
    driver: Any
    """The policy: whatever `evaluate` takes as one."""
    world: Any
    """The scenario: whatever `load` takes, or a function without arguments that gives it, where there are many."""
    overrides: Mapping[str, Any] = {}
    """Values by dotted key that replace those of the scenario."""
    driven_seed: int | None = None
    """Seed of the world, where the page calls it by another number."""
    steps: int = 0
    """How many it has; 0 where nobody knows."""

    @property
    def key(self) -> Key:
        """What the page calls it."""
        return self.policy, self.scenario, self.seed

    def wanted(self) -> Wanted:
        """What is needed to record it."""
        scenario = load(self.world() if callable(self.world) else self.world, dict(self.overrides))
        seed = self.seed if self.driven_seed is None else self.driven_seed
        world = ScenarioEntry(self.scenario, scenario, range(seed, seed + 1))
        return Wanted(self.key, replace(PolicyEntry.of(self.driver), label=self.policy), world, seed, self.steps)


def replayable(
    rows: Sequence[EpisodeRow],
    policies: Sequence[Any],
    scenarios: Sequence[Mapping[str, Any]],
    told: str = "{}",
    *,
    is_right: Callable[[EpisodeRow], bool] = lambda row: row.success,
) -> list[Replayable]:
    """The episodes of an evaluation.

    Args:
        rows: what `evaluate` gave.
        policies: what it was asked for.
        scenarios: likewise, as a suite has them.
        told: what the page calls a scenario; {} stands for its label.
        is_right: whether an episode ended as it should.
    """
    drivers = {entry.label: entry for entry in map(PolicyEntry.of, policies)}
    worlds = {one.get("label") or load(one["scenario"]).name: one for one in scenarios}
    return [
        Replayable(
            row.policy,
            told.format(row.scenario),
            row.seed,
            is_right(row),
            row.outcome,
            row.verdict,
            drivers[row.policy.removesuffix(PRIVILEGED)],
            worlds[row.scenario]["scenario"],
            worlds[row.scenario].get("overrides", {}),
            steps=row.steps,
        )
        for row in rows
    ]


def played(episodes: Sequence[Replayable]) -> list[Replayable]:
    """The episodes that a page plays: failures of each kind with who did well in that world; without any, typical ones."""
    return chosen(episodes, MOST) or typical(episodes)


def typical(episodes: Sequence[Replayable]) -> list[Replayable]:
    """Some episodes of the first policies in the first scenarios, in each in the same world: where one took the median time."""
    found: list[Replayable] = []
    scenarios = list(dict.fromkeys(one.scenario for one in episodes))
    drivers = list(dict.fromkeys(one.policy for one in episodes))[: max(TYPICAL // max(len(scenarios), 1), 2)]
    for scenario in scenarios[:TYPICAL]:
        mine = {(one.policy, one.seed): one for one in episodes if one.scenario == scenario and one.policy in drivers}
        first = [one for one in mine.values() if one.policy == next(iter(mine.values())).policy]
        middle = sorted(first, key=lambda one: one.steps)[(len(first) - 1) // 2 :][:1]
        found += [mine[driver, one.seed] for one in middle for driver in drivers if (driver, one.seed) in mine]
    return found[:TYPICAL]


def replays(episodes: Sequence[Replayable], workers: Workers) -> dict[Key, str]:
    """Some episodes, driven once more and packed."""
    with progress_bar(shown=True) as track:
        return replays_of([one.wanted() for one in episodes], workers, track)
