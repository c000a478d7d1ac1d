"""How the kernels are compiled: by numba, kept on disk, each function once.

What Python calls is a `kernel`; what only kernels call is `called` or, where it is copied into its callers, `inlined`.
By itself numba would optimise each function, make machine code of it and an entry for Python, and then do so again for
each function above it that took it in. A third of the time to compile is saved where only kernels go to the end.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Never, TypeVar, cast

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])

# _nrt: no reference counts. The kernels own nothing, and counting each row cut out of a batch costs 200 ns a scan.
OPTIONS: dict[str, Any] = {
    "nopython": True,
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}

PROCESS = uuid.uuid4().hex[:12]
KERNELS: list[Any] = []
"""All that are kept on disk."""

PACKAGE = Path(__file__).parent


def kernel(function: Function) -> Function:
    """Compiles a function for Python, and for other kernels, and keeps it on disk.

    What it calls and the constants that it reads may lie in the files of its own folder and in `bug_gym.kernels`; a
    change of any other file is not noticed.
    """
    dispatcher: Any = OncePerType(function, targetoptions=OPTIONS)
    if (stamp := stamp_of(function)) is not None:
        dispatcher.enable_caching()
        KERNELS.append(with_own_files(dispatcher, stamp))
    return cast(Function, dispatcher)


def called(function: Function) -> Function:
    """Compiles a function for kernels."""
    return cast(Function, Callee(function, targetoptions=OPTIONS))


def inlined(function: Function) -> Function:
    """Compiles a function for kernels, which take in a copy of it wherever they call it."""
    return cast(Function, Callee(function, targetoptions={**OPTIONS, "forceinline": True}))


def vectors(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose LLVM code is written out (its first parameter is numba's and not the caller's)."""
    return cast(Callable[..., Any], intrinsic(function))


# ---------------------------------------------------------------------------------------------- dispatchers


class OncePerType(CPUDispatcher):
    """A function that is compiled once for `f(x, 0)` and `f(x, 1)`: numba takes each constant for a type of its own."""

    pipeline: type[CompilerBase] = Compiler

    def __init__(
        self, py_func: Callable[..., Any], locals: Any = None, targetoptions: dict[str, Any] | None = None
    ) -> None:
        super().__init__(py_func, locals or {}, targetoptions or {}, self.pipeline)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What numba asks for when it meets a call."""
        return super().get_call_template(
            tuple(types.unliteral(type_) for type_ in args),
            {name: types.unliteral(type_) for name, type_ in dict(kws).items()},
        )


class Unfinished(JITCodeLibrary):
    """LLVM code as it was written: who links it in optimises it together with its own, and makes machine code of all."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class LoweringForCallers(NativeLowering):
    """Writes LLVM code for callers, and stops there."""

    _name = "lowering_for_callers"

    def run_pass(self, state: Any) -> bool:
        """Leave the result in `state.cr`, known to the functions compiled later by its description."""
        state.library = Unfinished(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = state.flags.no_cpython_wrapper = True
        super().run_pass(state)
        description = state.cr.fndesc
        state.targetctx.insert_user_function(description, description, [state.library])
        state.cr = state.cr._replace(cfunc=description)
        return True


class CompilerForCallers(CompilerBase):
    """numba's own passes, but for the last."""

    def define_pipelines(self) -> list[PassManager]:
        """The one pipeline, of nopython mode."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = PassManager("nopython_for_callers")
        for one, reason in usual.passes:
            passes.add_pass(LoweringForCallers if one is NativeLowering else one, reason)
        passes.finalize()
        return [passes]


class Callee(OncePerType):
    """A function that exists only inside the kernels that call it."""

    pipeline = CompilerForCallers

    def __call__(self, *args: Any, **kws: Any) -> Never:
        """Refuse: there is no machine code to jump to."""
        raise TypeError(
            f"{self.py_func.__name__} is compiled for kernels only; make it a @kernel to call it from Python"
        )

    def add_overload(self, cres: Any) -> None:
        """Keep what was compiled for one signature."""
        self.overloads[tuple(cres.signature.args)] = cres


# ---------------------------------------------------------------------------------------------- files


def with_own_files(dispatcher: Any, stamp: str) -> Any:
    """A dispatcher that writes compiled code to files that no other process writes, and reads what bears its stamp.

    Numba numbers the files of a function's signatures by what its index holds: of two processes that compile different
    signatures at once, one could write the other's file, and the index then give that code to the wrong types.
    """
    files = dispatcher._cache._cache_file
    files._source_stamp = (files._source_stamp, stamp)
    files._data_name_pattern = files._data_name_pattern.replace(".{number", f".{PROCESS}.{{number")
    return dispatcher


def take_own_name() -> None:
    """Give a forked process files of its own; it comes with the names of its parent's."""
    global PROCESS
    parent, PROCESS = PROCESS, uuid.uuid4().hex[:12]
    for dispatcher in KERNELS:
        files = dispatcher._cache._cache_file
        files._data_name_pattern = files._data_name_pattern.replace(parent, PROCESS)


if hasattr(os, "register_at_fork"):  # not on Windows, where no process forks
    os.register_at_fork(after_in_child=take_own_name)


# ---------------------------------------------------------------------------------------------- stamps


def stamp_of(function: Callable[..., Any]) -> str | None:
    """What tells compiled code of today's sources from older code, None for a function whose source is in no file.

    Numba's own stamp tells of the function's file only, but its code holds what it calls and the constants that it
    reads: one edited elsewhere would not count. A function typed into a notebook may call what another cell holds.
    """
    file = Path(function.__code__.co_filename)
    if not file.is_file() and not getattr(sys, "frozen", False):  # a frozen program is stamped by numba, as one file
        return None
    return " ".join([own_stamp(), folder_stamp(PACKAGE / "kernels"), folder_stamp(file.parent)])


@functools.cache
def own_stamp() -> str:
    """How functions are compiled."""
    return contents([Path(__file__)])


@functools.cache
def folder_stamp(folder: Path) -> str:
    """The modules of a folder, read once in a process."""
    return contents(sorted(file for file in folder.glob("*.py") if file.stem.isidentifier()))


def contents(files: Iterable[Path]) -> str:
    """A digest of names and contents, which are all the same age where an archive was unpacked (1.5 ms for 500 kB)."""
    digest = hashlib.sha256()
    for file in files:
        try:
            content = file.read_bytes()
        except OSError:  # what cannot be read, of another user say, is not called either
            continue
        digest.update(f"{file.name} {len(content)} ".encode() + content)
    return digest.hexdigest()
