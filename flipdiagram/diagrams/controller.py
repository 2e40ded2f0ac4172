"""Fig. 4 of the paper: the boxes of one architecture, added to a diagram in the order of the figure.

    [mpc] → x_cmd, v_cmd → [pd] → (+) → [inverse_jacobian] → [nominal_inertia] → (+) → [torque_limit] → robot
      └─── a_cmd → [feedforward] ──┘
    robot → q, qd → [tool_kinematics] → x, v → [pd];   tau, qd → [disturbance_observer] → tau_dis → second (+)

The four architectures differ by which boxes are present, never by a zero gain.  The drawing itself is not in our copy
of the paper's text; this is its reconstruction from section II-C.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Gain

from flipdiagram.arrays import Floats
from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.gravity import GravityCompensation
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.inverse_jacobian import InverseJacobian
from flipdiagram.blocks.mpc import CHANNELS, COMMANDS
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.tool_kinematics import ToolKinematics
from flipdiagram.blocks.torque_limit import TorqueLimit
from flipdiagram.diagrams.arrows import OUTSIDE, Arrows
from flipdiagram.diagrams.replacement import Box, build_diagram, with_replaced
from flipdiagram.diagrams.start import start_of
from flipdiagram.errors import InputError
from flipdiagram.planning.planner import Planner
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import one_per_joint
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario

SIGNALS = (*COMMANDS, "x", "v", "q", "qd", "a_ref", "qdd_ref", "tau_ref", "tau_dis", "tau_gravity", "tau_cmd", "tau")
"""Signals that a box may take as inputs, by the names of the figure."""


@dataclass(frozen=True)
class ControllerBoxes:
    """Handles to the boxes of Fig. 4; those that the architecture lacks are None."""

    pd: LeafSystem
    inverse_jacobian: LeafSystem
    nominal_inertia: LeafSystem
    torque_limit: LeafSystem
    tool_kinematics: LeafSystem
    feedforward: LeafSystem | None = None
    disturbance_observer: LeafSystem | None = None
    gravity_compensation: LeafSystem | None = None
    """Not in the paper's figure: present only where the scenario asks for it."""
    signals: Mapping[str, OutputPort] = field(default_factory=dict)
    """Where each signal that a box or a sum makes comes from."""

    @property
    def systems(self) -> dict[str, LeafSystem]:
        """The boxes that there are, by name."""
        return {name: box for name, box in vars(self).items() if box is not None and name != "signals"}

    def output(self, signal: str) -> OutputPort | None:
        """The port of a signal of the figure, such as tau, tau_cmd, x; None where the architecture lacks it."""
        return self.signals.get(signal)


def check_architecture(architecture: str) -> str:
    """The name itself; raises InputError, naming the valid ones, for another."""
    if architecture not in ARCHITECTURES:
        raise InputError.of("architecture", architecture, ARCHITECTURES, f"unknown architecture '{architecture}'")
    return architecture


def nominal_inertia(scenario: Scenario, arm: ArmModel, q_start: Floats) -> Floats:
    """Diagonal of M_n [kg·m²], shape (n,): the scenario's, or that of M(q) at the start pose q_start (n,)."""
    given = scenario.controller.nominal_inertia
    if given is None:
        diagonal = np.diag(arm.mass_matrix(q_start))
    else:
        diagonal = np.array(one_per_joint("controller.nominal_inertia", given, arm.joint_names))
    return diagonal * scenario.controller.nominal_inertia_scale


def build_controller(
    scenario: Scenario, architecture: str, arm: ArmModel, *, replace: Mapping[str, Box] | None = None
) -> Diagram:
    """Fig. 4 between MPC and robot as a Diagram of its own, to be put into anybody's DiagramBuilder.

    Input ports `x_cmd`, `v_cmd`, `a_cmd` (6,) [m, rad and per s, s²], `q` (n,) [rad], `qd` (n,) [rad/s]; output port
    `tau` (n,) [N·m].  Each architecture has all of them, so that one can stand in the place of another: what it does
    not take ends in a box, `unused_a_cmd` where nothing is fed forward.

    Args:
        scenario: gains, period, nominal inertia, and the start pose at which M_n is taken where it gives none.
        architecture: one of `ARCHITECTURES`.
        arm: the controller's model of the arm.
        replace: boxes of the user's own by name, {"pd": MyController}, see `replacement.with_replaced`.

    Raises:
        InputError: for an unknown architecture, a nominal inertia that does not fit the arm, a box that does not fit.
        PlanningError: where the arm cannot be at the start pose.
    """
    builder = DiagramBuilder()
    inputs = {**dict.fromkeys(COMMANDS, CHANNELS), "q": arm.n_joints, "qd": arm.n_joints}
    q_start = start_of(Planner(scenario, arm)).q
    boxes = add_controller(builder, scenario, architecture, arm, q_start, inputs, replace=replace)
    builder.ExportOutput(boxes.torque_limit.GetOutputPort("tau"), "tau")
    diagram = build_diagram(builder, replace)
    diagram.set_name(architecture)
    return diagram


