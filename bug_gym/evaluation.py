"""Policies in the same worlds, measured: `evaluate` makes one row an episode and robot, paired by seed.

A suite (configs/suites/*.yaml) names scenarios and seeds as data. A result folder holds manifest.json (what was asked),
rows.jsonl (one row a line, in order of arrival), the summary and a picture of a typical episode for each policy and
scenario. A run that was cut off goes on where it stopped: rows on disk are done.
"""

from __future__ import annotations

import hashlib
import importlib
import itertools
import json
import logging
import math
import os
import platform
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

import bug_gym
from bug_gym import kernels, kinematics
from bug_gym.config import AtLeastOne, Count, Part, Scenario, ScenarioError, _explain, _nearest, _read_file, dump, load
from bug_gym.intervals import summarise
from bug_gym.metrics import EpisodeRow, earliest_intercept, spl, turns_and_turning
from bug_gym.observation import Field as ObservationField
from bug_gym.observation import Sensors, as_dict, width
from bug_gym.policy import Drawing, Policy, ScriptedPolicy
from bug_gym.rendering import Canvas, Frame, load_pillow, load_pygame, replaced_when_done, save_png
from bug_gym.report import write_summary
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES

logger = logging.getLogger("bug_gym")

SUITE_FOLDER = Path(__file__).parent / "configs" / "suites"
AGENTS = "bug_gym.agents"
"""Where policies are looked up by name; a name and no import, since no module here knows an agent."""

EPISODES = 50
"""Episodes of a scenario where nobody says how many."""
SLOTS = 16
"""Worlds that one simulation drives side by side."""
CHUNK = 8
"""Seeds of a job: what a kill can cost a worker, and how finely workers share the work."""

ROWS, LENGTHS = "rows.jsonl", "shortest_paths.jsonl"
"""Files of a result folder that grow as the work goes on."""

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
T = TypeVar("T")
J = TypeVar("J")
R = TypeVar("R")
P = TypeVar("P", bound=Part)
World = tuple[str, int]
"""Label of a scenario and seed."""
Lengths = dict[World, list[float]]
"""Shortest paths [m] of the robots of each world."""


# ---------------------------------------------------------------------------------------------------------------------
# What to evaluate
# ---------------------------------------------------------------------------------------------------------------------


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
        return _checked(Suite, dict(source), "suite")
    if isinstance(source, str) and not _is_path(source):
        if source not in suite_names():
            known = ", ".join(suite_names())
            raise ScenarioError(f"no suite {source!r}{_nearest(source, suite_names())} (known: {known})")
        source = SUITE_FOLDER / f"{source}.yaml"
    path = Path(source).expanduser()
    data = _read_file(path)
    if isinstance(data.get("scenarios"), list):
        items = [item if isinstance(item, dict) else {"scenario": item} for item in data["scenarios"]]
        data["scenarios"] = [
            {**item, "scenario": str(path.parent / Path(item["scenario"]).expanduser())}
            if _is_path(item.get("scenario"))
            else item
            for item in items
        ]
    return _checked(Suite, data, path.name)


def _is_path(source: object) -> bool:
    return isinstance(source, str) and re.search(r"[/\\]|\.ya?ml$", source) is not None


