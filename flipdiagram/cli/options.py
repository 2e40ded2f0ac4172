"""The options of the command line: what may be written, checked as far as words alone can tell."""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from flipdiagram.errors import InputError

COMMANDS = (
    "plan",
    "flip",
    "frequency",
    "experiment",
    "borders",
    "replanning",
    "place",
    "campaign",
    "report",
    "diagram",
    "info",
    "scenario",
    "completion",
)
FORMATS = ("dot", "svg", "png", "mermaid")
SHORT = {"--start-y": "task.start_y"}
EPILOG = (
    "Every field of the scenario is an option: --controller.k_p 400 or --controller.k-p=400. "
    "`flipdiagram scenario` prints all fields with their units. --start-y M is short for --task.start_y M."
)


class _Formatter(argparse.HelpFormatter):
    """Names of commands and options beside their texts, not above them."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=26)


class _Parser(argparse.ArgumentParser):
    """argparse, but an error is one line like all others."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings, allow_abbrev=False, formatter_class=_Formatter)

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see `{self.prog} --help`")


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    text = "A robot arm turns a block over on a spatula."
    whole = _Parser(prog="flipdiagram", description=text, epilog=EPILOG)
    whole.add_argument("--version", action="store_true", help="print the versions of flipdiagram and Drake")
    commands = whole.add_subparsers(dest="command", metavar="COMMAND")

    common = _Parser(add_help=False)
    common.add_argument("--scenario", metavar="FILE", help="YAML file; what it leaves out keeps its default")

    def add(name: str, text: str, out: str | None = None, scenario: bool = True) -> _Parser:
        command = commands.add_parser(
            name, help=text, description=text, epilog=EPILOG if scenario else None, parents=[common] if scenario else []
        )
        if out is not None:
            command.add_argument("--quiet", action="store_true", help="print errors only")
            command.add_argument("--out", type=Path, default=Path(out), metavar="DIR", help=f"results ({out})")
        return command

    add("plan", "Plan the motion only: summary, plan and figure.", "out/plan")

    flip = add("flip", "Plan the motion and simulate it under each controller.", "out/turnover")
    _architectures_option(flip)
    flip.add_argument("--quick", action="store_true", help="shorter hold, no snapshots and replay")
    flip.add_argument("--meshcat", action="store_true", help="watch the simulation in a browser, at half speed")
    flip.add_argument("--no-replay", action="store_true", help="no snapshots and no replay.html")
    _jobs_option(flip)

    frequency = add("frequency", "Measure gain, phase, error, torque and noise of the 1-DOF loop.", "out/frequency")
    frequency.add_argument("--quick", action="store_true", help="fewer frequencies, no table of realisations")

    experiment = add("experiment", "Fly eight starts under each controller and judge E1-E8.", "out/experiment")
    experiment.add_argument("--starts", nargs="+", type=float, metavar="M", help="starts on y [m] (0 0.02 ... 0.14)")
    _architectures_option(experiment)
    experiment.add_argument("--quick", action="store_true", help="two starts only")
    _jobs_option(experiment)

    borders = add("borders", "Map where each controller stops working.", "out/borders")
    text = "disturbance, payload, clearance, gains, cone, inertia, sensing, variations (all)"
    borders.add_argument("--maps", nargs="+", metavar="MAP", help=text)
    borders.add_argument("--resolution", type=_positive, metavar="N", help="points per axis (5 or 6)")
    borders.add_argument("--quick", action="store_true", help="two maps of two points per axis")
    _jobs_option(borders)

    replanning = add("replanning", "Fly disturbed flips planned once, and again and again.", "out/replanning")
    replanning.add_argument("--quick", action="store_true", help="two disturbances only")
    _jobs_option(replanning)

    place = add("place", "Lay the object down: it slides off the tilted spatula.", "out/place")
    _architectures_option(place)
    place.add_argument("--no-replay", action="store_true", help="no replay.html")
    _jobs_option(place)

    campaign = add("campaign", "Fly thousands of uncertain flips: how often does each work?", "out/campaign")
    campaign.add_argument("file", nargs="?", metavar="FILE", help="the campaign as YAML, see examples/campaign.yaml")
    campaign.add_argument("--resume", action="store_true", help="go on with what --out holds: fly what is missing")
    campaign.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler, such as tcp://127.0.0.1:8786")
    campaign.add_argument("--yes", action="store_true", help="even if it takes longer than limit_hours")
    campaign.add_argument("--any-version", action="store_true", help="go on although code or versions have changed")
    campaign.add_argument("--tune", action="store_true", help="search the gains of the file's section `tune` instead")
    campaign.add_argument("--watch", type=Path, metavar="FILE", help="show a running campaign.sqlite")
    campaign.add_argument("--analyse", type=Path, metavar="FILE", help="analyse a campaign.sqlite again into --out")
    text = "write a campaign.sqlite as .csv, .parquet or .nc"
    campaign.add_argument("--export", type=Path, nargs=2, metavar=("FILE", "TO"), help=text)
    _jobs_option(campaign)

    report = add("report", "Run or reuse all studies; every claim measured, on one page.", "out/report")
    report.add_argument("--quick", action="store_true", help="under two minutes: coarse, two starts, few maps")
    _jobs_option(report)

    diagram = add("diagram", "Draw the block diagram of a controller, or of the 1-DOF loop.")
    diagram.add_argument("--architecture", type=_architecture, default="pd+ff+dob", metavar="A", help="(pd+ff+dob)")
    diagram.add_argument("--one-dof", action="store_true", help="the loop of section III instead of the robot's")
    diagram.add_argument("--format", choices=FORMATS, help="(from the ending of --out, else mermaid)")
    diagram.add_argument("--out", type=Path, metavar="FILE", help="where to write it (stdout)")
    diagram.add_argument("--depth", type=int, default=0, metavar="N", help="levels of inner diagrams opened (0)")
    diagram.add_argument("--rates", action="store_true", help="colour the boxes by sample time")
    diagram.add_argument("--table", action="store_true", help="print rates, ports and feed-through as a table")

    info = add("info", "Say what a result file holds: recording, summary or plan.", scenario=False)
    info.add_argument("file", metavar="FILE", help="a .nc, summary.json or plan.json, or a folder of results")

    completion = add("completion", "Print the completion script of a shell.", scenario=False)
    completion.add_argument("shell", metavar="SHELL", help='bash, zsh or fish: eval "$(flipdiagram completion bash)"')

    add("scenario", "Print the scenario as YAML, each field with its unit.")
    return whole


