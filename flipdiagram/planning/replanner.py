"""The rest of a motion planned again from where the tool is, warm-started from the plan that it follows."""

from __future__ import annotations

import time

import numpy as np

from flipdiagram.arm import ArmModel
from flipdiagram.contact import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning import limits
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.convexification import Convexification
from flipdiagram.planning.finish import plan_of
from flipdiagram.planning.plan import Plan
from flipdiagram.scenario import Scenario

FEWEST = 3
"""Contact samples that must be left: with fewer there is nothing to decide any more."""
TOLERANCE = 1e-2
"""θ [rad] within which the last linearisation must have been right; the next replanning corrects what is left."""


class Replanner:
    """Plans the rest of the contact phase, the release and the braking.  The program is built here, once."""

    def __init__(self, scenario: Scenario, arm: ArmModel) -> None:
        self.scenario, self.arm = scenario, arm
        self.horizons = Convexification(scenario, arm, native=True)

    def samples_left(self, plan: Plan, elapsed: float) -> int:
        """Contact samples of `plan` that are left at `elapsed` [s] of it."""
        return round((plan.release_time - elapsed) / plan.sampling_time)

    def replan(self, state: Floats, plan: Plan, elapsed: float, q: Floats, shift: float = 0.0) -> Plan:
        """The rest of `plan` from `elapsed` [s] of it on, begun at the state x̂ (6,) of the object instead.

        q (n,) [rad]: joint angles near that state; shift: how far the object sits from the middle of the blade along s
        [m].  Raises PlanningError where the program has no solution, the linearisation is too far off, or too few
        samples are left.
        """
        begin = time.perf_counter()
        n_contact = self.samples_left(plan, elapsed)
        if n_contact < FEWEST:
            raise PlanningError(f"{n_contact} contact samples are left; valid are at least {FEWEST}")
        horizons = self.horizons
        horizons.program_times.clear()
        horizons.restart(np.asarray(state, dtype=float), q, shift)
        guess, most = self._guess(state, plan, elapsed, n_contact), self.scenario.planner.replan_iterations
        outcome = horizons.settle(guess, TOLERANCE, most, rescue=False)
        if not outcome.settled:
            raise PlanningError("the linearisation has not settled")
        uses = limits.limit_use(outcome.motion, self.arm)
        return plan_of(outcome, horizons, {kind: float(use.max()) for kind, use in uses.items()}, begin)

    def _guess(self, state: Floats, plan: Plan, elapsed: float, n_contact: int) -> Trajectory:
        """The old plan from `elapsed` on, on the samples of the new horizon, moved to begin at the state."""
        layout, dt = self.horizons.layout, plan.sampling_time
        first = layout.release - n_contact
        t = elapsed + dt * np.arange(n_contact + layout.n_brake + 1)
        x, v, _ = plan.sample(t)
        moving = np.hstack([x, v])
        fade = np.linspace(1.0, 0.0, n_contact + 1)[:, None]
        moving[: n_contact + 1] += fade * (np.asarray(state) - moving[0])
        states = np.tile(moving[0], (layout.intervals + 1, 1))
        states[first:] = moving
        inputs = np.zeros((layout.intervals, 3))
        inputs[first:] = np.diff(moving[:, 3:], axis=0) / dt
        return Trajectory(states, inputs, n_contact, plan.n_flight, dt)
