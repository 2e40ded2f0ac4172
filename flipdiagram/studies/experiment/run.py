"""Section IV: the flip from eight starts under each architecture, as the paper's experiment did it."""

from collections.abc import Sequence
from pathlib import Path

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.run import run_flips
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.experiment.claims import claims_of, run_entry
from flipdiagram.studies.experiment.mujoco import second_engine
from flipdiagram.studies.study import Progress, silent

STARTS = (0.0, 0.02, 0.04, 0.06, 0.08, 0.10, 0.12, 0.14)
"""Starts [m] on y: the first at the centre of the workspace, each 2 cm further (section IV-B of the paper)."""
QUICK_STARTS = (0.0, 0.14)


def recording_name(start_y: float, architecture: str) -> str:
    """File of a recording, relative to the study's folder."""
    millimetres = round(1000 * start_y, 6) + 0.0
    text = f"{millimetres:+04.0f}" if millimetres.is_integer() else f"{millimetres:+}"
    return f"recordings/y{text}mm_{architecture}.nc"


def run(
    scenario: Scenario,
    out: str | Path,
    *,
    starts: Sequence[float] | None = None,
    architectures: Sequence[str] = ARCHITECTURES,
    quick: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
) -> None:
    """Fly every start under every architecture; write recordings and summary.json.

    Flights in Drake are judged once more with the block in MuJoCo, where it is installed.

    starts: y [m] of each, by default `STARTS`, or two of them where quick.  What an earlier call left in `out` is
    used.  Raises InputError for a bad start; a start without a motion is an outcome, not an error.
    """
    starts = tuple(starts) if starts is not None else QUICK_STARTS if quick else STARTS
    if not starts or len(set(starts)) != len(starts):
        raise InputError.of("starts", list(starts), "different numbers [m], at least one")
    folder = Path(out)
    flips = [
        Flip(scenario.with_overrides({"task.start_y": y}), name, recording_name(y, name))
        for y in starts
        for name in architectures
    ]
    build_loop(flips[0].scenario, architectures[0])  # what is wrong with the scenario shows before anything is computed
    outcomes = run_flips(flips, folder, jobs=jobs, progress=progress)
    runs = [run_entry(f.scenario.task.start_y, f.architecture, out) for f, out in zip(flips, outcomes, strict=True)]
    recorded = [
        (flip.architecture, flip.scenario.task.start_y, folder / str(flip.recording))
        for flip, outcome in zip(flips, outcomes, strict=True)
        if outcome.metrics is not None
    ]
    again = recorded if scenario.simulation.engine == "drake" else []
    progress("the same motions in MuJoCo" if again else "all flown")
    body = {
        "quick": quick,
        "starts_y_m": list(dict.fromkeys(run["start_y_m"] for run in runs)),
        "architectures": list(dict.fromkeys(run["architecture"] for run in runs)),
        "runs": runs,
        "claims": claims_of(runs),
        "second_engine": second_engine(again, jobs),
    }
    write_summary(folder / "summary.json", "experiment", scenario, body)
