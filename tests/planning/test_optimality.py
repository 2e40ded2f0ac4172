"""No nearby motion is better: the nonlinear program of the chosen horizon, solved by SNOPT from near the plan.

Contact, clearance, separation, flight and landing keep their true dependence on the angles here.  The joint limits are
linear rows about the plan, which test_limits.py compares with the arm.
"""

import numpy as np
import pytest
from planar import G, blade, block
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram, SnoptSolver

from flipdiagram.planning import limits
from flipdiagram.planning.arm_motion import ArmMotion, task_pose
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.rows import Rows

UNIT, LEVER = np.array([10.0, 10.0, 100.0]), 0.05


def differentiable(function):
    """A NumPy function as Drake wants it: values for floats, values and slopes (by complex step) for AutoDiffXd."""

    def evaluate(w):
        if w.dtype != object:
            return function(w)
        at, step = ExtractValue(w).ravel(), 1e-30
        slopes = np.column_stack([function(at + 1j * step * way).imag / step for way in np.eye(at.size)])
        return InitializeAutoDiff(function(at).reshape(-1, 1), slopes @ ExtractGradient(w)).ravel()

    return evaluate


def corner(pose, at):
    """Place (y, z) of a corner (s, n) at poses (..., 3)."""
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    return pose[..., 0] + at[0] * c - at[1] * s, pose[..., 1] + at[0] * s + at[1] * c


class Problem:
    """The motion as a function of the accelerations w = u / UNIT, and what is asked of it."""

    def __init__(self, scenario, plan):
        self.scenario, self.plan, self.settings = scenario, plan, scenario.planner
        self.start = plan.states[0, :3]

    def motion(self, w):
        """x̂ (N + 1, 6) and u (N, 3); w may be complex."""
        dt, u = self.settings.sampling_time, w.reshape(-1, 3) * UNIT
        v = np.vstack([np.zeros(3), np.cumsum(u, axis=0) * dt])
        x = self.start + np.vstack([np.zeros(3), np.cumsum(v[:-1] * dt + u * dt**2 / 2, axis=0)])
        return np.hstack([x, v]), u

    def flown(self, states, t):
        released = states[self.plan.n_contact]
        return released[:3] + released[3:] * t[:, None] - np.array([0, G / 2, 0]) * t[:, None] ** 2

    def cost(self, w):
        """J of eq. (5), and with smoothing."""
        settings, (states, u) = self.settings, self.motion(w)
        t = self.plan.n_flight * settings.sampling_time
        y, _, theta = self.flown(states, np.array([t]))[0]
        v_y, v_z = states[self.plan.n_contact, 3:5] - [0, G * t]
        landing = (theta - np.pi) ** 2 + settings.alpha * (y - self.scenario.task.target_y) ** 2
        landing = landing + settings.beta * (v_y**2 + v_z**2)
        jumps = np.diff(np.vstack([np.zeros(3), u, np.zeros(3)]), axis=0) * [1, 1, LEVER]
        return np.array([landing, landing + settings.smoothing / settings.sampling_time * np.sum(jumps**2)])

    def margins(self, w):
        """Everything that must not be negative."""
        settings, thing, table = self.settings, self.scenario.object, self.scenario.table.height
        (states, u), n, dt = self.motion(w), self.plan.n_contact, settings.sampling_time
        half, across = thing.length / 2, thing.thickness / 2
        mu, reach = thing.friction * (1 - settings.friction_margin), half * (1 - settings.support_margin)
        found = [states[n : n + 1, 2] - np.pi / 2 - settings.release_angle]
        for end in (0, 1):
            c, s = np.cos(states[end : n + end, 2]), np.sin(states[end : n + end, 2])
            a_y, a_z, spin = u[:n].T
            along, force = a_y * c + (a_z + G) * s, (a_z + G) * c - a_y * s
            moment = ((half**2 + across**2) / 3 * spin - across * along) / reach
            found += [
                force - settings.minimum_normal,
                mu * force - along,
                mu * force + along,
                force - moment,
                force + moment,
            ]
        for corners, last in ((blade(self.scenario), len(u)), (block(self.scenario)[2:], n)):
            found += [corner(states[1 : last + 1, :3], at)[1] - table - settings.table_clearance for at in corners]
        for at in block(self.scenario):
            found.append(corner(self.flown(states, np.arange(1, self.plan.n_flight) * dt), at)[1] - table)
        j = np.arange(1, len(u) - n + 1)
        wanted = np.minimum(settings.separation_gap, settings.separation_acceleration * (j * dt) ** 2 / 2)
        flying, tool = self.flown(states, np.minimum(j, self.plan.n_flight) * dt), states[n + j]
        for at in block(self.scenario)[:2]:
            y, z = corner(flying, at)
            height = -(y - tool[:, 0]) * np.sin(tool[:, 2]) + (z - tool[:, 1]) * np.cos(tool[:, 2]) + across
            found.append(height - wanted)
        for place, (low, high) in (
            (states[1:, 0], self.scenario.task.workspace_y),
            (states[1:, 1], self.scenario.task.workspace_z),
        ):
            found += [place - low, high - place]
        return np.concatenate(found)

    def zeros(self, w):
        """Height of the lowest corner at touch-down, and the tool's last velocity."""
        states, _ = self.motion(w)
        landing = self.flown(states, np.array([self.plan.n_flight * self.settings.sampling_time]))
        heights = [corner(landing, at)[1] - self.scenario.table.height for at in block(self.scenario)]
        return np.concatenate([min(heights, key=lambda height: height.real[0]), states[-1, 3:]])

    def joint_rows(self, arm, w):
        """Rows a · w ≤ b of the joint limits, linearised about w."""
        states, inputs = self.motion(w)
        x, layout = self.scenario.task.start_x, Layout(self.plan.n_contact, self.plan.n_brake)
        mover, q = ArmMotion(arm, x), arm.inverse_kinematics(task_pose(states[0], x))
        motion, allowed = mover.follow(states, inputs, q), limits.Allowed.of(arm, self.scenario)
        parts = limits.joint_rows(layout, motion, (states, inputs), mover, allowed)

        def decision(w):
            states, inputs = self.motion(w)
            return np.concatenate([np.hstack([states[:-1], inputs]).ravel(), states[-1]])

        rows = Rows.about(decision(w), parts)
        a, b = rows.matrix(layout.size), rows.upper
        offset = decision(np.zeros(w.size))
        return a @ np.column_stack([decision(way) - offset for way in np.eye(w.size)]), b - a @ offset


