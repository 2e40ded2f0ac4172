"""Results -> Matplotlib axes (Figs. 12 to 15 of the paper and what belongs to them). Nothing here simulates.

Every function draws into the axes it is given, or into a new Figure, and returns the axes.  `recordings` maps
architecture to its recording (an xarray.Dataset as written by `simulate`); time 0 is the start of the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from flipdiagram.arrays import Array
from flipdiagram.figures.style import GUIDE, LABELS, MARK, NAMES, STYLES, WITH_OBSERVER, finish, new_axes, style_of
from flipdiagram.scenario.scenario import ARCHITECTURES, from_mapping
from flipdiagram.scenario.yaml_reader import read_mapping
from flipdiagram.simulation import events
from flipdiagram.simulation.recording import rotations
from flipdiagram.simulation.replans import solve_times

if TYPE_CHECKING:
    from flipdiagram.planning.plan import Plan

Recordings = Mapping[str, xr.Dataset]
NEAR_LIMIT = 0.5
"""Share of a joint's limit that its torque must reach for the limit to be drawn: else it would flatten the curves."""


def dropped_at(recording: xr.Dataset) -> float | None:
    """When blade and block touched last, if the tool had not turned beyond π/2 by then [s]; else None."""
    k = events.release_index(recording)
    return float(recording["time"][k]) if recording["x"].values[k, 2] <= np.pi / 2 else None


def plot_trajectories(recordings: Recordings, ax: Axes | None = None) -> Axes:
    """Fig. 13: the path of the spatula's control point in the y-z plane, command and all architectures."""
    own, ax = ax is None, ax or new_axes(1, (5.2, 5.4))[0]
    for name, recording in _command_first(recordings):
        window = _motion(recording, before=0.0)
        y, z, _ = window["x_cmd" if name == "command" else "x"].values.T
        _line(ax, y, z, name)
        if name == "command":
            k = int(np.searchsorted(window["time"].values, recording.attrs["release_time_s"]))
            ax.plot(y[0], z[0], "s", **MARK, label="start")
            ax.plot(y[k], z[k], "o", **MARK, markerfacecolor="white", label="planned release")
        elif (lost := dropped_at(recording)) is not None:
            y, z, _ = recording["x"].sel(time=lost, method="nearest").values
            ax.plot(y, z, "X", **MARK, markersize=9, markerfacecolor=style_of(name).color)
    if any(dropped_at(recording) is not None for recording in recordings.values()):
        ax.plot([], [], "X", **MARK, markersize=9, markerfacecolor="white", label="block dropped")
    table_and_strikes(ax, recordings)
    finish_path(ax, own)
    return ax


def table_and_strikes(ax: Axes, recordings: Recordings) -> None:
    """The table's surface, and the blade, seen along x, at the moment when it struck the table."""
    label: str | None = "blade at impact"
    for name, recording in recordings.items():
        ax.axhline(recording.attrs["table_height_m"], color="0.55", linewidth=3.0, zorder=1)
        if (struck := events.strike_index(recording)) is not None:
            # of the tool alone: other fields may have had other names when it was recorded
            scenario, _ = read_mapping(recording.attrs["scenario"], "scenario")
            tool = from_mapping({"tool": scenario.get("tool") or {}}).tool
            pose = recording["tool_pose"].values[struck]
            corners = np.array(list(product((-0.5, 0.5), (-0.5, 0.5), (-1.0, 0.0)))) * tool.blade_size
            seen = (pose[4:] + rotations(pose[None])[0].apply(corners))[:, 1:]
            ax.fill(
                *seen[ConvexHull(seen).vertices].T,
                color=style_of(name).color,
                alpha=0.4,
                linewidth=0,
                zorder=2,
                label=label,
            )
            label = None
    if recordings:
        ax.plot([], [], color="0.55", linewidth=3.0, label="table")


def finish_path(ax: Axes, own: bool) -> None:
    """Labels, equal scales and legend of a path in the y-z plane."""
    ax.set(xlabel=LABELS["x"][0], ylabel=LABELS["x"][1])
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    finish([ax], own)


def plot_velocities(
    recordings: Recordings, architectures: Sequence[str] = WITH_OBSERVER, axes: Sequence[Axes] | None = None
) -> Sequence[Axes]:
    """Fig. 14: v_y, v_z, v_theta, command and responses of those architectures that were run; of all, if of none."""
    return _plot_responses(recordings, architectures, "v", axes)


