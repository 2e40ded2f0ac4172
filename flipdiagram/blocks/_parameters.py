"""Checked vectors for the blocks' constructors and their numeric parameters.

A block keeps its gains as numeric parameters in the Context, so that one diagram serves many gain sets
and a gain may be an AutoDiffXd or a symbolic variable. Only plain numbers can be range-checked;
arrays of other scalars (dtype object) are checked for their shape alone.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import BasicVector_, DependencyTicket, NumericParameterIndex

from flipdiagram.arrays import Array
from flipdiagram.errors import InputError

"""Floats, or objects of AutoDiffXd or Expression."""

# Names for the reader: pydrake's stubs type arrays as ndarray[float64], which fits no array and no other T.
ScalarContext = Any
"""Context_[T]."""
ScalarVector = Any
"""BasicVector_[T]."""
ScalarDiscreteValues = Any
"""DiscreteValues_[T]."""


def channels(
    name: str, value: ArrayLike, size: int | None = None, *, minimum: float = 0.0, strict: bool = False
) -> Array:
    """A vector of one number per channel, shape (size,); a single number is repeated for every channel.

    Raises InputError, naming ``name`` and the value, for a wrong shape, a value that is not finite, one
    below ``minimum``, or (``strict``) one equal to it.
    """
    vector = np.atleast_1d(np.array(value))
    if size is not None and vector.shape == (1,):
        vector = np.repeat(vector, size)
    if vector.ndim != 1 or vector.size == 0 or (size is not None and vector.size != size):
        wanted = "at least one channel" if size is None else f"{size} channels"
        raise InputError(f"{name} has shape {np.shape(value)}; give a vector of {wanted}")
    if vector.dtype == object:
        return vector
    vector = vector.astype(float)
    valid = np.isfinite(vector) & ((vector > minimum) if strict else (vector >= minimum))
    if not valid.all():
        bound = f"{'>' if strict else '>='} {minimum:g}"
        raise InputError(f"{name} = {vector.tolist()}; every entry must be finite and {bound}")
    return vector


def nominal_inertia(value: ArrayLike) -> Array:
    """A nominal inertia [kg m^2] (or [kg]): diagonal (n,) > 0, or symmetric positive definite matrix (n, n).

    Raises InputError, naming the value, otherwise.
    """
    inertia = np.atleast_1d(np.array(value))
    if inertia.ndim == 1:
        return channels("nominal inertia", inertia, strict=True)
    if inertia.ndim != 2 or inertia.shape[0] != inertia.shape[1]:
        raise InputError(f"nominal inertia has shape {inertia.shape}; give (n,) for a diagonal or (n, n)")
    if inertia.dtype == object:
        return inertia
    inertia = inertia.astype(float)
    symmetric = np.isfinite(inertia).all() and np.allclose(inertia, inertia.T)
    if not symmetric or np.linalg.eigvalsh(inertia).min() <= 0.0:
        raise InputError(f"nominal inertia = {inertia.tolist()}; it must be symmetric positive definite")
    return inertia


def same_form(inertia: Array, built: Array) -> Array:
    """``inertia`` in the form of ``built``: a diagonal (n,) is spread to (n, n) where a matrix was built.

    Raises InputError, naming both shapes, where the numbers do not fit.
    """
    if inertia.ndim == 1 and built.shape == (inertia.size, inertia.size):
        return np.diag(inertia)
    if inertia.shape != built.shape:
        raise InputError(f"nominal inertia has shape {inertia.shape}; valid here is {built.shape}")
    return inertia


def times_inertia(inertia: Array, vector: Array) -> Array:
    """M_n vector, shape (n,), for M_n given as its diagonal (n,) or as a matrix (n, n)."""
    # ndarray.dot: on small arrays a third of the time of @.
    return inertia * vector if inertia.ndim == 1 else inertia.dot(vector)


def sampling(period: float, offset: float) -> tuple[float, float]:
    """A period > 0 and an offset >= 0 [s] of a sampled block, as floats; else raises InputError."""
    if not (np.isfinite(period) and period > 0.0):
        raise InputError(f"period = {period} s; it must be finite and > 0")
    if not (np.isfinite(offset) and offset >= 0.0):
        raise InputError(f"offset = {offset} s; it must be finite and >= 0")
    return float(period), float(offset)


def declare_parameter(system: Any, scalar: type, values: Array) -> tuple[int, DependencyTicket]:
    """Declares ``values`` (flattened) as a numeric parameter of ``system``; returns its index and ticket."""
    index = system.DeclareNumericParameter(BasicVector_[scalar](values.ravel()))
    return index, system.numeric_parameter_ticket(NumericParameterIndex(index))


def write_parameter(context: ScalarContext, index: int, values: Array) -> None:
    """Writes ``values`` (flattened) into the numeric parameter ``index`` of ``context``."""
    context.get_mutable_numeric_parameter(index).SetFromVector(values.ravel())
