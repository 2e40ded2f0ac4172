"""The score of an entry as a picture: success by suite, in both engines, public and held-out side by side."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipdiagram.figures.style import GUIDE, STYLES, new_axes, save, tidy
from flipdiagram.studies.challenge.score import Result, found
from flipdiagram.studies.challenge.suites import HELD_OUT, PUBLIC
from flipdiagram.studies.study import Progress, Summary, silent

COLORS = {"drake": STYLES["pd+dob"].color, "mujoco": STYLES["pd+ff+dob"].color}
MARKERS = {PUBLIC: "o", HELD_OUT: "s"}


def write_figures(summary: Summary, out: Path, *, progress: Progress = silent) -> list[str]:
    """Draw the score."""
    progress("drawing the score")
    axes = plot_score(summary)
    assert isinstance(axes.figure, Figure)
    save(axes.figure, out / "score")
    return []


def plot_score(summary: Summary) -> Axes:
    """Share of blocks turned over with its interval, a group for each suite."""
    (ax,) = new_axes(1, (6.4, 3.2))
    names = list(dict.fromkeys(row["suite"] for row in summary["scores"]))
    series = list(dict.fromkeys((row["kind"], row["engine"]) for row in summary["scores"]))
    for k, (kind, engine) in enumerate(series):
        rows = [row for row in summary["scores"] if (row["kind"], row["engine"]) == (kind, engine)]
        x = np.array([names.index(row["suite"]) for row in rows]) + 0.15 * (k - (len(series) - 1) / 2)
        rate, low, high = (100 * np.array([row[name] for row in rows]) for name in ("rate", "low", "high"))
        style: dict[str, Any] = {
            "color": COLORS[engine],
            "marker": MARKERS[kind],
            "linestyle": "none",
            "markersize": 5,
            "capsize": 2,
        }
        ax.errorbar(x, rate, yerr=[rate - low, high - rate], label=f"{kind}, {engine}", **style)
    ax.set_xticks(range(len(names)), names)
    ax.set_ylim(-3, 103)
    ax.set_ylabel("turned over [%]")
    ax.set_title(summary["entry"]["name"], fontsize=10)
    ax.legend(fontsize=7, framealpha=0.9)
    tidy(ax)
    return ax


def plot_leaderboard(entries: Sequence[Result]) -> Figure:
    """A panel for each suite, a row for each entry: the share turned over, public filled and held-out open."""
    suites = list(dict.fromkeys(row["suite"] for row in entries[0]["scores"]))
    names = [entry["entry"]["name"] for entry in entries]
    axes = new_axes(len(suites), (9.6, 0.28 * len(names) + 1.5), columns=len(suites))
    handles: dict[str, Any] = {}
    for ax, suite in zip(axes, suites, strict=True):
        for y, entry in enumerate(entries):
            for shift, engine in ((-0.14, "drake"), (0.14, "mujoco")):
                for kind in (PUBLIC, HELD_OUT):
                    row = found(entry, kind, suite, engine)
                    if row is None:
                        continue
                    rate, low, high = (100 * row[key] for key in ("rate", "low", "high"))
                    color = COLORS[engine]
                    if kind == PUBLIC:
                        ax.plot([low, high], [y + shift] * 2, color=color, linewidth=0.9, alpha=0.7)
                    face, label = color if kind == PUBLIC else "white", f"{kind}, {engine}"
                    (marker,) = ax.plot(rate, y + shift, "o", color=color, markerfacecolor=face, markersize=4)
                    handles.setdefault(label, marker)
        ax.set_title(suite, fontsize=9)
        ax.set_xlim(-3, 103)
        ax.set_xlabel("turned over [%]")
        ax.set_yticks(range(len(names)), names if ax is axes[0] else [""] * len(names), fontsize=7.5)
        ax.set_ylim(len(names) - 0.5, -0.5)
        ax.set_xticks(np.arange(0, 101, 25))
        for x in (25, 50, 75):
            ax.axvline(x, **GUIDE)
        tidy(ax)
    figure = axes[0].figure
    assert isinstance(figure, Figure)
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=4, fontsize=7.5)
    return figure
