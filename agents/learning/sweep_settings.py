"""What a sweep over trainings is, as data: configs/sweeps/*.yaml."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import chain, islice, product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, PrivateAttr, Tag, ValidationError, model_validator

from bug_gym.agents.learning.beside import beside
from bug_gym.agents.learning.settings import AnySettings, OfflineSettings, load_settings
from bug_gym.checks import shortened
from bug_gym.config import SCENARIO_FOLDER, ScenarioError, expanded, explain, from_folder, names_file, read_yaml
from bug_gym.limits import MOST_TRAININGS
from bug_gym.naming import nearest_hint
from bug_gym.scenario_code import own_parts
from bug_gym.schema.errors import wrong
from bug_gym.schema.values import AtLeastOne, Name, Number, Part

if TYPE_CHECKING:
    import optuna

SWEEP_FOLDER = SCENARIO_FOLDER.parent / "sweeps"
MOST_TRIED = 1000
"""Combinations that are looked at, for one that can be trained with, before anything is: some seconds."""


class Range(Part):
    """Numbers from which a search takes one."""

    low: Number
    """The least."""
    high: Number
    """The greatest."""
    log: bool = False
    """Whether their logarithms are equally likely."""
    step: Number | None = None
    """Only the least and so many more; whole numbers where all three are."""

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        if self.low >= self.high:
            raise wrong(f"got {self.high}, expected more than low ({self.low})", "high")
        if self.log and (self.low <= 0.0 or self.step is not None):
            raise wrong(f"got low {self.low} and step {self.step}, expected a low above 0 and no step with log", "low")
        return self

    def suggested(self, trial: optuna.Trial, name: str) -> float:
        """What a trial takes."""
        numbers = [self.low, self.high, *([] if self.step is None else [self.step])]
        if self.step is not None and all(float(number).is_integer() for number in numbers):
            return trial.suggest_int(name, int(self.low), int(self.high), step=int(self.step))
        return trial.suggest_float(name, self.low, self.high, log=self.log, step=self.step)


Choice = str | bool | int | float
"""A value that a key of a training takes."""


def _kind(values: object) -> str:
    return "range" if isinstance(values, Mapping | Range) else "values"


Choices = Annotated[
    Annotated[tuple[Choice, ...], Tag("values")] | Annotated[Range, Tag("range")],
    Discriminator(_kind),
]
"""Values to choose from, or a range."""


class SweepSettings(Part):
    """What a sweep is."""

    name: Name = "sweep"
    """What it is called; a file's stem where the file gives none."""
    training: str
    """The training that is changed, by name or path, relative to the sweep's file."""
    overrides: dict[str, Any] = {}
    """Values of the training that are the same in all trials."""
    seeds: AtLeastOne = 1
    """Models of a trial, which counts by the mean of their best validations."""
    sampler: Literal["grid", "tpe"] = "grid"
    """Every combination of values, or a search by the tree-structured Parzen estimator (Bergstra et al. 2011)."""
    trials: AtLeastOne | None = None
    """How many a search makes."""
    space: dict[str, Choices] = Field(min_length=1)
    """By key of the training: values to choose from, or of a search a range."""
    _trust: bool = PrivateAttr(default=False)  # no key: data cannot grant itself trust

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        ranges = [key for key, values in self.space.items() if isinstance(values, Range)]
        if self.sampler == "grid" and ranges:
            raise wrong(
                f"got a range, expected a list of values in a grid, or sampler: tpe ({', '.join(ranges)})", "space"
            )
        if (self.sampler == "tpe") != (self.trials is not None):
            raise wrong(f"got {self.trials}, expected a number with sampler tpe and none with grid", "trials")
        if empty := [key for key, values in self.space.items() if not isinstance(values, Range) and not values]:
            raise wrong(f"got no values of {', '.join(empty)}, expected some", "space")
        if (models := self.total * self.seeds) > MOST_TRAININGS:
            came = f"got {self.total:,} trials of {self.seeds:,} seeds, {models:,} models"
            raise wrong(f"{came}, expected at most {MOST_TRAININGS:,}", "trials" if self.trials else "space")
        return self

    def trusting(self, trust: bool) -> Self:
        """The same sweep, whose trainings may run the code that their scenarios name or not."""
        copy = self.model_copy()
        copy._trust = trust
        return copy

    def trained_with(self, values: Mapping[str, Any]) -> AnySettings:
        """The settings of one trial's training."""
        return load_settings(self.training, {**self.overrides, **values}, trust=self._trust)

    @property
    def grid(self) -> dict[str, tuple[Choice, ...]]:
        """The values to choose from, by key."""
        return {key: values for key, values in self.space.items() if not isinstance(values, Range)}

    @property
    def total(self) -> int:
        """How many trials it has."""
        return math.prod(map(len, self.grid.values())) if self.trials is None else self.trials


