"""HTML that is escaped unless it says that it need not be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

PROSE = 40
"""Letters of a cell that are more than a number: its column is set as text."""
VOID = ("input", "meta")
"""Elements that have no end in HTML; those of drawings have one: what follows an open path would be in it, and unseen."""


class Markup(str):
    """Text that is HTML already; any other text is escaped."""

    __slots__ = ()


def element(name: str, *content: str, **attributes: str | float | bool | None) -> Markup:
    """An element with its content and attributes, all escaped.

    Args:
        name: of the element.
        content: texts, and elements as Markup.
        attributes: `_` at the end of a name is dropped, within it stands for `-`; True alone sets one, None and False
            leave it out.
    """
    head = "".join(
        _attribute(key, value) for key, value in attributes.items() if value is not None and value is not False
    )
    return Markup(f"<{name}{head}>" if name in VOID else f"<{name}{head}>{joined(content)}</{name}>")


def _attribute(key: str, value: str | float | bool | None) -> str:
    told = key.rstrip("_").replace("_", "-")
    return f" {told}" if value is True else f' {told}="{escape(str(value))}"'


def joined(parts: Iterable[str]) -> Markup:
    """Texts and elements one after the other, the texts escaped."""
    return Markup("".join(part if isinstance(part, Markup) else escape(part) for part in parts))


class Cell(NamedTuple):
    """A cell of a table."""

    content: str
    """What stands in it: text, or Markup."""
    share: float | None = None
    """0 to 1, how strongly the cell is coloured; None: not at all."""
    mark: str | None = None
    """Its id in the page."""


def table(header: Sequence[str], lines: Iterable[Sequence[Cell]], *, policy: int | None = 0) -> Markup:
    """A table that the page sorts by a click on a name of a column, and filters by policy.

    Args:
        header: names of the columns.
        lines: the cells of each line, as many as the header has.
        policy: number of the column with the policy, which is text; it and those before it are headers of their line. None:
            no column, the first one is the header.
    """
    last, lines = policy or 0, list(lines)
    texts = {*range(last + 1), *(column for line in lines for column, cell in enumerate(line) if _is_prose(cell))}
    heads = [
        element("th", name, scope="col", class_="name" if column in texts else None)
        for column, name in enumerate(header)
    ]
    head = element("tr", *heads)
    body = [
        element(
            "tr",
            *(_cell(cell, is_header=column <= last, is_text=column in texts) for column, cell in enumerate(line)),
            data_policy=None if policy is None else line[policy].content,
        )
        for line in lines
    ]
    whole = element("table", element("thead", head), element("tbody", *body), class_="sortable")
    return element("div", whole, class_="wide")


def text_table(header: Sequence[str], lines: Sequence[Sequence[str]], *, policy: int | None = 0) -> Markup:
    """A `table` of texts."""
    return table(header, ([Cell(text) for text in line] for line in lines), policy=policy)


def open_table(title: str, header: Sequence[str], lines: Sequence[Sequence[str]], *, policy: int | None = 0) -> Markup:
    """A `text_table` that a click on its title folds."""
    return element("details", element("summary", title), text_table(header, lines, policy=policy), open=True)


def _cell(cell: Cell, *, is_header: bool, is_text: bool) -> Markup:
    if is_header:
        return element("th", cell.content, scope="row", id=cell.mark)
    if cell.share is None:
        return element("td", cell.content, class_="prose" if is_text else None, id=cell.mark)
    return element("td", cell.content, class_="share", style=f"--share:{cell.share:.3f}", id=cell.mark)


def _is_prose(cell: Cell) -> bool:
    return not isinstance(cell.content, Markup) and len(cell.content) > PROSE
