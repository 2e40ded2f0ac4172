"""The command line: parses, runs one command, turns errors into exit codes.

Exit codes: 0 done, 2 bad input, 3 the physics or the planner said no, each error one line on stderr.
"""

import errno
import os
import sys
from collections.abc import Sequence

from flipdiagram.cli import commands
from flipdiagram.cli.options import COMMANDS, parser, split_overrides
from flipdiagram.errors import FlipdiagramError, InputError
from flipdiagram.scenario.scenario import Scenario, load
from flipdiagram.scenario.yaml_reader import parse_value
from flipdiagram.studies.registry import COMMANDS as STUDY_COMMANDS

INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    _guard_streams()
    try:
        code = _run(sys.argv[1:] if argv is None else list(argv))
        sys.stdout.flush()
        return code
    except FlipdiagramError as error:
        print(f"flipdiagram: error: {' '.join(str(error).split())}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("flipdiagram: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        _drop_stdout()  # the reader, `head` perhaps, has what it wanted
        return 0
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        _drop_stdout()
        print(f"flipdiagram: error: {error.strerror}", file=sys.stderr)
        return InputError.exit_code


def _run(argv: list[str]) -> int:
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
    if "scenario" not in arguments and overrides:
        options.error(f"'{arguments.command}' takes no fields of a scenario")
    file = getattr(arguments, "scenario", None)
    scenario = Scenario() if file is None else load(file)
    scenario = scenario.with_overrides({path: parse_value(text, path) for path, text in overrides.items()})
    if (study := STUDY_COMMANDS.get(arguments.command)) is not None:
        commands.run_study(study, arguments, scenario)
    else:
        getattr(commands, arguments.command)(arguments, scenario)
    return 0


def _drop_stdout() -> None:
    # without this the interpreter's own last flush would complain
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _guard_streams() -> None:
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # θ on a terminal that has no Greek
