"""Tables for people and files for programs from the summaries of an evaluation.

On screen, in Markdown and in LaTeX: one table a scenario, one over all scenarios where there are several, and one of the
paired differences between policies. On disk: summary.json, summary.csv, differences.csv, summary.md and, for a paper,
summary.tex, each replaced as a whole, so that a reader never meets half a file.
"""

import csv
import io
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from math import isnan
from typing import TYPE_CHECKING, Any, NamedTuple

from bug_gym.evaluation.by_name import HEADER, RENDER_ONE
from bug_gym.evaluation.latex import latex_table
from bug_gym.evaluation.matrix import as_text, matrix, percent, told_interval
from bug_gym.evaluation.rows import EpisodeRow, json_fields
from bug_gym.evaluation.summary import OVERALL, PairedDifference, Summary
from bug_gym.evaluation.teams import TeamRow, team_differences, team_rows, team_tables
from bug_gym.evaluation.text_table import NOTHING, TextTable
from bug_gym.files import out_path, replaced_when_done

if TYPE_CHECKING:
    from rich.console import Console

FEWER_PAIRS = (
    "In round brackets: of how many pairs a difference is where it is not of all, as those of time, path and clearance are "
    "of pairs in which both arrived."
)
"""What a reader of the table of differences has to know."""

INTERVALS = (
    "Success with its 95 % Wilson interval, SPL's interquartile mean with a bootstrap interval. Differences are means "
    "over pairs with a bootstrap interval; p is of the exact McNemar test on success. " + FEWER_PAIRS
)
"""What a reader of all tables has to know."""

_COUNT = "n"
"""Name of the column with the number of episodes."""


def _iqm(summary: Summary) -> str:
    if isnan(summary.spl_iqm_low):
        return _number(summary.spl_iqm, 2)
    return f"{summary.spl_iqm:.2f} [{summary.spl_iqm_low:.2f}, {summary.spl_iqm_high:.2f}]"


def _gave_up(summary: Summary) -> str:
    verdicts = ", ".join(f"{verdict or 'no verdict'} {count}" for verdict, count in summary.verdicts.items())
    return f"{percent(summary.gave_up, summary.n)} ({verdicts})" if verdicts else NOTHING


class _Column(NamedTuple):
    """A column of the tables; on screen there is room for some only."""

    name: str
    cell: Callable[[Summary], str]
    on_screen: bool = True


COLUMNS = (
    _Column("policy", lambda summary: summary.policy),
    _Column(_COUNT, lambda summary: str(summary.n)),
    _Column("success [%]", told_interval),
    _Column("SPL", lambda summary: _number(summary.spl, 2)),
    _Column("SPL, IQM", _iqm, on_screen=False),
    _Column("path / shortest", lambda summary: _number(summary.path_ratio, 2)),
    _Column("earliest / time", lambda summary: _number(summary.time_ratio, 2)),
    _Column("time [s]", lambda summary: _number(summary.time, 1)),
    _Column("collided [%]", lambda summary: percent(summary.collision, summary.n)),
    _Column("timeouts [%]", lambda summary: percent(summary.timeout, summary.n), on_screen=False),
    _Column("gave up [%]", _gave_up, on_screen=False),
    _Column("decision [ms]", lambda summary: _number(1000.0 * summary.decision_time, 3)),
)


class _Measure(NamedTuple):
    """A field of the rows in which policies are compared, as a column of the table of differences."""

    field: str
    name: str
    scale: float
    digits: int
    on_screen: bool = True


MEASURES = (
    _Measure("success", "success [%]", 100.0, 1),
    _Measure("spl", "SPL", 1.0, 2),
    _Measure("time_ratio", "earliest / time", 1.0, 2),
    _Measure("time", "time [s]", 1.0, 1),
    _Measure("path_length", "path [m]", 1.0, 2, on_screen=False),
    _Measure("min_clearance", "clearance [m]", 1.0, 3, on_screen=False),
)


