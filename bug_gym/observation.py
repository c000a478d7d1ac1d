"""The fields of a scenario's observation, and their spaces.

The core writes one flat float32 vector a robot (kernels.observation); a Dict observation is that vector cut by these fields.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import gymnasium as gym
import numpy as np

from bug_gym import kernels
from bug_gym.checks import float32_numbers
from bug_gym.config import Scenario, ScenarioError
from bug_gym.geometry import F32
from bug_gym.world import World

SENSED = tuple(kernels.OBSERVATION)
"""Names of the fields that the core fills, whether a scenario has them or not; others are a scenario's own."""


@dataclass(frozen=True)
class Field:
    """One field of the observation: its place in the flat vector and its bounds."""

    name: str
    shape: tuple[int, ...]
    low: F32
    """Smallest values, of the field's shape."""
    high: F32
    """Largest values, of the field's shape."""
    begin: int
    """Index of its first element in the flat vector."""

    @property
    def end(self) -> int:
        """Index past its last element in the flat vector."""
        return self.begin + math.prod(self.shape)


def fields(scenario: Scenario) -> tuple[Field, ...]:
    """The fields of a robot's observation in a scenario, in the order of the flat vector.

    First those of kernels.OBSERVATION that have elements there, then the scenario's own `observation_fields`.

    Raises:
        ScenarioError: one of them has a name that the observation has already.
    """
    record = World.record_of(scenario).view(np.recarray)[0]
    result = []
    for name, (begin, shape) in kernels.observation_places(record).items():
        if math.prod(shape):
            low, high = (
                np.broadcast_to(np.asarray(bound, dtype=np.float32), shape).copy()
                for bound in kernels.OBSERVATION[name].bounds(record)
            )
            result.append(Field(name, shape, low, high, begin))
    for name, own in scenario.observation_fields.items():
        if name in SENSED:
            raise ScenarioError(
                f"observation_fields.{name}: this name is taken: the observation has such a field already"
            )
        result.append(Field(name, own.shape, *own.bounds, result[-1].end))
    return tuple(result)


def width(table: tuple[Field, ...]) -> int:
    """Length of the flat observation."""
    return table[-1].end


def dict_space(table: tuple[Field, ...]) -> gym.spaces.Dict:
    """The Dict space of the fields, in the order of the flat vector, so that to flatten it gives that vector."""
    # Of a plain mapping gymnasium would sort the names.
    return gym.spaces.Dict([(field.name, gym.spaces.Box(field.low, field.high, dtype=np.float32)) for field in table])


def flat_space(table: tuple[Field, ...]) -> gym.spaces.Box:
    """The Box space of the flat observation."""
    low = np.concatenate([field.low.ravel() for field in table])
    high = np.concatenate([field.high.ravel() for field in table])
    return gym.spaces.Box(low, high, dtype=np.float32)


def as_dict(flat: F32, table: tuple[Field, ...]) -> dict[str, F32]:
    """Cut flat observations (..., D) into fields (..., *shape); each is a copy of its own."""
    batch = flat.shape[:-1]
    return {field.name: flat[..., field.begin : field.end].reshape(batch + field.shape).copy() for field in table}


def as_flat(observation: Mapping[str, F32], table: tuple[Field, ...]) -> F32:
    """Join fields (..., *shape) into flat observations (..., D).

    Raises:
        ValueError: a field is missing, has another shape than the table says, or holds no real numbers.
    """
    parts = []
    for field in table:
        if field.name not in observation:
            raise ValueError(f"the observation lacks the field {field.name!r}; it has {sorted(observation)}")
        value = float32_numbers(f"field {field.name!r}", observation[field.name])
        batch = value.shape[: value.ndim - len(field.shape)]
        if value.shape[len(batch) :] != field.shape:
            raise ValueError(f"field {field.name!r} has shape {value.shape}, expected (..., {field.shape})")
        parts.append(value.reshape((*batch, -1)))
    return np.concatenate(parts, axis=-1)
