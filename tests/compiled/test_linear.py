"""Linearisation against closed forms, finite differences and python-control."""

import sys

import numpy as np
import pydrake.symbolic as ds
import pytest
from pydrake.symbolic import Expression, Variable, if_then_else
from sampled_diagrams import PERIOD, PLANT_PARAMETERS, expressions_block, one_axis_loop, saturated_loop, single

from flipdiagram.compiled import compile_diagram
from flipdiagram.errors import InputError, MissingProgramError

pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")

X, Y, U = (Variable(name) for name in "xyu")
SMOOTH = [
    3.0 * X - Y * U,
    X * Y * U,
    X / (2.0 + Y * Y),
    -X * X * X,
    ds.exp(X * U),
    ds.log(3.0 + X),
    ds.sqrt(2.0 + Y),
    ds.pow(2.0 + X, Y),
    ds.pow(2.0 + X, Expression(2.5)),
    ds.pow(X, Expression(4)),
    ds.sin(X * Y),
    ds.cos(X + U),
    ds.tan(X),
    ds.asin(X / 3.0),
    ds.acos(Y / 3.0),
    ds.atan(X * U),
    ds.atan2(X, 2.0 + Y),
    ds.sinh(X),
    ds.cosh(Y),
    ds.tanh(X * 2.0),
    ds.abs(X * Y),
    ds.min(X, Y),
    ds.max(X * U, Y),
    if_then_else(X > Y, X * X, Y * U),
    ds.floor(10.0 * X) * Y,
    ds.ceil(U) * X,
    Expression(2.0),
]


@pytest.mark.parametrize("point", [(0.37, -0.52, 0.81), (-0.61, 0.44, -0.29)])
def test_every_derivative_equals_central_differences(point):
    block = expressions_block(SMOOTH, [X, Y], [ds.sin(X) + U, X * Y], input=np.array([U]))
    lin = compile_diagram(single(block)).linearize(state=point[:2], inputs={"in0": point[2]})
    found = np.block([[lin.A, lin.B], [lin.C, lin.D]])
    expressions = [ds.sin(X) + U, X * Y, *SMOOTH]
    step = 1e-6
    for column in range(3):
        ends = []
        for sign in (1.0, -1.0):
            moved = np.array(point)
            moved[column] += sign * step
            environment = dict(zip((X, Y, U), moved, strict=True))
            ends.append([(1.0 * e).Evaluate(environment) for e in expressions])
        expected = (np.array(ends[0]) - np.array(ends[1])) / (2 * step)
        np.testing.assert_allclose(found[:, column], expected, rtol=1e-7, atol=1e-8)


def test_the_slope_of_a_saturation_is_that_of_the_branch_taken():
    compiled = compile_diagram(saturated_loop())
    inside = compiled.linearize(inputs={"reference": 0.01})
    outside = compiled.linearize(inputs={"reference": 5.0})
    plant = np.array([[1.0, PERIOD], [-4.0 * PERIOD, 1.0 - 0.1 * PERIOD]])
    np.testing.assert_allclose(inside.A, plant - np.array([[0.0], [PERIOD]]) * 7.0 @ [[1.0, 0.0]], rtol=1e-15)
    np.testing.assert_array_equal(outside.A, plant)
    assert inside.B[1, 0] == pytest.approx(7.0 * PERIOD) and (outside.B == 0.0).all()
    assert inside.D[:, 0].tolist() == [0.0, 7.0] and inside.C.tolist() == [[1.0, 0.0], [-7.0, 0.0]]


def test_response_and_poles_of_a_low_pass_have_their_closed_form():
    decay, omega = 0.9, np.geomspace(0.1, 3000.0, 30)
    block = expressions_block([X], [X], [decay * X + (1.0 - decay) * U], input=np.array([U]))
    lin = compile_diagram(single(block)).linearize()
    z = np.exp(1j * omega * PERIOD)
    np.testing.assert_allclose(lin.response(omega)[:, 0, 0], (1.0 - decay) / (z - decay), rtol=1e-12)
    assert lin.poles() == [decay] and lin.dt == PERIOD


