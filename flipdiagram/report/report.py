"""From the studies to summary.json, report.md and the self-contained report.html."""

import json
from pathlib import Path
from typing import Any

from flipdiagram.files import write_atomically, write_summary
from flipdiagram.report.claims import all_claims
from flipdiagram.report.html import self_contained
from flipdiagram.report.optional import optional_sections
from flipdiagram.report.pages import page
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.registry import STUDIES
from flipdiagram.studies.study import Progress, Study, Summary, silent

PARTS = {
    "frequency": "section III",
    "experiment": "section IV",
    "borders": "borders",
    "replanning": "replanning",
    "place": "laying down",
}
"""The studies of the report, and what its progress calls them."""


def run(
    scenario: Scenario, out: str | Path, *, quick: bool = False, jobs: int | None = None, progress: Progress = silent
) -> None:
    """Run what is missing of the studies below `out`, draw their figures, and write summary.json and both pages.

    Raises InputError for bad settings and SimulationError for an unstable 1-DOF loop.
    """
    folder = Path(out)
    asked = {"quick": quick, "jobs": jobs, "no_replay": True}
    summaries = {name: _summary_of(STUDIES[name], scenario, folder / name, asked, progress) for name in PARTS}
    progress("writing the pages")
    claims = all_claims(summaries["frequency"], summaries["experiment"])
    body = {"quick": quick, "claims": claims, **_excerpt(summaries)}
    written = write_summary(folder / "summary.json", "report", scenario, body)
    summary = json.loads(written.read_text(encoding="utf-8"))
    text = page(summary, summaries, scenario, optional_sections(folder))
    write_atomically(folder / "report.md", text)
    write_atomically(folder / "report.html", self_contained(text, folder))


def _summary_of(study: Study, scenario: Scenario, out: Path, asked: dict[str, Any], progress: Progress) -> Summary:
    """A study's summary, of an earlier run where it would come out the same; its figures are drawn anew."""
    summary: Summary | None = study.stored and study.stored(scenario, out, **study.given(asked, "run"))
    if summary is None:
        return study.carry_out(scenario, out, asked, lambda text: progress(f"{PARTS[study.name]}: {text}"))[0]
    study.figures(summary, out, **study.given(asked, "figures"))
    return summary


def _excerpt(studies: dict[str, Summary]) -> dict[str, Any]:
    """What a reader of the summary wants beside the claims, without the curves."""
    frequency = studies["frequency"]
    parts = {
        "experiment": ("starts_y_m", "architectures", "runs", "second_engine"),
        "borders": ("maps", "variations"),
        "replanning": ("runs", "worlds"),
        "place": ("plan", "target_y_m", "runs"),
    }
    return {"observer": frequency["observer"], "realisations": frequency.get("realisations", [])} | {
        name: {key: studies[name][key] for key in keys} for name, keys in parts.items()
    }
