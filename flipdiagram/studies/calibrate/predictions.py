"""What the worlds that are left say of the paper's numbers and claims, beside scenarios that have a name."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.calibrate import inference
from flipdiagram.studies.calibrate.inference import Population
from flipdiagram.studies.calibrate.observations import CLAIMS, QUANTITIES, observe, position_of
from flipdiagram.studies.calibrate.worlds import Worlds
from flipdiagram.studies.experiment.claims import BOTH
from flipdiagram.studies.experiment.run import STARTS

MEAN, LAST = QUANTITIES[:2]
"""Position RMSE over the starts; of no single start but the last one is more printed."""


class Shown:
    """Prior, posterior and named scenarios, flown from all starts of the paper."""

    def __init__(
        self, worlds: Worlds, population: Population, prior: np.ndarray, scenarios: Mapping[str, Scenario]
    ) -> None:
        self._worlds, self._population, self._prior = worlds, population, prior
        self._positions = worlds.positions(population.index, STARTS)
        flown = {name: worlds.flown(scenario, STARTS) for name, scenario in scenarios.items()}
        self._named = {name: observe(flips, STARTS) for name, flips in flown.items()}
        self._starts = {name: [position_of(flips[BOTH, y]) for y in STARTS] for name, flips in flown.items()}

    def numbers(self) -> list[dict[str, Any]]:
        """Of each number of the paper, and of each start: 5, 50, 95 % over prior and posterior, and the scenarios'."""
        numbers = np.array([world.numbers for world in self._worlds.observations])
        rows = []
        for k, quantity in enumerate(QUANTITIES):
            before = numbers[self._prior, k][np.isfinite(numbers[self._prior, k])]
            row = {
                "name": quantity.name,
                "unit": quantity.unit,
                "paper": quantity.paper,
                "tolerance": quantity.tolerance,
                "prior": np.quantile(before, inference.INTERVAL).tolist() if before.size else None,
                "posterior": self._interval(numbers[self._population.index, k]),
                "scenarios": {name: _plain(seen.numbers[k]) for name, seen in self._named.items()},
            }
            rows.append(row)
        for k, y in enumerate(STARTS):
            of_start = LAST if k == len(STARTS) - 1 else MEAN
            row = {
                "name": f"position RMSE, y = {100 * y:.0f} cm",
                "unit": of_start.unit,
                "paper": of_start.paper,
                "tolerance": of_start.tolerance,
                "prior": None,
                "posterior": self._interval(self._positions[:, k]),
                "scenarios": {name: _plain(starts[k]) for name, starts in self._starts.items()},
            }
            rows.append(row)
        return rows

    def claims(self) -> list[dict[str, Any]]:
        """In what share of the posterior's worlds, and of the prior's, each claim holds, and in which scenarios."""
        worlds = self._worlds.observations
        holds = np.array([world.claims for world in worlds], dtype=float)
        shares = self._population.weight @ holds[self._population.index]
        return [
            {
                "id": id,
                "posterior": float(shares[k]),
                "prior": float(holds[self._prior, k].mean()),
                "scenarios": {name: seen.claims[k] for name, seen in self._named.items()},
            }
            for k, id in enumerate(CLAIMS)
        ]

    def _interval(self, values: Floats) -> list[float] | None:
        finite = np.isfinite(values)
        if not finite.any():
            return None
        found: list[float] = inference.quantiles(values[finite], self._population.weight[finite])[:, 0].tolist()
        return found


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
