"""The score of an entry as tables."""

from collections.abc import Mapping
from typing import Any

from flipdiagram.flips.outcome import SUCCESS
from flipdiagram.grid import Grid, number
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid | str | None]:
    """Success by suite and engine; the other numbers; against others; and what the entry did wrong."""
    return [success_grid(summary), number_grid(summary), against_grid(summary), *summary["problems"], _slow(summary)]


def success_grid(summary: Summary) -> Grid:
    """Blocks turned over, by suite: a row for each engine and kind of worlds."""
    rows = [
        [
            row["suite"],
            row["kind"],
            row["engine"],
            f"{row['turned_over']}/{row['flips']}",
            f"{100 * row['rate']:.0f} %",
            f"{100 * row['low']:.0f}–{100 * row['high']:.0f} %",
            ", ".join(f"{count} {mode}" for mode, count in row["modes"].items() if mode != SUCCESS) or "–",
        ]
        for row in summary["scores"]
    ]
    headings = ["suite", "worlds", "engine", "turned over", "share", "95 % (Wilson)", "not turned over"]
    title = f"{summary['entry']['name']}, suites {summary['suite']['version']} ({summary['suite']['digest'][:12]})"
    return Grid(headings, rows, title, headings[3:6], keys=3)


NUMBERS = {
    "landing_cost_J": ("landing J", 1.0),
    "position_rmse_m": ("position RMSE [cm]", 100.0),
    "acceleration_rmse_m_s2": ("acceleration RMSE [m/s²]", 1.0),
    "torque_use": ("torque [% of peak]", 100.0),
    "compute_p50_s": ("P50 [µs]", 1e6),
    "compute_p99_s": ("P99 [µs]", 1e6),
    "noise_gain_Nms": ("noise gain [N m s/rad]", 1.0),
}
"""Heading of each of `score.MEDIANS`, and the factor to its unit."""
HEADINGS = [heading for heading, _ in NUMBERS.values()]


def number_cells(row: Mapping[str, Any] | None) -> list[str]:
    """The medians of a suite under `HEADINGS`; dashes where it was not flown."""
    values = [(None if row is None else row[name], factor) for name, (_, factor) in NUMBERS.items()]
    return ["–" if value is None else number(float(f"{factor * value:.3g}")) for value, factor in values]


def number_grid(summary: Summary) -> Grid:
    """Medians over the flips of a suite."""
    rows = [[row["suite"], row["kind"], row["engine"], *number_cells(row)] for row in summary["scores"]]
    title = "medians over the flips (landing J: the less the better; noise gain: where speeds are noisy)"
    return Grid(["suite", "worlds", "engine", *HEADINGS], rows, title, HEADINGS, keys=3)


def against_grid(summary: Summary) -> Grid:
    """The same worlds under other entries, both engines together."""
    rows = [
        [
            other["name"],
            row["suite"],
            row["kind"],
            str(row["first_only"]),
            str(row["second_only"]),
            f"{100 * row['difference']:+.0f} ({100 * row['low']:+.0f} to {100 * row['high']:+.0f})",
            f"{row['p_holm']:.2g}",
        ]
        for other in summary["against"]
        for row in other["suites"]
    ]
    headings = ["against", "suite", "worlds", "only this", "only that", "points (95 %)", "p (McNemar, Holm)"]
    return Grid(headings, rows, "pair by pair in the same worlds", headings[3:], keys=3)


def _slow(summary: Summary) -> str | None:
    """A line where a period takes longer than the controller has."""
    period = summary["scenario"]["controller"]["period"]
    slow = [row for row in summary["scores"] if (row["compute_p99_s"] or 0.0) > period]
    if not slow:
        return None
    row = max(slow, key=lambda row: row["compute_p99_s"])
    return (
        f"slower than its period of {1e3 * period:g} ms: P99 is {1e3 * row['compute_p99_s']:.2g} ms in {row['kind']}"
        f" {row['suite']}, {row['engine']} (here; the score does not count it)"
    )
