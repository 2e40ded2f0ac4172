"""What became of the object that was laid down, as a table."""

from collections.abc import Mapping
from typing import Any

from flipdiagram.grid import Grid
from flipdiagram.studies.study import Summary
from flipdiagram.studies.turnover.tables import replanning_grid


def tables(summary: Summary) -> list[Grid]:
    """A row an architecture: verdict, where the object lies, how it came down and slid, whether the blade struck."""
    rows = []
    for run in summary["runs"]:
        speed = run["touchdown_speed_m_s"]
        rows.append(
            [
                f"`{run['architecture']}`",
                "laid down" if run["success"] else run["failure"],
                f"{100 * run['distance_m']:.1f}",
                f"{run['tilt_rad']:.3f}",
                "–" if speed is None else f"{speed:.2f}",
                f"{1000 * run['slid_m']:.1f}",
                f"{1000 * run['planned_slide_m']:.1f}",
                _strike(run),
                f"{100 * run['position_rmse_m']:.2f}",
            ]
        )
    quantities = ["from the target [cm]", "tilt [rad]", "at touch-down [m/s]", "slid [mm]", "planned [mm]"]
    quantities += ["blade on the table", "position RMSE [cm]"]
    plan = summary["plan"]
    title = (
        f"blade tilted to {plan['tilt_rad']:.2f} rad, friction angle {plan['friction_angle_rad']:.2f} rad,"
        f" target y = {100 * summary['target_y_m']:.0f} cm"
    )
    again = replanning_grid(summary["runs"])
    return [Grid(["", "object", *quantities], rows, title, quantities), *([again] if again else [])]


def _strike(run: Mapping[str, Any]) -> str:
    """Largest force, duration and begin of the contact of blade and table, which the plan keeps apart."""
    if run["strike_time_s"] is None:
        return "never"
    force, duration, begin = run["strike_force_N"], 1000 * run["strike_duration_s"], run["strike_time_s"]
    return f"{force:.0f} N, {duration:.0f} ms, from {begin:.2f} s"
