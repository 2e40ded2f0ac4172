"""What became of a flip: what was measured, or why there is nothing; its kind in one word, and as a plain row."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flipdiagram.simulation.events import Touchdown
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.simulation.verdict import CAUSES, cause_of

SUCCESS = "turned over"
MODES = (SUCCESS, *CAUSES, "no plan", "no start", "diverged", "refused", "timeout", "memory", "crashed")
"""Every outcome: success, the causes of failure (`simulation.verdict`), and why nothing was measured.

`no start`: the controller cannot hold the arm at the start pose, so there is no equilibrium to begin from.
"""
NOT_PHYSICS = ("timeout", "memory", "crashed", "refused")
"""Outcomes that say nothing about the controller: they are not counted as trials of it."""
LOST = ("timeout", "memory", "crashed")
"""Outcomes of which another run may make something else."""


def mode_of(failure: str | None) -> str:
    """The outcome of a flip by the text of its failure."""
    if failure is None:
        return SUCCESS
    kind = failure.partition(":")[0]
    return cause_of(failure) or (kind if kind in MODES else "refused")


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
        return mode_of(self.failure)

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
