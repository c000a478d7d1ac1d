"""A table of text, before it is set on a screen, in Markdown or in LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

NOTHING = "–"
"""Stands where nothing was measured."""


class TextTable(NamedTuple):
    """Text in lines and columns."""

    title: str
    header: list[str]
    lines: list[list[str]]

    @classmethod
    def of_columns(cls, title: str, columns: Sequence[Sequence[str]]) -> TextTable:
        """A table of those columns, each with its header, in which something was measured."""
        measured = [cells for cells in columns if any(cell != NOTHING for cell in cells[1:])]
        header, *lines = (list(line) for line in zip(*measured, strict=True))
        return cls(title, header, lines)
