"""The planned motion alone."""

from pathlib import Path

from flipdiagram.files import write_atomically, write_summary
from flipdiagram.planning import plan_motion
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.study import Progress, silent


def run(scenario: Scenario, out: str | Path, *, progress: Progress = silent) -> None:
    """Plan; write plan.json and summary.json.  Raises PlanningError."""
    progress("planning")
    plan = plan_motion(scenario, progress)
    write_atomically(Path(out) / "plan.json", plan.to_json())
    write_summary(Path(out) / "summary.json", "plan", scenario, {"plan": plan.summary()})
