"""One simulated flip, replay off, against real time."""

from __future__ import annotations

from collections.abc import Iterator

from bench.results import Section, Target
from bench.timing import timed
from flipdiagram.planning import Plan
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.simulate import Run, simulate

LIMIT, ELASTIC_LIMIT = Target(">=", 2.0), Target(">=", 1.5)
ELASTIC = {"joints.model": "elastic", "joint_friction.model": "elasto-plastic"}
ARCHITECTURE = "pd+ff+dob"
TEXT = (
    f"simulate() of the default scenario, {ARCHITECTURE}, with its plan given: hold, motion, release, settling, every"
    " signal recorded, no replay. Whole call: the diagram is built, simulated, and the recording assembled. Stepping"
    " alone is the real_time_factor of summary.json."
)


def sections(scenario: Scenario, plan: Plan, repetitions: int) -> Iterator[Section]:
    """The scenario as it is, and with gears that give way and joints that stick."""
    yield measure(scenario, plan, repetitions, "One simulation, replay off", LIMIT)
    elastic = scenario.with_overrides(ELASTIC)
    yield measure(elastic, plan, repetitions, "The same with elastic joints that stick", ELASTIC_LIMIT)


def measure(scenario: Scenario, plan: Plan, repetitions: int, title: str, limit: Target) -> Section:
    """Simulate the same flip `repetitions` times."""
    calls: list[tuple[float, Run]] = [timed(lambda: simulate(scenario, ARCHITECTURE, plan)) for _ in range(repetitions)]
    first = calls[0][1]
    end = simulated_time(first)
    whole, factors = [elapsed for elapsed, _ in calls], [run.real_time_factor for _, run in calls]
    section = Section(title, TEXT)
    section.add("real time / whole call", [end / elapsed for elapsed in whole], "x", limit)
    section.add("real time / stepping alone", factors, "x", limit)
    section.add("whole call", whole)
    section.add("stepping", [end / factor for factor in factors], indent=1)
    rest = [elapsed - end / factor for elapsed, factor in zip(whole, factors, strict=True)]
    section.add("building, assembling the recording", rest, indent=1)
    same = all(run.recording.identical(first.recording) for _, run in calls)
    verdict = metrics.measure(first.recording).failure or "turned over"
    section.checks.append(
        f"{end:.2f} s simulated, block: {verdict};"
        f" all recordings {'are bit-identical' if same else 'are NOT identical'}"
    )
    return section


def simulated_time(run: Run) -> float:
    """Simulated seconds of a run, hold included."""
    time = run.recording["time"].values
    return float(time[-1] - time[0])
