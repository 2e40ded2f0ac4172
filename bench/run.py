"""Measures the speed of flipdiagram against its targets, prints it, and writes bench.json and bench.md.

    python bench/run.py --out out/bench [--quick] [--only plan resolve simulation command]

It measures and does not judge: the exit code is 0 whatever the verdicts say.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # `bench` itself, where it is not installed

from bench import tables
from bench.results import Section

REPETITIONS = {"plan": 7, "resolve": 6, "simulation": 5, "command": 3}
QUICK = {"plan": 1, "resolve": 1, "simulation": 1, "command": 1}
"""How often each piece is repeated; `resolve` repeats all linearisations of a plan."""


def plan(repetitions: int, quick: bool) -> Iterator[Section]:
    """Planning from cold."""
    from bench import planning

    yield planning.measure(repetitions)


def resolve(repetitions: int, quick: bool) -> Iterator[Section]:
    """A built program solved again."""
    from bench import resolve

    yield resolve.measure(repetitions)


def simulation(repetitions: int, quick: bool) -> Iterator[Section]:
    """One simulation and its boxes."""
    from bench import boxes, loop
    from flipdiagram.planning import plan_motion
    from flipdiagram.scenario import Scenario

    scenario = Scenario()
    motion = plan_motion(scenario)
    yield loop.measure(scenario, motion, repetitions)
    yield boxes.measure(scenario, motion, repetitions)


def command(repetitions: int, quick: bool) -> Iterator[Section]:
    """The whole command."""
    from bench import command

    yield command.measure(repetitions, quick)


PIECES: dict[str, Callable[[int, bool], Iterator[Section]]] = {
    "command": command,  # first, while this process is small and has no part in the memory of its children
    "plan": plan,
    "resolve": resolve,
    "simulation": simulation,
}


def machine() -> dict[str, Any]:
    """What the numbers depend on."""
    from importlib.metadata import version

    return {
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
        "drake": version("drake"),
        "numpy": version("numpy"),
        "flipdiagram": version("flipdiagram"),
        "system": f"{platform.system()} {platform.machine()}",
    }


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="Speed of flipdiagram against its targets.")
    parser.add_argument("--out", type=Path, default=Path("out/bench"), help="folder for bench.json and bench.md")
    parser.add_argument("--quick", action="store_true", help="each piece once: less than 30 s")
    parser.add_argument("--only", nargs="+", choices=PIECES, default=list(PIECES), help="pieces to measure")
    arguments = parser.parse_args()

    from rich.console import Console

    from flipdiagram.files import write_atomically

    console, begin = Console(), time.perf_counter()
    width = None if console.is_terminal else tables.WIDTH
    console = Console(width=width)
    facts = machine()
    console.print(", ".join(f"{name} {value}" for name, value in facts.items()), style="dim")
    sections = []
    for name in [name for name in PIECES if name in arguments.only]:
        repetitions = (QUICK if arguments.quick else REPETITIONS)[name]
        for section in PIECES[name](repetitions, arguments.quick):
            sections.append(section)
            tables.to_terminal(console, section)
    console.print(tables.verdicts(sections))
    report = {"schema": "flipdiagram/bench/1", "quick": arguments.quick, "machine": facts}
    report["sections"] = [section.as_dict() for section in sections]
    write_atomically(arguments.out / "bench.json", json.dumps(report, indent=1))
    write_atomically(arguments.out / "bench.md", tables.to_markdown(sections, facts))
    console.print(f"measured in {time.perf_counter() - begin:.0f} s, written to {arguments.out}")


if __name__ == "__main__":
    main()
