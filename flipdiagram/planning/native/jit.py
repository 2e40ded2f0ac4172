"""Loops as machine code.  This module imports numba, half a second: import it only where it is used."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def jit(function: Function) -> Function:
    """The function as machine code, kept beside the source or in numba's cache folder where there is one."""
    try:
        compiled: Any = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # there is no folder to keep it in
        compiled = numba.njit(error_model="numpy")(function)
    return cast(Function, compiled)
