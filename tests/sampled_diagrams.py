"""Small sampled diagrams for the tests of flipdiagram.compiled, of Drake's own systems and of our blocks."""

from typing import Any

import numpy as np
from pydrake.symbolic import Variable
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem_
from pydrake.systems.primitives import Adder, Demultiplexer, Gain, LinearSystem, Saturation, SymbolicVectorSystem
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.sensors import Encoder, PseudoDerivative
from flipdiagram.blocks.torque_limit import TorqueLimit

PERIOD = 1e-3


def expressions_block(outputs: list[Any], state: list[Any], dynamics: list[Any], **more: Any) -> Any:
    """A SymbolicVectorSystem with arrays of Expressions where it wants them."""
    return SymbolicVectorSystem(
        state=np.array(state),
        dynamics=np.array([1.0 * e for e in dynamics]),
        output=np.array([1.0 * e for e in outputs]),
        time_period=PERIOD,
        **more,
    )


def saturated_loop(limit: float = 0.8, period: float = PERIOD) -> Any:
    """An oscillator of a linear system, saturated proportional feedback, a reference as exported input."""
    builder = DiagramBuilder()
    a = np.array([[1.0, period], [-4.0 * period, 1.0 - 0.1 * period]])
    plant = builder.AddNamedSystem("plant", LinearSystem(a, [[0.0], [period]], [[1.0, 0.0]], [[0.0]], period))
    error = builder.AddNamedSystem("error", Adder(2, 1))
    minus = builder.AddNamedSystem("minus", Gain(-1.0, 1))
    gain = builder.AddNamedSystem("gain", Gain(7.0, 1))
    limiter = builder.AddNamedSystem("limiter", Saturation([-limit], [limit]))
    builder.Connect(plant.get_output_port(), minus.get_input_port())
    builder.ExportInput(error.get_input_port(0), "reference")
    builder.Connect(minus.get_output_port(), error.get_input_port(1))
    builder.Connect(error.get_output_port(), gain.get_input_port())
    builder.Connect(gain.get_output_port(), limiter.get_input_port())
    builder.Connect(limiter.get_output_port(), plant.get_input_port())
    builder.ExportOutput(plant.get_output_port(), "y")
    builder.ExportOutput(limiter.get_output_port(), "u")
    return builder.Build()


