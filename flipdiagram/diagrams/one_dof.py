"""Section III: Fig. 4 with one degree of freedom around a mass, from the same boxes that drive the arm.

    [command] → x_cmd, v_cmd, a_cmd → [controller] → force → [plant] → x, v, a
    inside:   [pd] → (+) → [nominal_inertia] → (+) → force;  [feedforward] and [disturbance_observer] where present

A controller is any System with one channel and an output `force` [N] that has some of the inputs x_cmd [m],
v_cmd [m/s], a_cmd [m/s²], x [m], v [m/s]: those of the four architectures come from `build_controller`.
"""

from collections.abc import Mapping

from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder

from flipdiagram.blocks.commands import BroadbandNoise, SinusoidalCommand, SinusoidalNoise
from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.meters import LockIn, Peak, RootMeanSquare
from flipdiagram.blocks.mpc import COMMANDS
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.sensors import PseudoDerivative
from flipdiagram.diagrams.arrows import OUTSIDE, Arrows
from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.diagrams.replacement import misfit
from flipdiagram.errors import InputError
from flipdiagram.plants.one_dof import OneDofPlant
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.theory.transfer import Loop1Dof

CONTROLLER_INPUTS = (*COMMANDS, "x", "v")
NO_INERTIA = 1e-300
"""Stands for m_n = 0 [kg] in the observer's constructor, which takes positive numbers only."""


def build_controller(architecture: str, settings: OneDof) -> Diagram:
    """One architecture for one degree of freedom, with the observer realised as in the settings.

    The boxes are named as in Fig. 4; `force` = m_ref a_ref + tau_dis [N].  Raises InputError for an unknown
    architecture.
    """
    parts = check_architecture(architecture).split("+")
    builder = DiagramBuilder()
    add, arrow = builder.AddNamedSystem, Arrows(builder, dict.fromkeys(CONTROLLER_INPUTS, 1))
    pd = add("pd", ProportionalDerivative([settings.k_p], [settings.k_v]))
    arrow("x_cmd", OUTSIDE, pd)
    arrow("v_cmd", OUTSIDE, pd)
    arrow("x", OUTSIDE, pd)
    arrow("v", OUTSIDE, pd)
    asking = pd
    if "ff" in parts:
        feedforward = add("feedforward", AccelerationFeedforward(1))
        if settings.feedforward == "measured":
            measured = add("measured_acceleration", PseudoDerivative([settings.acceleration_cutoff], settings.step))
            arrow("v", OUTSIDE, measured, "q")
            arrow("v", measured, feedforward, "a_cmd")
        else:
            arrow("a_cmd", OUTSIDE, feedforward)
        asking = arrow.sum("a_ref_sum", 2, 1)
        arrow("a_ref", pd, asking)
        arrow("a_ff", feedforward, asking)
    reference = add("nominal_inertia", NominalInertia([reference_mass(settings)]))
    arrow("a_ref", asking, reference, "qdd_ref")
    force = reference.GetOutputPort("tau_ref")
    if "dob" in parts:
        nominal = max(settings.nominal_mass_ratio * settings.mass, NO_INERTIA)
        observer = add("disturbance_observer", DisturbanceObserver([settings.g_dis], [nominal], settings.step))
        force_sum = arrow.sum("force_sum", 2, 1)
        arrow("tau_ref", reference, force_sum)
        arrow("tau_dis", observer, force_sum)
        arrow("force", force_sum, observer, "tau")
        arrow("v", OUTSIDE, observer, "qd")
        force = force_sum.get_output_port()
    builder.ExportOutput(force, "force")
    diagram = builder.Build()
    diagram.set_name(architecture)
    return diagram


def build_experiment(
    controller: System,
    settings: OneDof,
    *,
    friction: bool = False,
    noise: float = 0.0,
    white_noise: float = 0.0,
    seed: int = 1,
) -> Diagram:
    """The closed loop with its sources and meters: what one channel of the study runs.

    Sources: the command of eqs. (13)–(15) with an amplitude of 1 m, and velocity noise [m/s] as a sinusoid of the
    amplitude `noise` and as white noise of the RMS `white_noise`, at rest where 0.  Friction is that of the settings.
    Outputs `x`, `v`, `a`, `force`, `white_noise`, and those of the meters: `lockin_x`, `lockin_a`, `peak_x`, `peak_a`,
    `peak_force`, `rms_error`.
    """
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    plant, x, v = _plant_and_sensor(builder, settings, friction)
    command = add("command", SinusoidalCommand([1.0]))
    sine = add("noise", SinusoidalNoise([1.0], [noise]))
    white = add("white_noise", BroadbandNoise([white_noise], settings.step, [seed]))
    noisy = add("v_noise_sum", Adder(3, 1))
    for i, term in enumerate((v, sine.GetOutputPort("noise"), white.GetOutputPort("noise"))):
        connect(term, noisy.get_input_port(i))
    commands = {name: command.GetOutputPort(name) for name in COMMANDS}
    signals = {**commands, "x": x, "v": noisy.get_output_port()}
    force = _close(builder, controller, plant.GetInputPort("f"), signals)
    outputs = {"x": x, "a": plant.GetOutputPort("a"), "force": force}
    meters = {f"lockin_{name}": (outputs[name], LockIn([1.0], settings.step)) for name in ("x", "a")}
    meters |= {f"peak_{name}": (outputs[name], Peak(1, settings.step)) for name in outputs}
    meters["rms_error"] = (x, RootMeanSquare(1, settings.step))
    for name, (port, meter) in meters.items():
        add(name, meter)
        connect(port, meter.GetInputPort("y"))
    connect(commands["x_cmd"], meters["rms_error"][1].GetInputPort("reference"))
    outputs |= {name: meter.get_output_port() for name, (_, meter) in meters.items()}
    outputs |= {"v": plant.GetOutputPort("v"), "white_noise": white.GetOutputPort("noise")}
    for name, port in outputs.items():
        builder.ExportOutput(port, name)
    return builder.Build()


