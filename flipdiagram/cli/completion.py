"""Completion of the command line by the shell: commands, options, their choices, and every field of the scenario.

The scripts are static text made from the parser itself by `shtab`: a shell that completes starts no Python.
`eval "$(flipdiagram completion bash)"`, the same with zsh, and `flipdiagram completion fish | source` switch it on.
"""

import argparse
from typing import get_args

import shtab

from flipdiagram.cli.options import SHORT, parser
from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.scenario.text import explain, fields_of
from flipdiagram.studies.borders.maps import maps_of

SHELLS = ("bash", "zsh", "fish")

PLACES = {"FILE": shtab.FILE, "DIR": shtab.DIRECTORY}
"""What to complete for an argument, by the name that its help gives it."""


def script(shell: str) -> str:
    """The completion script for bash, zsh or fish; InputError for another shell."""
    if shell not in SHELLS:
        raise InputError(f"unknown shell '{shell}'; choose from {', '.join(SHELLS)}")
    return shtab.complete(_full_parser(), shell).rstrip() + "\n"


def _full_parser() -> argparse.ArgumentParser:
    """The parser of all commands with what it leaves to later checks spelt out: fields, names, files and folders."""
    whole = parser()
    named = {"architecture": ARCHITECTURES, "architectures": ARCHITECTURES, "shell": SHELLS}
    named["maps"] = (*maps_of(Scenario()), "variations")
    (commands,) = (action for action in whole._actions if isinstance(action, argparse._SubParsersAction))
    for command in commands.choices.values():
        for action in command._actions:
            if action.choices is None:
                action.choices = named.get(action.dest)
            if isinstance(action.metavar, str) and action.metavar in PLACES:
                action.complete = PLACES[action.metavar]  # type: ignore[attr-defined]  # shtab's own attribute
        if any(action.dest == "scenario" for action in command._actions):
            _add_fields(command)
    return whole


def _add_fields(command: argparse.ArgumentParser) -> None:
    """Every field as an option `--section.field VALUE` with its text and unit, and the short names of some."""
    short = {path: name for name, path in SHORT.items()}
    for path, field in fields_of(Scenario).items():
        names = [f"--{path}"] + ([short[path]] if path in short else [])
        choices = [str(value) for value in get_args(field.annotation) if isinstance(value, str)]
        choices = ["true", "false"] if field.annotation is bool else choices
        text = explain(field).replace("%", "%%")
        command.add_argument(*names, help=text, choices=choices or None, metavar=None if choices else "VALUE")
