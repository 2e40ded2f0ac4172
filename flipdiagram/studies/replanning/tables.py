"""What planning again buys, as tables."""

from collections.abc import Mapping
from typing import Any

from flipdiagram.grid import Grid
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.studies.study import Summary
from flipdiagram.studies.turnover.tables import REPLANNING, replanning_cells


def tables(summary: Summary) -> list[Grid]:
    """A row for each case and way: J with which the block landed, RMSE and slip, or why it was lost; then how long the
    planning took in the loop; then the random worlds."""
    runs = {(run["case"], run["way"], run["architecture"]): run for run in summary["runs"]}
    rows, loop = [], []
    for case, way in dict.fromkeys((case, way) for case, way, _ in runs):
        flown = [runs[case, way, name] for name in ARCHITECTURES]
        rows.append([case, way, *map(_cell, flown)])
        loop += [
            [case, way, run["architecture"], *replanning_cells(run["replanning"])]
            for run in flown[-1:]
            if "replanning" in run
        ]
    title = "J of the landing, position RMSE, slip of the block; or why it was lost"
    grids = [Grid(["disturbance", "plan", *(f"`{name}`" for name in ARCHITECTURES)], rows, title, keys=2)]
    if loop:
        head = ["disturbance", "plan", "architecture", *REPLANNING]
        grids.append(Grid(head, loop, "planning in the running loop", REPLANNING, keys=2))
    return [*grids, _worlds(summary["worlds"])]


def _cell(run: Mapping[str, Any]) -> str:
    if not run["success"]:
        return str(run["failure"]).split(",")[0]
    return f"**{run['landing_cost_J']:.2f}**, {100 * run['position_rmse_m']:.2f} cm, {1000 * run['max_slip_m']:.1f} mm"


def _worlds(worlds: Mapping[str, Any]) -> Grid:
    rows = []
    for entry in worlds["entries"]:
        row = [f"`{entry['architecture']}`", entry["way"], f"{100 * entry['rate']:.1f} %"]
        row.append(f"{100 * entry['low']:.1f}–{100 * entry['high']:.1f} %")
        against = entry.get("against_first")
        if against is None:
            rows.append([*row, "–", "–", "–", "–", "–"])
            continue
        success, cost, error = (against[name] for name in ("success", "landing_cost_J", "position_rmse_m"))
        row += [f"{success['first_only']} : {success['second_only']}", f"{success['p']:.2g}"]
        row.append(_shift(cost, 1, "{:+.3f}"))
        row += [_shift(error, 100, "{:+.2f}"), f"{cost['p']:.1g}, {error['p']:.1g}" if cost["pairs"] else "–"]
        rows.append(row)
    head = ["architecture", "plan", "turned over", "95 % (Wilson)", "only this : only once", "p (McNemar)"]
    head += ["J, median\ndifference", "position RMSE,\nmedian difference [cm]", "p (Wilcoxon)"]
    return Grid(head, sorted(rows), f"{worlds['count']} random worlds, each flown in every way", head[2:], keys=2)


def _shift(entry: Mapping[str, Any], factor: float, form: str) -> str:
    return "–" if entry["median_difference"] is None else form.format(factor * entry["median_difference"])
