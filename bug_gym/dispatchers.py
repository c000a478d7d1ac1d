"""Functions that numba compiles only as far as they are needed: our own classes on its inside.

These change from one of its releases to the next; `compiling` does without this module where it does not load.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any, Never

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.core.types.functions import BaseFunction
from numba.np import arrayobj

# _nrt: no reference counts. The kernels own nothing, and counting each row cut out of a batch costs 200 ns a scan.
OPTIONS: dict[str, Any] = {"nopython": True, "no_cfunc_wrapper": True, "_nrt": False}

COUNTING_ON = "bug_gym.kernels."  # modules where no index of an array is below 0


@contextlib.contextmanager
def collector_off() -> Iterator[None]:
    """Python's collector would go through all that numba has loaded, again and again, for a fifth of the time."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@contextlib.contextmanager
def calls_remembered() -> Iterator[None]:
    """Whenever numba meets `a + b`, it asks some twenty templates in turn who knows the types; so it asks once for each.

    Under numba's lock, so that nothing else is compiled by it meanwhile.
    """
    inside: Any = BaseFunction  # a method of which is replaced meanwhile
    ask = inside.get_call_type
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        asked = (self, context, tuple(args), tuple(dict(kws).items()))
        if asked not in known:
            known[asked] = ask(self, context, args, kws)
        return known[asked]

    inside.get_call_type = get_call_type
    try:
        yield
    finally:
        inside.get_call_type = ask


@contextlib.contextmanager
def no_wrap_around() -> Iterator[None]:
    """Each signed index is asked whether it counts from the end, for a tenth of a step; here none does."""
    fix = arrayobj.fix_integer_index

    def as_it_is(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        return context.cast(builder, index, kind, types.intp if kind.signed else types.uintp)

    arrayobj.fix_integer_index = as_it_is
    try:
        yield
    finally:
        arrayobj.fix_integer_index = fix


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


@register_pass(mutates_CFG=True, analysis_only=False)
class LoweringApart(LoweringForCallers):
    """Likewise, and has the callers jump to it."""

    _name = "lowering_apart"

    def run_pass(self, state: Any) -> bool:
        """Mark what was written."""
        super().run_pass(state)
        state.library.get_function(state.cr.fndesc.llvm_func_name).add_function_attribute("noinline")
        return True


class CompilerForCallers(CompilerBase):
    """numba's own passes, but for the last."""

    lowering: type[NativeLowering] = LoweringForCallers

    def define_pipelines(self) -> list[PassManager]:
        """The one pipeline, of nopython mode."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = PassManager("nopython_for_callers")
        for one, reason in usual.passes:
            passes.add_pass(self.lowering if one is NativeLowering else one, reason)
        passes.finalize()
        return [passes]


class CompilerApart(CompilerForCallers):
    """Likewise."""

    lowering = LoweringApart


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


class Apart(Callee):
    """A callee that none of its callers takes in."""

    pipeline = CompilerApart


class Kernel(OncePerType):
    """A function for Python. To kernels that call it, it is a `Callee`: they need no machine code of its own."""

    def __init__(
        self, py_func: Callable[..., Any], locals: Any = None, targetoptions: dict[str, Any] | None = None
    ) -> None:
        super().__init__(py_func, locals, targetoptions)
        self.callee = Callee(py_func, locals, targetoptions)

    def compile(self, sig: Any) -> Any:
        """Compile for one signature, or take it from disk."""
        counts_on = (self.py_func.__module__ or "").startswith(COUNTING_ON)
        with (
            global_compiler_lock,
            collector_off(),
            calls_remembered(),
            no_wrap_around() if counts_on else nullcontext(),
        ):
            return super().compile(sig)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What numba asks for when it meets a call."""
        return self.callee.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """What numba asks for when it writes a call."""
        return self.callee.get_overload(sig)
