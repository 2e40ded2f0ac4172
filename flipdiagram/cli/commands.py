"""What the commands do: one function for every study, and one for each of the smaller commands.

What a command needs is imported when it runs, so that help and errors come at once.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from flipdiagram.files import check_output_directory, plain, remove_left, versions
from flipdiagram.grid import Grid, console
from flipdiagram.scenario.scenario import FILES, Scenario, value_of
from flipdiagram.scenario.work import check_work
from flipdiagram.studies.registry import STUDIES
from flipdiagram.studies.study import Study, silent


def print_version() -> None:
    """flipdiagram's and Drake's."""
    numbers = versions()
    print(f"flipdiagram {numbers['flipdiagram']} (Drake {numbers['drake']})")


def run_study(study: Study, arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Run a study into --out, draw its figures, and show its tables."""
    given = vars(arguments)
    if not given["yes"]:
        check_work(scenario, study.work)
    if any(value_of(scenario, field) for field in FILES):
        from flipdiagram.robot.parts import arm_of

        arm_of(scenario)  # raises InputError for a model file that cannot be, before anything is written
    if study.first is not None:
        parts = study.first(scenario, **study.given(given, "first"))
        if parts is not None:
            show(arguments, parts, [part.records() if isinstance(part, Grid) else part for part in parts])
            return
    study = next((STUDIES[name] for option, name in study.otherwise.items() if given[option]), study)
    out = check_output_directory(arguments.out)
    try:
        with status(arguments.quiet) as progress:
            summary, notes = study.carry_out(scenario, out, given, progress)
    finally:
        remove_left(out)  # of children that were killed while they wrote
    if arguments.json or not arguments.quiet:
        show(arguments, [*study.tables(summary), *notes, _left_out(scenario), study.written(summary, out)], summary)


def _left_out(scenario: Scenario) -> str | None:
    """What of an own arm the simulation leaves out, said once a run."""
    if scenario.arm.file is None:
        return None
    from flipdiagram.robot.survey import left_out

    return left_out(scenario.arm)


def diagram(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """The block diagram as a picture or text, or its poles."""
    if arguments.poles:
        from flipdiagram.cli.poles import poles

        return poles(arguments, scenario)
    from flipdiagram.cli.diagram import data_of, drawing_of, table_of, write

    drawing = drawing_of(scenario, arguments)
    if arguments.json:
        print_json(data_of(drawing))
    elif arguments.table and sys.stdout.isatty():
        show(arguments, [table_of(drawing)])
    elif arguments.table:
        print(drawing.rates().to_markdown(), end="")
    if arguments.out is not None or not (arguments.table or arguments.json):
        write(drawing, arguments.format, arguments.out)


def arm(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Whether an arm can flip, and what its file leaves out; raises PlanningError after the report where it cannot."""
    from flipdiagram.cli.arm import check, report

    with status(arguments.json) as progress:
        progress("looking at the arm, and planning a flip")
        found, problem = check(scenario)
    show(arguments, report(found), found)
    if problem is not None:
        raise problem


def info(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """What a result file holds."""
    from flipdiagram.results import info

    grid = info(arguments.file)
    show(arguments, [grid], {name: text for name, text in grid.rows})


def completion(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """The completion script of a shell."""
    from flipdiagram.cli.completion import script

    text = script(arguments.shell)
    show(arguments, [text.removesuffix("\n")], {"shell": arguments.shell, "script": text})


def scenario(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Every field with its unit."""
    text = scenario.to_yaml(comments=True)
    show(arguments, [text.removesuffix("\n")], scenario.model_dump(mode="json"))


def show(arguments: argparse.Namespace, parts: Sequence[Grid | str | None], data: Any = None) -> None:
    """Print tables that have rows, and lines of text; with --json the data instead, and nothing else."""
    if arguments.json:
        print_json(data)
        return
    for part in parts:
        if isinstance(part, str):
            print(part)
        elif part is not None and part.rows:
            console().print(part.rich())


def print_json(data: Any) -> None:
    """Data on stdout as JSON."""
    print(json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False))


@contextmanager
def status(quiet: bool) -> Iterator[Callable[[str], Any]]:
    """A context that gives progress(text): one moving line on stderr where that is a terminal."""
    stderr = None if quiet or not sys.stderr.isatty() else console(stderr=True)
    if stderr is None:  # in a log an error shall be the only line
        yield silent
    else:
        with stderr.status("") as line:
            yield line.update
