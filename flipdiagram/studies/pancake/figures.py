"""Pictures of the pancake's maps: one panel an architecture, a letter and a colour for how each flip ended."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from flipdiagram.figures.style import NAMES, RC, STYLES, save
from flipdiagram.studies.pancake.tables import axis, pascal
from flipdiagram.studies.study import Progress, Summary, silent


class Look(NamedTuple):
    """Of a cell."""

    letter: str
    color: str


LOOKS = {
    "turned over": Look("T", "#8FD3BC"),
    "folded": Look("F", "#56B4E9"),
    "off target": Look("O", "#F0E442"),
    "not turned": Look("N", "#CC79A7"),
    "slid at the start": Look("S", "#E69F00"),
    "slid later": Look("s", "#F3CC7D"),
    "tipped": Look("P", "#D9B08C"),
    "struck the table": Look("B", "#D55E00"),
    "never landed": Look("L", "#BBBBBB"),
    "torque limit": Look("M", "#999999"),
    "no plan": Look("–", "#FFFFFF"),
    "no start": Look("–", "#FFFFFF"),
    "diverged": Look("D", "#EEEEEE"),
}
"""By outcome; the letters tell them apart without colours."""
OTHER = Look("?", "#FFFFFF")
ENGINES = {
    "both turned over": Look("", "#8FD3BC"),
    "neither": Look("", "#DDDDDD"),
    "only Drake": Look("", "#E69F00"),
    "only MuJoCo": Look("", "#56B4E9"),
}
Cells = Mapping[tuple[str, float, float, float], tuple[str, str, str]]
"""Text, colour and legend of each, by architecture, thickness, friction and modulus."""


def write_figures(summary: Summary, out: Path, *, progress: Progress = silent) -> list[str]:
    """Draw map.png and .svg, and where there is a second engine, engines.png and .svg."""
    progress("drawing maps")
    save(plot_map(summary), out / "map")
    if summary["second_engine"]:
        save(plot_engines(summary), out / "engines")
    return []


def plot_map(summary: Summary) -> Figure:
    """How each flip ended: a row of panels for each thickness."""

    def cell(run: Mapping[str, Any]) -> tuple[str, str, str]:
        letter, color = LOOKS.get(run["outcome"], OTHER)
        return letter, color, f"{letter}  {run['outcome']}"

    return _panels(summary, {_key(run): cell(run) for run in summary["runs"]}, "how each pancake ended")


def plot_engines(summary: Summary) -> Figure:
    """The letters of both engines, Drake's first, and whether they say the same."""

    def cell(row: Mapping[str, Any]) -> tuple[str, str, str]:
        won = row["drake"]["success"], row["mujoco"]["success"]
        names = {(True, True): 0, (False, False): 1, (True, False): 2, (False, True): 3}
        text = " ".join(LOOKS.get(row[engine]["outcome"], OTHER).letter for engine in ("drake", "mujoco"))
        kind = list(ENGINES)[names[won]]
        return text, ENGINES[kind].color, kind

    cells = {_key(row): cell(row) for row in summary["second_engine"]}
    return _panels(summary, cells, "Drake's outcome, then MuJoCo's, in the letters of the map")


def _key(run: Mapping[str, Any]) -> tuple[str, float, float, float]:
    return run["architecture"], run["thickness_m"], run["friction"], run["youngs_modulus_Pa"]


def _panels(summary: Summary, cells: Cells, title: str) -> Figure:
    names, thicknesses = list(summary["architectures"]), axis(summary, "thickness_m")
    size = (2.1 * len(names) + 0.7, 2.2 * len(thicknesses) + 1.2)
    with rc_context(RC):
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(len(thicknesses), len(names), sharex=True, sharey=True, squeeze=False)
        for row, t in zip(panels, thicknesses, strict=True):
            for ax, name in zip(row, names, strict=True):
                _panel(ax, summary, lambda mu, E, name=name, t=t: cells.get((name, t, mu, E)))  # type: ignore[misc]
                if t == thicknesses[-1]:
                    ax.set_xlabel("Young's modulus")
                ax.set_title(NAMES[name], color=STYLES[name].color, fontweight="bold", fontsize=10)
            thick = f", {1000 * t:g} mm thick" if len(thicknesses) > 1 else ""
            row[0].set_ylabel(f"friction [1]{thick}")
        figure.suptitle(title, fontsize=9.5)
        used = dict(sorted({(legend, color) for _, color, legend in cells.values()}))
        handles = [Patch(facecolor=color, edgecolor="0.5", label=legend) for legend, color in used.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False, fontsize=8)
    return figure


def _panel(ax: Axes, summary: Summary, cell: Callable[[float, float], tuple[str, str, str] | None]) -> None:
    moduli, frictions = axis(summary, "youngs_modulus_Pa"), axis(summary, "friction")
    for j, mu in enumerate(frictions):
        for i, E in enumerate(moduli):
            if (found := cell(mu, E)) is not None:
                text, color, _ = found
                ax.fill([i - 0.5, i + 0.5, i + 0.5, i - 0.5], [j - 0.5, j - 0.5, j + 0.5, j + 0.5], color=color)
                ax.text(i, j, text, ha="center", va="center", fontsize=9)
    ax.set_xlim(-0.5, len(moduli) - 0.5)
    ax.set_ylim(-0.5, len(frictions) - 0.5)
    ax.set_xticks(range(len(moduli)), [pascal(E) for E in moduli], rotation=60 if len(moduli) > 3 else 0)
    ax.set_yticks(range(len(frictions)), [f"{mu:g}" for mu in frictions])
    ax.tick_params(length=0)
