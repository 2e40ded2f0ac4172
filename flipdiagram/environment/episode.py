"""A flip that is driven from outside: torques for a few periods of the controller, a look at the sensors, the next."""

from functools import cache

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from flipdiagram.arrays import Floats
from flipdiagram.blocks.mpc import COMMANDS
from flipdiagram.diagrams.loop import Loop, build_loop
from flipdiagram.errors import PlanningError
from flipdiagram.flips.flight import plan_drawn_flight
from flipdiagram.planning.plan import Plan
from flipdiagram.simulation.events import CONTACT_FORCE
from flipdiagram.simulation.recording import Recording
from flipdiagram.simulation.simulate import advance, end_of, recording_of
from flipdiagram.studies.challenge.suites import World, load_suites

HOLD = 0.1
"""Seconds for which the start is to be held before the motion starts; the challenge itself holds it for 1 s."""
TABLE_ON_BLOCK = slice(3, 6)
"""In the contact wrench of a cell."""


@cache
def worlds_of(suite: str) -> tuple[World, ...]:
    """The public worlds of a suite of the challenge, in its order."""
    return tuple(load_suites().worlds([suite]))


@cache
def plan_of(suite: str, index: int) -> Plan:
    """The motion planned for a world by what is known of it, the same in both engines.

    Raises PlanningError where there is none.
    """
    planned, reason = plan_drawn_flight(worlds_of(suite)[index].believed("drake", {}))
    if planned is None:
        raise PlanningError(str(reason))
    return Plan.from_json(planned, "plan")


class Episode:
    """One flip in a world of the challenge.

    Drake's Simulator stands half a period after the last sample: its state is that of the next one, whose torque is
    not taken yet.  So the sensors are read as at the next sample, and the torque that is then given acts from there.
    """

    def __init__(self, world: World, engine: str, plan: Plan) -> None:
        self._source, controller = _torque_source()
        truth = world.truth(engine, {"simulation.start": "hold", "simulation.hold_time": HOLD})
        self.plan = plan
        self.loop: Loop = build_loop(truth, record=True, replace={"controller": controller})
        assert self.loop.mpc is not None
        self._context = self.loop.context(plan)
        self._simulator = Simulator(self.loop.diagram, self._context)
        self._commands = self.loop.mpc.CreateDefaultContext()
        self.loop.mpc.set_plan(self._commands, plan)
        self._contact = self.loop.logs["contact_wrench"]
        self.samples = 0
        """How many periods have been simulated."""
        self.landed = False
        """Whether the table has touched the block since the motion started."""

    @property
    def period(self) -> float:
        """Of the controller [s]."""
        return self.loop.scenario.controller.period

    @property
    def time(self) -> float:
        """Of the next sample [s], 0 where the motion starts."""
        return self.samples * self.period - HOLD

    @property
    def over(self) -> bool:
        """Whether a simulation of this motion ends here."""
        return self.time >= end_of(self.loop.scenario, self.plan) - HOLD - self.period / 2

    @property
    def tool(self) -> Floats:
        """y, z [m], theta [rad] of the true tool (3,)."""
        return self.loop.arm.task_position(self._value(self.loop.cell.q_link))[:3]

    def seen(self) -> dict[str, Floats]:
        """q, qd as the sensors show them (n,) [rad, rad/s] and the commands (6,) [m, rad; per s, s^2] of the sample."""
        mpc = self.loop.mpc
        assert mpc is not None
        self._commands.SetTime(self.samples * self.period)
        commands = {name: np.array(mpc.GetOutputPort(name).Eval(self._commands)) for name in COMMANDS}
        return {"q": self._value(self.loop.sensing.q), "qd": self._value(self.loop.sensing.qd), **commands}

    def apply(self, tau: Floats, periods: int) -> None:
        """Simulate some periods with torques tau (n,) [N m]; raises SimulationError where that diverges."""
        self._source.get_mutable_source_value(self._source.GetMyMutableContextFromRoot(self._context)).set_value(tau)
        begin, self.samples = self.samples, self.samples + periods
        advance(self._simulator, (self.samples - 0.5) * self.period)
        lead = max(begin, round(HOLD / self.period))
        touching = self._contact.FindLog(self._context).data()[TABLE_ON_BLOCK, lead : self.samples]
        self.landed |= bool((np.linalg.norm(touching, axis=0) > CONTACT_FORCE).any())

    def recording(self) -> Recording:
        """What has been simulated so far."""
        return recording_of(self.loop, self._context, self.plan)

    def _value(self, port: OutputPort) -> Floats:
        context: Context = port.get_system().GetMyContextFromRoot(self._context)
        return np.array(port.Eval(context))


def _torque_source(joints: int = 6) -> tuple[ConstantVectorSource, Diagram]:
    """A source of torques, and the controller of the loop that it is."""
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource(np.zeros(joints)))
    builder.ExportOutput(source.get_output_port(), "tau")
    return source, builder.Build()
