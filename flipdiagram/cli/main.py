"""The command line: parses, runs one command, turns errors into exit codes.

Exit codes: 0 done, 2 bad input, 3 the physics or the planner said no, 130 interrupted, each error one line on stderr.
What a process does with signals stands in `__main__`.
"""

import errno
import logging
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import TextIO

from flipdiagram.cli import commands
from flipdiagram.cli.options import COMMANDS, parser, split_overrides
from flipdiagram.errors import FlipdiagramError, InputError
from flipdiagram.scenario.scenario import Scenario, load_scenario
from flipdiagram.scenario.yaml_reader import parse_value
from flipdiagram.studies.registry import COMMANDS as STUDY_COMMANDS

INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    _guard_streams()
    code, said = _outcome(sys.argv[1:] if argv is None else list(argv))
    for stream, text in ((sys.stdout, ""), (sys.stderr, said and f"flipdiagram: {said}\n")):
        try:
            stream.write(text)
            stream.flush()
        except (OSError, ValueError):  # full or closed: nobody can be told
            _drop(stream)
    return code


def _outcome(argv: list[str]) -> tuple[int, str]:
    """The exit code, and what is to be said on stderr."""
    try:
        code = _run(argv)
        sys.stdout.flush()
        return code, ""
    except FlipdiagramError as error:
        return error.exit_code, f"error: {' '.join(str(error).split())}"
    except KeyboardInterrupt:
        return INTERRUPTED, "interrupted"
    except BrokenPipeError:  # the reader, `head` perhaps, has what it wanted
        _drop(sys.stdout)
        return 0, ""
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        _drop(sys.stdout)
        return InputError.exit_code, f"error: {error.strerror}"


def _is_news(record: logging.LogRecord) -> bool:
    return record.levelno >= logging.WARNING


def _run(argv: list[str]) -> int:
    # what Drake's solvers report of their progress is no news; a level would be reset where Drake is imported
    logging.getLogger("drake").addFilter(_is_news)
    rest, overrides = split_overrides(argv)
    options = parser()
    try:
        arguments = options.parse_args(rest)
    except SystemExit as done:  # --help
        return int(done.code or 0)
    if arguments.command is None and not arguments.version:
        options.error("no command; choose from " + ", ".join(COMMANDS))
    if arguments.version:
        commands.print_version()
        return 0
    if arguments.command not in ("scenario", "completion"):
        _check_encoding()
    if "scenario" not in arguments and overrides:
        options.error(f"'{arguments.command}' takes no fields of a scenario")
    file = getattr(arguments, "scenario", None)
    scenario = Scenario() if file is None else load_scenario(file)
    fields = {path: parse_value(text, path) for path, text in overrides.items()}
    # an argument of a command may be a field too, such as the file of `arm check`
    fields |= {name: value for name, value in vars(arguments).items() if "." in name and value is not None}
    scenario = scenario.with_overrides(fields)
    if (study := STUDY_COMMANDS.get(arguments.command)) is not None:
        commands.run_study(study, arguments, scenario)
    else:
        getattr(commands, arguments.command)(arguments, scenario)
    return 0


def _check_encoding() -> None:
    if sys.getfilesystemencoding() == "ascii":  # Drake cannot be imported then
        problem = "names of files are ASCII in this environment (LC_ALL, LANG)"
        raise InputError.of("PYTHONUTF8", os.environ.get("PYTHONUTF8"), "PYTHONUTF8=1 or LC_ALL=C.UTF-8", problem)


def _drop(stream: TextIO) -> None:
    # without this the interpreter's own last flush would complain
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _guard_streams() -> None:
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # θ on a terminal that has no Greek
