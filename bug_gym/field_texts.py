"""What is written under the fields of a class, in its source: a sentence each, with its unit.

It is looked up when somebody asks. Pydantic would read it while each class is made, which took half of that time.
"""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from collections.abc import Iterable, Iterator


def texts_under_fields(classes: Iterable[type]) -> dict[str, str]:
    """By field, what a class says of it, on one line; a later class's word counts where several say one.

    A field under which nothing stands is missing, and so are all of a class that has no source (typed in by hand).
    """
    found: dict[str, str] = {}
    for one in classes:
        found |= _of_class(one)
    return found


@functools.cache
def _of_class(own: type) -> dict[str, str]:
    return dict(_written(own))


def _written(own: type) -> Iterator[tuple[str, str]]:
    """Each field of one class that has a sentence under it, with that sentence."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(own)))
    except (OSError, TypeError):  # typed in by hand, or run without its source
        return
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    for line, below in zip(body, body[1:], strict=False):
        if not (isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name)):
            continue
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) and isinstance(below.value.value, str):
            yield line.target.id, " ".join(below.value.value.split())
