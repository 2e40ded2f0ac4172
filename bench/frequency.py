"""Section III: the compiled loop beside a hand-written one and other simulators; compiling; the whole study."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from bench.contenders import MODULES, hand_written
from bench.one_dof import Array, Numbers, compile_loop, trajectories
from bench.processes import Watched, fresh, watch
from bench.results import Section, Target
from bench.timing import in_turn, ratios, timed
from flipdiagram.compiled import CompiledDiagram
from flipdiagram.compiled.vectors import LANES

RATE, OF_HAND_WRITTEN, OF_JAXONOMY, OF_OTHERS = (Target(">=", v) for v in (30e6, 0.8, 4.0, 5000.0))
TWO_CORES, COMPILE, CACHED = Target(">=", 1.8), Target("<", 3.0), Target("<", 0.3)
FLAT = Target("<", 1.25)
"""Dearest by cheapest channel-step, 8 to 10 000 channels: what is called flat here."""
WALL, MEMORY = Target("<", 30.0), Target("<", 1e9)
AGREE = 1e-9
"""Largest difference of x from the compiled diagram's, relative to the largest |x| of the channel."""
CHECKED, CHECKED_TICKS = np.array([3.0, 30.0, 300.0]), 1000
STEPS, CHANNELS = 4_000_000, 100
EXACT = "compiled diagram, exact"
LONGER = 8
"""Times as many ticks for what would be over in 8 ms."""
LATE = 1_000_000
"""First tick of runs compared by channels, so that short runs have angles as large as those of long ones."""
SIZES = {"jaxonomy_loop": ((400, 2500), (1600, 1000), (6400, 250))}
"""Channels and ticks to time; one channel, 1000 ticks where a contender runs one at a time."""
MANY = (1, 8, 32, 104, 304, 1000, 3000, 10_000)
TEXT = (
    "One mass under gravity, PD + feed-forward + disturbance observer, sinusoidal command, 0.1 ms, exact plant;"
    " channels differ in frequency, 1 to 300 rad/s. Rates in channel-steps per second, no log, on one thread"
    " (jaxonomy as it comes, on all cores: its ratio is to the compiled diagram on all cores), all in turn in"
    " one process; a ratio is of neighbours in time. Meters: lock-in, peak of x"
    " and of the force, RMS error. Exact: compile_diagram(..., exact=True), with the C"
    " library's sin and cos as Drake has them, instead of our own."
    " The compiled diagram, the hand-written loop and jaxonomy run all channels at"
    " once, the others one after another. Built, jitted and run once before the clock starts."
)


def measure(repetitions: int) -> Section:
    """Time the compiled diagram and all contenders that are installed, after checking their trajectories."""
    section = Section("The 1-DOF loop, compiled and elsewhere", TEXT)
    numbers = Numbers()
    bare, metered = compile_loop(numbers, meters=False), compile_loop(numbers, meters=True)
    exact = compile_loop(numbers, meters=False, exact=True)
    tasks, notes = contenders(numbers, bare)
    ticks, omega = STEPS // CHANNELS, frequencies(CHANNELS)
    given: dict[str, Any] = {"parameters": {"omega": omega}}
    by_hand = hand_written.prepare_metered(numbers, omega, ticks)
    worst = _meters_differ(metered.run(ticks, **given), by_hand())
    notes.append(_checked(EXACT, trajectories(exact, CHECKED, CHECKED_TICKS), bare))
    long, steps = LONGER * ticks, LONGER * STEPS
    tasks |= {
        "compiled diagram": _rate(lambda: bare.run(long, threads=1, **given), steps),
        "compiled diagram, all cores": _rate(lambda: bare.run(2 * long, **given), 2 * steps),
        "compiled diagram, with meters": _rate(lambda: metered.run(long, threads=1, **given), steps),
        EXACT: _rate(lambda: exact.run(ticks, threads=1, **given), STEPS),
        "hand-written numba loop, with meters": _rate(by_hand, STEPS),
    }
    two = (os.cpu_count() or 1) >= 2
    if two:
        name = "compiled diagram, with meters, two cores"
        tasks[name] = _rate(lambda: metered.run(2 * long, threads=2, **given), 2 * steps)
    for task in tasks.values():
        task()
    found = in_turn(tasks, repetitions)
    whole, own, with_meters = (found[f"compiled diagram{more}"] for more in (", all cores", "", ", with meters"))
    for name, values in found.items():
        section.add(name, values, "1/s", RATE if values is with_meters else None)
    section.add("compiled / hand-written", ratios(own, found[hand_written.NAME]), "x", OF_HAND_WRITTEN)
    by_hand_rates = found["hand-written numba loop, with meters"]
    section.add("compiled / hand-written, both with meters", ratios(with_meters, by_hand_rates), "x", OF_HAND_WRITTEN)
    section.add("compiled / exact", ratios(own, found[EXACT]), "x")
    if two:
        both = found["compiled diagram, with meters, two cores"]
        section.add("two cores / one", ratios(both, with_meters), "x", TWO_CORES)
    best: dict[str, tuple[str, list[float]]] = {}
    for name, values in found.items():
        kind = name.split(", batch")[0]
        if "hand-written" not in name and not name.startswith("compiled"):
            if kind not in best or np.median(values) > np.median(best[kind][1]):
                best[kind] = (name, values)
    for kind, (name, values) in best.items():
        if "batch" in name:
            section.add(f"compiled, all cores / {kind}, best batch", ratios(whole, values), "x", OF_JAXONOMY)
        else:
            section.add(f"compiled / {name}", ratios(own, values), "x", OF_OTHERS)
    section.checks += notes
    section.checks.append(f"meters: sums of the hand-written loop and of the diagram differ by {worst:.0e} at most")
    return section


