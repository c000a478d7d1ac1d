"""What the pages of results say: of the Bug family, of HD-BUG, of learning. docs/make_results.py writes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

Record = Mapping[str, Any]
"""A JSON object."""


class Page(NamedTuple):
    """What a page says of a reproduction beside its head."""

    tables: Sequence[str]
    """Tables and pictures in Markdown, each with its title."""
    reading: str = ""
    """What the numbers say."""
    claims: Sequence[tuple[str, bool]] = ()
    """Each claim, and whether it was found true."""
