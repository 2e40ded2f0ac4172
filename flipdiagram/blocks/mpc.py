"""The box MPC of Fig. 4: plans the motion at the start of the run and plays it out as commands."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, EventStatus, State

from flipdiagram.arrays import Floats
from flipdiagram.blocks._checks import channels
from flipdiagram.blocks.block import Block
from flipdiagram.planning.command import Command
from flipdiagram.planning.plan import Plan

CHANNELS = 6
"""Task coordinates (y, z, θ, x, pitch, yaw): the MPC moves the first three, the others are held."""
COMMANDS = ("x_cmd", "v_cmd", "a_cmd")
"""Outputs of an MPC."""


class ModelPredictiveController(Block):
    """Commands of a planned motion: x_cmd, v_cmd, a_cmd (6,) [m, rad], and solve_time [s], status (1 planned, 0 not).

    The plan is part of the Context's state.  The initialisation event of a run, which `Simulator.Initialize` triggers,
    calls `planner` (a MathematicalProgram, eqs. (2)–(5)) unless the state holds a plan already (`set_plan`).  Until
    `start_time` [s] the commands hold the start of the plan, or `hold` (6,) while there is none.  Outputs depend on
    time and state, so nothing feeds through.  stand: hold `hold` until then even with a plan, where the tool stands
    elsewhere than the plan begins.  Not scalar-convertible: it calls a planner of floats.

    Raises PlanningError from the initialisation where there is no motion.
    """

    def __init__(self, planner: Callable[[], Plan], hold: Floats, start_time: float = 0.0, stand: bool = False) -> None:
        super().__init__()
        self._planner, self._stand = planner, stand
        self._hold = channels("hold", hold, CHANNELS, minimum=-np.inf)
        self.start_time = float(channels("start_time", start_time, 1)[0])
        self.DeclareInitializationUnrestrictedUpdateEvent(self._plan_once)
        self._declare()

    def _declare(self) -> None:
        """The state, and the outputs of it."""
        self._state = self.abstract_state("plan", None, self.plan)
        self.outputs(COMMANDS, CHANNELS, self._commands)
        self.output("solve_time", 1, lambda plan: [math.nan if plan is None else plan.solve_time])
        self.output("status", 1, lambda plan: [float(plan is not None)])

    def plan(self, context: Context) -> Plan | None:
        """The plan in this system's Context, None before the run has started."""
        value = context.get_abstract_state(self._state).get_value()
        return value if isinstance(value, Plan) else None

    def followed(self, context: Context) -> Plan | Command | None:
        """What the tool follows in this system's Context, None before the run has started."""
        return self.plan(context)

    def set_plan(self, context: Context, plan: Plan) -> None:
        """Put a plan into this system's Context; the run then starts with it instead of solving."""
        context.get_mutable_abstract_state(self._state).set_value(self._state_of(plan))

    def _plan_once(self, context: Context, state: State) -> EventStatus:
        if self.plan(context) is None:
            state.get_mutable_abstract_state(self._state).set_value(self._state_of(self._planner()))
        return EventStatus.Succeeded()

    def _state_of(self, plan: Plan) -> Any:
        """The state at the start of a run with this plan."""
        return plan

    def _commands(self, t: float, plan: Plan | Command | None) -> tuple[Floats, Floats, Floats]:
        x, v, a = self._hold.copy(), np.zeros(CHANNELS), np.zeros(CHANNELS)
        if plan is not None and not (self._stand and t < self.start_time - 1e-9):
            x[:3], v[:3], a[:3] = plan.at(t - self.start_time)
        return x, v, a
