"""The border maps and the variations of solver and estimates as tables."""

from flipdiagram.grid import Grid
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.studies.study import Summary

NUMBERS = {
    "position RMSE [cm]": ("position_rmse_m", 100, 2),
    "acceleration RMSE [m/s²]": ("acceleration_rmse_m_s2", 1, 2),
    "slip [mm]": ("max_slip_m", 1000, 1),
    "joint 2 [N m]": ("max_torque_joint_2_Nm", 1, 1),
}
"""By heading: a number of a run, the factor to its unit, and its digits."""


def tables(summary: Summary) -> list[Grid | str | None]:
    """What a terminal shows."""
    quick = "a quick run: few and coarse maps, no variations" if summary["quick"] else None
    return [border_grid(summary), variation_grid(summary), quick]


def border_grid(summary: Summary) -> Grid:
    """In how many cells of each map each architecture turns the block over."""
    rows = []
    for a_map in summary["maps"]:
        cells = len(a_map["x"]["values"]) * len(a_map["y"]["values"])
        won = [sum(map(sum, a_map["architectures"][name]["success"])) for name in ARCHITECTURES]
        rows.append([a_map["title"], f"{a_map['x']['label']} × {a_map['y']['label']}", str(cells), *map(str, won)])
    names = [f"`{name}`" for name in ARCHITECTURES]
    return Grid(["map", "axes", "cells", *names], rows, right=["cells", *names])


def variation_grid(summary: Summary) -> Grid:
    """Each variation: who turned the block over, and how the numbers of the proposed controller move."""
    rows = []
    for row in summary["variations"]:
        verdicts = " ".join("yes" if row["runs"][name]["success"] else "no" for name in ARCHITECTURES)
        numbers = [_text(row["runs"]["pd+ff+dob"][name], *shown) for name, *shown in NUMBERS.values()]
        fragile = ", ".join(f"`{name}`" for name in row["fragile"]) or "–"
        rows.append([row["group"], row["name"], verdicts, *numbers, fragile])
    verdicts = f"turned over ({', '.join(ARCHITECTURES)})"
    headings = ["group", "changed", verdicts, *NUMBERS, "verdict differs for"]
    return Grid(headings, rows, title="numbers of pd+ff+dob", right=list(NUMBERS), keys=2)


def _text(value: float | None, factor: float, digits: int) -> str:
    return "–" if value is None else f"{factor * value:.{digits}f}"
