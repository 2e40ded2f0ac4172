from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flipdiagram.blocks.observer import DisturbanceObserver, disturbance_estimate, next_observer_state
from flipdiagram.errors import InputError

G, M, PERIOD = 12.6, 0.8, 1e-3
gains, inertias, torques = st.floats(1.0, 200.0), st.floats(0.05, 5.0), st.floats(-20.0, 20.0)


def run(g: float, inertia: float, torque: float, disturbance: float, steps: int, compensate: bool) -> np.ndarray:
    """tau_dis of a body M qdd = tau - d, tau = torque (+ tau_dis to compensate) held over each period."""
    gain, mass = np.array([g]), np.array([inertia])
    w, qd, estimates = np.zeros(1), np.zeros(1), []
    for _ in range(steps):
        estimate = disturbance_estimate(w, gain, mass, qd)
        estimates.append(estimate[0])
        tau = torque + (estimate if compensate else 0.0)
        w = next_observer_state(w, gain, mass, PERIOD, tau + np.zeros(1), qd)
        qd = qd + PERIOD * (tau - disturbance) / inertia
    return np.array(estimates)


def test_one_sample_by_hand() -> None:
    # decay = 1/2: w+ = 0.5 * 4 + 0.5 * (1 + (ln 2)(2)(3)); the estimate w - g M qd = 4 - 6 ln 2
    g = np.array([np.log(2.0)])
    w, mass, qd = np.array([4.0]), np.array([2.0]), np.array([3.0])
    assert next_observer_state(w, g, mass, 1.0, np.array([1.0]), qd) == pytest.approx(2.5 + 3.0 * np.log(2.0))
    assert disturbance_estimate(w, g, mass, qd) == pytest.approx(4.0 - 6.0 * np.log(2.0))


@given(g=gains, inertia=inertias, d=torques)
def test_a_compensated_constant_disturbance_is_found_in_closed_form(g: float, inertia: float, d: float) -> None:
    """tau = tau_dis: the error d - tau_dis shrinks by 1 - gT a sample: time constant 1/g."""
    k = np.arange(300)
    # tau_dis+ = a tau_dis + (1 - a) tau - gT (tau - d) with tau = tau_dis
    expected = d * (1.0 - (1.0 - g * PERIOD) ** k)
    assert run(g, inertia, 0.0, d, k.size, compensate=True) == pytest.approx(expected, abs=1e-9 * (1 + abs(d)))


def test_time_constant_is_one_over_g() -> None:
    at_time_constant = run(G, M, 0.0, 1.0, round(1 / (G * PERIOD)) + 1, compensate=True)[-1]
    assert at_time_constant == pytest.approx(1.0 - np.exp(-1.0), rel=5e-3)


@given(g=gains, inertia=inertias, tau=torques, d=torques)
def test_an_accelerating_body_leaves_the_stated_remainder(g: float, inertia: float, tau: float, d: float) -> None:
    """Without compensation tau_dis -> d + (1 - gT/(1 - e^-gT)) (tau - d), with the factor e^-gT a sample."""
    decay = np.exp(-g * PERIOD)
    limit = d + (1.0 - g * PERIOD / (1.0 - decay)) * (tau - d)
    k = np.arange(200)
    actual = run(g, inertia, tau, d, k.size, compensate=False)
    assert actual == pytest.approx(limit * (1.0 - decay**k), abs=1e-8)
    assert abs(limit - d) <= 0.5 * g * PERIOD * abs(tau - d) * 1.1 + 1e-12


@given(g=gains, inertia=inertias, tau=torques)
def test_no_disturbance_and_an_exact_model_give_nothing_but_the_remainder(g: float, inertia: float, tau: float) -> None:
    estimates = run(g, inertia, tau, 0.0, 200, compensate=False)
    assert (np.abs(estimates) <= 0.55 * g * PERIOD * abs(tau) + 1e-9).all()


@pytest.mark.parametrize("omega", [1.0, 12.6, 100.0, 1000.0])
def test_frequency_response_of_the_sampled_filter(omega: float) -> None:
    """tau -> tau_dis is (1 - a)/(z - a), qd -> tau_dis is g M (1 - z)/(z - a), at z = e^{j omega T}."""
    a, z, n = np.exp(-G * PERIOD), np.exp(1j * omega * PERIOD), 2500
    signal = z ** np.arange(n)
    for tau_on, qd_on, expected in [(1, 0, (1 - a) / (z - a)), (0, 1, G * M * (1 - z) / (z - a))]:
        w, response = np.zeros(1, dtype=complex), 0.0
        for s in signal:
            response = disturbance_estimate(w, np.array([G]), np.array([M]), qd_on * np.array([s]))[0] / s
            w = next_observer_state(
                w, np.array([G]), np.array([M]), PERIOD, tau_on * np.array([s]), qd_on * np.array([s])
            )
        assert response == pytest.approx(expected, abs=1e-9)  # a^2500 = 2e-14
    # and far below Nyquist it is the continuous g/(s+g)
    if omega <= 100.0:
        assert (1 - a) / (z - a) == pytest.approx(G / (1j * omega + G), rel=0.06)


def test_matrix_inertia_couples_the_channels() -> None:
    inertia = np.array([[2.0, 1.0], [1.0, 3.0]])
    qd, g = np.array([1.0, 0.0]), np.array([10.0, 20.0])
    assert disturbance_estimate(np.zeros(2), g, inertia, qd).tolist() == [-20.0, -20.0]
    diagonal = np.diag([2.0, 3.0])
    w, tau = np.array([1.0, 2.0]), np.array([3.0, 4.0])
    assert next_observer_state(w, g, diagonal, PERIOD, tau, qd) == pytest.approx(
        next_observer_state(w, g, np.array([2.0, 3.0]), PERIOD, tau, qd)
    )


def test_ports_feedthrough_and_sampling(feedthrough_of: Any) -> None:
    block = DisturbanceObserver(12.6, [0.5, 1.5], 1e-3, 2e-3)
    assert feedthrough_of(block) == {("qd", "tau_dis")}
    timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.period_sec(), timing.offset_sec()) == (1e-3, 2e-3)


def test_parameters_and_state_live_in_the_context(context_of: Any) -> None:
    block = DisturbanceObserver([10.0], [2.0], 1e-3)
    one, two = (context_of(block, tau=[1.0], qd=[0.5]) for _ in range(2))
    assert block.GetOutputPort("tau_dis").Eval(one)[0] == pytest.approx(-10.0)
    one.SetDiscreteState(block.EvalUniquePeriodicDiscreteUpdate(one).get_vector().value())
    expected = (1 - np.exp(-0.01)) * 11.0 - 10.0
    assert block.GetOutputPort("tau_dis").Eval(one)[0] == pytest.approx(expected)
    assert block.GetOutputPort("tau_dis").Eval(two)[0] == pytest.approx(-10.0)
    block.set_parameters(two, g_dis=4.0)
    block.set_parameters(two, inertia=[3.0])
    assert block.GetOutputPort("tau_dis").Eval(two)[0] == pytest.approx(-6.0)
    updated = block.EvalUniquePeriodicDiscreteUpdate(two).get_vector().value()
    assert updated[0] == pytest.approx((1 - np.exp(-0.004)) * 7.0)


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(InputError, match="g_dis"):
        DisturbanceObserver([-1.0], [1.0], 1e-3)
    with pytest.raises(InputError, match="period"):
        DisturbanceObserver([1.0], [1.0], 0.0)
