"""How `bug-gym render` is given what an evaluation drove: policies and scenarios by name, with their options.

Tables call them by labels, which leave things out: a suite's overrides, a policy's parameters, or the mark of those that read
the map is no part of a name.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bug_gym.agents.outside import Spec
from bug_gym.assignments import assignments

if TYPE_CHECKING:
    from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry

HEADER = ("in the tables", "in the command")
"""Of a table of `differing_names`."""
POLICY_OBJECT = "no name: an object or a class that was handed in"
SCENARIO_DATA = "no name: it, or an override, was handed in as data"
"""What stands in the place of a name that a command could take."""
RENDER_ONE = "bug-gym render POLICY SCENARIO --seed SEED --out race.html"
RENDER_SEVERAL = "bug-gym render SCENARIO --policies POLICY,POLICY --seed SEED --out race.html"


def differing_names(policies: Iterable[PolicyEntry], scenarios: Iterable[ScenarioEntry]) -> list[tuple[str, str]]:
    """Label and words of the command for each policy and scenario whose label is not what the command takes."""
    named = [(policy.label, policy_words(policy) or POLICY_OBJECT) for policy in policies]
    named += [(scenario.label, scenario.words or SCENARIO_DATA) for scenario in scenarios]
    return [(label, words) for label, words in named if label != words]


def policy_words(entry: PolicyEntry) -> str:
    """A policy as a shell hands it to a command; "" where it has no name, or parameters that no text can say."""
    if entry.policy is not None or entry.policy_class is not None:
        return ""
    pairs = _pairs(entry.parameters)
    if pairs is None:
        return ""
    text = ":".join([entry.name, *pairs])
    spec = Spec.of(text)
    said = spec.name == entry.name and _as_json(spec.options) == _as_json(dict(entry.parameters))
    return shlex.quote(text) if said else ""


def scenario_words(source: Any, overrides: Mapping[str, Any], *, trust: bool) -> str:
    """A scenario with its overrides as a shell hands it to a command; "" where it has no name, or they are no plain data.

    Args:
        source: as `load` takes it.
        overrides: values by dotted key.
        trust: whether the scenario names code, which is run only where it is trusted.
    """
    pairs = _pairs(overrides)
    if not isinstance(source, str) or pairs is None:
        return ""
    options = [word for pair in pairs for word in ("--set", pair)]
    return shlex.join([source, *options, *(["--trust"] if trust else [])])


def _pairs(values: Mapping[str, Any]) -> list[str] | None:
    """KEY=VALUE of each value, as short as it is read back; None where one cannot be."""
    pairs = [_pair(key, value) for key, value in values.items()]
    return None if None in pairs else [pair for pair in pairs if pair is not None]


def _pair(key: str, value: Any) -> str | None:
    expected = _as_json({key: value})
    texts: Sequence[str] = [*([value] if isinstance(value, str) else []), expected and json.dumps(value)]
    for text in texts if expected else ():
        try:
            if _as_json(assignments([f"{key}={text}"])) == expected:
                return f"{key}={text}"
        except ValueError:
            continue
    return None


def _as_json(value: Any) -> str:
    """As strict JSON, where 1 is not 1.0; "" of what it cannot hold."""
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        return ""
