"""Compiled diagrams against Drake: its Simulator, and Expression.Evaluate."""

import math

import numpy as np
import pydrake.symbolic as ds
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.symbolic import Expression, Variable, if_then_else, logical_and, logical_not, logical_or
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    DiscreteDerivative,
    DiscreteTimeDelay,
    FirstOrderLowPassFilter,
    LinearSystem,
    Sine,
    SymbolicVectorSystem,
    ZeroOrderHold,
)
from sampled_diagrams import (
    PERIOD,
    PLANT_PARAMETERS,
    drake_states,
    expressions_block,
    one_axis_loop,
    saturated_loop,
    single,
)

from flipdiagram.compiled import compile_diagram

# Drake's Expression keeps pointers in the payload of a NaN; NumPy reports the flags its comparisons leave.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")


def test_a_saturated_loop_equals_the_simulator_over_1e5_ticks():
    ticks = 100_000
    diagram = saturated_loop()
    compiled = compile_diagram(diagram)
    run = compiled.run(ticks, state={"plant": [2.0, 0.0]}, inputs={"reference": 0.1}, log=["y", "u"], every=1000)
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    context.SetDiscreteState(0, [2.0, 0.0])
    diagram.GetInputPort("reference").FixValue(context, [0.1])
    simulator.Initialize()
    for row in range(ticks // 1000 + 1):
        simulator.AdvanceTo(row * 1000 * PERIOD)
        assert run.log["y"][0, row] == diagram.GetOutputPort("y").Eval(context)  # bit for bit
        assert run.log["u"][0, row] == diagram.GetOutputPort("u").Eval(context)
    assert (abs(run.log["u"]) == 0.8).any() and (abs(run.log["u"]) < 0.8).any()
    assert run.log_ticks[-1] == ticks and (run.log["y"][:, -1] == run.outputs["y"]).all()
    assert (run.final[0] == context.get_discrete_state(0).value()).all()


@pytest.mark.parametrize("nested", [False, True])
def test_a_loop_of_our_blocks_equals_the_simulator(nested):
    ticks = 1000
    diagram = one_axis_loop(nested)
    compiled = compile_diagram(diagram)
    commands = {"x_cmd": 0.3, "v_cmd": 0.0, "a_cmd": 0.2}
    run = compiled.run(ticks, inputs=commands, parameters=PLANT_PARAMETERS, log=compiled.states, every=1)

    def prepare(context):
        plant = diagram.GetSubsystemByName("plant")
        plant.GetMyContextFromRoot(context).get_mutable_numeric_parameter(0).SetFromVector([1.0, -9.81])
        for name, value in commands.items():
            diagram.GetInputPort(name).FixValue(context, [value])

    expected = drake_states(diagram, prepare, ticks)
    found = np.concatenate([run.log[name][0] for name in compiled.states], axis=1)
    np.testing.assert_allclose(found[1:], expected, rtol=1e-10, atol=1e-13)
    assert abs(expected[-1]).max() > 0.1


X, Y, Z = (Variable(name) for name in "xyz")
EVERY_KIND = [
    1.5 + 2.0 * X - 3.0 * Y - Z,
    X - Y,
    -X,
    -(X + Y),
    X * Y * -2.0,
    X * X,
    X * X * X,
    X / Y,
    Expression(0.25),
    ds.abs(X),
    ds.exp(X),
    ds.log(2.0 + X * X),
    ds.sqrt(1.0 + Y * Y),
    ds.pow(X * X + 0.1, Y),
    ds.pow(X, Expression(4)),
    ds.pow(1.5 + X * X, Expression(-1.5)),
    ds.sin(X),
    ds.cos(X),
    ds.tan(X),
    ds.asin(X / 5.0),
    ds.acos(X / 5.0),
    ds.atan(X),
    ds.atan2(X, Y),
    ds.sinh(X),
    ds.cosh(X),
    ds.tanh(X),
    ds.floor(X * 3.0),
    ds.ceil(X * 3.0),
    ds.min(X, Y),
    ds.max(X, Y),
    if_then_else(X > Y, X, Y),
    if_then_else(X >= 0.0, 1.0 * X, 2.0 * Y),
    if_then_else(X < Y, Expression(1), Expression(2)),
    if_then_else(X <= 0.0, X * Y, X / Y),
    if_then_else(X == Y, Expression(1), Expression(2)),
    if_then_else(X != Y, Expression(1), Expression(2)),
    if_then_else(logical_and(X > 0.0, Y > 0.0, Z > 0.0), X, Z),
    if_then_else(logical_or(X > 1.0, Y > 1.0), X, Z),
    if_then_else(logical_not(logical_or(X > 0.0, Y > 0.0)), X, Z),
    ds.sin(X * 2.0 + Y) * ds.sin(X * 2.0 + Y) + ds.exp(-X * X),
]


def test_every_kind_of_expression_is_printed_and_equals_drakes_value():
    compiled = compile_diagram(single(expressions_block(EVERY_KIND, [X, Y, Z], [Y, Z, X])), exact=True)
    points = np.random.default_rng(1).uniform(-2.5, 2.5, (300, 3))
    points[:50, 1] = points[:50, 0]
    points[50:60] = np.arange(-5, 5)[:, None] * 0.5
    points[(points == 0.0).any(axis=1)] = 0.5
    run = compiled.run(1, state=points, log=["out0"])
    for row, point in zip(run.log["out0"][:, 0], points, strict=True):
        environment = dict(zip((X, Y, Z), point, strict=True))
        expected = np.array([(1.0 * e).Evaluate(environment) for e in EVERY_KIND])
        cube = 6  # x * x * x against the C library's pow
        assert row[cube] == pytest.approx(expected[cube], rel=4e-16)
        np.testing.assert_array_equal(np.delete(row, cube), np.delete(expected, cube))
    assert (run.final == points[:, [1, 2, 0]]).all()  # states change places at once


LEAVES = st.sampled_from([X, Y, Z]).map(Expression) | st.floats(-3.0, 3.0).map(lambda c: Expression(round(c, 3)))


def _grown(inner):
    smooth = st.builds(lambda f, e: f(e), st.sampled_from([ds.sin, ds.cos, ds.tanh, ds.atan, ds.abs]), inner)
    steps = st.builds(lambda f, e: 0.25 * f(4.0 * e), st.sampled_from([ds.floor, ds.ceil]), inner)
    pairs = st.builds(
        lambda f, a, b: f(a, b),
        st.sampled_from(
            [ds.min, ds.max, lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / (1.0 + b * b)]
        ),
        inner,
        inner,
    )
    choices = st.builds(lambda a, b, c, d: if_then_else(a > b, c, d), inner, inner, inner, inner)
    return smooth | steps | pairs | choices


@settings(max_examples=8)
@given(dynamics=st.lists(st.recursive(LEAVES, _grown, max_leaves=12), min_size=3, max_size=3), seed=st.integers(0, 99))
def test_random_expressions_equal_the_simulator(dynamics, seed):
    # tanh keeps the state finite, the linear part keeps it moving
    mixed = [0.9 * own + 0.3 * ds.tanh(e) + 0.05 for own, e in zip((Y, Z, X), dynamics, strict=True)]
    diagram = single(expressions_block([X + Y], [X, Y, Z], mixed))
    start = np.random.default_rng(seed).uniform(-1.0, 1.0, 3)
    expected = drake_states(diagram, lambda context: context.SetDiscreteState(0, start), 100)
    for exact in (False, True):
        run = compile_diagram(diagram, check=50, exact=exact).run(100, state=start, log=["SymbolicVectorSystem@0"])
        np.testing.assert_allclose(run.log["SymbolicVectorSystem@0"][0, 1:], expected, rtol=1e-10, atol=1e-12)


@settings(max_examples=5)
@given(size=st.integers(1, 4), seed=st.integers(0, 999))
def test_random_linear_systems_equal_matrix_powers(size, seed):
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((size, size))
    a *= 0.98 / max(abs(np.linalg.eigvals(a)))
    b, x0, u = rng.standard_normal((size, 2)), rng.standard_normal(size), rng.standard_normal(2)
    system = LinearSystem(a, b, np.eye(size), np.zeros((size, 2)), 0.25)
    compiled = compile_diagram(single(system))
    found = compiled.run(40, state=x0, inputs={"in0": u}).final[0]
    power = np.linalg.matrix_power(a, 40)
    settled = np.linalg.solve(np.eye(size) - a, b @ u)
    np.testing.assert_allclose(found, power @ (x0 - settled) + settled, rtol=1e-9, atol=1e-11)
    lin = compiled.linearize()
    for ours, theirs in ((lin.A, a), (lin.B, b), (lin.C, np.eye(size)), (lin.D, np.zeros((size, 2)))):
        assert (ours == theirs).all()


def test_drakes_own_sampled_blocks():
    builder = DiagramBuilder()
    sine = builder.AddNamedSystem("sine", Sine(0.7, 40.0, 0.3, 1))
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(PERIOD, 1))
    delay = builder.AddNamedSystem("delay", DiscreteTimeDelay(PERIOD, 3, 1))
    derivative = builder.AddNamedSystem("derivative", DiscreteDerivative(1, PERIOD))
    builder.AddNamedSystem("alone", ConstantVectorSource([1.0]))
    builder.Connect(sine.get_output_port(0), hold.get_input_port())
    builder.Connect(hold.get_output_port(), delay.get_input_port())
    builder.Connect(delay.get_output_port(), derivative.get_input_port())
    builder.ExportOutput(derivative.get_output_port(), "rate")
    builder.ExportOutput(delay.get_output_port(), "delayed")
    builder.ExportOutput(sine.get_output_port(0), "sine")
    diagram = builder.Build()
    run = compile_diagram(diagram, exact=True).run(300, log=["rate", "delayed", "sine", "hold"])
    expected = drake_states(diagram, lambda context: None, 300)
    assert (run.final[0] == expected[-1]).all()
    times = np.arange(301) * PERIOD
    sine_values = np.array([0.7 * math.sin(40.0 * t + 0.3) for t in times])
    np.testing.assert_allclose(run.log["sine"][0, :, 0], sine_values, rtol=1e-15)
    assert (run.log["hold"][0, 1:, 0] == run.log["sine"][0, :-1, 0]).all()
    assert (run.log["delayed"][0, 5:, 0] == run.log["hold"][0, 1:-4, 0]).all()


def test_an_offset_and_a_late_start_keep_drakes_times():
    t = Variable("t")
    builder = DiagramBuilder()
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(0.1, 1, 0.03))
    clock = builder.AddNamedSystem("clock", SymbolicVectorSystem(time=t, output=np.array([Expression(t)])))
    builder.Connect(clock.get_output_port(), hold.get_input_port())
    compiled = compile_diagram(builder.Build())
    assert (compiled.period, compiled.offset) == (0.1, 0.03)
    found = compiled.run(1, start=np.arange(2000)).final[:, 0]
    assert (found == 0.03 + np.arange(2000) * 0.1).all()


def test_a_continuous_filter_is_refused_and_named():
    with pytest.raises(Exception, match="'filter'.*continuous state"):
        builder = DiagramBuilder()
        builder.AddNamedSystem("filter", FirstOrderLowPassFilter(1.0, 1))
        compile_diagram(builder.Build())
