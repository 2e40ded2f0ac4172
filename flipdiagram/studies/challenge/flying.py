"""What a worker does for the challenge: plan a motion as an entry does, and fly it under the entry's controller."""

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.diagrams.replacement import WHOLE
from flipdiagram.errors import EntryError, InputError
from flipdiagram.flips.flight import Flight, Landed, Planned, Work, fly, plan_drawn_flight, provenance, with_inertia_of
from flipdiagram.planning import Plan
from flipdiagram.planning.replanner import Replanner
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.replans import solve_times
from flipdiagram.simulation.simulate import Run, simulate_loop
from flipdiagram.studies.challenge.boxes import refereed
from flipdiagram.studies.challenge.entry import Entry, load_entry, watched

STILL = 0.3
"""Seconds before the motion in which the arm stands, and torque is noise."""


@dataclass(frozen=True)
class EntryFlight(Flight):
    """A flight under the controller of a file, in a motion that the file may plan itself."""

    path: Path = Path()
    digest: str = ""
    plans: bool = False
    """Whether the file plans the motion itself."""

    @property
    def plan_key(self) -> str:
        """As of a `Flight`; of a file that plans, the file's too."""
        key = super().plan_key
        return hashlib.sha256(f"{key} {self.digest}".encode()).hexdigest() if self.plans else key


def plan_entry(believed: Scenario, path: Path) -> Planned:
    """The motion that the entry plans, or ours; or why there is none."""
    entry = load_entry(path)
    if "plan" not in entry.kinds:
        return plan_drawn_flight(believed)
    try:
        with watched(path):
            plan = entry.laws["plan"](believed)
            if not isinstance(plan, Plan):
                raise EntryError(f"plan returned {type(plan).__name__}; valid is a flipdiagram.Plan")
            return plan.to_json(), None
    except EntryError as error:
        return None, str(error)


def work_of(path: Path) -> Work:
    """What workers do for the entry of a file."""
    return Work(partial(plan_entry, path=path), fly_entry)


def fly_entry(flight: Flight, plan: str) -> Landed:
    """Fly one world; what an entry does wrong is the outcome, `crashed`, with file and line.

    Beside the plan's summary stand its own numbers: `compute_s`, P50 and P99 of its processor time per period, and
    `still_Nm`, the RMS torque about its mean while the arm stands.
    """
    assert isinstance(flight, EntryFlight)
    begin, entry, own = time.perf_counter(), load_entry(flight.path), dict[str, Any]()
    scenario, followed = with_inertia_of(flight.truth, flight.believed), Plan.from_json(plan, "stored plan")

    def simulated() -> Run:
        with watched(flight.path):
            run, seconds = _run(entry, scenario, flight.believed, followed)
        run.recording.attrs["entry"] = entry.name
        own.update(_numbers(run, seconds))
        return run

    outcome = fly(scenario, flight.architecture, followed, flight.recording, simulated=simulated)
    outcome = replace(outcome, plan={**(outcome.plan or {}), **own})
    return Landed(outcome, time.perf_counter() - begin, *provenance())


def _run(entry: Entry, scenario: Scenario, believed: Scenario, plan: Plan) -> tuple[Run, list[float]]:
    """The flip and the seconds that each period of its controller took."""
    again: Callable[[], Replanner] = partial(Replanner, believed, arm_of(believed))
    if not {"control", "controller"} & set(entry.kinds):
        loop = build_loop(scenario, entry.architecture, record=True, native=True, replanner=again)
        seconds: list[float] = []
        box: Any = loop.boxes.systems["controller"]
        compute = box.compute

        def timed(given: Any) -> Any:
            begin = time.thread_time()
            values = compute(given)
            seconds.append(time.thread_time() - begin)
            return values

        box.compute = timed
        return simulate_loop(loop, plan), seconds
    try:
        controller, referee = refereed(entry, believed, scenario.simulation.lead_time)
        own = {WHOLE: controller}
        loop = build_loop(scenario, entry.architecture, record=True, replace=own, native=True, replanner=again)
    except InputError as error:
        if error.field != WHOLE:
            raise
        raise EntryError(str(error).removeprefix("replace: ")) from None
    return simulate_loop(loop, plan), referee.seconds


def _numbers(run: Run, seconds: list[float]) -> dict[str, Any]:
    data, times = run.recording, np.array(seconds)
    if "replanned" in data:  # what plans on the way computes too; of a plan the wall time is known
        times = np.concatenate([times, solve_times(data)[1]])
    still = data["tau"].sel(time=slice(-STILL, -1e-9)).values
    noise = float(np.sqrt(np.mean(np.var(still, axis=0)))) if len(still) else None
    return {
        "compute_s": {"p50": float(np.quantile(times, 0.5)), "p99": float(np.quantile(times, 0.99))},
        "still_Nm": noise,
    }