@pytest.fixture(scope="module")
def problem(scenario, plan):
    return Problem(scenario, plan)


@pytest.fixture(scope="module")
def planned(plan):
    return (plan.inputs / UNIT).ravel()


def test_the_plan_meets_the_true_constraints(problem, plan, planned):
    np.testing.assert_allclose(problem.motion(planned)[0], plan.states, atol=1e-10)
    assert problem.cost(planned)[0] == pytest.approx(plan.cost, rel=1e-9)
    # θ has settled to 1e-4 rad; what a linearisation leaves out is of second order
    assert problem.margins(planned).min() > -1e-5
    assert np.abs(problem.zeros(planned)).max() < 1e-7


def test_no_nearby_motion_is_better(problem, plan, planned, arm):
    prog = MathematicalProgram()
    w = prog.NewContinuousVariables(planned.size)
    prog.AddCost(lambda w: differentiable(lambda w: problem.cost(w)[1:])(w)[0], vars=w)
    for function, upper in ((problem.margins, np.inf), (problem.zeros, 0.0)):
        count = function(planned).size
        prog.AddConstraint(differentiable(function), lb=np.zeros(count), ub=np.full(count, upper), vars=w)
    a, b = problem.joint_rows(arm, planned)
    prog.AddLinearConstraint(a, np.full(b.size, -np.inf), b, w)
    # not from the plan itself, where a solver might stop at once
    result = SnoptSolver().Solve(prog, planned + 0.02 * np.random.default_rng(0).normal(size=planned.size))
    assert result.is_success()
    best = result.GetSolution(w)
    assert problem.margins(best).min() > -1e-5 and np.abs(problem.zeros(best)).max() < 1e-5
    assert problem.cost(planned)[1] < problem.cost(best)[1] * (1 + 2e-4)
    assert problem.cost(planned)[0] < problem.cost(best)[0] * (1 + 1e-3)
    np.testing.assert_allclose(problem.motion(best)[0][:, :3], plan.states[:, :3], atol=0.02)
