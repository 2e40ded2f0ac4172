"""The worlds that explain the paper, as tables."""

from collections.abc import Sequence
from typing import Any

from flipdiagram.grid import Grid, number
from flipdiagram.scenario.scenario import with_unit
from flipdiagram.studies.study import Summary

MOST = 12
"""Pairs of data that are listed."""


def tables(summary: Summary) -> list[Grid]:
    """Posterior, predictions, claims, what was held out and recovered, and pairs of data that do not go together."""
    return [
        unknown_grid(summary),
        prediction_grid(summary),
        claim_grid(summary),
        check_grid(summary),
        pair_grid(summary),
    ]


def unknown_grid(summary: Summary) -> Grid:
    """A row for each unknown: median and 90 % interval, by the sequential sampler and by rejection."""
    coverage = summary["recovered"]["unknowns"]
    rows = [
        [
            f"`{with_unit(row['name'])}`",
            _value(row["base"]),
            _interval(row["posterior"]),
            _interval(row["rejection"]),
            _share(coverage[row["name"]]),
            row["source"],
        ]
        for row in summary["unknowns"]
    ]
    headings = ["unknown", "base", "posterior (5–95 %)", "by rejection", "recovered", "source of the prior"]
    title = f"unknowns, from {summary['worlds']} worlds; recovered: in how many synthetic worlds the interval holds"
    return Grid(headings, rows, title, [])


def prediction_grid(summary: Summary) -> Grid:
    """A row for each number of the paper and for each start, a column for each scenario."""
    rows = [
        [
            f"{row['name']} [{row['unit']}]",
            f"{row['paper']:g}",
            *map(_number, row["scenarios"].values()),
            _interval(row["prior"]),
            _interval(row["posterior"]),
        ]
        for row in summary["predictions"]
    ]
    headings = ["number", "paper", *_names(summary), "prior (5–95 %)", "posterior (5–95 %)"]
    return Grid(headings, rows, "the paper's numbers", [])


def claim_grid(summary: Summary) -> Grid:
    """In how many worlds the claims hold, and in which scenarios."""
    rows = [
        [
            row["id"],
            *("yes" if holds else "no" for holds in row["scenarios"].values()),
            _share(row["prior"]),
            _share(row["posterior"]),
        ]
        for row in summary["claim_shares"]
    ]
    headings = ["claim", *_names(summary), "worlds of the prior", "of the posterior"]
    draws = len(summary["draws"]["weight"])
    return Grid(headings, rows, f"claims that hold; the posterior has {draws} draws", headings[-2:])


def _names(summary: Summary) -> list[str]:
    return list(summary["claim_shares"][0]["scenarios"])


def check_grid(summary: Summary) -> Grid:
    """Data held out, and synthetic worlds recovered."""
    rows = []
    for entry in summary["held_out"]:
        found = (
            _interval(entry["interval"]) if "interval" in entry else f"holds in {_share(entry['share'])} of the worlds"
        )
        rows.append([f"without: {entry['name']}", "holds" if entry["paper"] is True else f"{entry['paper']:g}", found])
    recovered = summary["recovered"]
    said = f"{_share(recovered['coverage'])} of the 90 % intervals hold the truth"
    rows.append([f"{recovered['worlds']} synthetic worlds", "90 %", said])
    return Grid(["check", "wanted", "found"], rows, "does it find what it was not told?", [])


def pair_grid(summary: Summary) -> Grid:
    """Data that hold together less often than by chance."""
    rows = [
        [row["first"], row["second"], *map(str, row["alone"]), str(row["both"]), f"{row['expected']:.1f}"]
        for row in summary["pairs"][:MOST]
    ]
    headings = ["one", "the other", "one holds", "the other holds", "both hold", "if independent"]
    return Grid(headings, rows, "data that pull against each other, in worlds of the prior", headings[2:])


def _interval(values: Sequence[Any] | None) -> str:
    if values is None:
        return "–"
    low, middle, high = (_value(value) for value in values)
    return middle if low == high else f"{middle} ({low}–{high})"


def _value(value: Any) -> str:
    return number(value) if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def _number(value: float | None) -> str:
    return "–" if value is None else number(value)


def _share(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.0f} %"
