"""The rest of a motion planned again from where the tool is, warm-started from the plan that it follows."""

import math
import time
from itertools import product
from typing import Protocol

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
ROUNDING = 1e-6
"""Of a sample: a time that is a sample but for rounding is one."""
TOLERANCE = 1e-2
"""θ [rad] within which the last linearisation must have been right; the next replanning corrects what is left."""


class Replanning(Protocol):
    """What plans the rest of a motion again, and how many contact samples must be left for it."""

    fewest: int

    def replan(
        self, state: Floats, plan: Plan, elapsed: float, q: Floats, shift: float = 0.0, begun: float = 0.0
    ) -> Plan:
        """See `Replanner.replan`."""


class Replanner:
    """Plans the rest of the contact phase, the release and the braking.  The program is built here, once."""

    fewest = FEWEST

    def __init__(self, scenario: Scenario, arm: ArmModel) -> None:
        self.scenario, self.arm = scenario, arm
        self.horizons = Convexification(scenario, arm, native=True)
        self.horizons.compile()

    def replan(
        self, state: Floats, plan: Plan, elapsed: float, q: Floats, shift: float = 0.0, begun: float = 0.0
    ) -> Plan:
        """The rest of `plan` from `elapsed` [s] of it on, begun at the state x̂ (6,) of the object instead.

        q (n,) [rad]: joint angles near that state; shift: how far the object sits from the middle of the blade along s
        [m]; begun: when in the motion `plan` itself began [s].  Raises PlanningError where the program has no solution,
        the linearisation is too far off, or too few samples are left.
        """
        begin = time.perf_counter()
        done, passed = inside(plan, elapsed)
        n_contact = plan.n_contact - done
        if n_contact < FEWEST:
            raise PlanningError(f"{n_contact} contact samples are left; valid are at least {FEWEST}")
        horizons = self.horizons
        horizons.program_times.clear()
        horizons.restart(np.asarray(state, dtype=float), q, shift, plan.limit_divisors)
        outcomes: list[Outcome] = []
        reason: PlanningError | None = None
        all_done = math.floor((begun + elapsed) / plan.sampling_time + ROUNDING)
        for samples, flight in self._candidates(n_contact, plan.n_flight, all_done):
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
        layout, dt, (done, passed) = self.horizons.layout, plan.sampling_time, inside(plan, elapsed)
        first, left = layout.release - n_contact, plan.n_contact - done
        k = np.arange(n_contact + layout.n_brake + 1)
        since = np.maximum(dt * k - passed, 0.0)
        new, old = (dt * count - passed for count in (n_contact, left))
        pace = old / new
        t = elapsed + np.where(k <= n_contact, since * pace, since - new + old)
        # where the command stops at the release, what counts there is the velocity until then
        x, v, _ = plan.sample(t if plan.n_brake else np.minimum(t, plan.duration * (1 - 1e-6)))
        moving = np.hstack([x, v * np.where(k <= n_contact, pace, 1.0)[:, None]])
        fade = (1.0 - since[: n_contact + 1] / new)[:, None]
        moving[: n_contact + 1] += fade * (np.asarray(state) - moving[0])
        states = np.tile(moving[0], (layout.intervals + 1, 1))
        states[first:] = moving
        # the waiting samples lead up to it at constant speed, as in what the program gives
        states[:first, :3] -= dt * (first - np.arange(first))[:, None] * moving[0, 3:]
        inputs = np.zeros((layout.intervals, 3))
        inputs[first:] = np.diff(moving[:, 3:], axis=0) / np.diff(since)[:, None]
        return Trajectory(states, inputs, n_contact, n_flight, dt, passed, before(plan, done, passed))


def inside(plan: Plan, elapsed: float) -> tuple[int, float]:
    """Samples of a plan that have ended `elapsed` [s] after it began, and how much of the next one has passed [s]."""
    since, dt = elapsed + plan.passed, plan.sampling_time
    done = math.floor(since / dt + ROUNDING)
    passed = since - done * dt
    return done, passed if passed > ROUNDING * dt else 0.0


def before(plan: Plan, done: int, passed: float) -> Floats | None:
    """The acceleration (3,) that goes on: within a sample its own, at its beginning that of the sample before."""
    last = done if passed else done - 1
    return plan.inputs[last] if last >= 0 else None
