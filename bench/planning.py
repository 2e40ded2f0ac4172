"""Planning from cold: a fresh process imports, builds the program, and searches over contact and flight samples.

`python -m bench.planning SOLVER` is that process: it plans once and prints the times as JSON.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from typing import Any

from bench.processes import fresh
from bench.results import Section, Target
from bench.timing import SelfTimes

LIMIT = Target("<", 2.0)
PARTS = ("solver", "row assembly", "arm kinematics")
TEXT = (
    "A fresh Python process imports flipdiagram, builds the MathematicalProgram of the default scenario and searches"
    " over contact and flight samples to the finished Plan. Judged is the whole process, from its start to its exit."
    " Shares of the search: solver = HorizonProgram.solve; row assembly = linearising the constraints (Convexification"
    ".rows) and writing them into the program (HorizonProgram.update); arm kinematics = ArmMotion.follow, the arm"
    " followed along each trajectory; each without the others, so they add up."
)


def measure(repetitions: int) -> Section:
    """Plan in `repetitions` fresh processes, one after another."""
    for solver in ("clarabel", "daqp"):
        fresh("bench.planning", solver)  # fills the file cache, numba's, and the .pyc files
    quick, runs = ([_run(solver) for _ in range(repetitions)] for solver in ("daqp", "clarabel"))
    first = runs[0]
    section = Section("Plan from cold", TEXT)
    section.whole = section.add("whole process", [run["process"] for run in quick], target=LIMIT)
    for name, key in (("import of Drake and flipdiagram", "import"), ("build and search", "search")):
        section.add(name, [run[key] + run["build"] * (key == "search") for run in quick], indent=1)

    def add(name: str, key: str, indent: int = 1) -> None:
        section.add(name, [run[key] for run in runs], indent=indent)

    section.add("whole process, planner.solver: clarabel", [run["process"] for run in runs])
    add("interpreter and exit", "python")
    add("import of Drake and flipdiagram", "import")
    add("building arm model and program", "build")
    add(f"search, {len(first['programs'])} QPs", "search")
    for part in PARTS:
        add(part, part, 2)
    add("rest of the search", "rest", 2)
    section.add("one QP, solved (median of a search)", [statistics.median(run["programs"]) for run in runs])
    slow, fast = (statistics.median(run["search"] for run in found) for found in (runs, quick))
    section.add("search by clarabel / by daqp", [slow / fast], "x")
    section.checks.append(f"daqp: J = {quick[0]['cost']:.4f}, {len(quick[0]['programs'])} QPs")
    agree = len({(run["cost"], len(run["programs"])) for run in runs}) == 1
    section.checks.append(
        f"J = {first['cost']:.4f}, residual {first['residual']:.1e};"
        f" all runs {'agree' if agree else 'do NOT agree'} in J and in the number of QPs"
    )
    return section


def _run(solver: str) -> dict[str, Any]:
    elapsed, times = fresh("bench.planning", solver)
    within = times["import"] + times["build"] + times["search"]
    return {"process": elapsed, "python": elapsed - within, **times}


def plan_once(solver: str) -> dict[str, Any]:
    """Import, build, search, each with its time [s]; the parts of the search are those of Drake's programs."""
    begin = time.perf_counter()
    from flipdiagram.planning import Planner, arm_motion, convexification
    from flipdiagram.planning.program import HorizonProgram
    from flipdiagram.scenario.scenario import Scenario

    imported = time.perf_counter()
    planner = Planner(Scenario().with_overrides({"planner.solver": solver}))
    built = time.perf_counter()
    own = SelfTimes()
    with (
        own.of_method(HorizonProgram, "solve", "solver"),
        own.of_method(HorizonProgram, "update", "row assembly"),
        own.of_method(convexification.Convexification, "rows", "row assembly"),
        own.of_method(arm_motion.ArmMotion, "follow", "arm kinematics"),
    ):
        plan = planner.plan()
    search = time.perf_counter() - built
    parts = {name: own.seconds.get(name, 0.0) for name in PARTS}
    return {
        "import": imported - begin,
        "build": built - imported,
        "search": search,
        **parts,
        "rest": search - sum(parts.values()),
        "programs": list(plan.program_times),
        "cost": plan.cost,
        "residual": plan.residual,
    }


if __name__ == "__main__":
    print(json.dumps(plan_once(sys.argv[1])))
