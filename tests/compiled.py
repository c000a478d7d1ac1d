"""What is compiled for kernels only, for tests to call."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def for_python(callee: Function) -> Function:
    """The function of a `called` or `inlined` one, compiled with an entry of its own."""
    return cast(Function, njit(error_model="numpy")(cast(Any, callee).py_func))
