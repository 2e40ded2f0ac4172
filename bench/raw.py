"""The solver itself: a MathematicalProgram's QP as matrices, and Clarabel called on them without Drake.

    min ½ xᵀP x + qᵀx + c   subject to   A x + s = b,  s = 0 in the first `equalities` rows, s ≥ 0 in the others

Bounds and rows of a MathematicalProgram that are infinite have no row here.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from pydrake.solvers import MathematicalProgram

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Matrices:
    """A quadratic program as Clarabel takes it; P holds the upper triangle."""

    P: sp.csc_matrix
    q: Array
    constant: float
    A: sp.csc_matrix
    b: Array
    equalities: int

    def objective(self, x: Array) -> float:
        """Value of the cost at x."""
        full = self.P + sp.triu(self.P, 1).T
        return float(x @ (full @ x) / 2 + self.q @ x + self.constant)

    def violation(self, x: Array) -> float:
        """Largest violation of any row at x."""
        s = self.b - self.A @ x
        return float(max(np.abs(s[: self.equalities]).max(), np.max(-s[self.equalities :], initial=0.0)))


def matrices(prog: MathematicalProgram) -> Matrices:
    """Read the costs, equalities, bounds and inequalities of a program."""
    size = prog.num_vars()
    P, q, constant = sp.csc_matrix((size, size)), np.zeros(size), 0.0
    for binding in prog.quadratic_costs():
        at, cost = _place(prog, binding), binding.evaluator()
        P += at.T @ sp.csc_matrix(cost.Q()) @ at
        q += at.T @ cost.b()
        constant += cost.c()
    for binding in prog.linear_costs():
        q += _place(prog, binding).T @ binding.evaluator().a()
        constant += binding.evaluator().b()
    equal: list[tuple[Any, Array]] = []
    less: list[tuple[Any, Array]] = []
    constraints = prog.linear_equality_constraints() + prog.bounding_box_constraints() + prog.linear_constraints()
    for binding in constraints:
        rows = binding.evaluator().get_sparse_A() @ _place(prog, binding)
        low, high = binding.evaluator().lower_bound(), binding.evaluator().upper_bound()
        same, above, below = low == high, np.isfinite(high), np.isfinite(low)
        equal.append((rows[same], high[same]))
        less.append((rows[above & ~same], high[above & ~same]))
        less.append((-rows[below & ~same], -low[below & ~same]))
    A = sp.vstack([rows for rows, _ in equal + less]).tocsc()
    b = np.concatenate([bound for _, bound in equal + less])
    A.eliminate_zeros()
    return Matrices(sp.csc_matrix(sp.triu(P)), q, constant, A, b, sum(bound.size for _, bound in equal))


def _place(prog: MathematicalProgram, binding: Any) -> sp.csr_matrix:
    """Selects a binding's variables out of all."""
    columns = prog.FindDecisionVariableIndices(binding.variables())
    return sp.csr_matrix((np.ones(len(columns)), (range(len(columns)), columns)), (len(columns), prog.num_vars()))


def solve(problem: Matrices) -> Any:
    """Set up and solve with Clarabel's own interface and default settings, which are those Drake uses; its solution."""
    clarabel = import_module("clarabel")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(problem.equalities), clarabel.NonnegativeConeT(problem.b.size - problem.equalities)]
    return clarabel.DefaultSolver(problem.P, problem.q, problem.A, problem.b, cones, settings).solve()
