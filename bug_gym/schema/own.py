"""Reward terms and observation fields of a scenario's own: functions over named arrays, one row a robot.

A function is handed in itself, or named as "module:function" or "file.py:function". A name is only text until somebody
trusts it (`trusted`): to import it runs the code of its module.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, PlainValidator, model_validator

from bug_gym.references import from_anywhere, imported, is_reference, reference_of
from bug_gym.schema.errors import ScenarioError, shortened, wrong
from bug_gym.schema.values import AtLeastOne, Part, Weight

MOST_NUMBERS = 100_000
"""Numbers of a field for each robot, as beams of a scan."""
MOST_FLOAT32 = float(np.finfo(np.float32).max)
"""What is observed is float32; what lies beyond would be infinite."""


class Trusted:
    """A function behind a reference that somebody trusts: imported when it is made, and again where it is unpickled.

    Args:
        reference: "module:function" or "file.py:function".
        told: what an error calls it.

    Raises:
        ScenarioError: nothing that can be called lies there.
        ImportError: the module imports another one that is missing.
    """

    def __init__(self, reference: str, told: str) -> None:
        self.reference, self.told = from_anywhere(reference), told
        try:
            found = imported(self.reference, "function")
        except ValueError as error:
            raise ScenarioError(f"{told}: {error}") from None
        if not callable(found):
            raise ScenarioError(f"{told}: {reference} is no function: got {shortened(found)}")
        self.function: Callable[..., Any] = found

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled by name, so that a process that has not imported the module does."""
        return Trusted, (self.reference, self.told)

    def __eq__(self, other: object) -> bool:
        """Whether it is the same place."""
        return isinstance(other, Trusted) and self.reference == other.reference

    def __hash__(self) -> int:
        """Of the place."""
        return hash(self.reference)


def _function(value: object) -> object:
    if isinstance(value, str):
        if not is_reference(value):
            raise wrong(f"got {shortened(value)}, expected module:function or file.py:function")
        return value
    if not (isinstance(value, Trusted) or callable(value)):
        raise wrong(f"got {shortened(value)}, expected a function, or text such as my_module:my_function")
    return value


def told_function(function: Any) -> str:
    """A function as text: "module:function"."""
    if isinstance(function, str):
        return function
    return function.reference if isinstance(function, Trusted) else reference_of(function)


Function = Annotated[Any, PlainValidator(_function), PlainSerializer(told_function, when_used="json")]
"""A function itself, or where it is."""


class RewardTerm(Part):
    """A term of the reward of one's own; its function alone is enough."""

    function: Function
    """What gives the term of each robot (n,), from the arrays that its arguments name."""
    weight: Weight = 1.0
    """What the term is multiplied by [1]."""

    @model_validator(mode="before")
    @classmethod
    def _a_function_is_enough(cls, data: object) -> object:
        return data if isinstance(data, (Mapping, RewardTerm)) else {"function": data}


Bound = Any  # a number, or lists of numbers as deep as the field's shape
"""Smallest or largest value of a field: one for all its numbers, or one for each."""


def _bound(value: object) -> object:
    """A bound as plain numbers, which JSON can hold."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if isinstance(value, (str, bool)) or not (np.abs(array) <= MOST_FLOAT32).all():
        raise wrong(
            f"got {shortened(value)}, expected a finite number of float32, or lists of them of the field's shape"
        )
    return _as_tuples(array.tolist())


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


class ObservationField(Part):
    """A field of the observation of one's own."""

    function: Function
    """What gives the field of each robot (n, *shape), from the arrays that its arguments name."""
    shape: Annotated[tuple[AtLeastOne, ...], Field(min_length=1, max_length=4)] = (1,)
    """Its shape for one robot."""
    low: Annotated[Bound, BeforeValidator(_bound)]
    """Smallest values: a number, or lists of the field's shape; what the function gives is cut to it."""
    high: Annotated[Bound, BeforeValidator(_bound)]
    """Largest values, likewise."""

    @model_validator(mode="after")
    def _bounds_fit(self) -> Self:
        if math.prod(self.shape) > MOST_NUMBERS:
            raise wrong(f"got {list(self.shape)}, expected at most {MOST_NUMBERS:,} numbers", "shape")
        for key in ("low", "high"):
            came = np.shape(getattr(self, key))
            if came not in ((), self.shape):
                raise wrong(f"got bounds of shape {came}, expected a number, or numbers of shape {self.shape}", key)
        low, high = self.bounds
        if not (low <= high).all():
            raise wrong(f"got {shortened(self.low)} above high {shortened(self.high)}", "low")
        return self

    @property
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Smallest and largest values, of the field's shape."""
        low, high = (np.asarray(bound, dtype=np.float32) for bound in (self.low, self.high))
        return np.broadcast_to(low, self.shape).copy(), np.broadcast_to(high, self.shape).copy()


def _name(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z]\w{0,79}", value):  # Gymnasium's infos have a mask of their rows under "_name"
        raise wrong(f"got {shortened(value)}, expected a name of letters, digits and underscores, a letter first")
    return value


Name = Annotated[str, AfterValidator(_name)]


class Named(dict[str, Any]):
    """Parts by name, in their order, as a part of a frozen model: nobody changes them, so they have a hash."""

    def __hash__(self) -> int:  # type: ignore[override]
        """Of the parts and their names."""
        return hash(tuple(self.items()))


RewardTerms = Annotated[dict[Name, RewardTerm], AfterValidator(Named)]
ObservationFields = Annotated[dict[Name, ObservationField], AfterValidator(Named)]

OWN_PARTS: Mapping[str, type[RewardTerm] | type[ObservationField]] = {
    "reward_terms": RewardTerm,
    "observation_fields": ObservationField,
}
"""Keys of a scenario that hold functions, and what each of their values is."""


def trusted(own: RewardTerm | ObservationField, told: str) -> RewardTerm | ObservationField:
    """The same with its function imported, where it is only named.

    Args:
        own: of a scenario that somebody trusts.
        told: what an error calls it.

    Raises:
        ScenarioError: no such function.
        ImportError: its module imports another one that is missing.
    """
    if not isinstance(own.function, str):
        return own
    return own.model_copy(update={"function": Trusted(own.function, told)})


def required_function(own: RewardTerm | ObservationField, told: str) -> Callable[..., Any]:
    """The function of a part.

    Raises:
        ScenarioError: it is only named, and nobody has trusted the name.
    """
    if isinstance(own.function, str):
        why = "to import it runs its code: pass trust=True (--trust) if you know where it comes from"
        raise ScenarioError(f"{told} is the code {own.function}; {why}")
    function: Callable[..., Any] = own.function.function if isinstance(own.function, Trusted) else own.function
    return function
