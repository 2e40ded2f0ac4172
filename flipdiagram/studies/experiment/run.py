"""Section IV: the flip from eight starts under each architecture, as the paper's experiment did it."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import run_flips
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.experiment.claims import claims_of, run_entry
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

    Flips in Drake are flown once more in MuJoCo, where it is installed, by the same controller in the same diagram.

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
    again = scenario.simulation.engine == "drake" and find_spec("mujoco") is not None
    body = {
        "quick": quick,
        "starts_y_m": list(dict.fromkeys(run["start_y_m"] for run in runs)),
        "architectures": list(dict.fromkeys(run["architecture"] for run in runs)),
        "runs": runs,
        "claims": claims_of(runs),
        "second_engine": _second_engine(flips, outcomes, folder, jobs, progress) if again else None,
    }
    write_summary(folder / "summary.json", "experiment", scenario, body)


def _second_engine(
    flips: Sequence[Flip], outcomes: Sequence[Outcome], folder: Path, jobs: int | None, progress: Progress
) -> list[dict[str, Any]]:
    """Each flip's verdict beside that of MuJoCo, which flies it too: closed loop, from its own start."""
    again = [Flip(f.scenario.with_overrides({"simulation.engine": "mujoco"}), f.architecture) for f in flips]
    others = run_flips(again, folder, jobs=jobs, progress=lambda text: progress(f"MuJoCo: {text}"))
    entries = []
    for flip, ours, theirs in zip(flips, outcomes, others, strict=True):
        head = {"architecture": flip.architecture, "start_y_m": flip.scenario.task.start_y}
        head |= {"agree": ours.success == theirs.success}
        entries.append(head | {"drake": _verdict(ours), "mujoco": _verdict(theirs)})
    return entries


def _verdict(outcome: Outcome) -> dict[str, Any]:
    slip = outcome.metrics and outcome.metrics.max_slip_m
    return {"success": outcome.success, "failure": outcome.failure, "max_slip_m": slip}
