"""Friction that sticks, around a mass: against closed forms, and what no friction may do."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flipdiagram.blocks.sticking import (
    ElastoPlasticFriction,
    next_deflection,
    presliding_damping,
    stable_presliding,
    sticking_torque,
)
from flipdiagram.errors import InputError

TAU_C, BREAKAWAY, V_S, PRESLIDING = 2.0, 1.5, 0.05, 5e-4
TAU_B = TAU_C * BREAKAWAY
MASS, STEP = 0.05, 1e-3


class Mass:
    """A mass on a dry surface: v[k+1] = v[k] + h (force + friction) / m, x[k+1] = x[k] + h v[k+1], as the cell's plant."""

    def __init__(
        self, step: float = STEP, mass: float = MASS, v_s: float = V_S, presliding: float = PRESLIDING
    ) -> None:
        self.step, self.mass = step, mass
        sigma_1 = presliding_damping(TAU_B, presliding, mass)
        self.curve = [np.array([value]) for value in (BREAKAWAY, v_s, presliding)]
        self.torque = [np.array([TAU_C]), self.curve[0], np.zeros(1), self.curve[2], sigma_1]
        self.x = self.v = 0.0
        self.z = np.zeros(1)

    def push(self, force: float) -> None:
        v = np.array([self.v])
        after = next_deflection(self.z, v, *self.curve, self.step)
        friction = sticking_torque(self.z, after, v, *self.torque, self.step)[0]
        self.v += self.step * (force + friction) / self.mass
        self.x += self.step * self.v
        self.z = after


def test_by_hand(context_of: Any, feedthrough_of: Any) -> None:
    block = ElastoPlasticFriction([2.0, 2.0], 1.5, 0.1, 0.05, 1e-3, 4.0, 1e-3)
    context = context_of(block, qd=[0.2, 0.05])
    context.SetDiscreteState([2e-4, 9e-4])
    # joint 1 sticks: it bends by 0.2 mrad to 0.4 of 1 mrad.  Its sigma_0 is 3 N m / 1 mrad
    # joint 2 slides at v_s: z_ss = 1 mrad (1 + 0.5 / e) / 1.5, below 0.95 mrad: it relaxes, and w is 0
    z_ss = 1e-3 * (1 + 0.5 / np.e) / 1.5
    expected = [-(3000 * 4e-4 + 4 * 0.2 + 0.1 * 0.2), -(3000 * z_ss + 0.1 * 0.05)]
    assert block.GetOutputPort("tau_friction").Eval(context) == pytest.approx(expected)
    after = block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().value()
    assert after == pytest.approx([4e-4, z_ss])
    assert feedthrough_of(block) == {("qd", "tau_friction")}


def test_a_ramp_bends_the_bristle_and_breaks_it_away_at_the_breakaway_torque() -> None:
    mass, rate = Mass(), 1.0
    breaks = round(TAU_B / rate / STEP)
    for k in range(breaks - 10):
        mass.push(rate * k * STEP)
        # closed form of a ramp on a spring and its damper, m, sigma_1, sigma_0, some periods of it after the start:
        # x = (F - sigma_1 F' / sigma_0) / sigma_0; what the sampling adds is of the order of one step of the ramp
        if k > 100:
            sigma_0, sigma_1 = TAU_B / PRESLIDING, mass.torque[-1][0]
            expected = (rate * k * STEP - rate * sigma_1 / sigma_0) / sigma_0
            assert mass.x == pytest.approx(expected, abs=1.1 * rate * STEP / sigma_0)
    assert mass.x == pytest.approx(PRESLIDING, rel=0.02)  # where it still was on the way to sliding
    for k in range(breaks - 10, breaks + 300):
        mass.push(rate * k * STEP)
    # then friction is Coulomb's: m v = integral of F - tau_c since the breakaway, while the fall along the curve is short
    since = 0.2
    v_0, begin = mass.v, breaks + 300
    for k in range(begin, begin + round(since / STEP)):
        mass.push(rate * k * STEP)
    mean = rate * (begin * STEP + since / 2 - STEP / 2) - TAU_C
    assert mass.v - v_0 == pytest.approx(since * mean / MASS, rel=1e-6)


def drift(load: float, amplitude: float, of: Any = next_deflection) -> float:
    """How far a mass has moved for good under load + amplitude sin(20 Hz), as fractions of tau_b, over two minutes."""
    mass, cycles, samples = Mass(), 400, 50
    rise = [load * k / 500 for k in range(500)]
    wave = [load + amplitude * np.sin(2 * np.pi * k / samples) for k in range(cycles * samples)]
    for level in [*rise, *wave, *rise[::-1], *[0.0] * 500]:
        mass.push(level * TAU_B)
    assert abs(mass.v) < 1e-9
    return mass.x


@pytest.mark.parametrize(("load", "amplitude"), [(0.0, 0.9), (0.6, 0.3), (0.95, 0.0), (-0.7, 0.2)])
def test_it_does_not_creep_below_the_breakaway(load: float, amplitude: float) -> None:
    assert abs(drift(load, amplitude)) < 1e-12


def test_above_the_breakaway_it_moves() -> None:
    assert drift(0.4, 0.7) > 10 * PRESLIDING


