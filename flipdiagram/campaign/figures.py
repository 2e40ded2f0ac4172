"""Pictures of a campaign: success and failures, what matters, success over two parameters, errors."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import LogLocator

from flipdiagram.campaign.dataset import counted
from flipdiagram.campaign.sensitivity import TARGETS, strength, strengths
from flipdiagram.campaign.tables import Summary
from flipdiagram.figures.style import NAMES, RC, STYLES, save, tidy
from flipdiagram.flips.outcome import MODES, SUCCESS
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.text import fields_of, unit_of

COLOURS = {
    SUCCESS: "#009E73",
    "slid at the start": "#E69F00",
    "slid later": "#A6761D",
    "tipped": "#F0E442",
    "struck the table": "#D55E00",
    "wrong angle": "#CC79A7",
    "never landed": "#8C564B",
    "torque limit": "#332288",
    "not turned": "#AA4499",
    "folded": "#117733",
    "off target": "#DDCC77",
    "no plan": "#BBBBBB",
    "no start": "#999933",
    "diverged": "#000000",
    "refused": "#777777",
    "timeout": "#56B4E9",
    "memory": "#88CCEE",
    "crashed": "#0072B2",
}
"""Of the outcomes, in the order of `MODES`; Okabe and Ito's and Tol's, which colour-blind readers can tell apart."""
MOST_PARAMETERS = 10
CENTRED: Mapping[str, Any] = {"ha": "center", "va": "center"}
SHOWN = ("success", "position_rmse_m")
"""Those of `TARGETS` that have a panel."""


def write_figures(summary: Summary, data: xr.Dataset, out: Path) -> list[str]:
    """Write every figure for which there is data, as PNG and SVG; returns their names without suffix."""
    figures = {"campaign_success": plot_success(summary)}
    entries = [e for targets in summary["sensitivity"].values() for entries in targets.values() for e in entries]
    if any(entry["explained"] is not None for entry in entries):
        figures["campaign_sensitivity"] = plot_sensitivity(summary)
    if summary["map"] is not None:
        figures["campaign_map"] = plot_map(summary, data)
    if bool(np.isfinite(data["position_rmse_m"]).any()):
        figures["campaign_errors"] = plot_errors(data)
    for name, figure in figures.items():
        save(figure, out / name)
    return list(figures)


def plot_success(summary: Summary) -> Figure:
    """Left: success rates with their intervals; right: what became of all flips."""
    names = list(summary["architectures"])[::-1]
    with rc_context(RC):
        figure = Figure(figsize=(9.0, 0.5 * len(names) + 1.6), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1, 1.3))
        modes = [mode for mode in MODES if any(mode in e["modes"] for e in summary["architectures"].values())]
        for k, name in enumerate(names):
            entry = summary["architectures"][name]
            interval, colour = [100 * entry["low"], 100 * entry["high"]], STYLES[name].color
            left.plot(interval, [k, k], color=colour, linewidth=5, alpha=0.4)
            if entry["rate"] is not None:
                left.plot(100 * entry["rate"], k, "o", color=colour, markersize=7)
            start = 0.0
            for mode in modes:
                share = 100 * entry["modes"].get(mode, 0) / max(entry["flips"], 1)
                label = mode if k == 0 else None
                right.barh(k, share, left=start, color=COLOURS[mode], label=label, height=0.65, edgecolor="white")
                if share >= 7:
                    light = np.dot(to_rgba(COLOURS[mode])[:3], (0.3, 0.6, 0.1)) > 0.5
                    colour = "black" if light else "white"
                    right.text(start + share / 2, k, f"{share:.0f}", color=colour, fontsize=8, **CENTRED)
                start += share
        left.set_yticks(range(len(names)), [NAMES[name] for name in names])
        left.set(xlim=(-2, 102), xlabel="turned over [%], 95 % interval", ylim=(-0.6, len(names) - 0.4))
        right.set(xlim=(0, 100), xlabel="outcomes [% of the flips]")
        if modes:
            handles, labels = right.get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper center", ncols=min(len(modes), 6), frameon=False)
        tidy(left)
        right.spines[["top", "right"]].set_visible(False)
        right.tick_params(left=False)
    return figure


def plot_sensitivity(summary: Summary) -> Figure:
    """For each architecture the share of the variance of the ranks that goes with each parameter, with its sign."""
    by_name = summary["sensitivity"]
    total = strengths(by_name, SHOWN)
    parameters = sorted(total, key=total.__getitem__)[-MOST_PARAMETERS:]
    with rc_context(RC):
        figure = Figure(figsize=(9.0, 0.42 * len(parameters) + 1.5), layout="constrained")
        panels = figure.subplots(1, len(SHOWN), sharey=True, squeeze=False)[0]
        height = 0.8 / len(by_name)
        for ax, target in zip(panels, SHOWN, strict=True):
            for j, (name, targets) in enumerate(by_name.items()):
                entries = {entry["parameter"]: entry for entry in targets[target]}
                at = [k + 0.4 - (j + 0.5) * height for k in range(len(parameters))]
                shares = [100 * strength(entries[p]) for p in parameters]
                ax.barh(at, shares, height=height, color=STYLES[name].color, label=NAMES[name])
                for y, share, parameter in zip(at, shares, parameters, strict=True):
                    rho = entries[parameter]["rho"]
                    if share >= 3 and rho is not None:
                        ax.text(share + 0.8, y, "+" if rho > 0 else "−", va="center", fontsize=8, color="0.3")
            ax.set_yticks(range(len(parameters)), [_short(name) for name in parameters])
            ax.axvspan(0, 100 * summary["chance"], color="0.9", linewidth=0, zorder=0)
            ax.set_title(f"of: {TARGETS[target]}", fontsize=9.5)
            ax.set_xlim(0, None)
            tidy(ax)
        words = "share of the variance of the ranks [%];  + −: sign of the rank correlation;  grey: chance"
        figure.supxlabel(words, fontsize=9)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(by_name), frameon=False)
    return figure


def plot_map(summary: Summary, data: xr.Dataset) -> Figure:
    """Success over the two parameters that matter most, one column an architecture: above by cells, below by trial."""
    cells = summary["map"]
    names = list(cells["architectures"])
    with rc_context(RC):
        figure = Figure(figsize=(2.5 * len(names) + 1.3, 5.6), layout="constrained")
        above, below = figure.subplots(2, len(names), squeeze=False, sharex="row", sharey="row")
        for ax, name in zip(above, names, strict=True):
            image = _cells(ax, cells["architectures"][name])
            ax.set_title(NAMES[name], color=STYLES[name].color, fontweight="bold", fontsize=10)
            _ticks(ax, cells["x"], cells["y"])
        for ax, name in zip(below, names, strict=True):
            _trials(ax, data.sel(architecture=name), cells)
        for row in (above, below):
            row[0].set_ylabel(_with_unit(cells["y"]["parameter"]))
        figure.supxlabel(_with_unit(cells["x"]["parameter"]), fontsize=9)
        figure.colorbar(image, ax=list(above), label="turned over [%]\nin the cells: of how many", pad=0.01)
        handles, labels = below[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(handles), frameon=False)
    return figure


def _cells(ax: Axes, counts: Mapping[str, Any]) -> AxesImage:
    """The share of each cell as a colour, and its counts in words."""
    trials, won = (np.array(counts[key], dtype=float) for key in ("trials", "successes"))
    rate = np.divide(100 * won, trials, out=np.full_like(won, np.nan), where=trials > 0)
    ax.set_facecolor("0.92")
    size = 8 if max(trials.shape) <= 4 else 6
    for (j, i), count in np.ndenumerate(trials):
        if count:
            colour = "black" if rate[j, i] > 55 else "white"
            ax.text(i, j, f"{won[j, i]:.0f}/{count:.0f}", color=colour, fontsize=size, **CENTRED)
    return ax.imshow(rate, origin="lower", aspect="auto", cmap="viridis", vmin=0, vmax=100)


def _trials(ax: Axes, part: xr.Dataset, cells: Mapping[str, Any]) -> None:
    """Each trial that counts at its own values; choices by their number, a little apart."""
    places: list[np.ndarray] = []
    for axis, set_ticks in ((cells["x"], ax.set_xticks), (cells["y"], ax.set_yticks)):
        values = part[axis["parameter"]].values
        if values.dtype.kind != "f":
            set_ticks(range(len(axis["values"])), axis["values"])
            ax.tick_params(axis="x", rotation=60)
            spread = 0.3 * np.sin(2.4 * np.arange(len(values)))  # the same in every run
            values = np.array([axis["values"].index(str(value)) for value in values], dtype=float) + spread
        places.append(values)
    success, among = part["success"].values.astype(bool), counted(part)
    x, y = places
    marks: Sequence[tuple[np.ndarray, Mapping[str, Any]]] = (
        (~success & among, {"marker": "x", "color": "#D55E00", "label": "a trial, not turned over"}),
        (
            success & among,
            {"marker": "o", "facecolor": "none", "edgecolor": "#009E73", "label": "a trial, turned over"},
        ),
    )
    for which, look in marks:
        ax.scatter(x[which], y[which], s=14, linewidth=0.9, **look)
    tidy(ax)


def plot_errors(data: xr.Dataset) -> Figure:
    """Shares of flips whose position RMSE, and whose torque over its limit, is below a value."""
    with rc_context(RC):
        figure = Figure(figsize=(9.0, 3.3), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        quantities = (
            ("position_rmse_m", 100, "position RMSE [cm]"),
            ("torque_use", 1, "largest joint torque over its limit [1]"),
        )
        for ax, (name, factor, label) in zip(panels, quantities, strict=True):
            for architecture in data["architecture"].values:
                values = np.sort(data[name].sel(architecture=architecture).values * factor)
                values = values[np.isfinite(values)]
                if len(values):
                    shares = 100 * np.arange(1, len(values) + 1) / len(values)
                    style = STYLES[str(architecture)].line()
                    ax.step(values, shares, where="post", label=NAMES[str(architecture)], **style)
            ax.set(xlabel=label, ylim=(0, 101))
            tidy(ax)
        if np.nanmin(data["position_rmse_m"].values) > 0:
            panels[0].set_xscale("log")
            panels[0].xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            panels[0].xaxis.set_major_formatter("{x:g}")
            panels[0].xaxis.set_minor_formatter("")
        panels[0].set_ylabel("flips below [%]")
        panels[1].set_xlim(0, 1.05)
        panels[1].axvline(1.0, color="0.4", linewidth=0.9, linestyle=":")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False)
    return figure


def plot_tuning(tuning: Summary) -> Figure:
    """Left: the score of each set of gains and the best so far; right: default and tuned, search and held out."""
    history = tuning["history"]
    with rc_context(RC):
        figure = Figure(figsize=(9.0, 3.2), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.6, 1))
        scores = [100 * entry["rate"] for entry in history]
        left.plot(scores, "o", color="0.6", markersize=4, label="a set of gains")
        left.plot(0, scores[0], "s", color="#0072B2", label="default gains")
        best = tuning["best"]
        left.plot(best, scores[best], "*", color="#D55E00", markersize=12, label="chosen")
        left.set(xlabel="set of gains", ylabel="turned over in the search [%]")
        left.xaxis.get_major_locator().set_params(integer=True)
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
        for k, part in enumerate(("search", "held_out")):
            for j, (side, colour) in enumerate((("default", "#0072B2"), ("tuned", "#D55E00"))):
                rate, low, high = (100 * tuning[part][side][name] for name in ("rate", "low", "high"))
                x, label = k + 0.16 * (2 * j - 1), side if k == 0 else None
                right.errorbar(x, rate, [[rate - low], [high - rate]], fmt="o", color=colour, capsize=4, label=label)
        right.set_xticks([0, 1], ["search", "held out"])
        right.set(xlim=(-0.5, 1.5), ylim=(-2, 102), ylabel="turned over [%], 95 % interval")
        right.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
        for ax in (left, right):
            tidy(ax)
    return figure


def _ticks(ax: Axes, x: Mapping[str, Any], y: Mapping[str, Any]) -> None:
    for axis, set_ticks in ((x, ax.set_xticks), (y, ax.set_yticks)):
        if axis["edges"] is None:
            set_ticks(range(len(axis["values"])), [_text(value) for value in axis["values"]])
        else:  # between the cells
            set_ticks(np.arange(len(axis["edges"])) - 0.5, [_text(value) for value in axis["edges"]])
    ax.tick_params(axis="x", rotation=60)


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{float(f'{value:.3g}'):g}"


def _with_unit(name: str) -> str:
    """A parameter as the label of an axis; a number without a unit has [1], a choice none."""
    field = fields_of(Scenario).get(name.partition(",")[0])
    unit = "" if field is None else unit_of(field)
    return f"{_short(name)} [{unit}]" if unit else _short(name)


def _short(name: str) -> str:
    """Fields that vary together by the first of them."""
    first, comma, _ = name.partition(",")
    return f"{first} …" if comma else first
