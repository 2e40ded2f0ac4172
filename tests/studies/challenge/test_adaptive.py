"""The laws of the adaptive, model-free, learning and robust entries, each against what is known of it."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lsim

from flipdiagram import Scenario
from flipdiagram.flips.outcome import Outcome
from flipdiagram.studies.challenge.entry import load_entry

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "challenge"
T, TICKS = 1e-3, 1500
ADAPTIVE, MODEL_FREE, LEARNING, ROBUST, TRAINING, CAMPAIGN = (
    SimpleNamespace(**runpy.run_path(str(FOLDER / f"{name}.py")))
    for name in (
        "adaptive_dob",
        "model_free",
        "iterative_learning",
        "robust",
        "train_iterative_learning",
        "tuning_campaign",
    )
)


class Masses:
    """Six masses [kg] on rails in the place of an arm: joint and task coordinates are the same."""

    n_joints, mass, tau_max, tau_rated = 6, np.arange(1.0, 7.0), np.full(6, 1e3), np.ones(6)

    def task_kinematics(self, q, qd):
        return q, qd, np.eye(6), np.zeros(6)

    def mass_matrix(self, q):
        return np.diag(self.mass)

    def gravity_torque(self, q):
        return np.zeros(6)

    def inverse_dynamics(self, q, qd, qdd):
        return self.mass * qdd


def held(entry, disturbance, ticks=TICKS):
    """Memory and position after an entry has held the masses at 0 against a force (6,) [N]."""
    scenario = Scenario().with_overrides(
        {"sensors.delay": 0, "joint_friction.coulomb": 0.0, "joint_friction.viscous": 0.0}
    )
    memory = {"arm": Masses(), "scenario": scenario, "period": T}
    entry.reset(memory)
    q, qd, zero = np.zeros(6), np.zeros(6), np.zeros(6)
    for k in range(ticks):
        tau = entry.control(k * T, zero, zero, zero, q, qd, memory)
        qdd = (tau + disturbance) / Masses.mass
        q, qd = q + T * qd + T**2 / 2 * qdd, qd + T * qdd
    return memory, q


def test_least_squares_find_inertia_and_friction_from_angles_and_torques():
    inertia, coulomb, viscous, v_0, period = 1.3, 0.4, 0.6, 0.1, 2e-4
    theta, P = np.array([[0.5, 0.0, 0.0]]), 1e4 * np.eye(3)[None]
    late, q, v, sent = [np.zeros(1)] * 5, np.zeros(1), np.zeros(1), np.zeros(1)
    for k in range(7000):
        _, _, v_2, a_2, tau_2 = ADAPTIVE.filtered(q, sent, late, 1 - np.exp(-250 * period), period)
        phi = np.array([[a_2[0], np.tanh(v_2[0] / v_0), v_2[0]]])
        theta, P = ADAPTIVE.least_squares(theta, P, phi, tau_2, 1 - period)
        sent = np.array([3 * np.sin(9 * k * period) + 2 * np.sin(4 * k * period)])
        v = v + period * (sent - coulomb * np.tanh(v / v_0) - viscous * v) / inertia
        q = q + period * v
    np.testing.assert_allclose(theta[0], [inertia, coulomb, viscous], rtol=0.01)


def test_the_adaptive_observer_holds_still_against_a_constant_force():
    force = np.linspace(-5, 5, 6)
    memory, q = held(ADAPTIVE, force)
    np.testing.assert_allclose(memory["d"], -force, atol=1e-3)
    np.testing.assert_allclose(q, 0, atol=1e-6)
    np.testing.assert_array_equal(memory["theta"], [[1.0, 0.0, 0.0]] * 6)  # at rest nothing is learned


def test_the_model_free_estimate_is_exact_for_a_constant_acceleration():
    samples = 30
    of_angle, of_acceleration = MODEL_FREE.windows(samples, T)
    t = T * np.arange(samples)
    F, sent = 3.0, -1.2
    angles = 0.4 - 0.7 * t + (F + sent) * t**2 / 2
    assert of_angle @ angles - of_acceleration @ np.full(samples, sent) == pytest.approx(F, rel=1e-9)


def test_model_free_control_holds_still_against_a_constant_force():
    _, q = held(MODEL_FREE, np.linspace(-5, 5, 6))
    np.testing.assert_allclose(q, 0, atol=1e-6)


def test_learning_shrinks_the_error_of_a_linear_plant_by_one_minus_gamma():
    k_p, k_v, gamma = LEARNING.K_P, LEARNING.K_V, 0.7
    knots, time = LEARNING.KNOTS, np.arange(0, LEARNING.KNOTS[-1], T)
    w = np.zeros((len(knots), 1))
    unknown = np.sin(12 * knots)[:, None] + (knots > 0.2)[:, None]
    norms = []
    for _ in range(5):
        force = -np.interp(time, knots, (w + unknown)[:, 0])
        plant = ([[0, 1], [-k_p, -k_v]], [[0], [1]], np.eye(2), np.zeros((2, 1)))
        _, (e, de), _ = (lambda t, y, x: (t, y.T, x))(*lsim(plant, force, time))
        norms.append(np.linalg.norm(e))
        missing = np.gradient(de, T) + k_v * de + k_p * e
        w = TRAINING.improved(w, time, missing[:, None], knots, gamma)
    np.testing.assert_allclose(np.divide(norms[1:], norms[:-1]), 1 - gamma, atol=0.01)


def test_what_was_learned_is_added_between_the_knots_and_nowhere_else():
    w = np.arange(153.0).reshape(51, 3)
    np.testing.assert_allclose(LEARNING.added(0.015, w)[:3], (w[1] + w[2]) / 2)
    for outside in (-1e-3, 0.5, 2.0):
        np.testing.assert_array_equal(LEARNING.added(outside, w), 0)


def test_what_is_written_after_training_is_read_again(tmp_path, monkeypatch):
    file = tmp_path / "iterative_learning.py"
    file.write_text((FOLDER / "iterative_learning.py").read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.setitem(TRAINING.write.__globals__, "FILE", file)
    numbers = np.random.default_rng(1).normal(size=(51, 3)).round(2)
    TRAINING.write(numbers)
    np.testing.assert_array_equal(load_entry(file).laws["control"].__globals__["LEARNED"], numbers)


def test_the_poles_of_the_robust_observer_are_where_it_says():
    memory = {"scenario": Scenario(), "arm": Masses(), "period": T}
    ROBUST.reset(memory)
    predict = np.array([[1, T, T**2 / 2], [0, 1, T], [0, 0, 1]])
    correct = np.eye(3) - np.outer(memory["L"], [1, 0, 0])
    poles = np.linalg.eigvals(predict @ correct)
    np.testing.assert_allclose(poles, np.exp(-ROBUST.OBSERVER * T), atol=1e-4)  # a triple root to the third of eps


def test_the_robust_observer_finds_a_constant_force_and_ignores_the_measured_speed():
    force = np.linspace(-5, 5, 6)
    memory, q = held(ROBUST, force)
    np.testing.assert_allclose(memory["state"][2], force, atol=1e-6)
    np.testing.assert_allclose(q, 0, atol=1e-6)
    nothing = [np.zeros(6)] * 4
    quiet, loud = (
        ROBUST.control(0.0, *nothing, speed, dict(memory, past=list(memory["past"])))
        for speed in (np.zeros(6), np.ones(6))
    )
    np.testing.assert_array_equal(quiet, loud)


def test_the_tuning_campaign_flies_what_the_entry_is_not_told():
    worlds, entry = CAMPAIGN.worlds(), load_entry(FOLDER / "robust.py")
    assert len({world.hash for world in worlds}) == 64
    flight = CAMPAIGN.flight(entry, worlds[3], "mujoco")
    assert flight.truth.object.friction == worlds[3].trial.overrides["object.friction"]
    assert flight.truth.sensors.delay == worlds[3].trial.overrides["sensors.delay"]
    own = {*entry.settings, "simulation.engine", "simulation.start", "simulation.hold_time"}
    assert flight.believed.changes().keys() == own


def test_the_score_of_the_campaign_counts_every_world():
    outcomes = (Outcome(None, "no plan: none"), Outcome(None, "diverged: at once"))
    said = str(CAMPAIGN.Score(outcomes, (1.0, 3.0)))
    assert said.startswith("turned over 0 of 2, 0% (0% to ")
    assert "noise gain 2.00 N m s/rad; no plan 1, diverged 1" in said
