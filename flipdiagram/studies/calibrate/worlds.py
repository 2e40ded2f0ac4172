"""Worlds drawn from the priors, flown, and seen as the paper saw its own."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.campaign.specification import Specification
from flipdiagram.errors import InputError
from flipdiagram.flips.driver import Flying, fly_all
from flipdiagram.flips.flight import Flight
from flipdiagram.flips.flip import Flip
from flipdiagram.studies.calibrate.observations import NOTHING, Observation, needed, observe

BATCH = 200
"""Worlds flown before the next are made: all of them at once would wait in memory."""


class Worlds:
    """A simulator: points of the unit cube → observations, each flip kept as it ends; draws are numbered from 0 on."""

    def __init__(self, priors: Specification, starts: Sequence[float], flying: Flying) -> None:
        self._priors, self._starts, self._flying = priors, tuple(starts), flying
        self.u = np.empty((0, len(priors.dimensions)))
        self.observations: list[Observation] = []

    def fly(self, u: Floats, told: Callable[[int], None] = lambda done: None) -> np.ndarray:
        """Fly the worlds at u (n, d); their numbers (n,)."""
        first = len(self.observations)
        for begin in range(0, len(u), BATCH):
            self.observations += self._observe(u[begin : begin + BATCH])
            told(len(self.observations))
        self.u = np.vstack([self.u, u])
        return np.arange(first, first + len(u))

    def _observe(self, u: Floats) -> list[Observation]:
        asked = [self._flights(point) for point in u]
        store = self._flying.store
        missing = {
            str(flight.trial): flight
            for flights in asked
            for flight in flights
            if store.outcome(flight.trial, flight.architecture) is None
        }
        fly_all(missing.values(), len(missing), self._flying)
        return [self._seen(flights) for flights in asked]

    def _flights(self, u: Floats) -> list[Flight]:
        """The flips of a world; none where it cannot be."""
        priors, flights = self._priors, []
        trial = priors.drawn(0, u.tolist(), priors.seeds[0])
        for name, start in needed(self._starts):
            there = replace(trial, overrides=trial.overrides | {"task.start_y": start})
            try:
                flight = priors.flight(there, name)
            except InputError:
                return []
            flights.append(replace(flight, trial=f"{Flip(flight.truth, name).key} {flight.plan_key}"))
        return flights

    def _seen(self, flights: Sequence[Flight]) -> Observation:
        outcomes = [self._flying.store.outcome(flight.trial, flight.architecture) for flight in flights]
        if not outcomes or None in outcomes:
            return NOTHING
        flown = zip(needed(self._starts), outcomes, strict=True)
        return observe({question: outcome for question, outcome in flown if outcome is not None}, self._starts)
