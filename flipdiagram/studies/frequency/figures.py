"""Figs 5–10 of the paper from the summary of a frequency study; nothing here simulates.

Measured curves have the style of their architecture, lighter for a smaller g_dis; the closed form of the loop without
friction is the thin black line.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from flipdiagram.errors import InputError
from flipdiagram.figures.style import GUIDE, NAMES, STYLES, finish, new_axes, save, style_of, tidy
from flipdiagram.files import write_atomically
from flipdiagram.studies.frequency.response import FrequencyResponse
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


def write_figures(summary: Summary, out: Path, **_: Any) -> list[str]:
    """Draw Figs 5–10 as PNG and SVG, and write the tables as claims.md."""
    figures = {
        "fig05_gain": plot_gain(summary, "5"),
        "fig06_gain_with_friction": plot_gain(summary, "6"),
        "fig07_position_error": plot_error(summary),
        "fig08_phase": plot_phase(summary),
        "fig09_torque": plot_torque(summary),
        "fig10_noise": plot_noise(summary),
    }
    for name, figure in figures.items():
        save(figure, out / name)
    write_atomically(out / "claims.md", markdown(summary))
    return []


def plot_gain(summary: Summary, figure: str) -> Figure:
    """Fig. 5 (without friction) or 6 (with): peak acceleration over that of the command.

    Fig. 6 has a second panel for the other friction model where the summary holds one.
    """
    models = summary.get("friction_models") if figure == "6" else None
    panels = [summary["curves"]] + ([] if models is None else [models["curves"]])
    axes = new_axes(len(panels), (5.2 * len(panels), 3.8), columns=len(panels))
    for ax, entries in zip(axes, panels, strict=True):
        _responses(ax, _pick(entries, figure), _pick(summary["curves"], "5"))
        ax.axhline(np.sqrt(0.5), **GUIDE, label="−3 dB")
        ax.set(xscale="log", yscale="log", xlabel=OMEGA, ylabel="acceleration gain [1]")
        ax.set_ylim(1e-2, 3 if figure == "5" else 40)
    if models is not None:
        for ax, name in zip(axes, (models["figures_6_and_8"], models["other"]), strict=True):
            ax.set_title(f"friction: {name}", fontsize="medium")
    return _finished(axes)


def plot_error(summary: Summary) -> Figure:
    """Fig. 7: RMS error of the position for a command of 1 m, without friction."""
    axes = new_axes(1, (5.2, 3.8))
    curves = [entry for entry in _pick(summary["curves"], "7") if not entry["friction"]]
    _responses(axes[0], curves, curves)
    axes[0].set(xscale="log", yscale="log", xlabel=OMEGA, ylabel="RMS error of x [m]")
    return _finished(axes)


def plot_phase(summary: Summary) -> Figure:
    """Fig. 8: phase of the response with friction, (a) without and (b) with FF, for each g_dis."""
    axes = new_axes(2, (10.4, 3.9), columns=2)
    for ax, figure, words in zip(axes, ("8a", "8b"), ("without", "with"), strict=True):
        entries = _pick(summary["curves"], figure)
        _responses(ax, [entry for entry in entries if entry["friction"]], entries, np.degrees)
        ax.set(xscale="log", xlabel=OMEGA, ylabel="phase of x against x_cmd [deg]")
        ax.set_title(f"({figure[-1]}) {words} FF", fontsize="medium")
        ax.axhline(0.0, **GUIDE)
    return _finished(axes)


def plot_torque(summary: Summary) -> Figure:
    """Fig. 9: largest force against g_dis at three command frequencies; each panel has a scale of its own."""
    axes = new_axes(3, (10.4, 3.6), columns=3)
    for ax, figure in zip(axes, ("9a", "9b", "9c"), strict=True):
        curves = _pick(summary["torque"], figure)
        for entry in curves:
            name = entry["architecture"]
            ax.plot(entry["g_dis_rad_s"], entry["max_torque_N"], label=NAMES[name], **_line(name))
            ax.plot(entry["g_dis_rad_s"], entry["theory"], **THEORY)
        ax.set(xscale="log", xlabel="$g_{dis}$ [rad/s]", ylabel="maximum force [N]")
        ax.axvline(curves[0]["omega_rad_s"], **GUIDE, label="$g_{dis}$ = ω")
        ax.set_title(f"({figure[-1]}) ω = {curves[0]['omega_rad_s']:g} rad/s", fontsize="medium")
    return _finished(axes)


def plot_noise(summary: Summary) -> Figure:
    """Fig. 10: velocity noise to position, sinusoids as lines and broadband noise as dots; relative to PD beside it."""
    axes = new_axes(2, (10.4, 3.9), columns=2)
    # without FF and with it are the same curve: draw the one with FF first, so that the other lies on it
    curves = sorted(_pick(summary["curves"], "10"), key=lambda entry: "ff" not in entry["architecture"])
    pd = next(entry for entry in curves if entry["architecture"] == "pd")
    relative = [e | {key: np.divide(e[key], pd[key]) for key in ("value", "theory")} for e in curves]
    for ax, entries in zip(axes, (curves, relative), strict=True):
        _responses(ax, entries, entries)
    for entry in summary.get("broadband", ()):
        if "ff" not in entry["architecture"]:
            label = "broadband noise" if entry["architecture"] == "pd" else None
            axes[0].plot(entry["omega_rad_s"], entry["value"], label=label, **BROADBAND)
    axes[0].set(xscale="log", yscale="log", xlabel=OMEGA, ylabel="|x / $v_{noise}$| [s]")
    axes[1].set(xscale="log", xlabel=OMEGA, ylabel="noise gain relative to PD [1]")
    return _finished(axes)


def plot_response(response: FrequencyResponse, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Gain and phase [deg] of one controller over ω; axes that were given may hold those of others already."""
    axes = list(new_axes(2, (5.2, 4.6)) if ax is None else ax)
    if len(axes) != 2:
        raise InputError.of("ax", len(axes), "2, for gain and phase", f"{len(axes)} axes given")
    line = STYLES[response.name].line() if response.name in STYLES else {}
    label = NAMES.get(response.name, response.name) + (", friction" if response.friction else "")
    axes[0].plot(response.omega, response.gain, label=label, **line)
    axes[1].plot(response.omega, np.degrees(response.phase), label=label, **line)
    axes[0].set(xscale="log", yscale="log", ylabel="gain |X / $X_{cmd}$| [1]")
    axes[1].set(xscale="log", xlabel=OMEGA, ylabel="phase of x against $x_{cmd}$ [deg]")
    finish(axes, own=False)  # a legend that grows with the next response
    return axes


