"""Section IV for one start: the flip under each architecture, side by side."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.flips.workers import Workers
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.recording_files import save_recording
from flipdiagram.simulation.replans import replans
from flipdiagram.simulation.simulate import simulate
from flipdiagram.studies.study import Progress, silent

QUICK_HOLD = 1.0
"""Hold time [s] of a quick run: the observer has settled to within exp(−12.6), the PD's slow pole only to exp(−2.9)."""


def show_live(scenario: Scenario, *, architectures: Sequence[str], meshcat: bool) -> None:
    """Simulate in a browser first, where that is asked for."""
    if meshcat:
        from flipdiagram.rendering.live import show_live

        show_live(scenario, architectures)


def run(
    scenario: Scenario,
    out: str | Path,
    architectures: Sequence[str] = ARCHITECTURES,
    *,
    quick: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
) -> None:
    """Plan once, simulate every architecture in processes of its own, write recordings, plan.json and summary.json.

    quick: a shorter hold before the motion.  jobs: processes, by default one per core.  Finished runs are kept, and
    listed in summary.json, when it is interrupted.  Raises InputError, PlanningError, SimulationError.
    """
    for name in architectures:
        check_architecture(name)
    if quick and scenario.simulation.lead_time > QUICK_HOLD:
        scenario = scenario.with_overrides({"simulation.hold_time": QUICK_HOLD})
    folder = Path(out)
    build_loop(scenario, architectures[0])  # what is wrong with the scenario shows before anything is written
    with Workers(jobs) as workers:
        # the workers import Drake while this process plans
        for _ in range(min(jobs or len(architectures), len(architectures))):
            workers.submit(_import_only, ())
        progress("planning")
        plan = plan_motion(scenario, progress)
        progress(f"planned in {plan.solve_time:.2f} s: J = {plan.cost:.3f}; simulating {', '.join(architectures)}")
        write_atomically(folder / "plan.json", plan.to_json())
        runs: dict[int, dict[str, Any]] = {}
        tasks = [(scenario, name, plan, folder) for name in architectures]
        try:
            for index, entry in workers.results(simulate_one, tasks):
                runs[index] = entry
                verdict = "turned over" if entry["success"] else entry["failure"]
                progress(f"{len(runs)}/{len(tasks)} {architectures[index]}: {verdict}")
        finally:
            if runs:
                body = {"plan": plan.summary(), "runs": [runs[i] for i in sorted(runs)]}
                write_summary(folder / "summary.json", "turnover", scenario, body)


def simulate_one(scenario: Scenario, architecture: str, plan: Plan, folder: Path) -> dict[str, Any]:
    """One flip: simulate, measure, write its recording; its entry in `runs` of summary.json."""
    flip = simulate(scenario, architecture, plan)
    measured = metrics.measure(flip.recording)
    name = f"{architecture}.nc"
    save_recording(flip.recording, measured, folder / name)
    entry = measured.as_dict() | {"real_time_factor": flip.real_time_factor, "recording": name}
    again = replans(flip.recording)
    return entry if again is None else entry | {"replanning": again}


def _import_only() -> None:
    """Importing this module, which unpickling this function does, is the work."""
