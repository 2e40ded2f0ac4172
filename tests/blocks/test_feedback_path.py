"""The memoryless boxes between command and torque: FF, PD, M_n, and the torque limit."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.pd import ProportionalDerivative, feedback_acceleration
from flipdiagram.blocks.torque_limit import TorqueLimit, limited_torque
from flipdiagram.errors import InputError

VECTORS = arrays(float, 3, elements=st.floats(-1e3, 1e3))


def test_feedforward_passes_the_command_and_its_gain_is_in_the_context(context_of: Any, feedthrough_of: Any) -> None:
    block = AccelerationFeedforward(2)
    context, other = context_of(block, a_cmd=[3.0, -4.0]), context_of(block, a_cmd=[3.0, -4.0])
    assert block.GetOutputPort("a_ff").Eval(context).tolist() == [3.0, -4.0]
    block.set_parameters(context, k_ff=[0.5, 2.0])
    assert block.GetOutputPort("a_ff").Eval(context).tolist() == [1.5, -8.0]
    assert block.GetOutputPort("a_ff").Eval(other).tolist() == [3.0, -4.0]
    assert feedthrough_of(block) == {("a_cmd", "a_ff")}


def test_pd_by_hand(context_of: Any, feedthrough_of: Any) -> None:
    # 350 * (0.10 - 0.08) + 120 * (0.5 - 0.6) = 7 - 12; 2 * (1 - 3) + 4 * (0 - (-1)) = -4 + 4
    block = ProportionalDerivative([350.0, 2.0], [120.0, 4.0])
    context = context_of(block, x_cmd=[0.10, 1.0], v_cmd=[0.5, 0.0], x=[0.08, 3.0], v=[0.6, -1.0])
    assert block.GetOutputPort("a_ref").Eval(context) == pytest.approx([-5.0, 0.0], abs=1e-12)
    block.set_parameters(context, k_v=0.0)
    assert block.GetOutputPort("a_ref").Eval(context) == pytest.approx([7.0, -4.0])
    block.set_parameters(context, k_p=[0.0, 1.0])
    assert block.GetOutputPort("a_ref").Eval(context) == pytest.approx([0.0, -2.0])
    assert feedthrough_of(block) == {(name, "a_ref") for name in ("x_cmd", "v_cmd", "x", "v")}


def test_pd_gains_of_different_length_are_refused() -> None:
    with pytest.raises(InputError, match="k_p.*3 channels"):
        ProportionalDerivative([1.0, 2.0], [1.0, 2.0, 3.0])
    assert ProportionalDerivative([1.0, 2.0], 3.0).k_v.tolist() == [3.0, 3.0]


@given(x=VECTORS, v=VECTORS)
def test_pd_asks_for_nothing_on_the_command(x: np.ndarray, v: np.ndarray) -> None:
    assert not feedback_acceleration(np.full(3, 350.0), np.full(3, 120.0), x, v, x, v).any()


def test_nominal_inertia_diagonal(context_of: Any, feedthrough_of: Any) -> None:
    block = NominalInertia([0.5, 1.5])
    context = context_of(block, qdd_ref=[2.0, -2.0])
    assert block.GetOutputPort("tau_ref").Eval(context).tolist() == [1.0, -3.0]
    block.set_parameters(context, inertia=[1.0, 1.0])
    assert block.GetOutputPort("tau_ref").Eval(context).tolist() == [2.0, -2.0]
    assert feedthrough_of(block) == {("qdd_ref", "tau_ref")}
    with pytest.raises(InputError, match=r"\(2, 2\)"):
        block.set_parameters(context, inertia=np.eye(2))


def test_nominal_inertia_matrix(context_of: Any) -> None:
    block = NominalInertia([[2.0, 0.5], [0.5, 1.0]])
    context = context_of(block, qdd_ref=[1.0, 2.0])
    assert block.GetOutputPort("tau_ref").Eval(context).tolist() == [3.0, 2.5]
    block.set_parameters(context, inertia=[4.0, 5.0])
    assert block.GetOutputPort("tau_ref").Eval(context).tolist() == [4.0, 10.0]


def test_torque_limit_by_hand(context_of: Any, feedthrough_of: Any) -> None:
    block = TorqueLimit([1.0, 2.0, 0.0])
    context = context_of(block, tau_cmd=[-5.0, 1.5, 3.0])
    assert block.GetOutputPort("tau").Eval(context).tolist() == [-1.0, 1.5, 0.0]
    block.set_parameters(context, tau_max=10.0)
    assert block.GetOutputPort("tau").Eval(context).tolist() == [-5.0, 1.5, 3.0]
    assert feedthrough_of(block) == {("tau_cmd", "tau")}


@given(tau=VECTORS, tau_max=arrays(float, 3, elements=st.floats(0.0, 500.0)))
def test_torque_limit_is_idempotent_and_bounded(tau: np.ndarray, tau_max: np.ndarray) -> None:
    once = limited_torque(tau, tau_max)
    assert (np.abs(once) <= tau_max).all()
    assert (limited_torque(once, tau_max) == once).all()
    inside = np.abs(tau) <= tau_max
    assert (once[inside] == tau[inside]).all()
