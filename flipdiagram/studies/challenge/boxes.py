"""An entry as a controller in the loop: a function as a Drake System, and the referee that times and checks it."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, Diagram, DiagramBuilder, LeafSystem

from flipdiagram.arrays import Floats
from flipdiagram.blocks.mpc import CHANNELS, COMMANDS
from flipdiagram.diagrams.own_controller import INPUTS
from flipdiagram.diagrams.replacement import WHOLE, fitting
from flipdiagram.errors import EntryError
from flipdiagram.robot.native_arm import native_arm
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.challenge.entry import Entry

Law = Callable[..., Any]
TAKEN = (*COMMANDS, "q", "qd")
"""Signals that a control function takes, in this order, between the time and its memory."""


class FunctionController(LeafSystem):
    """tau = control(t, x_cmd, v_cmd, a_cmd, q, qd, memory), called once for each instant.

    Inputs x_cmd, v_cmd, a_cmd (6,) [m, rad; per s, s^2], q, qd (n,) [rad; per s], output `tau` (n,) [N m].  Its memory
    is the function's own and no state of the Context: a box serves one run.
    """

    def __init__(self, control: Law, memory: dict[str, Any], joints: int, start_time: float) -> None:
        """start_time: when the motion starts [s]; there t is 0."""
        super().__init__()
        self._control, self._memory, self._joints, self._start = control, memory, joints, start_time
        ports = [self.DeclareVectorInputPort(name, CHANNELS if name in COMMANDS else joints) for name in TAKEN]
        self._reads = [port.Eval for port in ports]
        self._last: tuple[float, Floats] | None = None
        self.DeclareVectorOutputPort("tau", joints, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        now = context.get_time()
        if self._last is None or self._last[0] != now:  # a memory must not see an instant twice
            signals = [np.array(read(context)) for read in self._reads]
            self._last = now, self._torque(self._control(now - self._start, *signals, self._memory))
        output.set_value(self._last[1])

    def _torque(self, given: Any) -> Floats:
        try:
            tau = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            raise EntryError(f"control returned {type(given).__name__}; valid are {self._joints} torques") from None
        if tau.shape != (self._joints,):
            raise EntryError(f"control returned an array of shape {tau.shape}; valid is ({self._joints},)")
        return tau


class Referee(LeafSystem):
    """Passes a controller's torque on, and notes the processor time it took: `seconds`, a number each period.

    Inputs are those of the controller, by their sizes, and its torque as `tau_entry` (n,) [N m]; output `tau`.  Raises
    EntryError for a torque that is not finite.
    """

    def __init__(self, taken: Mapping[str, int], joints: int, start_time: float) -> None:
        super().__init__()
        self.seconds: list[float] = []
        self._start = start_time
        ports = [self.DeclareVectorInputPort(name, size) for name, size in taken.items()]
        self._reads = [port.Eval for port in ports]
        self._tau = self.DeclareVectorInputPort("tau_entry", joints).Eval
        self.DeclareVectorOutputPort("tau", joints, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        for read in self._reads:  # sensors and MPC are none of the controller's time
            read(context)
        begin = time.thread_time()  # of the processor: other work on the machine is none of the controller's
        tau = self._tau(context)
        self.seconds.append(time.thread_time() - begin)
        if not np.isfinite(tau).all():
            at = f"joint {int(np.flatnonzero(~np.isfinite(tau))[0]) + 1}, t = {context.get_time() - self._start:.3f} s"
            raise EntryError(f"returned a torque that is not finite ({at})")
        output.set_value(tau)


def refereed(entry: Entry, believed: Scenario, start_time: float) -> tuple[Diagram, Referee]:
    """The controller of an entry with its referee, as `build_loop(replace={"controller": …})` takes it.

    believed: what the entry may know of the world.  start_time: when the motion starts [s].  Raises InputError for a
    System that does not fit.
    """
    arm = native_arm(arm_of(believed))
    if "control" in entry.kinds:
        memory: dict[str, Any] = {"arm": arm, "scenario": believed, "period": believed.controller.period}
        if "reset" in entry.laws:
            entry.laws["reset"](memory)
        system: Any = FunctionController(entry.laws["control"], memory, arm.n_joints, start_time)
    else:
        system = fitting(WHOLE, entry.laws["controller"](believed), {"tau": arm.n_joints}, INPUTS)
    taken = {port.get_name(): port for port in map(system.get_input_port, range(system.num_input_ports()))}
    builder = DiagramBuilder()
    referee = Referee({name: port.size() for name, port in taken.items()}, arm.n_joints, start_time)
    builder.AddSystem(system)
    builder.AddNamedSystem("referee", referee)
    builder.Connect(system.GetOutputPort("tau"), referee.GetInputPort("tau_entry"))
    for name, port in taken.items():
        builder.ExportInput(referee.GetInputPort(name), name)
        builder.ConnectInput(name, port)
    builder.ExportOutput(referee.GetOutputPort("tau"), "tau")
    return builder.Build(), referee
