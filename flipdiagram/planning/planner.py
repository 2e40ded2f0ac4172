"""From a scenario to a Plan: a search over the horizons, each settled by successive convexification."""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning import constraints, limits
from flipdiagram.planning.convexification import Convexification, Outcome
from flipdiagram.planning.plan import Plan
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario

SEARCH_ANGLE_TOLERANCE = 0.01
"""θ tolerance [rad] while horizons are compared; the chosen one is then settled to the scenario's own."""
SEARCH_ITERATIONS = 8
AT_LIMIT = 0.9
"""Use of a joint limit from which an infeasible plan mentions it."""
CHECKS_PER_SAMPLE = 4
"""The joint limits of the finished motion are checked this many times per ΔT."""
LONGEST = 120.0
"""Seconds of computing, without those of other processes, after which it gives up; a plan takes one to ten."""
MASS_SEARCH, MASS_TOLERANCE = 20.0, 0.03
"""Seconds of computing after which the search for the largest mass ends, and how near it shall come, relatively."""
CORRECTIONS = 2
"""Times that a joint limit exceeded between samples is fed back, as a smaller limit."""


class Planner:
    """Plans the flip of one scenario.  The program is built here, once; `plan` searches and solves."""

    def __init__(
        self, scenario: Scenario, arm: ArmModel | None = None, progress: Callable[[str], object] = lambda text: None
    ) -> None:
        self.scenario, self._progress = scenario, progress
        self.arm = arm or arm_of(scenario)
        self.horizons = Convexification(scenario, self.arm)
        self._failed: Outcome | None = None

    @property
    def q_start(self) -> Floats:
        """Joint angles at the start of the motion [rad]; raises PlanningError where the arm cannot be there."""
        return self.horizons.q_start

    def plan(self) -> Plan:
        """The best motion over the horizons allowed; raises PlanningError naming the constraint that cannot be met.

        Where that is the torque that the object costs it names the largest mass that it found a motion for.
        """
        self._failed = None
        try:
            return self._plan(LONGEST)
        except PlanningError as error:
            if limits.TORQUE not in str(error) or not self._object_is_too_heavy():
                raise
            raise PlanningError(f"{error}; {self._largest_mass()}") from None

    def _plan(self, longest: float) -> Plan:
        """`plan`, in so many seconds of computing, without the search for the largest mass."""
        begin = time.perf_counter()
        self.horizons.program_times.clear()
        self.horizons.deadline = time.process_time() + longest
        self.horizons.allowed = limits.Allowed.of(self.arm, self.scenario)
        self._check_start()
        best = self._search()
        settings = self.scenario.planner
        for _ in range(CORRECTIONS + 1):
            best = self.horizons.settle(best.point, settings.angle_tolerance, settings.max_iterations)
            self._failed = best
            if best.shortfall or not best.settled:
                raise PlanningError(self._reason(best))
            uses = self._limit_use(best)
            kind = max(uses, key=lambda kind: float(uses[kind].max()))
            if uses[kind].max() <= 1:
                return self.horizons.plan_of(best, uses, begin)
            self.horizons.allowed = self.horizons.allowed.tightened(uses)
        use, joint = uses[kind].max(), self.arm.joint_names[uses[kind].argmax()]
        raise PlanningError(f"{kind} cannot be met: joint {joint} would need {use:.2f} x its limit between samples")

    def _search(self) -> Outcome:
        """Flight samples by steps of shrinking size, then the shortest contact phase that costs hardly more."""
        settings = self.scenario.planner
        (fewest, most), (low, high) = settings.contact_samples, settings.flight_samples
        tried: dict[tuple[int, int], Outcome] = {}
        nearest: Outcome | None = None

        def attempt(n_contact: int, n_flight: int) -> Outcome:
            nonlocal nearest
            key = (n_contact, n_flight)
            if key not in tried:
                if nearest is None or nearest.shortfall:
                    point = self.horizons.guess(n_contact, n_flight)
                else:
                    point = replace(nearest.point, n_contact=n_contact, n_flight=n_flight)
                tried[key] = self.horizons.settle(point, SEARCH_ANGLE_TOLERANCE, SEARCH_ITERATIONS)
                if nearest is None or tried[key].rank < nearest.rank:
                    nearest = tried[key]
                found = "no motion yet" if nearest.shortfall else f"best J = {nearest.cost:.3f}"
                self._progress(f"planning: {len(tried)} horizons tried, {found}")
            return tried[key]

        best = attempt(most, (low + high) // 2)
        step = max(1, (high - low) // 4)
        while step:
            here = best.point.n_flight
            around = [n for n in (here - step, here + step) if low <= n <= high]
            better = min((attempt(most, n) for n in around), key=lambda o: o.rank, default=best)
            if better.rank < best.rank:
                best = better
            else:
                step //= 2
        if best.shortfall:
            return best
        allowed = best.cost * (1 + settings.search_tolerance)
        enough, short = most, fewest - 1
        while enough - short > 1:
            middle = (enough + short) // 2
            outcome = attempt(middle, best.point.n_flight)
            if not outcome.shortfall and outcome.settled and outcome.cost <= allowed:
                enough = middle
            else:
                short = middle
        return tried[enough, best.point.n_flight]

    def _object_is_too_heavy(self) -> bool:
        """Whether the arm could follow the motion that failed without the object."""
        if self._failed is None:
            return False
        states, inputs = self.horizons.moving(self._failed.linearised_at)  # where it could follow
        bare = limits.limit_use(self.horizons.motion.follow(states, inputs, self.q_start), self.arm)
        return bool(np.all(bare[limits.TORQUE] <= self.horizons.allowed.shares(self.arm)[limits.TORQUE]))

    def _largest_mass(self) -> str:
        """In words the largest mass for which it finds a motion, by bisection."""
        low, high, end = 0.0, self.scenario.object.mass, time.process_time() + MASS_SEARCH
        while high - low > MASS_TOLERANCE * high and (left := end - time.process_time()) > 0:
            mass = (low + high) / 2
            # a file of the user's own weighs what it weighs: a box of the same size in its place
            lighter = self.scenario.with_overrides({"object.mass": mass, "object.file": None})
            try:
                Planner(lighter, self.arm)._plan(left)
            except PlanningError:
                high = mass
            else:
                low = mass
        if not low:
            return f"largest mass for this arm: less than {high:.2g} kg"
        digit = 10.0 ** (math.floor(math.log10(low)) - 1)  # rounded down: what it says shall do
        return f"largest mass for this arm: about {math.floor(low / digit) * digit:.2g} kg"

    def _check_start(self) -> None:
        """The start itself must be reachable, and the blade clear of the table there."""
        self.q_start  # noqa: B018 - raises where the arm cannot be there
        geometry = constraints.Geometry.of(self.scenario)
        blade = self.scenario.task.start_z - geometry.half_thickness - geometry.blade_thickness
        gap, wanted = blade - self.scenario.table.height, self.scenario.planner.table_clearance
        if gap < wanted:
            raise PlanningError(
                f"{constraints.CLEARANCE} cannot be met: at the start the blade is {gap:.3f} m above the table"
                f" (height {self.scenario.table.height} m); wanted {wanted} m"
            )

    def _reason(self, outcome: Outcome) -> str:
        if not outcome.slack:
            return (
                f"the motion has not settled within {self.scenario.planner.max_iterations} linearisations"
                " (planner.max_iterations)"
            )
        name = max(outcome.slack, key=lambda group: outcome.slack[group])
        others = ", ".join(sorted(set(outcome.slack) - {name}))
        uses, joints = limits.limit_use(outcome.motion, self.arm), self.arm.joint_names
        text = f"no motion found: {name} cannot be met"
        if name in uses:
            use, share = uses[name], self.horizons.allowed.shares(self.arm)[name]
            j = int(np.argmax(use / share))
            text += f" (joint {joints[j]} would need {use[j]:.2f} x its limit; the plan may use {share[j]:.2f})"
            slower = "; valid may be a longer contact, planner.contact_samples"
            text += slower if name == limits.SPEED else ""
        else:
            text += f" (short by {outcome.slack[name]:.3g})"
            full = {kind: joints[use.argmax()] for kind, use in uses.items() if use.max() > AT_LIMIT}
            at_limit = " and ".join(f"joint {joint} is at its {kind}" for kind, joint in full.items())
            text += f" while {at_limit}" if at_limit else ""
        return text + (f"; also short: {others}" if others else "")

    def _limit_use(self, outcome: Outcome) -> dict[str, Floats]:
        """`limits.limit_use` of the motion on a grid finer than ΔT."""
        states, inputs = self.horizons.moving(outcome.point)
        tau = np.arange(CHECKS_PER_SAMPLE)[:, None] * (outcome.point.sampling_time / CHECKS_PER_SAMPLE)
        moves = states[:-1, None, :].repeat(CHECKS_PER_SAMPLE, axis=1)
        held = inputs[:, None, :].repeat(CHECKS_PER_SAMPLE, axis=1)
        moves[..., :3] += moves[..., 3:] * tau + held * tau**2 / 2
        moves[..., 3:] += held * tau
        dense = np.vstack([moves.reshape(-1, 6), states[-1]])
        motion = self.horizons.motion.follow(
            dense, held.reshape(-1, 3), self.q_start, CHECKS_PER_SAMPLE * outcome.point.n_contact
        )
        return limits.limit_use(motion, self.arm)


def plan_motion(scenario: Scenario, progress: Callable[[str], object] = lambda text: None) -> Plan:
    """Plan the flip of a scenario, telling `progress` how far it is.

    Raises PlanningError naming the constraint that cannot be met.
    """
    return Planner(scenario, progress=progress).plan()
