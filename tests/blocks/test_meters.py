"""Sources and meters against NumPy on the same samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from flipdiagram.blocks.commands import BroadbandNoise, SinusoidalCommand, SinusoidalNoise, next_random
from flipdiagram.blocks.meters import LockIn, Peak, RootMeanSquare, fundamental, whole_periods
from flipdiagram.errors import InputError

pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
T, OMEGA = 0.01, np.array([3.0, 40.0])


def samples(ticks):
    t = T * np.arange(ticks)[:, None]
    return -np.sin(OMEGA * t), -OMEGA * np.cos(OMEGA * t), OMEGA**2 * np.sin(OMEGA * t)


@pytest.mark.parametrize("start_time", [0.0, 0.5])
def test_meters_agree_with_numpy(start_time):
    builder = DiagramBuilder()
    command = builder.AddNamedSystem("command", SinusoidalCommand(OMEGA))
    meters = {
        "lockin": LockIn(OMEGA, T, start_time),
        "peak": Peak(2, T, start_time),
        "rms": RootMeanSquare(2, T, start_time),
    }
    for name, meter in meters.items():
        builder.AddNamedSystem(name, meter)
        builder.Connect(command.GetOutputPort("v_cmd"), meter.GetInputPort("y"))
    builder.Connect(command.GetOutputPort("x_cmd"), meters["rms"].GetInputPort("reference"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(2.0 - T / 2)
    context = simulator.get_context()
    read = {name: meter.get_output_port().Eval(meter.GetMyContextFromRoot(context)) for name, meter in meters.items()}
    first = round(start_time / T)
    x, v, a = (signal[first:] for signal in samples(200))
    assert read["lockin"] == pytest.approx(
        np.concatenate([(v * a).sum(0) / OMEGA**2, (v * -v).sum(0) / OMEGA, v.sum(0)]), rel=1e-9, abs=1e-9
    )
    assert read["peak"] == pytest.approx(np.concatenate([v.max(0), v.min(0)]), rel=1e-12)
    assert read["rms"] == pytest.approx(np.sqrt(((v - x) ** 2).mean(0)), rel=1e-12)
    sums = read["lockin"].reshape(3, 2).T
    assert fundamental(sums, OMEGA, T, first, 200 - first) == pytest.approx(-1j * OMEGA, rel=1e-9)


def test_meters_read_nothing_before_they_start():
    for meter, nothing in (
        (Peak(1, T), [-np.inf, np.inf]),
        (RootMeanSquare(1, T), [0.0]),
        (LockIn([1.0], T), [0.0] * 3),
    ):
        assert meter.get_output_port().Eval(meter.CreateDefaultContext()).tolist() == nothing


@given(
    st.floats(-5, 5),
    st.floats(0.01, 5),
    st.floats(-3, 3),
    st.floats(0.5, 300),
    st.integers(0, 10**6),
    st.integers(30, 3000),
)
def test_the_fundamental_of_a_sinusoid_on_an_offset_is_exact(mean, amplitude, angle, omega, start, ticks):
    """Also where the window is not a whole number of periods, as long as it holds a good part of one."""
    ticks = max(ticks, round(1.2 * 2 * np.pi / (omega * T)))
    t = T * (start + np.arange(ticks))
    y = mean + amplitude * np.sin(omega * t + angle)
    sums = [(y * np.sin(omega * t)).sum(), (y * np.cos(omega * t)).sum(), y.sum()]
    found = fundamental(sums, omega, T, start, ticks)
    assert abs(found - amplitude * np.exp(1j * angle)) < 1e-6 * (amplitude + abs(mean))


@given(st.floats(0.1, 5000))
def test_windows_are_nearly_whole_periods(omega):
    ticks = whole_periods(omega, 1e-4, 2000)
    periods = ticks * omega * 1e-4 / (2 * np.pi)
    assert ticks >= 1995 and round(periods) >= 1
    assert abs(periods - round(periods)) < 0.01


def test_commands_are_equations_13_to_15_and_noise_a_sine():
    command, noise = SinusoidalCommand(OMEGA, 2.0), SinusoidalNoise(OMEGA, 2.0)
    for k, (x, v, a) in enumerate(zip(*samples(20), strict=True)):
        for block in (command, command.ToSymbolic()):
            context = block.CreateDefaultContext()
            context.SetTime(T * k)
            for name, value in (("x_cmd", x), ("v_cmd", v), ("a_cmd", a)):
                read = [
                    float(e.Evaluate()) if hasattr(e, "Evaluate") else e
                    for e in block.GetOutputPort(name).Eval(context)
                ]
                assert read == pytest.approx(2 * value, rel=1e-12, abs=1e-12)
        context = noise.CreateDefaultContext()
        context.SetTime(T * k)
        assert noise.get_output_port().Eval(context) == pytest.approx(-2 * x, abs=1e-12)


def test_the_generator_is_the_minimal_standard():
    """Park and Miller, Communications of the ACM 31 (1988): from 1, the number after 10 000 steps is 1043618065."""
    state = 1.0
    for _ in range(10_000):
        state = float(next_random(state))
    assert state == 1043618065.0


def test_broadband_noise_is_white_and_repeats_with_its_seed():
    block = BroadbandNoise([0.5, 0.5], T, [1, 1043618065])
    simulator = Simulator(block)
    drawn = []
    for k in range(4000):
        simulator.AdvanceTo(T * (k + 0.5))
        drawn.append(block.get_output_port().Eval(simulator.get_context()))
    noise = np.array(drawn)
    assert noise.std(axis=0) == pytest.approx([0.5, 0.5], rel=0.03)
    for lag in (1, 2, 10):
        assert abs(np.mean(noise[lag:] * noise[:-lag])) < 4 * 0.25 / np.sqrt(4000)
    assert abs(np.mean(noise[:, 0] * noise[:, 1])) < 4 * 0.25 / np.sqrt(4000)
    symbolic = block.ToSymbolic()
    context = symbolic.CreateDefaultContext()
    after = symbolic.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector()
    assert [e.Evaluate() for e in after] == [16807.0, next_random(1043618065.0)]


@pytest.mark.parametrize(
    "make",
    [
        lambda: SinusoidalCommand([0.0]),
        lambda: SinusoidalNoise([-1.0]),
        lambda: LockIn([np.nan], T),
        lambda: LockIn([1.0], 0.0),
        lambda: Peak(1, T, -1.0),
        lambda: BroadbandNoise([1.0], T, [0]),
        lambda: BroadbandNoise([1.0], T, [1.5]),
        lambda: BroadbandNoise([-1.0], T),
    ],
)
def test_bad_numbers_are_named(make):
    with pytest.raises(InputError, match=r"; valid is (a )?(finite|whole) numbers?"):
        make()
