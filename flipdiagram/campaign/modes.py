"""What became of a trial, in one word; and how a failed flip failed."""

from __future__ import annotations

from flipdiagram.metrics import FlipMetrics

SUCCESS = "turned over"
MODES = (
    SUCCESS, "slid off", "tipped", "hit the table", "wrong angle", "never landed", "no plan", "diverged", "refused",
    "timeout", "crashed",
)  # fmt: skip
"""Every outcome.  A dropped block `tipped` where it lifted off the blade further than it slid, else it `slid off`."""
NOT_PHYSICS = ("timeout", "crashed", "refused")
"""Outcomes that say nothing about the controller: they are not counted as trials of it."""
SATURATED = 0.999
"""Torque over its limit from which a joint counts as saturated; a flag beside the mode, not a mode."""


def mode_of(failure: str | None, metrics: FlipMetrics | None) -> str:
    """The outcome of a flip by the text of its failure, and its metrics where there are any."""
    if failure is None:
        return SUCCESS
    if failure.startswith("dropped"):
        lifted = metrics is not None and metrics.max_lift_off_m > metrics.max_slip_m
        return "tipped" if lifted else "slid off"
    for start, mode in (
        ("blade hit the table", "hit the table"), ("landed", "wrong angle"), ("never", "never landed"),
        ("no plan", "no plan"), ("diverged", "diverged"), ("timeout", "timeout"), ("crashed", "crashed"),
    ):  # fmt: skip
        if failure.startswith(start):
            return mode
    return "refused"
