"""Blows against springs, against the motion integrated in small steps."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from flipdiagram.theory.impact import damping_ratio, restitution

STIFFNESS, MASS = 1.5e5, 3.2


def speed_after(force, speed):
    """Of a mass that meets a spring which pushes and never pulls, over its speed before."""

    def leaves(t, state):
        return force(*state) if t > 0 and state[1] < 0 else 1.0

    leaves.terminal = True
    found = solve_ivp(
        lambda t, state: (state[1], -max(force(*state), 0.0) / MASS),
        (0.0, 1.0),
        (0.0, speed),
        events=leaves,
        rtol=1e-10,
        atol=1e-12,
        max_step=1e-4,
    )
    return -found.y_events[0][0][1] / speed


@pytest.mark.parametrize(("dissipation", "speed"), [(2.0, 0.5), (20.0, 0.3), (0.5, 0.1), (100.0, 1.0)])
def test_hunt_and_crossley(dissipation, speed):
    after = speed_after(lambda x, v: STIFFNESS * x * (1 + dissipation * v), speed)
    assert restitution(dissipation, speed) == pytest.approx(after, rel=1e-4)


@pytest.mark.parametrize("back", [0.95, 0.6, 0.3])
def test_the_linear_damper_sends_as_much_back(back):
    damping = 2 * damping_ratio(back) * math.sqrt(STIFFNESS * MASS)
    assert speed_after(lambda x, v: STIFFNESS * x + damping * v, 0.5) == pytest.approx(back, rel=1e-3)


@given(st.floats(0.0, 1e4), st.floats(1e-6, 10.0))
def test_a_blow_never_comes_back_faster(dissipation, speed):
    assert 0.0 < restitution(dissipation, speed) <= 1.0


@given(st.floats(0.0, 1.0))
def test_every_share_has_a_damper(back):
    zeta = damping_ratio(back)
    assert 0.0 <= zeta <= 1.0 and (back < math.exp(-2) or zeta < 1)


def test_without_damping_all_comes_back():
    assert restitution(0.0, 0.5) == 1.0
    assert damping_ratio(1.0) == 0.0