def _checked(model: type[P], data: object, label: str) -> P:
    """The data as a part; errors name what it is of."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(_explain(error, label)) from None


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
            return cls.of(_checked(SuitePolicy, source, "policy"))
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
        policy: Policy = agents().make_policy(self.name, simulation, **self.parameters)
        return policy


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


def agents() -> ModuleType:
    """The table of policies."""
    return importlib.import_module(AGENTS)


def make_plan(
    policies: Any,
    scenario_or_suite: Any,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> Plan:
    """What to evaluate, from the arguments of `evaluate`, each policy tried once in each scenario.

    Raises:
        ValueError: an unknown name, a label that comes twice, or a policy that does not fit a scenario.
    """
    suite, name = _as_suite(scenario_or_suite)
    scenarios = []
    for item in suite.scenarios:
        scenario = load(item.scenario, {**item.overrides, **(overrides or {})})
        seeds = item.seeds or suite.seeds
        first, count = seeds.first if seed is None else seed, seeds.count if episodes is None else episodes
        if first < 0 or count < 1:
            raise ValueError(f"expected a seed from 0 on and at least one episode, got {first} and {count}")
        scenarios.append(ScenarioEntry(item.label or scenario.name, scenario, range(first, first + count)))
    if policies is None:
        policies = suite.policies or agents().policy_names()
    elif isinstance(policies, (str, Mapping)) or hasattr(policies, "predict"):
        policies = [policies]
    entries = [PolicyEntry.of(policy) for policy in policies]
    if not entries:
        raise ValueError("no policies to evaluate")
    _require_distinct("scenarios", [entry.label for entry in scenarios])
    _require_distinct("policies", [entry.label for entry in entries])
    return Plan(name, tuple(_rehearse(entries, scenarios)), tuple(scenarios))


def _as_suite(source: Any) -> tuple[Suite, str]:
    """A suite and its name for the manifest; one without a name for bare scenarios."""
    if isinstance(source, Path):
        source = str(source)
    if _is_suite(source):
        suite = load_suite(source)
        return suite, f"{suite.name} v{suite.version}"
    sources = source if isinstance(source, (list, tuple)) else [source]
    plain = [
        dump(item) if isinstance(item, Scenario) else str(item) if isinstance(item, Path) else item for item in sources
    ]
    return _checked(Suite, {"scenarios": [{"scenario": item} for item in plain]}, "scenarios"), ""


def _is_suite(source: Any) -> bool:
    if isinstance(source, str):
        return "scenarios" in _read_file(Path(source).expanduser()) if _is_path(source) else source in suite_names()
    return isinstance(source, Suite) or (isinstance(source, Mapping) and "scenarios" in source)


def _require_distinct(what: str, labels: Sequence[str]) -> None:
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ValueError(f"two {what} are called {twice[0]!r}: give them labels")


def _rehearse(entries: Sequence[PolicyEntry], scenarios: Sequence[ScenarioEntry]) -> list[PolicyEntry]:
    """One step of each policy in each scenario, before anything is written: what does not fit fails here.

    It also leaves compiled code in numba's cache, where workers find it. Policies that read the map are labelled so.
    """
    labelled = list(entries)
    for scenario in scenarios:
        for number, entry in enumerate(entries):
            rollout = Rollout(entry, scenario, scenario.seeds[:1])
            rollout.advance()
            if is_privileged(rollout.policy):
                labelled[number] = replace(entry, label=f"{entry.label} (privileged)")
    return labelled


def is_privileged(policy: Policy) -> bool:
    """Whether a policy reads the world's map."""
    return bool(getattr(policy, "privileged", False))


# ---------------------------------------------------------------------------------------------------------------------
# Driving
# ---------------------------------------------------------------------------------------------------------------------


class _OneByOne:
    """Asks a scripted policy robot by robot, so that each decision has a time of its own."""

    def __init__(self, policy: Policy, robots: int) -> None:
        self._policy = policy
        self._memories: list[tuple[Any, ...] | None] = [None] * robots

    def begin(self, robot: int) -> None:
        self._memories[robot] = None

    def memory(self, robot: int) -> Any:
        memories = self._memories[robot]
        return memories[0] if memories else None

    def decide(self, observation: F32, robots: NDArray[np.int64]) -> tuple[NDArray[Any], list[float]]:
        """Actions (k, ...) of some robots and the time that each decision took [s]."""
        actions, seconds = [], []
        for robot in robots:
            row, state = observation[robot], self._memories[robot]
            begin = perf_counter()
            action, state = self._policy.predict(row, state, deterministic=True)
            seconds.append(perf_counter() - begin)
            actions.append(action)
            self._memories[robot] = state
        return np.stack(actions), seconds


