"""The entries in examples/challenge: each loads and flies, and each law does what its docstring's equation says."""

import re
import runpy
from collections import deque
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from flipdiagram.flips.outcome import SUCCESS
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.challenge.entry import load_entry
from flipdiagram.studies.challenge.flying import EntryFlight, fly_entry, plan_entry
from flipdiagram.studies.challenge.suites import load_suites

FOLDER = Path(__file__).parents[3] / "examples" / "challenge"
ENTRIES = [file.stem for file in sorted(FOLDER.glob("*.py")) if re.search("^NAME = ", file.read_text("utf-8"), re.M)]
MAY_DROP = ("pd", "pd_ff")
"""The paper's own, which sag before the motion: after a hold as long as the challenge's they strike the table."""
WORLD = load_suites().worlds(["nominal"])[2]
T = 0.001


@cache
def functions(name):
    """What is defined in the file of an entry."""
    return runpy.run_path(str(FOLDER / f"{name}.py"))


@pytest.mark.parametrize("name", ENTRIES)
def test_an_entry_says_whose_it_is_and_flies(name):
    entry = load_entry(FOLDER / f"{name}.py")
    assert all((entry.name, entry.author, entry.reference))
    short = {"simulation.hold_time": 0.3, "simulation.settle_time": 0.2, **entry.settings}
    truth, believed = WORLD.truth("mujoco", short), WORLD.believed("mujoco", short)
    plan, why = plan_entry(believed, entry.path)
    assert plan, why
    flight = EntryFlight(0, truth, believed, entry.architecture, path=entry.path, digest=entry.digest)
    outcome = fly_entry(flight, plan).outcome
    assert outcome.metrics is not None, outcome.failure
    assert name in MAY_DROP or outcome.mode == SUCCESS, outcome.failure


class UnitMasses:
    """An arm whose joints are the tool's coordinates, each a unit mass: tau = qdd."""

    n_joints, tau_max = 6, np.full(6, np.inf)

    def task_kinematics(self, q, qd):
        return q, qd, np.eye(6), np.zeros(6)

    def inverse_dynamics(self, q, qd, qdd):
        return qdd


def moved(name, seconds, disturbance, delay=0):
    """Positions (k, 6) of unit masses that an entry holds at 1, from 0, against an acceleration (6,) of w(t)."""
    law = functions(name)
    memory = {"arm": UnitMasses(), "scenario": Scenario().with_overrides({"sensors.delay": delay}), "period": T}
    law["reset"](memory)
    q, qd, zero, seen, positions = np.zeros(6), np.zeros(6), np.zeros(6), deque([np.zeros(6)] * (delay + 1)), []
    for k in range(round(seconds / T)):
        seen.append(q)
        seen.popleft()
        tau = law["control"](k * T, np.ones(6), zero, zero, seen[0], zero, memory)
        acceleration = tau - disturbance(k * T)
        q, qd = q + T * qd + T**2 / 2 * acceleration, qd + T * acceleration
        positions.append(q)
    return np.array(positions), memory


def test_computed_torque_leaves_the_error_dynamics_of_its_docstring():
    """e'' + K_V e' + K_P e = 0 of the true arm, at any state, where the speeds are right."""
    law, rng = functions("computed_torque"), np.random.default_rng(0)
    arm = arm_of(Scenario())
    memory = {"arm": arm, "period": T}
    law["reset"](memory)
    for _ in range(5):
        q, qd = arm.home + 0.2 * rng.standard_normal(6), rng.standard_normal(6)
        x_cmd, v_cmd, a_cmd = rng.standard_normal((3, 6))
        memory["late"] = q - qd / law["G"]
        tau = law["control"](0.0, x_cmd, v_cmd, a_cmd, q, qd, memory)
        qdd = np.linalg.solve(arm.mass_matrix(q), tau - arm.inverse_dynamics(q, qd, np.zeros(6)))
        x, v, J, bias = arm.task_kinematics(q, qd)
        error = a_cmd - J @ qdd - bias + law["K_V"] * (v_cmd - v) + law["K_P"] * (x_cmd - x)
        np.testing.assert_allclose(error, 0, atol=1e-8 * law["K_P"])


