"""Suites as data: scenarios, seeds and policies that are always evaluated together (configs/suites/*.yaml)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, InstanceOf, field_validator, model_validator

from bug_gym.agents.outside import Spec
from bug_gym.checks import shortened
from bug_gym.config import (
    Scenario,
    ScenarioError,
    checked,
    expanded,
    from_folder,
    names_file,
    read_yaml,
    scenario_names,
)
from bug_gym.naming import nearest_hint
from bug_gym.references import is_reference
from bug_gym.schema.errors import wrong
from bug_gym.schema.values import AtLeastOne, Count, Episodes, Name, Part

SUITE_FOLDER = Path(__file__).parents[1] / "configs" / "suites"
EPISODES = 50
"""Episodes of a scenario where nobody says how many."""


class Seeds(Part):
    """Seeds in a row: the same worlds for each policy."""

    first: Count = 0
    """The first seed."""
    count: Episodes = EPISODES
    """How many."""


class SuiteScenario(Part):
    """A scenario of a suite; its name alone is enough."""

    scenario: str | dict[str, Any] | InstanceOf[Scenario]
    """A name, the path of a YAML file (relative to the suite's), a mapping that says the same, or a Scenario of a caller's."""
    overrides: dict[str, Any] = {}
    """Values by dotted key that replace the scenario's."""
    label: Name | None = None
    """What tables call it; none: the scenario's name."""
    seeds: Seeds | None = None
    """Seeds of its own; none: the suite's."""

    @model_validator(mode="before")
    @classmethod
    def _a_name_is_enough(cls, data: object) -> object:
        return {"scenario": data} if isinstance(data, (str, Scenario)) else data


class SuitePolicy(Part):
    """A policy of a suite; its name alone is enough."""

    name: str
    """Name that `make_policy` takes."""
    label: Name | None = None
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

    name: Name = "custom"
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

    @field_validator("policies")
    @classmethod
    def _data_runs_no_code(cls, policies: tuple[SuitePolicy, ...]) -> tuple[SuitePolicy, ...]:
        for policy in policies:
            spec = Spec.of(policy.name)
            if is_reference(spec.name) or "trust" in {*spec.options, *policy.parameters}:
                expected = "policies that run no code: the one who evaluates names and trusts it (--policies), not data"
                raise wrong(f"got {shortened(policy.name)}, expected {expected}")
        return policies

    def overrides(self, data: str | os.PathLike[str] | None) -> dict[str, Any]:
        """Where the scenarios find the data at a path, as values by dotted key.

        Raises:
            ValueError: no path where data is needed, or one where none is.
        """
        if self.data is None and data is not None:
            raise ValueError(f"got data {str(data)!r}, expected none: only some suites need any, such as barn")
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
    if isinstance(source, str) and not names_file(source):
        if source not in suite_names():
            known = ", ".join(suite_names())
            raise ScenarioError(
                f"no suite {shortened(source, 300)}{nearest_hint(source, suite_names())} (known: {known})"
            )
        source = SUITE_FOLDER / f"{source}.yaml"
    path = expanded(source)
    data = read_yaml(path)
    if isinstance(data.get("scenarios"), list):
        items = [item if isinstance(item, dict) else {"scenario": item} for item in data["scenarios"]]
        data["scenarios"] = [
            {key: from_folder(value, path.parent) if key == "scenario" else value for key, value in item.items()}
            for item in items
        ]
    return checked(Suite, data, path.name)


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
    plain = [str(item) if isinstance(item, Path) else item for item in sources]
    return checked(Suite, {"scenarios": [{"scenario": item} for item in plain]}, "scenarios"), ""


def _is_suite(source: Any) -> bool:
    if isinstance(source, str):
        if names_file(source):
            return "scenarios" in read_yaml(expanded(source))
        return source in suite_names() and source not in scenario_names()
    return isinstance(source, Suite) or (isinstance(source, Mapping) and "scenarios" in source)
