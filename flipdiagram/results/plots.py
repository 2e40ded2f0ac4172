"""One recording as Matplotlib axes; nothing here simulates, and there is no pyplot."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flipdiagram.errors import InputError
from flipdiagram.figures.motion import dropped_at, finish_path
from flipdiagram.figures.style import GUIDE, LABELS, MARK, NAMES, OTHER, STYLES, finish, new_axes
from flipdiagram.results.signals import components, pretty, scenario_fields
from flipdiagram.simulation.events import release_index, touchdown, touching

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
    "lift_off": "lift-off",
    "contact_force": "{0}",
}
BLOW = 4.0
"""Multiple of the largest planned normal force from which the realised one is a blow."""
MARGINS = (("cone_use", 1.0, "1"), ("centre_of_pressure", 1e3, "mm"), ("normal_force", 1.0, "N"), ("slip", 1e3, "mm"))


def line_of(data: xr.Dataset) -> dict[str, Any]:
    """Keywords of Axes.plot: name and style of the architecture, one style for all that we do not know."""
    name = data.attrs["architecture"]
    return {"label": NAMES.get(name, name), **STYLES.get(name, OTHER).line()}


def events(data: xr.Dataset) -> dict[str, float]:
    """What happened, by name: 'release' or 'block lost', and 'touch-down' [s]; only what lies inside the recording."""
    time, happened = data["time"].values, {}
    contact, landed = touching(data, "blade-block"), touchdown(data)
    last = release_index(data)
    if contact.any() and last < len(time) - 1:
        happened["release" if dropped_at(data) is None else "block lost"] = float(time[last])
    if landed is not None and landed.time_s > time[0]:
        happened["touch-down"] = landed.time_s
    return happened


def label_of(part: xr.DataArray) -> str:
    """A component with its unit, as on the axis of a figure."""
    base, place = part.attrs["signal"].removesuffix("_cmd"), part.attrs["place"]
    if base in LABELS and len(place) == 1 and place[0] < 3:
        return LABELS[base][place[0]]
    which = " ".join(part.attrs["labels"])
    symbol = SYMBOLS.get(base, "")
    if not symbol or ("$" in symbol and len(which) > 2):  # the name of a joint, too long for a subscript
        symbol = base.replace("_", " ") + " {0}"
    return f"{symbol.format(which).strip()} [{pretty(part.attrs['units'])}]"


def plot_signal(
    data: xr.Dataset, signal: str, ax: Axes | Sequence[Axes] | None, window: tuple[float, float] | None
) -> Axes | Sequence[Axes]:
    """See `FlipAccessor.plot`."""
    shown = view(data, window)

    def draw(panel: Axes, part: xr.DataArray) -> None:
        signal = part.attrs["signal"]
        command = signal.removesuffix("_cmd") + "_cmd"
        if command in data.data_vars:
            (commanded,) = components(shown, str(part.name).replace(signal, command, 1))
            panel.plot(shown["time"], commanded, label="command", **STYLES["command"].line())
        if signal != command:
            panel.plot(shown["time"], part, **line_of(data))
        _mark_events(panel, data)

    return draw_components(components(shown, signal), ax, draw)


def draw_components(
    parts: Sequence[xr.DataArray], ax: Axes | Sequence[Axes] | None, draw: Callable[[Axes, xr.DataArray], None]
) -> Axes | Sequence[Axes]:
    """A panel a component, which `draw` fills; the Axes, a list where there are several or a list was given."""
    count = len(parts)
    columns = 1 if count <= 3 else 3 if count % 3 == 0 else 4 if count > 4 else 2
    rows = -(-count // columns)
    size = (3.0 * columns, 0.8 + 2.0 * rows) if count > 3 else (5.6, 3.6 if count == 1 else 0.6 + 1.9 * count)
    panels = _time_panels(count, ax, size, columns)
    for panel, part in zip(panels, parts, strict=True):
        panel.set_ylabel(label_of(part))
        draw(panel, part)
    finish(panels, ax is None)
    return panels[0] if count == 1 and not isinstance(ax, Sequence) else panels


def plot_path(data: xr.Dataset, ax: Axes | None) -> Axes:
    """See `FlipAccessor.path`."""
    panel = ax if ax is not None else new_axes(1, (5.2, 5.4))[0]
    moving, line = data.sel(time=slice(0.0, data.attrs["end_time_s"])), line_of(data)
    if not moving.sizes["time"]:
        valid = f"samples between 0 and {data.attrs['end_time_s']} s, the motion"
        raise InputError(f"the recording lacks {valid}", field="recording", value=data.sizes["time"], valid=valid)
    command, response = moving["x_cmd"].values, moving["x"].values
    panel.plot(command[:, 0], command[:, 1], label="command", **STYLES["command"].line())
    panel.plot(response[:, 0], response[:, 1], **line)
    happened = events(data)
    loss = next(iter(happened.keys() & {"release", "block lost"}), None)
    if loss and "touch-down" in happened:
        fall = data["block_pose"].sel(time=slice(happened[loss], happened["touch-down"])).values[:, 5:]
        panel.plot(fall[:, 0], fall[:, 1], color=FLIGHT, linestyle="--", label="block in flight")
        panel.plot(*fall[-1], "v", **MARK, markerfacecolor=FLIGHT, label="touch-down")
    panel.plot(command[0, 0], command[0, 1], "s", **MARK, markersize=5, label="start")
    if loss:
        at = data["x"].sel(time=happened[loss], method="nearest").values
        shape, face = ("o", "white") if loss == "release" else ("X", line["color"])
        panel.plot(at[0], at[1], shape, **MARK, markersize=8, markerfacecolor=face, label=loss)
    finish_path(panel, ax is None)
    return panel


def plot_margins(data: xr.Dataset, axes: Sequence[Axes] | None) -> Sequence[Axes]:
    """See `FlipAccessor.margins`."""
    if missing := [name for name, _, _ in MARGINS if name not in data]:
        valid = "a recording of this version"
        message = f"the recording lacks {', '.join(missing)}; valid is {valid}"
        raise InputError(message, field="recording", value=missing, valid=valid)
    panels = _time_panels(len(MARGINS), axes, (8.0, 5.0), columns=2)
    happened, line, release = events(data), line_of(data), float(data.attrs["release_time_s"])
    lost = happened.get("release", happened.get("block lost", float(data.attrs["end_time_s"])))
    shown = data.sel(time=slice(0.0, max(lost, release)))
    for panel, (signal, factor, unit) in zip(panels, MARGINS, strict=True):
        planned = np.full(shown.sizes["time"], np.nan)
        if f"{signal}_cmd" in data:
            # at the release itself the command brakes already
            planned = factor * shown[f"{signal}_cmd"].where(shown["time"] < release).values
            panel.plot(shown["time"], planned, label="planned", **STYLES["command"].line())
        # what comes after the release is another contact, not a margin
        realised = factor * shown[signal].where(shown["time"] <= lost).values
        panel.plot(shown["time"], realised, **line | {"label": f"realised, {line['label']}"})
        panel.set_ylabel(f"{SYMBOLS.get(signal, signal.replace('_', ' '))} [{unit}]")
        if signal == "normal_force":
            _leave_out_blows(panel, planned, realised)
    panels[0].axhline(1.0, **GUIDE, label="limit")
    panels[0].set_ylim(0.0, 1.1)
    length = (scenario_fields(data) or {}).get("object.length")
    if isinstance(length, float):
        for edge in (-500.0 * length, 500.0 * length):
            panels[1].axhline(edge, **GUIDE)
    finish(panels, axes is None)
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
        valid = f"a part of {first:g} to {last:g} s"
        message = f"window = {window} holds no sample; valid is {valid}"
        raise InputError(message, field="window", value=window, valid=valid)
    return shown


def _time_panels(count: int, ax: Axes | Sequence[Axes] | None, size: tuple[float, float], columns: int) -> list[Axes]:
    """The axes to draw into, given or of a new Figure; time [s] stands below all of them, or the lowest."""
    if ax is None:
        every = new_axes(-(-count // columns) * columns, size, columns)
        for spare in every[count:]:
            spare.remove()
        panels = every[:count]
        for panel in panels[-columns:]:
            panel.tick_params(labelbottom=True)
    else:
        panels = list(np.ravel(np.array(ax, dtype=object)))
    if len(panels) != count:
        message = f"{len(panels)} axes given; valid are {count}, one a panel"
        raise InputError(message, field="ax", value=len(panels), valid=count)
    for panel in panels[-columns:] if ax is None else panels:
        panel.set_xlabel("time [s]")
    return panels


def _mark_events(panel: Axes, data: xr.Dataset) -> None:
    """Release and touch-down as they happened, and the planned release, as vertical lines."""
    styles = {"planned release": ":", "touch-down": "--"}
    for name, time in {"planned release": float(data.attrs["release_time_s"]), **events(data)}.items():
        panel.axvline(time, **GUIDE | {"linestyle": styles.get(name, "-")}, label=name)
