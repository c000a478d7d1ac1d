"""Docstrings for autodoc: Google's sections, with tables, headings and drawings as this package writes them in Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from sphinx.ext.napoleon import Config, GoogleDocstring

CODE = re.compile(r"(`[^`]*`)")
CONFIG = Config(napoleon_numpy_docstring=False, napoleon_use_rtype=False)
PLAIN = ("attribute", "data", "property")
"""What is described in a sentence, whose colons begin no type."""


def prepare(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """What autodoc calls with the lines of a docstring, to be changed in place."""
    written = list(in_rst(lines))
    if what not in PLAIN:
        written = GoogleDocstring(written, CONFIG, app, what, name, obj, options).lines()
    lines[:] = written


def in_rst(lines: list[str]) -> Iterator[str]:
    """The lines, with each paragraph as reStructuredText has it."""
    for paragraph in re.split(r"\n\s*\n", "\n".join(lines)):
        block = paragraph.split("\n")
        if is_drawing(block):
            yield from ["::", "", *(f"    {line}" for line in block)]
        else:
            yield from of_block(block)
        yield ""


def is_drawing(block: list[str]) -> bool:
    """Whether a paragraph is a picture in letters."""
    return any(re.match(r"\s*(\+--|#{4,}|\|? +[|#]$)", line) for line in block)


def of_block(block: list[str]) -> Iterator[str]:
    """A paragraph's lines: headings, tables, and plain text whose stars and bars are meant as such."""
    rows: list[list[str]] = []
    for line in block:
        if line.lstrip().startswith("|") and line.rstrip().endswith("|"):
            rows.append([plain(cell.strip()) for cell in line.strip().strip("|").split("|")])
            continue
        yield from table(rows)
        rows = []
        heading = re.match(r"#{2,} (.*)", line)
        if heading:
            yield from ["", f".. rubric:: {heading[1]}", ""]
        elif re.match(r"\s*(-|\d+\.) ", line) and not line.startswith(" "):
            yield from ["", plain(line)]
        else:
            yield plain(line)
    yield from table(rows)


def plain(line: str) -> str:
    """Text outside code, with marks of reStructuredText escaped."""
    parts = CODE.split(line)
    parts[::2] = [re.sub(r"([*|]|(?<=\w)_(?!\w))", r"\\\1", part) for part in parts[::2]]
    return "".join(parts)


def table(rows: list[list[str]]) -> Iterator[str]:
    """A table of Markdown as a list-table."""
    if not rows:
        return
    yield from ["", ".. list-table::", "   :header-rows: 1", ""]
    for row in rows:
        if not set("".join(row)) <= set("-: "):
            first, *others = row
            yield from [f"   * - {first}", *(f"     - {cell}" for cell in others)]
    yield ""
