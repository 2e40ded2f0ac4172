"""What the controller sees of the joints: through what the scenario has of noise, encoder, delay, velocity filter."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort

from flipdiagram.arrays import Floats
from flipdiagram.blocks.delay import Delay
from flipdiagram.blocks.noise import SensorNoise
from flipdiagram.blocks.sensors import Encoder, PseudoDerivative
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario


@dataclass
class Sensing:
    """q and qd (n,) [rad, rad/s] as the controller sees them, and the boxes between, by name."""

    q: OutputPort
    qd: OutputPort
    boxes: dict[str, LeafSystem] = field(default_factory=dict)

    def have_seen(self, context: Context, q: Floats) -> None:
        """Set the states, in a root Context, that come of angles q (n,) [rad] which stay for long."""
        for name, box in self.boxes.items():
            own = box.GetMyMutableContextFromRoot(context)
            if name == "delayed_q":
                own.SetDiscreteState(np.tile(q, own.num_total_states() // len(q)))
            elif name == "velocity":
                own.SetDiscreteState(q)

    def without_error(self, context: Context) -> None:
        """Let them measure without noise and rounding, in a root Context."""
        for box in self.boxes.values():
            for name in ("deviation", "resolution"):
                if name in box.numeric_parameter_names:
                    box.set_parameters(box.GetMyMutableContextFromRoot(context), **{name: 0.0})


def add_sensing(
    builder: DiagramBuilder,
    scenario: Scenario,
    arm: ArmModel,
    q: OutputPort,
    qd: OutputPort,
    q_start: Floats,
    offset: float,
    add_noise: Callable[[SensorNoise, str, OutputPort], OutputPort] | None = None,
) -> Sensing:
    """Add the sensors of a scenario behind the ports q and qd of a cell; offset [s], that of the sampled boxes.

    add_noise: adds a noise of this name to a signal, where its box shall stand elsewhere.

    Raises InputError where an encoder on the motor's side needs gear ratios that nobody gives.
    The encoder rounds angles that are noisy already.  Noise of the velocities comes before their delay, or after the
    filter where there is one: it belongs to the velocity, however that is measured.
    """
    sensors, period, n = scenario.sensors, scenario.controller.period, len(q_start)
    seen = Sensing(q, qd)

    def through(box: LeafSystem, name: str, signal: OutputPort) -> OutputPort:
        seen.boxes[name] = builder.AddNamedSystem(name, box)
        builder.Connect(signal, box.get_input_port())
        return box.get_output_port()

    def noisy(signal: OutputPort, name: str, deviation: float, stream: int) -> OutputPort:
        if deviation == 0:
            return signal
        box = SensorNoise(np.full(n, deviation), sensors.noise_seed, period, offset, stream)
        return (add_noise or through)(box, name, signal)

    seen.q = noisy(q, "position_noise", sensors.position_noise, 0)
    if sensors.encoder_resolution > 0 or scenario.encoder_bits:
        seen.q = through(Encoder(encoder_resolution(scenario, arm)), "encoder", seen.q)
    if sensors.delay > 0:
        seen.q = through(Delay(n, sensors.delay, period, offset, q_start), "delayed_q", seen.q)
    if sensors.velocity_cutoff is not None:
        g_v = np.full(n, sensors.velocity_cutoff)
        seen.qd = through(PseudoDerivative(g_v, period, offset, q_start), "velocity", seen.q)
    seen.qd = noisy(seen.qd, "velocity_noise", sensors.velocity_noise, 1)
    if sensors.velocity_cutoff is None and sensors.delay > 0:
        seen.qd = through(Delay(n, sensors.delay, period, offset), "delayed_qd", seen.qd)
    return seen


def encoder_resolution(scenario: Scenario, arm: ArmModel) -> Floats:
    """Step of the encoders, seen at the joints (n,) [rad]: 2 pi / (2^bits ratio) of one on the motor's side."""
    if not scenario.encoder_bits:
        return np.full(arm.n_joints, scenario.sensors.encoder_resolution)
    return 2 * np.pi / (2.0**scenario.encoder_bits * arm.gear_ratios("sensors.encoder_bits"))
