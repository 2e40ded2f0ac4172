"""Campaigns and the tuner as studies: what the options of `flipdiagram campaign` ask for."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from flipdiagram.campaign.checks import changes_of, load_specification
from flipdiagram.campaign.dataset import export as export_to
from flipdiagram.campaign.report import write_analysis, write_tuning
from flipdiagram.campaign.run import run
from flipdiagram.campaign.tables import pair_grid, success_grid, tuning_grid
from flipdiagram.campaign.tuner import tune as search
from flipdiagram.campaign.tuning import load_tuning
from flipdiagram.campaign.watch import watch as watch_on
from flipdiagram.errors import InputError
from flipdiagram.flips.run import Progress
from flipdiagram.grid import Grid, console
from flipdiagram.scenario.scenario import Scenario


def show(
    scenario: Scenario, *, file: str | None, watch: Path | None, analyse: Path | None, export: list[Path] | None
) -> bool:
    """Show or export the file of a campaign where that is asked for; whether it was.

    Raises InputError unless one of the four is given.
    """
    if sum(entry is not None for entry in (file, watch, analyse, export)) != 1:
        valid = "one of FILE, --watch, --analyse, --export"
        raise InputError(f"campaign takes {valid}; see `flipdiagram campaign --help`", valid=valid)
    if watch is not None:
        watch_on(watch, console())
    elif export is not None:
        print(f"written to {export_to(*export)}")
    return watch is not None or export is not None


def fly(
    scenario: Scenario, out: Path, *, file: str, analyse: Path | None, yes: bool, progress: Progress, **settings: Any
) -> None:
    """Fly the campaign of a specification, or take the file of an earlier one, and analyse it.

    scenario: its fields that are not at their defaults count more than the base of the specification.
    yes: even if it takes longer than its limit.  settings: of `campaign.run.run`.
    """
    if analyse is None:
        specification = load_specification(file, changes_of(scenario))
        if yes:
            specification = replace(specification, limit_hours=math.inf)
        analyse = run(specification, out, progress=progress, **settings).file
    progress("analysing")
    write_analysis(analyse, out)


def tune(scenario: Scenario, out: Path, *, file: str | None, **settings: Any) -> None:
    """Search the gains that work most often; settings: of `tuner.tune`."""
    if file is None:
        raise InputError("--tune needs the specification FILE with a section `tune`", field="--tune")
    specification, wanted = load_tuning(file, changes_of(scenario))
    write_tuning(search(specification, wanted, out, **settings), specification.base, out)


def tables(summary: Mapping[str, Any]) -> list[Grid]:
    """Success rates, and the differences between architectures."""
    return [success_grid(summary), pair_grid(summary)]


def tuning_tables(summary: Mapping[str, Any]) -> list[Grid]:
    """Default gains against tuned ones."""
    return [tuning_grid(summary)]
