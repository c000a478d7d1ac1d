"""All that an evaluation is about: policies, scenarios and seeds, each policy tried once before anything is written."""

from __future__ import annotations

import itertools
import json
import logging
import math
import os
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np

import bug_gym
from bug_gym.agents import Spec, playable_names
from bug_gym.checks import shortened
from bug_gym.config import Scenario, ScenarioError, dump, load
from bug_gym.evaluation.by_name import scenario_words
from bug_gym.evaluation.entries import EXPECTED, PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout, is_privileged
from bug_gym.evaluation.suites import as_suite
from bug_gym.evaluation.summary import OVERALL, PRIVILEGED
from bug_gym.files import released
from bug_gym.limits import MOST_EPISODES, ROW_BYTES, told_bytes
from bug_gym.log import warn_once
from bug_gym.policy import MisfitError
from bug_gym.references import note_code, source_digest
from bug_gym.scenario_code import data_digest, names_code, own_code, own_parts
from bug_gym.simulation import Simulation
from bug_gym.worlds.layout import Layout

logger = logging.getLogger("bug_gym")

SOURCE = "bug_gym_source"
"""What manifests call the digest of this package's source."""


def versions() -> dict[str, str]:
    """Of what rows are made by: this package and its source, Python, and the packages that they depend on."""
    told = {"bug_gym": released(bug_gym.__version__), "python": platform.python_version()}
    told |= {name: version(name) for name in ("gymnasium", "numpy", "numba", "shapely")}
    return {**told, SOURCE: source_digest()[:16]}


@dataclass(frozen=True)
class Plan:
    """All that an evaluation is about."""

    suite: str
    """Name and version of the suite, "" where there is none."""
    policies: tuple[PolicyEntry, ...]
    scenarios: tuple[ScenarioEntry, ...]
    left_out: frozenset[tuple[str, str]] = frozenset()
    """Labels of policies and of scenarios that they do not fit: a learned policy drives the robot it was made for."""

    def pairs(self) -> Iterator[tuple[ScenarioEntry, PolicyEntry]]:
        """Each scenario with each policy that fits it."""
        for scenario, policy in itertools.product(self.scenarios, self.policies):
            if (policy.label, scenario.label) not in self.left_out:
                yield scenario, policy

    def manifest(self) -> dict[str, Any]:
        """The plan as data: runs with the same one make the same rows, but for the times of decisions.

        Raises:
            ValueError: a policy has parameters that JSON cannot hold, or a caller's file was changed after it was imported.
        """
        scenarios = {
            entry.label: {
                "scenario": dump(entry.scenario),
                "seeds": {"first": entry.seeds.start, "count": len(entry.seeds)},
                "digest": entry.scenario.digest,
                **({"code": own} if (own := own_code(entry.scenario)) else {}),
                **({"data": data} if (data := data_digest(entry.scenario)) else {}),
            }
            for entry in self.scenarios
        }
        policies = {
            entry.label: {
                "name": entry.name,
                "parameters": dict(entry.parameters),
                **({"code": code} if (code := entry.code) else {}),
            }
            for entry in self.policies
        }
        manifest = {"suite": self.suite, "scenarios": scenarios, "policies": policies, "versions": versions()}
        try:
            return dict(json.loads(json.dumps(manifest, allow_nan=False)))  # as it will be read back
        except (TypeError, ValueError) as error:
            raise ValueError(f"a policy's parameters must be plain data that JSON can hold: {error}") from None

    def note_code(self) -> None:
        """Take down what is from outside as it is written now, so that a change after this is noticed."""
        for scenario in self.scenarios:
            for code in own_parts(scenario.scenario).values():
                note_code(code)

    def require_as_imported(self) -> None:
        """Refuse files of a caller's that have changed since they were imported: other processes would import others.

        Raises:
            ValueError: one has.
        """
        for entry in self.policies:
            entry.require_as_imported()
        for scenario in self.scenarios:
            own_code(scenario.scenario)


