"""Figs 5–10 of the paper from the summary of a frequency study; nothing here simulates.

Every function reads entries as they stand in summary.json, draws into the axes it is given, or into a new Figure, and
returns the axes.  Measured curves have the style of their architecture, lighter for a smaller g_dis; the closed form
of the loop without friction is the thin black line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from flipdiagram.figures.style import NAMES, new_axes, save, style_of, tidy
from flipdiagram.files import write_atomically
from flipdiagram.studies.frequency.tables import markdown
from flipdiagram.studies.study import Summary

THEORY: Any = {"color": "black", "linewidth": 0.5, "zorder": 4, "label": "theory (no friction)"}
WIDER = 1.9
"""Factor on the widths of the styles: where theory and measurement agree, a black hairline runs inside a colour."""
BROADBAND: Any = {"color": "black", "linestyle": "none", "marker": "o", "markersize": 2.5, "zorder": 5}
BROADBAND |= {"markerfacecolor": "white", "markeredgewidth": 0.6}
LIGHTEST = 0.45
"""How much of its colour the curve of the smallest g_dis keeps."""
OMEGA = "ω [rad/s]"


def plot_gain(summary: Summary, figure: str = "5", axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Fig. 5 (without friction) or 6 (with): peak acceleration over that of the command.

    Fig. 6 has a second panel for the other friction model where the summary holds one.
    """
    models = summary.get("friction_models") if figure == "6" else None
    panels = [summary["curves"]]
    if models is not None:
        panels.append(models["curves"])
    axes = list(axes or new_axes(len(panels), (5.2 * len(panels), 3.8), columns=len(panels)))
    for ax, entries in zip(axes, panels, strict=True):
        curves = _pick(entries, figure)
        for entry in curves:
            _curve(ax, entry, curves)
            _theory(ax, _beside(summary, "5", entry))
        ax.axhline(np.sqrt(0.5), color="0.4", linewidth=0.9, linestyle=":")
        ax.set(xscale="log", yscale="log", xlabel=OMEGA, ylabel="acceleration gain")
        ax.set_ylim(1e-2, 3 if figure == "5" else 40)
    if models is not None:
        for ax, name in zip(axes, (models["figures_6_and_8"], models["other"]), strict=True):
            ax.set_title(f"friction: {name}", fontsize="medium")
    _finish(axes)
    return axes


def plot_error(summary: Summary, ax: Axes | None = None, *, friction: bool = False) -> Axes:
    """Fig. 7: RMS error of the position for a command of 1 m."""
    ax = ax or new_axes(1, (5.2, 3.8))[0]
    curves = [entry for entry in _pick(summary["curves"], "7") if entry["friction"] == friction]
    for entry in curves:
        _curve(ax, entry, curves)
        _theory(ax, entry)
    ax.set(xscale="log", yscale="log", xlabel=OMEGA, ylabel="RMS error of x [m]")
    _finish([ax])
    return ax


