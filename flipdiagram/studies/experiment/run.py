"""Section IV: the flip from eight starts under each architecture, as the paper's experiment did it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import Progress, run_flips
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation.recording import Recording
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.experiment.claims import Row, claims_of
from flipdiagram.studies.experiment.mujoco import second_engine

STARTS = (0.0, 0.02, 0.04, 0.06, 0.08, 0.10, 0.12, 0.14)
"""Starts [m] on y: the first at the centre of the workspace, each 2 cm further (section IV-B of the paper)."""
QUICK_STARTS = (0.0, 0.14)


@dataclass(frozen=True)
class ExperimentResult:
    """The outcomes of all starts and architectures, and the claims E1–E8 judged from them."""

    scenario: Scenario
    starts: tuple[float, ...]
    architectures: tuple[str, ...]
    rows: tuple[Row, ...]
    out: Path
    quick: bool
    second_engine: dict[str, Any] | None
    """Verdicts of MuJoCo beside Drake's; None where it is not installed."""

    def recordings(self, architecture: str) -> list[Recording]:
        """The recordings of an architecture, by start."""
        rows = [row for row in self.rows if row.architecture == architecture and row.outcome.metrics is not None]
        return [load_recording(self.out / recording_name(row.start_y, architecture)) for row in rows]

    def summary(self) -> dict[str, Any]:
        """The body of summary.json."""
        return {
            "quick": self.quick,
            "starts_y_m": list(self.starts),
            "architectures": list(self.architectures),
            "runs": [row.as_dict() for row in self.rows],
            "claims": [claim.as_dict() for claim in claims_of(self.rows)],
            "second_engine": self.second_engine,
        }


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
    progress: Progress = lambda text: None,
) -> ExperimentResult:
    """Fly every start under every architecture; write recordings and summary.json.

    starts: y [m] of each, by default `STARTS`, or two of them where quick.  What an earlier call left in `out` is
    used.  Raises InputError for a bad start; a start without a motion is an outcome, not an error.
    """
    chosen = tuple(starts) if starts is not None else QUICK_STARTS if quick else STARTS
    if not chosen or len(set(chosen)) != len(chosen):
        raise InputError(f"starts = {list(chosen)} is not valid; valid are different numbers [m], at least one")
    folder = Path(out)
    flips = [
        Flip(scenario.with_overrides({"task.start_y": y}), name, recording_name(y, name))
        for y in chosen
        for name in architectures
    ]
    build_loop(flips[0].scenario, architectures[0])  # what is wrong with the scenario shows before anything is computed
    outcomes: list[Outcome] = run_flips(flips, folder, jobs=jobs, progress=progress)
    rows = tuple(
        Row(flip.scenario.task.start_y, flip.architecture, outcome)
        for flip, outcome in zip(flips, outcomes, strict=True)
    )
    recorded = [
        (flip.architecture, flip.scenario.task.start_y, folder / str(flip.recording))
        for flip, outcome in zip(flips, outcomes, strict=True)
        if outcome.metrics is not None
    ]
    progress("the same motions in MuJoCo")
    engines = second_engine(recorded, jobs)
    result = ExperimentResult(scenario, chosen, tuple(architectures), rows, folder, quick, engines)
    write_summary(folder / "summary.json", "experiment", scenario, result.summary())
    return result
