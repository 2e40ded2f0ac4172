"""A piece of motion from one rest to another, as smooth as the contact allows: a quadratic program, re-linearised."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from pydrake.solvers import MathematicalProgram

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.horizon import STATES, Layout
from flipdiagram.planning.model import transition
from flipdiagram.planning.program import TURNING_RADIUS, make_solver
from flipdiagram.planning.rows import Rows

ITERATIONS = 12
SETTLED = 1e-3
"""Change of θ [rad] below which the linearisation counts as right."""
RowsOf = Callable[[Rows, Layout, Trajectory], None]


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
        dynamics = self._dynamics()
        prog.AddLinearEqualityConstraint(dynamics, np.zeros(dynamics.shape[0]), self._z)
        self._add_smoothness()
        self._ends = prog.AddBoundingBoxConstraint(np.full(size, -1e9), np.full(size, 1e9), self._z)
        self._rows = prog.AddLinearConstraint(sp.csc_matrix((1, size)), [-np.inf], [1.0], self._z)

    def _dynamics(self) -> sp.csc_matrix:
        layout, n = self.layout, self.layout.intervals
        a, b = transition(self.sampling_time)
        matrix = sp.lil_matrix((STATES * n, layout.size))
        for k in range(n):
            rows = slice(STATES * k, STATES * (k + 1))
            first, following = int(layout.x(k, 0)), int(layout.x(k + 1, 0))
            matrix[rows, first : first + STATES] = -a
            matrix[rows, first + STATES : first + STATES + 3] = -b
            matrix[rows, following : following + STATES] = np.eye(STATES)
        return sp.csc_matrix(sp.diags(1 / np.tile(self._units[:STATES], n)) @ matrix.tocsr() @ sp.diags(self._units))

    def _add_smoothness(self) -> None:
        layout, n = self.layout, self.layout.intervals
        difference = np.eye(n + 1, n) - np.eye(n + 1, n, k=-1)
        for component, lever in enumerate((1.0, 1.0, TURNING_RADIUS)):
            columns = layout.u(np.arange(n), component)
            scale = lever * self._units[columns[0]]
            gram = 2 * scale**2 * difference.T @ difference + 1e-9 * np.eye(n)
            self.prog.AddQuadraticCost(gram, np.zeros(n), 0.0, self._z[columns], is_convex=True)

    def plan(self, start: Floats, end: Floats, rows_of: RowsOf) -> tuple[Floats, Floats]:
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
        point = Trajectory(states, np.zeros((n, 3)), n, 1, dt)
        for _ in range(ITERATIONS):
            rows = Rows()
            rows_of(rows, layout, point)
            matrix, upper = rows.matrix(layout.size)
            self._rows.evaluator().UpdateCoefficients(
                sp.csc_matrix(matrix @ sp.diags(self._units)), np.full(rows.count, -np.inf), upper
            )
            result = self._solver.Solve(self.prog, None, None)
            if not result.is_success():
                raise PlanningError(f"no motion in {n * dt:.2f} s: {result.get_solution_result().name}")
            states, inputs = layout.unpack(self._units * result.GetSolution(self._z))
            change = float(np.abs(states[:, 2] - point.states[:, 2]).max())
            point = Trajectory(states, inputs, n, 1, dt)
            if change < SETTLED:
                return states, inputs
        raise PlanningError(f"the motion has not settled within {ITERATIONS} linearisations")
