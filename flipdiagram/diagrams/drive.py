"""What lies between the torque that the controller sends and the one that the cell takes: hold, delay, ripple."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import ZeroOrderHold

from flipdiagram.arrays import Floats
from flipdiagram.blocks.delay import Delay
from flipdiagram.blocks.ripple import TorqueRipple, rippled_torque
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario


@dataclass
class Drive:
    """Torques (n,) [N m], and the boxes between them by name."""

    sent: OutputPort
    """What the controller sends in answer to the sample of now."""
    tau: OutputPort
    """What the cell takes."""
    boxes: dict[str, LeafSystem] = field(default_factory=dict)

    def have_sent(self, context: Context, tau: Floats) -> None:
        """Set the states, in a root Context, that come of a torque tau (n,) [N m] which stays for long."""
        for box in self.boxes.values():
            own = box.GetMyMutableContextFromRoot(context)
            if size := own.num_total_states():
                own.SetDiscreteState(np.tile(tau, size // len(tau)))


def ripple_at_rest(scenario: Scenario, arm: ArmModel, q: Floats) -> Floats:
    """Torques (n,) [N m] that a scenario's drives at rest add at angles q (n,) [rad] of their joints."""
    rest = np.zeros_like(q)
    return rippled_torque(rest, q, *_ripple(scenario, arm)) if scenario.drive.ripple > 0 else rest


def _ripple(scenario: Scenario, arm: ArmModel) -> tuple[Floats, Floats]:
    """Amplitude [N m] and cycles [1] (n,); raises InputError where nobody gives the gear ratios."""
    settings = scenario.drive
    return settings.ripple * arm.tau_rated, settings.ripple_cycles * arm.gear_ratios("drive.ripple")


def add_drive(
    builder: DiagramBuilder,
    scenario: Scenario,
    arm: ArmModel,
    tau: OutputPort,
    q: OutputPort,
    offset: float,
    sent: Floats | float = 0.0,
) -> Drive:
    """Add the drives of a scenario behind the torque tau of the controller; by default there is nothing to add.

    Args:
        builder: the diagram.
        scenario: delay and ripple; where the plant has a finer step than the controller, the torque is held too.
        arm: whose drives they are.
        tau: what the controller sends (n,) [N m].
        q: true angles (n,) [rad] on the motors' side.
        offset: of the sampled boxes [s].
        sent: the torque (n,) [N m] that a delay holds in the default context.

    Raises InputError where the ripple needs gear ratios that nobody gives.
    """
    settings, period = scenario.drive, scenario.controller.period
    drive = Drive(tau, tau)

    def through(box: LeafSystem, name: str) -> None:
        drive.boxes[name] = builder.AddNamedSystem(name, box)
        builder.Connect(drive.tau, box.get_input_port(0))
        drive.tau = box.get_output_port(0)

    if scenario.simulation.step < period:
        through(ZeroOrderHold(period, arm.n_joints, offset), "hold")
        drive.sent = drive.tau
        offset -= scenario.simulation.step / 4  # before the hold takes the next, so that its last is one period old
    if periods := settings.delay_periods(period):
        through(Delay(arm.n_joints, periods, period, offset, sent), "torque_delay")
    if settings.ripple > 0:
        ripple = TorqueRipple(*_ripple(scenario, arm))
        through(ripple, "torque_ripple")
        builder.Connect(q, ripple.GetInputPort("q"))
    return drive
