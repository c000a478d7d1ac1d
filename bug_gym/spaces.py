"""What the faces share: a robot's spaces, the forms of observations and actions, and checks of arguments."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypedDict

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from bug_gym.checks import checked_count, real_numbers, shortened
from bug_gym.config import Scenario
from bug_gym.geometry import F32
from bug_gym.kinematics import discrete_actions
from bug_gym.observation import as_dict, dict_space, flat_space
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES
from bug_gym.view import Sensors

ObservationForm = Literal["dict", "flat"]
ActionForm = Literal["continuous", "discrete"]
InfoForm = Literal["named", "numeric"]
Observation = Any  # F32, or F32 by field, as the env was made; a union would make every caller tell them apart
OUTCOME_CODES = {name: code for code, name in enumerate(OUTCOMES)}
FLOAT32 = np.dtype(np.float32)
ScenarioSource = str | Path | Mapping[str, Any] | Scenario
OwnTerms = Mapping[str, Any]  # of functions, references to some, or RewardTerms
OwnFields = Mapping[str, Any]  # of ObservationFields


class OwnArguments(TypedDict):
    """What the faces take beside a scenario and hand to `config.load`, which says what each is."""

    reward_terms: OwnTerms | None
    observation_fields: OwnFields | None
    trust: bool


class ActionBox(gym.spaces.Box):
    """A Box (2,) from -1 to 1 whose samples are those of any Box, value for value, in a fraction of the time.

    Gymnasium's own way sorts the bounds into four kinds at each sample, which takes longer than a step of the env.
    """

    def __init__(self, seed: int | np.random.Generator | None = None) -> None:
        super().__init__(-1.0, 1.0, (2,), dtype=np.float32, seed=seed)

    def sample(self, mask: None = None, probability: None = None) -> F32:
        """A uniform sample.

        Raises:
            gymnasium.error.Error: a mask or a probability, which no Box has.
        """
        if mask is not None or probability is not None:
            super().sample(mask, probability)
        return self.np_random.uniform(-1.0, 1.0, 2).astype(np.float32)


class RobotSpaces:
    """The spaces of one robot, and the way from them to the core's arrays and back.

    Args:
        simulation: the worlds that the robot lives in.
        observation_form: "dict" or "flat".
        action_form: "continuous" or "discrete".

    Raises:
        ValueError: another form than these.
    """

    def __init__(self, simulation: Simulation, observation_form: str, action_form: str) -> None:
        require_one_of("observation", observation_form, ("dict", "flat"))
        require_one_of("action", action_form, ("continuous", "discrete"))
        self.fields = simulation.fields
        self.is_flat = observation_form == "flat"
        self.is_discrete = action_form == "discrete"
        self.observation: gym.spaces.Space[Any]
        self.observation = flat_space(self.fields) if self.is_flat else dict_space(self.fields)
        self.action: gym.spaces.Space[Any] = ActionBox()
        self._table = discrete_actions(Sensors.of(simulation.scenario).drive).astype(np.float64)
        self._pairs: list[tuple[float, float]] = [(first, second) for first, second in self._table.tolist()]
        if self.is_discrete:
            self.action = gym.spaces.Discrete(len(self._table))
        # Most fields are vectors as they are cut; to shape each anew takes an eighth of the env's own step.
        self._parts = [
            (field.name, slice(field.begin, field.end), field.shape if len(field.shape) > 1 else None)
            for field in self.fields
        ]

    def present(self, flat: F32) -> Observation:
        """A flat observation (D,) of the core in the form of the observation space; the fields are views of it."""
        if self.is_flat:
            return flat
        fields: dict[str, F32] = {}
        for name, part, shape in self._parts:  # a comprehension is a call of its own in Python 3.11, 0.1 us
            fields[name] = flat[part] if shape is None else flat[part].reshape(shape)
        return fields

    def present_batch(self, flat: F32) -> Observation:
        """Flat observations (n, D) of the core in the form of the observation space; each field is a copy."""
        return flat if self.is_flat else as_dict(flat, self.fields)

    def velocity(self, action: Any) -> tuple[float, float]:
        """One action as the core takes it: what `velocities` gives, quickly for what is as the space draws it.

        Raises:
            ValueError: as `velocities`.
        """
        if self.is_discrete:
            if type(action) in (int, np.int64) and 0 <= action < len(self._pairs):
                pair: tuple[float, float] = self._pairs[action]
                return pair
        elif type(action) is np.ndarray and action.dtype is FLOAT32 and action.shape == (2,):
            first, second = action.tolist()
            return first, second
        first, second = self.velocities(action).tolist()
        return first, second

    def velocities(self, actions: ArrayLike, batch: tuple[int, ...] = ()) -> NDArray[np.float64]:
        """Actions of a batch (*batch, ...) as the core takes them (*batch, 2).

        Raises:
            ValueError: no numbers, another shape, or discrete actions that are no numbers of actions.
        """
        if not self.is_discrete:
            try:
                array = real_numbers("an action", actions)
            except ValueError:
                raise ValueError(f"an action is numbers of shape {(*batch, 2)}, got {actions!r}") from None
            if array.shape != (*batch, 2):
                raise ValueError(f"an action has shape {array.shape}, expected {(*batch, 2)}")
            return array
        numbers = np.asarray(actions)
        if numbers.shape != batch or numbers.dtype.kind not in "iu":
            raise ValueError(f"an action has shape {numbers.shape} of {numbers.dtype}, expected {batch} of integers")
        if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(self._table):
            raise ValueError(f"an action is an integer from 0 to {len(self._table) - 1}, got {actions!r}")
        chosen: NDArray[np.float64] = self._table[numbers]
        return chosen


def is_numeric(info_form: str) -> bool:
    """Whether infos hold numbers alone: codes of task.OUTCOMES, and each reward term under a key of its own.

    Raises:
        ValueError: no form of infos.
    """
    require_one_of("info", info_form, ("named", "numeric"))
    return info_form == "numeric"


def numeric_info(info: Mapping[str, Any]) -> dict[str, Any]:
    """The contract's info of one robot as numbers: what `with_codes` says."""
    return with_codes(info, OUTCOME_CODES[info["outcome"]])