def contenders(numbers: Numbers, bare: CompiledDiagram) -> tuple[dict[str, Callable[[], float]], list[str]]:
    """What times each contender that is installed, and a line on each: checked, or why it is missing.

    Raises RuntimeError where x differs from the compiled diagram's: at any tick of the channels `CHECKED`, or at the
    end of what is timed.
    """
    tasks: dict[str, Callable[[], float]] = {}
    notes: list[str] = []
    for module in MODULES:
        contender = import_module(f"bench.contenders.{module}")
        if contender.PACKAGE is not None and find_spec(contender.PACKAGE) is None:
            notes.append(f"NOT measured: {contender.NAME} is not installed (pip install {contender.PACKAGE})")
            continue
        notes.append(_checked(contender.NAME, contender.prepare(numbers, CHECKED, CHECKED_TICKS, True)(), bare))
        whole = (CHANNELS, STEPS // CHANNELS) if contender is hand_written else (1, 1000)
        for channels, ticks in SIZES.get(module, (whole,)):
            batch = f", batch {channels}" if module in SIZES else ""
            omega = frequencies(channels)
            run = contender.prepare(numbers, omega, ticks, False)
            _same(contender.NAME, run().T, bare.run(ticks, parameters={"omega": omega}).outputs["x"].T)
            tasks[contender.NAME + batch] = _rate(run, channels * ticks)
    return tasks, notes


def _checked(name: str, found: Array, bare: CompiledDiagram) -> str:
    difference = _same(name, found, trajectories(bare, CHECKED, CHECKED_TICKS))
    return f"{name}: same {len(CHECKED)} x {CHECKED_TICKS} samples of x, to {difference:.0e} of the largest"


def _same(name: str, found: Array, expected: Array) -> float:
    difference = differ(found, expected)
    if not difference <= AGREE:
        raise RuntimeError(f"{name} runs another loop: x differs by {difference:.1e} of its largest")
    return difference


def differ(found: Array, expected: Array) -> float:
    """Largest difference of two trajectories, relative to the largest value of the row; inf for other shapes."""
    if found.shape != expected.shape:
        return float("inf")
    return float(np.max(np.max(np.abs(found - expected), axis=1) / np.max(np.abs(expected), axis=1)))


def frequencies(channels: int) -> Array:
    """Command frequencies [rad/s]."""
    return np.geomspace(1.0, 300.0, channels)


def _rate(run: Callable[[], Any], steps: int) -> Callable[[], float]:
    return lambda: steps / timed(run)[0]


def _meters_differ(run: Any, sums: Array) -> float:
    """Largest difference of the states, relative to the largest of its kind; raises RuntimeError beyond `AGREE`."""
    names = ("plant", "controller::disturbance_observer", "lockin", "peak", "peak_force", "rms_error")
    states = np.concatenate([run.state[name] for name in names], axis=1)
    worst = float(np.max(np.abs(states - sums) / np.max(np.abs(states), axis=0)))
    if not worst <= AGREE:
        raise RuntimeError(f"the meters of the hand-written loop differ by {worst:.1e} from those of the diagram")
    return worst


def scaling(repetitions: int) -> Section:
    """Cost of a channel-step by the number of channels."""
    metered = compile_loop(Numbers(), meters=True)
    text = "Compiled diagram with meters, one thread, 32 million channel-steps each (4 million of one), in turn; all"
    text += " from t = 100 s on, since only short runs would have small angles. Judged from eight channels on,"
    text += " which advance together: fewer cost as eight."
    section = Section("Cost of a channel-step by the number of channels", text)

    def cost(n: int) -> float:
        given = {"omega": frequencies(n)}
        ticks = min(n, LANES) * STEPS // n
        return timed(lambda: metered.run(ticks, parameters=given, start=LATE, threads=1))[0] / (ticks * n)

    found = in_turn({f"{n} channels": partial(cost, n) for n in MANY}, repetitions)
    for name, values in found.items():
        section.add(name, values)
    vectors = [values for n, values in zip(MANY, found.values(), strict=True) if n >= LANES]
    dearest = [max(row) / min(row) for row in zip(*vectors, strict=True)]
    section.add("dearest / cheapest", dearest, "x", FLAT)
    medians = [1e9 * float(np.median(values)) for values in found.values()]
    section.plot = partial(_plot, medians)
    return section


def _plot(cost: list[float], folder: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 3), layout="constrained")
    axes = figure.subplots()
    axes.semilogx(MANY, cost, "o-")
    axes.set(xlabel="channels", ylabel="ns per channel-step", ylim=(0, None))
    axes.grid(alpha=0.3)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "frequency_cost.png", dpi=150)