class _AllAtOnce:
    """Asks a policy for all robots in one call, as SB3's evaluate_policy does: its state may be of any form."""

    def __init__(self, policy: Policy, robots: int, fields: tuple[ObservationField, ...]) -> None:
        self._policy = policy
        self._state: tuple[Any, ...] | None = None
        self._starts = np.ones(robots, dtype=bool)
        self._fields = fields if isinstance(getattr(policy, "observation_space", None), gym.spaces.Dict) else None

    def begin(self, robot: int) -> None:
        self._starts[robot] = True

    def memory(self, robot: int) -> Any:
        # A recurrent policy's state is a tuple too: of arrays for all robots together.
        is_one_each = isinstance(self._state, tuple) and len(self._state) == len(self._starts)
        return self._state[robot] if is_one_each and self._state else None

    def decide(self, observation: F32, robots: NDArray[np.int64]) -> tuple[NDArray[Any], list[float]]:
        """Actions (k, ...) of some robots and each one's share of the time that the call took [s]."""
        batch = as_dict(observation, self._fields) if self._fields else observation
        begin = perf_counter()
        actions, self._state = self._policy.predict(batch, self._state, self._starts.copy(), deterministic=True)
        share = (perf_counter() - begin) / len(observation)
        self._starts[:] = False
        return actions[robots], [share] * len(robots)


@dataclass
class _Trace:
    """What is kept of one robot's episode while it runs."""

    points: list[list[float]]
    """Places x, y [m], one a step and the start."""
    goals: list[list[float]]
    """Places of a moving goal x, y [m], likewise."""
    seconds: list[float]
    """Time of each decision [s]."""


