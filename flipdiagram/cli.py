"""The command line: parses, calls one function of the library, prints.

Exit codes: 0 done, 2 bad input, 3 the physics or the planner said no, each error one line on stderr.
What a command needs is imported when it runs, so that help and errors come at once.
"""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

from flipdiagram.errors import FlipdiagramError, ScenarioError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from flipdiagram.scenario import Scenario

INTERRUPTED = 130
SHORT = {"--start-y": "task.start_y"}
EPILOG = (
    "Every field of the scenario is an option: --controller.k_p 400 or --controller.k-p=400. "
    "`flipdiagram scenario` prints all fields with their units. --start-y M is short for --task.start_y M."
)


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
        return ScenarioError.exit_code


def _run(argv: list[str]) -> int:
    rest, overrides = _split_overrides(argv)
    parser = _parser()
    try:
        arguments = parser.parse_args(rest)
    except SystemExit as done:  # --help
        return int(done.code or 0)
    if arguments.version:
        from flipdiagram.files import versions

        numbers = versions()
        print(f"flipdiagram {numbers['flipdiagram']} (Drake {numbers['drake']})")
        return 0
    commands = {"plan": _plan, "flip": _flip, "frequency": _frequency, "scenario": _scenario}
    if arguments.command is None:
        parser.error(f"no command; choose from {', '.join(commands)}")
    commands[arguments.command](arguments, _load_scenario(arguments.scenario, overrides))
    return 0


def _plan(arguments: argparse.Namespace, scenario: Scenario) -> None:
    from flipdiagram.files import check_output_directory, write_atomically, write_summary

    out = check_output_directory(arguments.out)

    from flipdiagram import figures
    from flipdiagram.planning import plan_motion

    with _status(arguments.quiet) as progress:
        progress("planning")
        plan = plan_motion(scenario)
    write_atomically(out / "plan.json", plan.to_json())
    figures.save(cast("Figure", figures.plot_plan(plan)[0].figure), out / "plan")
    write_summary(out / "summary.json", "plan", scenario, {"plan": plan.summary()})
    if not arguments.quiet:
        _console().print(_summary_table(plan.summary()))
        print(f"written to {out}")


def _flip(arguments: argparse.Namespace, scenario: Scenario) -> None:
    from flipdiagram.files import check_output_directory

    out = check_output_directory(arguments.out)

    from flipdiagram.gallery import turnover_pictures
    from flipdiagram.studies import turnover
    from flipdiagram.tables import turnover_table

    with _status(arguments.quiet) as progress:
        result = turnover.run(
            scenario,
            out,
            list(dict.fromkeys(arguments.architecture)),
            quick=arguments.quick,
            jobs=arguments.jobs,
            progress=progress,
        )
        replay = not (arguments.no_replay or arguments.quick)
        notes = turnover_pictures(result, replay=replay, progress=progress)
    if not arguments.quiet:
        _console().print(turnover_table(result))
        for note in notes:
            print(note)
        print(f"written to {out}")


def _frequency(arguments: argparse.Namespace, scenario: Scenario) -> None:
    from flipdiagram.files import check_output_directory

    out = check_output_directory(arguments.out)

    from flipdiagram.frequency_figures import write_figures
    from flipdiagram.frequency_tables import claims_table, realisation_table, write_markdown
    from flipdiagram.studies import frequency

    with _status(arguments.quiet) as progress:
        result = frequency.run(scenario, out, quick=arguments.quick, progress=progress)
        write_markdown(result, out)
        write_figures(result.summary(), out)
    if not arguments.quiet:
        for table in [claims_table(result)] + ([realisation_table(result)] if result.rows else []):
            _console().print(table)
        print(f"{result.steps / 1e6:.0f} M channel-steps in {result.seconds:.1f} s; written to {out}")


def _scenario(arguments: argparse.Namespace, scenario: Scenario) -> None:
    print(scenario.to_yaml(comments=True), end="")


