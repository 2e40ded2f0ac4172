"""A controller of the user's own in the place of all of Fig. 4: from the MPC's commands to the torque."""

from collections.abc import Mapping
from dataclasses import dataclass

from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort, System

from flipdiagram.blocks.mpc import CHANNELS, COMMANDS
from flipdiagram.blocks.tool_kinematics import ToolKinematics
from flipdiagram.blocks.torque_limit import TorqueLimit
from flipdiagram.diagrams.arrows import OUTSIDE, Arrows
from flipdiagram.diagrams.replacement import WHOLE, Box, fitting
from flipdiagram.errors import InputError
from flipdiagram.robot.arm import ArmModel

INPUTS = (*COMMANDS, "q", "qd", "x", "v")
"""Signals that it may take, by the names of the figure."""


@dataclass(frozen=True)
class OwnController:
    """Handles to the controller and to what stays of the figure around it, as `ControllerBoxes` to many."""

    controller: System
    torque_limit: LeafSystem
    tool_kinematics: LeafSystem

    @property
    def systems(self) -> dict[str, System]:
        """Them by name."""
        return {WHOLE: self.controller, "torque_limit": self.torque_limit, "tool_kinematics": self.tool_kinematics}

    @property
    def signals(self) -> dict[str, OutputPort]:
        """Where tau_cmd, what the controller asks for, tau, what the drives can give, and x, v come from."""
        tool = self.tool_kinematics
        asked, given = self.controller.GetOutputPort("tau"), self.torque_limit.GetOutputPort("tau")
        return {"tau_cmd": asked, "tau": given, "x": tool.GetOutputPort("x"), "v": tool.GetOutputPort("v")}

    def output(self, signal: str) -> OutputPort | None:
        """The port of a signal of the figure; None where it is inside the controller."""
        return self.signals.get(signal)


def add_own_controller(
    builder: DiagramBuilder, replace: Mapping[str, Box], arm: ArmModel, inputs: Mapping[str, OutputPort | int]
) -> OwnController:
    """Add the System of `replace`, {"controller": MyController}, with its arrows.

    Its output port is `tau` (n,) [N m], its input ports are any of x_cmd, v_cmd, a_cmd (6,) [m, rad and per s, s^2],
    q (n,) [rad], qd (n,) [rad/s], as of `build_controller`, and x, v (6,), the tool's as the sensors show it.

    Args:
        builder: where MPC and sensors are.
        replace: the controller under its name, and nothing else.
        arm: for the number of joints and their torque limits.
        inputs: the signals by name, ports or sizes of inputs of the diagram.

    Raises InputError where ports do not fit, and where boxes of Fig. 4 are to be replaced too.
    """
    if others := [name for name in replace if name != WHOLE]:
        problem = f"replace: '{WHOLE}' stands for all boxes, {', '.join(others)} too"
        raise InputError.of("replace", list(replace), f"'{WHOLE}' alone", problem)
    box = builder.AddNamedSystem(WHOLE, fitting(WHOLE, replace[WHOLE], {"tau": arm.n_joints}, INPUTS))
    limit = builder.AddNamedSystem("torque_limit", TorqueLimit(arm.tau_max))
    tool = builder.AddNamedSystem("tool_kinematics", ToolKinematics(arm, arm.n_joints, CHANNELS))
    arrow = Arrows(builder, inputs, [box], {name: tool.GetOutputPort(name) for name in ("x", "v")})
    arrow("q", OUTSIDE, tool)
    arrow("qd", OUTSIDE, tool)
    arrow("tau", box, limit, "tau_cmd")
    arrow.complete()
    return OwnController(box, limit, tool)
