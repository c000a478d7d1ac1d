"""What stands before everything else in the page of a reproduction: its own tables, and episodes that can be watched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bug_gym.evaluation.page import Section
from bug_gym.evaluation.page.failures import end
from bug_gym.evaluation.page.markup import Cell, element, joined, open_table, table
from bug_gym.evaluation.page.recorded import Ended, Key, Recorded, buttons, has_failed

TextTable = tuple[str, Sequence[str], Sequence[Sequence[str]]]
"""Title, header and lines."""


def results(tables: Sequence[TextTable], notes: Sequence[str], holds: bool | None) -> Section:
    """The tables of a reproduction.

    Args:
        tables: what it found.
        notes: what has to be said beside them.
        holds: whether every claim that was checked holds; None: it claims nothing.
    """
    told = "" if holds is None else "Every claim that is checked holds." if holds else "NOT every claim holds."
    parts = [open_table(*one, policy=_policy_column(one[1])) for one in tables]
    told_beside = element("ul", *(element("li", note) for note in notes), class_="told")
    return Section("Results", told, joined([*parts, *([told_beside] if notes else [])]))


def _policy_column(header: Sequence[str]) -> int | None:
    return list(header).index("policy") if "policy" in header else None


def watched(episodes: Sequence[Ended], replays: Mapping[Key, str]) -> list[Section]:
    """The episodes that a page plays, in a table; nothing where there are none.

    Args:
        episodes: that the page is to play.
        replays: those that were recorded, packed.
    """
    lines, numbers = [], Recorded(replays).numbers
    for one in episodes:
        key = (one.policy, one.scenario, one.seed)
        if key in numbers:
            lines.append([Cell(one.scenario), Cell(one.policy), Cell(end(one)), Cell(buttons([key], numbers))])
    if not lines:
        return []
    told = (
        "The first failure of each kind, as the tables count failures, and who did better in the same world. "
        if any(has_failed(one) for one in episodes)
        else "Nothing failed: some typical episodes. "
    )
    told += "A button, which bears the seed of the world, plays the episode; another one can be set beside it."
    return [Section("Watch", told, table(["scenario", "policy", "how", "replay"], lines, policy=1))]
