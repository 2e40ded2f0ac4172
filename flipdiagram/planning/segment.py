"""A piece of motion from one rest to another, as smooth as the contact allows: a quadratic program, re-linearised."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from pydrake.solvers import MathematicalProgram

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning.horizon import STATES, Layout
from flipdiagram.planning.program import add_smoothing, dynamics, make_solver
from flipdiagram.planning.rows import Constraint, Linearisation, Rows

ITERATIONS = 12
SETTLED = 1e-3
"""Change of θ [rad] below which the linearisation counts as right."""


class SegmentProgram:
    """min Σ |Δu|² over N intervals from a state at rest to another, subject to eq. (2) and stacked rows.

    Built once for a number of intervals; `plan` changes numbers only.  Variables are divided by their units.
    """

    def __init__(self, intervals: int, sampling_time: float, solver: str = "clarabel") -> None:
        self.layout, self.sampling_time = Layout(intervals, 0), sampling_time
        self._solver, self._units = make_solver(solver), self.layout.units()
        self.prog = prog = MathematicalProgram()
        size = self.layout.size
        self._z = prog.NewContinuousVariables(size, "w")
        prog.AddLinearEqualityConstraint(dynamics(self.layout, sampling_time), np.zeros(STATES * intervals), self._z)
        add_smoothing(prog, self.layout, self._z, 1.0, least=1e-9)
        self._ends = prog.AddBoundingBoxConstraint(np.full(size, -1e9), np.full(size, 1e9), self._z)
        self._rows = prog.AddLinearConstraint(sp.csc_matrix((1, size)), [-np.inf], [1.0], self._z)

    def plan(self, start: Floats, end: Floats, constraints: Sequence[Constraint]) -> tuple[Floats, Floats]:
        """States (N + 1, 6) and inputs (N, 3) between two places (y, z, θ) at rest.

        Raises PlanningError where the program has no solution or θ does not settle.
        """
        layout, dt = self.layout, self.sampling_time
        n = layout.intervals
        low, high = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
        for sample, place in ((0, start), (n, end)):
            columns = slice(int(layout.x(sample, 0)), int(layout.x(sample, 0)) + STATES)
            low[columns] = high[columns] = [*place, 0.0, 0.0, 0.0]
        self._ends.evaluator().UpdateLowerBound(low / self._units)
        self._ends.evaluator().UpdateUpperBound(high / self._units)
        share = np.linspace(0, 1, n + 1)[:, None]
        smooth = share**3 * (10 - 15 * share + 6 * share**2)
        states = np.hstack([start + smooth * (np.asarray(end) - start), np.zeros((n + 1, 3))])
        inputs, linearisation = np.zeros((n, 3)), Linearisation(constraints)
        for _ in range(ITERATIONS):
            w = layout.pack(states, inputs)
            rows = Rows.about(w, [linearisation.at(w)])
            matrix = sp.csc_matrix(rows.matrix(layout.size) @ sp.diags(self._units))
            self._rows.evaluator().UpdateCoefficients(matrix, np.full(rows.count, -np.inf), rows.upper)
            result = self._solver.Solve(self.prog, None, None)
            if not result.is_success():
                raise PlanningError(f"no motion in {n * dt:.2f} s: {result.get_solution_result().name}")
            theta = states[:, 2]
            states, inputs = layout.unpack(self._units * result.GetSolution(self._z))
            if float(np.abs(states[:, 2] - theta).max()) < SETTLED:
                return states, inputs
        raise PlanningError(f"the motion has not settled within {ITERATIONS} linearisations")
