"""Docstrings and cells as Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

CODE = re.compile(r"(`[^`]*`)")
"""A piece of code within a sentence."""

SIGN = re.compile(r"(^\*[A-Z][^*]*\.\*(?= ))|([*<])", re.MULTILINE)
"""What a paragraph begins with as its heading, or a sign that is meant as such."""


def prose(text: str) -> str:
    """Plain text of a docstring, whose stars and brackets are meant as such, but for headings of paragraphs in stars."""
    parts = CODE.split(text)
    parts[::2] = [SIGN.sub(lambda sign: sign[1] or "\\" + sign[2], part) for part in parts[::2]]
    return "".join(parts)


def one_line(text: str) -> str:
    """The text without its breaks."""
    return " ".join(text.split())


def cell(text: str) -> str:
    """What may stand in a cell of a table."""
    return one_line(text).replace("|", "\\|")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *([cell(one) for one in row] for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def toctree(pages: Iterable[str], *, hidden: bool = True) -> str:
    """The pages below this one."""
    options = ":hidden:\n" if hidden else ":maxdepth: 1\n"
    return "```{toctree}\n" + options + "\n" + "\n".join(pages) + "\n```"


def paragraphs(*parts: str) -> str:
    """The text of a page: its parts that say something."""
    return "\n\n".join(part.strip("\n") for part in parts if part.strip()) + "\n"
