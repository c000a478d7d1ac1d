"""Policy by scenario at a glance: the share of successes, the best over all scenarios first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from bug_gym.evaluation.summary import OVERALL, PRIVILEGED, Summary
from bug_gym.evaluation.text_table import NOTHING, TextTable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_FRAME = 4
"""Lines of a screen that the matrix leaves: its title, a blank line, and the shell's own."""


class Line(NamedTuple):
    """A policy's line of the matrix."""

    policy: str
    """Label of the policy."""
    overall: Summary | None
    """Over all scenarios; None where the policy did not drive in each of them."""
    cells: tuple[Summary | None, ...]
    """One a scenario; None where the policy did not drive."""

    @property
    def is_privileged(self) -> bool:
        """Whether the policy reads the map."""
        return self.policy.endswith(PRIVILEGED)


class Matrix(NamedTuple):
    """Policies by scenarios."""

    scenarios: tuple[str, ...]
    """Labels of the scenarios, in order of first appearance."""
    lines: tuple[Line, ...]
    """The most successful policy first; those that did not drive everywhere come after those that did."""


def matrix(summaries: Sequence[Summary]) -> Matrix:
    """The matrix of what `summarise` gives.

    Raises:
        ValueError: no summaries.
    """
    if not summaries:
        raise ValueError("no summaries to report")
    found = {(one.scenario, one.policy): one for one in summaries}
    scenarios = tuple(dict.fromkeys(one.scenario for one in summaries if one.scenario != OVERALL))
    policies = dict.fromkeys(one.policy for one in summaries)
    lines = [
        Line(policy, found.get((OVERALL, policy)), tuple(found.get((scenario, policy)) for scenario in scenarios))
        for policy in policies
    ]
    return Matrix(scenarios, tuple(sorted(lines, key=_merit, reverse=True)))


def _merit(line: Line) -> tuple[bool, float]:
    """Whether it drove everywhere, and its share of successes where it drove."""
    driven = [cell for cell in line.cells if cell is not None]
    episodes = sum(cell.n for cell in driven)
    return line.overall is not None, sum(cell.success * cell.n for cell in driven) / episodes if episodes else 0.0


def print_matrix(summaries: Sequence[Summary], console: Console) -> None:
    """Print the matrix on one screen where that can be: in several columns on a terminal that is low and wide."""
    from rich.columns import Columns
    from rich.console import Console as Screen
    from rich.measure import Measurement
    from rich.text import Text

    whole = matrix(summaries)
    wide = console.options.update(width=10_000)
    needed = Measurement.get(console, wide, _table(whole, whole.lines)).maximum
    pieces = _pieces(whole, room=max(console.height - _FRAME, 1), most=max(console.width // (needed + 2), 1))
    # Wide enough: a terminal folds a line that is longer than it is, but every number is there.
    screen = Screen(file=console.file, width=max(console.width, needed), force_terminal=console.is_terminal)
    screen.print(Text(_title(whole), style="bold"))
    tables = [_table(whole, lines) for lines in pieces]
    screen.print(tables[0] if len(tables) == 1 else Columns(tables, padding=(0, 1)))


def as_text(whole: Matrix) -> TextTable:
    """The matrix as a table; the intervals are those over all scenarios."""
    is_single = len(whole.scenarios) == 1
    header = ["policy", *whole.scenarios] if is_single else ["policy", "all scenarios", *whole.scenarios]
    lines = []
    for line in whole.lines:
        first, rest = (line.cells[0], ()) if is_single else (line.overall, line.cells)
        lines.append([line.policy, told_interval(first), *map(told_share, rest)])
    return TextTable(_title(whole), header, lines)


def _title(whole: Matrix) -> str:
    counts = {cell.n for line in whole.lines for cell in line.cells if cell is not None}
    least, most = min(counts), max(counts)
    episodes = f"{most} episode" if most == 1 else f"{f'{least} to ' if least < most else ''}{most} episodes"
    return f"success [%], {episodes} a cell; in brackets the 95 % interval"


def _pieces(whole: Matrix, *, room: int, most: int) -> list[tuple[Line, ...]]:
    """The lines in as many pieces as make them fit into a room of so many lines, or as there may be at most."""
    room = max(room - _header_height(whole), 1)
    count = min(-(-len(whole.lines) // room), most)
    height = -(-len(whole.lines) // count)
    return [whole.lines[start : start + height] for start in range(0, len(whole.lines), height)]


def _header_height(whole: Matrix) -> int:
    return 1 + max(_broken(scenario).count("\n") + 1 for scenario in whole.scenarios)


def _broken(name: str) -> str:
    """A name in short lines: a column should not be much wider than its numbers."""
    return name.replace("_", "_\n").replace(" ", "\n")


def _table(whole: Matrix, lines: Sequence[Line]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    _, (policy, first, *scenarios), cells = as_text(whole._replace(lines=tuple(lines)))
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    table.add_column(policy, no_wrap=True)
    # Text, not str: a name in square brackets is a name, not rich's markup.
    table.add_column(Text(first), justify="right", no_wrap=True)
    for scenario in scenarios:
        table.add_column(Text(_broken(scenario)), justify="right", no_wrap=True)
    for line in cells:
        table.add_row(*map(Text, line))
    return table


def told_share(summary: Summary | None) -> str:
    """The share of successes in percent, without its unit."""
    return NOTHING if summary is None else percent(summary.success, summary.n)


def told_interval(summary: Summary | None) -> str:
    """The share of successes in percent with its Wilson interval, without their unit."""
    if summary is None:
        return NOTHING
    low, high = (percent(bound, summary.n) for bound in (summary.success_low, summary.success_high))
    return f"{told_share(summary)} [{low}, {high}]"


def percent(share: float, n: int) -> str:
    """A share of n episodes in percent, with a decimal where rounding would hide a single episode."""
    return f"{100.0 * share:.{int(n >= 200)}f}"
