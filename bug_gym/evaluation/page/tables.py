"""Matrix, summaries and paired differences as tables of the page; what stands in a cell is what the report says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bug_gym.evaluation.matrix import Matrix, told_interval
from bug_gym.evaluation.page.failures import mark
from bug_gym.evaluation.page.markup import Cell, Markup, element, joined, table, text_table
from bug_gym.evaluation.report import MEASURES, difference_tables, summary_tables
from bug_gym.evaluation.summary import PairedDifference, Summary
from bug_gym.evaluation.text_table import NOTHING

ALL = "all scenarios"
"""The column of the matrix over all scenarios."""


def matrix_table(whole: Matrix, scenarios: Mapping[str, int], policies: Mapping[str, int]) -> Markup:
    """The matrix, each cell coloured by the share of successes and leading to the failures behind it.

    Args:
        whole: the matrix.
        scenarios: numbers of the scenarios, by label.
        policies: likewise.
    """
    several = len(whole.scenarios) > 1
    lines = []
    for line in whole.lines:
        cells = [
            _share(cell, mark(scenarios[scenario], policies[line.policy]))
            for scenario, cell in zip(whole.scenarios, line.cells, strict=True)
        ]
        lines.append([Cell(line.policy), *([_share(line.overall, None)] if several else []), *cells])
    return table(["policy", *([ALL] if several else []), *whole.scenarios], lines)


def _share(summary: Summary | None, place: str | None) -> Cell:
    """The share of successes with its interval below it."""
    if summary is None:
        return Cell(NOTHING)
    share, interval = told_interval(summary).split(" ", 1)
    told = joined([element("b", share), " ", element("small", interval)])
    has_failed = place is not None and summary.success < 1.0
    return Cell(element("a", told, href=f"#{place}") if has_failed else told, share=summary.success)


def summaries_by_scenario(summaries: Sequence[Summary]) -> Markup:
    """A table a scenario, and one over all of them where there are several."""
    parts = summary_tables(summaries)
    return joined(
        element("details", element("summary", title), text_table(header, lines), open=len(parts) == 1)
        for title, header, lines in parts
    )


def differences_to_baseline(differences: Sequence[PairedDifference]) -> Markup:
    """A line a policy: mean differences to the baseline with their intervals, and McNemar's p of success."""
    if not differences:
        return element("p", "One policy alone: nothing to compare.")
    ((title, header, lines),) = difference_tables(differences, MEASURES)
    return joined([element("p", f"{title[0].upper()}{title[1:]}."), text_table(header, lines)])
