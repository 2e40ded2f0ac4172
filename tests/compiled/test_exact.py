"""Sines of our own beside the C library's (exact=True), for any number, length and order of channels."""

import platform

import llvmlite.binding as llvm
import numpy as np
import pydrake.symbolic as ds
import pytest
from pydrake.symbolic import Expression, Variable, if_then_else, logical_and, logical_not, logical_or
from pydrake.systems.framework import DiagramBuilder
from sampled_diagrams import expressions_block, one_axis_loop, single

from flipdiagram.blocks.commands import SinusoidalCommand
from flipdiagram.compiled import compile_diagram, kernel
from flipdiagram.diagrams.one_dof import build_controller, build_experiment
from flipdiagram.plants.one_dof import OneDofPlant
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.scenario.scenario import ARCHITECTURES

# Drake's Expression keeps pointers in the payload of a NaN; NumPy reports the flags its comparisons leave.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
RNG = np.random.default_rng(11)
N = 37
X, Y, Z = (Variable(name) for name in "xyz")
TO_THE_BIT = [
    1.5 + 2.0 * X - 3.0 * Y - Z,
    -(X + Y),
    X * Y * -2.0,
    X * X * X,
    X / Y,
    ds.abs(X),
    ds.sqrt(1.0 + Y * Y),
    ds.log(2.0 + X * X),
    ds.pow(X * X + 0.1, Y),
    ds.tan(X),
    ds.asin(X / 5.0),
    ds.acos(X / 5.0),
    ds.atan(X),
    ds.atan2(X, Y),
    ds.sinh(X),
    ds.cosh(X),
    ds.floor(X * 3.0),
    ds.ceil(X * 3.0),
    ds.min(X, Y),
    ds.max(X, Y),
    if_then_else(X > Y, X, Y),
    if_then_else(X >= 0.0, 1.0 * X, 2.0 * Y),
    if_then_else(X == Y, Z, Expression(2)),
    if_then_else(X != Y, Z, Expression(2)),
    if_then_else(X <= 0.0, X * Y, X / Y),
    if_then_else(X < Y, Y, 3.0 * Y),
    if_then_else(logical_and(X > 0.0, Y > 0.0), X, Z),
    if_then_else(logical_or(X > 1.0, Y > 1.0), X, Z),
    if_then_else(logical_not(logical_or(X > 0.0, Y > 0.0)), X, Z),
]
TO_ROUNDING = [ds.sin(X * 2.0 + Y), ds.cos(X) * ds.sin(X), ds.exp(-X * X), ds.tanh(X / 2.0), ds.sin(ds.exp(Y))]


def both(diagram, **options):
    return compile_diagram(diagram, exact=True, **options), compile_diagram(diagram, **options)


def test_every_kind_of_expression_equals_the_exact_one():
    exact, own = both(single(expressions_block([*TO_THE_BIT, *TO_ROUNDING], [X, Y, Z], [Y, Z, X])))
    points = RNG.uniform(-2.5, 2.5, (301, 3))
    points[:50, 1] = points[:50, 0]
    one, two = (c.run(1, state=points, log=["out0"]) for c in (exact, own))
    expected, found = one.log["out0"][:, 0], two.log["out0"][:, 0]
    same = len(TO_THE_BIT)
    np.testing.assert_array_equal(found[:, :same], expected[:, :same])
    np.testing.assert_allclose(found[:, same:], expected[:, same:], rtol=0.0, atol=1e-15)
    assert (two.final == one.final).all()
    assert exact.exact and not own.exact


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_without_own_functions_all_is_equal_to_the_bit_whatever_lengths_logs_and_threads(threads):
    exact, own = both(one_axis_loop())
    given = {
        "parameters": {"pd.0": RNG.uniform(400, 900, N), "plant.0": np.c_[RNG.uniform(1, 3, N), RNG.uniform(-9, 9, N)]},
        "inputs": {"x_cmd": RNG.uniform(-0.1, 0.1, (N, 60)), "v_cmd": 0.0, "a_cmd": RNG.uniform(-1, 1, (1, 9))},
        "start": RNG.integers(0, 1000, N),
        "threads": threads,
    }
    lengths = RNG.integers(0, 300, N)
    for ticks, more in ((lengths, {}), (lengths, {"log": ["x", "plant", "f"], "every": 7}), (250, {"log": ["f"]})):
        one, two = (c.run(ticks, **given, **more) for c in (exact, own))
        np.testing.assert_array_equal(two.final, one.final)
        for name in one.outputs:
            np.testing.assert_array_equal(two.outputs[name], one.outputs[name])
        for name in one.log:
            np.testing.assert_array_equal(two.log[name], one.log[name])  # nan where a channel had ended, too


