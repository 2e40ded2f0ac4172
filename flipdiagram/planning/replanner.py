"""The rest of a motion planned again from where the tool is, warm-started from the plan that it follows."""

import time
from itertools import product

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning import limits
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.convexification import Convexification, Outcome
from flipdiagram.planning.plan import Plan
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario

FEWEST = 3
"""Contact samples that must be left: with fewer there is nothing to decide any more."""
TOLERANCE = 1e-2
"""θ [rad] within which the last linearisation must have been right; the next replanning corrects what is left."""


class Replanner:
    """Plans the rest of the contact phase, the release and the braking.  The program is built here, once."""

    def __init__(self, scenario: Scenario, arm: ArmModel) -> None:
        self.scenario, self.arm = scenario, arm
        self.horizons = Convexification(scenario, arm, native=True)
        self.horizons.compile()

    def samples_left(self, plan: Plan, elapsed: float) -> int:
        """Contact samples of `plan` that are left at `elapsed` [s] of it."""
        return round((plan.release_time - elapsed) / plan.sampling_time)

    def replan(
        self, state: Floats, plan: Plan, elapsed: float, q: Floats, shift: float = 0.0, begun: float = 0.0
    ) -> Plan:
        """The rest of `plan` from `elapsed` [s] of it on, begun at the state x̂ (6,) of the object instead.

        q (n,) [rad]: joint angles near that state; shift: how far the object sits from the middle of the blade along s
        [m]; begun: when in the motion `plan` itself began [s].  Raises PlanningError where the program has no solution,
        the linearisation is too far off, or too few samples are left.
        """
        begin = time.perf_counter()
        n_contact = self.samples_left(plan, elapsed)
        if n_contact < FEWEST:
            raise PlanningError(f"{n_contact} contact samples are left; valid are at least {FEWEST}")
        horizons = self.horizons
        horizons.program_times.clear()
        horizons.restart(np.asarray(state, dtype=float), q, shift)
        outcomes: list[Outcome] = []
        reason: PlanningError | None = None
        passed = round((begun + elapsed) / plan.sampling_time)
        for samples, flight in self._candidates(n_contact, plan.n_flight, passed):
            try:
                guess = self._guess(state, plan, elapsed, samples, flight)
                outcome = horizons.settle(guess, TOLERANCE, self.scenario.planner.replan_iterations, rescue=False)
                if not outcome.settled:
                    raise PlanningError("the linearisation has not settled")
            except PlanningError as error:
                reason = reason or error
                continue
            outcomes.append(outcome)
        if not outcomes:
            assert reason is not None, "the old plan's own samples are always among the candidates"
            raise reason
        best = min(outcomes, key=lambda outcome: outcome.cost)
        if outcomes[0].cost <= (1 + self.scenario.planner.search_tolerance) * best.cost:
            best = outcomes[0]  # nearest to the old plan
        return horizons.plan_of(best, limits.limit_use(best.motion, self.arm), begin)

    def _candidates(self, n_contact: int, n_flight: int, passed: int) -> list[tuple[int, int]]:
        """Contact and flight samples to try: those of the old plan first, then as far from them as is allowed.

        With the samples that have passed, contact never lasts longer than planner.contact_samples allows: else an arm
        that does not follow would put off the release for ever.
        """
        settings = self.scenario.planner
        steps = range(-settings.replan_search, settings.replan_search + 1)
        near = sorted(product(steps, steps), key=lambda step: abs(step[0]) + abs(step[1]))
        low, high = settings.flight_samples
        return [
            (n_contact + i, n_flight + j)
            for i, j in near
            if (i, j) == (0, 0)
            or (FEWEST <= n_contact + i <= settings.contact_samples[1] - passed and low <= n_flight + j <= high)
        ]

    def _guess(self, state: Floats, plan: Plan, elapsed: float, n_contact: int, n_flight: int) -> Trajectory:
        """The old plan from `elapsed` on, on the samples of the new horizon, moved to begin at the state."""
        layout, dt = self.horizons.layout, plan.sampling_time
        first, left = layout.release - n_contact, self.samples_left(plan, elapsed)
        k = np.arange(n_contact + layout.n_brake + 1)
        pace = left / n_contact if n_contact != left else 1.0
        t = elapsed + dt * np.where(k <= n_contact, k * pace, k - n_contact + left)
        # where the command stops at the release, what counts there is the velocity until then
        x, v, _ = plan.sample(t if plan.n_brake else np.minimum(t, plan.duration * (1 - 1e-6)))
        moving = np.hstack([x, v * np.where(k <= n_contact, pace, 1.0)[:, None]])
        fade = np.linspace(1.0, 0.0, n_contact + 1)[:, None]
        moving[: n_contact + 1] += fade * (np.asarray(state) - moving[0])
        states = np.tile(moving[0], (layout.intervals + 1, 1))
        states[first:] = moving
        inputs = np.zeros((layout.intervals, 3))
        inputs[first:] = np.diff(moving[:, 3:], axis=0) / dt
        return Trajectory(states, inputs, n_contact, n_flight, dt)
