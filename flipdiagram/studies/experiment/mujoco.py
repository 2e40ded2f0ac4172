"""A second engine's verdict on the flips of the experiment: the recorded tool motion with the block in MuJoCo."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from flipdiagram.errors import FlipdiagramError
from flipdiagram.flips.workers import Workers
from flipdiagram.plants.mujoco_contact import Settings
from flipdiagram.simulation import metrics
from flipdiagram.simulation.mujoco import COMPARED, compare
from flipdiagram.simulation.recording_files import load_recording

VARIANTS: dict[str, Settings] = {
    "default": Settings(),
    "pyramidal cone": Settings(cone="pyramidal", impratio=1.0),
    "soft contact": Settings(time_constant=0.01),
    "step 0.25 ms": Settings(timestep=2.5e-4),
    "MuJoCo's own defaults": Settings(timestep=1e-3, cone="pyramidal", impratio=1.0, time_constant=0.02, impedance=0.9),
}
"""Contact settings; all recordings see the first, the first start sees all."""


def second_engine(runs: Sequence[tuple[str, float, Path]], jobs: int | None = None) -> dict[str, Any] | None:
    """Verdicts of Drake and MuJoCo on recordings given as (architecture, start [m], file); None without MuJoCo.

    Returns {"settings", "runs": one entry a recording, "variants": verdicts of the first start by settings}.
    """
    if find_spec("mujoco") is None or not runs:
        return None
    first = min((start for _, start, _ in runs), key=abs)
    tasks = [(path, Settings()) for _, _, path in runs]
    varied = [(name, variant, path) for name, start, path in runs for variant in list(VARIANTS)[1:] if start == first]
    tasks += [(path, VARIANTS[variant]) for _, variant, path in varied]
    with Workers(jobs) as workers:
        verdicts: dict[int, dict[str, Any]] = dict(workers.results(_verdict, tasks))
    entries = [verdicts[k] for k in range(len(tasks))]
    return {
        "settings": Settings().settings_text(),
        "runs": [
            {"architecture": name, "start_y_m": start, **entry}
            for (name, start, _), entry in zip(runs, entries, strict=False)
        ],
        "variants": [
            {"architecture": name, "variant": variant, "settings": VARIANTS[variant].settings_text(), **entry}
            for (name, variant, _), entry in zip(varied, entries[len(runs) :], strict=True)
        ],
    }


def _verdict(path: Path, settings: Settings) -> dict[str, Any]:
    recording = load_recording(path)
    try:
        verdict = compare(recording, settings)
    except FlipdiagramError as error:
        # Drake's verdict stands, and does not agree with one that there is not
        measured = metrics.measure(recording).as_dict()
        lost = {"success": False, "failure": str(error), "max_slip_m": None, "touchdown": None}
        return {"agree": False, "drake": {name: measured[name] for name in COMPARED}, "mujoco": lost}
    return {key: verdict[key] for key in ("agree", "drake", "mujoco")}
