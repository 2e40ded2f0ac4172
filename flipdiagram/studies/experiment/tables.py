"""The experiment of section IV as tables: by architecture beside the paper, E1–E8, and the second engine's verdicts."""

import numpy as np

from flipdiagram.grid import GOOD, Grid, verdict
from flipdiagram.studies.experiment.claims import Runs
from flipdiagram.studies.study import Summary

PAPER = {
    "turned over": {"pd": "no", "pd+ff": "no", "pd+dob": "yes", "pd+ff+dob": "yes"},
    "position RMSE [cm]": {"pd+ff+dob": "1.10 ± 0.15, last 1.18"},
    "acceleration RMSE [m/s²]": {"pd+dob": "4.81", "pd+ff+dob": "4.65"},
    "joint 2, max [N m]": {"pd+dob": "224", "pd+ff+dob": "205"},
    "velocity delay [ms]": {"pd+dob": "slight lag", "pd+ff+dob": "slight lead"},
    "vibration after the end [mm/s]": {"pd+dob": "visible", "pd+ff+dob": "less"},
}
"""What section IV-B of the paper states."""
QUANTITIES = {
    "position RMSE [cm]": ("position_rmse_meas_m", 100.0),
    "acceleration RMSE [m/s²]": ("acceleration_rmse_meas_m_s2", 1.0),
    "joint 2, max [N m]": ("max_torque_cmd_Nm", 1.0),
    "velocity delay [ms]": ("velocity_delay_meas_s", 1000.0),
    "vibration after the end [mm/s]": ("endpoint_vibration_meas_m_s", 1000.0),
    "true position RMSE [cm]": ("position_rmse_m", 100.0),
    "true acceleration RMSE [m/s²]": ("acceleration_rmse_m_s2", 1.0),
    "joint 2, max applied [N m]": ("max_torque_Nm", 1.0),
    "true velocity delay [ms]": ("velocity_delay_s", 1000.0),
    "slip, largest [mm]": ("max_slip_m", 1000.0),
}
"""By their labels: metrics of the runs and the factors to the units shown; first as the paper measures them."""


def tables(summary: Summary) -> list[Grid | str | None]:
    """What a terminal shows."""
    quick = "a quick run: two starts only" if summary["quick"] else None
    return [runs_grid(summary), claims_grid(summary), engine_grid(summary), quick]


def runs_grid(summary: Summary) -> Grid:
    """A row a quantity, a column an architecture: mean ± standard deviation over the starts, the last, the paper's."""
    names, runs = summary["architectures"], Runs(summary["runs"])
    rows = [["turned over", *("{} of {}".format(*runs.successes(name)) for name in names)]]
    for label, (metric, factor) in QUANTITIES.items():
        rows.append([label, *(_spread(factor * runs.values(name, metric)) for name in names)])
    for row in rows:
        stated = PAPER.get(row[0], {})
        row.append(", ".join(f"{name}: {stated[name]}" for name in names if name in stated))
    starts = ", ".join(f"{100 * y:g}" for y in summary["starts_y_m"])
    return Grid(["", *(f"`{name}`" for name in names), "the paper"], rows, title=f"starts at y = {starts} cm")


def _spread(values: np.ndarray) -> str:
    values = values[np.isfinite(values)]  # a block lost before the motion has no slip
    if not len(values):
        return "–"
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    return f"{np.mean(values):.3g} ± {deviation:.2g}, last {values[-1]:.3g}"


def claims_grid(summary: Summary) -> Grid:
    """E1–E8, the numbers measured, the paper's, and what may explain a large difference."""
    rows = [
        [c["id"], c["text"], verdict(c["holds"]), c["measured"], c["paper"], c["difference"] or "–"]
        for c in summary["claims"]
    ]
    return Grid(["", "claim", "holds", "measured", "the paper", "remark"], rows)


def engine_grid(summary: Summary) -> Grid:
    """Verdicts of both engines on the same flips; no row where the second was not run."""
    rows = []
    for name in summary["architectures"]:
        mine = [row for row in summary["second_engine"] or [] if row["architecture"] == name]
        if not mine:
            continue
        drake, mujoco = (sum(row[engine]["success"] for row in mine) for engine in ("drake", "mujoco"))
        same = sum(row["agree"] for row in mine)
        slip = [_largest([row[engine]["max_slip_m"] for row in mine]) for engine in ("drake", "mujoco")]
        agree = GOOD if same == len(mine) else f"**fragile**: {same} of {len(mine)}"
        rows.append([f"`{name}`", f"{drake} of {len(mine)}", f"{mujoco} of {len(mine)}", *slip, agree])
    headings = ["", "Drake: turned over", "MuJoCo: turned over", "Drake: slip [mm]", "MuJoCo: slip [mm]", "agree"]
    return Grid(headings, rows, title="the same flips with MuJoCo as the plant")


def _largest(values: list[float | None]) -> str:
    known = [value for value in values if value is not None and np.isfinite(value)]
    return f"{1000 * max(known):.1f}" if known else "–"
