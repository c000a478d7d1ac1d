"""`collect`: datasets of demonstrations of several policies in the same worlds, for Minari.

FOLDER/bug_gym/SCENARIO/POLICY-v0 are the datasets; with MINARI_DATASETS_PATH=FOLDER Minari finds them by name. Until all of
them are there, FOLDER/.collect/SCENARIO keeps the blocks of episodes that are done, a file each: a run that was cut off goes
on with the others, and what it writes is the same, byte for byte.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import logging
import math
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import bug_gym
from bug_gym.checks import checked_count, shortened
from bug_gym.config import Scenario, ScenarioError, dump, load
from bug_gym.evaluation.demonstrations import Demonstrations, Extras, demonstrate
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.minari_files import (
    FORMS,
    About,
    dataset_id,
    has_said,
    in_name,
    open_dataset,
    read_identity,
    require_minari,
    write_dataset,
    write_namespaces,
)
from bug_gym.evaluation.plan import SOURCE, Plan, make_plan
from bug_gym.evaluation.progress import Track, progress_bar
from bug_gym.evaluation.reference_returns import EXPERT, FLOOR, known_returns
from bug_gym.evaluation.results_folder import kept_manifest, other_run
from bug_gym.evaluation.work import require_sendable
from bug_gym.files import one_writer, out_path, released
from bug_gym.limits import MOST_WORKERS
from bug_gym.references import source_digest
from bug_gym.scenario_code import data_digest, own_code
from bug_gym.workers import are_several, each, starred

logger = logging.getLogger("bug_gym")

SCORED = 100
"""Worlds that the reference scores are taken of, the first ones."""
BLOCK = 25
"""Worlds that a scripted policy drives in one after the other: what a worker takes at a time, and what a kill can cost."""
WIDE_BLOCK, WIDE_SLOTS = 300, 100
"""Worlds in a block of policies that answer for many robots in one call, which pays, and how many of them are driven in side
by side. Other numbers would change the last bits of what learned policies do."""
MIXED = "mixed"
"""Name of the dataset with the episodes of all policies."""
KEPT = ".collect"
"""Folder of the blocks that are done."""
NEEDED = ".needed"
"""How the names of files end that say in a folder of blocks which runs need them."""


class Signature(NamedTuple):
    """Who is said to have collected a dataset."""

    author: str | None = None
    """None: the authors of this package."""
    author_email: str | None = None
    """Where to write to."""
    code_permalink: str | None = None
    """Address of the code, of this very version."""


class _Source(NamedTuple):
    """A policy in some worlds."""

    entry: PolicyEntry
    scenario: ScenarioEntry
    extras: Extras
    folder: Path
    """Of its blocks."""

    @property
    def name(self) -> str:
        """As it stands in the names of datasets and files."""
        return in_name(self.entry.label.removesuffix(" (privileged)"))

    @property
    def block(self) -> int:
        """How many worlds a block has."""
        return BLOCK if self.entry.is_scripted else WIDE_BLOCK

    def blocks(self) -> list[tuple[Path, range]]:
        """File and seeds of each block."""
        seeds = self.scenario.seeds
        parts = [seeds[first : first + self.block] for first in range(0, len(seeds), self.block)]
        return [(self.folder / f"{part[0]}-{part[-1]}.npz", part) for part in parts]

    def first(self) -> _Source:
        """The same with the first blocks only, in which a score's worlds are: a block is driven whole or not at all."""
        blocks = math.ceil(SCORED / self.block)
        return self._replace(scenario=replace(self.scenario, seeds=self.scenario.seeds[: blocks * self.block]))

    def identity(self) -> dict[str, Any]:
        """What the episodes are a function of."""
        seeds = self.scenario.seeds
        told = {
            "version": released(bug_gym.__version__),
            SOURCE: source_digest()[:16],
            "scenario": self.scenario.label,
            "digest": self.scenario.scenario.digest,
            **_digests(self.scenario.scenario, self.entry),
            "policy": self.entry.name,
            "parameters": dict(self.entry.parameters),
            "first_seed": seeds.start,
            "episodes": len(seeds),
            "extras": self.extras._asdict(),
        }
        return dict(json.loads(json.dumps(told)))  # as it will be read back

    def demonstrations(self) -> Iterator[tuple[str, Demonstrations]]:
        """The name and each block, read back."""
        for path, seeds in self.blocks():
            yield self.name, Demonstrations.read(path, seeds)