def split_overrides(argv: list[str]) -> tuple[list[str], dict[str, str]]:
    """(rest, {path: text}): the field overrides are the options with a dot in their name."""
    rest: list[str] = []
    overrides: dict[str, str] = {}
    words = iter(argv)
    for word in words:
        name, equals, text = word.partition("=")
        if not name.startswith("--") or not ("." in name or name in SHORT):
            rest.append(word)
            continue
        path = SHORT.get(name, name.removeprefix("--").replace("-", "_"))
        value = text if equals else next(words, None)
        if value is None or (not equals and value.startswith("--")):
            raise InputError(f"option {name} has no value; valid is {name} VALUE")
        overrides[path] = value
    return rest, overrides


def _architectures_option(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--architecture",
        nargs="+",
        type=_architecture,
        default=_architectures(),
        metavar="A",
        help=f"controllers to run (all of {', '.join(_architectures())})",
    )


def _jobs_option(command: argparse.ArgumentParser) -> None:
    command.add_argument("--jobs", type=_positive, metavar="N", help="processes side by side (one per core)")


def _architectures() -> list[str]:
    from flipdiagram.scenario.scenario import ARCHITECTURES

    return list(ARCHITECTURES)


def _architecture(name: str) -> str:
    if name not in _architectures():
        known = ", ".join(_architectures())
        raise argparse.ArgumentTypeError(f"unknown architecture '{name}'; choose from {known}")
    return name


def _positive(text: str) -> int:
    with suppress(ValueError):
        if (number := int(text)) > 0:
            return number
    raise argparse.ArgumentTypeError(f"'{text}' is not valid; valid is a whole number above 0")
