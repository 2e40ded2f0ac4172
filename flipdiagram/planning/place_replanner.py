"""The rest of a carrying planned again from where the tool is; what follows, tilt and retreat, stays as it was."""

import time
from dataclasses import replace

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.placing import Placer
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.replanner import FEWEST, before, inside
from flipdiagram.planning.segment import segment
from flipdiagram.theory import contact


class PlaceReplanner:
    """Plans the rest of the carrying, of a motion with `after_carry` contact samples after it."""

    def __init__(self, placer: Placer, after_carry: int) -> None:
        self._placer, self._after = placer, after_carry
        self.fewest = after_carry + FEWEST

    def replan(
        self, state: Floats, plan: Plan, elapsed: float, q: Floats, shift: float = 0.0, begun: float = 0.0
    ) -> Plan:
        """As `Replanner.replan`, whose arguments these are; the joints are not looked at again."""
        begin = time.perf_counter()
        (done, passed), dt = inside(plan, elapsed), plan.sampling_time
        left = plan.n_contact - self._after - done
        if left < FEWEST:
            raise PlanningError(f"{left} samples of the carrying are left; valid are at least {FEWEST}")
        states, inputs = plan.states[done : done + left + 1].copy(), plan.inputs[done : done + left]
        x, v, _ = plan.sample(elapsed)
        states += np.linspace(1.0, 0.0, left + 1)[:, None] * (state - np.append(x, v))
        states[0] = state
        layout, guess = Layout(left, 0), Trajectory(states, inputs, left, 1, dt, passed, before(plan, done, passed))
        states, inputs = segment(state, states[-1, :3], self._placer.carrying(layout, shift), layout, dt, guess)
        return replace(
            plan,
            n_contact=plan.n_contact - done,
            states=np.vstack([states, plan.states[done + left + 1 :]]),
            inputs=np.vstack([inputs, plan.inputs[done + left :]]),
            max_sliding_angle=float(np.abs(contact.sliding_angle(inputs[:, :2], states[:-1, 2])).max()),
            iterations=1,
            solve_time=time.perf_counter() - begin,
            passed=passed,
        )
