"""Results as tables for a terminal."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table

from flipdiagram.studies.turnover.run import TurnoverResult

JOINT_2 = 1


def turnover_table(result: TurnoverResult) -> Table:
    """One row per architecture: verdict, touch-down, errors, joint-2 torque, slip, speed of the simulation."""
    plan = result.plan
    title = (
        f"plan: J = {plan.cost:.3f}, release at {plan.release_time:.2f} s and {plan.release[2]:.2f} rad,"
        f" touch-down at {plan.touchdown_time:.2f} s and {plan.landing[2]:.2f} rad"
    )
    table = Table(title=title, title_justify="left")
    table.add_column("architecture", no_wrap=True)
    table.add_column("block")
    for heading in ("touch-down\n[rad]", "at y\n[cm]", "position\nRMSE [cm]", "angle\nRMSE [rad]"):
        table.add_column(heading, justify="right")
    for heading in ("acceleration\nRMSE [m/s²]", "joint 2\nmax [N m]", "slip\n[mm]", "delay\n[ms]", "× real\ntime"):
        table.add_column(heading, justify="right")
    for run in result.runs:
        m, landed = run.metrics, run.metrics.touchdown
        verdict = "[green]turned over[/]" if m.success else f"[red]{m.failure}[/]"
        table.add_row(
            m.architecture,
            verdict,
            f"{landed.theta_rad:.2f}" if landed else "–",
            f"{100 * landed.y_m:.1f}" if landed else "–",
            f"{100 * m.position_rmse_m:.2f}",
            f"{m.angle_rmse_rad:.3f}",
            f"{m.acceleration_rmse_m_s2:.2f}",
            f"{m.max_torque_Nm[JOINT_2]:.1f}",
            "–" if math.isnan(m.max_slip_m) else f"{1000 * m.max_slip_m:.2f}",
            f"{1000 * m.velocity_delay_s:.1f}",
            f"{run.real_time_factor:.1f}",
        )
    return table


def turnover_markdown(summary: dict[str, Any]) -> str:
    """The runs of a turnover summary.json as a Markdown table, as the README shows it."""
    headings = (
        "architecture",
        "block",
        "touch-down",
        "position RMSE",
        "acceleration RMSE",
        "joint 2, max",
        "slip",
        "velocity delay",
    )
    lines = [" | ".join(headings), " | ".join(["---"] * 2 + ["---:"] * 6)]
    for run in summary["runs"]:
        landed = run["touchdown"]
        cells = (
            f"`{run['architecture']}`",
            "**turned over**" if run["success"] else run["failure"],
            f"{landed['theta_rad']:.2f} rad" if landed else "–",
            f"{100 * run['position_rmse_m']:.2f} cm",
            f"{run['acceleration_rmse_m_s2']:.2f} m/s²",
            f"{run['max_torque_Nm'][JOINT_2]:.1f} N m",
            f"{1000 * run['max_slip_m']:.1f} mm",
            f"{1000 * run['velocity_delay_s']:.1f} ms",
        )
        lines.append(" | ".join(cells))
    return "\n".join(f"| {line} |" for line in lines) + "\n"
