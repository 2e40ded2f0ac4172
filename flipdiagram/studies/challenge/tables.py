"""The score of an entry as tables."""

from flipdiagram.grid import Grid, number
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid | str]:
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
            ", ".join(f"{count} {mode}" for mode, count in row["modes"].items() if mode != "turned over") or "–",
        ]
        for row in summary["scores"]
    ]
    headings = ["suite", "worlds", "engine", "turned over", "share", "95 % (Wilson)", "not turned over"]
    title = f"{summary['entry']['name']}, suites {summary['suite']['version']} ({summary['suite']['digest'][:12]})"
    return Grid(headings, rows, title, headings[3:6], keys=3)


def number_grid(summary: Summary) -> Grid:
    """Medians over the flips of a suite."""
    rows = [
        [
            row["suite"],
            row["kind"],
            row["engine"],
            number(row["landing_cost_J"]),
            _scaled(row["position_rmse_m"], 100),
            number(row["acceleration_rmse_m_s2"]),
            _scaled(row["torque_use"], 100),
            _scaled(row["compute_p50_s"], 1e6),
            _scaled(row["compute_p99_s"], 1e6),
            number(row["noise_gain_Nms"]),
        ]
        for row in summary["scores"]
    ]
    headings = [
        "suite",
        "worlds",
        "engine",
        "landing J",
        "position RMSE [cm]",
        "acceleration RMSE [m/s²]",
        "torque [% of peak]",
        "P50 [µs]",
        "P99 [µs]",
        "noise gain [N m s/rad]",
    ]
    return Grid(
        headings,
        rows,
        "medians over the flips (landing J: the less the better; noise gain: where speeds are noisy)",
        headings[3:],
        keys=3,
    )


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


def _scaled(value: float | None, factor: float) -> str:
    return "–" if value is None else f"{factor * value:.3g}"


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
