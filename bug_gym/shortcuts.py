"""Shortcuts through numba while it compiles a kernel: what it would do anew for each of a hundred functions is done once.

They change how long it takes, not the code that comes out, but for `no_wrap_around`. What they take hold of are numba's
insides, which change from one of its releases to the next: all are named when this module is loaded, and where one of
them is missing `compiling` does without.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Hashable, Iterator
from typing import Any

from numba import types
from numba.core import base, event
from numba.core.types.functions import BaseFunction
from numba.np import arrayobj


@contextlib.contextmanager
def replaced(owner: Any, name: str, function: Callable[..., Any]) -> Iterator[None]:
    """Have one of numba's functions replaced; under its lock, so that nothing else is compiled by it meanwhile."""
    before = getattr(owner, name)
    setattr(owner, name, function)
    try:
        yield
    finally:
        setattr(owner, name, before)


def asked_once(ask: Callable[..., Any], question: Callable[..., Hashable]) -> Callable[..., Any]:
    """A function that asks another one only what it has not been asked before; `question` tells from the arguments."""
    known: dict[Hashable, Any] = {}

    def answer(*arguments: Any) -> Any:
        asked = question(*arguments)
        if asked not in known:
            known[asked] = ask(*arguments)
        return known[asked]

    return answer


ASKED_AGAIN: list[tuple[Any, str, Callable[..., Any], Callable[..., Hashable]]] = [
    # Meeting `a + b`, numba asks some twenty templates in turn who knows the types.
    (
        BaseFunction,
        "get_call_type",
        BaseFunction.get_call_type,
        lambda function, context, args, kws: (function, context, tuple(args), tuple(dict(kws).items())),
    ),
    # Each pass over each function is told its types in words, some 20 kB for the record of a row.
    (types.Record, "__repr__", types.Record.__repr__, lambda record: record),
    # LLVM tells the size of a type by a module that is written, and read, to hold one.
    (base.BaseContext, "get_abi_sizeof", base.BaseContext.get_abi_sizeof, lambda context, kind: (context, str(kind))),
    # Python works out the parameters of each of numba's own functions that writes an operation.
    (base, "_has_loc", base._has_loc, lambda function: function),
]
"""Where numba's function is, and what makes two of its questions the same."""


@contextlib.contextmanager
def answers_remembered() -> Iterator[None]:
    """Numba remembers what it has asked itself, until this kernel is compiled."""
    with contextlib.ExitStack() as stack:
        for owner, name, ask, question in ASKED_AGAIN:
            stack.enter_context(replaced(owner, name, asked_once(ask, question)))
        yield


EVENTS = (event.start_event, event.end_event)


@contextlib.contextmanager
def no_stopwatches() -> Iterator[None]:
    """Numba starts two for each function, and each call of LLVM tells those of all that are being compiled."""
    with contextlib.ExitStack() as stack:
        for tell in EVENTS:
            stack.enter_context(replaced(event, tell.__name__, lambda *_, **__: None))
        yield


@contextlib.contextmanager
def collector_off() -> Iterator[None]:
    """Python's collector would go through all that numba has loaded, again and again, for a fifth of the time.

    Nor does it begin with that when it is back: what is there by then counts as old, and waits for its turn.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if not gc.get_freeze_count():  # or somebody else's frozen objects would thaw
            gc.freeze()
            gc.unfreeze()
        if collects:
            gc.enable()


FIX_INDEX = arrayobj.fix_integer_index


def no_wrap_around() -> contextlib.AbstractContextManager[None]:
    """Each signed index is asked whether it counts from the end, for a tenth of a step; here none does."""

    def as_it_is(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        return context.cast(builder, index, kind, types.intp if kind.signed else types.uintp)

    return replaced(arrayobj, FIX_INDEX.__name__, as_it_is)
