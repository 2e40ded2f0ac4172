"""Choices that work over every scalar: bool conditions of floats and AutoDiffXd, Formulas of Expressions."""

from typing import Any

from pydrake.symbolic import Formula, if_then_else


def choose(condition: Any, yes: Any, no: Any) -> Any:
    """``yes`` where the condition holds, else ``no``; of Expressions both are evaluated to one Expression."""
    return if_then_else(condition, yes, no) if isinstance(condition, Formula) else (yes if condition else no)


def sign(value: Any) -> Any:
    """sgn(value): 1, 0 or -1."""
    one = type(value)(1.0)
    return choose(value > 0.0, one, choose(value < 0.0, -one, 0.0 * one))
