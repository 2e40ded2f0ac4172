"""The score of an entry as a picture: success by suite, in both engines, public and held-out side by side."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipdiagram.figures.style import STYLES, new_axes, save, tidy
from flipdiagram.studies.study import Progress, Summary, silent

COLORS = {"drake": STYLES["pd+dob"].color, "mujoco": STYLES["pd+ff+dob"].color}
MARKERS = {"public": "o", "held-out": "s"}


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
        style = {"color": COLORS[engine], "marker": MARKERS[kind], "linestyle": "none", "markersize": 5, "capsize": 2}
        ax.errorbar(x, rate, yerr=[rate - low, high - rate], label=f"{kind}, {engine}", **style)
    ax.set_xticks(range(len(names)), names)
    ax.set_ylim(-3, 103)
    ax.set_ylabel("turned over [%]")
    ax.set_title(summary["entry"]["name"], fontsize=10)
    ax.legend(fontsize=7, framealpha=0.9)
    tidy(ax)
    return ax