def _pick(entries: Sequence[Any], figure: str) -> list[Any]:
    return [entry for entry in entries if entry["figure"] == figure]


def _line(architecture: str) -> dict[str, Any]:
    line = style_of(architecture).line()
    return line | {"linewidth": WIDER * line["linewidth"]}


def _responses(ax: Axes, curves: Sequence[Any], exact: Sequence[Any], convert: Any = np.asarray) -> None:
    """Draw curves, each with the theory of its loop without friction, which stands in the entries `exact`.

    The colour of the smaller ones of several g_dis is mixed with white.
    """
    cut_offs = sorted({entry["g_dis_rad_s"] for entry in curves if entry["g_dis_rad_s"]})
    for entry in curves:
        name, g = entry["architecture"], entry["g_dis_rad_s"]
        label, line = NAMES[name], _line(name)
        if g and len(cut_offs) > 1:
            part = LIGHTEST + (1 - LIGHTEST) * cut_offs.index(g) / (len(cut_offs) - 1)
            line["color"] = tuple(1 - part * (1 - np.array(to_rgb(line["color"]))))
            label += f", $g_{{dis}}$ = {g:g} rad/s"
        ax.plot(entry["omega_rad_s"], convert(np.asarray(entry["value"], dtype=float)), label=label, **line)
        for other in exact:
            if (other["architecture"], other["g_dis_rad_s"], other["friction"]) == (name, g, False):
                ax.plot(other["omega_rad_s"], convert(np.asarray(other["theory"], dtype=float)), **THEORY)


def _finished(axes: Sequence[Axes]) -> Figure:
    """The figure with a grid, and one legend above the panels with each label once."""
    labels: dict[str, Any] = {}
    for ax in axes:
        tidy(ax)
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            labels.setdefault(label, handle)
    figure = cast("Figure", axes[0].figure)
    # theory last; handles fill the legend column by column
    order = sorted(labels, key=lambda label: label.startswith("theory"))
    columns = 3 if figure.get_figwidth() < 7 or len(order) > 6 else 6
    handles = [labels[label] for label in order]
    figure.legend(handles, order, loc="outside upper center", ncols=columns, frameon=False, handlelength=3)
    return figure