class Rollout:
    """Episodes of one policy, side by side in the rows of one Simulation; a row that has ended takes the next seed.

    Robots are numbered row by row: robot r of row n is n R + r. A row starts with its seed, so what happens in it does
    not depend on the other rows.

    Args:
        entry: the policy.
        scenario: the scenario.
        seeds: one a world.
        lengths: shortest paths that are known.
        slots: how many worlds at a time. A policy that reads the map gets one: it has to know whose map it reads.
    """

    def __init__(
        self,
        entry: PolicyEntry,
        scenario: ScenarioEntry,
        seeds: Sequence[int],
        *,
        lengths: Lengths | None = None,
        slots: int = SLOTS,
    ) -> None:
        self.entry, self.scenario = entry, scenario
        self._lengths = lengths or {}
        self.simulation = Simulation(scenario.scenario, min(slots, len(seeds)))
        self.policy = entry.make(self.simulation)
        if is_privileged(self.policy) and self.simulation.count > 1:
            self.simulation = Simulation(scenario.scenario)
            self.policy = entry.make(self.simulation)
        count, robots = self.simulation.count, self.simulation.robots
        one_by_one = isinstance(self.policy, ScriptedPolicy) and not is_privileged(self.policy)
        self._driver: _OneByOne | _AllAtOnce = (
            _OneByOne(self.policy, count * robots)
            if one_by_one
            else _AllAtOnce(self.policy, count * robots, self.simulation.fields)
        )
        drive = Sensors.of(scenario.scenario).drive
        self._discrete_actions = kinematics.discrete_actions(drive)
        self._standing = kinematics.steering(drive, (0.0, 0.0))
        self._seeds = iter(seeds)
        self._observation: F32 = np.zeros((count * robots, width(self.simulation.fields)), dtype=np.float32)
        self._actions = np.tile(self._standing, (count * robots, 1))
        self._going = np.zeros(count * robots, dtype=bool)
        self._traces: dict[int, _Trace] = {}
        self._ended: dict[int, list[EpisodeRow]] = {}
        for row in range(count):
            self._begin(row)

    @property
    def is_over(self) -> bool:
        """Whether all seeds have been driven."""
        return not self._going.any()

    def memory(self, robot: int = 0) -> Any:
        """The policy's memory of a robot, None where its state has another form."""
        return self._driver.memory(robot)

    def drawings(self) -> list[Drawing | None]:
        """What the policy shows of its mind for each robot of the first row."""
        draw = getattr(self.policy, "draw", None)
        memories = [self.memory(robot) for robot in range(self.simulation.robots)]
        return [None if draw is None or memory is None else draw(memory) for memory in memories]

    def verdict(self) -> str:
        """What the policy has decided in the first row, "" where nothing."""
        verdicts = [getattr(self.memory(robot), "verdict", "") for robot in range(self.simulation.robots)]
        return ", ".join(dict.fromkeys(filter(None, verdicts)))

    def worlds(self) -> Iterator[list[EpisodeRow]]:
        """Drives to the end; yields the rows of each world, one a robot, as it ends."""
        while not self.is_over:
            yield from self.advance()

    def advance(self) -> list[list[EpisodeRow]]:
        """One decision and one step in each world; the rows of the worlds that ended with it."""
        deciding = np.flatnonzero(self._going)
        actions, seconds = self._driver.decide(self._observation, deciding)
        is_number = actions.dtype.kind in "iu"
        self._actions[deciding] = self._discrete_actions[actions] if is_number else actions
        for robot, duration in zip(deciding.tolist(), seconds, strict=True):
            self._traces[robot].seconds.append(duration)
            verdict = getattr(self._driver.memory(robot), "verdict", "")
            if verdict:
                self._actions[robot] = self._standing
                self._end(robot, "gave_up", verdict)
        self._step()
        robots = self.simulation.robots
        over = [row for row, ended in self._ended.items() if len(ended) == robots]
        worlds = [sorted(self._ended.pop(row), key=lambda ended: ended.robot) for row in over]
        for row in over:
            self._begin(row)
        return worlds

    def _begin(self, row: int) -> None:
        """Start the next seed in a row; without one it stays as it is."""
        seed = next(self._seeds, None)
        if seed is None:
            return
        robots = self.simulation.robots
        first, end = row * robots, (row + 1) * robots
        self._observation[first:end] = self.simulation.reset(np.array([row]), [seed])[0]
        self._going[first:end] = True
        self._actions[first:end] = self._standing
        self._ended[row] = []
        for robot in range(first, end):
            self._driver.begin(robot)
            self._traces[robot] = _Trace([], [], [])
        self._record(range(first, end))

    def _record(self, robots: Iterable[int]) -> None:
        places = self.simulation.world.pose[:, :, :2].reshape(-1, 2).tolist()
        goals = self.simulation.world.goal.reshape(-1, 2).tolist() if self.scenario.has_moving_target else None
        for robot in robots:
            trace = self._traces[robot]
            trace.points.append(places[robot])
            if goals is not None:
                trace.goals.append(goals[robot])

    def _step(self) -> None:
        count, robots = self.simulation.count, self.simulation.robots
        rows = np.flatnonzero(self._going.reshape(count, robots).any(axis=1))
        if len(rows) == 0:
            return
        transition = self.simulation.step(self._actions.reshape(count, robots, 2)[rows], rows)
        self._observation.reshape(count, robots, -1)[rows] = transition.observation
        going = np.flatnonzero(self._going)
        self._record(going.tolist())
        outcomes = self.simulation.world.outcome.ravel()[going]
        for robot, outcome in zip(going.tolist(), outcomes.tolist(), strict=True):
            if outcome != kernels.RUNNING:
                self._end(robot, OUTCOMES[outcome], "")

    def _end(self, robot: int, outcome: str, verdict: str) -> None:
        """Keep the row of a robot whose episode has ended; its world may go on for others."""
        row, number = divmod(robot, self.simulation.robots)
        self._going[robot] = False
        trace, world = self._traces[robot], self.simulation.world
        info = {name: values[0, number] for name, values in self.simulation.info(np.array([row])).items()}
        seed, time, taken = int(world.seed[row]), float(info["time"]), float(info["path_length"])
        lengths = self._lengths.get((self.scenario.label, seed))
        shortest = lengths[number] if lengths else math.nan
        turns, turning = turns_and_turning(trace.points)
        success = outcome == "success"
        self._ended[row].append(
            EpisodeRow(
                policy=self.entry.label,
                scenario=self.scenario.label,
                seed=seed,
                robot=number,
                outcome=outcome,
                verdict=verdict,
                success=success,
                time=time,
                steps=int(world.steps[row]),
                path_length=taken,
                goal_distance=float(info["goal_distance"]),
                shortest_path_length=shortest,
                spl=spl(success=success, shortest=shortest, taken=taken),
                time_ratio=self._time_ratio(trace, time),
                min_clearance=float(info["min_clearance"]),
                turns=turns,
                total_turning=turning,
                decision_time_mean=float(np.mean(trace.seconds)),
                decision_time_p99=float(np.percentile(trace.seconds, 99.0)),
                decision_time_total=math.fsum(trace.seconds),
            )
        )

    def _time_ratio(self, trace: _Trace, time: float) -> float:
        """Earliest time of meeting the moving goal on a straight run, over the time taken."""
        if not trace.goals or time == 0.0:
            return math.nan
        settings = self.scenario.scenario
        times = settings.time.step * np.arange(len(trace.goals))
        speed, radius = settings.robot.max_speed, settings.goal.radius
        return earliest_intercept(trace.points[0], trace.goals, times, speed, capture_radius=radius) / time


