"""The mass of section III: closed forms of held force, sampled friction and true sticking."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from flipdiagram.errors import InputError
from flipdiagram.plants.one_dof import FRICTIONS, OneDofPlant, held_step, signum_step, stick_slip_step

pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
T = 1e-3


def run(step, ticks, force, **numbers):
    x, v, trace = 0.0, 0.0, []
    for k in range(ticks):
        x, v = step(x, v, force(k), T=T, **numbers)
        trace.append((x, v))
    return np.array(trace)


def test_a_held_force_gives_a_parabola():
    x, v = run(held_step, 1000, lambda k: 3.0, mass=2.0)[-1]
    assert (x, v) == pytest.approx((0.75, 1.5), rel=1e-12)  # 1/2 (3/2) 1^2 and (3/2) 1


def test_the_sign_is_sampled_and_held_as_the_paper_writes_it():
    assert signum_step(1.0, 2.0, 5.0, 1.0, 0.5, 0.1, T) == held_step(1.0, 2.0, 5.0 - 0.5 - 0.2, 1.0, T)
    assert signum_step(1.0, -2.0, 5.0, 1.0, 0.5, 0.1, T) == held_step(1.0, -2.0, 5.0 + 0.5 + 0.2, 1.0, T)
    assert signum_step(1.0, 0.0, 5.0, 1.0, 0.5, 0.1, T) == held_step(1.0, 0.0, 5.0, 1.0, T)
    chatter = run(signum_step, 200, lambda k: 0.05, mass=1.0, f_c=0.1, d=0.0)  # never at rest below f_c
    assert np.abs(np.diff(chatter[:, 1])) == pytest.approx(0.05 * T) and chatter[-1, 0] > 0


def test_below_f_c_it_stays_at_rest_to_the_last_bit():
    assert not run(stick_slip_step, 1000, lambda k: 0.1 * math.sin(k), mass=1.0, f_c=0.1, d=0.1).any()


def test_above_f_c_it_breaks_away_and_nears_the_final_velocity():
    x, v = run(stick_slip_step, 1000, lambda k: 0.3, mass=0.5, f_c=0.1, d=0.4)[-1]
    final, decay = 0.2 / 0.4, math.exp(-0.4 * 1.0 / 0.5)  # m v' = 0.3 - 0.1 - 0.4 v
    assert v == pytest.approx(final * (1 - decay), rel=1e-11)
    assert x == pytest.approx(final * (1.0 - (1 - decay) * 0.5 / 0.4), rel=1e-11)


@given(
    st.floats(1e-6, 0.5), st.floats(0.01, 2.0), st.floats(0.1, 3.0), st.floats(0.0, 1.0), st.sampled_from([-1.0, 1.0])
)
def test_a_coasting_mass_stops_where_its_energy_ends(v, f_c, mass, d, side):
    x, ticks = 0.0, 0
    speed = side * v
    while speed != 0.0 and ticks < 200_000:
        x, speed = stick_slip_step(x, speed, 0.0, mass, f_c, min(d, 1e-3 * mass / T), T)
        ticks += 1
    d = min(d, 1e-3 * mass / T)
    rho = d * v / f_c  # x = m/d (v - f_c/d ln(1 + d v/f_c)), its limit m v^2/(2 f_c)
    series = 0.5 - rho / 3 + rho**2 / 4 if rho < 1e-4 else (rho - math.log1p(rho)) / rho**2
    assert side * x == pytest.approx(mass * v**2 / f_c * series, rel=1e-8)


@given(st.floats(-5e-4, 5e-4), st.floats(-1.0, 1.0), st.floats(0.0, 0.5), st.floats(0.0, 0.99))
def test_one_step_is_the_solution_of_the_equation_of_motion(v, force, f_c, d):
    """Against an integrator that is stopped at v = 0 and started again."""
    x0, v0, left = 0.0, v, T
    for _ in range(3):
        s = math.copysign(1.0, v0) if v0 else (math.copysign(1.0, force) if abs(force) > f_c else 0.0)
        if s == 0.0 or left <= 0:
            break

        def stop(t, y, s=s):
            return s * y[1] + 1e-18

        stop.terminal, stop.direction = True, -1
        drive = force - s * f_c
        done = solve_ivp(
            lambda t, y, a=drive: [y[1], a - d * y[1]], (0, left), [x0, v0], rtol=1e-11, atol=1e-16, events=stop
        )
        x0, v0, left = done.y[0, -1], done.y[1, -1], left - done.t[-1]
        if done.status == 1:
            v0 = 0.0
    x, speed = stick_slip_step(0.0, v, force, 1.0, f_c, d, T)
    assert (x, speed) == (pytest.approx(x0, rel=1e-6, abs=1e-12), pytest.approx(v0, rel=1e-6, abs=1e-10))


@pytest.mark.parametrize("friction", FRICTIONS)
def test_the_block_steps_as_its_law_over_every_scalar(friction):
    plant = OneDofPlant([1.0, 2.0], T, friction, [0.1, 0.2], 0.3)
    laws = {
        "none": lambda *a: held_step(*a[:4], T),
        "signum": lambda *a: signum_step(*a, T),
        "stick-slip": lambda *a: stick_slip_step(*a, T),
    }
    for v in ([1.0, -1.0], [1e-5, -1e-5], [0.0, 0.0]):
        for form in (plant, plant.ToAutoDiffXd(), plant.ToSymbolic()):
            context = form.CreateDefaultContext()
            context.SetDiscreteState(np.array([0.5, 0.6, *v]))
            form.GetInputPort("f").FixValue(context, np.array([9.7, 30.0]))
            after = form.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector()
            a = form.GetOutputPort("a").Eval(context)
            numbers = [
                value.Evaluate() if hasattr(value, "Evaluate") else getattr(value, "value", lambda v=value: v)()
                for value in (*after, *a)
            ]
            expected = [
                laws[friction](0.5 + 0.1 * i, v[i], f - m * 9.81, m, c, 0.3)
                for i, (f, m, c) in enumerate([(9.7, 1.0, 0.1), (30.0, 2.0, 0.2)])
            ]
            assert numbers[:4] == pytest.approx(
                [expected[0][0], expected[1][0], expected[0][1], expected[1][1]], rel=1e-13, abs=1e-18
            )
            assert numbers[4:] == pytest.approx([(expected[i][1] - v[i]) / T for i in range(2)], rel=1e-9, abs=1e-9)
            feeds = {form.get_output_port(i).get_name() for i in range(3) if form.HasDirectFeedthrough(0, i)}
            assert feeds == {"a"}


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"friction": "tanh"}, "friction = 'tanh'; choose from none, signum, stick-slip"),
        ({"mass": 0.0}, "mass"),
        ({"f_c": -1.0}, "f_c"),
        ({"d": 11.0}, "at most 0.001 mass/period"),
        ({"period": 0.0}, "period"),
    ],
)
def test_numbers_that_make_no_plant(bad, words):
    with pytest.raises(InputError, match=words):
        OneDofPlant(**{"mass": 1.0, "period": T, **bad})