class _Score(NamedTuple):
    """What the mean return of a policy in the first worlds is taken of."""

    name: str
    """Of the policy."""
    known: NDArray[np.float64] | None
    """Its returns, where nobody has to drive for them."""
    source: _Source | None
    """Who drives for them, where somebody has to."""

    def mean(self) -> float:
        """The score, once its source has been driven."""
        if self.known is not None:
            return float(np.mean(self.known))
        assert self.source is not None
        returns = [Demonstrations.read(path, seeds).returns() for path, seeds in self.source.first().blocks()]
        return float(np.mean(np.concatenate(returns)[:SCORED]))


def _digests(scenario: Scenario, entry: PolicyEntry) -> dict[str, Any]:
    """Of the files that a scenario and a policy are made of beside this package's, by kind."""
    told = {"code": own_code(scenario), "data": data_digest(scenario), "policy_code": entry.code}
    return {kind: digest for kind, digest in told.items() if digest}


class _Dataset(NamedTuple):
    """A dataset that is asked for."""

    id: str
    form: str
    sources: tuple[_Source, ...]
    expert: str

    def identity(self) -> dict[str, Any]:
        """What it is a function of; of several sources also which."""
        told = {**self.sources[0].identity(), "observation": self.form, "expert": self.expert}
        if len(self.sources) > 1:
            told["policy"], told["parameters"] = MIXED, {}
            told["of"] = {source.name: source.identity() for source in self.sources}
            told["episodes"] = sum(len(source.scenario.seeds) for source in self.sources)
        return told


def collect(
    scenario: Any,
    policies: Any,
    out: str | os.PathLike[str],
    *,
    episodes: int = 1000,
    seed: int = 0,
    forms: Sequence[str] = FORMS,
    extras: Extras | None = None,
    expert: Any = EXPERT,
    signature: Signature | None = None,
    overrides: Mapping[str, Any] | None = None,
    workers: int = 1,
    progress: bool = False,
    trust: bool = False,
) -> list[str]:
    """Write a Minari dataset of each policy in the same worlds, and of several policies one of all their episodes.

    The reference scores are the mean returns of the random policy and of the expert in the first hundred worlds.

    Args:
        scenario: a name, path, dict or Scenario, with one robot.
        policies: as `evaluate` takes them, by name.
        out: folder of all datasets. A run that was cut off goes on from it; one process at a time writes there.
        episodes: worlds, an episode each.
        seed: of the first world, the others count up.
        forms: how observations lie in the datasets, a dataset each: "dict", "flat".
        extras: what else is recorded.
        expert: the policy whose mean return is the highest score.
        signature: who is said to have collected them; what is there already keeps its own, as a warning says then.
        overrides: values by dotted key that replace the scenario's.
        workers: processes that share the work.
        progress: whether to show a bar on the terminal.
        trust: whether code that the scenario names may be imported and run.

    Returns:
        The names of the datasets.

    Raises:
        ImportError: no Minari.
        ValueError: an unknown name, a policy that does not fit, a scenario with several robots, or `out` holds datasets of
            another run, is in use or damaged.
    """
    require_minari()
    workers = checked_count("workers", workers, most=MOST_WORKERS)
    if unknown := [form for form in forms if form not in FORMS] or ([] if forms else ["none"]):
        raise ValueError(f"observations lie as {' or '.join(FORMS)}, got {shortened(unknown[0])}")
    root = out_path(out).absolute()  # Minari joins a relative one to itself
    extras = extras or Extras()
    _required(scenario, overrides, extras, trust=trust)
    plan = _planned(scenario, policies, episodes=episodes, seed=seed, overrides=overrides, trust=trust)
    _require_named(plan)
    if are_several(workers):
        require_sendable(plan)
    sources = _sources(plan, root, extras)
    planned = partial(_planned, scenario, episodes=episodes, seed=seed, overrides=overrides, trust=trust)
    lowest, highest = (_score(PolicyEntry.of(policy), sources, planned) for policy in (FLOOR, expert))
    datasets = _datasets(sources, forms, highest.name)
    drivers = [score.source for score in (lowest, highest) if score.source is not None]
    mark = _mark(datasets)
    with ExitStack() as stack:
        root.mkdir(parents=True, exist_ok=True)
        stack.enter_context(one_writer(root))
        track = stack.enter_context(progress_bar(shown=progress))
        missing = [dataset for dataset in datasets if not _is_there(root, dataset)]
        _tell_unsigned(root, [dataset for dataset in datasets if dataset not in missing], signature or Signature())
        if missing:
            needed = {source.folder: source for source in (*drivers, *_needed(missing))}  # those of datasets are longer
            _drive(list(needed.values()), mark, workers, track)
            _write(root, missing, (lowest.mean(), highest.mean()), signature or Signature(), workers, track)
        for source in (*drivers, *sources):
            _let_go(source.folder, mark)
        staged = {_stage(dataset).parent for dataset in datasets}
        for folder in (*staged, _kept(root, plan), root / KEPT):
            with suppress(OSError):  # blocks of another run may be there
                folder.rmdir()
    return [dataset.id for dataset in datasets]


