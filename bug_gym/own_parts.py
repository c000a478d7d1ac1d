"""Reward terms and observation fields of a scenario's own at work: functions over named arrays, one row a robot.

A function asks for arrays by the names of its arguments: `def near_wall(ranges): return -(ranges.min(axis=1) < 0.5)`.
It gets copies of them as ARRAYS says, and gives an array (n,) for a term, (n, *shape) for a field. It stands beside the
compiled step: it is called once after it, for all robots of all its worlds at once, so the same function serves one
env and thousands. Compiled by `numba.njit` it is called the same way.
"""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.config import Scenario
from bug_gym.naming import nearest_hint
from bug_gym.observation import Field
from bug_gym.references import kept_in_process
from bug_gym.schema.errors import ScenarioError, shortened
from bug_gym.schema.own import ObservationField, RewardTerm, required_function, told_function
from bug_gym.world import World

Rows = NDArray[np.int64]
Bools = NDArray[np.bool_]
Arrays = Mapping[str, NDArray[Any]]

ARRAYS = {
    "ranges": "(n, B) float32: what the scanner measures along each beam [m]",
    "observation": "(n, D) float32: what the robot observes, but for fields of one's own",
    "sensed_goal": "(n, 2) float32: the goal in the robot's frame, as it observes it [m]",
    "odometry": "(n, 3): the robot's own estimate of its pose, in the frame of the start [m, m, rad]",
    "pose": "(n, 3): where it truly is: x, y [m], heading [rad]",
    "velocity": "(n, 2): of its body [m/s, rad/s, or m/s]; 0 once it has arrived or touched something",
    "action": "(n, 2): the action of this step, cut to [-1, 1]; 0 where an episode begins",
    "goal": "(n, 2): where its goal is [m]",
    "goal_distance": "(n,): distance to the goal [m]",
    "path_length": "(n,): way so far [m]",
    "clearance": "(n,): least distance to an obstacle in this step [m]",
    "min_clearance": "(n,): the same of the episode so far [m]",
    "time": "(n,): since the start of the episode [s]",
    "steps": "(n,) int64: likewise, in steps",
    "outcome": "(n,) int64: code of the outcome, as task.OUTCOMES: 0 running, 1 success, 2 collision, 3 timeout, 4 ended",
    "robot": "(n,) int64: number of the robot in its world",
    "seed": "(n,) int64: seed of its world",
    "episode": "(n,) int64: number of the episode of that seed",
}
"""What a function may ask for: row n is a robot, (world, robot) in order. Numbers are float64 where nothing else stands."""

LAST = "last_"
"""Before the name of one of EARLIER: the same before the step; where an episode begins, as it is then."""
EARLIER = ("ranges", "sensed_goal", "odometry", "pose", "velocity", "action", "goal", "goal_distance", "clearance")
KNOWN = (*ARRAYS, *(LAST + name for name in EARLIER))

PER_ROBOT = {"action": "command"}
"""Arrays of a row under another name here; the others are named as in the row (kernels.FLOAT_ARRAYS, INT_ARRAYS)."""
PER_WORLD = ("time", "steps", "seed", "episode")


class OwnPart(NamedTuple):
    """A function with what it asks for."""

    told: str
    """What errors call it: "reward_terms.near_wall (my_module:near_wall)"."""
    function: Callable[..., Any]
    asks_for: tuple[str, ...]
    """Names of its arrays."""
    shape: tuple[int, ...]
    """Of its value for one robot."""
    shared: frozenset[str] = frozenset()
    """Names of arrays that others ask for, too: each gets a copy of its own, in which it may write."""
    weight: float = 1.0
    """What the function's value is multiplied by."""

    def value(self, arrays: Arrays, count: int) -> NDArray[np.float64]:
        """What the function gives for n robots (n, *shape), weighted.

        Raises:
            ValueError: something else than real numbers of that shape that are finite, weighted too.
        """
        try:
            with kept_in_process():
                value = self.function(
                    *(arrays[name].copy() if name in self.shared else arrays[name] for name in self.asks_for)
                )
        except BaseException as error:
            error.add_note(f"in {self.told}, called with {', '.join(self.asks_for)} of {count} robots")
            raise
        expected = (count, *self.shape)
        is_plain = isinstance(value, np.ndarray) and not isinstance(value, np.ma.MaskedArray)
        if not is_plain or value.dtype.kind not in "fiub":
            came = f"an array of {value.dtype}" if is_plain else type(value).__name__
            raise ValueError(f"{self.told} gave {came}, expected an array {expected} of real numbers")
        if value.shape != expected and not (value.shape == (count,) and self.shape == (1,)):
            raise ValueError(f"{self.told} gave an array of shape {value.shape}, expected {expected}")
        with np.errstate(over="ignore"):
            weighted: NDArray[np.float64] = self.weight * value.astype(np.float64)
        if not np.isfinite(weighted).all():
            robot = int(np.argwhere(~np.isfinite(weighted))[0, 0])
            came = f"{shortened(value[robot].tolist())} for row {robot}"
            times = (
                f", times its weight of {self.weight:g} beyond all numbers" if np.isfinite(value[robot]).all() else ""
            )
            raise ValueError(f"{self.told} gave {came}{times}, expected finite numbers")
        return weighted.reshape(expected)


