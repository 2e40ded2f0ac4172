"""The options of the command line: what may be written, checked as far as words alone can tell."""

import argparse
from pathlib import Path
from typing import Any, NoReturn

from flipdiagram.errors import InputError
from flipdiagram.studies.registry import COMMANDS as STUDY_COMMANDS
from flipdiagram.studies.study import JSON, YES, architecture

COMMANDS = (*STUDY_COMMANDS, "diagram", "arm", "info", "scenario", "completion")
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
    """The parser of all commands: those of the studies, then the smaller ones."""
    text = "A robot arm turns a block over on a spatula."
    whole = _Parser(prog="flipdiagram", description=text, epilog=EPILOG)
    whole.add_argument("--version", action="store_true", help="print the versions of flipdiagram and Drake")
    commands = whole.add_subparsers(dest="command", metavar="COMMAND")
    common = _Parser(add_help=False)
    common.add_argument("--scenario", metavar="FILE", help="YAML file; what it leaves out keeps its default")

    def add(name: str, text: str, scenario: bool = True) -> _Parser:
        epilog, parents = (EPILOG, [common]) if scenario else (None, [])
        command = commands.add_parser(name, help=text, description=text, epilog=epilog, parents=parents)
        command.add_argument(*JSON.names, **JSON.settings)
        return command

    for name, study in STUDY_COMMANDS.items():
        command = add(name, study.text)
        out = Path("out") / study.name
        command.add_argument("--quiet", action="store_true", help="print errors only")
        command.add_argument("--out", type=Path, default=out, metavar="DIR", help=f"results ({out})")
        for option in dict.fromkeys(option for option in (*study.options, YES) if option is not JSON):
            command.add_argument(*option.names, **option.settings)

    diagram = add("diagram", "Draw the block diagram of a controller, or of the 1-DOF loop.")
    diagram.add_argument("--architecture", type=architecture, default="pd+ff+dob", metavar="A", help="(pd+ff+dob)")
    diagram.add_argument("--one-dof", action="store_true", help="the loop of section III instead of the robot's")
    diagram.add_argument("--format", choices=FORMATS, help="(from the ending of --out, else mermaid)")
    diagram.add_argument("--out", type=Path, metavar="FILE", help="where to write it (stdout)")
    diagram.add_argument("--depth", type=int, default=0, metavar="N", help="levels of inner diagrams opened (0)")
    diagram.add_argument("--rates", action="store_true", help="colour the boxes by sample time")
    diagram.add_argument("--table", action="store_true", help="print rates, ports and feed-through as a table")
    text = "print the poles of the closed loop about its start; --out draws them (.svg, .png)"
    diagram.add_argument("--poles", action="store_true", help=text)

    arm = add("arm", "Check an arm of your own: limits, reach, what its file lacks, a start that works.")
    arm.add_argument("action", choices=("check",), help="what to do with it")
    what = "URDF, SDF or MJCF; --arm.base and --arm.flange name its links (the scenario's arm)"
    arm.add_argument("arm.file", nargs="?", metavar="FILE", help=what)

    info = add("info", "Say what a result file holds: recording, summary, plan or campaign.", scenario=False)
    what = "a .nc, .json or campaign.sqlite, an exported campaign, or a folder of results"
    info.add_argument("file", metavar="FILE", help=what)

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
