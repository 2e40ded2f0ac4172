"""The commands: each calls a study and the pictures and tables that belong to it, and prints.

What a command needs is imported when it runs, so that help and errors come at once.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, cast

from flipdiagram.cli.terminal import console, status, summary_table
from flipdiagram.files import check_output_directory, sole_use, versions, write_atomically, write_summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flipdiagram.grid import Grid
    from flipdiagram.scenario.scenario import Scenario


def print_version() -> None:
    """flipdiagram's and Drake's."""
    numbers = versions()
    print(f"flipdiagram {numbers['flipdiagram']} (Drake {numbers['drake']})")


def plan(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Plan the motion only."""
    out = check_output_directory(arguments.out)

    from flipdiagram.figures.motion import plot_plan
    from flipdiagram.figures.style import save
    from flipdiagram.planning import plan_motion

    with status(arguments.quiet) as progress:
        progress("planning")
        found = plan_motion(scenario)
    write_atomically(out / "plan.json", found.to_json())
    save(cast("Figure", plot_plan(found)[0].figure), out / "plan")
    write_summary(out / "summary.json", "plan", scenario, {"plan": found.summary()})
    if not arguments.quiet:
        console().print(summary_table("planned motion", found.summary()))
        print(f"written to {out}")


def flip(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """One start under each controller."""
    out = check_output_directory(arguments.out)

    from flipdiagram.studies.turnover import run as turnover
    from flipdiagram.studies.turnover.pictures import turnover_pictures
    from flipdiagram.studies.turnover.tables import turnover_table

    chosen = list(dict.fromkeys(arguments.architecture))
    if arguments.meshcat:
        from flipdiagram.rendering.live import show_live

        show_live(scenario, chosen)
        return
    with status(arguments.quiet) as progress:
        result = turnover.run(scenario, out, chosen, quick=arguments.quick, jobs=arguments.jobs, progress=progress)
        replay = not (arguments.no_replay or arguments.quick)
        notes = turnover_pictures(result, replay=replay, progress=progress)
    if not arguments.quiet:
        console().print(turnover_table(result))
        for note in notes:
            print(note)
        print(f"written to {out}")


def frequency(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Section III."""
    out = check_output_directory(arguments.out)

    from flipdiagram.studies.frequency import run as frequency
    from flipdiagram.studies.frequency.figures import write_figures
    from flipdiagram.studies.frequency.tables import claims_table, realisation_table, steadiness, write_markdown

    with sole_use(out), status(arguments.quiet) as progress:
        result = frequency.run(scenario, out, quick=arguments.quick, progress=progress)
        write_markdown(result, out)
        write_figures(result.summary(), out)
    if not arguments.quiet:
        for table in [claims_table(result)] + ([realisation_table(result)] if result.rows else []):
            console().print(table)
        print(steadiness(result))
        if result.quick:
            print("a quick run: fewer frequencies, no table of realisations")
        print(f"{result.steps / 1e6:.0f} M channel-steps in {result.seconds:.1f} s; written to {out}")


def experiment(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Section IV: all starts."""
    out = check_output_directory(arguments.out)

    from flipdiagram.studies.experiment import run as experiment
    from flipdiagram.studies.experiment.figures import write_figures
    from flipdiagram.studies.experiment.tables import claims_grid, engine_grid, runs_grid

    with status(arguments.quiet) as progress:
        result = experiment.run(
            scenario,
            out,
            starts=arguments.starts,
            architectures=list(dict.fromkeys(arguments.architecture)),
            quick=arguments.quick,
            jobs=arguments.jobs,
            progress=progress,
        )
        progress("drawing figures")
        write_figures(result)
    if not arguments.quiet:
        summary = result.summary()
        _show(runs_grid(summary), claims_grid(summary), engine_grid(summary))
        if result.quick:
            print("a quick run: two starts only")
        print(f"written to {out}")


def borders(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Where each controller stops working."""
    out = check_output_directory(arguments.out)

    from flipdiagram.studies.borders import run as borders
    from flipdiagram.studies.borders.figures import write_figures
    from flipdiagram.studies.borders.tables import border_grid, variation_grid

    with status(arguments.quiet) as progress:
        result = borders.run(
            scenario,
            out,
            maps=arguments.maps,
            resolution=arguments.resolution,
            quick=arguments.quick,
            jobs=arguments.jobs,
            progress=progress,
        )
        progress("drawing maps")
        write_figures(result.summary(), out)
    if not arguments.quiet:
        summary = result.summary()
        _show(border_grid(summary), variation_grid(summary))
        if result.quick:
            print("a quick run: few and coarse maps, no variations")
        print(f"written to {out}")


def replanning(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """What planning again buys."""
    out = check_output_directory(arguments.out)

    from flipdiagram.studies.replanning import run as replanning
    from flipdiagram.studies.replanning.tables import replanning_grid

    with status(arguments.quiet) as progress:
        result = replanning.run(scenario, out, quick=arguments.quick, jobs=arguments.jobs, progress=progress)
    if not arguments.quiet:
        _show(replanning_grid(result.summary()))
        print(f"written to {out}")


def place(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Lay the object down."""
    out = check_output_directory(arguments.out)

    from flipdiagram.rendering.replay import write_replay
    from flipdiagram.studies.place import run as place
    from flipdiagram.studies.place.figures import write_figures
    from flipdiagram.studies.place.tables import place_grid

    with status(arguments.quiet) as progress:
        result = place.run(
            scenario, out, list(dict.fromkeys(arguments.architecture)), jobs=arguments.jobs, progress=progress
        )
        progress("drawing figures")
        write_figures(result)
        if not arguments.no_replay:
            verdicts = {p.architecture: (p.success, p.failure or "laid down") for p in result.placements}
            write_replay(result.recordings(), scenario, out / "replay.html", verdicts)
    if not arguments.quiet:
        _show(place_grid(result.summary()))
        print(f"written to {out}")


def campaign(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """How often it works."""
    from flipdiagram.cli.campaign import campaign

    campaign(arguments, scenario)


def report(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Every claim, measured, in one page."""
    out = check_output_directory(arguments.out)

    from flipdiagram.report import write_report
    from flipdiagram.report.claims import claims_grid

    with status(arguments.quiet) as progress:
        written = write_report(scenario, out, quick=arguments.quick, jobs=arguments.jobs, progress=progress)
    if not arguments.quiet:
        _show(claims_grid(written.summary))
        if arguments.quick:
            print("a quick report: coarse, two starts, not the numbers to quote")
        print(f"written to {written.html} and {written.markdown}")


def diagram(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """The block diagram as a picture or text."""
    from flipdiagram.cli.diagram import drawing_of, write

    drawn = drawing_of(
        scenario, arguments.architecture, one_dof=arguments.one_dof, depth=arguments.depth, rates=arguments.rates
    )
    if arguments.table:
        print(drawn.rates().to_markdown(), end="")
    if arguments.out is not None or not arguments.table:
        write(drawn, arguments.format, arguments.out)


def info(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """What a result file holds."""
    from flipdiagram.results import info

    _show(info(arguments.file))


def completion(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """The completion script of a shell."""
    from flipdiagram.cli.completion import script

    print(script(arguments.shell), end="")


def _show(*grids: Grid | None) -> None:
    for grid in grids:
        if grid is not None and grid.rows:
            console().print(grid.rich())


def scenario(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Every field with its unit."""
    print(scenario.to_yaml(comments=True), end="")