def with_codes(info: Mapping[str, Any], codes: Any) -> dict[str, Any]:
    """The contract's info with `outcome` as code, and `reward_terms.progress` and its like instead of a dict in it.

    Args:
        info: of one robot, or as arrays of many.
        codes: of their outcomes.
    """
    flat = {name: value for name, value in info.items() if name != "reward_terms"} | {"outcome": codes}
    return flat | {f"reward_terms.{name}": value for name, value in info["reward_terms"].items()}


def told_draws(drawn: Mapping[str, Any]) -> dict[str, Any]:
    """What was drawn for an episode (or for many, as arrays) as an info tells it: `drawn.robot.max_speed` and so on."""
    return {f"drawn.{key}": value for key, value in drawn.items()}


OPTIONS = ("shortest_path", "drawn")
"""What a reset may be asked for."""


def asked_info(simulation: Simulation, options: Mapping[str, Any], row: int = 0, robot: int = 0) -> dict[str, Any]:
    """What the options of a reset ask of a robot beside its info: `shortest_path` and `drawn`."""
    told: dict[str, Any] = {}
    if options.get("shortest_path"):
        told["shortest_path_length"] = simulation.shortest_length(row, robot)
    if options.get("drawn"):
        told |= told_draws(simulation.drawn(row))
    return told


def require_one_of(name: str, value: object, known: tuple[object, ...]) -> None:
    """Raise a ValueError where an argument has none of the values that it may have."""
    if value not in known:
        raise ValueError(f"{name} is one of {', '.join(map(repr, known))}, got {shortened(value)}")


def require_one_robot(simulation: Simulation) -> None:
    """Raise a ValueError where a scenario has several robots."""
    if simulation.robots != 1:
        raise ValueError(
            f"scenario {simulation.scenario.name!r} has {simulation.robots} robots, expected 1: "
            "several robots are for bug_gym.parallel_env"
        )


def with_most_steps(scenario: Scenario, most: int | None) -> Scenario:
    """The scenario's worlds with a time limit of at most so many steps; None: as it is.

    Raises:
        ValueError: no integer from 1 on.
    """
    if most is None or scenario.time.steps <= checked_count("the number of steps", most):
        return scenario
    return scenario.cut_off(most * scenario.time.step)
