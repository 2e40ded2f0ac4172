"""Fly an entry of the challenge, untuned, on the 64 held-out worlds of the tuning campaign.

    python examples/challenge/tuning_campaign.py ENTRY.py [--engine mujoco] [--out out/tuning-campaign]

examples/tuning.yaml draws friction, mass, payload, inertia of the arm, delay and noise; `flipdiagram campaign --tune`
searches gains on some of its worlds and judges them on these 64.  The entry is told nothing of what is drawn.  As in
the challenge the arm holds the start for 1 s.  Flips are kept as they end: an interrupted run goes on.
"""

import argparse
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.campaign.checks import drawn_from
from flipdiagram.campaign.specification_file import read
from flipdiagram.campaign.statistics import success_rate
from flipdiagram.campaign.tuner import held_out_trials
from flipdiagram.campaign.tuning import tuning
from flipdiagram.flips.driver import Flying, fly_all
from flipdiagram.flips.flight import provenance
from flipdiagram.flips.outcome import SUCCESS, Outcome
from flipdiagram.flips.run import Clock
from flipdiagram.flips.store import digest_of
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import Workers
from flipdiagram.studies.challenge.entry import Entry, load_entry
from flipdiagram.studies.challenge.flying import EntryFlight, work_of
from flipdiagram.studies.challenge.run import LEAST_NOISE, LIMITS
from flipdiagram.studies.challenge.suites import World

CAMPAIGN = Path(__file__).resolve().parents[1] / "tuning.yaml"
HOLD = {"simulation.start": "hold", "simulation.hold_time": 1.0}


@dataclass(frozen=True)
class Score:
    """What became of the 64: outcomes by world, and the noise gain [N m s/rad] where there is noise to speak of."""

    outcomes: tuple[Outcome, ...]
    noise_gains: tuple[float, ...]

    def __str__(self) -> str:
        won, flips = sum(outcome.mode == SUCCESS for outcome in self.outcomes), len(self.outcomes)
        rate = success_rate(won, flips)
        ended = ", ".join(f"{mode} {n}" for mode, n in Counter(o.mode for o in self.outcomes).most_common())
        gain = f"{np.median(self.noise_gains):.2f} N m s/rad" if self.noise_gains else "-"
        return (
            f"turned over {won} of {flips}, {rate['rate']:.0%} ({rate['low']:.0%} to {rate['high']:.0%});"
            f" noise gain {gain}; {ended}"
        )


def worlds() -> list[World]:
    """The 64 held-out trials of examples/tuning.yaml as worlds of a challenge."""
    source = read(CAMPAIGN)
    specification = drawn_from(source, CAMPAIGN.parent, HOLD)
    held_out = held_out_trials(specification, tuning(source, specification))
    trials = [held_out.trial(index) for index in range(held_out.trials)]
    base = held_out.base.model_dump(mode="json", include={"simulation"})
    return [
        World("held-out", "tuning", t.index, t, held_out, digest_of({"base": base, "overrides": t.overrides}))
        for t in trials
    ]


def flight(entry: Entry, world: World, engine: str) -> EntryFlight:
    """One flip, named by all that decides it."""
    question = {"world": world.hash, "engine": engine, "entry": entry.digest, "code": provenance()[0]}
    truth, believed = world.truth(engine, entry.settings), world.believed(engine, entry.settings)
    own: dict[str, Any] = {"path": entry.path, "digest": entry.digest, "plans": "plan" in entry.kinds}
    return EntryFlight(digest_of(question), truth, believed, entry.architecture, **own)


def fly(file: str | Path, engine: str, out: str | Path, jobs: int | None = None) -> Score:
    """Fly the entry of a file in all 64 worlds."""
    entry = load_entry(file)
    entry = replace(entry, laws={})
    drawn = worlds()
    flights = [flight(entry, world, engine) for world in drawn]
    with Workers(jobs) as workers, open_to_write(Path(out) / "flips.sqlite", {"digest": "flips of entries"}) as store:
        missing = [f for f in flights if store.outcome(f.trial, f.architecture) is None]
        fly_all(missing, len(missing), Flying(workers, store, work_of(entry.path), LIMITS, Clock(len(missing)).tick))
        outcomes = tuple(outcome for f in flights if (outcome := store.outcome(f.trial, f.architecture)) is not None)
    noises = [world.trial.overrides["sensors.velocity_noise"] for world in drawn]
    still = [(outcome.plan or {}).get("still_Nm") for outcome in outcomes]
    pairs = zip(still, noises, strict=True)
    return Score(
        outcomes, tuple(torque / noise for torque, noise in pairs if torque is not None and noise > LEAST_NOISE)
    )


def main() -> None:
    """Read the arguments, fly, print one line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("entry", help="the entry's Python file")
    parser.add_argument("--engine", choices=("drake", "mujoco"), default="drake")
    parser.add_argument("--out", default="out/tuning-campaign", help="folder of the flips")
    parser.add_argument("--jobs", type=int, help="processes, by default one a core")
    given = parser.parse_args()
    print(f"{Path(given.entry).name}, {given.engine}: {fly(given.entry, given.engine, given.out, given.jobs)}")


if __name__ == "__main__":
    main()
