"""What to evaluate as data: suites, policies and scenarios with their seeds, and the plan that they make together."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import platform
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field, ValidationError, model_validator

import bug_gym
from bug_gym.config import Scenario, ScenarioError, dump, explain, read_yaml, scenario_names
from bug_gym.naming import nearest_hint
from bug_gym.policy import Policy
from bug_gym.schema.values import AtLeastOne, Count, Part
from bug_gym.simulation import Simulation

SUITE_FOLDER = Path(__file__).parents[1] / "configs" / "suites"
EPISODES = 50
"""Episodes of a scenario where nobody says how many."""

P = TypeVar("P", bound=Part)


class Seeds(Part):
    """Seeds in a row: the same worlds for each policy."""

    first: Count = 0
    """The first seed."""
    count: AtLeastOne = EPISODES
    """How many."""


class SuiteScenario(Part):
    """A scenario of a suite; its name alone is enough."""

    scenario: str | dict[str, Any]
    """A name, the path of a YAML file (relative to the suite's), or a mapping that says the same."""
    overrides: dict[str, Any] = {}
    """Values by dotted key that replace the scenario's."""
    label: str | None = None
    """What tables call it; none: the scenario's name."""
    seeds: Seeds | None = None
    """Seeds of its own; none: the suite's."""

    @model_validator(mode="before")
    @classmethod
    def _a_name_is_enough(cls, data: object) -> object:
        return {"scenario": data} if isinstance(data, str) else data


class SuitePolicy(Part):
    """A policy of a suite; its name alone is enough."""

    name: str
    """Name that `make_policy` takes."""
    label: str | None = None
    """What tables call it; none: its name."""
    parameters: dict[str, Any] = {}
    """The algorithm's own parameters."""

    @model_validator(mode="before")
    @classmethod
    def _a_name_is_enough(cls, data: object) -> object:
        return {"name": data} if isinstance(data, str) else data


class SuiteData(Part):
    """Somebody else's data that a suite drives in, which is not part of this package."""

    key: str
    """Key of each scenario that takes the path of the data, such as `world.path`."""
    what: Annotated[str, Field(min_length=1)]
    """What the data is, for the one who is asked for it."""


class Suite(Part):
    """Scenarios, seeds and policies that are always evaluated together."""

    name: str = "custom"
    """What the manifest calls it; a file's stem where the file gives none."""
    version: AtLeastOne = 1
    """Goes up with any change: results of different versions are not comparable."""
    scenarios: tuple[SuiteScenario, ...] = Field(min_length=1)
    """Scenarios to drive in."""
    policies: tuple[SuitePolicy, ...] = ()
    """Policies where the caller names none; empty: all that are registered."""
    seeds: Seeds = Seeds()
    """Seeds of each scenario that has none of its own."""
    data: SuiteData | None = None
    """Data that it needs; none: all is here."""

    def overrides(self, data: str | os.PathLike[str] | None) -> dict[str, Any]:
        """Where the scenarios find the data at a path, as values by dotted key.

        Raises:
            ValueError: no path where data is needed, or one where none is.
        """
        if self.data is None and data is not None:
            raise ValueError(f"suite {self.name!r} needs no data, got {str(data)!r}")
        if self.data is not None and data is None:
            raise ValueError(f"suite {self.name!r} needs data that is not part of this package: {self.data.what}")
        return {} if self.data is None else {self.data.key: str(Path(str(data)).expanduser().absolute())}


def suite_names() -> list[str]:
    """Names of the suites that come with the package, sorted."""
    return sorted(path.stem for path in SUITE_FOLDER.glob("*.yaml"))


def load_suite(source: str | Path | Mapping[str, Any] | Suite) -> Suite:
    """Makes a suite from a name of `suite_names()`, the path of a YAML file, or a mapping that says the same.

    Raises:
        ScenarioError: where something is unknown, missing or not allowed.
    """
    if isinstance(source, Suite):
        return source
    if isinstance(source, Mapping):
        return checked(Suite, dict(source), "suite")
    if isinstance(source, str) and not _is_path(source):
        if source not in suite_names():
            known = ", ".join(suite_names())
            raise ScenarioError(f"no suite {source!r}{nearest_hint(source, suite_names())} (known: {known})")
        source = SUITE_FOLDER / f"{source}.yaml"
    path = Path(source).expanduser()
    data = read_yaml(path)
    if isinstance(data.get("scenarios"), list):
        items = [item if isinstance(item, dict) else {"scenario": item} for item in data["scenarios"]]
        data["scenarios"] = [
            {**item, "scenario": str(path.parent / Path(item["scenario"]).expanduser())}
            if _is_path(item.get("scenario"))
            else item
            for item in items
        ]
    return checked(Suite, data, path.name)


def _is_path(source: object) -> bool:
    return isinstance(source, str) and re.search(r"[/\\]|\.ya?ml$", source) is not None


def checked(model: type[P], data: object, label: str) -> P:
    """The data as a part; errors name what it is of."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(explain(error, label)) from None


@dataclass(frozen=True)
class PolicyEntry:
    """A policy to evaluate: a name of the table with parameters, or an object that has `predict`."""

    label: str
    """What tables call it."""
    name: str
    """Name that `make_policy` takes, or the class of the object."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """The algorithm's own parameters."""
    policy: Policy | None = None
    """The object, where there is one."""

    @classmethod
    def of(cls, source: Any) -> PolicyEntry:
        """An entry from a name, (label, name, parameters), a dict with those keys, or an object with or without label.

        Raises:
            ValueError: nothing of the kind.
        """
        if isinstance(source, cls):
            return source
        if isinstance(source, SuitePolicy):
            return cls(source.label or source.name, source.name, source.parameters)
        if isinstance(source, (str, Mapping)):
            return cls.of(checked(SuitePolicy, source, "policy"))
        if isinstance(source, tuple) and len(source) in (2, 3) and isinstance(source[1], str):
            return cls.of(dict(zip(("label", "name", "parameters"), source, strict=False)))
        label, policy = source if isinstance(source, tuple) and len(source) == 2 else (type(source).__name__, source)
        if not callable(getattr(policy, "predict", None)):
            expected = "a name, (label, name, parameters), a dict with those keys, or an object with predict"
            raise ValueError(f"got {source!r} as a policy, expected {expected}")
        return cls(label, type(policy).__qualname__, policy=policy)

    def make(self, simulation: Simulation) -> Policy:
        """The policy for the robots of a simulation."""
        if self.policy is not None:
            return self.policy
        from bug_gym.agents import make_policy

        return make_policy(self.name, simulation, **self.parameters)


@dataclass(frozen=True)
class ScenarioEntry:
    """A scenario to evaluate in, and the seeds of its worlds."""

    label: str
    """What tables call it."""
    scenario: Scenario
    seeds: range

    @property
    def has_moving_target(self) -> bool:
        """Whether the goal moves, so that no path is the shortest one."""
        world = self.scenario.world
        return getattr(world, "target", None) is not None or getattr(world, "target_motion", None) is not None


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
            ValueError: a policy has parameters that JSON cannot hold.
        """
        scenarios = {
            entry.label: {
                "scenario": dump(entry.scenario),
                "seeds": {"first": entry.seeds.start, "count": len(entry.seeds)},
                "digest": _digest(entry.scenario),
            }
            for entry in self.scenarios
        }
        policies = {entry.label: {"name": entry.name, "parameters": dict(entry.parameters)} for entry in self.policies}
        versions = {"bug_gym": bug_gym.__version__, "python": platform.python_version()}
        versions |= {name: version(name) for name in ("gymnasium", "numpy", "numba", "shapely")}
        manifest = {"suite": self.suite, "scenarios": scenarios, "policies": policies, "versions": versions}
        try:
            return dict(json.loads(json.dumps(manifest, allow_nan=False)))  # as it will be read back
        except (TypeError, ValueError) as error:
            raise ValueError(f"a policy's parameters must be plain data that JSON can hold: {error}") from None


def _digest(scenario: Scenario) -> str:
    """Of the whole scenario, defaults too: they may change from one version to the next."""
    text = json.dumps(scenario.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def as_suite(source: Any) -> tuple[Suite, str]:
    """A suite and its name for the manifest; one without a name for bare scenarios.

    A bare name that a scenario and a suite share is the scenario's: `load_suite(name)` gives the suite.
    """
    if isinstance(source, Path):
        source = str(source)
    if _is_suite(source):
        suite = load_suite(source)
        return suite, f"{suite.name} v{suite.version}"
    sources = source if isinstance(source, (list, tuple)) else [source]
    plain = [
        dump(item) if isinstance(item, Scenario) else str(item) if isinstance(item, Path) else item for item in sources
    ]
    return checked(Suite, {"scenarios": [{"scenario": item} for item in plain]}, "scenarios"), ""


def _is_suite(source: Any) -> bool:
    if isinstance(source, str):
        if _is_path(source):
            return "scenarios" in read_yaml(Path(source).expanduser())
        return source in suite_names() and source not in scenario_names()
    return isinstance(source, Suite) or (isinstance(source, Mapping) and "scenarios" in source)