# ---------------------------------------------------------------------------------------------------------------------
# What is asked for
# ---------------------------------------------------------------------------------------------------------------------


def _required(scenario: Any, overrides: Mapping[str, Any] | None, extras: Extras, *, trust: bool) -> None:
    """Raise a ValueError where there are no datasets of a scenario, before anything is compiled for it."""
    found = load(scenario, overrides, trust=trust)
    if found.robots.count != 1:
        raise ValueError(f"datasets are of one robot, {found.name} has {found.robots.count}")
    if extras.shortest_path and ScenarioEntry(found.name, found, range(0)).has_moving_target:
        raise ValueError(f"{found.name} has a moving target and no shortest path")


def _planned(
    scenario: Any, policies: Any, *, episodes: int, seed: int, overrides: Mapping[str, Any] | None, trust: bool
) -> Plan:
    """The policies in their worlds, each tried once."""
    plan = make_plan(policies, [scenario], episodes=episodes, seed=seed, overrides=overrides, trust=trust)
    if objects := [entry.label for entry in plan.policies if entry.policy is not None]:
        raise ValueError(f"datasets are of policies by name, got the object {objects[0]}")
    return plan


def _require_named(plan: Plan) -> None:
    """Raise a ScenarioError where a dataset, which has names of functions and families, could not say what its env is of."""
    (worlds,) = plan.scenarios
    try:
        load(dump(worlds.scenario), trust=True)
    except ScenarioError as error:
        expected = "expected functions and families of a module or file, from where a dataset's env takes them"
        raise ScenarioError(f"{worlds.label}: {expected}: {error}") from None


def _kept(root: Path, plan: Plan) -> Path:
    return root / KEPT / in_name(plan.scenarios[0].label)


def _sources(plan: Plan, root: Path, extras: Extras) -> list[_Source]:
    (worlds,) = plan.scenarios
    sources = [_Source(entry, worlds, extras, Path()) for entry in plan.policies]
    names = [source.name for source in sources]
    for name in names:
        if name == MIXED or names.count(name) > 1:
            raise ValueError(f"got policies whose datasets would both be called {name}, expected distinct names")
    return [source._replace(folder=_kept(root, plan) / source.name) for source in sources]


def _score(entry: PolicyEntry, sources: Sequence[_Source], planned: Callable[[Any], Plan]) -> _Score:
    """The score of a policy that is collected anyway, whose returns are known, or that drives for it alone."""

    def driver(of: PolicyEntry) -> tuple[str, dict[str, Any]]:
        return of.name, dict(of.parameters)

    (one, *_) = sources
    for source in sources:
        if driver(source.entry) == driver(entry):
            return _Score(source.name, None, source)
    known = known_returns(entry, replace(one.scenario, seeds=one.scenario.seeds[:SCORED]))
    if known is not None:
        return _Score(in_name(entry.label), known, None)
    (tried,) = planned([entry]).policies
    alone = one._replace(entry=tried, extras=Extras()).first()
    return _Score(alone.name, None, alone._replace(folder=one.folder.with_name(f"{alone.name}.score")))


def _datasets(sources: Sequence[_Source], forms: Sequence[str], expert: str) -> list[_Dataset]:
    """Those of each source, and of several the mixed one, in each form."""
    several = [(MIXED, tuple(sources))] if len(sources) > 1 else []
    named = [*((source.name, (source,)) for source in sources), *several]
    label = sources[0].scenario.label
    return [
        _Dataset(dataset_id(label, name, form), form, members, expert)
        for name, members in named
        for form in dict.fromkeys(forms)
    ]


def _needed(datasets: Sequence[_Dataset]) -> Iterator[_Source]:
    return itertools.chain.from_iterable(dataset.sources for dataset in datasets)


def _is_there(root: Path, dataset: _Dataset) -> bool:
    """Whether a dataset has been written.

    Raises:
        ValueError: another one of that name has, or it is damaged.
    """
    folder = root / dataset.id
    if not os.path.lexists(folder):
        return False
    if other := other_run(read_identity(folder), dataset.identity()):
        raise ValueError(f"{folder} holds {other}; name another folder, or remove this one")
    open_dataset(folder)
    return True


