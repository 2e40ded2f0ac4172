"""The closed forms against state space written out by hand, python's own limits, and numbers known beforehand."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from flipdiagram.errors import InputError, SimulationError
from flipdiagram.theory.transfer import Loop1Dof

PAPER = {"mass": 1.0, "k_p": 900.0, "k_v": 60.0, "g_dis": 30.0, "nominal_mass": 1.0, "reference_mass": 1.0}
OMEGA = np.geomspace(0.1, 3000, 30)


def loop(**changes):
    return Loop1Dof(**{**PAPER, **changes})


def state_space(form: Loop1Dof):
    """(A, B, C) of the sampled loop, written tick by tick; inputs x_cmd, v_cmd, a_cmd, noise, f_d; output x.

    State x, v, w (observer), z (low-passed x), u (low-passed measured velocity).
    """
    T, m, g, m_n = form.period, form.mass, form.g_dis, form.nominal_mass
    x, v, w, z, u = np.eye(10)[:5]
    x_cmd, v_cmd, a_cmd, noise, f_d = np.eye(10)[5:]
    e, e_v = math.exp(-g * T), math.exp(-(form.velocity_cutoff or 0.0) * T)
    e_a = math.exp(-form.acceleration_cutoff * T) if form.feedforward == "measured" else 0.0
    seen = v if form.velocity_cutoff is None else (1 - e_v) / T * (x - z)
    seen = seen + noise
    a_ref = form.k_p * (x_cmd - x) + form.k_v * (v_cmd - seen)
    if form.feedforward == "command":
        a_ref = a_ref + a_cmd
    elif form.feedforward == "measured":
        a_ref = a_ref + (1 - e_a) / T * (seen - u)
    f = form.reference_mass * a_ref + (w - g * m_n * seen if g else 0)
    push = (f + f_d) / m
    rows = [
        x + T * v + T**2 / 2 * push,
        v + T * push,
        e * w + (1 - e) * (f + g * m_n * seen),
        e_v * z + (1 - e_v) * x,
        e_a * u + (1 - e_a) * seen,
    ]
    both = np.array(rows)
    return both[:, :5], both[:, 5:], np.eye(5)[:1], f


def numeric(form: Loop1Dof, omega: float):
    A, B, C, f = state_space(form)
    inner = np.linalg.solve(np.exp(1j * omega * form.period) * np.eye(5) - A, B)
    command = np.array([1.0, 1j * omega, -(omega**2), 0, 0])
    disturbance, noise = np.eye(5)[4], np.eye(5)[3]
    force = f[:5] @ inner @ command + f[5:] @ command
    return [(C @ inner @ u)[0] for u in (command, noise, disturbance)] + [force]


CASES = [
    dict(
        g_dis=g,
        nominal_mass=r,
        reference_mass=r if scaled and r else 1.0,
        velocity_cutoff=g_v,
        feedforward=ff,
        acceleration_cutoff=60.0,
    )
    for g, r, scaled, g_v, ff in product(
        (0.0, 30.0), (0.0, 0.5, 2.0), (False, True), (None, 62.8), ("none", "command", "measured")
    )
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_sampled_form_is_the_loop_written_tick_by_tick(case):
    form = loop(period=1e-4, **case)
    for omega in (1.0, 35.0, 700.0, 3000.0):
        ours = [f(omega) for f in (form.command, form.noise, form.disturbance, form.torque)]
        assert np.allclose(ours, numeric(form, omega), rtol=1e-7, atol=0)


@given(
    st.floats(0.1, 10),
    st.floats(10, 2000),
    st.floats(5, 200),
    st.floats(1, 300),
    st.floats(0, 2),
    st.sampled_from(["none", "command"]),
)
def test_poles_are_the_eigenvalues(mass, k_p, k_v, g, ratio, ff):
    form = loop(
        mass=mass,
        k_p=k_p,
        k_v=k_v,
        g_dis=g,
        nominal_mass=ratio * mass,
        reference_mass=mass,
        feedforward=ff,
        period=1e-3,
    )
    A = state_space(form)[0][:3, :3]
    poles = form.poles()
    assert len(poles) == 3
    # a characteristic polynomial vanishes at its roots
    for z in np.exp(poles * 1e-3):
        assert abs(np.linalg.det(z * np.eye(3) - A)) < 1e-9


def test_the_continuous_form_is_the_limit_and_scipys_response():
    form = loop(nominal_mass=0.5, feedforward="command")
    assert np.allclose(
        loop(nominal_mass=0.5, feedforward="command", period=1e-7).command(OMEGA), form.command(OMEGA), rtol=1e-3
    )
    # (s + g)(s^2 + k_v s + k_p) / (s^3 + g r s^2 + (s + g)(k_v s + k_p)), the formula known beforehand times s/s
    numerator = np.polymul([1, 30], [1, 60, 900])
    denominator = np.polyadd([1, 15, 0, 0], np.polymul([1, 30], [60, 900]))
    _, expected = signal.freqs(numerator, denominator, OMEGA)
    assert np.allclose(form.command(OMEGA), expected, rtol=1e-12)
    assert sorted(form.poles().real) == pytest.approx(sorted(np.roots(denominator).real), rel=1e-9)


@pytest.mark.parametrize("g", [3.0, 30.0, 300.0])
def test_the_textbook_observer_is_transparent_to_commands(g):
    assert np.allclose(loop(g_dis=g).command(OMEGA), loop(g_dis=0.0).command(OMEGA), rtol=1e-12)


def bandwidth(form):
    omega = np.geomspace(10, 1000, 20000)
    return omega[np.argmax(np.abs(form.command(omega)) < math.sqrt(0.5))]


def test_numbers_known_beforehand():
    assert bandwidth(loop(g_dis=0.0)) == pytest.approx(75, abs=0.6)
    assert bandwidth(loop(nominal_mass=0.0)) == pytest.approx(97, abs=1)
    assert bandwidth(loop(nominal_mass=0.0, g_dis=100.0)) == pytest.approx(139, abs=0.5)
    assert bandwidth(loop(nominal_mass=0.5)) == pytest.approx(87, abs=1)
    assert bandwidth(loop(g_dis=0.0, velocity_cutoff=62.8)) == pytest.approx(117, abs=1)
    assert bandwidth(loop(velocity_cutoff=62.8)) == pytest.approx(132, abs=0.6)
    for r, lead in ((0.0, 18.6), (0.5, 8.5)):
        phases = np.degrees(np.angle(loop(nominal_mass=r, feedforward="command").command(np.arange(1.0, 60.0, 0.5))))
        assert phases.max() == pytest.approx(lead, abs=0.2)
    for omega, plain, forward in ((10.0, 1.023, 0.946), (40.0, 1.566, 1.527)):
        assert abs(loop(nominal_mass=0.0).command(omega)) == pytest.approx(plain, abs=1e-3)
        assert abs(loop(nominal_mass=0.0, feedforward="command").command(omega)) == pytest.approx(forward, abs=1e-3)
    # realisation 3: between reference force and acceleration a (s + g)/(s + a g); so x/x_cmd with a = m_n/m = 2
    s, a, g = 1j * OMEGA, 2.0, 30.0
    inner = a * (s + g) / (s + a * g)
    pd = 60 * s + 900
    assert np.allclose(
        loop(nominal_mass=2.0, reference_mass=2.0).command(OMEGA), inner * pd / (s**2 + inner * pd), rtol=1e-12
    )


@given(st.floats(0, 2), st.floats(1, 300), st.sampled_from([None, 62.8]))
def test_feedforward_lowers_the_torque_just_below_the_root_of_twice_k_p(ratio, g, g_v):
    forms = [
        loop(nominal_mass=ratio, g_dis=g, velocity_cutoff=g_v, feedforward=ff, period=1e-4)
        for ff in ("command", "none")
    ]
    for omega, smaller in ((math.sqrt(1800) * 0.999, True), (math.sqrt(1800) * 1.001, False)):
        assert (abs(forms[0].torque(omega)) < abs(forms[1].torque(omega))) == smaller


def test_acceleration_is_the_difference_of_the_velocity():
    form, omega = loop(feedforward="command", nominal_mass=0.5, period=1e-3), np.array([2.0, 100.0, 2000.0])
    A, B, _, _ = state_space(form)
    for w, ours in zip(omega, form.acceleration(omega), strict=True):
        z = np.exp(1j * w * 1e-3)
        v = np.linalg.solve(z * np.eye(5) - A, B @ [1, 1j * w, -(w**2), 0, 0])[1]
        assert ours == pytest.approx((z - 1) / 1e-3 * v / -(w**2), rel=1e-9)


def test_an_unstable_loop_is_named_with_its_pole():
    form = loop(nominal_mass=0.5, g_dis=100.0, velocity_cutoff=62.8, period=1e-4)
    with pytest.raises(SimulationError, match=r"'x' is unstable: pole at s = 3\.716 ± 86\.7j rad/s"):
        form.check_stable("x")
    loop(period=1e-4).check_stable("x")


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf, math.pi / 1e-4])
def test_frequencies_that_are_none(bad):
    with pytest.raises(InputError, match="valid is finite, above 0 and below"):
        loop(period=1e-4).command([1.0, bad])


@pytest.mark.parametrize(
    "bad", [{"mass": 0.0}, {"k_p": -1.0}, {"k_v": math.nan}, {"g_dis": -3.0}, {"feedforward": "measured"}]
)
def test_numbers_that_make_no_loop(bad):
    with pytest.raises(InputError, match="valid is finite and"):
        loop(**bad)
