from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression, Variable

from flipdiagram.blocks.sensors import Encoder, PseudoDerivative, filtered_velocity, next_filter_state, quantised


def test_encoder_by_hand(context_of: Any, feedthrough_of: Any) -> None:
    block = Encoder([0.5, 0.5, 0.5, 0.0])
    context = context_of(block, q=[0.74, 0.75, -0.76, 0.123])
    assert block.GetOutputPort("q_measured").Eval(context).tolist() == [0.5, 1.0, -1.0, 0.123]
    block.set_parameters(context, resolution=[0.0, 1.0, 0.1, 0.1])
    assert block.GetOutputPort("q_measured").Eval(context) == pytest.approx([0.74, 1.0, -0.8, 0.1])
    assert feedthrough_of(block) == {("q", "q_measured")}


@given(q=st.floats(-7.0, 7.0), resolution=st.floats(1e-6, 0.1))
def test_quantised_is_near_idempotent_and_a_multiple(q: float, resolution: float) -> None:
    once = quantised(np.array([q]), np.array([resolution]))
    assert abs(once[0] - q) <= 0.5 * resolution * (1 + 1e-6)
    assert quantised(once, np.array([resolution])) == pytest.approx(once, abs=1e-12)
    assert once[0] / resolution == pytest.approx(np.round(once[0] / resolution), abs=1e-6)


def test_quantised_over_other_scalars() -> None:
    q, r = Variable("q"), Variable("r")
    (result,) = quantised(np.array([Expression(q)]), np.array([Expression(r)]))
    assert result.Evaluate({q: 0.74, r: 0.5}) == 0.5
    assert result.Evaluate({q: 0.74, r: 0.0}) == 0.74
    (off,) = quantised(np.array([Expression(q)]), np.array([Expression(0.0)]))
    assert off.EqualTo(Expression(q))
    rounded, through = quantised(np.array([AutoDiffXd(0.74, [1.0])] * 2), np.array([AutoDiffXd(0.5), AutoDiffXd(0.0)]))
    assert rounded.value() == 0.5 and not np.any(rounded.derivatives())
    assert through.value() == 0.74 and through.derivatives().tolist() == [1.0]


@pytest.mark.parametrize("g", [2 * np.pi * 10.0, 1000.0])
def test_pseudo_derivative_of_a_ramp_in_closed_form(g: float) -> None:
    """q = c t: v[k] = c (1 - a^k), a = e^-gT, with the true slope in the end however large gT is."""
    period, slope = 1e-3, 0.7
    z, a = np.zeros(1), np.exp(-g * period)
    for k in range(200):
        q = np.array([slope * k * period])
        expected = slope * (1.0 - a**k)
        assert filtered_velocity(z, np.array([g]), period, q)[0] == pytest.approx(expected, abs=1e-12)
        z = next_filter_state(z, np.array([g]), period, q)


@pytest.mark.parametrize("omega", [1.0, 60.0, 1000.0])
def test_pseudo_derivative_frequency_response(omega: float) -> None:
    g, period = 60.0, 1e-3
    a, zeta, z = np.exp(-g * period), np.exp(1j * omega * period), np.zeros(1, dtype=complex)
    for sample in zeta ** np.arange(600):
        response = filtered_velocity(z, np.array([g]), period, np.array([sample]))[0] / sample
        z = next_filter_state(z, np.array([g]), period, np.array([sample]))
    assert response == pytest.approx((1 - a) / period * (zeta - 1) / (zeta - a), abs=1e-9)
    if omega <= 60.0:  # the continuous g s/(s+g)
        assert response == pytest.approx(g * 1j * omega / (1j * omega + g), rel=0.05)


def test_pseudo_derivative_block(context_of: Any, feedthrough_of: Any) -> None:
    block = PseudoDerivative([10.0, 20.0], 1e-3)
    one, two = (context_of(block, q=[0.3, -0.4]) for _ in range(2))
    assert block.GetOutputPort("v").Eval(one) == pytest.approx((1 - np.exp([-0.01, -0.02])) * 1e3 * [0.3, -0.4])
    standing = PseudoDerivative([10.0, 20.0], 1e-3, initial=[0.3, -0.4])
    assert standing.GetOutputPort("v").Eval(context_of(standing, q=[0.3, -0.4])).tolist() == [0.0, 0.0]
    assert block.GetOutputPort("v").Eval(two) == pytest.approx((1 - np.exp([-0.01, -0.02])) * 1e3 * [0.3, -0.4])
    block.set_parameters(two, g_v=1.0)
    assert block.GetOutputPort("v").Eval(two) == pytest.approx((1 - np.exp(-1e-3)) * 1e3 * np.array([0.3, -0.4]))
    updated = block.EvalUniquePeriodicDiscreteUpdate(two).get_vector().value()
    assert updated == pytest.approx((1 - np.exp(-1e-3)) * np.array([0.3, -0.4]))
    assert feedthrough_of(block) == {("q", "v")}
