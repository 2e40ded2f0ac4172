"""Loops as machine code.  numba is imported where something is compiled: that takes half a second."""

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def jit(function: Function, sums: bool = False) -> Function:
    """The function as machine code, kept beside the source or in numba's cache folder where there is one.

    sums: terms may be added in any order, so that sums are vectorised.
    """
    import numba

    options: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "contract"} if sums else False}
    try:
        return cast(Function, numba.njit(cache=True, **options)(function))
    except RuntimeError:  # there is no folder to keep it in
        return cast(Function, numba.njit(**options)(function))


@cache
def compiled(function: Function, sums: bool = False) -> Function:
    """The same of a function that also runs as it stands; one per process."""
    return jit(function, sums)
