"""Where two engines agree, as tables."""

from flipdiagram.grid import Grid, number
from flipdiagram.scenario.scenario import with_unit
from flipdiagram.studies.study import Summary

MOST = 30
"""Flips with other verdicts that are listed."""


def tables(summary: Summary) -> list[Grid]:
    """Agreement by architecture; the flips that differ; the parameters of their worlds."""
    return [agreement_grid(summary), difference_grid(summary), parameter_grid(summary)]


def agreement_grid(summary: Summary) -> Grid:
    """A row for each architecture, and one for all."""
    drake, mujoco = summary["engines"]
    rows = []
    for name, entry in summary["architectures"].items():
        rate = "–" if entry["rate"] is None else f"{100 * entry['rate']:.1f} %"
        interval = f"{100 * entry['low']:.1f}–{100 * entry['high']:.1f} %"
        rows.append(
            [f"`{name}`", str(entry["counted"]), *map(str, entry["turned_over"]), str(entry["equal"]), rate, interval]
        )
    headings = ["architecture", "flips", drake, mujoco, "same verdict", "share", "95 % interval (Wilson)"]
    return Grid(
        headings, rows, f"turned over in {drake} and in {mujoco}, and how often both say the same", headings[1:]
    )


def difference_grid(summary: Summary) -> Grid:
    """The flips with other verdicts, with what tells their worlds apart best."""
    engines, shown = summary["engines"], [row["name"] for row in summary["parameters"][:3]]
    differ = summary["differ"]
    rows = [
        [
            str(flip["trial"]),
            f"`{flip['architecture']}`",
            *flip["outcomes"],
            *(number(flip["values"][p]) for p in shown),
        ]
        for flip in differ[:MOST]
    ]
    first = f"the first {MOST} of " if len(differ) > MOST else ""
    title = f"flips with other verdicts ({first}{len(differ)})"
    return Grid(["trial", "architecture", *engines, *(f"`{with_unit(p)}`" for p in shown)], rows, title, ["trial"])


def parameter_grid(summary: Summary) -> Grid:
    """What tells the worlds apart in which the verdicts differ."""
    rows = [
        [f"`{with_unit(row['name'])}`", number(row["equal"]), number(row["other"]), f"{row['p_holm']:.2g}"]
        for row in summary["parameters"]
    ]
    headings = ["parameter", "median, same verdict", "median, other verdict", "p (Kolmogorov-Smirnov, Holm)"]
    return Grid(headings, rows, "worlds in which the verdicts differ", headings[1:])
