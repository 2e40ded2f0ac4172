"""A dense quadratic program with unit Hessian by the dual active-set solver DAQP, given the rows near a guess first.

    min ½ |v|² + f·v   subject to   low ≤ A v ≤ high,  low = high in the first `equalities` rows

In these coordinates a row's slack over its norm is the distance of the guess to the row's plane, so rows that are far
cannot bind where the solution is near.  They are left out, looked at afterwards, and put in where they turn out to be
violated: a solution that keeps all rows is the solution of the program with all rows, whatever was left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError
from flipdiagram.planning.native.condensing import compiled

ROWS_PER_VARIABLE = 1.5
"""Rows given to the solver at first, per variable; a solution has no more active rows than variables."""
TOLERANCE = 1e-9
"""Distance from a row's plane within which the row holds; DAQP's primal tolerance, in units of √cost."""
TOUCHING = 1e-5
"""Distance of the guess from a row's plane up to which the row is taken to be active at first."""
ITERATIONS = 2000
"""Most iterations of one call of DAQP, some ten times what these programs need."""
STATUS = {
    1: "kSolutionFound",
    -1: "kInfeasibleConstraints",
    -2: "kSolverSpecificError",  # cycling
    -3: "kUnbounded",
    -4: "kIterationLimit",
}
"""DAQP's exit flags by Drake's names of a SolutionResult; any other is a solver-specific error."""


@dataclass(frozen=True)
class Minimum:
    """v (n,), multipliers (m,) (> 0 at upper, < 0 at lower bounds), DAQP's word, iterations, and calls of DAQP."""

    v: Floats
    multipliers: Floats
    status: str
    iterations: int
    rounds: int

    @property
    def success(self) -> bool:
        """Whether v is the minimum."""
        return self.status == STATUS[1]


@cache
def load_daqp() -> Any:
    """The module daqp; raises InputError, which says how to install it, where it is missing."""
    try:
        return import_module("daqp")
    except ImportError:
        raise InputError(
            "scenario field 'planner.solver' = 'daqp' needs the package daqp: pip install 'flipdiagram[fast]';"
            " valid without it is clarabel"
        ) from None


def minimise(f: Floats, A: Floats, low: Floats, high: Floats, equalities: int, slack: Floats) -> Minimum:
    """The minimum; slack (m,) is that of each row at the guess (negative: violated), of any value for equalities.

    It decides about speed only: which rows are given to the solver at first, and which of them as active ones.
    """
    daqp, loops = load_daqp(), compiled()
    norm, distance, scratch, multipliers = np.zeros((4, low.size))
    chosen, kind = np.empty(low.size, dtype=np.bool_), np.empty(low.size, dtype=np.int32)
    touching = loops.distances(A, low, high, slack, equalities, TOUCHING, TOLERANCE, norm, distance, kind, scratch)
    if touching < 0:  # a row on what is fixed already does not hold
        return Minimum(np.zeros(f.size), multipliers, STATUS[-1], 0, 0)
    count = int(ROWS_PER_VARIABLE * f.size)
    loops.choose(distance, norm, loops.kth(scratch, count) if count < low.size else np.inf, chosen)
    if touching > f.size:  # then the guess is none
        kind[equalities:] = 0
    unit, store = _unit(f.size), np.empty(A.size)
    iterations = rounds = 0
    while True:
        rounds += 1
        use = np.flatnonzero(chosen)
        part = store[: use.size * f.size].reshape(use.size, f.size)
        lower, upper, kinds = np.empty(use.size), np.empty(use.size), np.empty(use.size, dtype=np.int32)
        loops.pick(A, low, high, kind, use, part, lower, upper, kinds)
        v, _, flag, info = daqp.solve(unit, f, part, upper, lower, kinds, primal_tol=TOLERANCE, iter_limit=ITERATIONS)
        iterations += int(info["iterations"])
        if flag != 1:
            if kind[equalities:].any():  # whether or not a bad guess did the harm: once more without
                kind[equalities:] = 0
                continue
            return Minimum(v, multipliers, STATUS.get(flag, STATUS[-2]), iterations, rounds)
        multipliers[use] = info["lam"]
        if not loops.add_violated(A, v, low, high, norm, TOLERANCE, chosen):
            return Minimum(v, multipliers, STATUS[1], iterations, rounds)
        loops.working_set(multipliers, equalities, kind)


@lru_cache(maxsize=64)
def _unit(n: int) -> Floats:
    """The Hessian (n, n), which DAQP only reads."""
    return np.eye(n)