@given(speeds=arrays(float, 60, elements=st.floats(-0.5, 0.5)), sigma_1=st.floats(0.0, 1e3), v_s=st.floats(1e-3, 1.0))
def test_energy_is_never_created(speeds: np.ndarray, sigma_1: float, v_s: float) -> None:
    """What the bristle stores grows by no more than the work that the motion does on it, over each single period."""
    z, curve = np.zeros(1), [np.array([BREAKAWAY]), np.array([v_s]), np.array([PRESLIDING])]
    for speed in speeds:
        v = speed * np.ones(1)
        after = next_deflection(z, v, *curve, STEP)
        args = np.array([TAU_C]), curve[0], np.zeros(1), curve[2], np.array([sigma_1]), STEP
        work = -sticking_torque(z, after, v, *args)[0] * speed * STEP
        stored = TAU_B / PRESLIDING / 2 * (after[0] ** 2 - z[0] ** 2)
        assert stored <= work + 1e-15
        assert abs(after[0]) <= PRESLIDING
        z = after


def test_a_mass_that_is_struck_only_loses_energy() -> None:
    mass = Mass()
    mass.v, energies = 0.3, []
    for _ in range(400):
        mass.push(0.0)
        energies.append(MASS * mass.v**2 / 2 + TAU_B / PRESLIDING * mass.z[0] ** 2 / 2)
    assert abs(mass.v) < 1e-12 and abs(energies[-1]) < 1e-12  # it comes to rest, the bristle unloaded
    # the energy of a semi-implicit step wavers by half h w of what the bristle holds
    wavers = 0.5 * STEP * np.sqrt(TAU_B / PRESLIDING / MASS) * TAU_B * PRESLIDING / 2
    assert np.diff(energies).max() < wavers


@given(tau_b=st.floats(0.1, 300.0), inertia=st.floats(0.005, 5.0), share=st.floats(0.0, 0.9))
def test_the_smallest_presliding_is_stable_with_a_margin_of_two(tau_b: float, inertia: float, share: float) -> None:
    d = share * inertia / STEP
    least = stable_presliding(tau_b, d, inertia, STEP)[0]
    for factor in (1.0, 0.2):
        sigma_0 = tau_b / (factor * least)
        sigma_1 = presliding_damping(tau_b, factor * least, inertia)[0]
        a, b = STEP**2 * sigma_0 / inertia, STEP * (sigma_1 + d) / inertia
        step = np.array([[1.0, 1.0], [-a, 1.0 - a - b]])  # of (z, h v)
        assert (np.abs(np.linalg.eigvals(step)).max() < 1.0) == (a + 2 * b < 4.0)
        assert factor < 1.0 or a + 2 * b == pytest.approx(2.0)


def hunting(k_p: float, k_d: float, k_i: float) -> tuple[float, float]:
    """Half period [s] and stuck position of the limit cycle of a PID on a mass of 1 kg under TAU_B at rest, else TAU_C.

    Exact: while it slides (x, v, the integral of x, 1) follows a linear equation; it sticks where v = 0, and breaks away
    where the integral has wound up.
    """
    slide = np.array([[0, 1, 0, 0], [-k_p, -k_d, -k_i, -TAU_C], [1, 0, 0, 0], [0, 0, 0, 0]], dtype=float)
    poles, modes = np.linalg.eig(slide)
    x, dt = -0.01, 1e-3
    for _ in range(30):  # seen so that it slides to the positive side, from x < 0
        begin = np.linalg.solve(modes, [x, 0.0, (-k_p * x - TAU_B) / k_i, 1.0])

        def after(time: float, begin: np.ndarray = begin) -> np.ndarray:
            return np.real(modes @ (np.exp(poles * time) * begin))

        low = dt
        while after(low + dt)[1] > 0:
            low += dt
        high = low + dt
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if after(middle)[1] > 0 else (low, middle)
        x, _, integral, _ = after(low)
        stuck = ((-k_p * x + TAU_B) / k_i - integral) / x  # until it breaks away to the other side
        x = -x
    return low + stuck, -x


def test_the_hunting_of_a_pid_on_a_mass_has_its_exact_period_and_amplitude() -> None:
    k_p, k_d, k_i = 100.0, 12.0, 250.0
    half_period, amplitude = hunting(k_p, k_d, k_i)
    step = 4e-4
    mass = Mass(step, 1.0, v_s=1e-5, presliding=2e-6)  # nearly the ideal friction of the exact solution
    mass.x, integral, places, times = -amplitude, 0.0, [], []
    for k in range(round(4 * half_period / step)):
        x, v = mass.x, mass.v
        mass.push(-k_p * x - k_d * v - k_i * integral)
        integral += step * x
        if x < 0 <= mass.x or mass.x < 0 <= x:
            times.append(k * step)
        if abs(mass.v) < 1e-6:
            places.append(abs(mass.x))
    assert np.diff(times) == pytest.approx(half_period, rel=0.01)
    assert np.median(places) == pytest.approx(amplitude, rel=0.01)


def test_bad_arguments_are_refused() -> None:
    good: dict[str, Any] = {"tau_c": [1.0], "breakaway": 1.5, "d": 0.0, "v_s": 0.1, "presliding": 1e-3, "sigma_1": 0.0}
    for name, value in {"breakaway": 0.9, "v_s": 0.0, "presliding": 0.0, "sigma_1": -1.0, "tau_c": [-1.0]}.items():
        with pytest.raises(InputError, match=name):
            ElastoPlasticFriction(**good | {name: value}, period=0.001)
    assert np.isinf(stable_presliding(1.0, 50.0, 0.05, 1e-3))
