"""The MPC's quadratic program: one MathematicalProgram, built once; each solve changes numbers only.

Decision variables are those of `Layout`, divided by their units.  The cost is J of eq. (5) at touch-down, linear in
the release state through the ballistic flight, plus a small weight on the acceleration differences, which makes the
solution unique and smooth.  An elastic program carries one slack per group of constraints at a linear price: it has
a solution where the plain one has none, and its slacks name the constraint that cannot be met.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from pydrake import solvers
from pydrake.solvers import MathematicalProgram, SolverInterface

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.horizon import STATES, STRIDE, Layout
from flipdiagram.planning.model import LandingCost, flight, transition
from flipdiagram.planning.rows import Rows

_NAMES = ("clarabel", "osqp", "scs", "ipopt", "snopt", "mosek", "gurobi")
_SOLVERS = {name: getattr(solvers, f"{name.capitalize()}Solver") for name in _NAMES}
SLACK_PRICE = 30.0
"""Price of a unit of slack; above the multipliers of a feasible program, so that slack is zero there."""
TRUST_LENGTH = 0.5
"""Trust radius of y and z per trust radius of θ [m/rad]."""
FREE_TRUST = 1.0
"""Trust radius [rad] from which y and z are not bounded."""
TURNING_RADIUS = 0.05
"""Lever [m] at which angular accelerations count in the smoothing cost, about the block's and blade's half-size."""
LEVERS = (1.0, 1.0, TURNING_RADIUS)
"""Of (y, z, θ) there."""


def make_solver(name: str) -> SolverInterface:
    """Drake's solver of that name; raises InputError where this Drake lacks it or its licence."""
    solver: SolverInterface = _SOLVERS[name]()
    if not (solver.available() and solver.enabled()):
        usable = [n for n, kind in _SOLVERS.items() if kind().available() and kind().enabled()]
        problem = f"scenario field 'planner.solver' = {name!r} cannot be used here (not built in, or no licence)"
        raise InputError.of("planner.solver", name, usable, problem)
    return solver


HOLD = 1e4
"""Weight, in those of the smoothing, on a change of the acceleration inside the sample in progress: it keeps what it
has but for what a constraint demands, so that a plan begun at its own state, anywhere in a sample, comes out again."""


def hold_of(point: Trajectory) -> float:
    """Weight of |u_0 − before|² in those of the smoothing, where the trajectory moves first."""
    return HOLD if point.passed else 1.0


def dynamics(layout: Layout, sampling_time: float, first: int = 0, passed: float = 0.0) -> sp.csc_matrix:
    """Eq. (2) of all intervals as rows (6 N, size) that are zero, on variables and of states divided by their units.

    passed: of the interval `first` [s], which is shorter by it.
    """
    n, units = layout.intervals, layout.units()
    a, b = transition(sampling_time)
    here = sp.kron(sp.eye(n, n + 1), sp.hstack([sp.csr_matrix(-a), sp.csr_matrix(-b)]))
    if passed:
        short = np.hstack(transition(sampling_time - passed)) - np.hstack([a, b])
        here = here - sp.kron(sp.csr_matrix(([1.0], ([first], [first])), (n, n + 1)), short)
    following = sp.kron(sp.eye(n, n + 1, k=1), sp.eye(STATES, STRIDE))
    rows = (here + following).tocsr()[:, : layout.size]
    return sp.csc_matrix(sp.diags(1 / np.tile(units[:STATES], n)) @ (rows @ sp.diags(units)))


def add_smoothing(prog: Any, layout: Layout, z: Any, weight: float, least: float = 0.0) -> list[Any]:
    """A weight on Σ |Δu|² ≈ ΔT ∫ jerk² dt, the rests before and after counted as no acceleration; `least` on ½ |u|².

    Returns the cost of each axis.
    """
    n = layout.intervals
    difference = np.eye(n + 1, n) - np.eye(n + 1, n, k=-1)
    gram, costs = difference.T @ difference * (2 * weight), []
    for component, lever in enumerate(LEVERS):
        columns = layout.u(np.arange(n), component)
        scale = lever * layout.units()[columns[0]]
        hessian = gram * scale**2 + least * np.eye(n)
        costs.append(prog.AddQuadraticCost(hessian, np.zeros(n), 0.0, z[columns], is_convex=True).evaluator())
    return costs