def plot_accelerations(
    recordings: Recordings, architectures: Sequence[str] = WITH_OBSERVER, axes: Sequence[Axes] | None = None
) -> Sequence[Axes]:
    """Fig. 15: a_y, a_z, a_theta, command and responses (differences of the recorded velocity)."""
    return _plot_responses(recordings, architectures, "a", axes)


def plot_sliding_angle(recordings: Recordings, ax: Axes | None = None) -> Axes:
    """Sliding angle of eq. (11) until release or loss of the block, and the friction angle on both sides."""
    own, ax = ax is None, ax or new_axes(1, (5.6, 3.8))[0]
    for name, recording in _command_first(recordings)[1:]:
        lost, release = dropped_at(recording), float(recording.attrs["release_time_s"])
        window = recording.sel(time=slice(0.0, release if lost is None else min(lost, release)))
        _line(ax, window["time"], np.rad2deg(window["sliding_angle"]), name)
        cone = float(np.rad2deg(recording.attrs["friction_angle_rad"]))
    if recordings:
        ax.axhline(cone, **GUIDE, label="friction angle")
        ax.axhline(-cone, **GUIDE)
    ax.set(xlabel="time [s]", ylabel="sliding angle φ [deg]", ylim=(-100, 100), yticks=range(-90, 91, 30))
    finish([ax], own)
    return ax