def sweep_names() -> list[str]:
    """Names of the sweeps that come with the package, sorted."""
    return sorted(path.stem for path in SWEEP_FOLDER.glob("*.yaml"))


def load_sweep(source: str | Path | Mapping[str, Any], *, trust: bool = False) -> SweepSettings:
    """The settings of a sweep, each combination of which is a training.

    Args:
        source: a name of `sweep_names()`, the path of a YAML file, or a mapping.
        trust: whether code that scenarios of the training name may be imported, which runs the code of their modules.

    Raises:
        ScenarioError: what is unknown or not allowed, with its key; code that scenarios name, without trust.
    """
    label, data = str(source), source
    if isinstance(source, Mapping):
        label, data = "sweep", dict(source)
    elif isinstance(source, str) and source in sweep_names():
        data = read_yaml(SWEEP_FOLDER / f"{source}.yaml")
    elif isinstance(source, str) and not names_file(source):
        hint = nearest_hint(source, sweep_names())
        raise ScenarioError(f"no sweep {shortened(source, 300)}{hint} (known: {', '.join(sweep_names())})")
    else:
        path = expanded(source)
        data = read_yaml(path)
        data = {key: from_folder(value, path.parent) if key == "training" else value for key, value in data.items()}
        if isinstance(overrides := data.get("overrides"), dict):
            data["overrides"] = beside(path.parent, overrides)
        if isinstance(space := data.get("space"), dict):
            data["space"] = {key: _beside(path.parent, key, values) for key, values in space.items()}
    try:
        settings = SweepSettings.model_validate(data).trusting(trust)
    except ValidationError as error:
        raise ScenarioError(explain(error, label)) from None
    try:
        first = _first_training(settings)
        for scenario in chain(*first.worlds.values()):
            own_parts(scenario)
    except ScenarioError as error:
        raise ScenarioError(f"{label}: {error}") from None
    if isinstance(first, OfflineSettings):
        raise ScenarioError(
            f"{label}: training: {settings.training} learns offline, expected one that learns in worlds"
        )
    return settings


def _beside(folder: Path, key: str, values: Any) -> Any:
    """Values to choose from of a key of a training, looked for in the folder of the sweep's file."""
    if not isinstance(values, list):
        return values  # a range
    return [beside(folder, {key: value})[key] for value in values]


def _first_training(settings: SweepSettings) -> AnySettings:
    """The first training that can be, so that a key or values that never can are told before anything is trained.

    Raises:
        ScenarioError: there is none among the first MOST_TRIED; what is wrong with the very first.
    """
    wrong_with_first: ScenarioError | None = None
    for values in islice(product(*map(_ends, settings.space.values())), MOST_TRIED):
        try:
            return settings.trained_with(dict(zip(settings.space, values, strict=True)))
        except ScenarioError as error:
            wrong_with_first = wrong_with_first or error
    assert wrong_with_first is not None  # every key has a value
    raise wrong_with_first


def _ends(choices: tuple[Choice, ...] | Range) -> tuple[Choice, ...]:
    """The values of a key, of a range the least and the greatest."""
    if not isinstance(choices, Range):
        return choices
    return tuple(int(end) if choices.step and float(end).is_integer() else end for end in (choices.low, choices.high))
