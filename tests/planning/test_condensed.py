"""The condensed program against HorizonProgram with Clarabel, and against the optimality conditions themselves."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from scipy.optimize import nnls

from flipdiagram.planning import Planner, dense
from flipdiagram.planning.condensed import CondensedProgram, unit_smoothing_basis
from flipdiagram.planning.convexification import GROUPS, Convexification
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import flight
from flipdiagram.planning.program import HorizonProgram
from flipdiagram.planning.rows import Rows, part

LEVER = 0.05


@pytest.fixture(scope="module")
def linearisations(scenario):
    """What `update` was given in the search for the default plan, from first guess to settled motion."""
    calls, update = [], CondensedProgram.update

    def spy(program, *arguments):
        calls.append(arguments)
        update(program, *arguments)

    with patch.object(CondensedProgram, "update", spy):
        Planner(scenario).plan()
    assert len({(point.n_contact, point.n_flight) for _, point, *_ in calls}) > 8  # horizons
    return calls


def build(planner, solver):
    program = planner.horizons.program(solver)
    if solver == "clarabel":
        # the cost is flat: near the minimum w moves a thousand times as far as Clarabel's own tolerance of J
        for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
            program.prog.SetSolverOption(ClarabelSolver.id(), name, 1e-13)
        for name in ("reduced_tol_gap_abs", "reduced_tol_gap_rel", "reduced_tol_feas"):
            program.prog.SetSolverOption(ClarabelSolver.id(), name, 1e-11)
    return program


@pytest.fixture(scope="module")
def condensed(planner):
    return build(planner, "daqp")


@pytest.fixture(scope="module")
def reference(planner):
    return build(planner, "clarabel")


def objective(planner, w, n_flight):
    """J of eq. (5) plus smoothing."""
    settings, layout = planner.scenario.planner, planner.horizons.layout
    states, inputs = layout.unpack(w)
    matrix, offset = flight(n_flight * settings.sampling_time)
    jumps = np.diff(np.vstack([np.zeros(3), inputs, np.zeros(3)]), axis=0) * [1, 1, LEVER]
    return planner.horizons.cost(
        matrix @ states[layout.release] + offset
    ) + settings.smoothing / settings.sampling_time * np.sum(jumps**2)


def assert_same(planner, found, expected, n_flight):
    assert found.success and expected.success
    cost = objective(planner, expected.w, n_flight)
    assert objective(planner, found.w, n_flight) == pytest.approx(cost, rel=1e-8, abs=1e-8)
    np.testing.assert_allclose(
        found.w / planner.horizons.layout.units(), expected.w / planner.horizons.layout.units(), atol=1e-5
    )
    assert found.residual < 1e-9 and found.status == expected.status == "kSolutionFound"


def test_every_linearisation_of_a_plan_has_the_solution_that_clarabel_finds(
    planner, linearisations, condensed, reference
):
    for arguments in linearisations:
        for program in (condensed, reference):
            program.update(*arguments)
        assert_same(planner, condensed.solve(), reference.solve(), arguments[1].n_flight)


def test_programs_with_random_numbers_have_the_same_solution_or_none(planner, linearisations, condensed, reference):
    rng, layout, feasible = np.random.default_rng(0), planner.horizons.layout, 0
    for arguments in (linearisations[i] for i in rng.integers(len(linearisations), size=40)):
        start, point, landing, rows, _ = arguments
        velocity = rng.normal(scale=[0.1, 0.1, 0.3])
        start = start + np.append(rng.normal(scale=[0.005, 0.005, 0.02]), velocity)
        start[:3] -= (layout.release - point.n_contact) * 0.02 * velocity  # it waits in motion
        wider = rng.choice([0.05, -0.02, -0.3]) * np.abs(rng.normal(size=rows.count))
        moved = replace(rows, upper=rows.upper + wider, slack=rows.slack + wider)
        astray = np.append(rng.normal(scale=0.002, size=3), np.zeros(3))
        near, trust = replace(point, states=point.states + astray), rng.choice([1.0, 0.5])
        for program in (condensed, reference):
            program.update(start, near, landing, moved, trust)
        found, expected = condensed.solve(), reference.solve()
        assert found.success == expected.success
        if expected.success:
            feasible += 1
            assert_same(planner, found, expected, point.n_flight)
        else:
            assert found.status == "kInfeasibleConstraints"
    assert 10 < feasible < 35


def motion(arguments, layout, variables):
    """The decision vector by eq. (2), from the accelerations of the moving samples."""
    start, n_contact, dt = arguments[0], arguments[1].n_contact, 0.02
    u = np.zeros((layout.intervals, 3))
    u[layout.release - n_contact :] = variables.reshape(-1, 3)
    v = np.vstack([start[3:], start[3:] + np.cumsum(u, axis=0) * dt])
    x = np.vstack([start[:3], start[:3] + np.cumsum(v[:-1] * dt + u * dt**2 / 2, axis=0)])
    return np.append(np.hstack([x[:-1], v[:-1], u]).ravel(), [x[-1], v[-1]])


@pytest.mark.parametrize("which", [0, 5, 15, -1])
def test_the_solution_meets_the_optimality_conditions(planner, linearisations, condensed, which):
    """Eq. (2), all rows, and a gradient that the active ones hold with multipliers of the right sign."""
    arguments = [arguments for arguments in linearisations if arguments[-1] >= 1][which]  # y and z not bounded by trust
    layout = planner.horizons.layout
    start, point, (row, bound), rows, trust = arguments
    n_contact, n_flight, near = point.n_contact, point.n_flight, point.states
    condensed.update(*arguments)
    solution = condensed.solve()
    inputs = layout.unpack(solution.w)[1][layout.release - n_contact :].ravel()
    np.testing.assert_allclose(solution.w, motion(arguments, layout, inputs), atol=1e-9)
    unit = np.tile([1.0, 1.0, 1 / LEVER], n_contact + layout.n_brake)
    offset = motion(arguments, layout, np.zeros(unit.size))
    m = np.column_stack([motion(arguments, layout, way * unit) - offset for way in np.eye(unit.size)])
    samples = np.arange(layout.release - n_contact + 1, layout.intervals + 1)
    theta, a, upper = layout.x(samples, 2), rows.matrix(layout.size), rows.upper
    matrix = np.vstack([a @ m, m[theta], -m[theta]])
    limit = np.concatenate(
        [upper - a @ offset, near[samples, 2] + trust - offset[theta], trust - near[samples, 2] + offset[theta]]
    )
    released = slice(9 * layout.release, 9 * layout.release + 6)
    equal = np.vstack([row @ m[released], m[-3:]])
    missed = equal @ (inputs / unit) - np.append(bound - row @ offset[released], -offset[-3:])
    slack = limit - matrix @ (inputs / unit)
    assert slack.min() > -1e-9 and np.abs(missed).max() < 1e-9
    values = [objective(planner, solution.w + sign * 1e-3 * column, n_flight) for column in m.T for sign in (1, -1)]
    gradient = (np.array(values[::2]) - np.array(values[1::2])) / 2e-3  # exact, the cost being quadratic
    active = matrix[slack < 1e-8 * (1 + np.abs(limit))]
    _, left = nnls(np.vstack([active, equal, -equal]).T, -gradient, maxiter=10000)
    assert left < 1e-6 * max(1.0, np.linalg.norm(gradient))


def test_a_program_used_before_solves_like_a_fresh_one_to_the_bit(planner, linearisations):
    used = build(planner, "daqp")
    for arguments in linearisations[:20]:
        used.update(*arguments)
        used.solve()
    for arguments in linearisations[5:12]:
        fresh = build(planner, "daqp")
        for program in (used, fresh):
            program.update(*arguments)
        first = used.solve()
        for other in (fresh.solve(), used.solve()):
            np.testing.assert_array_equal(first.w, other.w)
            assert (first.iterations, first.residual) == (other.iterations, other.residual)


def test_the_linearisation_point_as_guess_saves_iterations_when_it_is_near(linearisations, condensed):
    condensed.update(*linearisations[-1])
    solution = condensed.solve()
    start, point, landing, rows, _ = linearisations[-1]
    near = replace(point, states=condensed.layout.unpack(solution.w)[0])
    condensed.update(start, near, landing, replace(rows, slack=rows.left(solution.w)), 1.0)
    again = condensed.solve()
    np.testing.assert_allclose(again.w, solution.w, atol=1e-7)
    astray = np.random.default_rng(0).permutation(rows.slack)  # nearness that is none
    turned = replace(near, states=near.states + [0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    condensed.update(start, turned, landing, replace(rows, slack=astray), 1.3)
    astray = condensed.solve()
    np.testing.assert_allclose(astray.w, solution.w, atol=1e-7)
    assert again.iterations < astray.iterations / 2


def test_what_cannot_be_met_ends_without_a_solution(linearisations, condensed, reference):
    start, point, landing, rows, trust = linearisations[-1]
    layout = condensed.layout
    for column, bound in ((layout.x(layout.release, 2), 1.0), (layout.x(0, 1), start[1] - 0.01)):
        # below that of the release; below the start
        more = Rows.about(
            np.zeros(layout.size), [part("release angle", column.reshape(1, 1), -np.ones((1, 1)), np.array([bound]))]
        )
        both = {
            name: np.concatenate([getattr(rows, name), getattr(more, name)])
            for name in ("columns", "values", "upper", "slack")
        }
        impossible = replace(rows, rows=np.append(rows.rows, rows.count), groups=rows.groups + more.groups, **both)
        for program in (condensed, reference):
            program.update(start, point, landing, impossible, trust)
        found, expected = condensed.solve(), reference.solve()
        assert (found.success, found.status) == (expected.success, expected.status) == (False, "kInfeasibleConstraints")


def test_the_basis_of_a_shorter_motion_is_the_rest_of_the_longer_ones():
    long, short = Layout(9, 4), Layout(6, 4)
    (whole, diagonal), (part, last) = (unit_smoothing_basis(layout, 0.02, 1e-6) for layout in (long, short))
    np.testing.assert_allclose(diagonal[3:], last, atol=1e-12)
    np.testing.assert_allclose(whole[9 * 3 :, 3 * 3 :], part, atol=1e-12)
    assert not np.any(whole[: 9 * 3, 3 * 3 :])
    u = whole[long.u(np.arange(13), 0)][:, ::3]
    jumps = np.diff(np.vstack([np.zeros(13), u, np.zeros(13)]), axis=0)
    np.testing.assert_allclose(2 * 1e-6 / 0.02 * jumps.T @ jumps, np.eye(13), atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_a_dense_program_is_solved_whatever_the_guess_says(seed):
    rng = np.random.default_rng(seed)
    n, m, equalities = 12, 150, 2
    A, f = rng.normal(size=(m, n)), 3 * rng.normal(size=n)
    inside = A @ rng.normal(size=n)
    low, high = inside - rng.uniform(0, 1, m), inside + rng.uniform(0, 1, m)
    low[: m // 2], high[:equalities], low[:equalities] = -np.inf, inside[:equalities], inside[:equalities]
    A[-1], low[-1], high[-1] = 0.0, -1.0, 0.0  # a row on nothing that can move
    prog = MathematicalProgram()
    v = prog.NewContinuousVariables(n)
    prog.AddQuadraticCost(np.eye(n), f, v)
    prog.AddLinearConstraint(A[:-1], low[:-1], high[:-1], v)
    result = ClarabelSolver().Solve(prog)
    for slack in (high - inside, rng.normal(size=m), np.zeros(m), np.full(m, np.nan)):
        found = dense.minimise(dense.DenseProgram(f, A, low, high, equalities, slack, np.linalg.norm(A, axis=1)))
        assert found.success
        np.testing.assert_allclose(found.v, result.GetSolution(v), atol=1e-4)
        np.testing.assert_allclose(found.v + f + A.T @ found.multipliers, 0, atol=1e-9)
        for bound, sign in ((high, 1), (low, -1)):
            pushing = np.flatnonzero(sign * found.multipliers[equalities:] > 0) + equalities
            np.testing.assert_allclose((A @ found.v)[pushing], bound[pushing], atol=1e-7)


def test_the_motion_settles_where_it_does_with_clarabel(scenario, arm, plan):
    outcomes = []
    for solver in ("clarabel", "daqp"):
        horizons = Convexification(scenario, arm)
        horizons._program = horizons.program(solver)
        outcomes.append(horizons.settle(horizons.guess(plan.n_contact, plan.n_flight), 1e-4, 30))
    a, b = outcomes
    assert a.settled and b.settled and b.cost == pytest.approx(a.cost, rel=1e-5)
    np.testing.assert_allclose(a.point.states[:, :3], b.point.states[:, :3], atol=1e-4)


def test_the_engine_is_chosen_by_name(planner):
    program = planner.horizons.program
    assert isinstance(program("daqp"), CondensedProgram)
    assert isinstance(program("osqp"), HorizonProgram)
    assert isinstance(program("daqp", GROUPS), HorizonProgram)
    with pytest.raises(ValueError, match="update"):
        program("daqp").solve()
