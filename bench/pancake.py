"""A pancake by finite elements: against real time at several meshes, by phase of the flip, and its memory.

`python -m bench.pancake REFINEMENT LAYERS` flies one in a process of its own; prints what it took as JSON.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from importlib.util import find_spec

from pydrake.systems.framework import Context

from bench.loop import ARCHITECTURE, simulated_time
from bench.processes import fresh
from bench.results import Section, Target
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.planning import plan_motion
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.flex import replay_in_flex
from flipdiagram.simulation.simulate import Run, simulate_loop

MESHES = ((1, 2), (2, 2), (3, 3))
"""Refinement and layers."""
NEAR_200, REAL_TIME = (3, 3), Target(">=", 0.5)
TEXT = (
    f"The default pancake by {ARCHITECTURE}, its plan given and its shape at rest known, recorded: simulated time over"
    " processor time of the stepping. On the blade, in flight, on the table: processor time of a step of 1 ms. MuJoCo:"
    " the same flip replayed as a flex on the recorded motion of the blade, coming to rest included. Memory: the"
    " process's peak, Drake, MuJoCo and the loop included. The target is that of about 200 vertices."
)


def measure(repetitions: int, quick: bool) -> Section:
    """All meshes, each in a process of its own."""
    section = Section("A pancake", TEXT)
    for mesh in MESHES[:1] if quick else MESHES:
        found = [fresh("bench.pancake", *map(str, mesh))[1] for _ in range(1 if quick else min(repetitions, 2))]

        def of(name: str, found: list[dict[str, float]] = found) -> list[float]:
            return [one[name] for one in found]

        limit = REAL_TIME if mesh == NEAR_200 else None
        section.add(f"{found[0]['vertices']:.0f} vertices: real time / stepping", of("real_time"), "x", limit)
        for phase in ("on the blade", "in flight", "on the table"):
            section.add(phase, of(phase), indent=1)
        if "flex" in found[0]:
            section.add("MuJoCo: real time / replay", of("flex"), "x", indent=1)
        section.add("memory", of("memory"), "B", indent=1)
        section.checks.append(f"{found[0]['vertices']:.0f} vertices: {found[0]['verdict']}")
    return section


def main(refinement: int, layers: int) -> None:
    """Fly one, with a clock that is read every 20 ms of the flip."""
    mesh = {"object.refinement": refinement, "object.layers": layers}
    scenario = Scenario().with_overrides({"object.kind": "pancake", **mesh})
    plan, marks = plan_motion(scenario), [(0.0, 0.0)]
    loop = build_loop(scenario, ARCHITECTURE, record=True, native=True)
    begin = time.process_time()

    def look(until: float, _: Context) -> None:
        marks.append((until, time.process_time() - begin))

    run = simulate_loop(loop, plan, pace=look)
    found = {"vertices": scenario.object.vertices, "real_time": marks[-1][0] / marks[-1][1]}
    found |= _phases(run, marks, scenario.simulation.lead_time, scenario.simulation.step)
    found["verdict"] = metrics.measure(run.recording).failure or "turned over"
    if find_spec("mujoco"):
        begin = time.process_time()
        replay_in_flex(run.recording)
        found["flex"] = simulated_time(run) / (time.process_time() - begin)
    found["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    print(json.dumps(found))


def _phases(run: Run, marks: list[tuple[float, float]], lead: float, step: float) -> dict[str, float]:
    """Mean processor time [s] of a step in each phase, by the marks that lie wholly in it."""
    measured = metrics.measure(run.recording)
    landed = measured.touchdown.time_s if measured.touchdown else float("inf")
    ends = {"on the blade": (0.0, lead + measured.release_time_s)}
    ends |= {
        "in flight": (lead + measured.release_time_s, lead + landed),
        "on the table": (lead + landed, float("inf")),
    }
    found = {}
    for phase, (first, last) in ends.items():
        inside = [(t, spent) for t, spent in marks if first <= t <= last]
        found[phase] = (inside[-1][1] - inside[0][1]) / (inside[-1][0] - inside[0][0]) * step
    return found


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
