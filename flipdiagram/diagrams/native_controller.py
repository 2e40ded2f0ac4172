"""The controller of Fig. 4 as one box, for runs of many flips: the same laws, the arm's kinematics as machine code."""

from collections.abc import Mapping
from dataclasses import dataclass

from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort

from flipdiagram.arrays import Floats
from flipdiagram.diagrams.controller import add_controller
from flipdiagram.diagrams.fused import Fused
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario


@dataclass(frozen=True)
class NativeController:
    """Handle to the box, as `ControllerBoxes` to many."""

    box: Fused

    @property
    def signals(self) -> dict[str, OutputPort]:
        """Where each signal that it has a port for comes from."""
        return {port.get_name(): port for port in map(self.box.get_output_port, range(self.box.num_output_ports()))}

    @property
    def systems(self) -> dict[str, LeafSystem]:
        """The one box by its name."""
        return {"controller": self.box}

    def output(self, signal: str) -> OutputPort | None:
        """The port of a signal of the figure: tau, tau_cmd, tau_dis, x, v; None where the architecture lacks it."""
        return self.box.GetOutputPort(signal) if self.box.HasOutputPort(signal) else None


def add_native_controller(
    builder: DiagramBuilder,
    scenario: Scenario,
    architecture: str,
    arm: ArmModel,
    q_start: Floats,
    inputs: Mapping[str, OutputPort],
    offset: float = 0.0,
) -> NativeController:
    """Add what `add_controller` adds, as one box; arguments and errors are the same."""
    figure = DiagramBuilder()
    sizes = {name: port.size() for name, port in inputs.items()}
    boxes = add_controller(figure, scenario, architecture, arm, q_start, sizes, offset)
    for signal in ("tau", "tau_cmd", "tau_dis", "x", "v"):
        if (port := boxes.output(signal)) is not None:
            figure.ExportOutput(port, signal)
    box = builder.AddNamedSystem("controller", Fused(figure.Build(), native=True))
    for name, source in inputs.items():
        builder.Connect(source, box.GetInputPort(name))
    return NativeController(box)