def shortest_lengths(scenario: ScenarioEntry, seed: int) -> list[float]:
    """Shortest paths [m] of the robots of one world; NaN where a robot does not fit at its start or goal."""
    simulation = Simulation(scenario.scenario)
    simulation.reset(seeds=[seed])
    lengths = []
    for robot in range(simulation.robots):
        try:
            lengths.append(simulation.shortest_path(robot=robot).length)
        except ValueError:  # the goal may be nearer to a wall than the body: it is reached from beside it
            lengths.append(math.nan)
    return lengths


# ---------------------------------------------------------------------------------------------------------------------
# The result folder
# ---------------------------------------------------------------------------------------------------------------------


class ResultFolder:
    """Where the rows of one plan are kept as they come.

    Args:
        path: a folder that is missing or empty, or that of an earlier run of the same plan with policies by name.
        plan: what is evaluated.

    Raises:
        ValueError: the folder is of another run, or its files are damaged.
    """

    def __init__(self, path: str | os.PathLike[str], plan: Plan) -> None:
        self.path = Path(path)
        manifest_path, manifest = self.path / "manifest.json", plan.manifest()
        if manifest_path.exists():
            differences = list(_differences(_read_json(manifest_path), manifest))
            if differences:
                raise ValueError(f"{self.path} holds another run: {'; '.join(differences[:3])}")
            objects = [policy.label for policy in plan.policies if policy.policy is not None]
            if objects:
                raise ValueError(
                    f"{self.path} holds a run of {objects[0]}: nobody can tell whether it is the same object"
                )
        elif self.path.exists() and not _is_empty(self.path):
            raise ValueError(f"{self.path} holds something else, expected a new folder or that of an earlier run")
        else:
            self.path.mkdir(parents=True, exist_ok=True)
            with replaced_when_done(manifest_path) as partial:
                partial.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
        self.rows: list[EpisodeRow] = _read_lines(self.path / ROWS, EpisodeRow.from_dict)
        """Rows of the worlds that are done."""
        self.lengths: Lengths = dict(_read_lines(self.path / LENGTHS, _length_from_dict))
        """Shortest paths that are known."""
        self._drop_partial_world({scenario.label: scenario.scenario.robots.count for scenario in plan.scenarios})

    def _drop_partial_world(self, robots: Mapping[str, int]) -> None:
        """Rows of a world are written at once, its last robot last: a kill may have cut them short."""
        count = len(self.rows)
        while self.rows and self.rows[-1].robot + 1 != robots.get(self.rows[-1].scenario):
            self.rows.pop()
        if len(self.rows) < count:
            with replaced_when_done(self.path / ROWS) as partial:
                partial.write_text("".join(_line(row.as_dict()) for row in self.rows), encoding="utf-8")

    def add_rows(self, rows: Sequence[EpisodeRow]) -> None:
        """Keep the rows of one world; they are on the disk when this returns."""
        _append(self.path / ROWS, "".join(_line(row.as_dict()) for row in rows))

    def add_lengths(self, world: World, lengths: Sequence[float]) -> None:
        """Keep the shortest paths of one world."""
        # As text, because JSON has neither infinity nor NaN.
        record = {"scenario": world[0], "seed": world[1], "lengths": [repr(length) for length in lengths]}
        _append(self.path / LENGTHS, _line(record))