def print_table(summaries: Sequence[Summary], console: "Console") -> None:
    """Print a table a scenario, and one over all of them where there are several; 80 columns are enough.

    Where all lines have the same number of episodes, the title tells it.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    for title, header, lines in summary_tables(summaries, [column for column in COLUMNS if column.on_screen]):
        counts = {line[header.index(_COUNT)] for line in lines}
        if len(counts) == 1:
            title = f"{title}, {counts.pop()} episodes a policy"
            lines = [_without(line, header.index(_COUNT)) for line in lines]
            header = _without(header, header.index(_COUNT))
        # Text, not str: a name in square brackets is a name, not rich's markup.
        table = Table(title=Text(title), box=SIMPLE_HEAD, padding=0, pad_edge=False)
        table.add_column(header[0], overflow="fold")
        for name in header[1:]:
            # Two lines a header and no others: a narrow screen folds the names of policies, never a number.
            breaks = (name.replace(" [", "\n[").replace(" / ", slash) for slash in (" /\n", "\n/ "))
            narrow = min(breaks, key=lambda broken: max(map(len, broken.splitlines())))
            table.add_column(Text(narrow), justify="right", no_wrap=True)
        for line in lines:
            table.add_row(*(Text(cell) for cell in line))
        console.print(table)


def _without(cells: Sequence[str], number: int) -> list[str]:
    return [*cells[:number], *cells[number + 1 :]]


def print_differences(differences: Sequence[PairedDifference], console: "Console") -> None:
    """Print a table of the differences to the baseline, see `summary.compare`; nothing where there are none."""
    for title, header, lines in difference_tables(differences, [measure for measure in MEASURES if measure.on_screen]):
        print_text_table(title, header, lines, console)
        if any(cell.endswith(")") for line in lines for cell in line[1:]):
            console.print(FEWER_PAIRS, markup=False, highlight=False)


def print_text_table(title: str, header: Sequence[str], lines: Sequence[Sequence[str]], console: "Console") -> None:
    """Print a table of text as wide as it needs to be: a number is never folded."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.measure import Measurement
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for number, name in enumerate(header):
        table.add_column(Text(name), justify="left" if number == 0 else "right", no_wrap=True)
    for line in lines:
        table.add_row(*(Text(cell) for cell in line))
    wide = console.options.update(width=10_000)
    needed = Measurement.get(console, wide, table).maximum
    # A console as wide as the table: a terminal folds the lines, but every number is there.
    Console(file=console.file, width=max(console.width, needed)).print(table)


def write_summary(
    folder: str | os.PathLike[str],
    rows: Sequence[EpisodeRow],
    summaries: Sequence[Summary],
    differences: Sequence[PairedDifference] = (),
    named: Sequence[tuple[str, str]] | None = None,
) -> None:
    """Write summary.json (with the rows behind it), summary.csv, differences.csv, summary.md and .tex into a folder.

    The folder is made where it is missing. The JSON is strict: NaN is null, infinity the string "inf"; the CSV leaves a
    cell empty for NaN. Where robots share a world, teams.csv has a row an episode of all of them. Of names that commands take
    (`by_name.differing_names`) summary.md says how an episode is replayed.
    """
    tables = all_tables(summaries, differences, rows)
    contents = {
        "summary.json": _json(rows, summaries, differences),
        "summary.csv": _csv(Summary, [_flat(summary) for summary in summaries]),
        "differences.csv": _csv(PairedDifference, [difference.as_dict() for difference in differences]),
        "summary.md": _markdown(tables, named),
        "summary.tex": _latex([as_text(matrix(summaries)), *tables]),
    }
    if teams := team_rows(rows):
        contents["teams.csv"] = _csv(TeamRow, [json_fields(row) for row in teams])
    target = out_path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for name, text in contents.items():
        with replaced_when_done(target / name) as partial:
            partial.write_text(text, encoding="utf-8", newline="\n")


def summary_tables(summaries: Sequence[Summary], columns: Sequence[_Column] = COLUMNS) -> list[TextTable]:
    """A table a scenario, and one of all; a column in which nothing was measured is left out."""
    if not summaries:
        raise ValueError("no summaries to report")
    by_scenario: dict[str, list[Summary]] = {}
    for summary in summaries:
        by_scenario.setdefault(summary.scenario, []).append(summary)
    if len(by_scenario) == 2:
        by_scenario.pop(OVERALL, None)
    tables = []
    for scenario, members in by_scenario.items():
        filled = [[column.name, *(column.cell(member) for member in members)] for column in columns]
        tables.append(TextTable.of_columns("all scenarios" if scenario == OVERALL else scenario, filled))
    return tables


