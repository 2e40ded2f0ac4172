"""A calibration in pictures: which unknowns are found, and how the worlds that are left compare with the paper."""

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from flipdiagram.campaign.distributions import distribution
from flipdiagram.figures.style import RC, STYLES, new_axes, save, tidy
from flipdiagram.studies.study import Progress, Summary, silent

MOST = 8
"""Unknowns in the corner plot: those whose interval has shrunk most."""
TICKS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
DRAWN = STYLES["pd+ff+dob"].color


def write_figures(summary: Summary, out: Path, *, progress: Progress = silent) -> list[str]:
    """Corner plot of the posterior, and the paper's numbers among those of its worlds."""
    progress("drawing the posterior")
    save(plot_corner(summary), out / "posterior")
    save(plot_predictions(summary), out / "predictions")
    return []


def plot_corner(summary: Summary) -> Figure:
    """Histograms of the unknowns on the diagonal, their draws in pairs below it; axes in shares of the prior."""
    u, weight = np.array(summary["draws"]["u"]), np.array(summary["draws"]["weight"])
    width = [_share(row, 2) - _share(row, 0) for row in summary["unknowns"]]
    chosen = sorted(np.argsort(width, kind="stable")[:MOST])
    count = len(chosen)
    with rc_context(RC):
        figure = Figure(figsize=(1.3 * count + 1, 1.3 * count + 1), layout="constrained")
        axes = figure.subplots(count, count, squeeze=False)
    for i, k in enumerate(chosen):
        for j, other in enumerate(chosen):
            ax = axes[i][j]
            if j > i:
                ax.axis("off")
                continue
            if i == j:
                ax.hist(u[:, k], bins=12, range=(0, 1), weights=weight, density=True, color=DRAWN)
                ax.axhline(1.0, color="0.6", linewidth=0.8)
                ax.set_yticks([])
            else:
                ax.scatter(u[:, other], u[:, k], s=1000 * weight, color=DRAWN, alpha=0.5, linewidths=0)
                ax.set_ylim(0, 1)
            ax.set_xlim(0, 1)
            ax.set_xticks([0, 1], _ends(summary, other) if i == count - 1 else ["", ""], fontsize=6)
            if i != j:
                ax.set_yticks([0, 1], _ends(summary, k) if j == 0 else ["", ""], fontsize=6)
            if i == count - 1:
                ax.set_xlabel(_name(summary, other), fontsize=7)
            if j == 0 and i > 0:
                ax.set_ylabel(_name(summary, k), fontsize=7)
            tidy(ax)
    figure.align_labels()
    return figure


def plot_predictions(summary: Summary) -> Figure:
    """The paper's numbers = 1, with the tolerance, and the 90 % intervals of prior and posterior over them."""
    rows = summary["predictions"]
    (ax,) = new_axes(1, (6.4, 0.5 * len(rows) + 1.2))
    for k, row in enumerate(rows):
        low, high, aim = 1 - row["tolerance"], 1 + row["tolerance"], "aimed at" if k == 0 else None
        ax.fill_betweenx([k - 0.4, k + 0.4], low, high, color="0.92", linewidth=0, label=aim)
        for kind, shift, color in (("prior", 0.15, "0.6"), ("posterior", -0.15, DRAWN)):
            if row[kind] is not None:
                low, middle, high = (value / row["paper"] for value in row[kind])
                label = f"{kind}, 5–95 %" if k == 0 else None
                ax.plot([low, high], [k + shift] * 2, color=color, linewidth=2.5, solid_capstyle="butt", label=label)
                ax.plot(middle, k + shift, "o", color=color, markersize=4)
    ax.axvline(1.0, color="black", linewidth=0.8, label="paper")
    ax.set_yticks(range(len(rows)), [f"{row['name']}\n{row['paper']:g} {row['unit']}" for row in rows], fontsize=7)
    ax.invert_yaxis()
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(ScalarFormatter())
    ax.xaxis.set_minor_formatter(NullFormatter())
    low, high = ax.get_xlim()
    ax.set_xticks([tick for tick in TICKS if low <= tick <= high])
    ax.set_xlabel("ours / the paper's")
    tidy(ax)
    figure = ax.figure
    assert isinstance(figure, Figure)
    figure.legend(fontsize=7, loc="outside upper right", ncols=4, frameon=False)
    return figure


def _share(row: Summary, k: int) -> float:
    """Where a quantile of the posterior lies in the prior."""
    at = distribution(row["prior"].get("scale", row["prior"])).position(_plain(row["posterior"][k]))
    return 0.5 if at is None else at


def _plain(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def _name(summary: Summary, k: int) -> str:
    name: str = summary["unknowns"][k]["name"].split(",")[0]
    return name.replace(".", "\n", 1).replace("_", " ")


def _ends(summary: Summary, k: int) -> list[str]:
    """The first and the last value of a prior."""
    prior = summary["unknowns"][k]["prior"]
    known = distribution(prior.get("scale", prior))
    return [_short(known.value(0.0)), _short(known.value(1.0 - 1e-9))]


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)[:6]
