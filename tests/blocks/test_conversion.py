"""A closed loop of all convertible blocks: its symbolic and AutoDiffXd forms against the float Simulator."""

from typing import Any

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression, MakeVectorVariable, Variable
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, LinearSystem, MatrixGain

from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.friction import JointFriction
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.sensors import Encoder, PseudoDerivative
from flipdiagram.blocks.torque_limit import TorqueLimit

# Drake's Expression keeps pointers in the payload of a NaN; NumPy reports the flags its comparisons leave.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")

N, PERIOD = 2, 2.0**-10
X_CMD, V_CMD, A_CMD = np.array([0.4, -0.3]), np.array([0.5, 0.2]), np.array([1.0, -2.0])
MASS = np.array([1.0, 2.0])
RESOLUTION = np.array([1e-3, 0.0])


def closed_loop(resolution: np.ndarray = RESOLUTION) -> tuple[Any, dict[str, Any]]:
    """PD + FF + DOB, limited, around a double integrator with friction, encoder and derived velocity."""
    half, eye, zero = 0.5 * PERIOD**2, np.eye(N), np.zeros((N, N))
    builder = DiagramBuilder()
    blocks = {
        "ff": AccelerationFeedforward(N),
        "pd": ProportionalDerivative([900.0, 350.0], [60.0, 40.0]),
        "a_ref": Adder(2, N),
        "inertia": NominalInertia([[0.9, 0.05], [0.05, 2.1]]),
        "tau_cmd": Adder(2, N),
        "limit": TorqueLimit([60.0, 30.0]),
        "dob": DisturbanceObserver([30.0, 20.0], [0.9, 2.1], PERIOD),
        "friction": JointFriction([0.4, 0.5], [0.1, 0.2], [0.02, 0.03]),
        "force": Adder(2, N),
        "encoder": Encoder(resolution),
        "velocity": PseudoDerivative([600.0, 500.0], PERIOD),
        "plant": LinearSystem(
            np.block([[eye, PERIOD * eye], [zero, eye]]),
            np.vstack([half * np.diag(1 / MASS), PERIOD * np.diag(1 / MASS)]),
            np.eye(2 * N),
            np.zeros((2 * N, N)),
            PERIOD,
        ),
        "q": MatrixGain(np.hstack([eye, zero])),
        "qd": MatrixGain(np.hstack([zero, eye])),
    }
    for name, block in blocks.items():
        block.set_name(name)
        builder.AddSystem(block)

    def out(name: str, port: str = "") -> Any:
        return blocks[name].GetOutputPort(port) if port else blocks[name].get_output_port(0)

    def wire(source: Any, name: str, port: str | int = 0) -> None:
        block = blocks[name]
        target = block.get_input_port(port) if isinstance(port, int) else block.GetInputPort(port)
        builder.Connect(source, target)

    builder.ExportInput(blocks["pd"].GetInputPort("x_cmd"), "x_cmd")
    builder.ExportInput(blocks["pd"].GetInputPort("v_cmd"), "v_cmd")
    builder.ExportInput(blocks["ff"].GetInputPort("a_cmd"), "a_cmd")
    wire(out("plant"), "q")
    wire(out("plant"), "qd")
    wire(out("q"), "encoder", "q")
    wire(out("encoder", "q_measured"), "velocity", "q")
    wire(out("encoder", "q_measured"), "pd", "x")
    wire(out("velocity", "v"), "pd", "v")
    wire(out("velocity", "v"), "dob", "qd")
    wire(out("pd", "a_ref"), "a_ref", 0)
    wire(out("ff", "a_ff"), "a_ref", 1)
    wire(out("a_ref"), "inertia", "qdd_ref")
    wire(out("inertia", "tau_ref"), "tau_cmd", 0)
    wire(out("dob", "tau_dis"), "tau_cmd", 1)
    wire(out("tau_cmd"), "limit", "tau_cmd")
    wire(out("limit", "tau"), "dob", "tau")
    wire(out("limit", "tau"), "force", 0)
    wire(out("qd"), "friction", "qd")
    wire(out("friction", "tau_friction"), "force", 1)
    wire(out("force"), "plant")
    return builder.Build(), blocks


def fix_commands(diagram: Any, context: Any) -> None:
    for name, value in (("x_cmd", X_CMD), ("v_cmd", V_CMD), ("a_cmd", A_CMD)):
        diagram.GetInputPort(name).FixValue(context, value)


def states(context: Any) -> np.ndarray:
    groups = range(context.num_discrete_state_groups())
    return np.concatenate([context.get_discrete_state(i).value() for i in groups])


