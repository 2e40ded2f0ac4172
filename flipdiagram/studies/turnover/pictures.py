"""The pictures of a study, written beside its results: Figs 12–15, further figures, and the replay."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flipdiagram.figures import motion
from flipdiagram.figures.style import save
from flipdiagram.flips.workers import Workers
from flipdiagram.rendering.replay import write_replay
from flipdiagram.rendering.snapshots import take_snapshots
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.recording import Recording
from flipdiagram.studies.turnover.run import TurnoverResult

BEST = ("pd+ff+dob", "pd+dob", "pd+ff", "pd")
"""Whose snapshots are taken: the first of these that was run."""


def turnover_pictures(
    result: TurnoverResult, *, replay: bool = True, progress: Callable[[str], None] = lambda text: None
) -> list[str]:
    """Write the figures and, with `replay`, snapshots and replay.html of a turnover study; returns notes to show."""
    recordings, out, scenario = result.recordings(), result.out, result.scenario
    if not replay:
        _figures(result, recordings)
        return []
    with Workers(2) as workers:
        shown = next(name for name in BEST if name in recordings)
        tasks = [(_replay, (recordings, scenario, out)), (_strip, (recordings[shown], scenario, out))]
        progress("rendering snapshots and replay, drawing figures")
        pending = workers.results(_call, tasks)
        _figures(result, recordings)
        return [note for _, note in pending if note]


def _call(function: Callable[..., str | None], arguments: tuple) -> str | None:
    return function(*arguments)


def _replay(recordings: dict[str, Recording], scenario: Scenario, out: Path) -> None:
    write_replay(recordings, scenario, out / "replay.html")


def _strip(recording: Recording, scenario: Scenario, out: Path) -> str | None:
    snapshots = take_snapshots(recording, scenario)
    axes = motion.snapshot_strip(snapshots.images, snapshots.times)
    save(_figure_of(axes), out / "fig12_snapshots")
    return snapshots.note


def _figures(result: TurnoverResult, recordings: dict[str, Recording]) -> None:
    out = result.out
    drawn = {
        "plan": motion.plot_plan(result.plan),
        "fig13_trajectories": motion.plot_trajectories(recordings),
        "fig14_velocities": motion.plot_velocities(recordings),
        "fig15_accelerations": motion.plot_accelerations(recordings),
        "sliding_angle": motion.plot_sliding_angle(recordings),
        "torques": motion.plot_torques(recordings),
    }
    for name, axes in drawn.items():
        save(_figure_of(axes), out / name)


def _figure_of(axes: object) -> Figure:
    first = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()[0]
    figure = first.figure
    assert isinstance(figure, Figure)
    return figure
