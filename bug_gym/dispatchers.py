"""Functions that numba compiles only as far as they are needed: our own classes on its inside.

These change from one of its releases to the next; `compiling` does without this module where it does not load.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any, Never

from numba import types
from numba.core import typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from bug_gym.shortcuts import answers_remembered, collector_off, no_stopwatches, no_wrap_around

# _nrt: no reference counts. The kernels own nothing, and counting each row cut out of a batch costs 200 ns a scan.
OPTIONS: dict[str, Any] = {"nopython": True, "no_cfunc_wrapper": True, "_nrt": False}

COUNTING_ON = "bug_gym.kernels."  # modules where no index of an array is below 0


class Library(JITCodeLibrary):
    """LLVM code that takes in what it calls, and what that calls: all once, and optimised together in the end."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout  # as numba's own does first

    def add_linking_library(self, library: Any) -> None:
        """Take in another library's code."""
        if library not in self._linking_libraries:
            super().add_linking_library(library)


class Unfinished(Library):
    """LLVM code as it was written: who takes it in makes machine code of all."""

    def finalize(self) -> None:
        """End here: what this calls is taken in by who takes in this."""
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True


class UnfinishedApart(Unfinished):
    """Likewise, of a function that its callers jump to."""

    def add_ir_module(self, module: Any) -> None:
        """Mark what was written, before LLVM reads it: LLVM 14 would mark what the function returns."""
        for function in module.functions:
            if not function.is_declaration:
                function.attributes.add("noinline")
        super().add_ir_module(module)


class Whole(Library):
    """Machine code of a kernel, and of all that it calls."""

    def _optimize_final_module(self) -> None:
        """In one go: numba's own goes through the code once before, for the sake of reference counts."""
        made = self._codegen._module_pass_manager()
        passes, *builder = made if isinstance(made, tuple) else (made,)  # numba 0.61 makes no builder
        passes.run(self._final_module, *builder)


@register_pass(mutates_CFG=True, analysis_only=False)
class LoweringForPython(NativeLowering):
    """Writes LLVM code, and makes machine code of it."""

    _name = "lowering_for_python"

    def run_pass(self, state: Any) -> bool:
        """Leave the result in `state.cr`."""
        state.library = Whole(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class LoweringForCallers(NativeLowering):
    """Writes LLVM code for callers, and stops there."""

    _name = "lowering_for_callers"
    library: type[Unfinished] = Unfinished

    def run_pass(self, state: Any) -> bool:
        """Leave the result in `state.cr`, known to the functions compiled later by its description."""
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = state.flags.no_cpython_wrapper = True
        super().run_pass(state)
        description = state.cr.fndesc
        libraries = [state.library, *state.library._linking_libraries]  # what it calls, and what that calls
        state.targetctx.insert_user_function(description, description, libraries)
        state.cr = state.cr._replace(cfunc=description)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class LoweringApart(LoweringForCallers):
    """Likewise, and has the callers jump to it."""

    _name = "lowering_apart"
    library = UnfinishedApart


NOT_NEEDED = frozenset(
    {
        untyped_passes.WithLifting,
        untyped_passes.InlineClosureLikes,
        untyped_passes.RewriteDynamicRaises,
        untyped_passes.MakeFunctionToJitFunction,
        untyped_passes.InlineInlinables,
        untyped_passes.FindLiterallyCalls,
        untyped_passes.LiteralUnroll,
        untyped_passes.LiteralPropagationSubPipelinePass,
        typed_passes.InlineOverloads,
        typed_passes.NopythonRewrites,
    }
)
"""Numba's passes for what kernels do not have: `with`, closures, comprehensions, exceptions, arrays that are made."""


class CompilerForKernels(CompilerBase):
    """Numba's own passes that kernels need, the last of them exchanged."""

    lowering: type[NativeLowering] = LoweringForPython

    def define_pipelines(self) -> list[PassManager]:
        """The one pipeline, of nopython mode."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = PassManager("nopython_for_kernels")
        for one, reason in usual.passes:
            if one not in NOT_NEEDED:
                passes.add_pass(self.lowering if one is NativeLowering else one, reason)
        passes.finalize()
        return [passes]


class CompilerForCallers(CompilerForKernels):
    """Likewise, for a function that is compiled together with its callers."""

    lowering = LoweringForCallers


class CompilerApart(CompilerForCallers):
    """Likewise."""

    lowering = LoweringApart


class OncePerType(CPUDispatcher):
    """A function that is compiled once for `f(x, 0)` and `f(x, 1)`: numba takes each constant for a type of its own."""

    pipeline: type[CompilerBase] = CompilerForKernels

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
            no_stopwatches(),
            answers_remembered(),
            no_wrap_around() if counts_on else nullcontext(),
        ):
            return super().compile(sig)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What numba asks for when it meets a call."""
        return self.callee.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """What numba asks for when it writes a call."""
        return self.callee.get_overload(sig)
