"""What a worker does: plan a motion, fly a trial.  Scenarios and plans travel as data, diagrams do not."""

import logging
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.diagrams.controller import nominal_inertia
from flipdiagram.errors import (
    EntryError,
    FlipdiagramError,
    InputError,
    NoEquilibriumError,
    PlanningError,
    SimulationError,
)
from flipdiagram.files import versions
from flipdiagram.flips.flip import SOURCES, Flip, code_version
from flipdiagram.flips.outcome import Outcome
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.planning.planner import Planner
from flipdiagram.planning.replanner import Replanner
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.bending import bending
from flipdiagram.simulation.recording_files import save_recording
from flipdiagram.simulation.replans import replans
from flipdiagram.simulation.simulate import Run, simulate

KINDS: dict[type[FlipdiagramError], str] = {
    SimulationError: "diverged",
    PlanningError: "no plan",
    NoEquilibriumError: "no start",
    EntryError: "crashed",
}
"""Outcome by what a simulation raised."""
Planned = tuple[str | None, str | None]
"""(plan as JSON, None) or (None, why there is none)."""


@dataclass(frozen=True)
class Flight:
    """One flip to be flown: what is true, and what planner and controller believe.

    `trial` and `architecture` together name its row; seed, values and overrides are kept there.
    """

    trial: int | str
    truth: Scenario
    believed: Scenario
    architecture: str
    seed: int = 0
    values: tuple[Any, ...] = ()
    overrides: Mapping[str, Any] = field(default_factory=dict)
    recording: Path | None = None
    """File for its signals."""

    @property
    def plan_key(self) -> str:
        """Name of the motion that is needed."""
        return Flip(self.believed, self.architecture).plan_key

    @property
    def motion(self) -> str:
        """Flights with equal ones fly the same plan."""
        return self.plan_key

    def flight(self) -> "Flight":
        """Itself, as an `order.Order`."""
        return self


@dataclass(frozen=True)
class Landed:
    """What became of a flight."""

    outcome: Outcome
    seconds: float
    code: str
    versions: dict[str, str]
    host: str


@dataclass(frozen=True)
class Work:
    """The two functions that workers call; importable by name, as only their names travel.

    An InputError that `plan` raises ends everything; what else either raises is the trial's outcome, `crashed`.
    """

    plan: Callable[[Scenario], Planned]
    fly: Callable[[Flight, str], Landed]
    """Takes the plan as JSON."""


def plan_flight(believed: Scenario) -> Planned:
    """Plan a motion, or say why there is none."""
    try:
        return plan_motion(believed).to_json(), None
    except (PlanningError, SimulationError) as error:
        return None, str(error)


def plan_drawn_flight(believed: Scenario) -> Planned:
    """As `plan_flight`, for a scenario drawn at random: one that cannot be is no reason to stop."""
    try:
        return plan_flight(believed)
    except InputError as error:
        return None, str(error)


def fly_flight(flight: Flight, plan: str) -> Landed:
    """Fly a trial and write its recording if it names one; what goes wrong with the physics is its outcome."""
    scenario, begin = with_inertia_of(flight.truth, flight.believed), time.perf_counter()
    outcome = fly(scenario, flight.architecture, _plan(plan), flight.recording, flight.believed)
    return Landed(outcome, time.perf_counter() - begin, *provenance())


def with_inertia_of(truth: Scenario, believed: Scenario) -> Scenario:
    """The true scenario with the controller's M_n of the arm as it is believed to be."""
    if truth.controller.nominal_inertia is not None or believed.arm == truth.arm:
        return truth
    return truth.with_overrides({"controller.nominal_inertia": _inertia(believed)})


def fly(
    scenario: Scenario,
    architecture: str,
    plan: Plan,
    recording: Path | None = None,
    believed: Scenario | None = None,
    simulated: Callable[[], Run] | None = None,
) -> Outcome:
    """Run one flip here; writes its signals where a file for them is named.

    believed: by what an MPC plans again.  simulated: what simulates it, by default `simulate`.
    """
    _quieten_drake()
    planned_by = believed or scenario
    try:
        if simulated is not None:
            run = simulated()
        else:
            run = simulate(scenario, architecture, plan, replanner=lambda: Replanner(planned_by, arm_of(planned_by)))
    except FlipdiagramError as error:
        kind = KINDS.get(type(error), "refused")
        return Outcome(None, f"{kind}: {error}", plan.summary())
    measured = metrics.measure(run.recording)
    if recording is not None:
        save_recording(run.recording, measured, recording, Flip(scenario, architecture).key)
    torque_use = float(np.max(np.array(measured.max_torque_Nm) / run.recording["tau"].attrs["limit"]))
    again, bent = replans(run.recording), bending(run.recording)
    planned = plan.summary() | ({} if again is None else {"replanning": again})
    if bent is not None:
        planned["bending"] = bent | {"real_time_factor": run.real_time_factor}
    return Outcome(measured, measured.failure, planned, torque_use)


def provenance() -> tuple[str, dict[str, str], str]:
    """Code, versions and host of this process."""
    return code_version(SOURCES), versions() | {"numpy": np.__version__}, socket.gethostname()


@cache
def _quieten_drake() -> None:
    # a study that compares solvers uses deprecated ones on purpose; once a process is once too often
    logging.getLogger("drake").addFilter(lambda record: "DRAKE_DEPRECATED" not in record.getMessage())


@lru_cache(maxsize=4)
def _plan(text: str) -> Plan:
    return Plan.from_json(text, "stored plan")


@lru_cache(maxsize=16)
def _inertia(believed: Scenario) -> tuple[float, ...]:
    arm = arm_of(believed)
    unscaled = believed.with_overrides({"controller.nominal_inertia_scale": 1.0})
    return tuple(float(value) for value in nominal_inertia(unscaled, arm, Planner(believed, arm).q_start))
