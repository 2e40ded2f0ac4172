"""How a pancake bent: energy, contact and overhang over time, and its section at some instants of a flip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipdiagram.arrays import Array, Floats
from flipdiagram.errors import InputError
from flipdiagram.figures.motion import dropped_at
from flipdiagram.figures.style import GUIDE, LABELS, MARK, NAMES, OTHER, RC, STYLES, finish, tidy
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.simulation import events
from flipdiagram.simulation.deformation import bends
from flipdiagram.simulation.pancake_surface import middle_section, outlines, surface_of
from flipdiagram.simulation.recording import rotations

INSTANTS = 8
"""Outlines that are drawn."""
BEFORE, AFTER = 0.05, 0.2
"""Seconds shown before the motion, and after touch-down or the end of the motion."""
LANDING = 0.08
"""Seconds after touch-down that belong to the flight here: then it bends most."""
DARKEST, PALEST = np.array([0.0, 0.24, 0.38]), np.array([0.70, 0.86, 0.95])
"""Colours of the first outline and of the last, one hue from dark to pale: readable without colours too."""


def plot_deformation(recordings: Mapping[str, xr.Dataset], axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Four panels over time, of every pancake, and two of the last architecture's section x = 0 in flight.

    Over time: energy of the deformation, contact with blade and with table, share of the lower face beyond the blade;
    release and touch-down are marked.  In flight: the outline in the y-z plane, and the
    deflection of the middle line from the rigid pancake that lies nearest, from release until shortly after touch-down.

    InputError where no recording is of a pancake, and for too few axes.
    """
    names = [name for name in dict.fromkeys([*ARCHITECTURES, *recordings]) if name in recordings]
    shown = {name: recordings[name] for name in names if bends(recordings[name])}
    if not shown:
        valid = "at least one of a pancake (object.kind: pancake)"
        raise InputError(f"these recordings are of rigid blocks; valid is {valid}", field="recordings", valid=valid)
    own, panels = axes is None, _panels() if axes is None else list(axes)
    if len(panels) != 6:
        raise InputError(f"{len(panels)} axes given; valid are 6", field="axes", value=len(panels), valid=6)
    end = AFTER + max(max(_flight(data)[1], float(data.attrs["end_time_s"])) for data in shown.values())
    for name, recording in shown.items():
        _over_time(panels[:4], name, recording, end)
    labels = ("energy [mJ]", "contact with\nblade [cm²]", "contact with\ntable [cm²]", "overhang [%]")
    for panel, label in zip(panels, labels, strict=False):
        panel.set_ylabel(label)
        panel.set_ylim(bottom=0.0)
    for marker, face, label in (
        ("o", "white", "release"),
        ("X", "white", "pancake dropped"),
        ("v", "black", "touch-down"),
    ):
        panels[0].plot([], [], marker, **MARK, markersize=5, markerfacecolor=face, label=label)
    panels[3].set_xlabel("time [s]")
    _sections(panels[4:], *list(shown.items())[-1])
    finish(panels[:4], own)
    for panel in panels[4:]:
        tidy(panel)
    if own:
        panels[0].figure.align_ylabels(panels[:4])
    return panels


def _panels() -> list[Axes]:
    """Four flat panels on the left, which share their time, and two high ones on the right."""
    with rc_context(RC):
        figure = Figure(figsize=(9.6, 6.4), layout="constrained")
        grid = figure.add_gridspec(1, 2)
        left, right = grid[0].subgridspec(4, 1), grid[1].subgridspec(2, 1, height_ratios=(1.2, 1.0))
        panels = [figure.add_subplot(left[0])]
        panels += [figure.add_subplot(left[row], sharex=panels[0]) for row in range(1, 4)]
        for panel in panels[:3]:
            panel.tick_params(labelbottom=False)
        return [*panels, figure.add_subplot(right[0]), figure.add_subplot(right[1])]


def _over_time(panels: Sequence[Axes], name: str, recording: xr.Dataset, end: float) -> None:
    """Energy, contact and overhang of one architecture until an end [s], its release and its touch-down marked."""
    release, landed = _flight(recording)
    frames, samples = recording["frame_time"].values, recording["time"].values
    area = 1e4 * recording["contact_area"]
    signals = [
        (frames, 1e3 * recording["deformation_energy"].values),
        (samples, area.sel(surface="blade").values),
        (samples, area.sel(surface="table").values),
        (frames, 100 * recording["overhang"].values),
    ]
    style = STYLES.get(name, OTHER)
    for panel, (time, values) in zip(panels, signals, strict=True):
        inside = (time >= -BEFORE) & (time <= end)
        panel.plot(time[inside], values[inside], label=NAMES.get(name, name), **style.line())
        lost = "o" if dropped_at(recording) is None else "X"
        for at, marker, face in ((release, lost, "white"), (landed, "v", style.color)):
            value = values[int(np.argmin(np.abs(time - at)))]
            panel.plot(
                at, value, marker, color=style.color, markerfacecolor=face, markersize=5, zorder=3.5, clip_on=False
            )


def _flight(recording: xr.Dataset) -> tuple[float, float]:
    """When the pancake left the blade, and when it touched the table, or the recording ended [s]."""
    landed = events.touchdown(recording)
    end = float(recording["time"][-1]) if landed is None else landed.time_s
    return float(recording["time"][events.release_index(recording)]), end


def _sections(panels: Sequence[Axes], name: str, recording: xr.Dataset) -> None:
    """The section x = 0 at some instants of the flight: its outline in the world, its middle line in its own frame."""
    surface = surface_of(recording)
    assert surface is not None, "this recording is of a pancake"
    section, (release, landed) = middle_section(recording, surface), _flight(recording)
    # at frames, where pose and vertices belong together
    surface = surface.some(np.searchsorted(surface.time[:-1], np.linspace(release, landed + LANDING, INSTANTS)))
    times, poses = surface.time, recording["block_pose"].sel(time=surface.time, method="nearest").values
    lines = 0.5 * (surface.vertices[:, section[0]] + surface.vertices[:, section[1]])
    colours = [tuple(colour) for colour in np.linspace(DARKEST, PALEST, INSTANTS)]
    for k, outline in enumerate(outlines(surface, section, times)):
        label = f"{times[k]:.2f} s"
        panels[0].fill(*outline.T, facecolor=(*colours[k], 0.6), edgecolor=colours[k], linewidth=1.2, label=label)
        s, n = 1e3 * _own_frame(lines[k], poses[k])[:, 1:].T
        panels[1].plot(s, n, ".-", color=colours[k], label=label)
    panels[0].axhline(recording.attrs["table_height_m"], color="0.55", linewidth=3.0, zorder=1)
    panels[0].set(xlabel=LABELS["x"][0], ylabel=LABELS["x"][1])
    title = f"{NAMES.get(name, name)}: section along the middle, touch-down at {landed:.2f} s"
    panels[0].set_title(title, loc="right", fontsize=8, color="0.4")
    panels[0].set_aspect("equal", adjustable="datalim")
    panels[0].legend(fontsize="small", frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    panels[1].axhline(0.0, **GUIDE)
    panels[1].set(xlabel="along the pancake s [mm]", ylabel="deflection [mm]")


def _own_frame(points: Floats, pose: Array) -> Floats:
    """Points (n, 3) of the world [m] in the frame of a pose (7,)."""
    return np.asarray(rotations(pose[None])[0].apply(points - pose[4:], inverse=True))