def asks_for(scenario: Scenario, name: str) -> bool:
    """Whether a term or field of a scenario's own asks for an array, of this step or of the last one."""
    parts = [own_part(f"reward_terms.{key}", own, ()) for key, own in scenario.reward_terms.items()]
    parts += [own_part(f"observation_fields.{key}", own, own.shape) for key, own in scenario.observation_fields.items()]
    return any(asked.removeprefix(LAST) == name for part in parts for asked in part.asks_for)


class OwnParts:
    """All functions of a scenario over the worlds of a simulation.

    Args:
        scenario: whose `reward_terms` and `observation_fields` they are.
        world: the worlds.
        fields: of the observation.

    Raises:
        ScenarioError: a function that is only named and that nobody trusts, or one that asks for what is not there.
    """

    def __init__(self, scenario: Scenario, world: World, fields: tuple[Field, ...]) -> None:
        self._world = world
        self._terms = [own_part(f"reward_terms.{name}", own, ()) for name, own in scenario.reward_terms.items()]
        own_fields = scenario.observation_fields
        self._fields = [own_part(f"observation_fields.{name}", own, own.shape) for name, own in own_fields.items()]
        times = Counter(name for part in (*self._terms, *self._fields) for name in part.asks_for)
        shared = frozenset(name for name, count in times.items() if count > 1)
        weights = [own.weight for own in scenario.reward_terms.values()]
        self._terms = [
            part._replace(shared=shared, weight=weight) for part, weight in zip(self._terms, weights, strict=True)
        ]
        self._fields = [part._replace(shared=shared) for part in self._fields]
        places = {field.name: field for field in fields}
        self._places = [places[name] for name in own_fields]
        self._seen = {name: slice(places[name].begin, places[name].end) for name in ("ranges",)}
        self._seen["sensed_goal"] = slice(places["goal"].begin, places["goal"].end)
        self._seen["observation"] = slice(0, min((field.begin for field in self._places), default=fields[-1].end))
        self.term_names = tuple(scenario.reward_terms)
        asked = {name for part in (*self._terms, *self._fields) for name in part.asks_for}
        self._earlier = sorted(name for name in asked if name.startswith(LAST))
        self._now = sorted(asked - {*self._earlier})
        self._at_begin = {name for part in self._fields for name in part.asks_for}

    def before(self, rows: Rows) -> tuple[Bools, Arrays]:
        """What `after` wants to know of the time before a step: who is in play (n R,), and the arrays asked for."""
        in_play = self._world.array("outcome")[rows].ravel() == kernels.RUNNING
        return in_play, {name: self._array(name.removeprefix(LAST), rows) for name in self._earlier}

    def after(self, rows: Rows, before: tuple[Bools, Arrays]) -> None:
        """Add the terms of a step to the rewards, and fill the fields in."""
        in_play, earlier = before
        arrays = {**earlier, **{name: self._array(name, rows) for name in self._now}}
        robots, count = self._world.robots, len(in_play)
        if self._terms:
            own = np.empty((len(rows), robots, len(self._terms)))
            reward = self._world.array("reward")[rows]
            for number, term in enumerate(self._terms):
                value = np.where(in_play, term.value(arrays, count), 0.0).reshape(-1, robots)
                own[:, :, number] = value
                reward += value
            self._world.array("own_terms")[rows] = own.reshape(len(rows), -1)
            self._world.array("reward")[rows] = reward
        self._fill(rows, arrays, None)

    def begin(self, rows: Rows, which: Bools | None = None) -> None:
        """Fill the fields in where episodes begin, with no terms yet.

        Args:
            rows: numbers of the worlds (n,).
            which: robots (n R,) whose runs begin; None: all of them.
        """
        if which is None:
            self._world.array("own_terms")[rows] = 0.0
        else:
            own = self._world.array("own_terms")[rows].reshape(len(which), len(self._terms))
            own[which] = 0.0
            self._world.array("own_terms")[rows] = own.reshape(len(rows), -1)
        arrays = {name: self._array(name.removeprefix(LAST), rows) for name in self._at_begin}
        self._fill(rows, arrays, which)

    def _fill(self, rows: Rows, arrays: Arrays, which: Bools | None) -> None:
        robots, seen = self._world.robots, self._world.observation
        for part, field in zip(self._fields, self._places, strict=True):
            value = part.value(arrays, len(rows) * robots)
            cut = np.clip(value, field.low, field.high).astype(np.float32).reshape(len(rows), robots, -1)
            if which is not None:
                old = seen[rows, :, field.begin : field.end]
                cut = np.where(which.reshape(len(rows), robots, 1), cut, old)
            seen[rows, :, field.begin : field.end] = cut

    def told(self, row: int, robot: int) -> dict[str, float]:
        """The last terms of one robot by name."""
        count = len(self._terms)
        values = self._world.array("own_terms")[row, count * robot : count * (robot + 1)].tolist()
        return dict(zip(self.term_names, values, strict=True))

    def terms(self, rows: Rows) -> NDArray[np.float64]:
        """The last terms (n, R, terms) of the rows."""
        return self._world.array("own_terms")[rows].reshape(len(rows), self._world.robots, -1)

    def _array(self, name: str, rows: Rows) -> NDArray[Any]:
        """A named array (n R, ...) of the rows: a copy of its own, whose numbers lie one after the other."""
        world, count = self._world, len(rows) * self._world.robots
        if name in self._seen:
            part = world.observation[rows, :, self._seen[name]]
            return np.ascontiguousarray(part).reshape(count, -1)
        if name == "goal":
            return np.ascontiguousarray(world.goal[rows]).reshape(count, 2)
        if name == "robot":
            return np.tile(np.arange(world.robots), len(rows))
        if name in PER_WORLD:
            return np.repeat(world.array(name)[rows, 0], world.robots)
        values = world.array(PER_ROBOT.get(name, name))[rows]
        return values.reshape(count, -1) if values.shape[1] > world.robots else values.ravel()


