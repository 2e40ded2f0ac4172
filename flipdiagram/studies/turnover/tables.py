"""The runs as a table."""

from typing import Any

from flipdiagram.grid import Grid
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid]:
    """One row per architecture: verdict, touch-down, errors, joint-2 torque, slip, speed of the simulation."""
    plan = summary["plan"]
    title = (
        f"plan: J = {plan['cost_J']:.3f}, release at {plan['release_time_s']:.2f} s and"
        f" {plan['release_angle_rad']:.2f} rad, touch-down at {plan['touchdown_time_s']:.2f} s and"
        f" {plan['touchdown_angle_rad']:.2f} rad"
    )
    quantities = ["touch-down\n[rad]", "at y\n[cm]", "position\nRMSE [cm]", "angle\nRMSE [rad]"]
    quantities += ["acceleration\nRMSE [m/s²]", "joint 2\nmax [N m]", "slip\n[mm]", "delay\n[ms]", "× real\ntime"]
    rows = [_row(run) for run in summary["runs"]]
    failures = [str(run["failure"]) for run in summary["runs"]]
    runs = Grid(["architecture", "block", *quantities], rows, title, quantities, whole=["architecture"], bad=failures)
    return [runs, *([again] if (again := replanning_grid(summary["runs"])) else [])]


def replanning_grid(runs: list[dict[str, Any]]) -> Grid | None:
    """How planning again went in the loop, where it was."""
    rows = [[run["architecture"], *replanning_cells(run["replanning"])] for run in runs if "replanning" in run]
    title = "the rest of the motion planned again, times as measured in the running loop"
    return Grid(["architecture", *REPLANNING], rows, title, REPLANNING) if rows else None


REPLANNING = ["plans", "failed", "late", "median\n[ms]", "99 %\n[ms]", "most\n[ms]"]
"""Columns of `replanning_cells`."""


def replanning_cells(entry: dict[str, Any]) -> list[str]:
    """Counts, and the solve times in ms."""
    times = (entry[f"solve_time_{name}_s"] for name in ("p50", "p99", "max"))
    counts = [str(entry[name]) for name in ("replanned", "failed", "late")]
    return counts + ["–" if time is None else f"{1000 * time:.2f}" for time in times]


def _row(run: dict[str, Any]) -> list[str]:
    landed = run["touchdown"]
    return [
        run["architecture"],
        "turned over" if run["success"] else run["failure"],
        f"{landed['theta_rad']:.2f}" if landed else "–",
        f"{100 * landed['y_m']:.1f}" if landed else "–",
        f"{100 * run['position_rmse_m']:.2f}",
        f"{run['angle_rmse_rad']:.3f}",
        f"{run['acceleration_rmse_m_s2']:.2f}",
        f"{run['max_torque_Nm'][1]:.1f}",
        "–" if run["max_slip_m"] is None else f"{1000 * run['max_slip_m']:.2f}",
        f"{1000 * run['velocity_delay_s']:.1f}",
        f"{run['real_time_factor']:.2g}",
    ]
