"""E1 as an inverse problem: worlds in which PD and PD+FF lose the block by sliding and both with observer keep it.

The controllers are flown one after another, the next one only where the last did as the paper tells: a world that does
not fit costs one flip, or few.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flipdiagram.campaign.specification import Dimension, Specification
from flipdiagram.errors import InputError
from flipdiagram.flips.driver import Flying
from flipdiagram.flips.flight import Flight
from flipdiagram.flips.outcome import SUCCESS, Outcome
from flipdiagram.flips.run import fly_kept
from flipdiagram.scenario.scenario import value_of
from flipdiagram.simulation.verdict import SLIDES

STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("pd", SLIDES),
    ("pd+ff", SLIDES),
    ("pd+dob", (SUCCESS,)),
    ("pd+ff+dob", (SUCCESS,)),
)
"""The controllers in the order in which they are flown, and the outcomes that E1 asks of each."""
KEPT = 0.015
"""Way [m] that a block may slide under a controller that keeps it; in the default up to 0.012, all of it early.

There the plan leaves little normal force, and the blade is off the block for some 0.1 s, by 2 mm.

Without this bound worlds count in which all four throw the block, and two of them turn it over by luck.
"""
BATCH = 100
"""Worlds flown before the next are made."""
BISECTIONS = 6
"""Halvings of the way from a world's value to the base's."""


@dataclass(frozen=True)
class World:
    """A world by what is other than in the base: dimensions with their values, and what became of it so far."""

    index: int
    dimensions: tuple[Dimension, ...]
    values: tuple[Any, ...]
    outcomes: Mapping[str, Outcome]

    @property
    def passed(self) -> int:
        """How many of `STAGES` went as the paper tells; all of them: E1 holds here."""
        for stage, (name, wanted) in enumerate(STAGES):
            if name not in self.outcomes or not _as_told(self.outcomes[name], wanted):
                return stage
        return len(STAGES)

    @property
    def rank(self) -> tuple[int, float]:
        """Smaller is nearer to E1: more stages passed, then the farther the block slid under the one that differs."""
        stage = self.passed
        last = self.outcomes.get(STAGES[stage][0]) if stage < len(STAGES) else None
        slip = last.metrics.max_slip_m if last is not None and last.metrics is not None else 0.0
        # of a controller that should keep the block, the less it slid the nearer
        return -stage, -slip if stage < 2 else slip

    def as_dict(self) -> dict[str, Any]:
        """Plain data: values by name, and of each controller flown its outcome, its text and the slip."""
        flown = {
            name: {
                "outcome": outcome.mode,
                "failure": outcome.failure,
                "max_slip_m": outcome.metrics and outcome.metrics.max_slip_m,
            }
            for name, outcome in self.outcomes.items()
        }
        values = {dimension.name: value for dimension, value in zip(self.dimensions, self.values, strict=True)}
        return {"trial": self.index, "passed": self.passed, "values": values, "flips": flown}


def _as_told(outcome: Outcome, wanted: Sequence[str]) -> bool:
    slid = outcome.metrics is not None and outcome.success and outcome.metrics.max_slip_m > KEPT
    return outcome.mode in wanted and not slid


class Search:
    """Flies worlds stage by stage; each flip is kept as it ends."""

    def __init__(self, box: Specification, flying: Flying) -> None:
        self._box, self._flying = box, flying

    def run(self, told: Callable[[int, int], None] = lambda done, found: None) -> list[World]:
        """All worlds of the box, in the order of their numbers; told: how many are done, how many fit so far."""
        box, worlds = self._box, []
        for begin in range(0, box.trials, BATCH):
            trials = [box.trial(k) for k in range(begin, min(begin + BATCH, box.trials))]
            worlds += self.fly([World(trial.index, box.dimensions, trial.values, {}) for trial in trials])
            told(len(worlds), sum(world.passed == len(STAGES) for world in worlds))
        return worlds

    def fly(self, worlds: Sequence[World]) -> list[World]:
        """The worlds with what became of them, flown as far as E1 holds."""
        known = list(worlds)
        for stage, (name, _) in enumerate(STAGES):
            asked = {k: self.flight(world, name) for k, world in enumerate(known) if world.passed == stage}
            flights = {k: flight for k, flight in asked.items() if flight is not None}
            outcomes = dict(zip(flights, fly_kept(list(flights.values()), self._flying), strict=True))
            for k in asked:
                outcome = outcomes.get(k) or Outcome(None, "refused: such a world cannot be")
                known[k] = replace(known[k], outcomes={**known[k].outcomes, name: outcome})
        return known

    def flight(self, world: World, architecture: str) -> Flight | None:
        """The question of a world under a controller; None where it cannot be."""
        try:
            return self._box.flight(self._box.trial_with(world.dimensions, world.values), architecture)
        except InputError:
            return None

    def smallest(self, worlds: Sequence[World]) -> list[World]:
        """Each world with as little as possible changed from the base: what is not needed left out, the rest halved.

        Each unknown in turn, from the first on, is set back to the base's value, then moved towards it by halving, and
        what still fits is kept.  The worlds go side by side, so that all workers have something to fly.
        """
        kept = list(worlds)
        for name in [dimension.name for dimension in self._box.dimensions]:
            without = self.fly([_without(world, name) for world in kept])
            needed = [k for k, world in enumerate(without) if world.passed < len(STAGES)]
            nearer = iter(self._nearer([kept[k] for k in needed], name))
            kept = [next(nearer) if k in needed else world for k, world in enumerate(without)]
        return kept

    def _nearer(self, worlds: Sequence[World], name: str) -> list[World]:
        """The worlds with one value as near to the base's as halving finds it."""
        kept, low, high = list(worlds), [0.0] * len(worlds), [1.0] * len(worlds)
        # shares of the way from the base at which they do not fit, and fit
        for _ in range(BISECTIONS):
            share = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
            moved = {k: self._moved(worlds[k], name, share[k]) for k in range(len(worlds))}
            tried = {k: world for k, world in moved.items() if world is not None}
            for k, world in zip(tried, self.fly(list(tried.values())), strict=True):
                if world.passed == len(STAGES):
                    kept[k], high[k] = world, share[k]
                else:
                    low[k] = share[k]
        return kept

    def _moved(self, world: World, name: str, share: float) -> World | None:
        """The world with a value at a share of the way from the base's; None where it is no number."""
        k = [dimension.name for dimension in world.dimensions].index(name)
        dimension, value = world.dimensions[k], world.values[k]
        base = 1.0 if dimension.scale else value_of(self._box.base, dimension.fields[0])
        if not (isinstance(value, float) and isinstance(base, float)):
            return None
        moved = float(f"{base + share * (value - base):.4g}")
        return World(world.index, world.dimensions, (*world.values[:k], moved, *world.values[k + 1 :]), {})


def _without(world: World, name: str) -> World:
    """The world with an unknown as in the base, to be flown."""
    kept = [k for k, dimension in enumerate(world.dimensions) if dimension.name != name]
    dimensions, values = tuple(world.dimensions[k] for k in kept), tuple(world.values[k] for k in kept)
    return World(world.index, dimensions, values, {})
