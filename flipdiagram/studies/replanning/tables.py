"""What planning again buys, as a table."""

from collections.abc import Mapping
from typing import Any

from flipdiagram.grid import Grid
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid]:
    """A row for each case and way: J with which the block landed, RMSE and slip, or why it was lost."""
    runs = {(run["case"], run["way"], run["architecture"]): run for run in summary["runs"]}
    rows = []
    for case, way in dict.fromkeys((case, way) for case, way, _ in runs):
        rows.append([case, way, *(_cell(runs[case, way, name]) for name in ARCHITECTURES)])
    title = "J of the landing, position RMSE, slip of the block; or why it was lost"
    return [Grid(["disturbance", "plan", *(f"`{name}`" for name in ARCHITECTURES)], rows, title)]


def _cell(run: Mapping[str, Any]) -> str:
    if not run["success"]:
        return str(run["failure"]).split(",")[0]
    return f"**{run['landing_cost_J']:.2f}**, {100 * run['position_rmse_m']:.2f} cm, {1000 * run['max_slip_m']:.1f} mm"
