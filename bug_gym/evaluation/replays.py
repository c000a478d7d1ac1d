"""Episodes driven once more and recorded, to be looked at: one by name, or those that a report leads to."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, zip_longest
from typing import Any, NamedTuple, TypeVar

from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.failures import Failure
from bug_gym.evaluation.page.recorded import Ended, Key, has_failed
from bug_gym.evaluation.plan import Plan
from bug_gym.evaluation.progress import Track
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.replay import Episode, Recorder
from bug_gym.workers import Workers, each

logger = logging.getLogger("bug_gym")

REPLAYS = 24
"""Episodes that a report holds unless it is asked for others."""
MOST_LETTERS = 15_000_000
"""What the episodes of a report may take together [bytes]; its rows have the rest of 20 MB."""
MOST_FRAMES = 1_000
"""Frames of an episode in a report; of a longer one, only each second step is kept, or each third."""


def record_episode(
    policy: Any,
    scenario: Any,
    *,
    seed: int = 0,
    every: int = 1,
    overrides: Mapping[str, Any] | None = None,
    trust: bool = False,
) -> Episode:
    """An episode of a policy, for `bug_gym.show`.

    Args:
        policy: a name with or without options (`bug2:turn=right`), or whatever else `evaluate` takes as one policy.
        scenario: a name, path, dict or Scenario.
        seed: of the world.
        every: steps from one frame to the next.
        overrides: values by dotted key that replace those of the scenario.
        trust: whether code that the scenario names may be imported and run.

    Raises:
        ValueError: an unknown name, a policy that does not fit, or `every` below 1.
    """
    entry, loaded = PolicyEntry.of(policy), load(scenario, dict(overrides or {}), trust=trust)
    return recorded(Rollout(entry, ScenarioEntry(loaded.name, loaded, range(seed, seed + 1)), [seed]), every=every)


def recorded(rollout: Rollout, *, every: int = 1) -> Episode:
    """Drive the rollout's first world to its end; a frame of the start, of every so many steps, and of the end.

    Raises:
        ValueError: `every` below 1.
    """
    if every < 1:
        raise ValueError(f"every must be at least 1, got {every}")
    recorder = Recorder(rollout.simulation, title=rollout.entry.label, every=every)
    recorder.record(rollout.drawings(), note=rollout.state())
    while not rollout.is_over:
        for _ in range(every):
            rollout.advance()
            if rollout.is_over:
                break
        recorder.record(rollout.drawings(), note=rollout.state())
    return recorder.episode()


# ---------------------------------------------------------------------------------------------------------------------
# Those of a report
# ---------------------------------------------------------------------------------------------------------------------


AnyEnded = TypeVar("AnyEnded", bound=Ended)


class Wanted(NamedTuple):
    """An episode to record."""

    key: Key
    """What the page calls it."""
    policy: PolicyEntry
    scenario: ScenarioEntry
    seed: int
    steps: int
    """How many it has; 0 where nobody knows, which takes a drive to find out."""


def wanted(plan: Plan, rows: Sequence[EpisodeRow]) -> list[Wanted]:
    """Some episodes of an evaluation, to be recorded.

    Args:
        plan: what was evaluated.
        rows: a row of each episode.
    """
    pairs = {(policy.label, scenario.label): (policy, scenario) for scenario, policy in plan.pairs()}
    return [
        Wanted((row.policy, row.scenario, row.seed), *pairs[row.policy, row.scenario], row.seed, row.steps)
        for row in rows
    ]


def replays_of(episodes: Sequence[Wanted], workers: Workers, track: Track[Any]) -> dict[Key, str]:
    """Some episodes, driven once more and packed, as far as there is room for them.

    Args:
        episodes: what to record.
        workers: who shares the work.
        track: shows how far it is.
    """
    found: dict[Key, str] = {}
    room = MOST_LETTERS
    packed = track(each(_record, episodes, workers, in_order=True), "replays", len(episodes))
    for one, letters in zip(episodes, packed, strict=True):
        if isinstance(letters, Failure):
            logger.warning("no replay: %s", letters.told)
        elif len(letters) <= room:
            room -= len(letters)
            found[one.key] = letters
    return found


def _record(one: Wanted) -> str | Failure:
    """An episode, packed; or why there is none, as a policy's `draw` may fail where all else of it is well."""
    try:
        steps = one.steps or _steps_of(Rollout(one.policy, one.scenario, [one.seed]))
        every = max(1, math.ceil(steps / MOST_FRAMES))
        return recorded(Rollout(one.policy, one.scenario, [one.seed]), every=every).packed
    except Exception as error:  # of a caller's code: any
        return Failure.of(error, one.policy, one.scenario).as_text()


def _steps_of(rollout: Rollout) -> int:
    ((row, *_),) = rollout.worlds()
    return row.steps


def chosen(rows: Sequence[AnyEnded], count: int, *, successes: bool = False) -> list[AnyEnded]:
    """The episodes to record: of each policy and scenario the first failure of each kind, one a world.

    Scenarios take turns, in each of them the policies that fail least: what they still cannot do is worth a look. After each
    failure comes the best policy that arrived in that world, to be played beside it.

    Args:
        rows: of all policies.
        count: most episodes.
        successes: whether the first success of each policy and scenario counts as a kind, too.
    """
    failed = Counter(row.policy for row in rows if has_failed(row))
    ordered = sorted(rows, key=lambda row: failed[row.policy])
    first: dict[tuple[str, str, str, str], AnyEnded] = {}
    arrived: dict[tuple[str, int], AnyEnded] = {}
    for row in ordered:
        if row.success:
            arrived.setdefault((row.scenario, row.seed), row)
        if has_failed(row) or (row.success and successes):
            first.setdefault((row.scenario, row.policy, row.outcome, row.verdict), row)
    worlds: dict[Key, AnyEnded] = {}
    for row in _in_turns(list(first.values())):
        for one in (row, arrived.get((row.scenario, row.seed), row)):
            worlds.setdefault((one.policy, one.scenario, one.seed), one)
    return list(worlds.values())[:count]


def _in_turns(rows: Sequence[AnyEnded]) -> Iterator[AnyEnded]:
    """The first row of each scenario, then the second of each, and so on."""
    by_scenario: dict[str, list[AnyEnded]] = {}
    for row in rows:
        by_scenario.setdefault(row.scenario, []).append(row)
    return (row for row in chain.from_iterable(zip_longest(*by_scenario.values())) if row is not None)
