"""One simulated flip: its real-time factor, and what each box of the diagram takes of a controller period."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from bench.results import Section, Target
from bench.timing import SelfTimes, in_turn, ratios, timed
from flipdiagram.loop import Loop, build_loop
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.plants.cell import Cell, add_cell
from flipdiagram.scenario import Scenario
from flipdiagram.simulate import Run, simulate

LIMIT = Target(">=", 2.0)
ARCHITECTURE = "pd+ff+dob"
CELL_BOXES = ("joint_friction", "contact_forces")
"""Boxes in Python that belong to the cell."""
SPEED_TEXT = (
    f"simulate() of the default scenario, {ARCHITECTURE}, with its plan given: hold, motion, release, settling, every"
    " signal recorded, no replay. Whole call: the diagram is built, simulated and the recording assembled. Stepping"
    " alone is the real_time_factor that summary.json reports."
)
BOXES_TEXT = (
    "Time per controller period ({period:g} ms) of the same run. Each box in Python: a clock on its output and update"
    " callbacks during a run, without the boxes that it evaluates in turn; what Drake needs to enter a callback counts"
    " for the box that asked. Plant: a run with no controller, the recorded torques played back from C++ (same motion,"
    " same contacts), less joint_friction. Logging: a run with sinks less one without, less contact_forces, which only"
    " the log reads. These are separate runs, in turn: the sum of the parts is compared with the whole below."
)


def measure(repetitions: int) -> list[Section]:
    """Real-time factor, then the boxes; each from `repetitions` runs."""
    scenario = Scenario()
    plan = plan_motion(scenario)
    calls = [timed(lambda: simulate(scenario, ARCHITECTURE, plan)) for _ in range(repetitions)]
    run: Run = calls[0][1]
    return [_speed(scenario, calls), _boxes(scenario, plan, run, repetitions)]


def simulated_time(run: Run, scenario: Scenario) -> float:
    """Simulated seconds of a run."""
    time = run.recording["time"].values
    return float(time[-1]) + scenario.simulation.hold_time


def _speed(scenario: Scenario, calls: list[tuple[float, Run]]) -> Section:
    section = Section("One simulation, replay off", SPEED_TEXT)
    end = simulated_time(calls[0][1], scenario)
    whole = [elapsed for elapsed, _ in calls]
    section.add("real time / whole call", [end / elapsed for elapsed in whole], "x", LIMIT)
    section.add("real time / stepping alone", [run.real_time_factor for _, run in calls], "x", LIMIT)
    section.add("whole call", whole)
    section.add("stepping", [end / run.real_time_factor for _, run in calls], indent=1)
    section.add("building, recording", [t - end / run.real_time_factor for t, run in calls], indent=1)
    same = all(run.recording.identical(calls[0][1].recording) for _, run in calls)
    section.checks.append(
        f"{end:.2f} s simulated; block {'turned over' if _landed(calls[0][1]) else 'NOT turned over'};"
        f" the {len(calls)} recordings are {'bit-identical' if same else 'NOT identical'}"
    )
    return section


def _landed(run: Run) -> bool:
    from flipdiagram import metrics

    return bool(metrics.measure(run.recording).success)


def _boxes(scenario: Scenario, plan: Plan, run: Run, repetitions: int) -> Section:
    periods = len(run.recording["time"]) - 1
    end = simulated_time(run, scenario)
    recorded, silent = (build_loop(scenario, ARCHITECTURE, record=record) for record in (True, False))
    own: list[SelfTimes] = []
    clocked: Loop

    with clocks_on_boxes() as current:
        clocked = build_loop(scenario, ARCHITECTURE, record=True)
    cell, playback = torques_played_back(scenario, run, recorded)
    states: dict[str, Any] = {}

    def go(name: str, diagram: Diagram, context: Callable[[], Context], loop: Loop | Cell) -> float:
        started = context()
        elapsed = advance(diagram, started, end)
        plant = loop.cell.plant if isinstance(loop, Loop) else loop.plant
        states[name] = plant.GetPositionsAndVelocities(plant.GetMyContextFromRoot(started))
        return elapsed

    def with_clocks() -> float:
        current.clear()
        elapsed = go("clocked", clocked.diagram, lambda: clocked.context(plan), clocked)
        own.append(current.copy())
        return elapsed

    times = in_turn(
        {
            "recorded": lambda: go("recorded", recorded.diagram, lambda: recorded.context(plan), recorded),
            "silent": lambda: go("silent", silent.diagram, lambda: silent.context(plan), silent),
            "playback": lambda: go("playback", playback[0], playback[1], cell),
            "clocked": with_clocks,
        },
        repetitions,
    )
    return _table(scenario, times, own, states, periods)


def _table(
    scenario: Scenario,
    times: dict[str, list[float]],
    own: list[SelfTimes],
    states: dict[str, Any],
    periods: int,
) -> Section:
    per_step = {name: np.array(values) / periods for name, values in times.items()}
    boxes = {name: np.array([o.seconds[name] for o in own]) / periods for name in own[0].seconds}
    controller = {name: values for name, values in boxes.items() if name not in CELL_BOXES}
    contact, friction = boxes["contact_forces"], boxes["joint_friction"]
    logging = per_step["recorded"] - per_step["silent"] - contact
    plant = per_step["playback"] - friction
    parts = sum(boxes.values()) + plant + logging
    whole = per_step["recorded"]

    section = Section("Where a period of the simulation goes", BOXES_TEXT.format(period=scenario.controller.period * 1e3))
    section.whole = section.add("whole period", whole)
    section.add(f"controller, {len(controller)} boxes", sum(controller.values()), indent=1)
    for name, values in sorted(controller.items(), key=lambda item: -np.median(item[1])):
        section.add(name, values, indent=2)
    section.add("plant", plant, indent=1)
    for name in CELL_BOXES:
        section.add(name, boxes[name], indent=1)
    section.add("logging", logging, indent=1)
    section.add("Drake's own, between the boxes", whole - parts, indent=1)
    return section