def add_controller(
    builder: DiagramBuilder,
    scenario: Scenario,
    architecture: str,
    arm: ArmModel,
    q_start: Floats,
    inputs: Mapping[str, OutputPort | int],
    offset: float = 0.0,
    replace: Mapping[str, Box] | None = None,
    tau_dis: Floats | float = 0.0,
) -> ControllerBoxes:
    """Add what `build_controller` builds, flat: Drake evaluates a sub-diagram at twice the cost.

    Beside its arguments: q_start (n,) [rad], where M_n is taken if the scenario gives none; inputs, the figure's by
    name, ports or sizes of inputs of the diagram (see `Arrows`); offset [s], that of the sampled boxes; tau_dis (n,)
    [N m], what our observer's state is in the default context.
    """
    ours = _boxes(scenario, architecture, arm, nominal_inertia(scenario, arm, q_start), offset, tau_dis)
    placed = with_replaced(ours, replace or {}, SIGNALS, architecture)
    named = {name: builder.AddNamedSystem(name, system) for name, system in placed.items()}
    ports = [box.get_output_port(i) for box in named.values() for i in range(box.num_output_ports())]
    own = [named[name] for name in replace or ()]
    boxes = ControllerBoxes(**named)
    arrow = Arrows(builder, inputs, own, {port.get_name(): port for port in ports})
    draw_figure_4(arrow, boxes, arm.n_joints)
    arrow.complete()
    signals = {name: arrow.source(name) for name in SIGNALS if name not in inputs and arrow.has(name)}
    of_box = {"tau": boxes.torque_limit, "x": boxes.tool_kinematics, "v": boxes.tool_kinematics}
    signals |= {name: box.GetOutputPort(name) for name, box in of_box.items()}
    return dataclasses.replace(boxes, signals=signals)


def draw_figure_4(arrow: Arrows, box: ControllerBoxes, n: int) -> None:
    """The arrows of Fig. 4 from left to right, then the feedback; boxes that the architecture lacks have none."""
    arrow("x_cmd", OUTSIDE, box.pd)
    arrow("v_cmd", OUTSIDE, box.pd)
    if box.feedforward is not None:
        a_ref_sum = arrow.sum("a_ref_sum", 2, CHANNELS)
        arrow("a_cmd", OUTSIDE, box.feedforward)
        arrow("a_ref", box.pd, a_ref_sum)
        arrow("a_ff", box.feedforward, a_ref_sum)
        arrow("a_ref", a_ref_sum, box.inverse_jacobian)
    else:
        arrow.unused("a_cmd")
        arrow("a_ref", box.pd, box.inverse_jacobian)
    arrow("qdd_ref", box.inverse_jacobian, box.nominal_inertia)
    added = [b for b in (box.disturbance_observer, box.gravity_compensation) if b is not None]
    if added:
        tau_sum = arrow.sum("tau_sum", 1 + len(added), n)
        arrow("tau_ref", box.nominal_inertia, tau_sum)
        if box.disturbance_observer is not None:
            arrow("tau_dis", box.disturbance_observer, tau_sum)
        if box.gravity_compensation is not None:
            arrow("tau_gravity", box.gravity_compensation, tau_sum)
        arrow("tau_cmd", tau_sum, box.torque_limit)
    else:
        arrow("tau_ref", box.nominal_inertia, box.torque_limit, "tau_cmd")

    arrow("q", OUTSIDE, box.tool_kinematics)
    arrow("qd", OUTSIDE, box.tool_kinematics)
    arrow("x", box.tool_kinematics, box.pd)
    arrow("v", box.tool_kinematics, box.pd)
    arrow("q", OUTSIDE, box.inverse_jacobian)
    arrow("qd", OUTSIDE, box.inverse_jacobian)
    if box.gravity_compensation is not None:
        arrow("q", OUTSIDE, box.gravity_compensation)
    if box.disturbance_observer is not None:
        arrow("qd", OUTSIDE, box.disturbance_observer)
        if box.gravity_compensation is None:
            arrow("tau", box.torque_limit, box.disturbance_observer)
        else:  # what is fed forward must not be observed as a disturbance too, or it would count twice
            minus_gravity = arrow.add("minus_gravity", Gain(-1.0, n))
            tau_observed = arrow.sum("tau_observed", 2, n)
            arrow("tau_gravity", box.gravity_compensation, minus_gravity, "u0")
            arrow("tau", box.torque_limit, tau_observed)
            arrow("y0", minus_gravity, tau_observed)
            arrow("tau_observed", tau_observed, box.disturbance_observer, "tau")


def _boxes(
    scenario: Scenario, architecture: str, arm: ArmModel, inertia: Floats, offset: float, tau_dis: Floats | float
) -> dict[str, LeafSystem]:
    """Our boxes of an architecture by their names in the figure."""
    parts = check_architecture(architecture).split("+")
    settings, n = scenario.controller, arm.n_joints
    boxes: dict[str, LeafSystem] = {
        "pd": ProportionalDerivative(np.full(CHANNELS, settings.k_p), np.full(CHANNELS, settings.k_v)),
        "inverse_jacobian": InverseJacobian(arm, n, CHANNELS, inner_damping=settings.k_v),
        "nominal_inertia": NominalInertia(inertia),
        "torque_limit": TorqueLimit(arm.tau_max),
        "tool_kinematics": ToolKinematics(arm, n, CHANNELS),
    }
    if "ff" in parts:
        boxes["feedforward"] = AccelerationFeedforward(CHANNELS)
    if "dob" in parts:
        g_dis = np.full(n, settings.g_dis)
        boxes["disturbance_observer"] = DisturbanceObserver(g_dis, inertia, settings.period, offset, tau_dis)
    if settings.gravity_compensation > 0:
        boxes["gravity_compensation"] = GravityCompensation(arm, settings.gravity_compensation, n)
    return boxes
