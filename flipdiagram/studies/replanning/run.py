"""What planning again buys: the same disturbed flips with the plan made once, and with four ways of replanning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.files import write_summary
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import Progress, run_flips
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario

PERIOD = 0.04
"""How often the motion is planned again [s], where the scenario does not say."""
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
    period = {"planner.replan_period": scenario.planner.replan_period or PERIOD}
    camera = {"sensors.camera_period": scenario.sensors.camera_period or CAMERA}
    return {
        "planned once": {"planner.replan_period": None, "sensors.camera_period": None},
        "from the command": period | {"planner.replan_from": "commanded", "sensors.camera_period": None},
        "from the measured tool": period | {"planner.replan_from": "measured", "sensors.camera_period": None},
        "measured, other horizons": period
        | {"planner.replan_from": "measured", "planner.replan_search": scenario.planner.replan_search or SEARCH}
        | {"sensors.camera_period": None},
        "measured, with camera": period | {"planner.replan_from": "measured"} | camera,
    }


@dataclass(frozen=True)
class ReplanningResult:
    """The outcomes by case, way and architecture."""

    scenario: Scenario
    outcomes: dict[tuple[str, str, str], Outcome]
    out: Path
    quick: bool

    def summary(self) -> dict[str, Any]:
        """The body of summary.json."""
        return {
            "quick": self.quick,
            "cases": {name: dict(fields) for name, fields in CASES.items()},
            "ways": {name: dict(fields) for name, fields in ways_of(self.scenario).items()},
            "runs": [
                {
                    "case": case,
                    "way": way,
                    "architecture": name,
                    "success": outcome.success,
                    "failure": outcome.failure,
                    **({} if outcome.metrics is None else outcome.metrics.as_dict()),
                }
                for (case, way, name), outcome in self.outcomes.items()
            ],
        }


def run(
    scenario: Scenario,
    out: str | Path,
    *,
    quick: bool = False,
    jobs: int | None = None,
    progress: Progress = lambda text: None,
) -> ReplanningResult:
    """Fly every case in every way under every architecture; write summary.json.

    What an earlier call left in `out` is used.  Raises InputError.
    """
    build_loop(scenario)  # what is wrong with the scenario itself shows before anything is computed
    cases = QUICK_CASES if quick else tuple(CASES)
    keys = [(case, way, name) for case in cases for way in ways_of(scenario) for name in ARCHITECTURES]
    ways = ways_of(scenario)
    flips = [Flip(scenario.with_overrides({**CASES[case], **ways[way]}), name) for case, way, name in keys]
    outcomes = run_flips(flips, Path(out), jobs=jobs, progress=progress)
    result = ReplanningResult(scenario, dict(zip(keys, outcomes, strict=True)), Path(out), quick)
    write_summary(Path(out) / "summary.json", "replanning", scenario, result.summary())
    return result