def difference_tables(differences: Sequence[PairedDifference], measures: Sequence[_Measure]) -> list[TextTable]:
    """The table of differences, one or none; a column without a value is left out."""
    policies = list(dict.fromkeys(difference.policy for difference in differences))
    if not policies:
        return []
    by_key = {(difference.policy, difference.field): difference for difference in differences}
    shares = [by_key[policy, "success"] for policy in policies]
    filled = [
        ["policy", *policies],
        ["pairs", *(str(share.n) for share in shares)],
        *(
            [one.name, *(told_difference(by_key[share.policy, one.field], one, share.n) for share in shares)]
            for one in measures
        ),
    ]
    filled.insert(3, ["p", *(f"{share.p_value:.2g}" for share in shares)])
    return [TextTable.of_columns(f"difference to {differences[0].baseline} in the same worlds", filled)]


def told_difference(difference: PairedDifference, measure: _Measure, pairs: int) -> str:
    """Mean and interval, and how many pairs they are of where these are others than the `pairs` of their line."""
    mean, low, high = (
        f"{measure.scale * value:+.{measure.digits}f}" for value in (difference.mean, difference.low, difference.high)
    )
    if isnan(difference.mean):
        return NOTHING
    told = mean if isnan(difference.low) else f"{mean} [{low}, {high}]"
    return told if difference.n == pairs else f"{told} ({difference.n})"


def _json(rows: Sequence[EpisodeRow], summaries: Sequence[Summary], differences: Sequence[PairedDifference]) -> str:
    data = {
        "summaries": [summary.as_dict() for summary in summaries],
        "differences": [difference.as_dict() for difference in differences],
        "rows": [row.as_dict() for row in rows],
    }
    return json.dumps(data, indent=2, allow_nan=False) + "\n"


def _flat(summary: Summary) -> dict[str, Any]:
    """A summary as one line of a CSV; verdicts as "unreachable:3 stuck:1"."""
    verdicts = " ".join(f"{verdict}:{count}" for verdict, count in summary.verdicts.items())
    return {**summary.as_dict(), "verdicts": verdicts}


def _csv(kind: type[Summary] | type[PairedDifference] | type[TeamRow], records: Sequence[Mapping[str, Any]]) -> str:
    """One line a record, under the names of the fields."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=[field.name for field in fields(kind)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()


def all_tables(
    summaries: Sequence[Summary], differences: Sequence[PairedDifference], rows: Sequence[EpisodeRow]
) -> list[TextTable]:
    """All tables of a summary, of teams too where robots share a world."""
    baseline = differences[0].baseline if differences else rows[0].policy if rows else ""
    tables = [*summary_tables(summaries), *difference_tables(differences, MEASURES)]
    return [*tables, *team_tables(rows), *team_differences(rows, baseline)]


def _latex(tables: Sequence[TextTable]) -> str:
    parts = [r"% Tables of an evaluation with bug_gym, for documents with \usepackage{booktabs}.", f"% {INTERVALS}"]
    return "\n\n".join([*parts, *map(latex_table, tables)]) + "\n"


def _markdown(tables: Sequence[TextTable], named: Sequence[tuple[str, str]] | None) -> str:
    parts = ["# Summary", INTERVALS]
    for title, header, lines in tables:
        parts += [f"## {_escape(title)}", _markdown_table(header, lines, ["--:"] * (len(header) - 1))]
    if named is not None:
        parts += ["## replays", f"Any episode of a policy and a scenario with a name is replayed by `{RENDER_ONE}`."]
    if named:
        parts += ["Where the command has other words than the tables:", _markdown_table(HEADER, named, [":--"])]
    return "\n\n".join(parts) + "\n"


def _markdown_table(header: Sequence[str], lines: Sequence[Sequence[str]], sides: Sequence[str]) -> str:
    """A table whose first column is text; the sides say how the others are set."""
    return "\n".join("| " + " | ".join(map(_escape, line)) + " |" for line in (header, [":--", *sides], *lines))


_SIGNS = re.compile(r"[\\`*<&~|]|(?<![^\W_])_|_(?![^\W_])")
"""What Markdown would take for a sign; an underscore within a word is none."""


def _escape(text: str) -> str:
    """Have a text stand in Markdown as it is, in one line, and keep a cell of a table one cell."""
    return _SIGNS.sub(r"\\\g<0>", " ".join(text.splitlines()))


def _number(value: float, digits: int) -> str:
    return NOTHING if isnan(value) else f"{value:.{digits}f}"
