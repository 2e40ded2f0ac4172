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
    return [Grid(["architecture", "block", *quantities], rows, title, quantities, whole=["architecture"], bad=failures)]


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
        f"{run['real_time_factor']:.1f}",
    ]
