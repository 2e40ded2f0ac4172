"""The quadratic program of a replan by CasADi's interfaces to qpOASES and OSQP: that of a real-time iteration."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.timing import timed

PACKAGE = "casadi"
SOLVERS: dict[str, dict[str, Any]] = {
    "qpoases": {"printLevel": "none"},
    "osqp": {"osqp": {"verbose": False, "eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 100_000}},
}
"""With their options; tolerances of OSQP such that its plan keeps the rows as well as ours."""

Array = NDArray[np.float64]


def prepare(solver: str, A: Array) -> Callable[..., tuple[float, Array]]:
    """solve(f, A, low, high) -> time [s], v of min ½ |v|² + f·v, low ≤ A v ≤ high, for programs of this size."""
    import casadi as ca

    m, n = A.shape
    structure = {"h": ca.Sparsity.diag(n), "a": ca.Sparsity.dense(m, n)}
    conic, unit = ca.conic("qp", solver, structure, {"error_on_fail": True, **SOLVERS[solver]}), ca.DM.eye(n)

    def solve(f: Array, A: Array, low: Array, high: Array) -> tuple[float, Array]:
        with silence():
            elapsed, found = timed(lambda: conic(h=unit, g=f, a=A, lba=low, uba=high))
        return elapsed, np.array(found["x"]).ravel()

    return solve


@contextmanager
def silence() -> Iterator[None]:
    """Nothing on the process's standard output: qpOASES prints its licence whatever its print level."""
    sys.stdout.flush()
    kept, nothing = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nothing)
