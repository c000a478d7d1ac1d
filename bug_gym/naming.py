"""What somebody may have meant by a name that is not known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

LONGEST = 200
"""Characters of the longest word that may be a misspelt one."""


def nearest_hint(
    word: object, known: Iterable[object], *, count: int = 1, cutoff: float = 0.5, separator: str = ","
) -> str:
    """`, did you mean 'x'?` for the known words nearest to this one, or nothing.

    Args:
        word: what was given.
        known: what could have been meant.
        count: how many to offer at most: `'x' or 'y'`.
        cutoff: how alike they must be, from 0 to 1: difflib's ratio.
        separator: what stands between the complaint and this question.
    """
    if isinstance(word, int) or len(str(word)) > LONGEST:
        return ""
    close = difflib.get_close_matches(str(word), [str(name) for name in known], n=count, cutoff=cutoff)
    return f"{separator} did you mean {' or '.join(map(repr, close))}?" if close else ""