def test_pd_and_feedforward_around_a_mass_track_as_the_closed_form_says():
    # x = (k_p + k_v v + z-transform of the ramp); no velocity filter: the two poles of z^2 - (2 - aT - b) z + (1 - aT + b)
    period, k_p, k_v = PERIOD, 900.0, 60.0
    x, v, f = Variable("x"), Variable("v"), Variable("f")
    force = k_p * (U - x) - k_v * v + 0.0 * f
    block = expressions_block(
        [x], [x, v], [x + period * v + period**2 / 2 * force, v + period * force], input=np.array([U])
    )
    lin = compile_diagram(single(block)).linearize()
    trace, determinant = 2.0 - k_v * period - k_p * period**2 / 2, 1.0 - k_v * period + k_p * period**2 / 2
    np.testing.assert_allclose(np.sort(lin.poles()), np.sort(np.roots([1.0, -trace, determinant])), rtol=1e-6)
    z = np.exp(1j * np.array([3.0, 30.0, 300.0]) * period)
    expected = k_p * period**2 / 2 * (z + 1.0) / (z * z - trace * z + determinant)
    np.testing.assert_allclose(lin.response([3.0, 30.0, 300.0])[:, 0, 0], expected, rtol=1e-9)


def test_the_linearised_loop_of_our_blocks_predicts_small_steps():
    compiled = compile_diagram(one_axis_loop(quantised=False))
    lin = compiled.linearize(parameters=PLANT_PARAMETERS)
    assert (abs(lin.poles()) <= 1.0 + 1e-9).all()
    inputs = {"x_cmd": 1e-3, "v_cmd": 0.0, "a_cmd": 0.0}
    rest = compiled.run(200, parameters=PLANT_PARAMETERS, inputs={name: 0.0 for name in inputs}).final[0]
    moved = compiled.run(200, parameters=PLANT_PARAMETERS, inputs=inputs).final[0]
    b = lin.B[:, lin.input_names.index("x_cmd")] * 1e-3
    powers = [np.linalg.matrix_power(lin.A, k) @ b for k in range(200)]
    np.testing.assert_allclose(moved - rest, np.sum(powers, axis=0), rtol=1e-8, atol=1e-12)


def test_a_response_has_the_inputs_and_outputs_named():
    total = Variable("total")
    block = expressions_block([X, total], [X, total], [0.5 * X + U, total + X * X], input=np.array([U]))
    lin = compile_diagram(single(block)).linearize(state=[1.0, 0.0])
    assert lin.output_names == ("out0[0]", "out0[1]") and lin.state_names[1].endswith("[1]")
    assert sorted(lin.poles()) == [0.5, 1.0]
    assert (lin.response(10.0, "in0", "out0[0]") == lin.response(10.0)[:, :1]).all()
    with pytest.raises(InputError, match="unknown output 'z'; choose from out0"):
        lin.response(1.0, outputs="z")


def test_control_statespace_has_the_same_response():
    control = pytest.importorskip("control", reason="python-control is not installed")
    lin = compile_diagram(saturated_loop()).linearize()
    theirs = lin.to_control()
    assert isinstance(theirs, control.StateSpace) and theirs.dt == PERIOD
    assert theirs.input_labels == ["reference"] and theirs.output_labels == ["y", "u"]
    omega = np.array([0.5, 2.0, 50.0])
    response = np.moveaxis(np.asarray(theirs(np.exp(1j * omega * PERIOD))), -1, 0).reshape(3, 2, 1)
    np.testing.assert_allclose(response, lin.response(omega), rtol=1e-8)


def test_without_python_control_the_message_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingProgramError, match="pip install control"):
        compile_diagram(saturated_loop()).linearize().to_control()


def test_an_operating_point_is_one_channel():
    with pytest.raises(InputError, match="of one channel; 2 were given"):
        compile_diagram(saturated_loop()).linearize(state=np.zeros((2, 2)))
