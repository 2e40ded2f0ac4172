"""The engines side by side: what a controller period and a whole flip take in each, and flips a minute.

`python -m bench.engines ENGINE FLIPS` plans and flies in a process of its own; prints the seconds of each flip as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from bench.loop import ARCHITECTURE, simulated_time
from bench.playback import PROCESSOR, closed_loop, torques_alone
from bench.processes import fresh
from bench.results import Section, Target
from bench.timing import in_turn, timed
from flipdiagram.diagrams.loop import ENGINES, build_loop
from flipdiagram.flips.flight import fly
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.simulate import simulate_loop

CONTROLLER = Target("<", 40e-6)
REAL_TIME = {"drake": Target(">=", 4.0)}
PACE = {"drake": Target(">=", 200 / 60), "mujoco": Target(">=", 400 / 60)}
"""Flips a second of two processes."""
TEXT = (
    f"The default flip by {ARCHITECTURE}, recorded, as simulate() runs it: the controller as machine code. Processor"
    " time per controller period. Plant: the recorded torques played back into the cell, joint friction included."
    " Controller: a run without log less that, MPC and Drake's calls included; law alone: the compiled function. Log: a"
    " run with sinks less one without, contact forces included. Then a whole flip, and flips a second where each is"
    " planned anew, in one process and in two at once."
)


def measure(repetitions: int, quick: bool) -> Section:
    """All engines that are installed."""
    section = Section("Engines side by side", TEXT)
    for engine in ENGINES:
        if engine == "drake" or find_spec(engine):
            scenario = Scenario().with_overrides({"simulation.engine": engine})
            plan = plan_motion(scenario)
            _period(section, scenario, plan, repetitions)
            _flip(section, scenario, plan, repetitions)
            _pace(section, engine, 3 if quick else 20)
    return section


def _period(section: Section, scenario: Scenario, plan: Plan, repetitions: int) -> None:
    engine = scenario.simulation.engine
    recorded = build_loop(scenario, ARCHITECTURE, record=True, native=True)
    run = simulate_loop(recorded, plan)
    end, periods = simulated_time(run), len(run.recording["time"]) - 1
    runs = {
        "recorded": closed_loop(recorded, plan),
        "boxes": closed_loop(build_loop(scenario, ARCHITECTURE), plan),
        "silent": closed_loop(build_loop(scenario, ARCHITECTURE, native=True), plan),
        "playback": torques_alone(recorded, run),
    }
    tasks: dict[str, Callable[[], float]] = {name: partial(one.advance, end) for name, one in runs.items()}
    times = {name: np.array(values) / periods for name, values in in_turn(tasks, repetitions).items()}
    section.add(f"{engine}: a period", times["recorded"])
    section.add("plant", times["playback"], indent=1)
    section.add("controller as boxes", times["boxes"] - times["playback"], indent=1)
    section.add(f"{engine}: controller as it runs", times["silent"] - times["playback"], target=CONTROLLER, indent=1)
    section.add("law alone", _law(recorded, plan, repetitions), indent=2)
    section.add("log", times["recorded"] - times["silent"], indent=1)
    real_time = 1 / (times["recorded"] * periods / end)
    section.add(f"{engine}: real time / stepping", real_time, "x", REAL_TIME.get(engine))
    found = metrics.measure(run.recording)
    section.checks.append(
        f"{engine}: {found.failure or 'turned over'}, {1e3 * found.max_slip_m:.2f} mm slip; {recorded.cell.engine}"
    )


def _law(loop: Any, plan: Plan, repetitions: int, calls: int = 2000) -> list[float]:
    """The compiled function alone [s], at the start of the run."""
    box = loop.boxes.box
    context = box.GetMyContextFromRoot(loop.context(plan))
    given = box.given(context)

    def many() -> None:
        for _ in range(calls):
            box.compute(given)

    return [timed(many, PROCESSOR)[0] / calls for _ in range(repetitions)]


def _flip(section: Section, scenario: Scenario, plan: Plan, repetitions: int) -> None:
    section.add(
        f"{scenario.simulation.engine}: a flip, its plan given",
        [timed(lambda: fly(scenario, ARCHITECTURE, plan), PROCESSOR)[0] for _ in range(repetitions)],
    )
    section.add("building", [timed(lambda: _built(scenario), PROCESSOR)[0] for _ in range(repetitions)], indent=1)
    plans = [timed(lambda: plan_motion(scenario), PROCESSOR)[0] for _ in range(repetitions)]
    section.add("its plan, besides", plans, indent=1)


def _built(scenario: Scenario) -> None:
    build_loop(scenario, ARCHITECTURE, record=True, native=True).context()


def _pace(section: Section, engine: str, flips: int) -> None:
    for jobs in (1, 2):
        with ThreadPoolExecutor(jobs) as pool:
            found = [
                seconds for _, seconds in pool.map(lambda _: fresh("bench.engines", engine, str(flips)), range(jobs))
            ]
        rates = [sum(1 / one for one in same) for same in zip(*found, strict=True)]
        many = "one process" if jobs == 1 else "two processes"
        section.add(f"{engine}: flips a second, {many}", rates, "1/s", PACE[engine] if jobs == 2 else None)


def main(engine: str, flips: int) -> None:
    """Plan and fly, once before the clock starts."""
    scenario, seconds = Scenario().with_overrides({"simulation.engine": engine}), []
    for _ in range(flips + 1):
        begin = time.perf_counter()
        fly(scenario, ARCHITECTURE, plan_motion(scenario))
        seconds.append(time.perf_counter() - begin)
    print(json.dumps(seconds[1:]))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