def make_plan(
    policies: Any,
    scenario_or_suite: Any,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    data: str | os.PathLike[str] | None = None,
    privileged: bool = True,
    trust: bool = False,
) -> Plan:
    """What to evaluate, from the arguments of `evaluate`, each policy tried once in each scenario.

    Raises:
        ValueError: an unknown name, a label that comes twice, or says falsely that a policy reads the map, a policy that fits
            none of the scenarios, or only some that read the map where those are left out.
    """
    if not isinstance(overrides, (Mapping, NoneType)):
        raise ScenarioError(f"overrides: got {shortened(overrides)}, expected a mapping of dotted keys to values")
    suite, name = as_suite(scenario_or_suite)
    scenarios, found = [], suite.overrides(data)
    for number, item in enumerate(suite.scenarios):
        replaced = {**item.overrides, **found, **(overrides or {})}
        try:
            scenario = load(item.scenario, replaced, trust=trust)
        except ScenarioError as error:
            raise ScenarioError(f"{name}: scenarios.{number}: {error}" if name else str(error)) from None
        seeds = item.seeds or suite.seeds
        first, count = seeds.first if seed is None else seed, seeds.count if episodes is None else episodes
        if not (_is_whole(first) and _is_whole(count)) or first < 0 or count < 1:
            came = f"{shortened(first)} and {shortened(count)}"
            raise ValueError(f"expected a seed from 0 on and at least one episode, whole numbers, got {came}")
        first, count = int(first), int(count)
        if item.seeds is not None and item.seeds.count == 1:  # the suite says that more would be the same once more
            count = 1
        if first + count > 2**63:
            raise ValueError(f"expected seeds below 2**63, got {count} from {first} on")
        words = scenario_words(item.scenario, replaced, trust=names_code(scenario))
        scenarios.append(ScenarioEntry(item.label or scenario.name, scenario, range(first, first + count), words))
    by_default = policies is None and not suite.policies
    if by_default:
        policies = playable_names()
    elif policies is None:
        policies = suite.policies
    elif isinstance(policies, (str, Path, Mapping, Spec)) or hasattr(policies, "predict"):
        policies = [policies]
    elif not isinstance(policies, Iterable):
        raise ValueError(f"got {shortened(policies)} as policies, expected a list of these, or one: {EXPECTED}")
    entries = [PolicyEntry.of(policy) for policy in policies]
    if not entries:
        raise ValueError("no policies to evaluate")
    if not privileged:
        asked = [entry.label for entry in entries]
        entries = [entry for entry in entries if not entry.is_privileged]
        if not entries:
            raise ValueError(f"expected a policy that does not read the map, got {', '.join(asked)}")
    _require_room(scenarios, len(entries))
    if any(entry.label == OVERALL for entry in scenarios):
        raise ValueError(f"no scenario may be named {OVERALL!r}, as tables call all of them together")
    cure = "give them labels" if name else "give them names (`name:`)"
    _require_distinct("scenarios", [entry.label for entry in scenarios], cure)
    _require_distinct("policies", [entry.label for entry in entries], "give them labels")
    labelled, left_out = _try_out(entries, scenarios, asked_for=not by_default)
    _require_distinct("policies", [entry.label for entry in labelled], "give them labels")  # some have a mark now
    lost = [entry for entry in labelled if all((entry.label, scenario.label) in left_out for scenario in scenarios)]
    if lost and not by_default:
        raise MisfitError(left_out[lost[0].label, scenarios[0].label])
    kept = tuple(entry.held() for entry in labelled if entry not in lost)
    plan = Plan(name, kept, tuple(entry.held() for entry in scenarios), frozenset(left_out))
    plan.note_code()
    return plan


def _is_whole(number: object) -> bool:
    return isinstance(number, (int, np.integer)) and not isinstance(number, bool)


def _require_room(scenarios: Sequence[ScenarioEntry], policies: int) -> None:
    """Raises where the rows would not fit into memory; seeds are ranges, which take none."""
    rows = policies * sum((entry.seeds.stop - entry.seeds.start) * entry.scenario.robots.count for entry in scenarios)
    if rows > MOST_EPISODES:
        memory = f"their rows would take {told_bytes(ROW_BYTES * rows)}"
        raise ValueError(f"got {rows:,} episodes of all policies, expected at most {MOST_EPISODES:,}: {memory}")


def _require_distinct(what: str, labels: Sequence[str], cure: str) -> None:
    """Refuse two of a kind under one label, which rows could not be told by; cure: what else to do than leave one out."""
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ValueError(f"two {what} are called {shortened(twice[0])}: leave one out, or {cure}")


def is_one_world(scenario: Scenario, seeds: Sequence[int]) -> bool:
    """Whether each seed has the same still world and robot, as far as two of them show: episodes then differ by noise alone."""
    simulation = Simulation(scenario, 2)
    simulation.reset(seeds=seeds[:2])
    one, other = (simulation.world.layout(row) for row in range(2))
    is_still = not one.movers and one.target is None
    return is_still and simulation.drawn(0) == simulation.drawn(1) and _are_alike(one, other)


