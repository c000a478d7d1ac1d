"""One page of HTML about an evaluation: a file that needs no server, no network and nothing installed.

Tables and drawings stand in the page as they are, for those who read it without scripts; its script sorts and filters
them, makes the table of all episodes of the rows that are kept as JSON, and plays the episodes that were recorded, each of
which is unpacked when it is asked for. Texts are escaped (`markup`), and the page forbids itself to load anything
(Content-Security-Policy).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

import bug_gym
from bug_gym.evaluation.by_name import HEADER, RENDER_ONE, RENDER_SEVERAL
from bug_gym.evaluation.matrix import matrix
from bug_gym.evaluation.page.distributions import distributions
from bug_gym.evaluation.page.failures import end, failures
from bug_gym.evaluation.page.markup import Cell, Markup, element, joined, open_table, table
from bug_gym.evaluation.page.recorded import Key, Recorded, episodes_of
from bug_gym.evaluation.page.tables import differences_to_baseline, matrix_table, summaries_by_scenario
from bug_gym.evaluation.report import FEWER_PAIRS
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import PairedDifference, Summary, path_ratio
from bug_gym.evaluation.teams import team_differences, team_tables
from bug_gym.files import replaced_when_done
from bug_gym.replay.page import digest, part

PAGE = "report.html"
"""Name of the page in a results folder."""
PARTS = Path(__file__).parent
"""Where the template, the style and the script lie."""
LARGEST_WHOLE = 2**53
"""From here on a number of JavaScript is not every whole number: seeds are kept as text."""


class Section(NamedTuple):
    """A part of the page."""

    title: str
    told: str
    """What a reader has to know of it."""
    content: Markup


def write_page(
    path: Path,
    title: str,
    rows: Sequence[EpisodeRow],
    summaries: Sequence[Summary],
    differences: Sequence[PairedDifference] = (),
    replays: Mapping[Key, str] | None = None,
    first: Sequence[Section] = (),
    named: Sequence[tuple[str, str]] | None = None,
) -> None:
    """Write the page about some rows.

    Args:
        path: of the file, which is replaced as a whole.
        title: what was evaluated.
        rows: one an episode and robot; without any the page says nothing of them.
        summaries: what `summarise` makes of them.
        differences: what `compare` makes of them.
        replays: episodes that were recorded, packed, by policy, scenario and seed.
        first: what stands before all that.
        named: labels and what commands are given for them, see `by_name.differing_names`; None: nobody knows.

    Raises:
        ValueError: a path that cannot be written to.
    """
    text = page(title, rows, summaries, differences, replays, first, named)
    with replaced_when_done(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def page(
    title: str,
    rows: Sequence[EpisodeRow],
    summaries: Sequence[Summary],
    differences: Sequence[PairedDifference] = (),
    replays: Mapping[Key, str] | None = None,
    first: Sequence[Section] = (),
    named: Sequence[tuple[str, str]] | None = None,
) -> str:
    """The text of the page, see `write_page`."""
    recorded = Recorded(replays or {})
    keys = [*((row.policy, row.scenario) for row in rows), *((key[0], key[1]) for key in recorded.numbers)]
    policies, scenarios = _numbered(policy for policy, _ in keys), _numbered(scenario for _, scenario in keys)
    sections = list(first)
    if rows:
        sections += _about_rows(rows, summaries, differences, policies, scenarios, recorded, named)
    titles = [one.title for one in sections] + (["Episodes"] if rows else [])
    script = "\n".join([part("player.js"), _part("page.js")])
    return Template(_part("page.html")).substitute(
        title=joined([title]),
        subtitle=joined(["; ".join(filter(None, [_counts(rows), f"bug_gym {bug_gym.__version__}"]))]),
        nav=joined(joined([element("a", name.lower(), href=f"#{name.lower()}"), " "]) for name in titles),
        style=_part("page.css") + part("player.css"),
        sections=joined(map(_section, sections)),
        hidden="" if rows else "hidden",
        data=_embedded(_data(rows, policies, scenarios, recorded)),
        replays=episodes_of(recorded),
        script=script,
        digest=digest(script),
    )


def _about_rows(
    rows: Sequence[EpisodeRow],
    summaries: Sequence[Summary],
    differences: Sequence[PairedDifference],
    policies: Mapping[str, int],
    scenarios: Mapping[str, int],
    recorded: Recorded,
    named: Sequence[tuple[str, str]] | None,
) -> list[Section]:
    """What the page says of all episodes together."""
    return [
        Section(
            "Success",
            "Share of successes [%] with its 95 % Wilson interval, the best first; a cell leads to its failures. "
            "Policies marked (privileged) read the map.",
            matrix_table(matrix(summaries), scenarios, policies),
        ),
        Section(
            "Differences",
            "Means over pairs in the same worlds with a 95 % bootstrap interval; p is of the exact McNemar test on "
            f"success, not corrected for the number of comparisons. {FEWER_PAIRS}",
            differences_to_baseline(differences),
        ),
        *_teams(rows, differences),
        Section("Summaries", "Means; path, time and clearance are of successes.", summaries_by_scenario(summaries)),
        Section(
            "Distributions",
            "Of successes: the median, in brackets the middle half. Bars of a column share an axis, whose ends its name "
            "tells; what lies beyond stands in the last bar.",
            distributions(rows),
        ),
        Section(
            "Failures",
            joined(
                [
                    "With the seeds of their worlds",
                    "; a button replays the episode." if recorded.numbers else ".",
                    *([] if named is None else [" ", _told_commands(named)]),
                ]
            ),
            joined([*_names(named or ()), failures(rows, scenarios, policies, recorded.numbers)]),
        ),
    ]


def _told_commands(named: Sequence[tuple[str, str]]) -> Markup:
    """The commands that replay any episode that has names."""
    commands = [
        *("Any episode of a policy and a scenario with a name is replayed by ", element("code", RENDER_ONE)),
        *(", several policies side by side by ", element("code", RENDER_SEVERAL), "."),
    ]
    if named:
        commands.append(
            " Where the command has other words for a policy or a scenario than the tables, they stand here:"
        )
    return joined(commands)


def _names(named: Sequence[tuple[str, str]]) -> list[Markup]:
    """A table of what the command is given in the place of labels; nothing where it takes these."""
    if not named:
        return []
    return [table(HEADER, ([Cell(label), Cell(element("code", words))] for label, words in named), policy=None)]


def _teams(rows: Sequence[EpisodeRow], differences: Sequence[PairedDifference]) -> list[Section]:
    """What robots of one world did together; nothing where each robot is alone."""
    tables = team_tables(rows)
    if not tables:
        return []
    if differences:
        tables += team_differences(rows, differences[0].baseline)
    told = (
        "Robots that share a world have a mission together, which the share of successes counts. First and last: when the "
        "first robot arrived, and when all had; together: the ways of all; a deadlock: robots still under way when the time "
        "was up, and all of them standing."
    )
    return [Section("Teams", told, joined(open_table(*one) for one in tables))]


def _counts(rows: Sequence[EpisodeRow]) -> str:
    """How much the page is about, "" where it has no rows."""
    if not rows:
        return ""
    policies, scenarios = ({getattr(row, name) for row in rows} for name in ("policy", "scenario"))
    worlds = len({(row.scenario, row.seed) for row in rows})
    counts = (_told(len(policies), "policy", "policies"), _told(len(scenarios), "scenario"), _told(worlds, "world"))
    return f"{', '.join(counts)}, {_told(len(rows), 'episode')}"


def _numbered(labels: Any) -> dict[str, int]:
    return {label: number for number, label in enumerate(dict.fromkeys(labels))}


def _told(count: int, one: str, many: str = "") -> str:
    return f"{count:,} {one if count == 1 else many or f'{one}s'}"


def _section(one: Section) -> Markup:
    told = [element("p", one.told, class_="told")] if one.told else []
    return element("section", element("h2", one.title), *told, one.content, id=one.title.lower())


def _part(name: str) -> str:
    return (PARTS / name).read_text(encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------------------
# The rows, for the table of all episodes
# ---------------------------------------------------------------------------------------------------------------------

COLUMNS = (
    "policy",
    "scenario",
    "seed",
    "robot",
    "how",
    "time [s]",
    "path [m]",
    "path / shortest",
    "SPL",
    "clearance [m]",
)
"""Columns of the table of all episodes; policy, scenario and how are numbers in lists of names."""


def _data(
    rows: Sequence[EpisodeRow], policies: Mapping[str, int], scenarios: Mapping[str, int], recorded: Recorded
) -> dict[str, Any]:
    """What the script shows of every episode: names once, and a short list of numbers a row; and what was recorded."""
    ends = _numbered(map(end, rows))
    return {
        "columns": COLUMNS,
        "names": [list(policies), list(scenarios), None, None, list(ends)],
        "rows": [[policies[row.policy], scenarios[row.scenario], *_numbers(row, ends)] for row in rows],
        "replays": [
            [policies[policy], scenarios[scenario], _seed(seed)] for policy, scenario, seed in recorded.numbers
        ],
    }


def _numbers(row: EpisodeRow, ends: Mapping[str, int]) -> list[Any]:
    return [
        _seed(row.seed),
        row.robot,
        ends[end(row)],
        _short(row.time, 2),
        _short(row.path_length, 2),
        _short(path_ratio(row) if row.success else float("nan"), 3),
        _short(row.spl, 3),
        _short(row.min_clearance, 3),
    ]


def _seed(seed: int) -> int | str:
    return seed if seed < LARGEST_WHOLE else str(seed)


def _short(value: float, digits: int) -> float | int | None:
    """A number with few digits, or None for what JSON has no number for."""
    if not isfinite(value):
        return None
    rounded = round(value, digits)
    return int(rounded) if rounded == int(rounded) else rounded


def _embedded(data: Mapping[str, Any]) -> str:
    """JSON that can stand in a page: nothing in it closes the element."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
