"""One recording as Matplotlib axes; nothing here simulates, and there is no pyplot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flipdiagram.errors import InputError
from flipdiagram.figures.motion import dropped_at
from flipdiagram.figures.style import GUIDE, LABELS, MARK, NAMES, STYLES, Style, finish, new_axes
from flipdiagram.results.signals import Component, components, pretty, scenario_fields
from flipdiagram.simulation import metrics

OTHER = Style("#56B4E9", "-", 2.5, 1.6)
"""An architecture of the user's own."""
FLIGHT = "#CC79A7"
"""The block's own colour, as in the figure of the plan."""
BEFORE, AFTER = 0.05, 0.15
"""Seconds shown before the motion and after its end."""
SYMBOLS = {
    "q": r"$q_\mathrm{{{0}}}$",
    "qd": r"$\dot q_\mathrm{{{0}}}$",
    "tau": r"$τ_\mathrm{{{0}}}$",
    "tau_dis": r"$τ_\mathrm{{dis,{0}}}$",
    "power": "power {0}",
    "energy": "work {0}",
    "tool_pose": "tool {0}",
    "block_pose": "block {0}",
    "sliding_angle": "sliding angle φ",
    "cone_use": "friction cone used",
    "centre_of_pressure": "centre of pressure",
    "normal_force": "normal force",
    "slip": "slip",
    "lift_off": "lift-off",
    "contact_force": "{0}",
}
BLOW = 4.0
"""Multiple of the largest planned normal force from which the realised one is a blow."""
MARGINS = (("cone_use", 1.0, "1"), ("centre_of_pressure", 1e3, "mm"), ("normal_force", 1.0, "N"), ("slip", 1e3, "mm"))


def style_for(data: xr.Dataset) -> Style:
    """The style of the recording's architecture; one of its own for an architecture that we do not know."""
    return STYLES.get(data.attrs["architecture"], OTHER)


def events(data: xr.Dataset) -> dict[str, float]:
    """What happened, by name: 'release' or 'block lost', and 'touch-down' [s]; only what lies inside the recording."""
    time, happened = data["time"].values, {}
    contact, landed = metrics.touching(data, "blade-block"), metrics.touchdown(data)
    last = metrics.release_index(data)
    if contact.any() and last < len(time) - 1:
        happened["release" if dropped_at(data) is None else "block lost"] = float(time[last])
    if landed is not None and landed.time_s > time[0]:
        happened["touch-down"] = landed.time_s
    return happened


def label_of(part: Component) -> str:
    """A component with its unit, as on the axis of a figure."""
    base = part.signal.removesuffix("_cmd")
    if base in LABELS and len(part.place) == 1 and part.place[0] < 3:
        return LABELS[base][part.place[0]]
    which = " ".join(part.labels)
    symbol = SYMBOLS.get(base, "")
    if not symbol or ("$" in symbol and len(which) > 2):  # the name of a joint, too long for a subscript
        symbol = base.replace("_", " ") + " {0}"
    return f"{symbol.format(which).strip()} [{pretty(part.unit)}]"


def plot_signal(
    data: xr.Dataset, signal: str, ax: Axes | Sequence[Axes] | None, window: tuple[float, float] | None
) -> Axes | Sequence[Axes]:
    """See `FlipAccessor.plot`."""
    parts = components(data, signal)
    panels, own = panels_for(parts, ax)
    shown = view(data, window)
    name, style = data.attrs["architecture"], style_for(data)
    for panel, part in zip(panels, parts, strict=True):
        if f"{part.signal}_cmd" in data.data_vars:
            twin = Component("", f"{part.signal}_cmd", part.labels, part.place, part.unit)
            panel.plot(shown["time"], twin.values(shown), label="command", **STYLES["command"].line())
            panel.plot(shown["time"], part.values(shown), label=NAMES.get(name, name), **style.line())
        else:
            commanded = part.signal.endswith("_cmd")
            line = (STYLES["command"] if commanded else style).line()
            label = "command" if commanded else NAMES.get(name, name)
            panel.plot(shown["time"], part.values(shown), label=label, **line)
        panel.set_ylabel(label_of(part))
    mark_events(panels, data)
    finish_panels(panels, own)
    return panels[0] if len(parts) == 1 and not isinstance(ax, Sequence) else panels


