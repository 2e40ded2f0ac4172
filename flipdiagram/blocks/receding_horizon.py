"""The box MPC in the full sense: it plans the rest of the motion again while the block is on the spatula."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, EventStatus, State

from flipdiagram.arrays import Floats
from flipdiagram.blocks.mpc import CHANNELS, COMMANDS, ModelPredictiveController
from flipdiagram.errors import InputError, PlanningError
from flipdiagram.planning.command import Command, of_object
from flipdiagram.planning.plan import Plan

SAME_PLACE = 1e-9
"""Distance [m, rad] below which the tool stands where the plan begins."""


class Status(IntEnum):
    """What became of the last attempt, output `status`."""

    NONE = 0
    PLANNED = 1
    REPLANNED = 2
    FAILED = 3
    LATE = 4
    OVER = 5
    """Too little of the contact phase is left to plan again."""


COUNTED = (Status.REPLANNED, Status.FAILED, Status.LATE)
"""What attempts to plan again are counted as, outputs `replanned`, `failed`, `late`."""


@dataclass(frozen=True)
class Horizon:
    """The state: the command in force and those that will take over in turn, and how the attempts went.

    solve_time [s]; iterations: programs solved; margin: least distance to the friction angle in the plan [rad], all of
    the last attempt.  counts: attempts of each `COUNTED` status so far.
    """

    commands: tuple[Command, ...] = ()
    status: Status = Status.NONE
    solve_time: float = math.nan
    iterations: int = 0
    margin: float = math.nan
    counts: tuple[int, ...] = (0, 0, 0)

    def at(self, t: float) -> Command | None:
        """The command in force at t [s] since the start of the motion."""
        begun = [command for command in self.commands if t >= command.begins - 1e-9]
        return begun[-1] if begun else next(iter(self.commands), None)

    def after(self, status: Status, **changes: Any) -> Horizon:
        """The state after an attempt that ended so."""
        counts = tuple(count + (status is kind) for count, kind in zip(self.counts, COUNTED, strict=True))
        return replace(self, status=status, counts=counts, **changes)


Replan = Callable[[Floats, Plan, float, Floats, float, float], Plan]
"""(state x̂ (6,), plan, elapsed [s], q (n,), shift [m], begun [s]) -> the rest of it; `planning.Replanner.replan`."""


@dataclass(frozen=True)
class Timing:
    """When the box plans again, all [s]: every `period`, in force one `delay` later.

    deadline: a plan that took longer to compute is dropped; None: none is.  early: how long before the sample the
    event runs, so that it falls between two samples of the controller whatever the rounding.
    """

    period: float
    delay: float
    early: float
    deadline: float | None = None

    def __post_init__(self) -> None:
        if not (self.period > 0 and self.delay >= 0 and self.early > 0):
            raise InputError.of("timing", self, "period and early above 0, delay at least 0")


class RecedingHorizonController(ModelPredictiveController):
    """The MPC that replans: outputs x_cmd, v_cmd, a_cmd (6,), solve_time [s], iterations, status, cone_margin [rad],
    and how many plans were `replanned`, `failed` and `late` so far.

    Inputs: x, v (6,) of the tool and q (n,), read at the events only, so nothing feeds through; optional `shift` (1,)
    [m], where the object sits on the blade along s.  `planner` plans once when the run starts, as in
    `ModelPredictiveController`; from `start_time` on, every `timing.period`, `again` plans the rest of the motion from
    the measured tool (or, measured=False, from the command) as it will be when the new plan takes effect.  The command
    is led over to it as an error decays under the PD's `gains` K_p, K_v.  When that fails or is late the last plan goes
    on.  The whole behaviour is in the Context's state.  Not scalar-convertible: it
    calls a planner of floats.
    """

    def __init__(
        self,
        planner: Callable[[], Plan],
        again: Replan,
        hold: Floats,
        timing: Timing,
        *,
        joints: int,
        gains: tuple[float, float],
        start_time: float = 0.0,
        measured: bool = True,
        fewest: int = 1,
    ) -> None:
        super().__init__(planner, hold, start_time, stand=True)
        self._again, self.timing = again, timing
        self._gains, self._measured, self._fewest = gains, measured, fewest
        for name in ("x", "v"):
            self.input(name, CHANNELS)
        self.input("q", joints)
        self.input("shift", 1)
        first = self.start_time - timing.early
        while first < 0:
            first += timing.period
        self.DeclarePeriodicUnrestrictedUpdateEvent(timing.period, first, self._plan_again)

    def _declare(self) -> None:
        self._state = self.abstract_state("horizon", Horizon(), self.horizon)
        self.outputs(COMMANDS, CHANNELS, lambda t, horizon: self._commands(t, horizon.at(t - self.start_time)))
        self.output("solve_time", 1, lambda horizon: [horizon.solve_time])
        self.output("iterations", 1, lambda horizon: [float(horizon.iterations)])
        self.output("status", 1, lambda horizon: [float(horizon.status)])
        self.output("cone_margin", 1, lambda horizon: [horizon.margin])
        self.output("replanned", 1, lambda horizon: [float(horizon.counts[0])])
        self.output("failed", 1, lambda horizon: [float(horizon.counts[1])])
        self.output("late", 1, lambda horizon: [float(horizon.counts[2])])

    def horizon(self, context: Context) -> Horizon:
        """The state in this system's Context."""
        value: Any = context.get_abstract_state(self._state).get_value()
        return value if isinstance(value, Horizon) else Horizon()

    def plan(self, context: Context) -> Plan | None:
        """The plan in force in this system's Context, None before the run has started."""
        command = self.followed(context)
        return None if command is None else command.plan

    def followed(self, context: Context) -> Command | None:
        """The newest command in this system's Context."""
        commands = self.horizon(context).commands
        return commands[-1] if commands else None

    def _state_of(self, plan: Plan) -> Horizon:
        """The first command, led over from where the tool is held."""
        still = np.tile([*self._hold[:3], 0.0, 0.0, 0.0], (len(plan.states), 1))
        stand = Command(replace(plan, states=still, inputs=np.zeros_like(plan.inputs)))
        command = Command(plan)
        apart = float(np.abs(self._hold[:3] - plan.states[0, :3]).max())
        if apart > SAME_PLACE:
            command = command.led_over_from(stand, self._gains)
        margin = plan.friction_angle - plan.max_sliding_angle
        return Horizon((command,), Status.PLANNED, plan.solve_time, plan.iterations, margin)

    def _plan_again(self, context: Context, state: State) -> EventStatus:
        horizon, now = self.horizon(context), context.get_time() + self.timing.early - self.start_time
        command = horizon.at(now)
        if now < -1e-9 or command is None:
            return EventStatus.DidNothing()
        horizon = replace(horizon, commands=horizon.commands[horizon.commands.index(command) :])
        begins, last = now + self.timing.delay, horizon.commands[-1]
        shift = self.value_in(context, "shift")[0] if self.GetInputPort("shift").HasValue(context) else last.shift
        left = last.plan.release_time - (begins - last.begins)
        if left < self._fewest * last.plan.sampling_time - 1e-9:
            result = horizon.after(Status.OVER)
        else:
            result = self._attempt(context, horizon, now, begins, float(shift))
        state.get_mutable_abstract_state(self._state).set_value(result)
        return EventStatus.Succeeded()

    def _attempt(self, context: Context, horizon: Horizon, now: float, begins: float, shift: float) -> Horizon:
        """A new plan from what will be in force at `begins`; what the tool is off by now it will then still be."""
        command, last = horizon.commands[0], horizon.commands[-1]
        x, v, _ = (np.array(values) for values in last.at(begins))
        if self._measured:
            x_now, v_now, _ = (np.array(values) for values in command.at(now))
            x += self.value_in(context, "x")[:3] - x_now
            v += self.value_in(context, "v")[:3] - v_now
        try:
            q, elapsed = self.value_in(context, "q"), begins - last.begins
            plan = self._again(of_object(x, v, shift), last.plan, elapsed, q, shift, last.begins)
        except PlanningError:
            return horizon.after(Status.FAILED)
        margin = plan.friction_angle - plan.max_sliding_angle
        measured = {"solve_time": plan.solve_time, "iterations": plan.iterations, "margin": margin}
        if self.timing.deadline is not None and plan.solve_time > self.timing.deadline:
            return horizon.after(Status.LATE, **measured)
        following = Command(plan, begins, shift=shift).led_over_from(last, self._gains)
        return horizon.after(Status.REPLANNED, commands=(*horizon.commands, following), **measured)
