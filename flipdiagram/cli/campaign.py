"""What `flipdiagram campaign` does: fly and analyse, tune, watch, export."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from flipdiagram.cli.terminal import console, status
from flipdiagram.errors import InputError
from flipdiagram.files import check_output_directory

if TYPE_CHECKING:
    from flipdiagram.grid import Grid
    from flipdiagram.scenario.scenario import Scenario


def campaign(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """How often does it work?  One of a specification, --watch, --analyse, --export; InputError for another number.

    scenario: its fields that are not at their defaults count more than the base of the specification.
    """
    given = [arguments.file, arguments.watch, arguments.analyse, arguments.export]
    if sum(entry is not None for entry in given) != 1:
        valid = "one of FILE, --watch, --analyse, --export"
        raise InputError(f"campaign takes {valid}; see `flipdiagram campaign --help`")
    if arguments.watch is not None:
        from flipdiagram.campaign.watch import watch

        watch(arguments.watch, console())
    elif arguments.export is not None:
        from flipdiagram.campaign.dataset import export

        print(f"written to {export(*arguments.export)}")
    elif arguments.tune:
        _tune(arguments, scenario)
    else:
        _fly(arguments, scenario)


def _fly(arguments: argparse.Namespace, scenario: Scenario) -> None:
    out = check_output_directory(arguments.out)

    from flipdiagram.campaign.checks import changes_of, load_specification
    from flipdiagram.campaign.report import write_analysis
    from flipdiagram.campaign.run import run
    from flipdiagram.campaign.tables import pair_grid, success_grid

    with status(arguments.quiet) as progress:
        file = arguments.analyse
        if file is None:
            specification = load_specification(arguments.file, changes_of(scenario))
            file = run(
                replace(specification, limit_hours=math.inf) if arguments.yes else specification,
                out,
                jobs=arguments.jobs,
                scheduler=arguments.scheduler,
                resume=arguments.resume,
                any_version=arguments.any_version,
                progress=progress,
            ).file
        progress("analysing")
        summary = write_analysis(file, out)
    if not arguments.quiet:
        _show(success_grid(summary), pair_grid(summary))
        print(f"written to {out}")


def _tune(arguments: argparse.Namespace, scenario: Scenario) -> None:
    if arguments.file is None:
        raise InputError("--tune needs the specification FILE with a section `tune`")
    out = check_output_directory(arguments.out)

    from flipdiagram.campaign.checks import changes_of
    from flipdiagram.campaign.report import write_tuning
    from flipdiagram.campaign.tables import tuning_grid
    from flipdiagram.campaign.tuner import tune
    from flipdiagram.campaign.tuning import load_tuning

    with status(arguments.quiet) as progress:
        specification, tuning = load_tuning(arguments.file, changes_of(scenario))
        result = tune(specification, tuning, out, jobs=arguments.jobs, scheduler=arguments.scheduler, progress=progress)
        summary = write_tuning(result, specification.base, out)
    if not arguments.quiet:
        _show(tuning_grid(summary))
        print(f"written to {out}")


def _show(*grids: Grid | None) -> None:
    for grid in grids:
        if grid is not None and grid.rows:
            console().print(grid.rich())
