"""Campaigns and the tuner as studies: what the options of `flipdiagram campaign` ask for, and what is written."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from json import loads
from pathlib import Path
from typing import Any

from flipdiagram.campaign.analysis import analyse as analysis_of
from flipdiagram.campaign.checks import load_specification
from flipdiagram.campaign.dataset import export as export_to
from flipdiagram.campaign.dataset import load_dataset
from flipdiagram.campaign.figures import plot_tuning, write_figures
from flipdiagram.campaign.run import FILE, run
from flipdiagram.campaign.tables import pair_grid, section, success_grid, tuning_grid, tuning_section
from flipdiagram.campaign.tuner import tune as search
from flipdiagram.campaign.tuning import load_tuning
from flipdiagram.campaign.watch import status_grid
from flipdiagram.campaign.watch import watch as watch_on
from flipdiagram.errors import InputError
from flipdiagram.figures.style import save
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.flips.run import Progress
from flipdiagram.grid import Grid, console
from flipdiagram.scenario.scenario import Scenario, from_mapping

TUNING = "tuning.json"
"""What the tuner found, in its folder."""


def show(
    scenario: Scenario,
    *,
    file: str | None,
    watch: Path | None,
    analyse: Path | None,
    export: list[Path] | None,
    salvage: bool,
    json: bool,
) -> list[Grid | str] | None:
    """Show or export the file of a campaign where that is asked for: what is said of it, None where it is not.

    json: of a running campaign the table as it is now, where it would move.
    Raises InputError unless one of the four is given.
    """
    if sum(entry is not None for entry in (file, watch, analyse, export)) != 1:
        valid = "one of FILE, --watch, --analyse, --export"
        raise InputError(f"campaign takes {valid}; see `flipdiagram campaign --help`", valid=valid)
    if salvage and export is None:
        raise InputError.of("--salvage", True, "--salvage beside --export FILE TO", "--salvage stands alone")
    if watch is not None:
        if json:
            return [status_grid(watch)[0]]
        watch_on(watch, console())
        return []
    if export is None:
        return None
    (source, target), lost = export, list[str]()
    said: list[Grid | str] = [f"written to {export_to(source, target, lost if salvage else None)}"]
    if salvage:
        said.append(f"damaged flips left out: {len(lost)}" + f", the first: {lost[0]}" * bool(lost))
    return said


def fly(
    scenario: Scenario, out: Path, *, file: str, analyse: Path | None, yes: bool, progress: Progress, **settings: Any
) -> None:
    """Fly the campaign of a specification, or take the file of an earlier one, and analyse it.

    scenario: its fields that are not at their defaults count more than the base of the specification.
    yes: even if it takes longer than its limit.  settings: of `campaign.run.run`.
    """
    if analyse is None:
        specification = load_specification(file, scenario.changes())
        if yes:
            specification = replace(specification, limit_hours=math.inf)
        analyse = run(specification, out, progress=progress, **settings).file
    progress("analysing")
    write_analysis(analyse, out)


def tune(scenario: Scenario, out: Path, *, file: str | None, **settings: Any) -> None:
    """Search the gains that work most often; settings: of `tuner.tune`."""
    if file is None:
        raise InputError("--tune needs the specification FILE with a section `tune`", field="--tune")
    specification, wanted = load_tuning(file, scenario.changes())
    write_tuning(search(specification, wanted, out, **settings), specification.base, out)


def tables(summary: Mapping[str, Any]) -> list[Grid]:
    """Success rates, and the differences between architectures."""
    return [success_grid(summary), pair_grid(summary)]


def tuning_tables(summary: Mapping[str, Any]) -> list[Grid]:
    """Default gains against tuned ones."""
    return [tuning_grid(summary)]


def write_analysis(file: Path, out: Path) -> dict[str, Any]:
    """Analyse a campaign's file, of a running one what is there; returns the summary.  Raises InputError."""
    data = load_dataset(file)
    if (held := out / FILE).is_file() and not held.samefile(file):
        problem = f"--out = '{out}' holds the flips of another campaign"
        raise InputError.of("--out", out, f"another folder than that of {FILE}", problem)
    specification = loads(data.attrs["specification"])
    body: dict[str, Any] = analysis_of(data)
    body["figures"] = write_figures(body, data, out)
    body["specification"] = {key: value for key, value in specification.items() if key != "base"}
    written = write_summary(out / "summary.json", "campaign", from_mapping(specification["base"]), body)
    summary: dict[str, Any] = loads(written.read_text(encoding="utf-8"))
    write_atomically(out / "campaign.md", f"# Campaign\n\n{section(summary)}")
    return summary


def write_tuning(tuning: dict[str, Any], base: Scenario, out: Path) -> None:
    """Write what the tuner found: tuning.json, tuning.md and a figure."""
    save(plot_tuning(tuning), out / "tuning")
    write_summary(out / TUNING, "tuning", base, tuning)
    text = f"# Tuned gains\n\n{tuning_section(tuning)}\n![Search and verdict](tuning.png)\n"
    write_atomically(out / "tuning.md", text)


def report_section(folder: Path, names: Sequence[str] = ("campaign", "tuning")) -> str:
    """What the reproduction report shows of campaigns and of tuned gains below `folder`/name; '' without them."""
    parts = [section(write_analysis(folder / name / FILE, folder / name), name) for name in _with(folder, names, FILE)]
    for name in _with(folder, names, TUNING):
        tuning = loads((folder / name / TUNING).read_text(encoding="utf-8"))
        picture = f"![Search and verdict of the tuner]({name}/tuning.png)"
        parts.append(f"### Default gains against tuned ones\n\n{tuning_section(tuning)}\n{picture}\n")
    return "\n".join(parts)


def _with(folder: Path, names: Sequence[str], file: str) -> list[str]:
    return [name for name in names if (folder / name / file).is_file()]
