"""Why the block slides in the world with the smallest change: friction used over time, and the joints behind it."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flipdiagram.figures.style import GUIDE, NAMES, STYLES, finish, new_axes, save
from flipdiagram.simulation.events import release_index
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.inverse.search import STAGES
from flipdiagram.studies.study import Progress, Summary, silent


def write_figures(summary: Summary, out: Path, *, progress: Progress = silent) -> list[str]:
    """Draw the mechanism where a world was found."""
    files = {name: out / f"{name}.nc" for name, _ in STAGES}
    if summary["smallest"] and all(file.is_file() for file in files.values()):
        progress("drawing why the block slides")
        save(plot_mechanism(files), out / "mechanism")
    return []


def plot_mechanism(files: dict[str, Path]) -> Figure:
    """Friction cone used, way slid, tilt of the blade; then how far each joint's speed is from that under FF+DOB.

    Each run is shown until the block has left the blade, or until the planned release where it left before.
    """
    data = {name: load_recording(file) for name, file in files.items()}
    joints = list(next(iter(data.values()))["joint"].values)
    axes = new_axes(3 + len(joints), (7.0, 1.3 * (3 + len(joints)) + 1))
    reference = data["pd+ff+dob"]
    release = float(reference.attrs["release_time_s"])
    for name, run in data.items():
        shown = run.sel(time=slice(0.0, max(release, float(run["time"][release_index(run)]))))
        line = STYLES[name].line() | {"label": NAMES[name]}
        axes[0].plot(shown["time"], np.minimum(shown["cone_use"], 1.5), **line)
        axes[1].plot(shown["time"], 1000 * shown["slip"], **line)
        axes[2].plot(shown["time"], shown["x"].values[:, 2], **line)
        away = (shown["qd"] - reference["qd"]).sel(time=shown["time"])
        for k, joint in enumerate(joints):
            axes[3 + k].plot(shown["time"], away.sel(joint=joint), **line)
    axes[0].axhline(1.0, **GUIDE)
    axes[0].set_ylabel("cone use [1]")
    axes[1].set_ylabel("slip [mm]")
    axes[2].axhline(np.pi / 2, **GUIDE)
    axes[2].set_ylabel("tilt θ [rad]")
    for ax in axes:
        ax.axvline(release, **GUIDE)
    for k, joint in enumerate(joints):
        axes[3 + k].set_ylabel(f"{joint}: Δ speed [rad/s]")
    axes[-1].set_xlabel("time [s]")
    finish(axes, True)
    figure = axes[0].figure
    assert isinstance(figure, Figure)
    return figure
