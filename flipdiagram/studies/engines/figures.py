"""Where two engines disagree, as a picture: the flips over the two parameters that tell their worlds apart best."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flipdiagram.campaign.dataset import counted, load_dataset
from flipdiagram.campaign.run import FILE
from flipdiagram.figures.style import NAMES, STYLES, new_axes, save, tidy
from flipdiagram.scenario.scenario import with_unit
from flipdiagram.studies.study import Progress, Summary, silent

KINDS = (
    ("both turned it over", "o", STYLES["pd+ff+dob"].color, 9.0),
    ("neither did", "o", "0.8", 9.0),
    ("only {0}", "^", STYLES["pd+dob"].color, 34.0),
    ("only {1}", "v", STYLES["pd"].color, 34.0),
)
"""Label, marker, colour and size of the flips by the two verdicts."""


def write_figures(summary: Summary, out: Path, *, progress: Progress = silent) -> list[str]:
    """Draw where verdicts differ, if any does."""
    if len(summary["parameters"]) > 1:
        progress("drawing where the engines differ")
        save(plot_disagreement(summary, out), out / "engines")
    return []


def plot_disagreement(summary: Summary, out: Path) -> Figure:
    """A panel for each architecture; the flips are read from the engines' files in the folder."""
    one, other = (load_dataset(Path(out) / engine / FILE) for engine in summary["engines"])
    first, second = (row["name"] for row in summary["parameters"][:2])
    names = list(summary["architectures"])
    axes = new_axes(len(names), (8.0, 3.4 * ((len(names) + 1) // 2)), columns=min(2, len(names)))
    for ax, name in zip(axes, names, strict=True):
        a, b = one.sel(architecture=name), other.sel(architecture=name)
        won, also, both = a["success"].values, b["success"].values, counted(a) & counted(b)
        for (label, marker, color, size), chosen in zip(
            KINDS, (won & also, ~won & ~also, won & ~also, ~won & also), strict=True
        ):
            at = np.flatnonzero(chosen & both)
            text = f"{label.format(*summary['engines'])} ({len(at)})"
            ax.scatter(
                a[first].values[at], a[second].values[at], s=size, c=color, marker=marker, label=text, linewidths=0
            )
        ax.set_title(NAMES[name], fontsize=9)
        ax.set_xlabel(with_unit(first))
        ax.set_ylabel(with_unit(second))
        ax.legend(fontsize=6.5, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.16), frameon=False)
        tidy(ax)
    figure = axes[0].figure
    assert isinstance(figure, Figure)
    return figure
