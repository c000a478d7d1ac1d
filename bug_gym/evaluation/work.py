"""What a plan still lacks, cut into jobs: shortest paths of worlds, and episodes of policies."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.failures import Failure
from bug_gym.evaluation.lengths import Lengths, World, shortest_lengths
from bug_gym.evaluation.plan import Plan
from bug_gym.evaluation.progress import Track
from bug_gym.evaluation.results_folder import ResultFolder
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.references import is_reference
from bug_gym.workers import Workers, are_several, each
from bug_gym.worlds.own import OwnFamily

T = TypeVar("T")

TYPED_IN = "__main__:"
"""Where what is typed in, or run as a script, has its classes: a worker has another such module."""

CHUNK = 8
"""Seeds of a job: what a kill can cost a worker, and how finely workers share the work."""


class _Job(NamedTuple):
    """Some worlds to drive in with one policy."""

    policy: PolicyEntry
    scenario: ScenarioEntry
    seeds: tuple[int, ...]
    lengths: Lengths


def require_sendable(plan: Plan) -> None:
    """Refuse what cannot be sent to other processes, by its name: they would say that something cannot, and no more.

    Raises:
        ValueError: a policy or a scenario cannot be.
    """
    from joblib.externals.loky.backend.reduction import dumps

    expected = "cannot be sent to workers, expected a class or function of a module or file, or one worker"
    for scenario in plan.scenarios:
        world = scenario.scenario.world
        if isinstance(world, OwnFamily) and (not is_reference(world.reference) or world.reference.startswith(TYPED_IN)):
            raise ValueError(f"scenario {scenario.label}: the family {world.reference} {expected}")
    for kind, entries in (("policy", plan.policies), ("scenario", plan.scenarios)):
        for entry in entries:
            try:
                dumps(entry)
            except Exception as error:  # of a caller's code: any
                raise ValueError(f"{kind} {entry.label} {expected}: {error}") from error


def missing_worlds(plan: Plan, rows: Sequence[EpisodeRow]) -> list[tuple[PolicyEntry, ScenarioEntry, Sequence[int]]]:
    """Seeds without rows, by scenario and policy that fits it; a range where there are no rows at all."""
    done: dict[tuple[str, str], set[int]] = {}
    for row in rows:
        done.setdefault((row.policy, row.scenario), set()).add(row.seed)
    missing: list[tuple[PolicyEntry, ScenarioEntry, Sequence[int]]] = []
    for scenario, policy in plan.pairs():
        seeds = done.get((policy.label, scenario.label))
        rest = [seed for seed in scenario.seeds if seed not in seeds] if seeds else scenario.seeds
        missing.append((policy, scenario, rest))
    return missing


def known_lengths(
    missing: Sequence[tuple[PolicyEntry, ScenarioEntry, Sequence[int]]],
    folder: ResultFolder | None,
    workers: Workers,
    track: Track[Any],
) -> Lengths:
    """Shortest paths of all worlds to drive in, once a world; a moving target has none."""
    lengths = {} if folder is None else dict(folder.lengths)
    wanted = {
        (scenario.label, seed): (scenario, seed)
        for _, scenario, seeds in missing
        for seed in seeds
        if not scenario.has_moving_target and (scenario.label, seed) not in lengths
    }
    chunk = CHUNK if are_several(workers) else 1
    found = itertools.chain.from_iterable(each(_shortest_lengths, _parts(list(wanted.values()), chunk), workers))
    for world, robots in track(found, "shortest paths", len(wanted)):
        if folder is not None:
            folder.add_lengths(world, robots)
        lengths[world] = robots
    return lengths


def _parts(sequence: Sequence[T], size: int) -> list[Sequence[T]]:
    """A sequence cut into pieces of a size, the last one as long as is left."""
    return [sequence[first : first + size] for first in range(0, len(sequence), size)]


def _shortest_lengths(job: Sequence[tuple[ScenarioEntry, int]]) -> list[tuple[World, list[float]]]:
    return [((scenario.label, seed), shortest_lengths(scenario, seed)) for scenario, seed in job]


def drive_missing(
    missing: Sequence[tuple[PolicyEntry, ScenarioEntry, Sequence[int]]],
    lengths: Lengths,
    workers: Workers,
    track: Track[Any],
) -> Iterable[list[EpisodeRow] | Failure]:
    """The rows of each missing world; a policy that fails ends the job that it fails in, and no other one."""
    numbered = []
    for policy, scenario, seeds in missing:
        chunk = CHUNK if are_several(workers) else len(seeds)
        for number, some in enumerate(_parts(seeds, max(chunk, 1))):
            mine = {world: lengths[world] for seed in some if (world := (scenario.label, seed)) in lengths}
            numbered.append((number, _Job(policy, scenario, tuple(some), mine)))
    # The first seeds of all policies come first, so that what an interrupted run leaves can be compared.
    jobs = [job for _, job in sorted(numbered, key=lambda item: item[0])]
    worlds = itertools.chain.from_iterable(each(_drive if are_several(workers) else _drive_lazily, jobs, workers))
    return track(worlds, "episodes", sum(len(job.seeds) for job in jobs))


def _drive_lazily(job: _Job) -> Iterator[list[EpisodeRow] | Failure]:
    try:
        yield from Rollout(job.policy, job.scenario, job.seeds, lengths=job.lengths).worlds()
    except Exception as error:  # of a caller's code: any
        yield Failure.of(error, job.policy, job.scenario)


def _drive(job: _Job) -> list[list[EpisodeRow] | Failure]:
    return [done.as_text() if isinstance(done, Failure) else done for done in _drive_lazily(job)]
