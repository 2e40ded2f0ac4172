"""`flipdiagram challenge`: fly an entry in every world of the suites and write its score."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.diagrams.loop import ENGINES
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.child_process import MEMORY, Limits, TrialError, TrialLimitError, WorkerLostError
from flipdiagram.flips.driver import Flying, fly_all
from flipdiagram.flips.flight import provenance
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import Clock
from flipdiagram.flips.store import Store, digest_of
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import Workers
from flipdiagram.plants.mujoco_contact import import_mujoco
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.challenge.entry import Entry, load_entry
from flipdiagram.studies.challenge.flying import EntryFlight, work_of
from flipdiagram.studies.challenge.score import load_results, paired_with, problems, scores
from flipdiagram.studies.challenge.suites import Suites, World, load_suites, read_secret
from flipdiagram.studies.study import Progress, silent

FILE = "challenge.sqlite"
LIMITS = Limits(300.0, MEMORY)
"""What a flip, the planning of one, or the loading of the file may take."""
LEAST_NOISE = 2e-3
"""Noise of the velocities [rad/s] from which the torque of a standing arm is their doing."""


def run(
    scenario: Scenario,
    out: str | Path,
    *,
    file: str | None,
    suites: Sequence[str] | None = None,
    engines: Sequence[str] | None = None,
    seed_file: str | None = None,
    against: str | None = None,
    jobs: int | None = None,
    progress: Progress = silent,
) -> None:
    """Fly the entry of a Python file; write summary.json.  Each flip is kept in `out`/challenge.sqlite as it ends.

    Args:
        scenario: must be the default: the worlds are what they are.
        out: folder of the results.
        file: the entry, see `flipdiagram challenge --template`.
        suites: names of those to fly, by default all.
        engines: the referees, by default those that are installed.
        seed_file: the organiser's secret, from which held-out worlds are drawn.
        against: a folder of other entries' summaries, with which this one is compared pair by pair.
        jobs: processes, by default one a core.
        progress: told how far it is.

    Raises InputError.
    """
    if file is None:
        raise InputError("challenge needs the FILE of an entry; see flipdiagram challenge --template", field="FILE")
    if changes := scenario.changes():
        valid = "SETTINGS in the entry's file, for fields of planner and controller"
        problem = f"{', '.join(changes)}: the worlds of the challenge are frozen"
        raise InputError.of(next(iter(changes)), None, valid, problem)
    drawn, others = load_suites(), load_results(against) if against else []
    names, referees = _chosen(suites, drawn.names, "--suites"), _engines(engines)
    secret = read_secret(seed_file) if seed_file else None
    worlds = drawn.worlds(names) + (drawn.worlds(names, secret) if secret else [])
    progress(f"loading {Path(file).name}")
    with Workers(jobs) as workers, open_to_write(Path(out) / FILE, {"digest": "flips of a challenge"}) as store:
        entry = described(workers, file)
        flights = {(world.hash, engine): flight_of(entry, world, engine) for world in worlds for engine in referees}
        missing = [f for f in flights.values() if store.outcome(f.trial, f.architecture) is None]
        clock = Clock(len(missing), lambda text: progress(f"{entry.name}: {text}"))
        fly_all(missing, len(missing), Flying(workers, store, work_of(entry.path), LIMITS, clock.tick))
        rows = [
            _row(world, engine, _kept(store, flights[world.hash, engine])) for world in worlds for engine in referees
        ]
    body = _body(entry, drawn, rows, secret)
    body["against"] = [paired_with(rows, other) for other in others if other["entry"]["digest"] != entry.digest]
    write_summary(Path(out) / "summary.json", "challenge", Scenario(), body)


def described(workers: Workers, file: str | Path) -> Entry:
    """The entry of a file, loaded in a process of its own: a stranger's code does not run in this one."""
    path = Path(file).absolute()
    try:
        found: Entry = workers.submit(describe, (path,), LIMITS).result()
    except TrialError as error:
        raise error.error or InputError(f"entry '{path.name}': {error}", field="entry") from None
    except (TrialLimitError, WorkerLostError) as error:
        raise InputError(f"entry '{path.name}' cannot be loaded: {error}", field="entry") from None
    return found