def plot_torques(recordings: Recordings, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Joint torques as sent, one panel a joint, and the joints' limits."""
    joints = [str(name) for name in next(iter(recordings.values()))["joint"].values] if recordings else []
    rows = -(-len(joints) // 3) or 1
    own, axes = axes is None, list(new_axes(3 * rows, (9.0, 2.4 * rows), columns=3) if axes is None else axes)
    for name, recording in _command_first(recordings)[1:]:
        window = _motion(recording)
        for ax, values in zip(axes, window["tau"].values.T, strict=False):
            _line(ax, window["time"], values, name)
    _limits(next(iter(recordings.values()), None), axes)
    for name, ax in zip(joints, axes, strict=False):
        # one letter reads as an index, a longer name does not
        ax.set_ylabel(rf"$τ_{name}$ [N m]" if len(name) == 1 else f"τ {name.removesuffix('_joint')} [N m]")
    for ax in axes[len(joints) :]:
        ax.set_visible(False)
    for ax in axes[max(0, len(joints) - 3) :]:
        ax.set_xlabel("time [s]")
        ax.tick_params(labelbottom=True)
    finish(axes, own)
    return axes


def _limits(recording: xr.Dataset | None, axes: Sequence[Axes]) -> None:
    """The torque limits of the joints, on both sides; where torque stays far below, in words instead of lines."""
    limits: Array = np.array([]) if recording is None else np.atleast_1d(recording["tau"].attrs.get("limit", []))
    for limit, ax in zip(limits, axes, strict=False):
        ax.plot([], [], **GUIDE, label="limit")
        if max(map(abs, ax.get_ylim())) < NEAR_LIMIT * limit:
            ax.set_title(f"limit ±{limit:.3g} N m", loc="right", fontsize=8, color="0.4", pad=2)
        else:
            ax.axhline(limit, **GUIDE)
            ax.axhline(-limit, **GUIDE)


def plot_replanning(recordings: Recordings, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """How long each new plan took in the loop, and how far it keeps from the friction cone."""
    own, axes = axes is None, list(new_axes(2, (5.6, 4.6)) if axes is None else axes)
    for name, recording in _command_first(recordings)[1:]:
        if "replanned" in recording:
            t, taken = solve_times(recording)
            axes[0].plot(t, 1000 * taken, ".", markersize=3, color=style_of(name).color, label=NAMES[name])
            _line(axes[1], t, np.rad2deg(recording["cone_margin"].sel(time=t).values), name)
    axes[0].set(ylabel="solve time [ms]", yscale="log")
    axes[1].set(xlabel="time [s]", ylabel="margin to the\nfriction angle [deg]")
    finish(axes, own)
    return axes


def plot_plan(plan: Plan, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Planned position, velocity and acceleration of y, z, theta (rows: quantity); the braking is shaded."""
    own, axes = ax is None, list(new_axes(9, (9.0, 6.0), columns=3) if ax is None else ax)
    t = np.linspace(0.0, plan.duration, 1001)
    flying = np.linspace(plan.release_time, plan.touchdown_time, 101)
    path, command = plan.object_path(flying), STYLES["command"].line()
    for row, (quantity, values) in enumerate(zip("xva", plan.sample(t), strict=True)):
        for column, panel in enumerate(axes[3 * row : 3 * row + 3]):
            panel.plot(t, values[:, column], label="tool", **command)
            if quantity == "x":
                panel.plot(flying, path[:, column], color="#CC79A7", linestyle="--", label="object in flight")
            if plan.n_brake:
                panel.axvspan(plan.release_time, plan.duration, color="0.92", linewidth=0, label="tool brakes")
            panel.axvline(plan.touchdown_time, **GUIDE, label="touch-down")
            panel.set(ylabel=LABELS[quantity][column])
    for panel in axes[6:]:
        panel.set_xlabel("time [s]")
    finish(axes, own)
    return axes


def snapshot_strip(images: ArrayLike, times: Sequence[float] | Array, ax: Axes | None = None) -> Axes:
    """Fig. 12: pictures (n, height, width, 3) of uint8 in two rows, each with its time [s]."""
    pictures = np.asarray(images)
    count, height, width = pictures.shape[:3]
    columns, gap = -(-count // 2), 6
    wide, high = columns * (width + gap) - gap, 2 * (height + gap) - gap
    ax = ax or new_axes(1, (2.6 * columns, 2.6 * columns * high / wide), frame=False)[0]
    # a picture at a time: Matplotlib resamples in floats, which for one large sheet takes 200 MB
    for k, (picture, time) in enumerate(zip(pictures, times, strict=True)):
        top, left = (k // columns) * (height + gap), (k % columns) * (width + gap)
        ax.imshow(picture, interpolation="nearest", extent=(left, left + width, top + height, top))
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 2.0}
        ax.text(left + width / 32, top + width / 32, f"{time:.2f} s", va="top", ha="left", bbox=box)
    ax.set(xlim=(0, wide), ylim=(high, 0), aspect="equal")
    ax.set_axis_off()
    return ax


def _plot_responses(
    recordings: Recordings, architectures: Sequence[str], quantity: str, axes: Sequence[Axes] | None
) -> Sequence[Axes]:
    own, axes = axes is None, list(new_axes(3, (5.6, 6.2)) if axes is None else axes)
    shown = {name: recordings[name] for name in architectures if name in recordings} or recordings
    for name, recording in _command_first(shown):
        window = _motion(recording)
        components = window[f"{quantity}_cmd" if name == "command" else quantity].values.T
        for ax, values in zip(axes, components, strict=True):
            _line(ax, window["time"], values, name)
    for ax, label in zip(axes, LABELS[quantity], strict=True):
        ax.set(ylabel=label)
        for recording in list(shown.values())[:1]:
            ax.axvline(recording.attrs["release_time_s"], **GUIDE, label="planned release")
    axes[-1].set_xlabel("time [s]")
    if left_out := [NAMES[name] for name in ARCHITECTURES if name in recordings and name not in shown]:
        words = f"left out, as in the paper: {', '.join(left_out)}"
        axes[0].set_title(words, loc="right", fontsize=8, color="0.4")
    finish(axes, own)
    return axes


def _command_first(recordings: Recordings) -> list[tuple[str, xr.Dataset]]:
    """Names with data in their fixed order: the command, the same in every recording, comes first."""
    for name in recordings:
        style_of(name)
    known = [(name, recordings[name]) for name in ARCHITECTURES if name in recordings]
    return [("command", recording) for _, recording in known[:1]] + known


def _motion(recording: xr.Dataset, before: float = 0.05, after: float = 0.15) -> xr.Dataset:
    """From shortly before the motion to shortly after the command has come to rest, times in s."""
    return recording.sel(time=slice(-before, recording.attrs["end_time_s"] + after))


def _line(ax: Axes, horizontal: ArrayLike, vertical: ArrayLike, name: str) -> None:
    ax.plot(horizontal, vertical, label=NAMES[name], **style_of(name).line())
