"""Pictures of the border maps: one panel an architecture, colour the position error, a line where it stops working."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from flipdiagram.figures.style import NAMES, RC, STYLES, save
from flipdiagram.studies.study import Progress, Summary, silent

FAILED = "#DDDDDD"


def plot_map(a_map: Mapping[str, Any]) -> Figure:
    """One map of a borders summary.json: all architectures side by side."""
    names = list(a_map["architectures"])
    with rc_context(RC):
        figure = Figure(figsize=(2.75 * len(names) + 0.9, 3.5), layout="constrained")
        panels = figure.subplots(1, len(names), sharex=True, sharey=True, squeeze=False)[0]
        for ax, name in zip(panels, names, strict=True):
            image = _panel(ax, a_map["architectures"][name])
            ax.set_title(NAMES[name], color=STYLES[name].color, fontweight="bold", fontsize=10)
            _ticks(ax, a_map["x"], a_map["y"])
        panels[0].set_ylabel(a_map["y"]["label"])
        figure.supxlabel(a_map["x"]["label"], fontsize=9)
        bar = figure.colorbar(image, ax=list(panels), label="position RMSE [cm]", pad=0.01, extend="both")
        bar.set_ticks([0.1, 0.2, 0.5, 1, 2, 5], labels=["0.1", "0.2", "0.5", "1", "2", "5"])
        bar.ax.minorticks_off()
        marks = "turned over (colour), not turned over (grey ×), no motion planned (white –)"
        figure.suptitle(f"{a_map['title']}: {marks}", fontsize=9.5)
    return figure


def _panel(ax: Axes, cells: Mapping[str, Any]) -> Any:
    success = np.array(cells["success"], dtype=bool)
    error = np.array([[np.nan if e is None else 100 * e for e in row] for row in cells["position_rmse_m"]], dtype=float)
    ax.set_facecolor(FAILED)
    # dark is a large error, even for colour-blind readers; the same range [cm] in every map
    look: Any = {"cmap": "viridis_r", "norm": LogNorm(0.1, 5.0)}
    image = ax.imshow(np.where(success, error, np.nan), origin="lower", aspect="auto", **look)
    for (j, i), won in np.ndenumerate(success):
        if not won:
            planned = not str(cells["failure"][j][i]).startswith("no plan")
            if not planned:
                ax.fill([i - 0.5, i + 0.5, i + 0.5, i - 0.5], [j - 0.5, j - 0.5, j + 0.5, j + 0.5], color="white")
            ax.text(i, j, "×" if planned else "–", ha="center", va="center", color="0.35", fontsize=9)
    _border(ax, success)
    return image


def _border(ax: Axes, success: np.ndarray) -> None:
    """A thick line between cells that succeed and cells that do not."""
    for j, i in np.argwhere(success[:, 1:] != success[:, :-1]):
        ax.plot([i + 0.5, i + 0.5], [j - 0.5, j + 0.5], color="black", linewidth=2.2)
    for j, i in np.argwhere(success[1:] != success[:-1]):
        ax.plot([i - 0.5, i + 0.5], [j + 0.5, j + 0.5], color="black", linewidth=2.2)


def _ticks(ax: Axes, x: Mapping[str, Any], y: Mapping[str, Any]) -> None:
    ax.set_xticks(range(len(x["values"])), [_text(v) for v in x["values"]], rotation=60 if len(x["values"]) > 4 else 0)
    ax.set_yticks(range(len(y["values"])), [_text(v) for v in y["values"]])
    ax.tick_params(length=0)


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{float(f'{value:.3g}'):g}"


def write_figures(summary: Summary, out: Path, *, progress: Progress = silent) -> list[str]:
    """Draw map_<name>.png and .svg of every map."""
    progress("drawing maps")
    for a_map in summary["maps"]:
        save(plot_map(a_map), out / f"map_{a_map['name']}")
    return []
