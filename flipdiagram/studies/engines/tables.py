"""Where two engines agree, as tables."""

from flipdiagram.campaign.statistics import success_rate
from flipdiagram.grid import Grid, number
from flipdiagram.scenario.scenario import with_unit
from flipdiagram.studies.study import Summary

MOST = 8
"""Flips with other verdicts that are listed of each architecture."""


def tables(summary: Summary) -> list[Grid]:
    """Agreement by architecture; the flips that differ; the parameters of their worlds."""
    return [agreement_grid(summary), difference_grid(summary), parameter_grid(summary)]


def agreement_grid(summary: Summary) -> Grid:
    """A row for each architecture, and one for all."""
    drake, mujoco = summary["engines"]
    entries = summary["architectures"]
    every = [[entry["counted"], *entry["turned_over"], entry["equal"]] for entry in entries.values()]
    total = [sum(column) for column in zip(*every, strict=True)]
    named = [(f"`{name}`", row, entry) for (name, entry), row in zip(entries.items(), every, strict=True)]
    rows = []
    for name, row, rate in [*named, ("all", total, success_rate(total[-1], total[0]))]:
        share = "–" if rate["rate"] is None else f"{100 * rate['rate']:.1f} %"
        rows.append([name, *map(str, row), share, f"{100 * rate['low']:.1f}–{100 * rate['high']:.1f} %"])
    headings = ["architecture", "flips", drake, mujoco, "same verdict", "share", "95 % interval (Wilson)"]
    return Grid(
        headings, rows, f"turned over in {drake} and in {mujoco}, and how often both say the same", headings[1:]
    )


def difference_grid(summary: Summary) -> Grid:
    """The flips with other verdicts, with what tells their worlds apart best."""
    engines, shown = summary["engines"], [row["name"] for row in summary["parameters"][:3]]
    differ = summary["differ"]
    of_each = [[flip for flip in differ if flip["architecture"] == name][:MOST] for name in summary["architectures"]]
    listed = [flip for flips in of_each for flip in flips]
    rows = [
        [
            str(flip["trial"]),
            f"`{flip['architecture']}`",
            *flip["outcomes"],
            *(number(flip["values"][p]) for p in shown),
        ]
        for flip in listed
    ]
    first = f"the first {MOST} of each of " if len(differ) > len(listed) else ""
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
