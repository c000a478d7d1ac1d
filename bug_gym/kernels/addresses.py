"""The arguments of `step_rows` as addresses: who has them calls its machine code without handing over an array.

Python spends 80 ns on each array that it hands to compiled code, for eleven of them longer than a small world's step
takes. A table has their addresses instead, written once, and the address of the code itself: what steps one world is the
code that steps many, as to compile it a second time would take seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import from_dtype, typeof, types

from bug_gym.compiling import DISPATCHERS, vectors
from bug_gym.kernels.layout import SPEC, Integers
from bug_gym.kernels.vectors import cgutils

# What `step_rows` takes, in its order.
ARGUMENTS: tuple[Any, ...] = tuple(
    types.Array(kind, dimensions, "C")
    for kind, dimensions in (
        (types.float64, 2),  # floats
        (types.int64, 2),  # ints
        (types.float32, 3),  # observation
        (from_dtype(SPEC), 1),  # spec
        (types.float64, 2),  # beams
        (types.float64, 2),  # footprint
        (types.float64, 1),  # regions
        (types.float64, 1),  # scratch
        (types.int64, 1),  # scratch_int
        (types.float64, 3),  # actions
        (types.int64, 1),  # rows
    )
)

tuple_of: Any = types.Tuple  # without types upstream
ARRAYS = tuple_of(ARGUMENTS)

HAS_ADDRESSES = DISPATCHERS is not None
"""Whether code may be called at its address; a numba that was not tried may hand arguments over in another way."""

# A line of the table: address, numbers, bytes of a number, up to three sizes, up to three strides [bytes]. The first line
# has the address of the code alone.
SIZES, STRIDES, LINE = 3, 6, 9


def address_table(kernel: Callable[..., None], arrays: Sequence[npt.NDArray[Any]]) -> Integers:
    """The table (1 + 11, LINE) of a kernel that takes ARGUMENTS and of these arrays, which must outlive it."""
    types_of_arrays: Any = tuple(map(typeof, arrays))
    assert types_of_arrays == ARGUMENTS, f"the arrays are {types_of_arrays}, expected {ARGUMENTS}"
    table = np.zeros((1 + len(arrays), LINE), dtype=np.int64)
    table[0, 0] = code_address(kernel)
    for line, array in zip(table[1:], arrays, strict=True):
        line[:SIZES] = array.ctypes.data, array.size, array.itemsize
        line[SIZES : SIZES + array.ndim] = array.shape
        line[STRIDES : STRIDES + array.ndim] = array.strides
    return table


def code_address(kernel: Callable[..., None]) -> int:
    """Where the machine code of a kernel that takes ARGUMENTS begins; it is compiled if it is not yet."""
    dispatcher: Any = kernel
    dispatcher.compile(ARGUMENTS)
    compiled = dispatcher.overloads[ARGUMENTS]
    address: int = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    assert address, f"the code of {dispatcher.py_func.__name__} has no address"
    return address


def _word(builder: Any, table: Any, number: int) -> Any:
    return builder.load(builder.gep(table, [ir.Constant(ir.IntType(64), number)]))


@vectors
def arrays_at(typingctx: Any, table: Any) -> Any:
    """The arrays of the table that lies at an address."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        words = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
        values = []
        for number, kind in enumerate(ARGUMENTS, start=1):
            numbers = [_word(builder, words, LINE * number + place) for place in range(LINE)]
            array = context.make_array(kind)(context, builder)  # zeros: no owner, as the table's keeps the arrays
            array.data = builder.inttoptr(numbers[0], array.data.type)
            array.nitems, array.itemsize = numbers[1], numbers[2]
            array.shape = cgutils.pack_array(builder, numbers[SIZES : SIZES + kind.ndim])
            array.strides = cgutils.pack_array(builder, numbers[STRIDES : STRIDES + kind.ndim])
            values.append(array._getvalue())
        return context.make_tuple(builder, signature.return_type, values)

    return ARRAYS(types.int64), codegen


@vectors
def call_at(typingctx: Any, table: Any, arrays: Any) -> Any:
    """Calls the code of the table that lies at an address, with its arrays."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        table, arrays = arguments
        words = builder.inttoptr(table, ir.IntType(64).as_pointer())
        kind = context.call_conv.get_function_type(types.none, ARGUMENTS)
        code = builder.inttoptr(_word(builder, words, 0), kind.as_pointer())
        values = [builder.extract_value(arrays, number) for number in range(len(ARGUMENTS))]
        context.call_conv.call_function(builder, code, types.none, ARGUMENTS, values)  # kernels raise nothing
        return context.get_dummy_value()

    return types.void(types.int64, ARRAYS), codegen
