"""The planner's problem without any linearisation of contact, by CasADi and IPOPT: the nonlinear reference.

Cone, normal force, centre of pressure, clearance, separation, flight and landing keep their true dependence on θ.  The
joint limits are the planner's own rows about a given motion, as in tests/planning/test_optimality.py; they are true at
that motion and hold near it, so `region` bounds how far θ may be from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from bench.timing import timed
from flipdiagram.planning.constraints import Geometry, Trajectory
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import transition
from flipdiagram.planning.program import TURNING_RADIUS
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory.contact import GRAVITY_Z

NAME, PACKAGE = "CasADi + IPOPT", "casadi"
OPTIONS = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-8, "max_iter": 500}}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """What IPOPT found: decision vector of the moving samples in SI, J, J + smoothing, time [s], its word."""

    success: bool
    w: Array
    cost: float
    objective: float
    violation: float
    time: float
    iterations: int
    status: str


def prepare(
    scenario: Scenario, point: Trajectory, joints: tuple[sp.csr_matrix, Array], region: float = np.inf
) -> Callable[..., Reference]:
    """The program of the horizon of `point` (moving samples only, no waiting ones), built here, solved by the callable.

    joints: rows (m, size) and bounds (m,) on the decision vector of `Layout`; region: how far θ may be from `point`
    [rad].  The callable takes the decision vector to start from, whose first state is the start; with only_evaluate it
    returns that vector's values.
    """
    casadi = import_module("casadi")
    settings, dt = scenario.planner, point.sampling_time
    layout = Layout(point.n_contact, len(point.inputs) - point.n_contact)
    n, units = layout.intervals, layout.units()
    z = casadi.SX.sym("z", layout.size)
    w = z * units
    states = [w[int(layout.x(k, 0)) : int(layout.x(k, 0)) + 6] for k in range(n + 1)]
    inputs = [w[int(layout.u(k, 0)) : int(layout.u(k, 0)) + 3] for k in range(n)]
    a, b = transition(dt)
    zeros = [(states[k + 1] - a @ states[k] - b @ inputs[k]) / units[:6] for k in range(n)]
    zeros.append(_landing(casadi, scenario, point, states))
    positive = casadi.vertcat(*_margins(casadi, scenario, point, states, inputs))
    rows, upper = joints
    if rows.shape[0]:
        positive = casadi.vertcat(positive, upper - casadi.DM(rows) @ w)
    landing = _flown(states[point.n_contact], point.n_flight * dt)
    cost = (landing[2] - np.pi) ** 2 + settings.alpha * (landing[0] - scenario.task.target_y) ** 2
    cost += settings.beta * (landing[3] ** 2 + landing[4] ** 2)
    lever = np.array([1.0, 1.0, TURNING_RADIUS])
    held = [casadi.SX.zeros(3), *inputs, casadi.SX.zeros(3)]
    smoothing = sum(casadi.sumsqr((held[k + 1] - held[k]) * lever) for k in range(n + 1))
    objective = cost + settings.smoothing / dt * smoothing
    g = casadi.vertcat(*zeros, positive)
    equal = sum(part.numel() for part in zeros)
    solver = casadi.nlpsol("plan", "ipopt", {"x": z, "f": objective, "g": g}, OPTIONS)
    values = casadi.Function("values", [z], [casadi.vertcat(cost, objective), g])
    high = np.append(np.zeros(equal), np.full(g.numel() - equal, np.inf))
    free = np.full(layout.size, np.inf)

    def evaluate(at: Any) -> tuple[float, float, float]:
        """J, J + smoothing, violation."""
        both, found = (np.asarray(value, dtype=float).ravel() for value in values(at))
        violation = max(float(np.abs(found[:equal]).max()), float(np.max(-found[equal:], initial=0.0)))
        return float(both[0]), float(both[1]), violation

    def solve(guess: Array, only_evaluate: bool = False) -> Reference:
        if only_evaluate:
            return Reference(True, guess, *evaluate(guess / units), 0.0, 0, "evaluated")
        low_x, high_x = -free, free.copy()
        theta = layout.x(np.arange(n + 1), 2)
        low_x[theta] = (point.states[:, 2] - region) / units[theta]
        high_x[theta] = (point.states[:, 2] + region) / units[theta]
        low_x[:6] = high_x[:6] = guess[:6] / units[:6]
        if settings.stop == "brake":  # the tool is at rest in the end; else its command stops at the release
            low_x[-3:] = high_x[-3:] = 0.0
        elapsed, found = timed(
            lambda: solver(x0=guess / units, lbx=low_x, ubx=high_x, lbg=np.zeros(g.numel()), ubg=high)
        )
        stats = solver.stats()
        w = np.asarray(found["x"], dtype=float).ravel() * units
        return Reference(
            bool(stats["success"]), w, *evaluate(found["x"]), elapsed, int(stats["iter_count"]), stats["return_status"]
        )

    return solve


def _flown(released: Any, t: float) -> list[Any]:
    """[y, z, θ, v_y, v_z] of the block after t [s] of flight."""
    y, z, theta = (released[i] + released[i + 3] * t for i in range(3))
    return [y, z + GRAVITY_Z * t**2 / 2, theta, released[3], released[4] + GRAVITY_Z * t]


def _height(casadi: Any, pose: Any, s: float, n: float) -> Any:
    """z of a corner (s, n) at a pose y, z, θ."""
    return pose[1] + s * casadi.sin(pose[2]) + n * casadi.cos(pose[2])


def _landing(casadi: Any, scenario: Scenario, point: Trajectory, states: list[Any]) -> Any:
    """Height of the corner that touches down over the table: the one that is lowest in the motion `point`."""
    geometry, t = Geometry.of(scenario), point.n_flight * point.sampling_time
    released = point.states[point.n_contact]
    theta = released[2] + released[5] * t
    corner = (-np.copysign(geometry.half_length, np.sin(theta)), -np.copysign(geometry.half_thickness, np.cos(theta)))
    return _height(casadi, _flown(states[point.n_contact], t), *corner) - scenario.table.height


def _margins(casadi: Any, scenario: Scenario, point: Trajectory, states: list[Any], inputs: list[Any]) -> list[Any]:
    """All that must not be negative."""
    settings, geometry, table = scenario.planner, Geometry.of(scenario), scenario.table.height
    n, dt, half, across = point.n_contact, point.sampling_time, geometry.half_length, geometry.half_thickness
    mu = scenario.object.friction * (1 - settings.friction_margin)
    reach = half * (1 - settings.support_margin)
    found = [states[n][2] - np.pi / 2 - settings.release_angle]
    for k, end in product(range(n), (0, 1)):
        theta, (a_y, a_z, spin) = states[k + end][2], casadi.vertsplit(inputs[k])
        c, s, lift = casadi.cos(theta), casadi.sin(theta), a_z - GRAVITY_Z
        along, force = a_y * c + lift * s, lift * c - a_y * s
        moment = (geometry.gyration * spin - across * along) / reach
        found += [force - settings.minimum_normal, mu * force - along, mu * force + along]
        found += [force - moment, force + moment]
    blade = [(sign * geometry.half_blade, -across - t) for sign in (1, -1) for t in (0.0, geometry.blade_thickness)]
    for corners, last in ((blade, len(inputs)), ([(half, across), (-half, across)], n)):
        for k, corner in product(range(1, last + 1), corners):
            found.append(_height(casadi, states[k], *corner) - table - settings.table_clearance)
    corners = list(product((half, -half), (across, -across)))
    for j, corner in product(range(1, point.n_flight), corners):
        found.append(_height(casadi, _flown(states[n], j * dt), *corner) - table)
    for j in range(1, max(len(inputs) - n, point.n_flight) + 1):
        tool = states[min(n + j, len(inputs))]
        block = _flown(states[n], min(j, point.n_flight) * dt)
        gap = min(settings.separation_gap, settings.separation_acceleration * (j * dt) ** 2 / 2)
        for side in (half, -half):
            y = block[0] + side * casadi.cos(block[2]) + across * casadi.sin(block[2]) - tool[0]
            z = block[1] + side * casadi.sin(block[2]) - across * casadi.cos(block[2]) - tool[1]
            found.append(z * casadi.cos(tool[2]) - y * casadi.sin(tool[2]) + across - gap)
    for state in states[1:]:
        for value, (low, high) in ((state[0], scenario.task.workspace_y), (state[1], scenario.task.workspace_z)):
            found += [value - low, high - value]
    return found