def test_symbolic_loop_equals_the_simulator_over_200_ticks() -> None:
    diagram, blocks = closed_loop()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    fix_commands(diagram, context)
    blocks["pd"].set_parameters(blocks["pd"].GetMyContextFromRoot(context), k_p=[800.0, 400.0])

    symbolic = diagram.ToSymbolic()
    symbolic_context = symbolic.CreateDefaultContext()
    symbolic_context.SetTimeStateAndParametersFrom(context)
    fix_commands(symbolic, symbolic_context)
    groups = [symbolic_context.get_discrete_state(i) for i in range(context.num_discrete_state_groups())]
    variables = [MakeVectorVariable(group.size(), f"s{i}_") for i, group in enumerate(groups)]
    for i, group in enumerate(variables):
        symbolic_context.SetDiscreteState(i, np.array([Expression(v) for v in group]))
    update = symbolic.EvalUniquePeriodicDiscreteUpdate(symbolic_context)
    expressions = np.concatenate([update.get_vector(i).CopyToVector() for i in range(update.num_groups())])
    names = np.concatenate(variables)

    expected, limited = states(context), 0
    simulator.Initialize()
    for tick in range(200):
        limit = blocks["limit"].GetMyContextFromRoot(context)
        limited += (abs(blocks["limit"].GetOutputPort("tau").Eval(limit)) == [60.0, 30.0]).any()
        simulator.AdvanceTo((tick + 0.5) * PERIOD)
        environment = dict(zip(names, expected, strict=True))
        expected = np.array([e.Evaluate(environment) for e in expressions])
        np.testing.assert_allclose(states(context), expected, rtol=0.0, atol=1e-12)
    assert 0 < limited < 200  # both branches of the limit were taken
    assert np.abs(states(context)).max() > 0.1


def test_gains_can_be_symbols() -> None:
    block = DisturbanceObserver([30.0], [2.0], PERIOD).ToSymbolic()
    context = block.CreateDefaultContext()
    g, m, tau, qd = (Variable(name) for name in ("g", "m", "tau", "qd"))
    block.set_parameters(context, g_dis=[Expression(g)])
    block.set_parameters(context, inertia=[Expression(m)])
    block.GetInputPort("tau").FixValue(context, np.array([Expression(tau)]))
    block.GetInputPort("qd").FixValue(context, np.array([Expression(qd)]))
    values = {g: 10.0, m: 0.5, tau: 3.0, qd: 0.2}
    update = block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector()[0]
    assert update.Evaluate(values) == pytest.approx((1 - np.exp(-10.0 * PERIOD)) * 4.0, rel=1e-12)
    assert block.GetOutputPort("tau_dis").Eval(context)[0].Evaluate(values) == pytest.approx(-1.0)


def after_ticks(diagram: Any, blocks: dict[str, Any], parameters: np.ndarray, ticks: int) -> np.ndarray:
    """Plant state after some updates, without Simulator, over the scalar of ``parameters``."""
    context = diagram.CreateDefaultContext()
    fix_commands(diagram, context)

    def system(name: str) -> tuple[Any, Any]:
        block = diagram.GetSubsystemByName(name)
        return block, block.GetMyContextFromRoot(context)

    k_p, g_dis, tau_c, x0 = (parameters[i : i + 1] for i in range(4))
    pd, dob, friction = system("pd"), system("dob"), system("friction")
    pd[0].set_parameters(pd[1], k_p=np.append(k_p, 350.0))
    dob[0].set_parameters(dob[1], g_dis=np.append(g_dis, 20.0))
    friction[0].set_parameters(friction[1], tau_c=np.append(tau_c, 0.5))
    system("plant")[1].SetDiscreteState(np.append(x0, np.zeros(2 * N - 1)))
    for _ in range(ticks):
        update = diagram.EvalUniquePeriodicDiscreteUpdate(context)
        for i in range(update.num_groups()):
            context.SetDiscreteState(i, update.get_vector(i).CopyToVector())
    return system("plant")[1].get_discrete_state_vector().CopyToVector()


def test_autodiff_gradients_through_the_loop_match_differences() -> None:
    diagram, blocks = closed_loop(np.zeros(N))  # a quantised position has no useful derivative
    point, steps = np.array([900.0, 30.0, 0.4, 0.33]), np.array([1e-2, 1e-3, 1e-4, 1e-5])
    dual = np.array([AutoDiffXd(value, row) for value, row in zip(point, np.eye(4), strict=True)])
    result = after_ticks(diagram.ToAutoDiffXd(), blocks, dual, 60)
    assert [r.value() for r in result] == pytest.approx(after_ticks(diagram, blocks, point, 60), abs=1e-12)
    gradient = np.array([np.resize(r.derivatives(), 4) if r.derivatives().size else np.zeros(4) for r in result])
    for i, step in enumerate(steps):
        shift = step * np.eye(4)[i]
        difference = after_ticks(diagram, blocks, point + shift, 60) - after_ticks(diagram, blocks, point - shift, 60)
        assert gradient[:, i] == pytest.approx(difference / (2 * step), rel=2e-5, abs=1e-9)
    assert (np.abs(gradient).max(axis=0) > 1e-7).all()