def compiling(repetitions: int) -> Section:
    """compile_diagram of the study's experiment in fresh processes: nothing kept, then from its cache."""
    text = "compile_diagram() of the study's loop with its meters and noise, in a fresh process, Drake imported before."
    section = Section("Compiling", text + " Reading, compiling or loading, and the replay against Drake's Simulator.")
    found: dict[str, list[float]] = {"compiled": [], "from the cache": []}
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, FLIPDIAGRAM_CACHE_DIR=folder):
            for name, times in found.items():
                result = fresh("bench.frequency")[1]
                if result["from_cache"] is not (name == "from the cache"):
                    raise RuntimeError(f"from_cache = {result['from_cache']}")
                times.append(result["seconds"])
    for name, times in found.items():
        section.add(name, times, target=COMPILE if name == "compiled" else CACHED)
    return section


def study(repetitions: int, quick: bool) -> Section:
    """`flipdiagram frequency`, the whole command, with an empty cache and with a full one."""
    words = ["frequency", *(["--quick"] if quick else [])]
    text = f"`flipdiagram {' '.join(words)}` in a fresh process, from its start to its exit, as a user runs it."
    section = Section("The whole of Figs 5 to 10", text)
    runs: dict[str, list[Watched]] = {"empty cache": [], "full cache": []}
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, FLIPDIAGRAM_CACHE_DIR=folder):
            for name in runs:
                with tempfile.TemporaryDirectory() as out:
                    runs[name].append(watch([sys.executable, "-m", "flipdiagram", *words, "--out", out]))
    for name, found in runs.items():
        section.add(f"wall time, {name}", [run.elapsed for run in found], target=None if quick else WALL)
    for name, found in runs.items():
        section.add(f"peak memory, {name}", [run.largest for run in found], "B", None if quick else MEMORY)
    section.checks.append(f"exit code 0, {os.cpu_count()} cores")
    return section


def sections(repetitions: int, quick: bool) -> Iterator[Section]:
    """All of them; the command first, while this process is small."""
    few = min(repetitions, 2)
    yield study(few, quick)
    yield compiling(min(repetitions, 3))
    yield scaling(repetitions)
    yield measure(repetitions)


def compile_once() -> dict[str, Any]:
    """Seconds that compile_diagram takes in this process."""
    from flipdiagram.compiled import compile_diagram
    from flipdiagram.diagrams.one_dof import build_controller, build_experiment

    settings = Numbers().settings
    diagram = build_experiment(build_controller("pd+ff+dob", settings), settings, friction=True)
    tie = {"omega": [f"{box}.omega" for box in ("command", "noise", "lockin_x", "lockin_a")]}
    begin = time.perf_counter()
    compiled = compile_diagram(diagram, tie=tie)
    return {"seconds": time.perf_counter() - begin, "from_cache": compiled.from_cache}


if __name__ == "__main__":
    import json

    print(json.dumps(compile_once()))
