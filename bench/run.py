"""Measures the speed of flipdiagram against its targets, prints it, and writes bench.json and bench.md.

    python bench/run.py --out out/bench [--quick] [--only PIECE ...]

It measures, others judge: the exit code is 0 whatever the verdicts say.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rich.console import Console

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:  # run as a script: only its own folder is there
    sys.path.insert(0, str(ROOT))

from bench import tables  # noqa: E402
from bench.results import Section  # noqa: E402
from flipdiagram import __version__  # noqa: E402

REPETITIONS = {
    "campaign": 1,
    "command": 3,
    "frequency": 7,
    "plan": 7,
    "resolve": 6,
    "replan": 7,
    "simulation": 5,
    "pancake": 2,
}
"""How often each piece is measured, once with --quick; `resolve` and `replan` solve all linearisations each time."""
BUSY = 0.5
"""Load average per core from which other work on the machine is mentioned."""

UNDISTURBED = 0.95
"""Processor time per wall time from which a piece is said to have run undisturbed."""


def _command(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import command

    yield command.measure(repetitions, quick)


def _frequency(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import frequency

    yield from frequency.sections(repetitions, quick)


def _plan(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import planning

    yield planning.measure(repetitions)


def _resolve(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import resolve

    yield resolve.measure(repetitions)


def _replan(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import optimality, replan, replan_loop
    from bench.contenders import casadi_plan

    yield from replan_loop.sections(repetitions, quick)
    yield from replan.sections(repetitions, quick)
    if find_spec(casadi_plan.PACKAGE):
        yield optimality.measure(4 if quick else optimality.STARTS)


def _simulation(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import boxes, engines, loop
    from flipdiagram.planning import plan_motion
    from flipdiagram.scenario.scenario import Scenario

    scenario = Scenario()
    motion = plan_motion(scenario)
    yield from loop.sections(scenario, motion, repetitions)
    yield boxes.measure(scenario, motion, repetitions)
    yield engines.measure(repetitions, quick)


def _campaign(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import campaign

    yield from campaign.sections(repetitions, quick)


def _pancake(repetitions: int, quick: bool) -> Iterator[Section]:
    from bench import pancake

    yield pancake.measure(repetitions, quick)


PIECES: dict[str, Callable[[int, bool], Iterator[Section]]] = {
    "command": _command,  # first: Linux counts a parent's memory for its children, and this process is still small
    "plan": _plan,
    "resolve": _resolve,
    "replan": _replan,
    "simulation": _simulation,
    "pancake": _pancake,
    "campaign": _campaign,
    "frequency": _frequency,  # last: the threads of what it imports stay
}


def machine() -> dict[str, Any]:
    """What the numbers depend on."""
    return {
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **{name: version(name) for name in ("drake", "numpy")},
        "flipdiagram": __version__,
    }


def with_processor_time(sections: Iterator[Section]) -> Iterator[Section]:
    """Add to each section how much of a core it had."""
    before = os.times()
    for section in sections:
        after = os.times()
        share = (sum(after[:4]) - sum(before[:4])) / (after.elapsed - before.elapsed)
        disturbed = "" if share > UNDISTURBED else ": NOT undisturbed, other work on the machine was in the way"
        section.checks.append(f"processor time {100 * share:.0f} % of wall time{disturbed}")
        yield section
        before = os.times()


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="Speed of flipdiagram against its targets.")
    parser.add_argument("--out", type=Path, default=Path("out/bench"), help="folder for bench.json and bench.md")
    parser.add_argument("--quick", action="store_true", help="each piece once, less than 30 s in all")
    parser.add_argument("--only", nargs="+", choices=PIECES, default=list(PIECES), help="pieces to measure")
    arguments = parser.parse_args(argv)

    console = Console()
    if not console.is_terminal:
        console = Console(width=tables.WIDTH)
    facts, begin = machine(), time.perf_counter()
    console.print(", ".join(f"{name} {value}" for name, value in facts.items()), style="dim", highlight=False)
    if facts["load"] > BUSY * facts["cores"]:
        console.print("the machine is busy with other work: trust ratios, not times", style="yellow")
    sections: list[Section] = []
    for name in [name for name in PIECES if name in arguments.only]:
        pieces = PIECES[name](1 if arguments.quick else REPETITIONS[name], arguments.quick)
        for section in with_processor_time(pieces):
            sections.append(section)
            tables.to_terminal(console, section)
            if section.plot is not None:
                section.plot(arguments.out)
    console.print(tables.verdicts(sections))

    from flipdiagram.files import write_atomically

    complete = set(arguments.only) == set(PIECES)
    report = {"schema": "flipdiagram/bench/1", "quick": arguments.quick, "complete": complete, "machine": facts}
    report["sections"] = [section.as_dict() for section in sections]
    write_atomically(arguments.out / "bench.json", json.dumps(report, indent=1))
    write_atomically(arguments.out / "bench.md", tables.to_markdown(sections, facts))
    console.print(f"measured in {time.perf_counter() - begin:.0f} s, written to {arguments.out}", highlight=False)


if __name__ == "__main__":
    main()
