"""Fig. 4 of the paper: the boxes of one architecture, added to a diagram in the order of the figure.

    [mpc] → x_cmd, v_cmd → [pd] → (+) → [inverse_jacobian] → [nominal_inertia] → (+) → [torque_limit] → robot
      └─── a_cmd → [feedforward] ──┘                       [disturbance_observer] ┘

The four architectures differ by which boxes are present, never by a zero gain.  The drawing itself is not in our copy
of the paper's text; this is its reconstruction from section II-C.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Adder, Gain

from flipdiagram.arrays import Floats
from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.gravity import GravityCompensation
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.inverse_jacobian import InverseJacobian
from flipdiagram.blocks.mpc import CHANNELS
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.tool_kinematics import ToolKinematics
from flipdiagram.blocks.torque_limit import TorqueLimit
from flipdiagram.diagrams.replacement import Box, chosen, misfit
from flipdiagram.errors import InputError
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario

SIGNALS = (
    "x_cmd",
    "v_cmd",
    "a_cmd",
    "x",
    "v",
    "q",
    "qd",
    "a_ref",
    "qdd_ref",
    "tau_ref",
    "tau_dis",
    "tau_gravity",
    "tau_cmd",
    "tau",
)
"""Signals that a box may take as inputs, by the names of the figure."""


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
    """The name itself; raises InputError, naming the valid ones, for another."""
    if architecture not in ARCHITECTURES:
        raise InputError(f"unknown architecture '{architecture}'; choose from {', '.join(ARCHITECTURES)}")
    return architecture


def nominal_inertia(scenario: Scenario, arm: ArmModel, q_start: Floats) -> Floats:
    """Diagonal of M_n [kg·m²], shape (n,): the scenario's, or that of M(q) at the start pose q_start (n,)."""
    given = scenario.controller.nominal_inertia
    if given is not None and len(given) != arm.n_joints:
        raise InputError(
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
    mpc: LeafSystem,
    q: OutputPort,
    qd: OutputPort,
    offset: float = 0.0,
    replace: Mapping[str, Box] | None = None,
) -> ControllerBoxes:
    """Add the boxes of an architecture, wired to the MPC's commands and the measured q, qd; the caller takes tau.

    Boxes are named as in the figure.  offset [s] is that of the sampled boxes.  replace: boxes of the user's own by
    name, see `replacement.chosen`.  Raises InputError for an unknown architecture, a nominal inertia that does not
    fit the arm, or a box that does not fit its place.
    """
    parts = check_architecture(architecture).split("+")
    settings, n = scenario.controller, arm.n_joints
    inertia = nominal_inertia(scenario, arm, q_start)
    connect = builder.Connect

    ours: dict[str, LeafSystem] = {
        "pd": ProportionalDerivative(np.full(CHANNELS, settings.k_p), np.full(CHANNELS, settings.k_v)),
        "inverse_jacobian": InverseJacobian(arm, n, CHANNELS, settings.k_v),
        "nominal_inertia": NominalInertia(inertia),
        "torque_limit": TorqueLimit(arm.tau_max),
        "tool_kinematics": ToolKinematics(arm, n, CHANNELS),
    }
    if "ff" in parts:
        ours["feedforward"] = AccelerationFeedforward(CHANNELS)
    if "dob" in parts:
        g_dis = np.full(n, settings.g_dis)
        ours["disturbance_observer"] = DisturbanceObserver(g_dis, inertia, settings.period, offset)
    if settings.gravity_compensation > 0:
        ours["gravity_compensation"] = GravityCompensation(arm, settings.gravity_compensation, n)
    placed = chosen(ours, replace or {}, SIGNALS, architecture)
    boxes = {name: builder.AddNamedSystem(name, box) for name, box in placed.items()}

    signals = {name: mpc.GetOutputPort(name) for name in ("x_cmd", "v_cmd", "a_cmd")} | {"q": q, "qd": qd}
    for box in boxes.values():
        signals |= {box.get_output_port(i).get_name(): box.get_output_port(i) for i in range(box.num_output_ports())}
    if "feedforward" in boxes:
        signals["a_ref"] = _sum(builder, "a_ref_sum", signals["a_ref"], signals["a_ff"])
    torques = [signals[name] for name in ("tau_ref", "tau_dis", "tau_gravity") if name in signals]
    signals["tau_cmd"] = _sum(builder, "tau_sum", *torques) if len(torques) > 1 else torques[0]
    observed = signals["tau"]
    if "gravity_compensation" in boxes and "disturbance_observer" in boxes:
        # what is fed forward must not be observed as a disturbance too, or it would count twice
        minus = builder.AddNamedSystem("minus_gravity", Gain(-1.0, n))
        connect(signals["tau_gravity"], minus.get_input_port())
        observed = _sum(builder, "tau_observed", observed, minus.get_output_port())

    for name, box in boxes.items():
        for i in range(box.num_input_ports()):
            port = box.get_input_port(i)
            taken = observed if (name, port.get_name()) == ("disturbance_observer", "tau") else signals[port.get_name()]
            if taken.size() != port.size():
                raise misfit(name, f"input port '{port.get_name()}' has size {port.size()}", f"{taken.size()}")
            connect(taken, port)
    found: dict[str, Any] = {field.name: boxes.get(field.name) for field in fields(ControllerBoxes)}
    return ControllerBoxes(**found)


def _sum(builder: DiagramBuilder, name: str, *terms: OutputPort) -> OutputPort:
    total = builder.AddNamedSystem(name, Adder(len(terms), terms[0].size()))
    for i, term in enumerate(terms):
        builder.Connect(term, total.get_input_port(i))
    return total.get_output_port()
