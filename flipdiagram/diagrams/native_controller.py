"""Sensors and controller, or sensors alone, as one box: the same laws, the arm's kinematics as machine code."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Adder, ConstantVectorSource, PassThrough

from flipdiagram.arrays import Floats
from flipdiagram.blocks.noise import SensorNoise
from flipdiagram.diagrams.controller import add_controller
from flipdiagram.diagrams.fused import Fused
from flipdiagram.diagrams.sensing import Sensing, add_sensing
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario

MEASURED = "_meas"
"""End of the names of the ports that give q and qd as the sensors show them."""


@dataclass(frozen=True)
class NativeController:
    """Handle to the box, as `ControllerBoxes` to many."""

    box: Fused

    @property
    def signals(self) -> dict[str, OutputPort]:
        """Where each signal of the figure that it has a port for comes from."""
        ports = map(self.box.get_output_port, range(self.box.num_output_ports()))
        return {port.get_name(): port for port in ports if not port.get_name().endswith(MEASURED)}

    @property
    def systems(self) -> dict[str, LeafSystem]:
        """The one box by its name."""
        return {"controller": self.box}

    def output(self, signal: str) -> OutputPort | None:
        """The port of a signal of the figure: tau, tau_cmd, tau_dis, x, v; None where the architecture lacks it."""
        return self.box.GetOutputPort(signal) if self.box.HasOutputPort(signal) else None


@dataclass
class NativeSensing(Sensing):
    """The same of sensors inside the box; `boxes` are those of the diagram that it was made of."""

    inside: Fused | None = None
    noises: Mapping[str, SensorNoise] | None = None
    """Boxes that stand outside."""

    def have_seen(self, context: Context, q: Floats) -> None:
        """See `Sensing`."""
        assert self.inside is not None
        own = self.inside.GetMyMutableContextFromRoot(context)
        for name, box in self.boxes.items():
            if name == "delayed_q":
                self.inside.put_state(own, name, np.tile(q, box.periods))
            elif name == "velocity":
                self.inside.put_state(own, name, q)

    def without_error(self, context: Context) -> None:
        """See `Sensing`."""
        assert self.inside is not None
        self.inside.tune(self.inside.GetMyMutableContextFromRoot(context), 0.0)
        for box in (self.noises or {}).values():
            box.set_parameters(box.GetMyMutableContextFromRoot(context), deviation=0.0)


def add_native_controller(
    builder: DiagramBuilder,
    scenario: Scenario,
    architecture: str,
    arm: ArmModel,
    q_start: Floats,
    inputs: Mapping[str, OutputPort],
    offset: float = 0.0,
) -> tuple[Sensing, NativeController]:
    """Add what `add_sensing` and `add_controller` add, as one box; arguments and errors are the same.

    inputs: the commands, and q and qd of the cell.  Noise comes from boxes of its own: a draw is no machine code.
    """
    sensing, box = _add(builder, scenario, architecture, arm, q_start, inputs, offset)
    assert box is not None
    return sensing, NativeController(box)


def add_native_sensing(
    builder: DiagramBuilder,
    scenario: Scenario,
    arm: ArmModel,
    q_start: Floats,
    inputs: Mapping[str, OutputPort],
    offset: float = 0.0,
) -> Sensing:
    """The same of the sensors alone, where the controller is the user's own; inputs: q and qd of the cell."""
    return _add(builder, scenario, None, arm, q_start, inputs, offset)[0]


def _add(
    builder: DiagramBuilder,
    scenario: Scenario,
    architecture: str | None,
    arm: ArmModel,
    q_start: Floats,
    inputs: Mapping[str, OutputPort],
    offset: float,
) -> tuple[Sensing, Fused | None]:
    """Sensing and the box; None where there are neither sensors nor a controller."""
    figure = DiagramBuilder()
    sources, noises = dict(inputs), dict[str, SensorNoise]()
    entered: dict[str, OutputPort] = {}
    for name, port in inputs.items():
        entry = figure.AddNamedSystem(f"{name}_entry", PassThrough(port.size()))
        figure.ExportInput(entry.get_input_port(), name)
        entered[name] = entry.get_output_port()

    def add_noise(box: SensorNoise, name: str, signal: OutputPort) -> OutputPort:
        noises[name] = builder.AddNamedSystem(name, box)
        silence = builder.AddNamedSystem(f"no_{name}", ConstantVectorSource(np.zeros(signal.size())))
        builder.Connect(silence.get_output_port(), box.get_input_port())
        total = figure.AddNamedSystem(f"{name}_sum", Adder(2, signal.size()))
        figure.Connect(signal, total.get_input_port(0))
        figure.ExportInput(total.get_input_port(1), name)
        sources[name] = box.get_output_port()
        return total.get_output_port()

    seen = add_sensing(figure, scenario, arm, entered["q"], entered["qd"], q_start, offset, add_noise)
    measured = {f"q{MEASURED}": seen.q, f"qd{MEASURED}": seen.qd} if seen.boxes or noises else {}
    if architecture is None and not measured:  # sensors that show what is
        return Sensing(inputs["q"], inputs["qd"], {}), None
    for name, port in measured.items():
        figure.ExportOutput(port, name)
    if architecture is not None:
        signals = entered | {"q": seen.q, "qd": seen.qd}
        boxes = add_controller(figure, scenario, architecture, arm, q_start, signals, offset)
        for signal in ("tau", "tau_cmd", "tau_dis", "x", "v"):
            if (output := boxes.output(signal)) is not None:
                figure.ExportOutput(output, signal)
    name = "sensors" if architecture is None else "controller"
    box = builder.AddNamedSystem(name, Fused(figure.Build(), native=True, tuned=("resolution",)))
    for name, source in sources.items():
        builder.Connect(source, box.GetInputPort(name))
    q, qd = (box.GetOutputPort(f"{name}{MEASURED}") if measured else inputs[name] for name in ("q", "qd"))
    sensing = NativeSensing(q, qd, seen.boxes | noises, inside=box, noises=noises)
    return sensing, box
