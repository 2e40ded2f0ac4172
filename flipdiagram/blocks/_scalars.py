"""What laws are written with where NumPy does not serve every scalar: floats, AutoDiffXd, Expressions."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import pydrake.math as scalar_math
from pydrake.symbolic import Formula, if_then_else

from flipdiagram.arrays import Array

Function = TypeVar("Function", bound=Callable[..., Any])
OVER_FLOATS: dict[Callable[..., Any], Callable[..., Any]] = {}
"""What a function is over floats alone: machine code of a law calls this in its place."""


def over_floats(numpy_function: Callable[..., Any]) -> Callable[[Function], Function]:
    """Say what the function is over floats alone."""

    def register(function: Function) -> Function:
        OVER_FLOATS[function] = numpy_function
        return function

    return register


def choose(condition: Any, yes: Any, no: Any) -> Any:
    """``yes`` where the condition holds, else ``no``; of Expressions both are evaluated to one Expression."""
    return if_then_else(condition, yes, no) if isinstance(condition, Formula) else (yes if condition else no)


def sign(value: Any) -> Any:
    """sgn(value): 1, 0 or -1."""
    one = type(value)(1.0)
    return choose(value > 0.0, one, choose(value < 0.0, -one, 0.0 * one))


@over_floats(np.minimum)
def minimum(a: Array, b: Array) -> Array:
    """The smaller of each pair, shapes (n,)."""
    if a.dtype != object:
        return np.minimum(a, b)
    return np.array([scalar_math.min(x, y) for x, y in zip(a, b, strict=True)], dtype=object)


@over_floats(np.maximum)
def maximum(a: Array, b: Array) -> Array:
    """The larger of each pair, shapes (n,)."""
    if a.dtype != object:
        return np.maximum(a, b)
    return np.array([scalar_math.max(x, y) for x, y in zip(a, b, strict=True)], dtype=object)
