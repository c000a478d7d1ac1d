"""How policies fare: every record of a success in docs/results/*.json that names its policy and its interval."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from bug_gym.agents import AGENTS, TEAMS

RESULTS = Path(__file__).parents[1] / "results"
BOARD = RESULTS / "board"
"""Entries of the leaderboard, one a file: see docs/make_entry.py."""

LEFT_OUT = {"ppo-curve", "hd-bug-ablation"}
"""Results of parts of a policy, or of one that is still being trained."""

LEFT_TO_THEIR_PAGE = {"ring", "ranges", "(all)"}
"""Words of records that no line can tell: no one can arrive in a ring; a sweep of ranges is a curve; sums over worlds."""

SAID = {
    "hd-bug-tables": "field, range {0}, {1} obstacles",
    "barn": "BARN, robot {0}",
    "dynabarn": "DynaBARN",
    "hd-bug-traps": "{0}",
    "hd-bug-targets": "target: {0}",
}
"""What the words about its worlds mean, of results whose words are short."""

PARTS = {"Traps": "traps", "Mazes": "mazes", "policies": "", "models": "", "results": "", "summaries": ""}
"""Keys on the way to a record -> what they say of its worlds; other words stand for themselves."""


class Fare(NamedTuple):
    """How one policy did in one kind of world."""

    result: str
    """Name of the reproduction."""
    worlds: str
    """What kind of world."""
    policy: str
    """Name in the table of agents."""
    variant: str
    """What was said of it beside its name."""
    n: int
    """Number of worlds."""
    success: float
    """Share that was reached."""
    low: float
    high: float
    """The 95 % interval of that."""
    path_ratio: float | None
    """Mean path over the shortest one, of those that were reached."""
    time: float | None
    """Mean time of those [s]."""


def fares() -> list[Fare]:
    """All that the results say, in the order of their names."""
    found = []
    for path in sorted(RESULTS.glob("*.json")):
        if path.stem not in LEFT_OUT:
            found += _of(path.stem, json.loads(path.read_text(encoding="utf-8")), ())
    return found


def _of(result: str, value: Any, way: tuple[str, ...]) -> Iterator[Fare]:
    """The records in a value; those in lists of numbers have no name for their worlds and are left to their page."""
    if isinstance(value, dict) and "success" in value:
        fare = _fare(result, value, way)
        if fare is not None:
            yield fare
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _of(result, inner, (*way, key))
    elif isinstance(value, list) and way[-1:] == ("summaries",):
        for inner in value:
            yield from _of(result, inner, (inner["scenario"], inner["policy"]))


def _fare(result: str, record: dict[str, Any], way: tuple[str, ...]) -> Fare | None:
    """A record as a Fare; None where it names no policy or no interval."""
    words = [word for part in way for word in re.split(r", ", PARTS.get(part, part)) if word]
    named = [(place, *_policy(word)) for place, word in enumerate(words) if _policy(word)[0]]
    low, high = _interval(record)
    if len(named) != 1 or low is None or high is None or LEFT_TO_THEIR_PAGE & {*words}:
        return None
    place, policy, before = named[0]
    # Of a table by policy first, what follows is the kind of world; else what follows is said of the policy.
    by_policy = place == 0 and way[0] in ("models", "policies")
    worlds = words[1:] if by_policy else [*words[:place], before]
    variant = [] if by_policy else words[place + 1 :]
    told = [word for word in worlds if word]
    where = SAID[result].format(*told) if result in SAID else ", ".join(told)
    n = int(record.get("n", record.get("worlds", 0)))
    return Fare(
        result, where, policy, ", ".join(variant), n, record["success"], low, high,
        record.get("path_ratio"), record.get("time"),
    )  # fmt: skip


def _policy(word: str) -> tuple[str, str]:
    """The policy that a word names, and what stands before it ("holonomic bug1")."""
    *before, last = word.split(" ")
    return (last, " ".join(before)) if last in AGENTS | TEAMS else ("", "")


def _interval(record: dict[str, Any]) -> tuple[float | None, float | None]:
    """The 95 % interval of the success, by whichever of its names."""
    if "success_interval" in record:
        low, high = record["success_interval"]
        return low, high
    for begin in ("success_", ""):
        if f"{begin}low" in record:
            return record[f"{begin}low"], record[f"{begin}high"]
    return None, None
