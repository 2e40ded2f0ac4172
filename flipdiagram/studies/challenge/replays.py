"""A replay of each entry of the leaderboard: one flip of the nominal suite, flown again."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flipdiagram.flips.workers import Workers
from flipdiagram.rendering.replay import write_replay
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.challenge.entry import load_entry
from flipdiagram.studies.challenge.flying import EntryFlight, fly_entry, plan_entry
from flipdiagram.studies.challenge.suites import load_suites
from flipdiagram.studies.study import Progress

SHOWN = ("nominal", 4)
"""Suite and number of the world that is shown: the paper's start at y = 8 cm."""
FOLDER = "replays"


def write_replays(
    folder: Path, entries: Sequence[Mapping[str, Any]], out: Path, jobs: int | None, progress: Progress
) -> dict[str, str]:
    """Fly and draw the entries whose files are in the folder as they were flown; {name: file below `out`}.

    Raises SimulationError where a worker is lost.
    """
    tasks, written = [], dict[str, str]()
    for summary in entries:
        entry = summary["entry"]
        file = f"{FOLDER}/{re.sub('[^a-z0-9]+', '-', entry['name'].lower()).strip('-')}.html"
        tasks.append((folder / entry["file"], entry["digest"], out / file))
        written[entry["name"]] = file
    (out / FOLDER).mkdir(parents=True, exist_ok=True)
    with Workers(jobs) as workers:
        for k, (index, there) in enumerate(workers.results(replayed, tasks)):
            progress(f"replays {k + 1}/{len(tasks)}")
            if not there:
                del written[entries[index]["entry"]["name"]]
    return written


def replayed(path: Path, digest: str, file: Path) -> bool:
    """Fly one entry and write its replay; False where its file is not there, or another one, or it finds no motion."""
    if not path.is_file() or (entry := load_entry(path)).digest != digest:
        return False
    suite, index = SHOWN
    world = load_suites().worlds([suite])[index]
    truth, believed = world.truth("drake", entry.settings), world.believed("drake", entry.settings)
    plan, _ = plan_entry(believed, entry.path)
    recording = file.with_suffix(".nc")
    if plan is None:
        return False
    fly_entry(EntryFlight(0, truth, believed, entry.architecture, recording=recording, path=path, digest=digest), plan)
    if not recording.is_file():  # the entry raised
        return False
    write_replay({entry.architecture: load_recording(recording)}, truth, file)
    recording.unlink()
    return True