def turning():
    """States that turn by angles of their own: sin and cos of time and of states."""
    t, w = Variable("t"), Variable("w")
    dynamics = [0.9 * X + ds.sin(w * t + Y), 0.9 * Y + ds.cos(3.0 * X), ds.tanh(Z + ds.exp(-X * X))]
    return single(expressions_block([X + Y], [X, Y, Z], dynamics, time=t, parameter=np.array([w])))


def test_a_channel_is_the_same_alone_in_company_again_and_in_pieces():
    own = compile_diagram(turning())
    (name,) = own.parameters
    omega, state = RNG.uniform(1, 300, N), RNG.uniform(-1, 1, (N, 3))
    whole = own.run(500, parameters={name: omega}, state=state, threads=2)
    again = own.run(500, parameters={name: omega[::-1]}, state=state[::-1], threads=1)
    assert (whole.final == again.final[::-1]).all()
    first = own.run(np.arange(N) * 13, parameters={name: omega}, state=state)
    second = own.run(500 - np.arange(N) * 13, parameters={name: omega}, state=first.final, start=first.ticks)
    assert (second.final == whole.final).all()
    for c in (0, 7, 8, 36):
        alone = own.run(500, parameters={name: omega[c]}, state=state[c])
        assert (alone.final == whole.final[c]).all() and (alone.outputs["out0"] == whole.outputs["out0"][c]).all()


@pytest.mark.parametrize("law", ["none", "signum", "stick-slip"])
@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_1e5_ticks_of_the_1_dof_loop_agree_to_1e_12(architecture, law):
    """With signum friction one rounding at v = 0 could part two runs for good; then signs of v would differ: none do."""
    builder, one_dof = DiagramBuilder(), OneDof()
    plant = builder.AddNamedSystem("plant", OneDofPlant([one_dof.mass], one_dof.step, law, [0.4], [0.1]))
    command = builder.AddNamedSystem("command", SinusoidalCommand([1.0], [0.3]))
    controller = builder.AddNamedSystem("controller", build_controller(architecture, one_dof))
    for name, source in {"x": plant, "v": plant, "x_cmd": command, "v_cmd": command, "a_cmd": command}.items():
        if controller.HasInputPort(name):
            builder.Connect(source.GetOutputPort(name), controller.GetInputPort(name))
    builder.Connect(controller.GetOutputPort("force"), plant.GetInputPort("f"))
    builder.ExportOutput(controller.GetOutputPort("force"), "force")
    omega = np.geomspace(2.0, 300.0, 5)
    one, two = (
        c.run(100_000, parameters={"command.omega": omega}, log=["plant", "force"], every=20)
        for c in both(builder.Build(), check=0)
    )
    assert (np.sign(two.log["plant"]) == np.sign(one.log["plant"])).all()
    for name, expected in one.log.items():
        scale = abs(expected).max(axis=1, keepdims=True)
        assert (abs(two.log[name] - expected) <= 1e-12 * scale).all()


def test_the_meters_of_the_study_read_the_same():
    diagram = build_experiment(build_controller("pd+ff+dob", OneDof()), OneDof(), friction=True, white_noise=1e-4)
    tie = {"omega": [f"{box}.omega" for box in ("command", "noise", "lockin_x", "lockin_a")]}
    one, two = (c.run(20_000, parameters={"omega": np.geomspace(3, 500, 9)}) for c in both(diagram, tie=tie))
    for name, expected in one.outputs.items():
        assert (abs(two.outputs[name] - expected) <= 1e-12 * abs(expected).max(axis=0)).all(), name


def test_one_dof_kernels_are_made_of_vector_instructions():
    if platform.machine() not in ("x86_64", "AMD64") or not llvm.get_host_cpu_features().get("fma"):
        pytest.skip("looks for the names of x86's vector instructions, FMA included")
    code = kernel.target_machine().emit_assembly(kernel.parsed(compile_diagram(turning()).source))
    names = [line.split()[0] for line in code.splitlines() if line.startswith("\tv")]
    assert sum(name.startswith("vf") and name.endswith("pd") for name in names) > 60
    assert not any(name.startswith(("vfm", "vfn")) and name.endswith("sd") for name in names)
