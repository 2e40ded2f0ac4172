"""Checked numbers of the blocks: one per channel, an inertia, a period.

Only plain numbers can be range-checked; arrays of other scalars (dtype object: AutoDiffXd, Expression) are checked
for their shape alone, so that a gain may be a symbolic variable.
"""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.errors import InputError


def channels(
    name: str, value: ArrayLike, size: int | None = None, *, minimum: float = 0.0, strict: bool = False
) -> Array:
    """A vector of one number per channel, shape (size,); a single number is repeated for every channel.

    Raises InputError, naming `name` and the value, for a wrong shape, a value that is not finite, one below
    `minimum`, or (`strict`) one equal to it.
    """
    vector = np.atleast_1d(np.array(value))
    if size is not None and vector.shape == (1,):
        vector = np.repeat(vector, size)
    if vector.ndim != 1 or vector.size == 0 or (size is not None and vector.size != size):
        wanted = "at least one channel" if size is None else f"{size} channels"
        raise InputError.of(name, np.array(value).tolist(), f"a vector of {wanted}")
    if vector.dtype == object:
        return vector
    vector = vector.astype(float)
    within = np.isfinite(vector) & ((vector > minimum) if strict else (vector >= minimum))
    if not within.all():
        raise InputError.of(name, vector.tolist(), f"finite numbers {'>' if strict else '>='} {minimum:g}")
    return vector


def nominal_inertia(name: str, value: ArrayLike, size: int | None = None) -> Array:
    """A nominal inertia [kg m^2] (or [kg]): diagonal (n,) > 0, or symmetric positive definite matrix (n, n).

    Raises InputError, naming the value, otherwise.  `size` is not asked for: `same_form` compares with the one built.
    """
    inertia = np.atleast_1d(np.array(value))
    if inertia.ndim == 1:
        return channels(name, inertia, strict=True)
    if inertia.ndim != 2 or inertia.shape[0] != inertia.shape[1]:
        raise InputError.of(name, inertia.tolist(), "a diagonal, shape (n,), or a matrix, shape (n, n)")
    if inertia.dtype == object:
        return inertia
    inertia = inertia.astype(float)
    symmetric = np.isfinite(inertia).all() and np.allclose(inertia, inertia.T)
    if not symmetric or np.linalg.eigvalsh(inertia).min() <= 0.0:
        raise InputError.of(name, inertia.tolist(), "a symmetric positive definite matrix")
    return inertia


def same_form(name: str, value: Array, built: Array) -> Array:
    """`value` in the form of `built`: a diagonal (n,) is spread to (n, n) where a matrix was built.

    Raises InputError, naming the shapes, where the numbers do not fit.
    """
    if value.ndim == 1 and built.shape == (value.size, value.size):
        return np.diag(value)
    if value.shape != built.shape:
        raise InputError.of(name, value, str(built.shape), f"{name} has shape {value.shape}")
    return value


def times_inertia(inertia: Array, vector: Array) -> Array:
    """M_n vector, shape (n,), for M_n given as its diagonal (n,) or as a matrix (n, n)."""
    # ndarray.dot: on small arrays a third of the time of @.
    return inertia * vector if inertia.ndim == 1 else inertia.dot(vector)


def sampling(period: float, offset: float = 0.0) -> tuple[float, float]:
    """A period > 0 and an offset >= 0 [s] of a sampled block, as floats; else raises InputError."""
    if not (np.isfinite(period) and period > 0.0):
        raise InputError.of("period", period, "a finite number > 0 [s]")
    if not (np.isfinite(offset) and offset >= 0.0):
        raise InputError.of("offset", offset, "a finite number >= 0 [s]")
    return float(period), float(offset)


def whole(name: str, value: int, minimum: int = 0) -> int:
    """A whole number of at least `minimum`; else raises InputError."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < minimum:
        raise InputError.of(name, value, f"a whole number of at least {minimum}")
    return int(value)
