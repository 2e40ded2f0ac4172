"""Sensor noise: white, of the deviation asked for, and the same number for the same seed and tick."""

from typing import Any

import numpy as np
import pytest
from pydrake.autodiffutils import InitializeAutoDiff
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, VectorLogSink
from scipy import stats

from flipdiagram.blocks.noise import PAGE, SensorNoise, white_noise
from flipdiagram.errors import InputError

PERIOD, TICKS = 1e-3, 20_000
DEVIATION = np.array([0.01, 3.0, 0.0])


@pytest.fixture(scope="module")
def output() -> np.ndarray:
    """What the block gives for a constant input, once a tick, shape (TICKS, 3)."""
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource(np.array([1.0, -2.0, 5.0])))
    noise = builder.AddSystem(SensorNoise(DEVIATION, 7, PERIOD))
    log = builder.AddSystem(VectorLogSink(3, PERIOD))
    builder.Connect(source.get_output_port(), noise.get_input_port())
    builder.Connect(noise.get_output_port(), log.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo((TICKS - 0.5) * PERIOD)
    data: np.ndarray = log.FindLog(simulator.get_context()).data().T
    assert data.shape == (TICKS, 3)
    return data


def test_mean_and_deviation_are_those_asked_for(output: np.ndarray) -> None:
    error = output - [1.0, -2.0, 5.0]
    assert not error[:, 2].any()
    for channel in (0, 1):
        scaled = error[:, channel] / DEVIATION[channel]
        assert abs(scaled.mean()) < 4 / np.sqrt(TICKS)  # standard error 1/√N
        assert abs(scaled.std() - 1) < 4 / np.sqrt(2 * TICKS)  # that of the deviation of normal numbers: 1/√(2N)
        assert stats.kstest(scaled, "norm").pvalue > 0.01


def test_it_is_white(output: np.ndarray) -> None:
    """Autocorrelations of white noise are normal with variance 1/N, N Σ r² over m lags is χ² with m degrees."""
    lags = [*range(1, 51), PAGE - 1, PAGE, PAGE + 1, 2 * PAGE]
    one, two = ((output - output.mean(axis=0))[:, :2] / output.std(axis=0)[:2]).T
    for w in (one, two):
        r = np.array([np.mean(w[:-lag] * w[lag:]) for lag in lags])
        assert np.abs(r).max() < 4.5 / np.sqrt(TICKS)
        assert 0.001 < stats.chi2.cdf(TICKS * np.sum(r**2), len(lags)) < 0.999
    across = [
        np.mean(one[max(-lag, 0) : TICKS - max(lag, 0)] * two[max(lag, 0) : TICKS + min(lag, 0)])
        for lag in range(-5, 6)
    ]
    assert np.abs(across).max() < 4 / np.sqrt(TICKS)


def test_a_draw_depends_on_seed_stream_tick_and_channel_alone() -> None:
    ticks = [0, 3, PAGE - 1, PAGE, 5 * PAGE + 17]
    found = {k: white_noise(7, 0, k, 3).copy() for k in ticks}
    for k in reversed(ticks):
        assert white_noise(7, 0, k, 3).tolist() == found[k].tolist()
        assert white_noise(7, 0, k, 6)[:3].tolist() == found[k].tolist()  # whatever the number of channels
    everything = [white_noise(seed, stream, k, 3) for seed in (7, 8, 2**40 + 7) for stream in (0, 1) for k in ticks]
    assert len(np.unique(everything)) == 3 * 2 * len(ticks) * 3


def test_a_run_draws_what_the_law_says_and_holds_it_for_a_period() -> None:
    offset = 0.4 * PERIOD
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource(np.zeros(2)))
    noise = builder.AddSystem(SensorNoise([1.0, 1.0], 3, PERIOD, offset, stream=1))
    builder.Connect(source.get_output_port(), noise.get_input_port())
    simulator = Simulator(builder.Build())
    for quarter in range(4 * 5):
        time = 0.25 * PERIOD * quarter
        simulator.AdvanceTo(time)
        seen = noise.get_output_port().Eval(noise.GetMyContextFromRoot(simulator.get_context()))
        ticks = 0 if time < offset else 1 + int((time - offset) / PERIOD)
        assert seen.tolist() == white_noise(3, 1, ticks, 2).tolist()


def test_nothing_is_stale_and_the_input_feeds_through(context_of: Any, feedthrough_of: Any) -> None:
    block = SensorNoise([0.1, 0.2], 1, PERIOD)
    context = context_of(block, u=[1.0, 2.0])
    w = white_noise(1, 0, 0, 2)
    y = block.GetOutputPort("y")
    assert y.Eval(context) == pytest.approx([1.0, 2.0] + np.array([0.1, 0.2]) * w, abs=1e-15)
    block.set_parameters(context, deviation=2.0)
    assert y.Eval(context) == pytest.approx([1.0, 2.0] + 2.0 * w, abs=1e-15)
    context.SetDiscreteState([5.0])
    assert y.Eval(context) == pytest.approx([1.0, 2.0] + 2.0 * white_noise(1, 0, 5, 2), abs=1e-15)
    block.GetInputPort("u").FixValue(context, [0.0, 0.0])
    assert y.Eval(context) == pytest.approx(2.0 * white_noise(1, 0, 5, 2), abs=1e-15)
    assert block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().value().tolist() == [6.0]
    assert feedthrough_of(block) == {("u", "y")}
    other = block.CreateDefaultContext()  # state is in the context, not in the block
    assert other.get_discrete_state_vector().value().tolist() == [0.0]


def test_its_derivative_is_that_of_the_input_and_it_has_no_formula(context_of: Any) -> None:
    block = SensorNoise([0.1, 0.2], 1, PERIOD, 0.5e-3, stream=4)
    y = block.GetOutputPort("y").Eval(context_of(block, u=[1.0, 2.0]))
    converted = block.ToAutoDiffXd()
    context = converted.CreateDefaultContext()
    converted.GetInputPort("u").FixValue(context, InitializeAutoDiff(np.array([1.0, 2.0]))[:, 0])
    found = converted.GetOutputPort("y").Eval(context)
    assert [v.value() for v in found] == y.tolist()
    assert [v.derivatives().tolist() for v in found] == [[1.0, 0.0], [0.0, 1.0]]
    timing = converted.GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.period_sec(), timing.offset_sec()) == (PERIOD, 0.5e-3)
    assert block.ToSymbolicMaybe() is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([-0.1], 0, PERIOD), "deviation = "),
        (([np.nan], 0, PERIOD), "deviation = "),
        (([0.1], -1, PERIOD), "seed = -1;"),
        (([0.1], 1.5, PERIOD), "seed = 1.5;"),
        (([0.1], True, PERIOD), "seed = True;"),
        (([0.1], 0, 0.0), "period = 0.0"),
        (([0.1], 0, PERIOD, -1.0), "offset = -1.0"),
        (([0.1], 0, PERIOD, 0.0, -2), "stream = -2;"),
    ],
)
def test_a_number_that_makes_no_sense_is_one_line(arguments: Any, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        SensorNoise(*arguments)
    assert "\n" not in str(caught.value)
