"""What the commands do: one function for every study, and one for each of the smaller commands.

What a command needs is imported when it runs, so that help and errors come at once.
"""

from __future__ import annotations

import argparse
import json
from contextlib import nullcontext
from typing import TYPE_CHECKING

from flipdiagram.cli.terminal import show, status
from flipdiagram.files import check_output_directory, sole_use, versions
from flipdiagram.studies.registry import STUDIES

if TYPE_CHECKING:
    from flipdiagram.scenario.scenario import Scenario
    from flipdiagram.studies.study import Study


def print_version() -> None:
    """flipdiagram's and Drake's."""
    numbers = versions()
    print(f"flipdiagram {numbers['flipdiagram']} (Drake {numbers['drake']})")


def run_study(study: Study, arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Run a study into --out, draw its figures, and show its tables."""
    given = vars(arguments)
    if study.instead is not None and study.instead(scenario, **study.given(given, "instead")):
        return
    study = next((STUDIES[name] for option, name in study.otherwise.items() if given[option]), study)
    out = check_output_directory(arguments.out)
    with sole_use(out) if study.alone else nullcontext(), status(arguments.quiet) as progress:
        study.run(scenario, out, progress=progress, **study.given(given, "run"))
        summary = json.loads((out / study.file).read_text(encoding="utf-8"))
        notes = study.figures(summary, out, progress=progress, **study.given(given, "figures"))
    if not arguments.quiet:
        show(*study.tables(summary), *notes, study.written(summary, out))


def diagram(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """The block diagram as a picture or text."""
    from flipdiagram.cli.diagram import drawing_of, write

    drawing = drawing_of(
        scenario, arguments.architecture, one_dof=arguments.one_dof, depth=arguments.depth, rates=arguments.rates
    )
    if arguments.table:
        print(drawing.rates().to_markdown(), end="")
    if arguments.out is not None or not arguments.table:
        write(drawing, arguments.format, arguments.out)


def info(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """What a result file holds."""
    from flipdiagram.results import info

    show(info(arguments.file))


def completion(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """The completion script of a shell."""
    from flipdiagram.cli.completion import script

    print(script(arguments.shell), end="")


def scenario(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Every field with its unit."""
    print(scenario.to_yaml(comments=True), end="")
