"""Fig. 4 of the paper: the boxes of one architecture, added to a diagram in the order of the figure.

    [mpc] → x_cmd, v_cmd → [pd] → (+) → [inverse_jacobian] → [nominal_inertia] → (+) → [torque_limit] → robot
      └─── a_cmd → [feedforward] ──┘                       [disturbance_observer] ┘

The four architectures differ by which boxes are present, never by a zero gain.  The drawing itself is not in our copy
of the paper's text; this is its reconstruction from section II-C.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Adder, Gain

from flipdiagram.arm import ArmModel
from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.gravity import GravityCompensation
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.inverse_jacobian import InverseJacobian
from flipdiagram.blocks.mpc import CHANNELS, ModelPredictiveController
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.tool_kinematics import ToolKinematics
from flipdiagram.blocks.torque_limit import TorqueLimit
from flipdiagram.contact import Floats
from flipdiagram.errors import ScenarioError
from flipdiagram.scenario import ARCHITECTURES, Scenario


@dataclass(frozen=True)
class ControllerBoxes:
    """Handles to the boxes of Fig. 4; those that the architecture lacks are None."""

    pd: LeafSystem
    inverse_jacobian: LeafSystem
    nominal_inertia: LeafSystem
    torque_limit: LeafSystem
    tool_kinematics: LeafSystem
    feedforward: LeafSystem | None
    disturbance_observer: LeafSystem | None
    gravity_compensation: LeafSystem | None
    """Not in the paper's figure: present only where the scenario asks for it."""


def check_architecture(architecture: str) -> str:
    """The name itself; raises ScenarioError, naming the valid ones, for another."""
    if architecture not in ARCHITECTURES:
        raise ScenarioError(f"unknown architecture '{architecture}'; choose from {', '.join(ARCHITECTURES)}")
    return architecture


def nominal_inertia(scenario: Scenario, arm: ArmModel, q_start: Floats) -> Floats:
    """Diagonal of M_n [kg·m²], shape (n,): the scenario's, or that of M(q) at the start pose q_start (n,)."""
    given = scenario.controller.nominal_inertia
    if given is not None and len(given) != arm.n_joints:
        raise ScenarioError(
            f"scenario field 'controller.nominal_inertia' = {list(given)} has {len(given)} entries;"
            f" valid is one per joint, {' '.join(arm.joint_names)}"
        )
    diagonal = np.diag(arm.mass_matrix(q_start)) if given is None else np.array(given)
    return diagonal * scenario.controller.nominal_inertia_scale


def add_controller(
    builder: DiagramBuilder,
    scenario: Scenario,
    architecture: str,
    arm: ArmModel,
    q_start: Floats,
    *,
    mpc: ModelPredictiveController,
    q: OutputPort,
    qd: OutputPort,
    offset: float = 0.0,
) -> ControllerBoxes:
    """Add the boxes of an architecture, wired to the MPC's commands and the measured q, qd; the caller takes tau.

    Boxes are named as in the figure.  offset [s] is that of the sampled boxes.  Raises ScenarioError for an unknown
    architecture or a nominal inertia that does not fit the arm.
    """
    parts = check_architecture(architecture).split("+")
    settings, n = scenario.controller, arm.n_joints
    inertia = nominal_inertia(scenario, arm, q_start)
    add, connect = builder.AddNamedSystem, builder.Connect

    pd = add("pd", ProportionalDerivative(np.full(CHANNELS, settings.k_p), np.full(CHANNELS, settings.k_v)))
    feedforward = add("feedforward", AccelerationFeedforward(CHANNELS)) if "ff" in parts else None
    inverse_jacobian = add("inverse_jacobian", InverseJacobian(arm, n, CHANNELS))
    reference = add("nominal_inertia", NominalInertia(inertia))
    observer = None
    if "dob" in parts:
        g_dis = np.full(n, settings.g_dis)
        observer = add("disturbance_observer", DisturbanceObserver(g_dis, inertia, settings.period, offset))
    limit = add("torque_limit", TorqueLimit(arm.tau_max))
    kinematics = add("tool_kinematics", ToolKinematics(arm, n, CHANNELS))

    for box in (kinematics, inverse_jacobian):
        connect(q, box.GetInputPort("q"))
        connect(qd, box.GetInputPort("qd"))
    for signal in ("x_cmd", "v_cmd"):
        connect(mpc.GetOutputPort(signal), pd.GetInputPort(signal))
    for signal in ("x", "v"):
        connect(kinematics.GetOutputPort(signal), pd.GetInputPort(signal))

    a_ref = pd.GetOutputPort("a_ref")
    if feedforward is not None:
        connect(mpc.GetOutputPort("a_cmd"), feedforward.GetInputPort("a_cmd"))
        a_ref = _sum(builder, "a_ref_sum", a_ref, feedforward.GetOutputPort("a_ff"))
    connect(a_ref, inverse_jacobian.GetInputPort("a_ref"))
    connect(inverse_jacobian.GetOutputPort("qdd_ref"), reference.GetInputPort("qdd_ref"))

    terms, observed = [reference.GetOutputPort("tau_ref")], limit.GetOutputPort("tau")
    if observer is not None:
        terms.append(observer.GetOutputPort("tau_dis"))
    gravity = None
    if settings.gravity_compensation > 0:
        gravity = add("gravity_compensation", GravityCompensation(arm, settings.gravity_compensation, n))
        connect(q, gravity.GetInputPort("q"))
        terms.append(gravity.GetOutputPort("tau_gravity"))
        if observer is not None:
            # what is fed forward must not be observed as a disturbance too, or it would count twice
            minus = add("minus_gravity", Gain(-1.0, n))
            connect(gravity.GetOutputPort("tau_gravity"), minus.get_input_port())
            observed = _sum(builder, "tau_observed", observed, minus.get_output_port())
    if observer is not None:
        connect(observed, observer.GetInputPort("tau"))
        connect(qd, observer.GetInputPort("qd"))
    tau = _sum(builder, "tau_sum", *terms) if len(terms) > 1 else terms[0]
    connect(tau, limit.GetInputPort("tau_cmd"))
    return ControllerBoxes(pd, inverse_jacobian, reference, limit, kinematics, feedforward, observer, gravity)


def _sum(builder: DiagramBuilder, name: str, *terms: OutputPort) -> OutputPort:
    total = builder.AddNamedSystem(name, Adder(len(terms), terms[0].size()))
    for i, term in enumerate(terms):
        builder.Connect(term, total.get_input_port(i))
    return total.get_output_port()