def _length_from_dict(record: Any) -> tuple[World, list[float]]:
    try:
        return (record["scenario"], record["seed"]), [float(length) for length in record["lengths"]]
    except (KeyError, TypeError) as error:
        raise ValueError(f"got {record!r}, expected scenario, seed and lengths") from error


def _line(record: Mapping[str, Any]) -> str:
    return json.dumps(record, allow_nan=False) + "\n"


def _append(path: Path, text: str) -> None:
    with path.open("ab") as file:
        file.write(text.encode())
        file.flush()
        os.fsync(file.fileno())


def _read_lines(path: Path, parse: Callable[[Any], T]) -> list[T]:
    """What a file holds, one JSON value a line; a last line that a kill has cut short is taken out of the file.

    Raises:
        ValueError: another line is damaged.
    """
    if not path.exists():
        return []
    *lines, torn = path.read_bytes().split(b"\n")
    values = []
    for number, line in enumerate(lines, start=1):
        try:
            values.append(parse(json.loads(line)))
        except ValueError as error:
            raise ValueError(f"{path}: line {number}: {error}") from None
    if torn:
        os.truncate(path, sum(len(line) + 1 for line in lines))
    return values


def _is_empty(folder: Path) -> bool:
    """Whether nobody has left anything in a folder, but for the beginning of a manifest."""
    return folder.is_dir() and all(".partial" in path.name for path in folder.iterdir())


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None


def _differences(there: Any, here: Any, key: str = "") -> Iterator[str]:
    """What differs between a manifest on disk and ours, by dotted key."""
    if isinstance(there, dict) and isinstance(here, dict):
        for name in dict.fromkeys([*there, *here]):
            yield from _differences(there.get(name), here.get(name), f"{key}.{name}".lstrip("."))
    elif there != here:
        texts = ("missing" if value is None else json.dumps(value) for value in (there, here))
        was, now = (text if len(text) <= 60 else f"{text[:57]}..." for text in texts)
        yield f"{key} was {was}, is now {now}"


# ---------------------------------------------------------------------------------------------------------------------
# evaluate
# ---------------------------------------------------------------------------------------------------------------------

Track = Callable[[Iterable[T], str, int], Iterable[T]]
"""Lets items through and shows how many of a total have come, under a title."""


class _Job(NamedTuple):
    """Some worlds to drive in with one policy."""

    policy: PolicyEntry
    scenario: ScenarioEntry
    seeds: tuple[int, ...]
    lengths: Lengths


