"""Episodes that did not succeed, by kind, with the seeds of their worlds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from bug_gym.evaluation.page.markup import Cell, Markup, element, table
from bug_gym.evaluation.page.recorded import Ended, Key, buttons, has_failed
from bug_gym.evaluation.rows import EpisodeRow

KINDS = {
    "success": "success",
    "collision": "collision",
    "timeout": "time was up",
    "ended": "another robot arrived",
    "gave_up": "gave up",
}
"""Outcomes, as the page calls them."""
SHOWN = 40
"""Letters of a list of seeds that are shown at once."""


def mark(scenario: int, policy: int) -> str:
    """The id of the first failure of a policy in a scenario, both by number."""
    return f"failed-{scenario}-{policy}"


def end(row: Ended) -> str:
    """How an episode ended, with the policy's verdict."""
    kind = KINDS.get(row.outcome, row.outcome)
    return f"{kind}: {row.verdict}" if row.verdict else kind


def failed(rows: Sequence[EpisodeRow]) -> dict[tuple[str, str], dict[str, list[EpisodeRow]]]:
    """Rows that failed by (scenario, policy) and kind."""
    found: dict[tuple[str, str], dict[str, list[EpisodeRow]]] = {}
    for row in rows:
        if has_failed(row):
            found.setdefault((row.scenario, row.policy), {}).setdefault(end(row), []).append(row)
    return found


def failures(
    rows: Sequence[EpisodeRow],
    scenarios: Mapping[str, int],
    policies: Mapping[str, int],
    replays: Mapping[Key, int] | None = None,
) -> Markup:
    """A table with a line for each scenario, policy and kind of failure.

    Args:
        rows: of all policies.
        scenarios: their numbers, by label.
        policies: likewise.
        replays: numbers of the episodes that were recorded; without them there is no column of buttons.
    """
    lines = []
    for (scenario, policy), kinds in failed(rows).items():
        place: str | None = mark(scenarios[scenario], policies[policy])
        for kind, mine in sorted(kinds.items(), key=lambda item: -len(item[1])):
            line = [Cell(scenario, mark=place), Cell(policy), Cell(kind), Cell(str(len(mine))), _seeds(mine)]
            if replays:
                line.append(Cell(buttons(((policy, scenario, row.seed) for row in mine), replays)))
            lines.append(line)
            place = None
    if not lines:
        return element("p", "Every episode succeeded.")
    header = ["scenario", "policy", "how", "episodes", "seeds", *(["replay"] if replays else [])]
    return table(header, lines, policy=1)


def _seeds(rows: Sequence[EpisodeRow]) -> Cell:
    told = told_seeds(row.seed for row in rows)
    if len(told) <= SHOWN:
        return Cell(told)
    start = told[:SHOWN].rpartition(", ")[0]
    return Cell(element("details", element("summary", f"{start}, ..."), told))


def told_seeds(seeds: Iterable[int]) -> str:
    """Seeds in order, neighbours as a range: "3 to 7, 9"."""
    ranges: list[list[int]] = []
    for seed in sorted(set(seeds)):
        if ranges and seed == ranges[-1][1] + 1:
            ranges[-1][1] = seed
        else:
            ranges.append([seed, seed])
    return ", ".join(_told_range(first, last) for first, last in ranges)


def _told_range(first: int, last: int) -> str:
    if first == last:
        return str(first)
    return f"{first}, {last}" if last == first + 1 else f"{first} to {last}"
