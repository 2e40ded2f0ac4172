"""Pictures of laying the object down: contact states over the motion (the paper's Fig. 2), the slide, and the path."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipdiagram.figures.motion import table_and_strikes
from flipdiagram.figures.style import GUIDE, LABELS, NAMES, RC, STYLES, save, style_of, tidy
from flipdiagram.rendering.replay import write_replay
from flipdiagram.scenario.scenario import ARCHITECTURES, from_mapping
from flipdiagram.simulation.recording import Recording
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.place.run import commanded_angle, planned_states
from flipdiagram.studies.study import Progress, Summary, silent

STATES = (("stick (7)", "#56B4E9"), ("slide (8)", "#F0E442"), ("release (9)", "#BBBBBB"))


def write_figures(summary: Summary, out: Path, *, no_replay: bool = False, progress: Progress = silent) -> list[str]:
    """Draw the figures and, unless told not to, replay.html beside the results."""
    progress("drawing figures")
    recordings = {run["architecture"]: load_recording(out / run["recording"]) for run in summary["runs"]}
    scenario = from_mapping(summary["scenario"])
    moving = {name: recordings[name].sel(time=slice(0.0, None)) for name in ARCHITECTURES if name in recordings}
    save(plot_states(moving, scenario.object.friction), out / "contact_states")
    save(plot_path(moving, scenario.place.target_y), out / "path")
    if not no_replay:
        verdicts = {run["architecture"]: (run["success"], run["failure"] or "laid down") for run in summary["runs"]}
        write_replay(recordings, scenario, out / "replay.html", verdicts)
    return []


def plot_states(recordings: Mapping[str, Recording], friction: float) -> Figure:
    """Sliding angle φ of eq. (11), displacement σ on the blade, and the contact states of eqs. (7)–(9) over time."""
    first = next(iter(recordings.values()))
    with rc_context(RC):
        figure = Figure(figsize=(7.6, 6.0), layout="constrained")
        top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(1.2, 1.2, 0.25 * (len(recordings) + 2)))
    cone = float(np.degrees(np.arctan(friction)))
    time = first["time"].values
    moving = time <= first.attrs["end_time_s"]
    phi = np.degrees(np.abs(commanded_angle(first)))
    top.plot(time[moving], phi[moving], label="commanded", **STYLES["command"].line())
    for value, text in ((cone, "friction angle"), (90.0, "90°: upright")):
        top.axhline(value, **GUIDE)
        top.annotate(text, (1.0, value), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8)
    top.set(ylabel="sliding angle |φ| [deg]", ylim=(0, 105), yticks=range(0, 91, 30))
    middle.plot(time, 1000 * first["slide_cmd"].values, label="planned", **STYLES["command"].line())
    for name, data in recordings.items():
        slide = np.where(data["contact_state"].values < 2, 1000 * data["slide"].values, np.nan)
        middle.plot(data["time"].values, slide, label=NAMES[name], **style_of(name).line())
    least = 1000 * float(first["slide_cmd"].values.min())
    middle.set(ylabel="slide σ on the blade [mm]", ylim=(1.6 * least, -0.15 * least))
    middle.legend(fontsize="small", ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    _bands(bottom, recordings, friction)
    bottom.set_xlabel("time [s]")
    for ax in (top, middle):
        tidy(ax)
    return figure


def _bands(ax: Axes, recordings: Mapping[str, Recording], friction: float) -> None:
    """One row a run, coloured by contact state; the planned one on top."""
    first = next(iter(recordings.values()))
    planned = np.where(first["time"].values <= first.attrs["release_time_s"], planned_states(first, friction), 2)
    rows = [("planned", first["time"].values, planned)]
    for name, data in recordings.items():
        rows.append((NAMES[name], data["time"].values, data["contact_state"].values))
    for k, (_, time, states) in enumerate(rows):
        edges = np.flatnonzero(np.diff(states)) + 1
        for begin, end in zip([0, *edges], [*edges, len(states)], strict=True):
            width = time[min(end, len(time) - 1)] - time[begin]
            ax.barh(k, width, left=time[begin], color=STATES[int(states[begin])][1], height=0.8, linewidth=0)
    ax.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    ax.invert_yaxis()
    for text, colour in STATES:
        ax.barh(0, 0, color=colour, label=text)
    ax.legend(fontsize="small", ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.22), frameon=False)


def plot_path(recordings: Mapping[str, Recording], target_y: float) -> Figure:
    """Paths of the tool's control point and of the object in the y–z plane, and the target."""
    with rc_context(RC):
        figure = Figure(figsize=(6.4, 4.9), layout="constrained")
        ax = figure.subplots()
    first = next(iter(recordings.values()))
    ax.plot(*first["x_cmd"].values[:, :2].T, label="tool, commanded", **STYLES["command"].line())
    for name, data in recordings.items():
        ax.plot(*data["x"].values[:, :2].T, label=f"tool, {NAMES[name]}", **style_of(name).line())
        ax.plot(*data["block_pose"].values[:, 5:].T, color=STYLES[name].color, linewidth=0.7)
    table_and_strikes(ax, recordings)
    ax.plot(target_y, first.attrs["table_height_m"], "^", color="black", linestyle="none", label="target")
    ax.plot([], [], color="0.3", linewidth=0.7, label="object, in its controller's colour")
    ax.set(xlabel=LABELS["x"][0], ylabel=LABELS["x"][1])
    ax.set_aspect("equal", adjustable="datalim")
    ax.grid(color="0.9", linewidth=0.6)
    figure.legend(fontsize="small", ncols=3, loc="outside upper center", frameon=False)
    return figure
