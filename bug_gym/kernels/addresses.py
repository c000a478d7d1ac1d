"""The arguments of `run_rows` as addresses: who has them calls its machine code without handing over an array.

Python spends 80 ns on each array that it hands to compiled code, for nine of them longer than a small world's step takes.
A table has their addresses instead, written once, and the address of the code itself: what steps one world is the code
that steps many, as to compile it a second time would take seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types

from bug_gym.compiling import DISPATCHERS, types_of, vectors
from bug_gym.kernels.layout import Integers
from bug_gym.kernels.record import SPEC
from bug_gym.kernels.vectors import cgutils


def _arrays(*kinds: tuple[Any, int]) -> tuple[Any, ...]:
    return tuple(types.Array(kind, dimensions, "C") for kind, dimensions in kinds)


# What `run_rows` takes after its task, in its order: floats, ints, observation, spec, beams; then footprint and regions,
# which may be None and are handed over as they are; scratch, scratch_int, actions, rows.
BEFORE = _arrays((types.float64, 2), (types.int64, 2), (types.float32, 3), (from_dtype(SPEC), 1), (types.float64, 2))
AFTER = _arrays((types.float64, 1), (types.int64, 1), (types.float64, 3), (types.int64, 1))

HAS_ADDRESSES = DISPATCHERS is not None
"""Whether code may be called at its address; a numba that was not tried may hand arguments over in another way."""

# A line of the table: address, numbers, bytes of a number, up to three sizes, up to three strides [bytes]. The first line
# has the address of the code alone.
SIZES, STRIDES, LINE = 3, 6, 9


def address_table(kernel: Callable[..., None], arguments: Sequence[Any]) -> Integers:
    """The table (1 + 9, LINE) of a kernel and of the arrays among its arguments, which must outlive it."""
    task, *rest = arguments
    before, after = rest[: len(BEFORE)], rest[len(BEFORE) + 2 :]
    found = types_of(*before), types_of(*after)
    assert found == (BEFORE, AFTER), f"the arrays are {found}, expected {(BEFORE, AFTER)}"
    arrays = [*before, *after]
    table = np.zeros((1 + len(arrays), LINE), dtype=np.int64)
    table[0, 0] = code_address(kernel, types_of(task, *rest))
    for line, array in zip(table[1:], arrays, strict=True):
        line[:SIZES] = array.ctypes.data, array.size, array.itemsize
        line[SIZES : SIZES + array.ndim] = array.shape
        line[STRIDES : STRIDES + array.ndim] = array.strides
    return table


def code_address(kernel: Callable[..., None], signature: tuple[Any, ...]) -> int:
    """Where the machine code of a kernel for these types begins; it is compiled if it is not yet."""
    dispatcher: Any = kernel
    dispatcher.compile(signature)
    compiled = dispatcher.overloads[signature]
    address: int = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    assert address, f"the code of {dispatcher.py_func.__name__} has no address"
    return address


def _word(builder: Any, table: Any, number: int) -> Any:
    return builder.load(builder.gep(table, [ir.Constant(ir.IntType(64), number)]))


@vectors
def arguments_at(typingctx: Any, table: Any, task: Any, footprint: Any, regions: Any) -> Any:
    """What `run_rows` takes: the arrays of the table that lies at an address, and what is handed over beside it."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        words = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
        found = []
        for number, kind in enumerate((*BEFORE, *AFTER), start=1):
            numbers = [_word(builder, words, LINE * number + place) for place in range(LINE)]
            array = context.make_array(kind)(context, builder)  # zeros: no owner, as the table's keeps the arrays
            array.data = builder.inttoptr(numbers[0], array.data.type)
            array.nitems, array.itemsize = numbers[1], numbers[2]
            array.shape = cgutils.pack_array(builder, numbers[SIZES : SIZES + kind.ndim])
            array.strides = cgutils.pack_array(builder, numbers[STRIDES : STRIDES + kind.ndim])
            found.append(array._getvalue())
        before, after = found[: len(BEFORE)], found[len(BEFORE) :]
        return context.make_tuple(builder, signature.return_type, [arguments[1], *before, *arguments[2:], *after])

    kinds = (types.int64, *BEFORE, footprint, regions, *AFTER)
    return types.Tuple(kinds)(types.int64, types.int64, footprint, regions), codegen


@vectors
def call_at(typingctx: Any, table: Any, handed: Any) -> Any:
    """Calls the code of the table that lies at an address, with its arguments."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        table, values = arguments
        words = builder.inttoptr(table, ir.IntType(64).as_pointer())
        kind = context.call_conv.get_function_type(types.none, handed.types)
        code = builder.inttoptr(_word(builder, words, 0), kind.as_pointer())
        parts = [builder.extract_value(values, number) for number in range(len(handed.types))]
        context.call_conv.call_function(builder, code, types.none, handed.types, parts)  # kernels raise nothing
        return context.get_dummy_value()

    return types.void(types.int64, handed), codegen
