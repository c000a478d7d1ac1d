"""Errors in plain words: what pydantic found, as a reader of the file would say it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from bug_gym.naming import nearest_hint
from bug_gym.schema.errors import shortened

EXPECTED = {
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "a number below {lt:g}",
    "less_than_equal": "at most {le:g}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "string_too_short": "text that is not empty",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "literal_error": "{expected}",
    "union_tag_invalid": "{expected_tags}",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
}
"""What is allowed, by pydantic's name of the error."""

PLAIN = ("constrained-float", "constrained-int", "constrained-str", "float", "int", "str", "bool")
"""What pydantic calls the branches of a value that may be of one plain type or another."""

LONGEST_KEY = 80
"""Characters of a key that are shown: an unknown one may be of any length."""

NAMES: dict[str, Callable[[], Iterable[str]]] = {}
"""The names of each discriminator, such as "family"; filled in where they are."""


def explain(error: ValidationError, label: str) -> str:
    """One line a fault: file, key, what came, what is allowed; of a value that may be one thing or another, each.

    A list that is too short because its entries are faulty is not told again: pydantic counts the good ones only.
    """
    details = error.errors()
    faulty = {detail["loc"][:depth] for detail in details for depth in range(len(detail["loc"]))}
    told = [one for one in details if not (one["type"] == "too_short" and one["loc"] in faulty)]
    faults: dict[tuple[str, str], list[str]] = {}
    for place, reason in map(fault, told):
        came, expected, allowed = reason.partition(", expected ")
        faults.setdefault((place, came + expected), []).append(allowed)
    return "\n".join(
        f"{label}: {place}{': ' * bool(place)}{came}{' or '.join(ways)}" for (place, came), ways in faults.items()
    )


def fault(detail: ErrorDetails) -> tuple[str, str]:
    """The key of a fault, "" for the whole, and what came and what is allowed."""
    context, came, kind = detail.get("ctx", {}), detail["input"], detail["type"]
    keys = _keys(detail["loc"])
    if kind == "scenario":
        key = ".".join(filter(None, [*keys, _cut(context["key"])]))
        return key, str(context["reason"])
    if "error" in context:  # what the code of a family from outside has raised
        return ".".join(keys), str(context["error"])
    known: tuple[str, ...] = ()
    if kind.startswith("union_tag"):
        discriminator = str(context["discriminator"]).strip("'")
        known = tuple(NAMES[discriminator]())
        keys.append(discriminator)
        if kind == "union_tag_not_found":
            return ".".join(keys), f"missing, expected one of {', '.join(known)}"
        came = context["tag"]
    elif kind == "literal_error":
        known = tuple(re.findall(r"'([^']+)'", context["expected"]))
    expected = EXPECTED[kind].format(**context) if kind in EXPECTED else detail["msg"]
    return ".".join(keys), f"got {shortened(came)}, expected {expected}{nearest_hint(came, known)}"


def _keys(location: tuple[int | str, ...]) -> list[str]:
    """The keys a reader sees: without the names of branches, which pydantic puts after the key of a union."""
    unions = ("world", "motion", "target_motion")
    if len(location) > 1 and location[-1] in PLAIN:
        location = location[:-1]
    pairs = zip(("", *location), location, strict=False)
    shown = [str(item) for before, item in pairs if before not in unions and not str(item).startswith("<")]
    return [_cut(key) for key in shown]


def _cut(key: str) -> str:
    return key if len(key) <= LONGEST_KEY else f"{key[:LONGEST_KEY]}..."
