"""The pictures of a study, drawn from its results: Figs 12–15, further figures, and the replay."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.figures import motion
from flipdiagram.figures.deformation import plot_deformation
from flipdiagram.figures.style import save
from flipdiagram.flips.workers import Workers
from flipdiagram.planning import Plan
from flipdiagram.rendering.replay import write_replay
from flipdiagram.rendering.snapshots import take_snapshots
from flipdiagram.rendering.video import write_video
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, from_mapping
from flipdiagram.simulation.deformation import bends
from flipdiagram.simulation.recording import Recording
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.study import Progress, Summary, silent


def write_figures(
    summary: Summary,
    out: Path,
    *,
    quick: bool = False,
    no_replay: bool = False,
    video: Path | bool | None = None,
    progress: Progress = silent,
) -> list[str]:
    """Draw the figures and, unless quick or told not to, snapshots and replay.html; returns notes to show.

    video: the file, True for flip.gif in `out`, None for no video.
    """
    recordings = {run["architecture"]: load_recording(out / run["recording"]) for run in summary["runs"]}
    scenario = from_mapping(summary["scenario"])
    notes = []
    if quick or no_replay:
        _plots(recordings, out)
    else:
        notes = _plots_and_pictures(recordings, scenario, out, progress)
    if video:
        progress("rendering the video")
        notes.append(write_video(recordings, scenario, out / "flip.gif" if video is True else Path(video)))
    return list(dict.fromkeys(filter(None, notes)))


def _plots_and_pictures(
    recordings: dict[str, Recording], scenario: Scenario, out: Path, progress: Progress
) -> list[str | None]:
    with Workers(1) as workers:  # a second one takes longer to start than it saves
        shown = next(name for name in reversed(ARCHITECTURES) if name in recordings)  # snapshots of the best
        tasks = [
            (write_replay, (recordings, scenario, out / "replay.html")),
            (_strip, (recordings[shown], scenario, out)),
        ]
        progress("rendering snapshots and replay, drawing figures")
        pending = workers.results(_call, tasks)
        _plots(recordings, out)
        return [note for task, note in pending if task == 1]


def _call(function: Callable[..., Any], arguments: tuple) -> Any:
    return function(*arguments)


def _strip(recording: Recording, scenario: Scenario, out: Path) -> str | None:
    snapshots = take_snapshots(recording, scenario)
    _save(motion.snapshot_strip(snapshots.images, snapshots.times), out / "fig12_snapshots")
    return snapshots.note


def _plots(recordings: dict[str, Recording], out: Path) -> None:
    _save(motion.plot_plan(Plan.load(out / "plan.json")), out / "plan")
    _save(motion.plot_trajectories(recordings), out / "fig13_trajectories")
    _save(motion.plot_velocities(recordings), out / "fig14_velocities")
    _save(motion.plot_accelerations(recordings), out / "fig15_accelerations")
    _save(motion.plot_sliding_angle(recordings), out / "sliding_angle")
    _save(motion.plot_torques(recordings), out / "torques")
    if any("replanned" in recording for recording in recordings.values()):
        _save(motion.plot_replanning(recordings), out / "replanning")
    if any(bends(recording) for recording in recordings.values()):
        _save(plot_deformation(recordings), out / "deformation")


def _save(axes: object, path: Path) -> None:
    save(np.ravel(np.array(axes, dtype=object))[0].figure, path)
