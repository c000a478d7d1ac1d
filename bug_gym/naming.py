"""What somebody may have meant by a name that is not known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest_hint(word: object, known: Iterable[object]) -> str:
    """`, did you mean 'x'?` for the known word nearest to this one, or nothing."""
    close = difflib.get_close_matches(str(word), [str(name) for name in known], n=1, cutoff=0.5)
    return f", did you mean {close[0]!r}?" if close else ""
