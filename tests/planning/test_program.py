"""The quadratic program against the same one built from scratch: other variables, another solver."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.solvers import GurobiSolver, MathematicalProgram, SnoptSolver

from flipdiagram.errors import InputError
from flipdiagram.planning import constraints
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.convexification import GROUPS
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import LandingCost
from flipdiagram.planning.program import HorizonProgram, make_solver
from flipdiagram.planning.rows import Rows, part

G, LEVER = 9.81, 0.05
TRUST = 0.05  # so little that it binds


@pytest.fixture(scope="module")
def point(planner, plan):
    """The default plan as a linearisation point: waiting samples before it."""
    waiting = planner.horizons.layout.release - plan.n_contact
    states = np.vstack([np.tile(plan.states[0], (waiting, 1)), plan.states])
    inputs = np.vstack([np.zeros((waiting, 3)), plan.inputs])
    return Trajectory(states, inputs, plan.n_contact, plan.n_flight, plan.sampling_time)


@pytest.fixture(scope="module")
def elsewhere(point):
    """A linearisation point off the optimum, with another horizon."""
    k = np.arange(len(point.states))[:, None]
    moved = point.states + 0.01 * np.sin(k * [0.3, 0.4, 0.5, 0, 0, 0])
    return replace(point, states=moved, n_contact=point.n_contact + 3, n_flight=point.n_flight + 1)


def numbers(planner, point, trust=TRUST):
    """What `update` takes, for a linearisation point."""
    horizons = planner.horizons
    landing = constraints.landing_row(horizons.layout, point, planner.scenario)
    return horizons.start, point, landing, horizons.rows(point)[0], trust


def build(planner, groups=()):
    settings, horizons = planner.scenario.planner, planner.horizons
    return HorizonProgram(
        horizons.layout, settings.sampling_time, horizons.cost, settings.smoothing, "clarabel", groups
    )


def from_scratch(planner, arguments):
    """Optimal cost and inputs (N, 3): the accelerations of the moving samples are the only variables, by SNOPT."""
    start, point, (row, bound), rows, trust = arguments
    n_contact, n_flight, near = point.n_contact, point.n_flight, point.states[:, :3]
    settings, layout = planner.scenario.planner, planner.horizons.layout
    dt, count, waiting = settings.sampling_time, layout.intervals, layout.release - n_contact
    unit = np.tile([10.0, 10.0, 100.0], count - waiting)

    def motion(variables):
        u = np.zeros((count, 3))
        u[waiting:] = (variables * unit).reshape(-1, 3)
        v = np.vstack([start[3:], start[3:] + np.cumsum(u, axis=0) * dt])
        x = np.vstack([start[:3], start[:3] + np.cumsum(v[:-1] * dt + u * dt**2 / 2, axis=0)])
        return np.hstack([x, v]), u

    def affine(function):
        """Matrix and offset of an affine function of the variables."""
        offset = function(*motion(np.zeros(unit.size)))
        return np.column_stack([function(*motion(e)) - offset for e in np.eye(unit.size)]), offset

    def residuals(states, u):
        """Square roots of eq. (5) at touch-down and of the smoothing cost."""
        released, t = states[layout.release], n_flight * dt
        y, theta = released[[0, 2]] + released[[3, 5]] * t
        landing = [theta - np.pi, np.sqrt(settings.alpha) * (y - planner.scenario.task.target_y)]
        landing += [np.sqrt(settings.beta) * released[3], np.sqrt(settings.beta) * (released[4] - G * t)]
        jumps = np.diff(np.vstack([np.zeros(3), u, np.zeros(3)]), axis=0) * [1, 1, LEVER]
        return np.concatenate([landing, np.sqrt(settings.smoothing / dt) * jumps.ravel()])

    prog = MathematicalProgram()
    variables = prog.NewContinuousVariables(unit.size)
    square, offset = affine(residuals)
    prog.AddQuadraticCost(2 * square.T @ square, 2 * square.T @ offset, float(offset @ offset), variables)
    a, b = rows.matrix(layout.size), rows.upper
    m, c = affine(lambda s, u: np.concatenate([np.hstack([s[:-1], u]).ravel(), s[-1]]))
    prog.AddLinearConstraint(a @ m, np.full(len(b), -np.inf), b - a @ c, variables)
    m, c = affine(lambda s, u: np.append(s[-1, 3:], row @ s[layout.release] - bound))
    prog.AddLinearEqualityConstraint(m, -c, variables)
    m, c = affine(lambda s, u: s[waiting + 1 :, :3].ravel())
    centre = near[waiting + 1 :].ravel() - c
    radius = np.tile([trust / 2, trust / 2, trust], count - waiting)
    prog.AddLinearConstraint(m, centre - radius, centre + radius, variables)
    solver = SnoptSolver()
    prog.SetSolverOption(solver.id(), "Major optimality tolerance", 1e-9)
    prog.SetSolverOption(solver.id(), "Minor optimality tolerance", 1e-9)
    result = solver.Solve(prog)
    assert result.is_success()
    return result.get_optimal_cost(), motion(result.GetSolution(variables))


def cost_of(planner, states, inputs, n_flight):
    """J of eq. (5) plus smoothing, written out."""
    settings, dt = planner.scenario.planner, planner.scenario.planner.sampling_time
    y, z, theta, v_y, v_z, spin = states[planner.horizons.layout.release]
    t = n_flight * dt
    landing = (theta + spin * t - np.pi) ** 2 + settings.alpha * (y + v_y * t - planner.scenario.task.target_y) ** 2
    landing += settings.beta * (v_y**2 + (v_z - G * t) ** 2)
    jumps = np.diff(np.vstack([np.zeros(3), inputs, np.zeros(3)]), axis=0) * [1, 1, LEVER]
    return landing + settings.smoothing / dt * np.sum(jumps**2)


@pytest.mark.parametrize("where", ["point", "elsewhere"])
def test_the_solution_is_that_of_the_same_program_built_from_scratch(planner, where, request):
    program, arguments = build(planner), numbers(planner, request.getfixturevalue(where))
    program.update(*arguments)
    solution = program.solve()
    assert solution.success and solution.slack == {} and solution.residual < 1e-8
    states, inputs = program.layout.unpack(solution.w)
    expected, (other_states, other_inputs) = from_scratch(planner, arguments)
    assert cost_of(planner, states, inputs, arguments[1].n_flight) == pytest.approx(expected, rel=1e-6)
    np.testing.assert_allclose(states[:, :3], other_states[:, :3], atol=1e-4)
    np.testing.assert_allclose(inputs, other_inputs, atol=1e-4 * 1000)


def test_eq_2_start_waiting_rest_and_trust_hold_in_the_solution(planner, elsewhere):
    program, arguments = build(planner), numbers(planner, elsewhere)
    program.update(*arguments)
    solution = program.solve()
    states, inputs = program.layout.unpack(solution.w)
    dt, waiting = elsewhere.sampling_time, program.layout.release - elsewhere.n_contact
    np.testing.assert_allclose(states[1:, :3], states[:-1, :3] + states[:-1, 3:] * dt + inputs * dt**2 / 2, atol=1e-9)
    np.testing.assert_allclose(states[1:, 3:], states[:-1, 3:] + inputs * dt, atol=1e-8)
    np.testing.assert_allclose(states[: waiting + 1], np.tile(planner.horizons.start, (waiting + 1, 1)), atol=1e-8)
    np.testing.assert_allclose(inputs[:waiting], 0, atol=1e-7)
    np.testing.assert_allclose(states[-1, 3:], 0, atol=1e-8)
    moved = np.abs(states[waiting + 1 :, :3] - elsewhere.states[waiting + 1 :, :3]).max(axis=0)
    np.testing.assert_allclose(moved, [TRUST / 2, TRUST / 2, TRUST], rtol=1e-5)  # as far as it may
    a, b = arguments[3].matrix(program.layout.size), arguments[3].upper
    assert np.max(a @ solution.w - b) <= solution.residual + 1e-15


def test_a_program_used_before_solves_like_a_fresh_one(planner, point, elsewhere):
    used, fresh = build(planner), build(planner)
    for where in (point, elsewhere):
        used.update(*numbers(planner, where))
        used.solve()
    for program in (used, fresh):
        program.update(*numbers(planner, point))
    np.testing.assert_array_equal(used.solve().w, fresh.solve().w)
    np.testing.assert_array_equal(used.solve().w, used.solve().w)


def test_the_elastic_program_solves_a_feasible_one_without_slack(planner, elsewhere):
    plain, elastic = build(planner), build(planner, GROUPS)
    for program in (plain, elastic):
        program.update(*numbers(planner, elsewhere))
    a, b = plain.solve(), elastic.solve()
    assert set(b.slack) == set(GROUPS) and max(b.slack.values()) < 1e-6
    np.testing.assert_allclose(b.w / plain.layout.units(), a.w / plain.layout.units(), atol=1e-4)


@pytest.mark.parametrize("group", ["first", "second"])
def test_the_elastic_program_names_the_group_that_was_made_impossible(group):
    layout, start = Layout(6, 4), np.array([0.0, 0.35, 0, 0, 0, 0])
    # θ ≥ 0.2 at the release: easy; the start 0.1 m lower than it is: impossible
    asked = [("first", 6, 2, 1.0, -0.2), ("second", 6, 2, 1.0, -0.2), (group, 0, 1, -1.0, 0.25)]
    parts = [
        part(name, layout.x(sample, component).reshape(1, 1), np.array([[slope]]), np.array([margin]))
        for name, sample, component, slope, margin in asked
    ]
    rows = Rows.about(np.zeros(layout.size), parts)
    landing = np.array([0.0, 1, 0, 0, 0.04, 0]), 0.2 + G * 0.04**2 / 2
    arguments = start, Trajectory(np.tile(start, (11, 1)), np.zeros((10, 3)), 6, 2, 0.02), landing, rows, 1.0
    plain, elastic = (
        HorizonProgram(layout, 0.02, LandingCost(20, 0.5), 1e-6, "clarabel", g) for g in ((), ("first", "second"))
    )
    plain.update(*arguments)
    assert not plain.solve().success
    elastic.update(*arguments)
    solution = elastic.solve()
    assert solution.success
    assert solution.slack[group] == pytest.approx(0.1, abs=1e-6)
    assert sum(solution.slack.values()) == pytest.approx(0.1, abs=1e-6)


def test_a_program_without_numbers_says_so(planner):
    with pytest.raises(ValueError, match="update"):
        build(planner).solve()


def test_a_solver_that_is_not_there_is_named_with_those_that_are():
    if GurobiSolver().available():
        pytest.skip("this Drake has Gurobi")
    with pytest.raises(
        InputError, match=r"'planner.solver' = 'gurobi' cannot be used here .* choose from clarabel, "
    ) as error:
        make_solver("gurobi")
    assert "gurobi" not in str(error.value).split("choose from")[1]
