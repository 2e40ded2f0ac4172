"""A piece of motion to a rest, as smooth as the contact allows: a quadratic program, re-linearised."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from pydrake.solvers import MathematicalProgram

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.horizon import STATES, Layout
from flipdiagram.planning.program import add_smoothing, dynamics, go_on, make_solver
from flipdiagram.planning.rows import Constraint, Linearisation, Rows

ITERATIONS = 12
SETTLED = 1e-3
"""Change of θ [rad] below which the linearisation counts as right."""


def segment(
    start: Floats,
    end: Floats,
    constraints: Sequence[Constraint],
    layout: Layout,
    sampling_time: float,
    guess: Trajectory | None = None,
) -> tuple[Floats, Floats]:
    """States (N + 1, 6) and inputs (N, 3) between two places (y, z, θ) at rest; start: also a state (6,) in motion.

    min Σ |Δu|² subject to eq. (2) and the rows of the constraints.  Variables are divided by their units.  guess: the
    motion about which is linearised first, and how it begins; else a smooth one that begins at rest.

    Raises PlanningError where the program has no solution or θ does not settle.
    """
    if guess is None:
        guess = _smooth(start, end, layout.intervals, sampling_time)
    n, size, units, solver = layout.intervals, layout.size, layout.units(), make_solver("clarabel")
    prog = MathematicalProgram()
    z = prog.NewContinuousVariables(size, "w")
    prog.AddLinearEqualityConstraint(dynamics(layout, sampling_time, 0, guess.passed), np.zeros(STATES * n), z)
    go_on(add_smoothing(prog, layout, z, 1.0, least=1e-9), layout, 1.0, guess)
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    for columns, place in ((slice(STATES), start), (slice(-STATES, None), end)):
        low[columns] = high[columns] = np.append(place, np.zeros(STATES - len(place)))
    prog.AddBoundingBoxConstraint(low / units, high / units, z)
    linear = prog.AddLinearConstraint(sp.csc_matrix((1, size)), [-np.inf], [1.0], z)
    states, inputs, linearisation = guess.states, guess.inputs, Linearisation(constraints)
    for _ in range(ITERATIONS):
        w = layout.pack(states, inputs)
        rows = Rows.about(w, [linearisation.at(w)])
        matrix = sp.csc_matrix(rows.matrix(size) @ sp.diags(units))
        linear.evaluator().UpdateCoefficients(matrix, np.full(rows.count, -np.inf), rows.upper)
        result = solver.Solve(prog, None, None)
        if not result.is_success():
            raise PlanningError(f"no motion in {n * sampling_time:.2f} s: {result.get_solution_result().name}")
        theta = states[:, 2]
        states, inputs = layout.unpack(units * result.GetSolution(z))
        if float(np.abs(states[:, 2] - theta).max()) < SETTLED:
            return states, inputs
    raise PlanningError(f"the motion has not settled within {ITERATIONS} linearisations")


def _smooth(start: Floats, end: Floats, n: int, sampling_time: float) -> Trajectory:
    """Between two places at rest, without inputs."""
    share = np.linspace(0, 1, n + 1)[:, None]
    smooth = share**3 * (10 - 15 * share + 6 * share**2)
    states = np.hstack([start + smooth * (end - start), np.zeros((n + 1, 3))])
    return Trajectory(states, np.zeros((n, 3)), n, 1, sampling_time)