def go_on(costs: Sequence[Any], layout: Layout, weight: float, point: Trajectory, first: int = 0) -> None:
    """Let costs of `add_smoothing` count the first difference from the acceleration before, in the interval `first`."""
    if point.before is None:
        return
    for axis, cost in enumerate(costs):
        unit = layout.units()[layout.u(first, axis)]
        scaled = 2 * weight * (unit * LEVERS[axis]) ** 2
        Q, b = cost.Q().copy(), cost.b().copy()
        Q[first, first] += scaled * (hold_of(point) - 1.0)
        b[first] = -scaled * hold_of(point) * point.before[axis] / unit
        cost.UpdateCoefficients(Q, b, 0.0, is_convex=True)


@dataclass(frozen=True)
class Solution:
    """What one solve gave: SI decision vector, slack per group, solver's word and time [s], largest row violation."""

    success: bool
    w: Floats
    slack: dict[str, float]
    status: str
    solve_time: float
    iterations: int
    residual: float


class HorizonProgram:
    """min J + smoothing over the horizon, subject to eq. (2), the start, the landing height and stacked rows."""

    def __init__(
        self,
        layout: Layout,
        sampling_time: float,
        cost: LandingCost,
        smoothing: float,
        solver: str = "clarabel",
        elastic_groups: Sequence[str] = (),
    ) -> None:
        self.layout, self.sampling_time, self.cost = layout, sampling_time, cost
        self._solver = make_solver(solver)
        self._groups = list(elastic_groups)
        self._units = layout.units()
        prog = self.prog = MathematicalProgram()
        self._z = prog.NewContinuousVariables(layout.size, "w")
        self._slack = prog.NewContinuousVariables(len(self._groups), "slack")
        variables = np.concatenate([self._z, self._slack])
        # rows in the units of the state they advance
        self._dynamics, self._begun = dynamics(layout, sampling_time), (0, 0.0)
        no_rest = np.zeros(self._dynamics.shape[0])
        self._transitions = prog.AddLinearEqualityConstraint(self._dynamics, no_rest, self._z).evaluator()
        self._jumps = smoothing / sampling_time
        self._smoothing = add_smoothing(prog, layout, self._z, self._jumps)
        self._hessians = [cost.Q() for cost in self._smoothing]
        size = variables.size
        self._bounds = prog.AddBoundingBoxConstraint(np.full(layout.size, -1e9), np.full(layout.size, 1e9), self._z)
        if self._groups:
            prog.AddBoundingBoxConstraint(0.0, 1e6, self._slack)
            prog.AddLinearCost(np.full(len(self._groups), SLACK_PRICE), 0.0, self._slack)
        self._rows = prog.AddLinearConstraint(sp.csc_matrix((1, size)), [-np.inf], [1.0], variables)
        columns = slice(STRIDE * layout.release, STRIDE * layout.release + STATES)
        released, self._released_units = self._z[columns], self._units[columns]
        self._landing_cost = prog.AddQuadraticCost(np.eye(STATES), np.zeros(STATES), 0.0, released, is_convex=True)
        self._landing = prog.AddLinearEqualityConstraint(np.ones((1, STATES)), np.zeros(1), released)
        self._current: Rows | None = None

    def update(self, start: Floats, point: Trajectory, landing: tuple[Floats, float], rows: Rows, trust: float) -> None:
        """New numbers: start (6,), landing row on x̂(release) and its bound, rows linearised about `point`, trust.

        Trust is the radius [rad] in which θ may move about `point`; y and z may move by `TRUST_LENGTH` times it, or
        freely where it is `FREE_TRUST` or more.
        """
        layout, near, waiting = self.layout, point.states, self.layout.release - point.n_contact
        low, high = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
        samples = np.arange(1, layout.intervals + 1)
        # rows that cannot bind cost time all the same: y and z are bounded once the trust has shrunk
        length = trust * TRUST_LENGTH if trust < FREE_TRUST else np.inf
        for component, radius in enumerate((length, length, trust)):
            low[layout.x(samples, component)] = near[1:, component] - radius
            high[layout.x(samples, component)] = near[1:, component] + radius
        for component in range(3):
            still = layout.u(np.arange(waiting), component)
            low[still] = high[still] = 0.0
            # the waiting states follow from the start; bounds on them would only repeat the equality
            idle = layout.x(samples[:waiting], component)
            low[idle], high[idle] = -np.inf, np.inf
        low[:STATES] = high[:STATES] = start
        if layout.n_brake:
            low[-3:] = high[-3:] = 0.0
        self._begin(point, waiting)
        self._bounds.evaluator().UpdateLowerBound(low / self._units)
        self._bounds.evaluator().UpdateUpperBound(high / self._units)

        matrix, offset = flight(point.n_flight * self.sampling_time)
        w = self.cost.residual_matrix()
        map_ = w @ matrix * self._released_units
        residual = w @ (offset - self.cost.target())
        self._landing_cost.evaluator().UpdateCoefficients(
            2 * map_.T @ map_, 2 * map_.T @ residual, float(residual @ residual), is_convex=True
        )
        row, bound = landing
        self._landing.evaluator().UpdateCoefficients((row * self._released_units)[None, :], [bound])

        self._current, matrix = rows, rows.matrix(layout.size)
        scaled = matrix @ sp.diags(self._units)
        if self._groups:
            group_of = {name: i for i, name in enumerate(self._groups)}
            column = np.array([group_of[name] for name in rows.names()])
            slack = sp.csc_matrix(
                (-np.ones(rows.count), (np.arange(rows.count), column)), (rows.count, len(self._groups))
            )
            scaled = sp.hstack([scaled, slack])
        self._rows.evaluator().UpdateCoefficients(sp.csc_matrix(scaled), np.full(rows.count, -np.inf), rows.upper)

    def _begin(self, point: Trajectory, first: int) -> None:
        """The first interval that moves: how long it is, and from which acceleration it goes on."""
        begun = (first, point.passed) if point.passed else (0, 0.0)
        if begun != self._begun:
            self._dynamics, self._begun = dynamics(self.layout, self.sampling_time, *begun), begun
            self._transitions.UpdateCoefficients(self._dynamics, np.zeros(self._dynamics.shape[0]))
        for cost, hessian in zip(self._smoothing, self._hessians, strict=True):
            cost.UpdateCoefficients(hessian, np.zeros(len(hessian)), 0.0, is_convex=True)
        go_on(self._smoothing, self.layout, self._jumps, point, first)

    def solve(self) -> Solution:
        """Solve with the current numbers."""
        if self._current is None:
            raise ValueError("solve() needs the numbers of an update() first")
        begin = time.perf_counter()
        result = self._solver.Solve(self.prog, None, None)
        elapsed = time.perf_counter() - begin
        z = result.GetSolution(self._z)
        w = self._units * z
        slack = dict(zip(self._groups, np.maximum(result.GetSolution(self._slack), 0.0).tolist(), strict=True))
        details = result.get_solver_details()
        residual = max(self._current.excess(w), float(np.max(np.abs(self._dynamics @ z), initial=0.0)))
        return Solution(
            success=bool(result.is_success()),
            w=w,
            slack=slack,
            status=result.get_solution_result().name,
            solve_time=elapsed,
            iterations=int(getattr(details, "iterations", getattr(details, "iter", 0))),
            residual=residual,
        )
