"""Flips of a study: planned once per motion, flown once per question, kept as they end in `runs.sqlite`."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from flipdiagram.errors import SimulationError
from flipdiagram.flips.child_process import MEMORY, Limits
from flipdiagram.flips.driver import Flying, fly_all
from flipdiagram.flips.flight import Flight, Work, fly_flight, plan_flight
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import LOST, Outcome
from flipdiagram.flips.store import Store
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import Workers
from flipdiagram.folders import bring_back, set_aside
from flipdiagram.simulation.recording_files import recording_key

LEAST_TIMEOUT, PACE = 300.0, 300.0
"""A flip is given up after so long [s], and so many times its simulated time at a step of 1 ms; it needs one."""
WORK = Work(plan_flight, fly_flight)
FILE, MARK = "runs.sqlite", {"digest": "flips of studies"}
"""The store of a study, and what it begins with."""

Progress = Callable[[str], None]


def run_flips(
    flips: Sequence[Flip],
    out: Path,
    *,
    jobs: int | None = None,
    progress: Progress = lambda text: None,
    work: Work = WORK,
) -> list[Outcome]:
    """The outcomes of the flips, in their order; only those that `out`/runs.sqlite does not hold are flown.

    Each is kept as soon as it ends, so nothing finished is lost when the run is interrupted.  Raises SimulationError
    for a flip that took too long or whose worker was lost again and again: another call flies that one alone.
    """
    with open_to_write(out / FILE, MARK) as store:
        missing = {flip.key: flip for flip in flips if not is_done(flip, store, out)}
        if missing:
            progress(f"{len(flips)} flips, {len(missing)} of them to be run")
            for key, flip in missing.items():
                store.forget(key, flip.architecture)
            with Workers(jobs) as workers:
                flights = [_flight(key, flip, out) for key, flip in missing.items()]
                limits = limits_of(missing.values())
                flying = Flying(workers, store, work, limits, Clock(len(missing), progress).tick)
                fly_all(flights, len(flights), flying)
        outcomes = [_kept(store, flip.key, flip.architecture) for flip in flips]
    for outcome in outcomes:
        if outcome.mode in LOST:
            bug = outcome.mode == "crashed" and "lost its worker" not in str(outcome.failure)
            raise (RuntimeError if bug else SimulationError)(f"a flip was lost, {outcome.failure}; the others are kept")
    return outcomes


def fly_kept(
    flights: Sequence[Flight], flying: Flying, told: Callable[[int], object] = lambda missing: None, how: str = ""
) -> list[Outcome]:
    """What became of flights, in their order; only those whose question the store does not hold are flown.

    told: how many those are.  A question is the true scenario, the architecture, the motion, and how it is answered
    where that is not by flying it.
    """
    keys = [f"{Flip(flight.truth, flight.architecture).key} {flight.plan_key} {how}".rstrip() for flight in flights]
    missing = {
        key: replace(flight, trial=key)
        for key, flight in zip(keys, flights, strict=True)
        if flying.store.outcome(key, flight.architecture) is None
    }
    told(len(missing))
    fly_all(missing.values(), len(missing), flying)
    return [_kept(flying.store, key, flight.architecture) for key, flight in zip(keys, flights, strict=True)]


def is_done(flip: Flip, store: Store, out: Path) -> bool:
    """Whether a flip need not be flown: its outcome is known, and its recording there, or brought back."""
    outcome = store.outcome(flip.key, flip.architecture)
    if outcome is None or outcome.mode in LOST:
        return False
    if flip.recording is None or outcome.metrics is None:
        return True
    # a run of another scenario into the same folder replaces the file under the same name
    if recording_key(out / flip.recording) == flip.key:
        return True
    if found := recording_key(set_aside(out, flip.recording)) == flip.key:
        bring_back(out, flip.recording)
    return found


def _flight(key: str, flip: Flip, out: Path) -> Flight:
    recording = None if flip.recording is None else (out / flip.recording).absolute()
    return Flight(key, flip.scenario, flip.scenario, flip.architecture, recording=recording)


def limits_of(flips: Iterable[Flip]) -> Limits:
    """What each of them may take, the longest one's time."""
    return Limits(max(map(_timeout, flips)), MEMORY)


def _timeout(flip: Flip) -> float:
    settings = flip.scenario.simulation
    return LEAST_TIMEOUT + PACE * (settings.lead_time + 1.0 + settings.settle_time) * max(0.001 / settings.step, 1.0)


def _kept(store: Store, key: str, architecture: str) -> Outcome:
    outcome = store.outcome(key, architecture)
    assert outcome is not None, "every flip has been flown"
    return outcome


class Clock:
    """Counts flips that have ended and tells how long the others take."""

    def __init__(self, total: int, progress: Progress = lambda text: None) -> None:
        self.total, self.done, self.begin, self._progress = total, 0, time.monotonic(), progress

    def leave_out(self, flips: int) -> None:
        """So many need not be flown: an earlier run has."""
        self.total -= flips

    def tick(self) -> str:
        """One more is done: 'flips 12/96, 3:04 left'."""
        self.done += 1
        left = int((time.monotonic() - self.begin) / self.done * (self.total - self.done))
        text = f"flips {self.done}/{self.total}, {left // 60}:{left % 60:02d} left"
        self._progress(text)
        return text