def test_computed_torque_alone_is_off_by_the_disturbance_over_k_p():
    positions, _ = moved("computed_torque", 1.0, lambda t: np.full(6, 3.0))
    np.testing.assert_allclose(1 - positions[-1], 3.0 / functions("computed_torque")["K_P"], rtol=1e-4)


@pytest.mark.parametrize("delay", [0, 2])
def test_an_observer_takes_a_constant_disturbance_away(delay):
    positions, memory = moved("computed_torque_dob", 1.5, lambda t: np.full(6, 3.0), delay)
    np.testing.assert_allclose(positions[-1], 1, atol=1e-6)
    np.testing.assert_allclose(memory["state"][2], 3, rtol=1e-4)


def test_the_observers_error_has_its_three_poles_where_they_are_said_to_be():
    law = functions("computed_torque_dob")
    memory = {"period": T}
    law["reset"](memory)
    l1, l2, l3 = memory["gains"]
    ahead = np.array([[1, T, -(T**2) / 2], [0, 1, -T], [0, 0, 1]])  # of angle, speed and w under no torque
    error = ahead @ (np.eye(3) - np.array([[l1], [l2], [-l3]]) @ [[1, 0, 0]])
    pole = np.exp(-law["OMEGA"] * T)
    np.testing.assert_allclose(np.poly(error), [1, -3 * pole, 3 * pole**2, -(pole**3)], atol=1e-12)


def test_super_twisting_reaches_zero_in_finite_time_and_finds_what_disturbs():
    """s' = -w - u: zero to O(T^2) under a w of any slope below L, where a linear law of this size keeps an error."""
    twist, bound, s, z = functions("super_twisting")["super_twisting"], 5.0, np.array([1.0]), np.zeros(1)
    history = []
    for k in range(4000):
        w = 0.9 * bound / 4 * np.sin(4 * k * T)
        u, z = twist(s, z, bound, 0.0, T)
        s = s + T * (-w - u)
        history.append((abs(s[0]), abs(z[0] + w)))
    late = np.array(history)[2500:]
    assert late[:, 0].max() < 10 * bound * T**2
    assert late[:, 1].max() < 10 * bound * T


@pytest.fixture(scope="module")
def lqr():
    """The functions of lqr.py, A, B, and a memory that has been reset."""
    law, scenario = functions("lqr"), Scenario()
    memory = {"arm": arm_of(scenario), "scenario": scenario, "period": T}
    law["reset"](memory)
    return law, *law["linear_model"](scenario)[:2], memory


def test_the_regulator_solves_its_riccati_equation_and_is_the_end_of_dynamic_programming(lqr):
    law, A, B, _ = lqr
    Q, R = np.diag([1e4] * 6 + [10.0] * 6), 0.01 * np.eye(6)
    K, P = law["regulator"](A, B, Q, R)
    residual = A.T @ P @ A - P - A.T @ P @ B @ K + Q
    assert np.abs(residual).max() < 1e-8 * np.abs(P).max()
    cost = Q
    for _ in range(2000):
        gain = np.linalg.solve(R + B.T @ cost @ B, B.T @ cost @ A)
        cost = A.T @ cost @ (A - B @ gain) + Q
    np.testing.assert_allclose(gain, K, rtol=1e-6, atol=1e-6 * np.abs(K).max())


def test_regulator_and_filter_take_the_error_and_a_constant_disturbance_away(lqr):
    """The linear joints, seen late, from an error of 0.01 rad under a torque of 1 N m."""
    _, A, B, memory = lqr
    delay = Scenario().sensors.delay
    estimate, true, d = np.zeros(len(memory["F"])), np.r_[np.full(6, 0.01), np.zeros(6)], np.ones(6)
    past = deque([true[:6]] * (delay + 1), delay + 1)
    for _ in range(3000):
        estimate = estimate + memory["L"] @ (past[0] - memory["C"] @ estimate)
        u = estimate[12:18] - memory["K"] @ estimate[:12]
        true, estimate = A @ true + B @ (u - d), memory["F"] @ estimate + memory["B"] @ u
        past.append(true[:6])
    np.testing.assert_allclose(true, 0, atol=1e-6)
    np.testing.assert_allclose(estimate[12:18], d, rtol=1e-4)
