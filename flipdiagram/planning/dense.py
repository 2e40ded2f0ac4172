"""A dense quadratic program with unit Hessian, solved by DAQP, which is given the rows nearest to a guess first.

    min ½ |v|² + f·v   subject to   low ≤ A v ≤ high,  low = high in the first `equalities` rows

In these coordinates a row's slack at the guess over its norm is the distance of the guess from the row's plane: rows
that are far cannot bind where the solution is near.  A solution that keeps all rows is that of the program with all
rows, whatever DAQP was given; where it does not keep them, those that it violates are given as well.  All rows at once
take DAQP 2.5 times as long with 25 intervals and 35 times with 50.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import daqp
import numpy as np

from flipdiagram.arrays import Floats

ROWS_PER_VARIABLE = 1.5
"""Rows given to DAQP at first, per variable; a solution has no more active rows than variables."""
TOLERANCE = 1e-9
"""Distance from a row's plane within which the row holds; DAQP's primal tolerance, in units of √cost."""
TOUCHING = 1e-5
"""Distance of the guess from a row's plane up to which DAQP starts with the row as an active one."""
ITERATIONS = 2000
"""Most iterations of one call of DAQP, some ten times what these programs need."""
EQUALITY, ACTIVE = 5, 1
"""DAQP's kinds of rows; 0 is an inequality that is not active at first."""
STATUS = {
    1: "kSolutionFound",
    -1: "kInfeasibleConstraints",
    -2: "kSolverSpecificError",  # cycling
    -3: "kUnbounded",
    -4: "kIterationLimit",
}
"""DAQP's exit flags by Drake's names of a SolutionResult; any other is a solver-specific error."""


class DenseProgram(NamedTuple):
    """f (n,), A (m, n), low, high (m,); slack (m,) of each row at the guess, and the norm of each row of A.

    The slack (negative: violated; any value for equalities) decides about speed only.
    """

    f: Floats
    A: Floats
    low: Floats
    high: Floats
    equalities: int
    slack: Floats
    norm: Floats


@dataclass(frozen=True)
class Minimum:
    """v (n,), multipliers (m,) (> 0 at upper, < 0 at lower bounds), DAQP's word, and iterations."""

    v: Floats
    multipliers: Floats
    status: str
    iterations: int

    @property
    def success(self) -> bool:
        """Whether v is the minimum."""
        return self.status == STATUS[1]


def minimise(program: DenseProgram) -> Minimum:
    """The minimum by DAQP."""
    f, A, low, high, equalities, slack, norm = program
    if not norm.all():  # rows of zeros decide about nothing
        nothing = norm == 0.0
        if np.any(nothing & ((low > TOLERANCE) | (high < -TOLERANCE))):
            return Minimum(np.zeros(f.size), np.zeros(low.size), STATUS[-1], 0)
        slack, norm = np.where(nothing, np.inf, slack), np.where(nothing, 1.0, norm)
    distance = slack / norm
    distance[:equalities] = -np.inf
    kind = np.where(distance < TOUCHING, ACTIVE, 0).astype(np.int32)
    if np.count_nonzero(kind) > f.size:  # then the guess is none
        kind[:] = 0
    kind[:equalities] = EQUALITY
    count = int(ROWS_PER_VARIABLE * f.size)
    use = np.argpartition(distance, count)[:count] if count < distance.size else np.arange(distance.size)
    use.sort()  # equalities first
    iterations = 0
    while True:
        v, _, flag, info = daqp.solve(
            _unit(f.size), f, A[use], high[use], low[use], kind[use], primal_tol=TOLERANCE, iter_limit=ITERATIONS
        )
        iterations += int(info["iterations"])
        multipliers = np.zeros(low.size)
        if flag != 1 and kind[equalities:].any():  # whether or not a bad guess did the harm: once more without
            kind[equalities:] = 0
            continue
        if flag == 1:
            multipliers[use] = info["lam"]
            value = A @ v
            violated = np.maximum(value - high, low - value) > TOLERANCE * norm
            violated[use] = False
            if violated.any():
                use = np.union1d(use, np.flatnonzero(violated))
                kind[equalities:] = np.sign(np.abs(multipliers[equalities:])) + 2 * (multipliers[equalities:] < 0)
                continue
        return Minimum(v, multipliers, STATUS.get(flag, STATUS[-2]), iterations)


@lru_cache(maxsize=64)
def _unit(n: int) -> Floats:
    """The Hessian (n, n), which DAQP only reads."""
    return np.eye(n)
