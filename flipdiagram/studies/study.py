"""What a study is: one record of its command, its run, its figures, its tables, and how its results are read."""

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from flipdiagram.errors import InputError
from flipdiagram.folders import renewed
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.scenario.work import Work, flip_work
from flipdiagram.scenario.yaml_reader import show

Summary = Mapping[str, Any]
"""summary.json as read."""
Progress = Callable[[str], None]


def silent(text: str) -> None:
    """Progress that nobody is told."""


@dataclass(frozen=True)
class Later:
    """A function named 'module:function', imported when it is called: a record costs no import of Drake."""

    path: str

    def __call__(self, *arguments: Any, **settings: Any) -> Any:
        """Call the function."""
        module, name = self.path.split(":")
        return getattr(import_module(f"flipdiagram.{module}"), name)(*arguments, **settings)


class Option:
    """An option of a study's command: its names, the settings of argparse, and which of the functions receive it."""

    def __init__(self, *names: str, to: Sequence[str] = ("run",), **settings: Any) -> None:
        self.names, self.to, self.settings = names, to, settings
        self.dest: str = settings.get("dest", names[0].lstrip("-").replace("-", "_"))


def flag(name: str, text: str, to: Sequence[str] = ("run",)) -> Option:
    """An option without a value."""
    return Option(name, to=to, action="store_true", help=text)


def architecture(name: str) -> str:
    """The name of one of the four controllers, as argparse's `type`."""
    if name not in ARCHITECTURES:
        raise argparse.ArgumentTypeError(f"unknown architecture '{name}'; choose from {', '.join(ARCHITECTURES)}")
    return name


MOST = 1000
"""Processes side by side, or points of an axis."""


def positive(text: str) -> int:
    """A whole number from 1 to `MOST`, as argparse's `type`."""
    with suppress(ValueError):
        if 0 < (number := int(text)) <= MOST:
            return number
    raise argparse.ArgumentTypeError(f"{show(text)} is not valid; valid is a whole number from 1 to {MOST}")


class _Each(argparse.Action):
    """Keeps the first of equal values."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        setattr(namespace, self.dest, list(dict.fromkeys(values)))


ARCHITECTURE = Option(
    "--architecture",
    dest="architectures",
    nargs="+",
    type=architecture,
    action=_Each,
    default=list(ARCHITECTURES),
    metavar="A",
    help=f"controllers to run (all of {', '.join(ARCHITECTURES)})",
)
JSON = flag("--json", "print the results as JSON, and nothing else", to=("first",))
YES = flag("--yes", "even if it takes longer than limit_hours, or a flip than half an hour")
JOBS = Option("--jobs", type=positive, metavar="N", help="processes side by side (one per core)")


def nothing(summary: Summary, *_: Any, **__: Any) -> list[Any]:
    """No figures."""
    return []


@dataclass(frozen=True)
class Study:
    """One study; the command line, the report, `info`, completion and the contract suite loop over these records.

    Args:
        name: as in the schema 'flipdiagram/<name>/1' and in the folder out/<name>.
        text: what its command does, in a line.
        run: run(scenario, out, progress=, **options) writes summary.json and what belongs to it.
        figures: figures(summary, out, progress=, **options) draws them into the folder; notes for the user.
        tables: tables(summary) gives the Grids and lines of text that a terminal shows.
        read: read(summary, folder) gives its results as xarray Datasets with units.
        options: of its command, beside --scenario, --out and --quiet.
        command: name of its command; '' where it has none of its own.
        file: name of its summary.
        success: what is judged, and the words for success.
        first: first(scenario, **options) does what some options ask for before a run, or in its place: then what is
            shown of it, None where the run is to follow.
        otherwise: {option: study} that runs in its place where the option is given.
        stored: stored(scenario, out, **options) gives the summary of an earlier run that would come out the same.
        work: what one of its runs costs, by the fields of the scenario; above a limit it needs --yes.
        written: written(summary, out) is the last line.
    """

    name: str
    text: str
    run: Callable[..., Any]
    read: Callable[..., Any]
    figures: Callable[..., list[str]]
    tables: Callable[..., list[Any]]
    options: tuple[Option, ...]
    command: str
    file: str = "summary.json"
    success: tuple[str, str] = ("block", "turned over")
    first: Callable[..., list[Any] | None] | None = None
    otherwise: Mapping[str, str] = field(default_factory=dict)
    stored: Callable[..., Any] | None = None
    work: Work = flip_work
    written: Callable[[Summary, Path], str] = lambda summary, out: f"written to {out}"

    @property
    def schema(self) -> str:
        """What its summary.json begins with."""
        return f"flipdiagram/{self.name}/1"

    def carry_out(
        self, scenario: Scenario, out: Path, arguments: Mapping[str, Any], progress: Progress
    ) -> tuple[Summary, list[str]]:
        """Run it and draw its figures, so that `out` holds this run's results and nobody's else: summary and notes."""
        with self.replacing(out):
            self.run(scenario, out, progress=progress, **self.given(arguments, "run"))
            summary: Summary = json.loads((out / self.file).read_text(encoding="utf-8"))
            return summary, self.figures(summary, out, progress=progress, **self.given(arguments, "figures"))

    @contextmanager
    def replacing(self, out: Path) -> Iterator[None]:
        """`folders.renewed` of its results; InputError where another study's stand there."""
        schema = self.schema
        with suppress(OSError, ValueError, AttributeError):  # no summary, or none of ours
            schema = str(json.loads((out / self.file).read_text(encoding="utf-8")).get("schema"))
        if schema.startswith("flipdiagram/") and schema.split("/")[1] != self.name:
            problem = f"--out = '{out}' holds results of another study, {show(schema)}"
            raise InputError.of("--out", out, "another folder", problem)
        with renewed(out, self.file):
            yield

    def given(self, arguments: Mapping[str, Any], to: str) -> dict[str, Any]:
        """Those of the arguments that one of its functions receives."""
        return {o.dest: arguments[o.dest] for o in self.options if to in o.to and o.dest in arguments}
