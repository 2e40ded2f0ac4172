"""Fig. 4 around joints alone, every block of it for every scalar: what can be linearised, converted and compiled."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, Demultiplexer

from flipdiagram.arrays import Floats
from flipdiagram.blocks.mpc import CHANNELS, COMMANDS
from flipdiagram.blocks.plan_commands import plan_commands
from flipdiagram.compiled.linear import Linearization
from flipdiagram.compiled.linearize import linearize_diagram
from flipdiagram.diagrams.controller import add_controller
from flipdiagram.diagrams.drive import add_drive
from flipdiagram.diagrams.rest import Resting
from flipdiagram.diagrams.sensing import add_sensing
from flipdiagram.diagrams.start import start_of
from flipdiagram.errors import InputError
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.planner import Planner
from flipdiagram.plants.joint_friction import joint_friction
from flipdiagram.plants.joint_model import JointModel, joint_model
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_at_pose import ArmAtPose
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario

SMOOTH = {
    "sensors.encoder_resolution": 0.0,
    "sensors.encoder_bits": 0,
    "sensors.position_noise": 0.0,
    "sensors.velocity_noise": 0.0,
}
"""Rounding has the slope 0, and noise none."""


@dataclass(frozen=True)
class JointLoop:
    """The loop and what it stands for; `diagram` and its default context are all that Drake needs of it."""

    diagram: Diagram
    scenario: Scenario
    architecture: str
    model: JointModel
    hold: Floats
    """The command that holds the start pose (6,) [m, rad]."""

    def context(self) -> Context:
        """A context at rest, inputs fixed: the command holds the start, nothing disturbs."""
        context = self.diagram.CreateDefaultContext()
        for i in range(self.diagram.num_input_ports()):
            port = self.diagram.get_input_port(i)
            port.FixValue(context, self.hold if port.get_name() == "x_cmd" else np.zeros(port.size()))
        return context

    def linearize(self) -> Linearization:
        """A, B, C, D about the rest, where the command holds the start pose."""
        return linearize_diagram(self.diagram, self.context())


def build_joint_loop(
    scenario: Scenario,
    architecture: str = "pd+ff+dob",
    plan: Plan | None = None,
    *,
    arm: ArmModel | None = None,
    model: JointModel | None = None,
) -> JointLoop:
    """The controller of Fig. 4 with sensors, drives and joint friction around a `JointModel` in the place of the cell.

    All blocks have the controller's period and convert to AutoDiffXd and, with the default `arm`, to Expression.
    Sensors neither round nor make noise.  There is no contact: the block is a part of the tool.  Inputs `x_cmd`,
    `v_cmd`, `a_cmd` (6,) and `tau_ext` (n,) [N m], a torque on the joints, or none of them with a plan; outputs: the
    figure's signals, as of `Loop.diagram`.

    Args:
        scenario: its controller, sensors, drive, friction and robot.
        architecture: one of `ARCHITECTURES`.
        plan: the motion that a `PlanCommands` plays out in the place of the MPC.
        arm: the controller's model of the arm: by default `ArmAtPose`, linear about the rest; `arm_of(scenario)` for
            the kinematics as they are, which do not convert to Expression.
        model: the joints, by default those of the scenario's robot where it rests.

    Raises:
        InputError: for an unknown architecture, a bad number, elastic joints.
        PlanningError: where the arm cannot be at the start pose.
    """
    if scenario.joints.model != "rigid":
        message = "scenario field 'joints.model' = 'elastic' has no joint model here; valid is rigid"
        raise InputError(message, field="joints.model", value=scenario.joints.model, valid="rigid")
    period = scenario.controller.period
    smooth = scenario.with_overrides({**SMOOTH, "simulation.step": period})
    true_arm = arm_of(smooth)
    start = start_of(Planner(smooth, true_arm))
    resting = Resting(smooth, architecture, true_arm, start)
    joints = joint_model(smooth, start.q, resting.at_rest) if model is None else model
    controllers = ArmAtPose(true_arm, joints.q0) if arm is None else arm
    n = true_arm.n_joints

    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("joints", joints.sampled(period))
    state = builder.AddNamedSystem("joint_state", Demultiplexer([n, n]))
    friction = builder.AddNamedSystem("joint_friction", joint_friction(smooth, true_arm))
    torque = builder.AddNamedSystem("joint_torque", Adder(2 if plan is not None else 3, n))
    q, qd = state.get_output_port(0), state.get_output_port(1)
    builder.Connect(plant.get_output_port(), state.get_input_port())
    builder.Connect(qd, friction.get_input_port())
    builder.Connect(friction.get_output_port(), torque.get_input_port(1))
    builder.Connect(torque.get_output_port(), plant.get_input_port())
    signals: dict[str, OutputPort | int] = dict.fromkeys(COMMANDS, CHANNELS)
    if plan is not None:
        source = plan_commands(plan, start.pose, smooth.simulation.lead_time)
        commands = builder.AddNamedSystem("mpc", source)
        signals = {name: commands.GetOutputPort(name) for name in COMMANDS}
    else:
        builder.ExportInput(torque.get_input_port(2), "tau_ext")
    seen = add_sensing(builder, smooth, true_arm, q, qd, joints.q0, 0.0)
    signals |= {"q": seen.q, "qd": seen.qd}
    boxes = add_controller(builder, smooth, architecture, controllers, start.q, signals, tau_dis=resting.observed)
    drive = add_drive(builder, smooth, true_arm, boxes.signals["tau"], q, 0.0, resting.tau)
    builder.Connect(drive.tau, torque.get_input_port(0))
    for name, port in {**signals, **boxes.signals}.items():
        if not isinstance(port, int):
            builder.ExportOutput(port, name)
    diagram = builder.Build()
    diagram.set_name(architecture)
    return JointLoop(diagram, smooth, architecture, joints, start.pose)
