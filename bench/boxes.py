"""What each box of the diagram takes of a controller period, from runs with clocks and runs with boxes absent."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
from pydrake.systems.framework import LeafSystem, PortDataType

from bench.loop import ARCHITECTURE, simulated_time
from bench.playback import PROCESSOR, Stepped, closed_loop, torques_alone
from bench.results import Section
from bench.timing import SelfTimes, in_turn
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.planning import Plan
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.simulate import simulate_loop

CELL = ("joint_friction", "contact_forces")
"""Boxes in Python that belong to the cell, not to the controller."""
TEXT = (
    "Processor time per controller period ({period:g} ms) of the same run, stepping alone; it takes one thread, so this"
    " is the wall time of an undisturbed machine. Boxes: a clock on the output and"
    " update callbacks of every Python block, without the blocks that a callback evaluates in turn. Plant: the recorded"
    " torques played back from C++ into the cell without a controller (same motion, same contacts), less"
    " joint_friction. Logging: a run with sinks less one without, less contact_forces, which only the log reads."
    " Between the boxes: what the parts leave of the whole: adders, Drake's scheduling, its calls into Python."
)


def measure(scenario: Scenario, plan: Plan, repetitions: int) -> Section:
    """Run the flip with clocks, with and without logging, and without a controller, in turn, `repetitions` times."""
    run = simulate_loop(build_loop(scenario, ARCHITECTURE, record=True), plan)
    end, periods = simulated_time(run), len(run.recording["time"]) - 1
    own = SelfTimes(PROCESSOR)
    with clocks_on_boxes(own):
        clocked = build_loop(scenario, ARCHITECTURE, record=True)
    by_box: list[dict[str, float]] = []

    def with_clocks() -> float:
        elapsed = runs["clocked"].advance(end)
        by_box.append(own.take())
        return elapsed

    recorded = build_loop(scenario, ARCHITECTURE, record=True)
    runs: dict[str, Stepped] = {
        "recorded": closed_loop(recorded, plan),
        "silent": closed_loop(build_loop(scenario, ARCHITECTURE), plan),
        "playback": torques_alone(recorded, run),
        "clocked": closed_loop(clocked, plan),
        "native": closed_loop(build_loop(scenario, ARCHITECTURE, native=True), plan),
    }
    tasks: dict[str, Callable[[], float]] = {name: partial(one.advance, end) for name, one in runs.items()}
    tasks["clocked"] = with_clocks
    times = {name: np.array(values) / periods for name, values in in_turn(tasks, repetitions).items()}
    boxes = {name: np.array([seconds[name] for seconds in by_box]) / periods for name in by_box[0]}
    section = _section(scenario, times, boxes)
    states = [one.final_state for name, one in runs.items() if name != "native"]  # equal to rounding only
    same = all(np.array_equal(state, states[0]) for state in states)
    section.checks.append(
        f"the {len(states)} kinds of run with boxes, playback included,"
        f" {'end' if same else 'do NOT end'} in the same state"
    )
    return section


def _section(scenario: Scenario, times: dict[str, Any], boxes: dict[str, Any]) -> Section:
    controller = {name: values for name, values in boxes.items() if name not in CELL}
    own = sum(controller.values())
    plant = times["playback"] - boxes["joint_friction"]
    logging = times["recorded"] - times["silent"] - boxes["contact_forces"]
    parts = sum(boxes.values()) + plant + logging
    whole = times["recorded"]

    section = Section("One controller period", TEXT.format(period=scenario.controller.period * 1e3))
    section.whole = section.add("whole period, recorded", whole)
    section.add(f"controller, {len(controller)} boxes", own, indent=1)
    for name in sorted(controller, key=lambda name: -float(np.median(controller[name]))):
        section.add(name, controller[name], indent=2)
    section.add("plant", plant, indent=1)
    for name in CELL:
        section.add(name, boxes[name], indent=1)
    section.add("logging", logging, indent=1)
    section.add("between the boxes", whole - parts, indent=1)

    def us(values: Any) -> str:
        return f"{1e6 * float(np.median(values)):.0f} µs"

    section.checks += [
        f"sum of the parts {us(parts)}, whole {us(whole)}: {100 * float(np.median(parts / whole)):.0f} %"
        f" (with the clocks in place the run took {us(times['clocked'])})",
        f"controller by another way, run without log less playback: {us(times['silent'] - times['playback'])},"
        f" Drake's calls into it included; sum of its boxes {us(own)}",
        f"controller as one box, as simulate() runs it, by the same way: {us(times['native'] - times['playback'])}",
    ]
    return section


@contextmanager
def clocks_on_boxes(own: SelfTimes) -> Iterator[None]:
    """Blocks in Python that are built inside this context get a clock on each output and update callback."""

    def with_clock(declare: Callable[..., Any]) -> Callable[..., Any]:
        def declare_clocked(system: Any, *arguments: Any, **options: Any) -> Any:
            def clock(value: Any) -> Any:
                if not inspect.isroutine(value):
                    return value
                return _inputs_first(system, own.wrap(value, system.get_name))

            return declare(system, *map(clock, arguments), **{name: clock(value) for name, value in options.items()})

        return declare_clocked

    output, update = "DeclareVectorOutputPort", "DeclarePeriodicDiscreteUpdateEvent"
    with (
        patch.object(LeafSystem, output, with_clock(getattr(LeafSystem, output))),
        patch.object(LeafSystem, update, with_clock(getattr(LeafSystem, update))),
    ):
        yield


def _inputs_first(system: Any, callback: Callable[..., Any]) -> Callable[..., Any]:
    """The callback, its abstract inputs evaluated before: contact results are work of the plant, not of the reader."""
    ports: list[Any] | None = None

    def call(context: Any, *arguments: Any) -> Any:
        nonlocal ports
        if ports is None:
            every = map(system.get_input_port, range(system.num_input_ports()))
            ports = [port for port in every if port.get_data_type() == PortDataType.kAbstractValued]
        for port in ports:
            port.Eval(context)
        return callback(context, *arguments)

    return call
