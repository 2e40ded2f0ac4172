"""The drawings of `flipdiagram diagram`: which diagram is drawn, and where the drawing goes."""

import argparse
import sys
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.diagrams.one_dof import build_controller, build_experiment
from flipdiagram.drawing import Drawing, draw
from flipdiagram.errors import InputError
from flipdiagram.files import write_atomically
from flipdiagram.grid import Grid
from flipdiagram.scenario.scenario import Scenario

SUFFIXES = {".dot": "dot", ".gv": "dot", ".svg": "svg", ".png": "png", ".mmd": "mermaid", ".md": "mermaid"}


def drawing_of(scenario: Scenario, options: argparse.Namespace) -> Drawing:
    """The drawing of an architecture's loop, or of the 1-DOF loop of section III; raises InputError."""
    if not options.one_dof:
        return draw(build_loop(scenario, options.architecture), depth=options.depth, rates=options.rates)
    loop = build_experiment(build_controller(options.architecture, scenario.one_dof), scenario.one_dof)
    # the controller is a diagram of its own there: open, it is the figure
    return draw(loop, depth=options.depth + 1, rates=options.rates)


def table_of(drawing: Drawing) -> Grid:
    """Rates, ports and feed-through of what is drawn."""
    head, *rows = drawing.rates().cells()
    return Grid(head, rows, whole=["sample time"])


def data_of(drawing: Drawing) -> dict[str, Any]:
    """The same as `table_of`, for JSON: a port by its name has its number of elements, null where it is no vector."""
    return {
        "systems": [
            {
                "name": row.name,
                "class": row.system_class,
                "state": row.timing.kind,
                "period_s": row.timing.period or None,
                "offset_s": row.timing.offset,
                "inputs": {port.name: port.size for port in row.inputs},
                "outputs": {port.name: port.size for port in row.outputs},
                "feedthrough": row.feedthrough,
            }
            for row in drawing.rates()
        ]
    }


def write(drawing: Drawing, format: str | None, out: Path | None) -> None:
    """Write a drawing to a file, or to stdout; the format follows from the file's ending where none is named.

    Raises InputError for an unknown ending, and for a picture on a terminal; MissingProgramError where graphviz is
    needed and absent.
    """
    if format is None:
        if out is not None and out.suffix.lower() not in SUFFIXES:
            raise InputError(f"--out = '{out}' ends in no known format; valid is {', '.join(SUFFIXES)}, or --format")
        format = "mermaid" if out is None else SUFFIXES[out.suffix.lower()]
    if format == "png" and out is None and sys.stdout.isatty():
        problem = "--format png is no text for a terminal"
        raise InputError.of("--out", None, "--out FILE, or a pipe", problem)
    content: str | bytes = getattr(drawing, format)()
    if out is not None:
        write_atomically(out, content)
    elif isinstance(content, str):
        sys.stdout.write(content if content.endswith("\n") else content + "\n")
    else:
        sys.stdout.buffer.write(content)
