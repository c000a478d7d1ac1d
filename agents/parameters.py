"""What can be set of each policy: read from its `Parameters` dataclass, where each field stands with a sentence."""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints


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


@functools.cache
def _texts(own: type) -> dict[str, str]:
    """What is written under each field of a dataclass; a base class's word where the class repeats none."""
    found: dict[str, str] = {}
    for base in reversed(own.__mro__):
        if is_dataclass(base):
            found |= dict(_written(base))
    return found


def _written(own: type) -> Iterator[tuple[str, str]]:
    """Each field of one class that has a sentence under it, with that sentence on one line."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(own)))
    except (OSError, TypeError):  # typed in by hand, or run without its source
        return
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    for line, below in zip(body, body[1:], strict=False):
        if not (isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name)):
            continue
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) and isinstance(below.value.value, str):
            yield line.target.id, " ".join(below.value.value.split())


def _spelled(hint: Any) -> str:
    """A type as it is written."""
    if isinstance(hint, str):
        return hint
    if get_origin(hint) is Literal:
        return " | ".join(map(repr, get_args(hint)))
    if get_origin(hint) in (Union, UnionType):
        return " | ".join(_spelled(one) for one in get_args(hint))
    return "None" if hint is NoneType else getattr(hint, "__name__", str(hint))