def _tell_unsigned(root: Path, there: Sequence[_Dataset], signature: Signature) -> None:
    """Say of which datasets that are there already the signature was not written into."""
    asked = {key: value for key, value in signature._asdict().items() if value is not None}
    others = [dataset.id for dataset in there if not all(has_said(root / dataset.id, key, asked[key]) for key in asked)]
    if others:
        told = f"{', '.join(asked)} not written into what was there already: {', '.join(others)}"
        logger.warning("%s; remove these folders to have them written anew", told)


# ---------------------------------------------------------------------------------------------------------------------
# Doing it
# ---------------------------------------------------------------------------------------------------------------------


def _drive(sources: Sequence[_Source], mark: str, workers: int, track: Track[Any]) -> None:
    """Drive the blocks that are not there yet, the first ones of all policies first."""
    for source in sources:
        _agree(source)
    jobs = []
    for source in sources:
        (source.folder / mark).touch()
        for number, (path, seeds) in enumerate(source.blocks()):
            if path.exists():
                Demonstrations.read(path, seeds)  # a damaged one is told of before the work
            else:
                jobs.append((number, (source, path, seeds)))
    ordered = [job for _, job in sorted(jobs, key=lambda item: item[0])]
    for _ in track(each(partial(starred, _drive_block), ordered, workers), "blocks", len(ordered)):
        pass


def _drive_block(source: _Source, path: Path, seeds: range) -> None:
    slots = None if source.entry.is_scripted else WIDE_SLOTS
    demonstrate(source.entry, source.scenario, seeds, source.extras, slots=slots).write(path)


def _agree(source: _Source) -> None:
    """Write down what the blocks of a folder are of, or find that they are of the same."""
    source.folder.mkdir(parents=True, exist_ok=True)
    identity = source.identity()
    there = kept_manifest(source.folder / "manifest.json", identity)
    if other := other_run(there, identity):
        raise ValueError(f"{source.folder} holds {other}; name another folder, or remove this one")


def _mark(datasets: Sequence[_Dataset]) -> str:
    """Name of the file that says in a folder of blocks that a run for these datasets needs them, until all are there."""
    told = json.dumps([[dataset.id, dataset.identity()] for dataset in datasets], sort_keys=True)
    return f"{hashlib.sha256(told.encode()).hexdigest()[:16]}{NEEDED}"


def _let_go(folder: Path, mark: str) -> None:
    """Remove a folder of blocks that a run needed and no other one does."""
    if not (folder / mark).exists():
        return
    if len(list(folder.glob(f"*{NEEDED}"))) > 1:
        (folder / mark).unlink()
        return
    for block in folder.glob("*.npz"):
        block.unlink()  # before what says of whom they are
    shutil.rmtree(folder, ignore_errors=True)


def _write(
    root: Path,
    datasets: Sequence[_Dataset],
    scores: tuple[float, float],
    signature: Signature,
    workers: int,
    track: Track[Any],
) -> None:
    """Put the datasets together; the scores are the lowest and the highest one."""
    write_namespaces(root, datasets[0].sources[0].scenario.label)
    jobs = [(root, dataset, dataset.identity(), scores, signature) for dataset in datasets]
    for _ in track(each(partial(starred, _write_one), jobs, workers), "datasets", len(jobs)):
        pass


def _write_one(
    root: Path, dataset: _Dataset, identity: Mapping[str, Any], scores: tuple[float, float], signature: Signature
) -> None:
    worlds = dataset.sources[0].scenario
    names = ", ".join(source.name for source in dataset.sources)
    who = f"the policies {names}" if len(dataset.sources) > 1 else f"the policy {names}"
    lowest, highest = scores
    about = About(
        scenario=worlds.scenario,
        algorithm=names,
        description=f"Episodes of {who} of bug_gym in worlds of the scenario {worlds.label}, seeds "
        f"{worlds.seeds[0]} to {worlds.seeds[-1]}; observations as {dataset.form}.",
        identity=identity,
        lowest=lowest,
        highest=highest,
        scored=min(SCORED, len(worlds.seeds)),
        expert=dataset.expert,
        **signature._asdict(),
    )
    blocks = itertools.chain.from_iterable(source.demonstrations() for source in dataset.sources)
    write_dataset(root, _stage(dataset), dataset.id, dataset.form, about, blocks)


def _stage(dataset: _Dataset) -> Path:
    """Where a dataset is put together, while others are."""
    return dataset.sources[0].folder.parent / "staged" / Path(dataset.id).name
