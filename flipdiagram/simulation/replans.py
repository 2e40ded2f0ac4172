"""How planning again went in the loop: counts and solve times, from the recording of a flip."""

from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.simulation.recording import Recording

COUNTS = ("replanned", "failed", "late")


def replans(data: Recording) -> dict[str, Any] | None:
    """How many plans came into force, failed and were late; quantiles of their solve times [s].  None: planned once.

    A failed attempt gives no time of its own.
    """
    if COUNTS[0] not in data:
        return None
    times = solve_times(data)[1]
    shown = {"p50": 0.5, "p99": 0.99, "max": 1.0}
    return {name: int(data[name].values[-1]) for name in COUNTS} | {
        f"solve_time_{name}_s": float(np.quantile(times, share)) if times.size else None
        for name, share in shown.items()
    }


def solve_times(data: Recording) -> tuple[Floats, Floats]:
    """When plans were made [s], and how long each took [s]."""
    made = data["replanned"].values + data["late"].values
    k = np.flatnonzero(np.diff(made) > 0) + 1
    return data["time"].values[k], data["solve_time"].values[k]