def plot_path(data: xr.Dataset, ax: Axes | None) -> Axes:
    """See `FlipAccessor.path`."""
    panels, own = ([ax], False) if ax is not None else (new_axes(1, (5.2, 5.4)), True)
    panel, name, style = panels[0], data.attrs["architecture"], style_for(data)
    moving = data.sel(time=slice(0.0, data.attrs["end_time_s"]))
    if not moving.sizes["time"]:
        raise InputError(f"the recording has no sample between 0 and {data.attrs['end_time_s']} s, the motion")
    command, response = moving["x_cmd"].values, moving["x"].values
    panel.plot(command[:, 0], command[:, 1], label="command", **STYLES["command"].line())
    panel.plot(response[:, 0], response[:, 1], label=NAMES.get(name, name), **style.line())
    happened, y_z = events(data), data["block_pose"].values[:, 5:]
    loss = next(iter(happened)) if happened else ""
    if "touch-down" in happened and loss in ("release", "block lost"):
        time = data["time"].values
        fall = y_z[(time >= happened[loss]) & (time <= happened["touch-down"])]
        panel.plot(fall[:, 0], fall[:, 1], color=FLIGHT, linestyle="--", label="block in flight")
        panel.plot(*fall[-1], "v", **MARK, markerfacecolor=FLIGHT, label="touch-down")
    panel.plot(command[0, 0], command[0, 1], "s", **MARK, markersize=5, label="start")
    if loss in ("release", "block lost"):
        at = data["x"].sel(time=happened[loss], method="nearest").values
        shape, face = ("o", "white") if loss == "release" else ("X", style.color)
        panel.plot(at[0], at[1], shape, **MARK, markersize=8, markerfacecolor=face, label=loss)
    panel.set(xlabel=LABELS["x"][0], ylabel=LABELS["x"][1])
    panel.set_aspect("equal", adjustable="datalim")
    panel.margins(0.08)
    finish_panels(panels, own, time_axis=False)
    return panel


def plot_margins(data: xr.Dataset, axes: Sequence[Axes] | None) -> Sequence[Axes]:
    """See `FlipAccessor.margins`."""
    missing = [name for name, _, _ in MARGINS if name not in data]
    if missing:
        raise InputError(f"the recording lacks {', '.join(missing)}; valid is a recording of this version")
    panels, own = (
        (list(np.ravel(np.array(axes, dtype=object))), False)
        if axes is not None
        else (new_axes(4, (8.0, 5.0), columns=2), True)
    )
    check_count(panels, len(MARGINS))
    happened = events(data)
    lost = happened.get("release", happened.get("block lost", float(data.attrs["end_time_s"])))
    until = max(lost, float(data.attrs["release_time_s"]))
    shown = data.sel(time=slice(0.0, until))
    name = data.attrs["architecture"]
    for panel, (signal, factor, unit) in zip(panels, MARGINS, strict=True):
        planned = np.full(shown.sizes["time"], np.nan)
        if f"{signal}_cmd" in data:
            # at the release itself the command brakes already
            carried = shown["time"] < float(data.attrs["release_time_s"])
            planned = factor * shown[f"{signal}_cmd"].where(carried).values
            panel.plot(shown["time"], planned, label="planned", **STYLES["command"].line())
        # what comes after the release is another contact, not a margin
        realised = factor * shown[signal].where(shown["time"] <= lost).values
        panel.plot(shown["time"], realised, label=f"realised, {NAMES.get(name, name)}", **style_for(data).line())
        panel.set_ylabel(f"{SYMBOLS[signal]} [{unit}]")
        if signal == "normal_force":
            _leave_out_blows(panel, planned, realised)
    panels[0].axhline(1.0, **GUIDE, label="limit")
    panels[0].set_ylim(0.0, 1.1)
    length = (scenario_fields(data) or {}).get("object.length")
    if isinstance(length, float):
        for edge in (-500.0 * length, 500.0 * length):
            panels[1].axhline(edge, **GUIDE)
    finish_panels(panels, own)
    return panels


