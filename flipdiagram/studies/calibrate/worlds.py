"""Worlds drawn from the priors, flown, and seen as the paper saw its own."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.campaign.specification import Specification
from flipdiagram.errors import InputError
from flipdiagram.flips.driver import Flying
from flipdiagram.flips.flight import Flight
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import Clock, fly_kept
from flipdiagram.studies.calibrate.observations import NOTHING, Observation, needed, observe

BATCH = 200
"""Worlds flown before the next are made: all of them at once would wait in memory."""


class Worlds:
    """A simulator: points of the unit cube → observations, each flip kept as it ends; draws are numbered from 0 on."""

    def __init__(self, priors: Specification, starts: Sequence[float], flying: Flying, clock: Clock) -> None:
        self._priors, self._flying, self._clock = priors, flying, clock
        self._starts, self._asked = tuple(starts), needed(starts)
        self.u = np.empty((0, len(priors.dimensions)))
        self.observations: list[Observation] = []

    def fly(self, u: Floats) -> np.ndarray:
        """Fly the worlds at u (n, d); their numbers (n,)."""
        first = len(self.observations)
        for begin in range(0, len(u), BATCH):
            self.observations += self._observe(u[begin : begin + BATCH])
        self.u = np.vstack([self.u, u])
        return np.arange(first, first + len(u))

    def _observe(self, u: Floats) -> list[Observation]:
        worlds = [self._flights(point) for point in u]
        flights = [flight for world in worlds for flight in world]
        expected = len(u) * len(self._asked)
        outcomes = iter(fly_kept(flights, self._flying, lambda missing: self._clock.leave_out(expected - missing)))
        return [self._seen([next(outcomes) for _ in world]) for world in worlds]

    def _flights(self, u: Floats) -> list[Flight]:
        """The flips of a world; none where it cannot be."""
        priors, flights = self._priors, []
        trial = priors.drawn(0, u.tolist(), priors.seeds[0])
        for name, start in self._asked:
            there = replace(trial, overrides=trial.overrides | {"task.start_y": start})
            try:
                flights.append(priors.flight(there, name))
            except InputError:
                return []
        return flights

    def _seen(self, outcomes: list[Outcome]) -> Observation:
        return observe(dict(zip(self._asked, outcomes, strict=True)), self._starts) if outcomes else NOTHING
