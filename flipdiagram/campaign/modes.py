"""What became of a trial, in one word; and how a failed flip failed."""

from __future__ import annotations

from flipdiagram.simulation.metrics import FlipMetrics

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
    "diverged",
    "refused",
    "timeout",
    "crashed",
)
"""Every outcome.

A dropped block `tipped` where it lifted off the blade further than it slid, else it `slid off`.

`torque limit`: a failed flip, whatever it looked like, in which a joint's torque was at its limit for more than
`LIMITED` [s] in all from the start of the motion until the block left the blade or the blade hit the table, whichever
came first; saturation after that is a consequence.  A flip that succeeds with saturated torque is a success.
"""
NOT_PHYSICS = ("timeout", "crashed", "refused")
"""Outcomes that say nothing about the controller: they are not counted as trials of it."""
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
    for start, mode in (
        ("blade hit the table", "hit the table"),
        ("landed", "wrong angle"),
        ("never", "never landed"),
        ("no plan", "no plan"),
        ("diverged", "diverged"),
        ("timeout", "timeout"),
        ("crashed", "crashed"),
    ):
        if failure.startswith(start):
            return mode
    return "refused"