def is_without_noise(scenario: Scenario) -> bool:
    """Whether the robot's scanner and odometry draw nothing."""
    lidar, odometry = scenario.lidar, scenario.odometry
    return not any((lidar.noise, lidar.dropout, odometry.translation_noise, odometry.rotation_noise))


def room_at_goal(radius: float, reach: float) -> int:
    """How many robots of a reach [m] find room within the radius [m] of a goal, whoever comes first and from wherever.

    Who arrives stands on the rim, where no other centre comes within two reaches of it. Two centres as far apart are seen
    from the goal at an angle of 2 asin(reach / radius), so that each takes up twice that of the rim.
    """
    return 1 if reach >= radius else math.ceil(math.pi / (2.0 * math.asin(reach / radius)))


def crowded_goal(scenario: Scenario, seed: int) -> str:
    """What to say where more robots have to arrive at one still goal than are sure to find room there, else ""."""
    if scenario.robots.count == 1 or scenario.mission == "first":
        return ""
    simulation = Simulation(scenario)
    simulation.reset(seeds=[seed])
    layout = simulation.world.layout(0)
    sharing = scenario.robots.count
    if len(layout.goals) > 1:
        sharing = int(np.unique(layout.goals, axis=0, return_counts=True)[1].max())
    room = room_at_goal(scenario.goal.radius, scenario.robot.reach)
    if sharing <= room or layout.target is not None:
        return ""
    told = f"{sharing} robots go to one goal, within {scenario.goal.radius:g} m of which {room} of them are sure to find room"
    return f"{told} (others: a larger goal.radius, goals of their own, mission: first)"


def _are_alike(one: Layout, other: Layout) -> bool:
    """Whether two layouts have the same places and still obstacles."""
    told = [
        [layout.border, layout.starts, layout.goals, layout.circles, *itertools.chain.from_iterable(layout.polygons)]
        for layout in (one, other)
    ]
    return len(told[0]) == len(told[1]) and all(map(np.array_equal, *told))


def _try_out(
    entries: Sequence[PolicyEntry], scenarios: Sequence[ScenarioEntry], *, asked_for: bool
) -> tuple[list[PolicyEntry], dict[tuple[str, str], str]]:
    """One step of each policy in each scenario, before anything is written: what is wrong fails here.

    It also leaves compiled code in numba's cache, where workers find it. Policies that read the map are labelled so. A
    learned policy that was made for another robot is left out of the scenario: why, by label of policy and scenario. So is one
    from outside whose own code fails, where nobody has asked for it (but for all that there are).
    """
    labelled = list(entries)
    left_out = {}
    for scenario in scenarios:
        if len(scenario.seeds) > 1 and is_one_world(scenario.scenario, scenario.seeds):
            if is_without_noise(scenario.scenario):
                told = "and nothing is drawn: who decides without chance drives one episode again and again, so ask for one"
            else:
                told = "episodes differ by noise alone"
            warn_once(f"{scenario.label}: every seed has the same world, {told}")
        if told := crowded_goal(scenario.scenario, scenario.seeds[0]):
            warn_once(f"{scenario.label}: {told}")
        misfits = []
        for number, entry in enumerate(entries):
            try:
                rollout = Rollout(entry, scenario, scenario.seeds[:1])
                rollout.advance()
            except MisfitError as error:
                left_out[entry.label, scenario.label] = str(error)
                misfits.append(entry.label)
                continue
            except Exception as error:  # of a caller's code: any
                if asked_for or not entry.reference:
                    raise
                came = f"{type(error).__name__}: {shortened(str(error), 200)}"
                told = "policy %s (%s) is left out of %s, where it fails: %s"
                logger.warning(told, entry.label, entry.reference, scenario.label, came)
                left_out[entry.label, scenario.label] = came
                continue
            if is_privileged(rollout.policy):
                labelled[number] = replace(entry, label=f"{entry.label.removesuffix(PRIVILEGED)}{PRIVILEGED}")
            elif entry.label.endswith(PRIVILEGED):
                told = f"{entry.label} does not read the map, which{PRIVILEGED} behind a label says"
                raise ValueError(f"{told}: give it another label")
        if misfits:
            logger.warning("%s is not for the robot of: %s", scenario.label, ", ".join(misfits))
    now = {entry.label: new.label for entry, new in zip(entries, labelled, strict=True)}
    return labelled, {(now[policy], scenario): why for (policy, scenario), why in left_out.items()}
