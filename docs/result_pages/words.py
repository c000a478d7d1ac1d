"""Numbers as words of a page: shares, intervals, lists, tables in Markdown, and the line of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bug_gym.intervals import exact_mcnemar
from result_pages import Record


def percent(share: float) -> str:
    """A share in percent, as many digits as it has."""
    return f"{100 * share:.4g}"


def between(low: float, high: float) -> str:
    """An interval of shares in percent."""
    return f"{100 * low:.1f} - {100 * high:.1f}"


def share(one: Record) -> str:
    """Success in percent with its 95 % interval."""
    return f"{percent(one['success'])} ({between(*one['success_interval'])})"


def number(value: float | None, digits: int = 2) -> str:
    """A number; a dash for none."""
    return "-" if value is None else f"{value:,.{digits}f}"


def listed(values: Iterable[str]) -> str:
    """Some words in a row: a, b and c."""
    *some, last = values
    return f"{', '.join(some)} and {last}" if some else last


def code(names: Iterable[str]) -> str:
    """Names in a row, set as code."""
    return listed(f"`{name}`" for name in names)


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown under its title."""
    lines = [header, ["---"] * len(header), *rows]
    return f"**{title}**\n\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def picture(name: str, says: str) -> str:
    """A picture beside the page."""
    return f"![{says}]({name}.png)"


RUN_HEADER = (
    *("worlds", "reached [%] (95 %)", "other ends", "time [s]", "path [m]", "path / shortest", "turns"),
    *("a decision [ms]", "99 % [ms]", "a run [s]"),
)
RUN_NOTE = (
    "Time, path, ratio and turns are means over the worlds reached. A decision, the 99 % of decisions that are quicker, "
    "and all decisions of a run are times on the machine of that run, as busy as it then was."
)


def run(one: Record) -> list[str]:
    """The cells of RUN_HEADER of the episodes of one policy in one kind of world."""
    others = ", ".join(f"{count} {end.replace('_', ' ')}" for end, count in one["outcomes"].items() if end != "success")
    return [
        str(one["n"]),
        share(one),
        others or "-",
        number(one["time"]),
        number(one["path_length"]),
        number(one["path_ratio"], 4),
        number(one["turns"], 1),
        *(number(1e3 * one[f"decision_time_{kind}"]) for kind in ("mean", "p99")),
        number(one["decision_time_total"]),
    ]


def only_one(mine: Record, other: Record) -> tuple[int, int]:
    """In how many worlds only the first arrives, and only the other."""
    missed, others = ({tuple(world) for world in one["missed_seeds"]} for one in (mine, other))
    return len(others - missed), len(missed - others)


def p_value(mine: Record, other: Record) -> str:
    """Exact McNemar's p that both arrive equally often."""
    return f"{exact_mcnemar(*only_one(mine, other)):.2g}"


def points(mine: Record, other: Record) -> float:
    """Success minus the other's [percent]."""
    return float(100 * (mine["success"] - other["success"]))
