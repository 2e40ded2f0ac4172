"""From a settled horizon to a Plan."""

from __future__ import annotations

import time

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.planning.convexification import Convexification, Outcome
from flipdiagram.planning.plan import Plan
from flipdiagram.theory import contact


def moving(outcome: Outcome, horizons: Convexification) -> tuple[Floats, Floats]:
    """States and inputs without the waiting samples."""
    first = horizons.layout.release - outcome.point.n_contact
    return outcome.point.states[first:], outcome.point.inputs[first:]


def plan_of(outcome: Outcome, horizons: Convexification, limit_use: dict[str, float], begin: float) -> Plan:
    """The plan of an outcome; begin: when the planning began, of time.perf_counter() [s]."""
    point, scenario = outcome.point, horizons.scenario
    states, inputs = moving(outcome, horizons)
    k = np.arange(point.n_contact)
    phi = [contact.sliding_angle(inputs[k, :2], states[at, 2]) for at in (k, k + 1)]
    return Plan(
        sampling_time=point.sampling_time,
        n_contact=point.n_contact,
        n_flight=point.n_flight,
        n_brake=horizons.layout.n_brake,
        states=states,
        inputs=inputs,
        cost=outcome.cost,
        residual=outcome.solution.residual,
        max_sliding_angle=float(np.max(np.abs(phi))),
        friction_angle=float(contact.friction_angle(scenario.object.friction)),
        limit_use=limit_use,
        solver=scenario.planner.solver,
        iterations=len(horizons.program_times),
        solve_time=time.perf_counter() - begin,
        program_times=tuple(horizons.program_times),
    )
