"""Eqs. (2)–(5) against numerical integration and hand-worked numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from flipdiagram.planning.model import LandingCost, flight, transition

G = 9.81
numbers = st.floats(-5, 5)
states = st.tuples(*[numbers] * 6).map(np.array)
inputs = st.tuples(*[st.floats(-50, 50)] * 3).map(np.array)
durations = st.floats(1e-3, 0.5)


def integrated(state, acceleration, duration):
    """A double integrator under a held acceleration, by Runge-Kutta."""
    result = solve_ivp(lambda _, x: np.concatenate([x[3:], acceleration]), (0, duration), state, rtol=1e-12, atol=1e-12)
    return result.y[:, -1]


def test_the_matrices_are_those_printed_in_the_paper():
    a, b = transition(0.02)
    np.testing.assert_array_equal(
        a,
        [
            [1, 0, 0, 0.02, 0, 0],
            [0, 1, 0, 0, 0.02, 0],
            [0, 0, 1, 0, 0, 0.02],
            [0, 0, 0, 1, 0, 0],
            [0, 0, 0, 0, 1, 0],
            [0, 0, 0, 0, 0, 1],
        ],
    )
    half = 0.02**2 / 2
    np.testing.assert_allclose(
        b, [[half, 0, 0], [0, half, 0], [0, 0, half], [0.02, 0, 0], [0, 0.02, 0], [0, 0, 0.02]], rtol=1e-15
    )


@given(x=states, u=inputs, dt=durations)
def test_one_step_of_eq_2_is_the_double_integrator(x, u, dt):
    a, b = transition(dt)
    np.testing.assert_allclose(a @ x + b @ u, integrated(x, u, dt), rtol=1e-9, atol=1e-9)


@given(x=states, u=inputs, first=durations, second=durations)
def test_two_steps_with_the_same_input_are_one_longer_step(x, u, first, second):
    (a1, b1), (a2, b2), (a, b) = transition(first), transition(second), transition(first + second)
    np.testing.assert_allclose(a2 @ (a1 @ x + b1 @ u) + b2 @ u, a @ x + b @ u, atol=1e-11)


def test_flight_against_hand_worked_numbers():
    # thrown with 2 m/s up, 1 m/s left, 5 rad/s; half a second later: 0.3 + 1 − 9.81/8 = 0.07375 m high
    matrix, offset = flight(0.5)
    landing = matrix @ [0.1, 0.3, 1.0, 1.0, 2.0, 5.0] + offset
    np.testing.assert_allclose(landing, [0.6, 0.07375, 3.5, 1.0, -2.905, 5.0], rtol=1e-12)


@given(x=states, duration=durations)
def test_flight_is_free_fall(x, duration):
    matrix, offset = flight(duration)
    np.testing.assert_allclose(matrix @ x + offset, integrated(x, [0, -G, 0], duration), rtol=1e-9, atol=1e-9)


@given(x=states, duration=durations)
def test_flight_keeps_energy_and_horizontal_momentum(x, duration):
    matrix, offset = flight(duration)
    after = matrix @ x + offset
    energy = [G * s[1] + (s[3] ** 2 + s[4] ** 2) / 2 for s in (x, after)]
    assert energy[0] == pytest.approx(energy[1], abs=1e-9)
    assert (after[3], after[5]) == (x[3], x[5])


def test_landing_cost_against_hand_worked_numbers_of_eq_5():
    cost = LandingCost(alpha=20.0, beta=0.5)
    # (−0.2)² + 20 · 0.1² + 0.5 (0.3² + 0.4²) = 0.04 + 0.2 + 0.125
    assert cost(np.array([0.1, 0.9, np.pi - 0.2, 0.3, -0.4, 7.0])) == pytest.approx(0.365, rel=1e-12)
    assert cost(np.array([0.0, 0.2, np.pi, 0.0, 0.0, 0.0])) == 0.0
    assert LandingCost(20.0, 0.5, target_y=0.25)(np.array([0.15, 0, np.pi, 0, 0, 0])) == pytest.approx(0.2)


@given(x=states, alpha=st.floats(0, 100), beta=st.floats(0, 10), target=numbers)
def test_landing_cost_is_eq_5(x, alpha, beta, target):
    expected = (x[2] - np.pi) ** 2 + alpha * (x[0] - target) ** 2 + beta * (x[3] ** 2 + x[4] ** 2)
    assert LandingCost(alpha, beta, target)(x) == pytest.approx(expected, rel=1e-10, abs=1e-10)
