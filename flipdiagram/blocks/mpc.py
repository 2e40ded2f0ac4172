"""The box MPC of Fig. 4: plans the motion at the start of the run and plays it out as commands."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from flipdiagram.arrays import Floats
from flipdiagram.blocks._commands import CHANNELS, Commands, declare_commands, standing
from flipdiagram.planning.plan import Plan

__all__ = ["CHANNELS", "ModelPredictiveController"]


class ModelPredictiveController(LeafSystem):
    """Commands of a planned motion: x_cmd, v_cmd, a_cmd (6,) [m, rad], and solve_time [s], status (1 planned, 0 not).

    The plan is part of the Context's state.  The initialisation event of a run, which `Simulator.Initialize` triggers,
    calls `planner` (a MathematicalProgram, eqs. (2)–(5)) unless the state holds a plan already (`set_plan`).  Until
    `start_time` [s] the commands hold the start of the plan, or `hold` (6,) while there is none.  Outputs depend on
    time and state, so nothing feeds through.  stand: hold `hold` until then even with a plan, where the tool stands
    elsewhere than the plan begins.

    Raises PlanningError from the initialisation where there is no motion.  Not scalar-convertible: it calls a
    planner of floats.
    """

    def __init__(self, planner: Callable[[], Plan], hold: Floats, start_time: float = 0.0, stand: bool = False) -> None:
        super().__init__()
        self._planner = planner
        self._stand = stand
        self._hold, self.start_time = standing(hold, start_time)
        self._state = self.DeclareAbstractState(Value[object]())
        self.DeclareInitializationUnrestrictedUpdateEvent(self._plan_once)
        state = {self.abstract_state_ticket(self._state)}
        declare_commands(self, self._commands, {self.time_ticket(), *state})
        self.DeclareVectorOutputPort("solve_time", 1, self._calc_solve_time, state)
        self.DeclareVectorOutputPort("status", 1, self._calc_status, state)

    def plan(self, context: Context) -> Plan | None:
        """The plan in this system's Context, None before the run has started."""
        value = context.get_abstract_state(int(self._state)).get_value()
        return value if isinstance(value, Plan) else None

    def set_plan(self, context: Context, plan: Plan) -> None:
        """Put a plan into this system's Context; the run then starts with it instead of solving."""
        context.get_mutable_abstract_state(int(self._state)).set_value(plan)

    def _plan_once(self, context: Context, state: State) -> EventStatus:
        if self.plan(context) is None:
            state.get_mutable_abstract_state(int(self._state)).set_value(self._planner())
        return EventStatus.Succeeded()

    def _commands(self, context: Context) -> Commands:
        x, v, a = self._hold.copy(), np.zeros(CHANNELS), np.zeros(CHANNELS)
        plan = self.plan(context)
        if plan is not None and not (self._stand and context.get_time() < self.start_time - 1e-9):
            x[:3], v[:3], a[:3] = plan.at(context.get_time() - self.start_time)
        return x, v, a

    def _calc_solve_time(self, context: Context, output: BasicVector) -> None:
        plan = self.plan(context)
        output[0] = math.nan if plan is None else plan.solve_time

    def _calc_status(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self.plan(context) is not None)
