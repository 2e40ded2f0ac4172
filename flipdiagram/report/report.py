"""From the studies to summary.json, report.md and the self-contained report.html."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flipdiagram.campaign import report as campaign_report
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.report.claims import all_claims
from flipdiagram.report.html import self_contained
from flipdiagram.report.pages import page
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.borders import figures as border_figures
from flipdiagram.studies.borders import run as borders
from flipdiagram.studies.experiment import figures as experiment_figures
from flipdiagram.studies.experiment import run as experiment
from flipdiagram.studies.frequency import figures as frequency_figures
from flipdiagram.studies.frequency import run as frequency
from flipdiagram.studies.frequency.tables import write_markdown
from flipdiagram.studies.place import figures as place_figures
from flipdiagram.studies.place import run as place
from flipdiagram.studies.replanning import run as replanning

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Report:
    """What `write_report` wrote: the summary as in summary.json, and the two pages."""

    summary: dict[str, Any]
    html: Path
    markdown: Path


def write_report(
    scenario: Scenario,
    out: str | Path,
    *,
    quick: bool = False,
    jobs: int | None = None,
    progress: Progress = lambda text: None,
) -> Report:
    """Run what is missing of the studies below `out`, draw their figures, and write summary.json and both pages.

    Raises InputError for bad settings and SimulationError for an unstable 1-DOF loop.
    """
    folder = Path(out)
    studies = {
        "frequency": _frequency(scenario, folder / "frequency", quick, progress),
        "experiment": _experiment(scenario, folder / "experiment", quick, jobs, progress),
        "borders": _borders(scenario, folder / "borders", quick, jobs, progress),
        "replanning": _replanning(scenario, folder / "replanning", quick, jobs, progress),
        "place": _place(scenario, folder / "place", jobs, progress),
    }
    progress("writing the pages")
    body = {"quick": quick, "claims": all_claims(studies["frequency"], studies["experiment"]), **_excerpt(studies)}
    written = write_summary(folder / "summary.json", "report", scenario, body)
    summary = json.loads(written.read_text(encoding="utf-8"))
    text = page(summary, studies, scenario, campaign_report.report_section(folder))
    markdown = write_atomically(folder / "report.md", text)
    html = write_atomically(folder / "report.html", self_contained(text, folder))
    return Report(summary, html, markdown)


def _frequency(scenario: Scenario, out: Path, quick: bool, progress: Progress) -> dict[str, Any]:
    found = frequency.stored(scenario, out, quick=quick)
    if found is None:
        result = frequency.run(scenario, out, quick=quick, progress=lambda text: progress(f"section III: {text}"))
        write_markdown(result, out)
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    frequency_figures.write_figures(found, out)
    return found


def _experiment(scenario: Scenario, out: Path, quick: bool, jobs: int | None, progress: Progress) -> dict[str, Any]:
    result = experiment.run(
        scenario, out, quick=quick, jobs=jobs, progress=lambda text: progress(f"section IV: {text}")
    )
    experiment_figures.write_figures(result)
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


def _borders(scenario: Scenario, out: Path, quick: bool, jobs: int | None, progress: Progress) -> dict[str, Any]:
    borders.run(scenario, out, quick=quick, jobs=jobs, progress=lambda text: progress(f"borders: {text}"))
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    border_figures.write_figures(found, out)
    return found


def _replanning(scenario: Scenario, out: Path, quick: bool, jobs: int | None, progress: Progress) -> dict[str, Any]:
    replanning.run(scenario, out, quick=quick, jobs=jobs, progress=lambda text: progress(f"replanning: {text}"))
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


def _place(scenario: Scenario, out: Path, jobs: int | None, progress: Progress) -> dict[str, Any]:
    result = place.run(scenario, out, jobs=jobs, progress=lambda text: progress(f"laying down: {text}"))
    place_figures.write_figures(result)
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


def _excerpt(studies: dict[str, Any]) -> dict[str, Any]:
    """What a reader of the summary wants beside the claims, without the curves."""
    found = studies["frequency"]
    return {
        "observer": found["observer"],
        "realisations": found.get("realisations", []),
        "experiment": {
            key: studies["experiment"][key] for key in ("starts_y_m", "architectures", "runs", "second_engine")
        },
        "borders": {key: studies["borders"][key] for key in ("maps", "variations")},
        "replanning": {"runs": studies["replanning"]["runs"]},
        "place": {key: studies["place"][key] for key in ("plan", "target_y_m", "runs")},
    }