def one_axis_loop(nested: bool = False, quantised: bool = True) -> Any:
    """PD + FF + DOB of ours, limited, around a mass; commands as exported inputs; the controller a sub-diagram."""
    inner = DiagramBuilder()
    pd = inner.AddNamedSystem("pd", ProportionalDerivative([900.0], [60.0]))
    ff = inner.AddNamedSystem("ff", AccelerationFeedforward(1))
    dob = inner.AddNamedSystem("dob", DisturbanceObserver([30.0], [1.0], PERIOD))
    limit = inner.AddNamedSystem("limit", TorqueLimit([30.0]))
    acceleration, force = (inner.AddNamedSystem(name, Adder(2, 1)) for name in ("acceleration", "force"))
    outer = DiagramBuilder() if nested else inner
    inner.Connect(pd.get_output_port(), acceleration.get_input_port(0))
    inner.Connect(ff.get_output_port(), acceleration.get_input_port(1))
    inner.Connect(acceleration.get_output_port(), force.get_input_port(0))
    inner.Connect(dob.get_output_port(), force.get_input_port(1))
    inner.Connect(force.get_output_port(), limit.get_input_port())
    inner.Connect(limit.get_output_port(), dob.GetInputPort("tau"))
    commands = {"x_cmd": pd.GetInputPort("x_cmd"), "v_cmd": pd.GetInputPort("v_cmd"), "a_cmd": ff.get_input_port()}
    for name, port in commands.items():
        inner.ExportInput(port, name)
    x, v, f, m, g = (Variable(name) for name in "xvfmg")
    a = f / m + g
    dynamics = [x + PERIOD * v + PERIOD**2 / 2 * a, v + PERIOD * a]
    plant = outer.AddNamedSystem(
        "plant", expressions_block([x, v], [x, v], dynamics, input=np.array([f]), parameter=np.array([m, g]))
    )
    parts = outer.AddNamedSystem("parts", Demultiplexer(2, 1))
    encoder = outer.AddNamedSystem("encoder", Encoder([1e-4 if quantised else 0.0]))
    velocity = outer.AddNamedSystem("velocity", PseudoDerivative([600.0], PERIOD))
    outer.Connect(plant.get_output_port(), parts.get_input_port())
    outer.Connect(parts.get_output_port(0), encoder.get_input_port())
    outer.Connect(encoder.get_output_port(), velocity.get_input_port())
    if nested:
        inner.ExportInput(pd.GetInputPort("x"), "x")
        inner.ExportInput(pd.GetInputPort("v"), "v")
        inner.ExportInput(dob.GetInputPort("qd"), "qd")
        inner.ExportOutput(limit.get_output_port(), "f")
        controller = outer.AddNamedSystem("controller", inner.Build())
        for name in commands:
            outer.ExportInput(controller.GetInputPort(name), name)
        x_port, v_ports = controller.GetInputPort("x"), [controller.GetInputPort("v"), controller.GetInputPort("qd")]
        sent = controller.get_output_port()
    else:
        x_port, v_ports = pd.GetInputPort("x"), [pd.GetInputPort("v"), dob.GetInputPort("qd")]
        sent = limit.get_output_port()
    outer.Connect(encoder.get_output_port(), x_port)
    for port in v_ports:
        outer.Connect(velocity.get_output_port(), port)
    outer.Connect(sent, plant.get_input_port())
    outer.ExportOutput(sent, "f")
    outer.ExportOutput(parts.get_output_port(0), "x")
    diagram = outer.Build()
    return diagram


PLANT_PARAMETERS = {"plant.0": [1.0, -9.81]}
"""SymbolicVectorSystem starts with parameters of zero."""


def single(block: Any) -> Any:
    """A diagram of one block, its ports exported as in0, in1, ... and out0, ..."""
    builder = DiagramBuilder()
    builder.AddSystem(block)
    for i in range(block.num_input_ports()):
        builder.ExportInput(block.get_input_port(i), f"in{i}")
    for i in range(block.num_output_ports()):
        builder.ExportOutput(block.get_output_port(i), f"out{i}")
    return builder.Build()


@TemplateSystem.define("Stepper_")
def Stepper_(T: Any) -> Any:
    """Blocks that are no pure periodic maps: counts its events of the kinds given."""

    class Impl(LeafSystem_[T]):
        def _construct(self, kinds: tuple[str, ...], converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.kinds = kinds
            self.DeclareDiscreteState(1)
            for kind in kinds:
                if kind == "per step":
                    self.DeclarePerStepDiscreteUpdateEvent(self._update)
                else:
                    period, offset = (float(number) for number in kind.split("+"))
                    self.DeclarePeriodicDiscreteUpdateEvent(period, offset, self._update)
            self.DeclareVectorOutputPort("count", 1, self._count)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.kinds, converter=converter)

        def _update(self, context: Any, values: Any) -> None:
            values.set_value(context.get_discrete_state_vector().CopyToVector() + 1.0)

        def _count(self, context: Any, output: Any) -> None:
            output.set_value(context.get_discrete_state_vector().CopyToVector())

    return Impl


Stepper = Stepper_[None]


def drake_states(diagram: Any, prepare: Any, ticks: int, period: float = PERIOD) -> np.ndarray:
    """Discrete states after each of ``ticks`` updates by Drake's Simulator, all groups in the diagram's order."""
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    prepare(context)
    simulator.Initialize()
    rows = []
    for k in range(ticks):
        simulator.AdvanceTo((k + 0.5) * period)
        groups = range(context.num_discrete_state_groups())
        rows.append(np.concatenate([context.get_discrete_state(g).CopyToVector() for g in groups]))
    return np.array(rows)
