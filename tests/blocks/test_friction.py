from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flipdiagram.blocks.friction import JointFriction, friction_torque, stable_transition_velocity
from flipdiagram.errors import InputError

VELOCITIES = arrays(float, 3, elements=st.floats(-10.0, 10.0))
TAU_C, D, V_S = np.array([1.0, 0.5, 0.0]), np.array([0.1, 0.0, 2.0]), np.array([0.01, 0.1, 1.0])


def test_by_hand(context_of: Any, feedthrough_of: Any) -> None:
    # far above v_s: -(1 + 0.1 * 3); at v_s: -0.5 tanh 1; without Coulomb friction: -2 * (-1)
    block = JointFriction(TAU_C, D, V_S)
    context = context_of(block, qd=[3.0, 0.1, -1.0])
    expected = [-1.3, -0.5 * 0.7615941559557649, 2.0]
    assert block.GetOutputPort("tau_friction").Eval(context) == pytest.approx(expected)
    block.set_parameters(context, tau_c=0.0, d=1.0)
    assert block.GetOutputPort("tau_friction").Eval(context) == pytest.approx([-3.0, -0.1, 1.0])
    block.set_parameters(context, tau_c=[0.0, 2.0, 0.0], v_s=0.05)
    assert block.GetOutputPort("tau_friction").Eval(context)[1] == pytest.approx(-0.1 - 2 * np.tanh(2.0))
    assert feedthrough_of(block) == {("qd", "tau_friction")}


@given(qd=VELOCITIES)
def test_dissipates_and_is_odd(qd: np.ndarray) -> None:
    torque = friction_torque(qd, TAU_C, D, V_S)
    assert (qd * torque <= 0.0).all()
    assert (friction_torque(-qd, TAU_C, D, V_S) == -torque).all()
    assert (np.abs(torque) <= TAU_C + D * np.abs(qd) + 1e-12).all()


def sign_changes(v_s: float, tau_c: float, inertia: float, step: float) -> int:
    """Sign changes of a sliding body's velocity under friction alone, explicit integration."""
    velocities, qd = [], np.array([20.3 * step * tau_c / inertia])  # comes to rest after some twenty steps
    for _ in range(300):
        velocities.append(qd[0] if abs(qd[0]) > 1e-14 else 0.0)  # rounding is no chatter
        qd = qd + step / inertia * friction_torque(qd, np.array([tau_c]), np.zeros(1), np.array([v_s]))
    return int(np.count_nonzero(np.multiply(velocities[1:], velocities[:-1]) < 0.0))


@given(tau_c=st.floats(0.1, 5.0), inertia=st.floats(0.01, 1.0))
def test_transition_velocity_is_the_smallest_without_chatter(tau_c: float, inertia: float) -> None:
    step = 1e-3
    v_s = stable_transition_velocity(tau_c, inertia, step)[0]
    assert sign_changes(v_s, tau_c, inertia, step) == 0
    assert sign_changes(0.3 * v_s, tau_c, inertia, step) > 100  # multiplier 1 - 1/0.3: unstable around rest


def test_transition_velocity_by_hand_and_creep() -> None:
    v_s = stable_transition_velocity([2.0, 0.0], [0.05, 1.0], 1e-3)
    assert v_s == pytest.approx([0.04, 0.0])
    # the documented creep: at v_s artanh(1/2) friction balances half the Coulomb torque
    creep = 0.04 * np.arctanh(0.5)
    assert friction_torque(np.array([creep]), np.array([2.0]), np.zeros(1), v_s[:1]) == pytest.approx([-1.0])


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(InputError, match="v_s"):
        JointFriction([1.0], [0.0], [0.0])
    with pytest.raises(InputError, match="step"):
        stable_transition_velocity(1.0, 1.0, 0.0)
    with pytest.raises(InputError, match="inertia"):
        stable_transition_velocity(1.0, 0.0, 1e-3)
