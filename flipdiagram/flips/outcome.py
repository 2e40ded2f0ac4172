"""What became of a flip: what was measured, or why there is nothing; its kind in one word, and as a plain row."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flipdiagram.simulation.metrics import FlipMetrics, Touchdown

SUCCESS = "turned over"
MODES = (
    SUCCESS,
    "slid off",
    "tipped",
    "hit the table",
    "wrong angle",
    "never landed",
    "torque limit",
    "no plan",
    "no start",
    "diverged",
    "refused",
    "timeout",
    "memory",
    "crashed",
)
"""Every outcome.

A dropped block `tipped` where it lifted off the blade further than it slid, else it `slid off`.

`torque limit`: a failed flip, whatever it looked like, in which a joint's torque was at its limit for more than
`LIMITED` [s] in all from the start of the motion until the block left the blade or the blade hit the table, whichever
came first; saturation after that is a consequence.  A flip that succeeds with saturated torque is a success.

`no start`: the controller cannot hold the arm at the start pose, so there is no equilibrium to begin from.
"""
NOT_PHYSICS = ("timeout", "memory", "crashed", "refused")
"""Outcomes that say nothing about the controller: they are not counted as trials of it."""
LOST = ("timeout", "memory", "crashed")
"""Outcomes of which another run may make something else."""
LIMITED = 0.02
"""Time [s] for which torque may be at its limit without being the reason of a failure.

In that time 5 m/s² that are missing move the tool by 1 mm.
"""


def mode_of(failure: str | None, metrics: FlipMetrics | None) -> str:
    """The outcome of a flip by the text of its failure, and its metrics where there are any."""
    if failure is None:
        return SUCCESS
    if metrics is not None and metrics.saturated_s > LIMITED:  # not so where it is nan: limits unknown
        return "torque limit"
    if failure.startswith("dropped"):
        lifted = metrics is not None and metrics.max_lift_off_m > metrics.max_slip_m
        return "tipped" if lifted else "slid off"
    for start, mode in (("blade hit the table", "hit the table"), ("landed", "wrong angle"), ("never", "never landed")):
        if failure.startswith(start):
            return mode
    kind = failure.partition(":")[0]
    return kind if kind in MODES else "refused"


@dataclass(frozen=True)
class Outcome:
    """What became of a flip: its metrics, or why there are none ("no plan: …", "diverged: …")."""

    metrics: FlipMetrics | None
    failure: str | None
    plan: Mapping[str, Any] | None = None
    """The plan's summary."""
    torque_use: float | None = None
    """Largest torque of any joint over its limit; 1: saturated."""

    @property
    def success(self) -> bool:
        """Whether the block was turned over."""
        return self.metrics is not None and self.metrics.success

    @property
    def mode(self) -> str:
        """One of `MODES`."""
        return mode_of(self.failure, self.metrics)

    @classmethod
    def from_row(
        cls, metrics: Mapping[str, Any] | None, failure: str | None, plan: Mapping[str, Any] | None
    ) -> Outcome:
        """The outcome whose metrics are stored as plain data, where null stands for nan."""
        if metrics is None:
            return cls(None, failure, plan)
        values: dict[str, Any] = {name: math.nan if value is None else value for name, value in metrics.items()}
        torque_use = values.pop("torque_use")  # kept beside them
        values |= {"touchdown": metrics["touchdown"] and Touchdown(**metrics["touchdown"]), "failure": failure}
        return cls(FlipMetrics(**values), failure, plan, torque_use)
