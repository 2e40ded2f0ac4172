"""Section IV for one start: the flip under each architecture, side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.flips.workers import Workers
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.simulation.recording import Recording
from flipdiagram.simulation.recording_files import load_recording, save_recording
from flipdiagram.simulation.simulate import simulate

QUICK_HOLD = 1.0
"""Hold time [s] of a quick run: the observer has settled to within exp(−12.6), the PD's slow pole only to exp(−2.9)."""


@dataclass(frozen=True)
class TurnoverRun:
    """One architecture's flip: what was measured, how fast it ran, and the file of its recording."""

    metrics: FlipMetrics
    real_time_factor: float
    recording: str

    def as_dict(self) -> dict[str, Any]:
        """The `runs` entry of summary.json."""
        return self.metrics.as_dict() | {"real_time_factor": self.real_time_factor, "recording": self.recording}


@dataclass(frozen=True)
class TurnoverResult:
    """The plan and the runs of one study, in the order in which the architectures were named."""

    scenario: Scenario
    plan: Plan
    out: Path
    runs: list[TurnoverRun] = field(default_factory=list)

    def recordings(self) -> dict[str, Recording]:
        """The recordings by architecture, read from their files."""
        return {run.metrics.architecture: load_recording(self.out / run.recording) for run in self.runs}

    def write_summary(self) -> Path:
        """Write summary.json."""
        body = {"plan": self.plan.summary(), "runs": [run.as_dict() for run in self.runs]}
        return write_summary(self.out / "summary.json", "turnover", self.scenario, body)


def run(
    scenario: Scenario,
    out: str | Path,
    architectures: Sequence[str] = ARCHITECTURES,
    *,
    quick: bool = False,
    jobs: int | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> TurnoverResult:
    """Plan once, simulate every architecture in processes of its own, write recordings, plan.json and summary.json.

    quick: a shorter hold before the motion.  jobs: processes, by default one per core.  Finished runs are kept, and
    listed in summary.json, when it is interrupted.  Raises InputError, PlanningError, SimulationError.
    """
    for name in architectures:
        check_architecture(name)
    if quick:
        shorter = min(QUICK_HOLD, scenario.simulation.hold_time)
        scenario = scenario.with_overrides({"simulation.hold_time": shorter})
    folder = Path(out)
    build_loop(
        scenario, architectures[0]
    )  # what is wrong with the scenario shows before anything is computed or written
    with Workers(jobs) as workers:
        # the workers import Drake while this process plans
        workers.warm_up(_import_only, min(jobs or len(architectures), len(architectures)))
        progress("planning")
        plan = plan_motion(scenario)
        progress(f"planned in {plan.solve_time:.2f} s: J = {plan.cost:.3f}; simulating {', '.join(architectures)}")
        write_atomically(folder / "plan.json", plan.to_json())
        done: dict[int, TurnoverRun] = {}
        tasks = [(scenario, name, plan, folder) for name in architectures]
        try:
            for index, finished in workers.results(simulate_one, tasks):
                done[index] = finished
                verdict = "turned over" if finished.metrics.success else finished.metrics.failure
                progress(f"{len(done)}/{len(tasks)} {architectures[index]}: {verdict}")
        finally:
            result = TurnoverResult(scenario, plan, folder, [done[i] for i in sorted(done)])
            if done:
                result.write_summary()
    return result


def simulate_one(scenario: Scenario, architecture: str, plan: Plan, folder: Path) -> TurnoverRun:
    """One flip: simulate, measure, write its recording."""
    flip = simulate(scenario, architecture, plan)
    measured = metrics.measure(flip.recording)
    name = f"{architecture}.nc"
    save_recording(flip.recording, measured, folder / name)
    return TurnoverRun(measured, flip.real_time_factor, name)


def _import_only() -> None:
    """Importing this module, which unpickling this function does, is the work."""