def describe(path: Path) -> Entry:
    """What a file enters with, without its functions, which do not travel."""
    return replace(load_entry(path), laws={})


def _chosen(given: Sequence[str] | None, valid: Sequence[str], option: str) -> list[str]:
    for name in given or ():
        if name not in valid:
            raise InputError.of(option, name, valid, f"{option} = '{name}'")
    return [name for name in valid if given is None or name in given]


def _engines(given: Sequence[str] | None) -> list[str]:
    if given and "mujoco" in given:
        import_mujoco()  # raises InputError where it is missing
    return [name for name in _chosen(given, tuple(ENGINES), "--engines") if name != "mujoco" or find_spec(name)]


def flight_of(entry: Entry, world: World, engine: str) -> EntryFlight:
    """A world under an entry, named by all that decides what becomes of it."""
    truth, believed = world.truth(engine, entry.settings), world.believed(engine, entry.settings)
    question = {"world": world.hash, "engine": engine, "entry": entry.digest, "code": provenance()[0]}
    key = f"{world.name} {engine} {digest_of(question)}"
    return EntryFlight(
        key, truth, believed, entry.architecture, path=entry.path, digest=entry.digest, plans="plan" in entry.kinds
    )


def _kept(store: Store, flight: EntryFlight) -> Outcome:
    outcome = store.outcome(flight.trial, flight.architecture)
    assert outcome is not None, "every flip has been flown"
    return outcome


def _row(world: World, engine: str, outcome: Outcome) -> dict[str, Any]:
    """One flip as the summary keeps it: no parameter of a held-out world stands there."""
    metrics, own = outcome.metrics, outcome.plan or {}
    row: dict[str, Any] = {
        "kind": world.kind,
        "suite": world.suite,
        "index": world.index,
        "hash": world.hash[:16],
        "engine": engine,
        "outcome": outcome.mode,
        "failure": outcome.failure,
    }
    if metrics is not None:
        row |= {
            "landing_cost_J": metrics.landing_cost_J,
            "position_rmse_m": metrics.position_rmse_m,
            "acceleration_rmse_m_s2": metrics.acceleration_rmse_m_s2,
            "torque_use": outcome.torque_use,
        }
    compute, still = own.get("compute_s"), own.get("still_Nm")
    noise = world.trial.overrides.get("sensors.velocity_noise", 0.0)
    if compute:
        row |= {"compute_p50_s": compute["p50"], "compute_p99_s": compute["p99"]}
    if still is not None and noise > LEAST_NOISE:
        row["noise_gain_Nms"] = still / noise
    return {name: _short(value) for name, value in row.items()}


def _short(value: Any) -> Any:
    """Five digits: a summary is kept with the entry, and read by people."""
    return float(np.format_float_positional(value, 5, fractional=False)) if isinstance(value, float) else value


def _body(entry: Entry, drawn: Suites, rows: Sequence[Mapping[str, Any]], secret: str | None) -> dict[str, Any]:
    code, versions, _ = provenance()
    return {
        "entry": {
            "name": entry.name,
            "author": entry.author,
            "reference": entry.reference,
            "file": entry.path.name,
            "digest": entry.digest,
            "kinds": list(entry.kinds) or [entry.architecture],
            "settings": dict(entry.settings),
        },
        "suite": {"version": drawn.version, "digest": drawn.digest},
        "held_out": digest_of({"secret": secret})[:16] if secret else None,
        "code": code,
        "of": versions | ({"mujoco": version("mujoco")} if find_spec("mujoco") else {}),
        "scores": scores(rows),
        "problems": problems(rows),
        "flips": rows,
    }