def evaluate(
    policies: Any,
    scenario_or_suite: Any,
    episodes: int | None = None,
    seed: int | None = None,
    workers: int = 1,
    out: str | os.PathLike[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: bool = False,
) -> list[EpisodeRow]:
    """Drive policies through the same worlds and measure each episode.

    Args:
        policies: a list of names, (label, name, parameters), dicts with those keys, or objects with `predict`; one
            of them; or None for those of the suite, or all that are registered.
        scenario_or_suite: a scenario or a list of them, each a name, path, dict or Scenario; or a suite, likewise.
        episodes: worlds of each scenario; None: as many as the suite says, 50 without one.
        seed: of the first world, the others count up; None: as the suite says, 0 without one.
        workers: processes that share the work. Times of decisions are fair where each has a core of its own.
        out: a folder for the rows as they come, the summary and pictures. A run that was cut off goes on from it.
        overrides: values by dotted key that replace those of every scenario.
        progress: whether to show a bar on the terminal.

    Returns:
        One row an episode and robot, by scenario, policy, seed and robot.

    Raises:
        ValueError: an unknown name, a policy that does not fit, or `out` is of another run.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    plan = make_plan(policies, scenario_or_suite, episodes=episodes, seed=seed, overrides=overrides)
    folder = None if out is None else ResultFolder(out, plan)
    rows = [] if folder is None else list(folder.rows)
    with progress_bar(shown=progress) as track:
        missing = _missing(plan, rows)
        lengths = _shortest_lengths(missing, folder, workers, track)
        for world in _drive_missing(missing, lengths, workers, track):
            if folder is not None:
                folder.add_rows(world)
            rows.extend(world)
        rows = _in_order(plan, rows)
        if folder is not None:
            write_summary(folder.path, rows, summarise(rows))
            _draw_typical(plan, rows, folder.path / "pictures", workers, track)
    return rows


def _in_order(plan: Plan, rows: Sequence[EpisodeRow]) -> list[EpisodeRow]:
    scenarios = {entry.label: number for number, entry in enumerate(plan.scenarios)}
    policies = {entry.label: number for number, entry in enumerate(plan.policies)}
    return sorted(rows, key=lambda row: (scenarios[row.scenario], policies[row.policy], row.seed, row.robot))


def _missing(plan: Plan, rows: Sequence[EpisodeRow]) -> list[tuple[PolicyEntry, ScenarioEntry, list[int]]]:
    """Seeds without rows, by scenario and policy."""
    done = {(row.policy, row.scenario, row.seed) for row in rows}
    return [
        (policy, scenario, [seed for seed in scenario.seeds if (policy.label, scenario.label, seed) not in done])
        for scenario in plan.scenarios
        for policy in plan.policies
    ]


def _shortest_lengths(
    missing: Sequence[tuple[PolicyEntry, ScenarioEntry, list[int]]],
    folder: ResultFolder | None,
    workers: int,
    track: Track[Any],
) -> Lengths:
    """Shortest paths of all worlds to drive in, once a world; a moving target has none."""
    lengths = {} if folder is None else dict(folder.lengths)
    wanted = {
        (scenario.label, seed): scenario
        for _, scenario, seeds in missing
        for seed in seeds
        if not scenario.has_moving_target and (scenario.label, seed) not in lengths
    }
    found = _each(_shortest_length, [(scenario, seed) for (_, seed), scenario in wanted.items()], workers)
    for world, robots in track(found, "shortest paths", len(wanted)):
        if folder is not None:
            folder.add_lengths(world, robots)
        lengths[world] = robots
    return lengths


def _shortest_length(job: tuple[ScenarioEntry, int]) -> tuple[World, list[float]]:
    scenario, seed = job
    return (scenario.label, seed), shortest_lengths(scenario, seed)


def _drive_missing(
    missing: Sequence[tuple[PolicyEntry, ScenarioEntry, list[int]]], lengths: Lengths, workers: int, track: Track[Any]
) -> Iterable[list[EpisodeRow]]:
    """The rows of each missing world."""
    numbered = []
    for policy, scenario, seeds in missing:
        chunk = CHUNK if workers > 1 else len(seeds)
        for first in range(0, len(seeds), max(chunk, 1)):
            some = tuple(seeds[first : first + chunk])
            mine = {world: lengths[world] for seed in some if (world := (scenario.label, seed)) in lengths}
            numbered.append((first, _Job(policy, scenario, some, mine)))
    # The first seeds of all policies come first, so that what an interrupted run leaves can be compared.
    jobs = [job for _, job in sorted(numbered, key=lambda item: item[0])]
    worlds = itertools.chain.from_iterable(_each(_drive_lazily if workers == 1 else _drive, jobs, workers))
    return track(worlds, "episodes", sum(len(job.seeds) for job in jobs))


def _drive_lazily(job: _Job) -> Iterator[list[EpisodeRow]]:
    return Rollout(job.policy, job.scenario, job.seeds, lengths=job.lengths).worlds()


def _drive(job: _Job) -> list[list[EpisodeRow]]:
    return list(_drive_lazily(job))


def _each(function: Callable[[J], R], jobs: Sequence[J], workers: int) -> Iterator[R]:
    """What a function makes of each job, in order of arrival."""
    if workers == 1 or len(jobs) < 2:
        yield from map(function, jobs)
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=workers, return_as="generator_unordered")
        yield from parallel(delayed(function)(job) for job in jobs)


@contextmanager
def progress_bar(*, shown: bool) -> Iterator[Track[Any]]:
    """A way to show how far things are on the terminal, or not to."""
    if not shown:
        yield lambda items, title, total: items
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description:<14}"), BarColumn(), MofNCompleteColumn())
    times = (TextColumn("elapsed"), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
    with Progress(*columns, *times, console=Console(stderr=True)) as bar:
        yield lambda items, title, total: bar.track(items, total=total, description=title) if total else items


# ---------------------------------------------------------------------------------------------------------------------
# Pictures
# ---------------------------------------------------------------------------------------------------------------------


class _Picture(NamedTuple):
    """An episode to draw into a file."""

    policy: PolicyEntry
    scenario: ScenarioEntry
    seed: int
    path: Path


def _draw_typical(plan: Plan, rows: Sequence[EpisodeRow], folder: Path, workers: int, track: Track[Any]) -> None:
    """A picture of a typical episode of each policy in each scenario; those that are there already are kept."""
    try:
        load_pygame()
        load_pillow()
    except ImportError as error:
        logger.warning("no pictures: %s", error)
        return
    folder.mkdir(exist_ok=True)
    wanted = []
    for scenario, policy in itertools.product(plan.scenarios, plan.policies):
        mine = [row for row in rows if (row.scenario, row.policy) == (scenario.label, policy.label)]
        path = folder / (re.sub(r"[^\w.-]+", "_", f"{scenario.label}-{policy.label}") + ".png")
        if not path.exists():
            wanted.append(_Picture(policy, scenario, typical(mine).seed, path))
    for _ in track(_each(_draw, wanted, workers), "pictures", len(wanted)):
        pass


def typical(rows: Sequence[EpisodeRow]) -> EpisodeRow:
    """The success with the median path, or the first row where there is no success."""
    solved = sorted((row for row in rows if row.success), key=lambda row: row.path_length)
    return solved[(len(solved) - 1) // 2] if solved else rows[0]


def _draw(picture: _Picture) -> None:
    rollout = Rollout(picture.policy, picture.scenario, [picture.seed])
    save_png(picture.path, portrait(rollout, Canvas(rollout.simulation, title=picture.policy.label)))


def portrait(rollout: Rollout, canvas: Canvas) -> Frame:
    """Drive the rollout's first world to its end, and draw the whole path."""
    canvas.record()
    while not rollout.is_over:
        rollout.advance()
        canvas.record()
    return canvas.draw(rollout.drawings(), scan=False, note=rollout.verdict())


def film(rollout: Rollout, canvas: Canvas, *, every: int = 1) -> Iterator[Frame]:
    """Drive the rollout's first world to its end; a frame of the start, of every so many steps, and of the end.

    Raises:
        ValueError: `every` below 1.
    """
    if every < 1:
        raise ValueError(f"every must be at least 1, got {every}")
    yield canvas.draw(rollout.drawings(), note=rollout.verdict())
    while not rollout.is_over:
        for _ in range(every):
            if not rollout.is_over:
                rollout.advance()
                canvas.record()
        yield canvas.draw(rollout.drawings(), note=rollout.verdict())