def _leave_out_blows(panel: Axes, planned: np.ndarray, realised: np.ndarray) -> None:
    """Where a blow of the table dwarfs the planned forces, show those, and write how high the blow was."""
    if not np.isfinite(planned).any() or not np.isfinite(realised).any():
        return
    usual, highest = float(np.nanmax(planned)), float(np.nanmax(realised))
    if highest > BLOW * usual > 0:
        panel.set_ylim(min(0.0, float(np.nanmin(planned))), 2 * usual)
        panel.text(0.98, 0.96, f"up to {highest:.3g} N", transform=panel.transAxes, ha="right", va="top")


def view(data: xr.Dataset, window: tuple[float, float] | None) -> xr.Dataset:
    """The samples to show: the window [s], or from shortly before the motion until shortly after it."""
    if window is None:
        end = max([float(data.attrs["end_time_s"]), *events(data).values()])
        window = (-BEFORE, end + AFTER)
    shown = data.sel(time=slice(*window))
    if not shown.sizes["time"]:
        first, last = data["time"].values[[0, -1]]
        raise InputError(f"window = {window} holds no sample; valid is a part of {first:g} to {last:g} s")
    return shown


def panels_for(parts: Sequence[Component], ax: Axes | Sequence[Axes] | None) -> tuple[list[Axes], bool]:
    """The axes to draw into, one a component, and whether they are of a new Figure."""
    if ax is not None:
        panels = list(np.ravel(np.array(ax, dtype=object)))
        check_count(panels, len(parts))
        return panels, False
    count = len(parts)
    if count <= 3:
        return new_axes(count, (5.6, 3.6 if count == 1 else 0.6 + 1.9 * count)), True
    columns = 3 if count % 3 == 0 else 4 if count > 4 else 2
    rows = -(-count // columns)
    panels = new_axes(rows * columns, (3.0 * columns, 0.8 + 2.0 * rows), columns=columns)
    for spare in panels[count:]:
        spare.remove()
    for panel in panels[count - columns : count]:
        panel.tick_params(labelbottom=True)
    return panels[:count], True


def check_count(panels: Sequence[Axes], count: int) -> None:
    """InputError unless there is one of the axes for each of the panels."""
    if len(panels) != count:
        raise InputError(f"{len(panels)} axes given; valid are {count}, one a panel")


def mark_events(panels: Sequence[Axes], data: xr.Dataset) -> None:
    """Release and touch-down as they happened, and the planned release, as vertical lines."""
    marks = {"planned release": float(data.attrs["release_time_s"]), **events(data)}
    for panel in panels:
        for name, time in marks.items():
            style = GUIDE if name == "planned release" else {**GUIDE, "linestyle": "-"}
            if name == "touch-down":
                style = {**GUIDE, "linestyle": "--"}
            panel.axvline(time, **style, label=name)


def finish_panels(panels: Sequence[Axes], own: bool, time_axis: bool = True) -> None:
    """Labels of time, grid, and a legend: above the panels of a Figure of our own, else inside the first."""
    for panel in panels if time_axis else ():
        if not own or panel in _lowest(panels):
            panel.set_xlabel("time [s]")
    finish(panels, own)


def _lowest(panels: Sequence[Axes]) -> list[Axes]:
    """The lowest panel of each column of a Figure."""
    columns: dict[int, Axes] = {}
    for panel in panels:  # row by row: a lower one replaces a higher one
        place = panel.get_subplotspec()
        columns[place.colspan.start if place else 0] = panel
    return list(columns.values())
