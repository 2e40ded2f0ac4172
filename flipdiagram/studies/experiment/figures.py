"""Pictures of the experiment of section IV: Figs 13–15 with all starts overlaid, cone use, and the numbers by start."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipdiagram.figures.motion import dropped_at
from flipdiagram.figures.style import GUIDE, LABELS, NAMES, RC, STYLES, WITH_OBSERVER, save, tidy
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.experiment.claims import Runs
from flipdiagram.studies.experiment.run import recording_name
from flipdiagram.studies.experiment.tables import QUANTITIES
from flipdiagram.studies.study import Progress, Summary, silent

ByArchitecture = Mapping[str, Sequence[xr.Dataset]]
PAPER_RMSE = (0.0110, 0.0015)
"""The paper's position RMSE [m], mean and standard deviation over its eight starts."""


def write_figures(summary: Summary, out: Path, *, progress: Progress = silent) -> list[str]:
    """Draw the figures beside the results."""
    progress("drawing figures")
    recordings: dict[str, list[xr.Dataset]] = {name: [] for name in summary["architectures"]}
    for run in summary["runs"]:
        if "position_rmse_m" in run:
            name = run["architecture"]
            recordings[name].append(load_recording(out / recording_name(run["start_y_m"], name)))
    save(plot_paths(recordings), out / "fig13_all_starts")
    save(plot_responses(recordings, "v"), out / "fig14_all_starts")
    save(plot_responses(recordings, "a"), out / "fig15_all_starts")
    save(plot_cone_use(recordings), out / "cone_use")
    save(plot_by_start(summary["runs"]), out / "by_start")
    return []