def own_part(name: str, own: RewardTerm | ObservationField, shape: tuple[int, ...]) -> OwnPart:
    """A function of a scenario, ready to be called.

    Raises:
        ScenarioError: see `OwnParts`.
    """
    function = required_function(own, name)
    told = f"{name} ({told_function(own.function)})"
    return OwnPart(told, function, asked_names(function, told), shape)


def asked_names(function: Callable[..., Any], told: str) -> tuple[str, ...]:
    """The arrays that a function asks for: the names of its arguments, up to the first that has a value of its own.

    Raises:
        ScenarioError: a name of no array, or none at all.
    """
    try:
        parameters = [*inspect.signature(getattr(function, "py_func", function)).parameters.values()]
    except (TypeError, ValueError):
        parameters = []  # of some that are written in C
    names = []
    for parameter in parameters:
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        if parameter.default is not parameter.empty:
            continue
        if parameter.kind is parameter.KEYWORD_ONLY:
            came = f"{told} asks for {shortened(parameter.name)} by keyword alone"
            raise ScenarioError(f"{came}, expected arguments before the *, as arrays are handed over in their order")
        if parameter.name not in KNOWN:
            hint = nearest_hint(parameter.name, KNOWN)
            raise ScenarioError(f"{told} asks for {shortened(parameter.name)}{hint} (known: {', '.join(KNOWN)})")
        names.append(parameter.name)
    if not names:
        raise ScenarioError(f"{told} asks for no array by the name of an argument (known: {', '.join(KNOWN)})")
    return tuple(names)
