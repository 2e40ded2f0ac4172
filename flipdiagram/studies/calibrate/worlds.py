"""Worlds drawn from the priors, flown, and seen as the paper saw its own."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.campaign.specification import Specification, Trial
from flipdiagram.errors import InputError
from flipdiagram.flips.driver import Flying
from flipdiagram.flips.flight import Flight
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import Clock, fly_kept
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.calibrate.observations import NOTHING, Observation, observe, position_of, stages
from flipdiagram.studies.experiment.claims import BOTH

BATCH = 200
"""Worlds flown before the next are made: all of them at once would wait in memory."""


class Worlds:
    """A simulator: points of the unit cube → observations, each flip kept as it ends; draws are numbered from 0 on."""

    def __init__(self, priors: Specification, starts: Sequence[float], flying: Flying, clock: Clock) -> None:
        self._priors, self._flying, self._clock = priors, flying, clock
        self._starts = tuple(starts)
        self.u = np.empty((0, len(priors.dimensions)))
        self.observations: list[Observation] = []
        self.smooth = np.array([dimension.distribution.values is None for dimension in priors.dimensions])
        """Which unknowns are numbers, not choices."""

    def fly(self, u: Floats) -> np.ndarray:
        """Fly the worlds at u (n, d); their numbers (n,)."""
        first = len(self.observations)
        for begin in range(0, len(u), BATCH):
            self.observations += self._observe(u[begin : begin + BATCH])
        self.u = np.vstack([self.u, u])
        return np.arange(first, first + len(u))

    def positions(self, index: np.ndarray, starts: Sequence[float]) -> Floats:
        """Measured position RMSE of worlds under FF+DOB from each start, (n, starts) [cm]; nan where there is none."""
        asked = [(BOTH, y) for y in starts]
        worlds = [self._flights(self._drawn(self.u[k]), asked) for k in index]
        outcomes = iter(self._fly([flight for flights in worlds for flight in flights]))
        rows = [[position_of(next(outcomes)) for _ in flights] or [np.nan] * len(asked) for flights in worlds]
        return np.array(rows).reshape(len(index), len(asked))

    def flown(self, scenario: Scenario, starts: Sequence[float]) -> dict[tuple[str, float], Outcome]:
        """All flips of a scenario that is no draw."""
        asked = [question for stage in stages(starts) for question in stage]
        there = {y: scenario.with_overrides({"task.start_y": y}) for y in starts}
        return dict(zip(asked, self._fly([Flight(0, there[y], there[y], name) for name, y in asked]), strict=True))

    def _fly(self, flights: list[Flight], expected: int = 0) -> list[Outcome]:
        return fly_kept(flights, self._flying, lambda missing: self._clock.leave_out(expected - missing))

    def _drawn(self, u: Floats) -> Trial:
        return self._priors.drawn(0, u.tolist(), self._priors.seeds[0])

    def _observe(self, u: Floats) -> list[Observation]:
        drawn = [self._drawn(point) for point in u]
        flown: list[dict[tuple[str, float], Outcome]] = [{} for _ in drawn]
        going = list(range(len(drawn)))
        for stage in stages(self._starts):
            flights = {k: self._flights(drawn[k], stage) for k in going}
            flights = {k: own for k, own in flights.items() if own}
            asked = [flight for own in flights.values() for flight in own]
            outcomes = iter(self._fly(asked, len(drawn) * len(stage)))
            for k, own in flights.items():
                flown[k].update(zip(stage, [next(outcomes) for _ in own], strict=True))
            going = [k for k in flights if all(flown[k][name, y].success for name, y in stage if "dob" in name)]
        whole = sum(len(stage) for stage in stages(self._starts))
        return [observe(flips, self._starts) if len(flips) == whole else NOTHING for flips in flown]

    def _flights(self, world: Trial, stage: Sequence[tuple[str, float]]) -> list[Flight]:
        """The flips of a stage; none where the world cannot be."""
        flights = []
        for name, start in stage:
            there = replace(world, overrides=world.overrides | {"task.start_y": start})
            try:
                flights.append(self._priors.flight(there, name))
            except InputError:
                return []
        return flights