def build_open(controller: System, settings: OneDof) -> Diagram:
    """The same loop without friction, source and meters, for linearising: inputs x_cmd, v_cmd, a_cmd, v_noise, f_d.

    Commands that the controller does not take are no inputs here either.  Outputs `x`, `a`, `force`.
    """
    builder = DiagramBuilder()
    plant, x, v = _plant_and_sensor(builder, settings, friction=False)
    noisy, disturbed = (builder.AddNamedSystem(f"{name}_sum", Adder(2, 1)) for name in ("v_noise", "f_d"))
    builder.Connect(v, noisy.get_input_port(0))
    builder.ExportInput(noisy.get_input_port(1), "v_noise")
    builder.ExportInput(disturbed.get_input_port(1), "f_d")
    builder.Connect(disturbed.get_output_port(), plant.GetInputPort("f"))
    signals: dict[str, OutputPort | int] = dict.fromkeys(COMMANDS, 1)
    force = _close(builder, controller, disturbed.get_input_port(0), signals | {"x": x, "v": noisy.get_output_port()})
    for name, port in {"x": x, "a": plant.GetOutputPort("a"), "force": force}.items():
        builder.ExportOutput(port, name)
    return builder.Build()


def theory(architecture: str, settings: OneDof, *, sampled: bool = True) -> Loop1Dof:
    """The closed form of an architecture with these settings, without friction."""
    parts = check_architecture(architecture).split("+")
    return Loop1Dof(
        mass=settings.mass,
        k_p=settings.k_p,
        k_v=settings.k_v,
        g_dis=settings.g_dis if "dob" in parts else 0.0,
        nominal_mass=settings.nominal_mass_ratio * settings.mass,
        reference_mass=reference_mass(settings),
        velocity_cutoff=settings.velocity_cutoff,
        feedforward=settings.feedforward if "ff" in parts else "none",
        acceleration_cutoff=settings.acceleration_cutoff,
        period=settings.step if sampled else 0.0,
    )


def reference_mass(settings: OneDof) -> float:
    """m_ref [kg] of force = m_ref a_ref: the mass, or m_n where the reference is scaled by it."""
    return settings.mass * (settings.nominal_mass_ratio if settings.reference_scaled_by_nominal_mass else 1.0)


def _plant_and_sensor(
    builder: DiagramBuilder, settings: OneDof, friction: bool
) -> tuple[System, OutputPort, OutputPort]:
    """The plant, its x, and the velocity that the controller sees."""
    law = settings.friction_model if friction else "none"
    numbers = ([settings.mass], settings.step, law, [settings.coulomb], [settings.viscous])
    plant = builder.AddNamedSystem("plant", OneDofPlant(*numbers))
    x = plant.GetOutputPort("x")
    if settings.velocity_cutoff is None:
        return plant, x, plant.GetOutputPort("v")
    velocity = builder.AddNamedSystem("velocity", PseudoDerivative([settings.velocity_cutoff], settings.step))
    builder.Connect(x, velocity.GetInputPort("q"))
    return plant, x, velocity.GetOutputPort("v")


def _close(
    builder: DiagramBuilder, controller: System, f: InputPort, signals: Mapping[str, OutputPort | int]
) -> OutputPort:
    """Add the controller between its signals, those that are sizes as inputs, and the port f; returns its force."""
    if not controller.HasOutputPort("force"):
        name = controller.get_name()
        raise InputError(f"controller '{name}' has no output 'force'; give it one [N]", field="controller", value=name)
    force = controller.GetOutputPort("force")
    if force.size() != 1:
        raise misfit("controller", f"output port 'force' of size {force.size()}", "1", argument="")
    builder.AddNamedSystem("controller", controller)
    Arrows(builder, signals).feed(controller)
    builder.Connect(force, f)
    return force