class _Parser(argparse.ArgumentParser):
    """argparse, but an error is one line like all others."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        raise ScenarioError(f"{message}; see `{self.prog} --help`")


def _parser() -> _Parser:
    text = "A robot arm turns a block over on a spatula."
    parser = _Parser(prog="flipdiagram", description=text, epilog=EPILOG)
    parser.add_argument("--version", action="store_true", help="print the versions of flipdiagram and Drake")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")

    common = _Parser(add_help=False)
    common.add_argument("--scenario", metavar="FILE", help="YAML file; what it leaves out keeps its default")
    written = _Parser(add_help=False)
    written.add_argument("--quiet", action="store_true", help="print errors only")

    def add(name: str, text: str, *parents: _Parser) -> _Parser:
        family = [common, *parents]
        return commands.add_parser(name, help=text, description=text, epilog=EPILOG, parents=family)

    plan = add("plan", "Plan the motion only: summary, plan and figure.", written)
    plan.add_argument("--out", type=Path, default=Path("out/plan"), metavar="DIR", help="(out/plan)")

    flip = add("flip", "Plan the motion and simulate it under each controller.", written)
    flip.add_argument("--out", type=Path, default=Path("out/turnover"), metavar="DIR", help="(out/turnover)")
    flip.add_argument(
        "--architecture", nargs="+", type=_architecture, default=_architectures(), metavar="A",
        help=f"controllers to run (all of {', '.join(_architectures())})",
    )  # fmt: skip
    flip.add_argument("--quick", action="store_true", help="shorter hold, no snapshots and replay")
    flip.add_argument("--no-replay", action="store_true", help="no snapshots and no replay.html")
    flip.add_argument("--jobs", type=_positive, metavar="N", help="processes side by side (one per core)")

    frequency = add("frequency", "Measure gain, phase, error, torque and noise of the 1-DOF loop.", written)
    frequency.add_argument("--out", type=Path, default=Path("out/frequency"), metavar="DIR", help="(out/frequency)")
    frequency.add_argument("--quick", action="store_true", help="fewer frequencies, no table of realisations")

    add("scenario", "Print the scenario as YAML, each field with its unit.")
    return parser


def _split_overrides(argv: list[str]) -> tuple[list[str], dict[str, str]]:
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
            raise ScenarioError(f"option {name} has no value; valid is {name} VALUE")
        overrides[path] = value
    return rest, overrides


def _load_scenario(file: str | None, overrides: dict[str, str]) -> Scenario:
    from flipdiagram.scenario import Scenario, load
    from flipdiagram.scenario_io import parse_value

    scenario = Scenario() if file is None else load(file)
    return scenario.with_overrides({path: parse_value(text, path) for path, text in overrides.items()})


def _architectures() -> list[str]:
    from flipdiagram.scenario import ARCHITECTURES

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


def _console(stderr: bool = False) -> Console:
    from rich.console import Console

    # rich colours terminals only; into a file or pipe it would fold tables at 80 columns
    stream = sys.stderr if stderr else sys.stdout
    return Console(file=stream, width=None if stream.isatty() else 160)


def _status(quiet: bool) -> Any:
    """A context that gives progress(text): one moving line on a terminal, else a line each on stderr."""
    if quiet:
        return nullcontext(lambda text: None)
    console = _console(stderr=True)
    if not console.is_terminal:
        return nullcontext(lambda text: print(text, file=sys.stderr, flush=True))
    return _Spinner(console)


class _Spinner:
    """Progress as one line that moves and vanishes."""

    def __init__(self, console: Console) -> None:
        self.status = console.status("")

    def __enter__(self) -> Any:
        self.status.start()
        return self.status.update

    def __exit__(self, *exception: object) -> None:
        self.status.stop()


def _summary_table(summary: dict[str, Any]) -> Any:
    from rich.table import Table

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return ", ".join(f"{name} {text(item)}" for name, item in value.items())
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    table = Table("planned motion", "value")
    for name, value in summary.items():
        table.add_row(name, text(value))
    return table


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


if __name__ == "__main__":
    sys.exit(main())
