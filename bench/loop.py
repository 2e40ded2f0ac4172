"""One simulated flip, replay off, against real time."""

from __future__ import annotations

from bench.results import Section, Target
from bench.timing import timed
from flipdiagram.planning import Plan
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.simulate import Run, simulate

LIMIT = Target(">=", 2.0)
ARCHITECTURE = "pd+ff+dob"
TEXT = (
    f"simulate() of the default scenario, {ARCHITECTURE}, with its plan given: hold, motion, release, settling, every"
    " signal recorded, no replay. Whole call: the diagram is built, simulated, and the recording assembled. Stepping"
    " alone is the real_time_factor of summary.json."
)


def measure(scenario: Scenario, plan: Plan, repetitions: int) -> Section:
    """Simulate the same flip `repetitions` times."""
    calls: list[tuple[float, Run]] = [timed(lambda: simulate(scenario, ARCHITECTURE, plan)) for _ in range(repetitions)]
    first = calls[0][1]
    end = simulated_time(first)
    whole, factors = [elapsed for elapsed, _ in calls], [run.real_time_factor for _, run in calls]
    section = Section("One simulation, replay off", TEXT)
    section.add("real time / whole call", [end / elapsed for elapsed in whole], "x", LIMIT)
    section.add("real time / stepping alone", factors, "x", LIMIT)
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
