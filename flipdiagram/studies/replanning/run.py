"""What planning again buys: disturbed flips and random worlds, with the plan made once and in ways of replanning."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.files import write_summary
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.run import run_flips
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.replanning.worlds import QUICK_WORLDS, WORLDS, fly_worlds
from flipdiagram.studies.study import Progress, silent

SLOW = {"planner.replan_period": 0.02, "planner.compute_delay": 0.01}
"""Once a sample of the plan; it takes effect half a sample later."""
FAST = {"planner.replan_period": 0.001, "planner.compute_delay": 0.001}
"""At the control rate, in force one period later."""
ONCE = {"planner.replan_period": None, "sensors.camera_period": None}
CAMERA = 0.02
"""Period of the camera [s], where the scenario has none."""
SEARCH = 2
"""Contact and flight samples by which a new plan may differ, where the scenario does not say."""

CASES: dict[str, Mapping[str, Any]] = {
    "nothing": {},
    "push of 40 N down at 0.1 s": {"disturbance.push": (0.0, -40.0)},
    "push of 40 N sideways at 0.2 s": {"disturbance.push": (40.0, 0.0), "disturbance.push_time": 0.2},
    "block twice as heavy": {"disturbance.object_mass_scale": 2.0},
    "start off by 2 cm": {"disturbance.start_error": 0.02},
    "block 1 cm off the middle": {"disturbance.block_offset": 0.01},
    "table 3 cm higher than planned": {"disturbance.table_error": 0.03},
}
"""What goes wrong, by name."""
QUICK_CASES = ("nothing", "start off by 2 cm")


def ways_of(scenario: Scenario) -> dict[str, Mapping[str, Any]]:
    """The plan made once, and the ways of replanning, by name."""
    blind = {"sensors.camera_period": None}
    camera = {"sensors.camera_period": scenario.sensors.camera_period or CAMERA}
    search = {"planner.replan_search": scenario.planner.replan_search or SEARCH}
    return {
        "planned once": ONCE,
        "every 20 ms": SLOW | blind,
        "every 20 ms, other horizons": SLOW | blind | search,
        "every 1 ms": FAST | blind,
        "every 1 ms, with camera": FAST | camera,
    }


IN_WORLDS = ("planned once", "every 20 ms", "every 1 ms, with camera")
"""Ways that are flown in the random worlds."""


def run(
    scenario: Scenario, out: str | Path, *, quick: bool = False, jobs: int | None = None, progress: Progress = silent
) -> None:
    """Fly every case in every way under every architecture, and random worlds in some; write summary.json.

    What an earlier call left in `out` is used.  Raises InputError.
    """
    build_loop(scenario)  # what is wrong with the scenario itself shows before anything is computed
    ways = ways_of(scenario)
    keys = list(product(QUICK_CASES if quick else CASES, ways, ARCHITECTURES))
    flips = [Flip(scenario.with_overrides({**CASES[case], **ways[way]}), name) for case, way, name in keys]
    outcomes = run_flips(flips, Path(out), jobs=jobs, progress=progress)
    runs = [
        {"case": case, "way": way, "architecture": name, "success": outcome.success, "failure": outcome.failure}
        | ({} if outcome.metrics is None else outcome.metrics.as_dict())
        | {name: entry for name, entry in (outcome.plan or {}).items() if name == "replanning"}
        for (case, way, name), outcome in zip(keys, outcomes, strict=True)
    ]
    count = QUICK_WORLDS if quick else WORLDS
    chosen = {way: ways[way] for way in IN_WORLDS}
    worlds = fly_worlds(scenario, chosen, count, Path(out), jobs=jobs, progress=progress)
    body = {"quick": quick, "cases": CASES, "ways": ways, "runs": runs, "worlds": worlds}
    write_summary(Path(out) / "summary.json", "replanning", scenario, body)