def plot_paths(recordings: ByArchitecture) -> Figure:
    """Fig. 13 for all starts: paths in the y–z plane, a panel an architecture; a cross where the block was lost."""
    names = _known(recordings)
    figure, panels = _panels(2, -(-len(names) // 2), (6.8, 6.2), share=True, share_x=True)
    for ax in panels[len(names) :]:
        ax.set_axis_off()
    for ax, name in zip(panels, names, strict=False):
        for k, data in enumerate(recordings[name]):
            window = data.sel(time=slice(0.0, data.attrs["end_time_s"]))
            ax.plot(*window["x_cmd"].values[:, :2].T, color="black", linewidth=0.8, label=None if k else "command")
            ax.plot(*window["x"].values[:, :2].T, **_line(name), label=None if k else "response")
            if (lost := dropped_at(data)) is not None:
                y, z, _ = data["x"].sel(time=lost, method="nearest").values
                ax.plot(y, z, "X", color="black", markersize=6, markerfacecolor=STYLES[name].color, linestyle="none")
        if recordings[name]:
            ax.axhline(
                recordings[name][0].attrs["table_height_m"], color="0.55", linewidth=3.0, zorder=1, label="table"
            )
        ax.set_xlabel(LABELS["x"][0])
        ax.set_aspect("equal")
    panels[0].set_ylabel(LABELS["x"][1])
    return _finished(figure, panels, names)


def plot_responses(recordings: ByArchitecture, quantity: str) -> Figure:
    """Figs 14 ("v") and 15 ("a") for all starts: rows y, z, θ, a column for each architecture with observer."""
    names = [name for name in _known(recordings) if name in WITH_OBSERVER] or _known(recordings)
    figure, panels = _panels(3, len(names), (3.6 * len(names), 6.4), share="row")
    for column, name in enumerate(names):
        for row in range(3):
            ax = panels[row * len(names) + column]
            for k, data in enumerate(recordings[name]):
                window = data.sel(time=slice(-0.02, data.attrs["end_time_s"] + 0.15))
                time = window["time"].values
                command = window[f"{quantity}_cmd"].values[:, row]
                ax.plot(time, command, color="black", linewidth=0.7, label=None if k else "command")
                ax.plot(time, window[quantity].values[:, row], **_line(name), label=None if k else "response")
            if not column:
                ax.set_ylabel(LABELS[quantity][row])
        panels[2 * len(names) + column].set_xlabel("time [s]")
    if left_out := [NAMES[name] for name in _known(recordings) if name not in names]:
        words = f"left out, as in the paper: {', '.join(left_out)}"
        figure.supxlabel(words, x=0.99, ha="right", fontsize=8, color="0.4")
    return _finished(figure, panels, names)


def plot_cone_use(recordings: ByArchitecture) -> Figure:
    """Friction cone used, planned and realised, from the first start until release or loss; 1 is the border of (7).

    Realised: |tangential| / (μ normal) of the contact force; planned: of the commanded acceleration, eq. (10).
    """
    names = _known(recordings)
    figure, panels = _panels(1, len(names), (2.6 * len(names) + 0.6, 3.0), share=True)
    for ax, name in zip(panels, names, strict=True):
        for data in recordings[name][:1]:
            lost = dropped_at(data)
            end = data.attrs["release_time_s"] if lost is None else lost
            window = data.sel(time=slice(0.0, end))
            time = window["time"]
            ax.plot(time, window["cone_use_cmd"], color="black", linewidth=0.8, label="planned")
            ax.plot(time, window["cone_use"], **_line(name), label="realised")
        ax.axhline(1.0, **GUIDE)
        ax.set(xlabel="time [s]", ylim=(0, 1.1))
    panels[0].set_ylabel("friction cone used [1]")
    return _finished(figure, panels, names)


def plot_by_start(runs: Sequence[dict[str, Any]]) -> Figure:
    """Position RMSE, acceleration RMSE, joint-2 torque and velocity delay over the start; open marks: block lost."""
    figure, panels = _panels(2, 2, (7.6, 5.2), share=False)
    known = Runs(runs)
    for ax, (label, (metric, factor)) in zip(panels, QUANTITIES.items(), strict=False):
        for name in _known({run["architecture"]: run for run in runs}):
            mine = [run for run in known.of(name) if metric in run]
            starts, values = [100 * run["start_y_m"] for run in mine], factor * known.values(name, metric)
            colour = STYLES[name].color
            faces = [colour if run["success"] else "white" for run in mine]
            ax.plot(starts, values, color=colour, linewidth=1.0, zorder=2)
            ax.scatter(starts, values, c=faces, edgecolors=colour, zorder=3, label=NAMES[name])
        ax.set(ylabel=label)
        tidy(ax)
    mean, deviation = (100 * value for value in PAPER_RMSE)
    panels[0].axhspan(mean - deviation, mean + deviation, color="0.85", zorder=1, label="the paper, FF + DOB")
    marked: tuple[list[float], ...] = ([0.2, 0.5, 1, 2, 4], [1, 2, 5, 10, 20, 50, 100])
    for ax, ticks in zip(panels, marked, strict=False):
        ax.set_yscale("log")
        ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        ax.minorticks_off()
    for ax in panels[2:]:
        ax.set_xlabel("start y [cm]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False)
    return figure


def _known(recordings: Mapping[str, Any]) -> list[str]:
    return [name for name in ARCHITECTURES if name in recordings]


def _panels(
    rows: int, columns: int, size: tuple[float, float], share: Any, share_x: bool = False
) -> tuple[Figure, list[Axes]]:
    with rc_context(RC):
        figure = Figure(figsize=size, layout="constrained")
        return figure, list(np.ravel(figure.subplots(rows, columns, sharey=share, sharex=share_x, squeeze=False)))


def _line(name: str) -> dict[str, Any]:
    return {"color": STYLES[name].color, "linewidth": 0.9, "alpha": 0.7}


def _finished(figure: Figure, panels: Sequence[Axes], names: Sequence[str]) -> Figure:
    """The figure with a grid in every panel, names above those of the architectures, and one legend."""
    for ax in panels:
        tidy(ax)
    for ax, name in zip(panels, names, strict=False):
        ax.set_title(NAMES[name], color=STYLES[name].color, fontweight="bold", fontsize=10)
    handles, labels = panels[0].get_legend_handles_labels()
    for handle in handles[1:]:
        handle.set_alpha(1.0)
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False)
    return figure
