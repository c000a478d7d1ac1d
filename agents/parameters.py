"""What can be set of each policy: read from its `Parameters` dataclass, where each field stands with a sentence."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from bug_gym.field_texts import texts_under_fields
from bug_gym.naming import nearest_hint
from bug_gym.schema.errors import shortened


@dataclass(frozen=True)
class AtMost:
    """A limit above which a number makes no sense, and would overflow what is computed of it; in an `Annotated`."""

    most: float


Length = Annotated[float, AtMost(1000.0)]
"""A length [m], a time [s] or a speed [m/s] of a policy's parameter."""
Weight = Annotated[float, AtMost(1e6)]
"""A weight of a policy's parameter."""


class Parameter(NamedTuple):
    """One parameter of a policy."""

    name: str
    """As `make_policy` takes it."""
    type: str
    """What it takes, such as "float | None", or its words, such as "'left' | 'right'"."""
    default: Any
    """What it is if nothing is given; where something must be given, dataclasses.MISSING (inspect's `empty` where a
    constructor says so)."""
    text: str
    """What it means, with its unit; empty where the source says nothing."""


def parameter_names(policy_class: type) -> list[str]:
    """Names of an algorithm's own parameters: those of its `Parameters` dataclass, or of its constructor."""
    own = _declared(policy_class)
    if own is not None:
        return [field.name for field in fields(own) if field.init]
    return [key for key in inspect.signature(policy_class).parameters if key not in ("sensors", "discrete")]


def parameters_of(policy_class: type) -> list[Parameter]:
    """An algorithm's own parameters, with what is written under each."""
    own = _declared(policy_class)
    if own is None:
        known = [inspect.signature(policy_class).parameters[name] for name in parameter_names(policy_class)]
        return [Parameter(one.name, _spelled(one.annotation), one.default, "") for one in known]
    hints, texts = get_type_hints(own), _texts(own)
    return [
        Parameter(field.name, _spelled(hints[field.name]), field.default, texts.get(field.name, ""))
        for field in fields(own)
        if field.init
    ]


def checked_parameters(policy_class: type, parameters: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Values of an algorithm's own parameters, of the types that its `Parameters` says, and within its limits.

    NumPy's numbers become Python's. What more must hold of a value the algorithm itself says. The parameters of a
    constructor of its own are not looked at.

    Args:
        policy_class: the algorithm.
        parameters: values by name; the names are known.
        where: what an error begins with.

    Raises:
        ValueError: a value of another type, or above its limit.
    """
    own = _declared(policy_class)
    if own is None:
        return dict(parameters)
    hints, texts = get_type_hints(own, include_extras=True), _texts(own)
    checked = {}
    for name, value in parameters.items():
        plain = value.item() if isinstance(value, np.generic) else value
        hint = hints[name]
        if get_origin(hint) is Literal and plain not in get_args(hint):
            words = list(get_args(hint))
            raise ValueError(
                f"{where}{name} must be one of {words}, got {shortened(plain)}{nearest_hint(plain, words)}"
            )
        most = min((one.most for one in _limits(hint)), default=math.inf)
        expected = f"{_spelled(get_type_hints(own)[name])}{'' if math.isinf(most) else f', at most {most:g}'}"
        try:
            checked[name] = TypeAdapter(hint, config=STRICT).validate_python(plain)
        except ValidationError:
            text = texts.get(name, "")
            about = f" ({text})" if text else ""
            raise ValueError(f"{where}{name}: got {shortened(plain)}, expected {expected}{about}") from None
        if isinstance(plain, (int, float)) and most < plain < math.inf:
            raise ValueError(f"{where}{name}: got {shortened(plain)}, expected {expected}")
    return checked


def require_numbers(
    own: Any, *, positive: Sequence[str] = (), not_negative: Sequence[str] = (), shares: Sequence[str] = ()
) -> None:
    """Check finite numbers among the fields of a policy's `Parameters`.

    Args:
        own: the parameters.
        positive: names of those above 0.
        not_negative: names of those from 0 on.
        shares: names of those that are shares of the robot's top speed.

    Raises:
        ValueError: another number.
    """
    for name in positive:
        value = getattr(own, name)
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be positive, got {shortened(value)}")
    for name in not_negative:
        value = getattr(own, name)
        if not (math.isfinite(value) and value >= 0.0):
            raise ValueError(f"{name} must not be negative, got {shortened(value)}")
    for name in shares:
        if getattr(own, name) > 1.0:
            raise ValueError(f"{name} is a share of the top speed, at most 1, got {shortened(getattr(own, name))}")


STRICT = ConfigDict(strict=True, arbitrary_types_allowed=True)
"""No text for a number, no number for text."""


def _parts(hint: Any) -> Iterator[Any]:
    """A type and those that it is made of."""
    yield hint
    for one in get_args(hint) if get_origin(hint) in (Union, UnionType, Annotated) else ():
        yield from _parts(one)


def _limits(hint: Any) -> Iterator[AtMost]:
    """The limits in a type."""
    for part in _parts(hint):
        yield from (one for one in getattr(part, "__metadata__", ()) if isinstance(one, AtMost))


def _declared(policy_class: type) -> type | None:
    """The `Parameters` of a class, or None where a constructor of its own, without them, says what can be set."""
    for base in policy_class.__mro__:
        if "Parameters" in vars(base):
            own: type = vars(base)["Parameters"]
            return own if is_dataclass(own) else None
        constructor = vars(base).get("__init__")
        if constructor is not None and not _takes_any(constructor):
            return None
    return None


def _takes_any(function: Any) -> bool:
    """Whether a function takes `**parameters`."""
    return any(one.kind is one.VAR_KEYWORD for one in inspect.signature(function).parameters.values())


def _texts(own: type) -> dict[str, str]:
    """What is written under each field of a dataclass; a base class's word where the class repeats none."""
    return texts_under_fields(base for base in reversed(own.__mro__) if is_dataclass(base))


def _spelled(hint: Any) -> str:
    """A type as it is written."""
    if isinstance(hint, str):
        return hint
    if get_origin(hint) is Literal:
        return " | ".join(map(repr, get_args(hint)))
    if get_origin(hint) in (Union, UnionType):
        return " | ".join(_spelled(one) for one in get_args(hint))
    return "None" if hint is NoneType else getattr(hint, "__name__", str(hint))