def plot_phase(summary: Summary, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Fig. 8: phase of the response with friction, (a) without and (b) with FF, for each g_dis."""
    axes = list(axes or new_axes(2, (10.4, 3.9), columns=2))
    for ax, figure in zip(axes, ("8a", "8b"), strict=True):
        curves = [entry for entry in _pick(summary["curves"], figure) if entry["friction"]]
        for entry in curves:
            _curve(ax, entry, curves, np.degrees)
            _theory(ax, _beside(summary, figure, entry), np.degrees)
        ax.set(xscale="log", xlabel=OMEGA, ylabel="phase of x against x_cmd [deg]")
        ax.set_title(f"({figure[-1]}) {'with' if figure == '8b' else 'without'} FF", fontsize="medium")
        ax.axhline(0.0, color="0.4", linewidth=0.9, linestyle=":")
    _finish(axes)
    return axes


def plot_torque(summary: Summary, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Fig. 9: largest force against g_dis at three command frequencies; each panel has a scale of its own."""
    axes = list(axes or new_axes(3, (10.4, 3.6), columns=3))
    for ax, figure in zip(axes, ("9a", "9b", "9c"), strict=True):
        curves = _pick(summary["torque"], figure)
        for entry in curves:
            name = entry["architecture"]
            ax.plot(entry["g_dis_rad_s"], entry["max_torque_N"], label=NAMES[name], **_line(name))
            ax.plot(entry["g_dis_rad_s"], entry["theory"], **THEORY)
        ax.set(xscale="log", xlabel="$g_{dis}$ [rad/s]", ylabel="maximum force [N]")
        ax.axvline(curves[0]["omega_rad_s"], color="0.4", linewidth=0.9, linestyle=":", label="$g_{dis}$ = ω")
        ax.set_title(f"({figure[-1]}) ω = {curves[0]['omega_rad_s']:g} rad/s", fontsize="medium")
    _finish(axes)
    return axes


def plot_noise(summary: Summary, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Fig. 10: velocity noise to position, sinusoids as lines and broadband noise as dots; relative to PD beside it."""
    axes = list(axes or new_axes(2, (10.4, 3.9), columns=2))
    curves = _pick(summary["curves"], "10")
    reference = next((entry for entry in curves if entry["architecture"] == "pd"), None)
    # without FF and with it are the same curve: draw the one with FF first, so that the other lies on it
    for entry in sorted(curves, key=lambda entry: "ff" not in entry["architecture"]):
        _curve(axes[0], entry, curves)
        _theory(axes[0], entry)
        if reference is not None:
            ratio = entry | {"value": np.divide(entry["value"], reference["value"])}
            _curve(axes[1], ratio, curves)
            axes[1].plot(entry["omega_rad_s"], np.divide(entry["theory"], reference["theory"]), **THEORY)
    for entry in summary.get("broadband", ()):
        if "ff" not in entry["architecture"]:
            label = "broadband noise" if entry["architecture"] == "pd" else None
            axes[0].plot(entry["omega_rad_s"], entry["value"], label=label, **BROADBAND)
    axes[0].set(xscale="log", yscale="log", xlabel=OMEGA, ylabel="|x / $v_{noise}$| [s]")
    axes[1].set(xscale="log", xlabel=OMEGA, ylabel="noise gain relative to PD")
    _finish(axes)
    return axes


def write_figures(summary: Summary, out: Path, **_: Any) -> list[str]:
    """Draw Figs 5–10 as PNG and SVG, and write the tables as claims.md."""
    axes: dict[str, Any] = {
        "fig05_gain": plot_gain(summary, "5"),
        "fig06_gain_with_friction": plot_gain(summary, "6"),
        "fig07_position_error": [plot_error(summary)],
        "fig08_phase": plot_phase(summary),
        "fig09_torque": plot_torque(summary),
        "fig10_noise": plot_noise(summary),
    }
    for name, panels in axes.items():
        save(panels[0].figure, out / name)
    write_atomically(out / "claims.md", markdown(summary))
    return []


def _pick(entries: Sequence[Any], figure: str) -> list[Any]:
    return [entry for entry in entries if entry["figure"] == figure]


def _beside(summary: Summary, figure: str, entry: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The entry of the same loop without friction, whose theory is known."""
    keys = ("architecture", "g_dis_rad_s")
    for other in _pick(summary["curves"], figure):
        if not other["friction"] and all(other[key] == entry[key] for key in keys):
            return cast("Mapping[str, Any]", other)
    return None


def _curve(ax: Axes, entry: Mapping[str, Any], group: Sequence[Any], convert: Any = np.asarray) -> None:
    values = convert(np.asarray(entry["value"], dtype=float))
    cut_offs = {other["g_dis_rad_s"] for other in group if other["g_dis_rad_s"]}
    g = f", $g_{{dis}}$ = {entry['g_dis_rad_s']:g}" if entry["g_dis_rad_s"] and len(cut_offs) > 1 else ""
    line = _line(entry["architecture"]) | {"color": _shade(entry, group)}
    ax.plot(entry["omega_rad_s"], values, label=NAMES[entry["architecture"]] + g, **line)


def _line(architecture: str) -> dict[str, Any]:
    line = style_of(architecture).line()
    return line | {"linewidth": WIDER * line["linewidth"]}


def _theory(ax: Axes, entry: Mapping[str, Any] | None, convert: Any = np.asarray) -> None:
    if entry is not None and entry["theory"] is not None:
        values = convert(np.asarray(entry["theory"], dtype=float))
        ax.plot(entry["omega_rad_s"], values, **THEORY)


def _shade(entry: Mapping[str, Any], group: Sequence[Any]) -> tuple[float, ...]:
    """The architecture's colour, mixed with white for the smaller ones of several g_dis."""
    color = np.array(to_rgb(style_of(entry["architecture"]).color))
    cut_offs = sorted({other["g_dis_rad_s"] for other in group if other["g_dis_rad_s"]})
    if not entry["g_dis_rad_s"] or len(cut_offs) < 2:
        return tuple(color)
    part = LIGHTEST + (1 - LIGHTEST) * cut_offs.index(entry["g_dis_rad_s"]) / (len(cut_offs) - 1)
    return tuple(1 - part * (1 - color))


def _finish(axes: Sequence[Axes]) -> None:
    """Grid, and one legend above the panels with each label once."""
    labels: dict[str, Any] = {}
    for ax in axes:
        tidy(ax)
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            labels.setdefault(label, handle)
    figure = axes[0].figure
    if isinstance(figure, Figure):
        # theory last; handles fill the legend column by column
        order = sorted(labels, key=lambda label: label.startswith("theory"))
        columns = 3 if figure.get_figwidth() < 7 else 4 if len(order) > 6 else 6
        handles = [labels[label] for label in order]
        figure.legend(handles, order, loc="outside upper center", ncols=columns, frameon=False, handlelength=3)
