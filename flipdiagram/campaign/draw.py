"""A trial as the driver hands it out: its number and where it lies; the worker draws its world from them."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from flipdiagram.campaign.specification import Specification
from flipdiagram.flips.flight import Flight
from flipdiagram.flips.row import to_json


class Draw(NamedTuple):
    """A trial under one architecture, as an `order.Order`.

    The point comes along: every worker would otherwise hold the points of a million trials to read a few.
    """

    specification: Specification
    trial: int
    point: tuple[float, ...]
    """In the unit cube."""
    seed: int
    architecture: str

    @property
    def motion(self) -> str:
        """The drawn values on which the plan depends, as text: one may be a list."""
        dimensions = self.specification.dimensions
        return to_json([dimensions[k].distribution.value(self.point[k]) for k in self.specification.planned])

    def flight(self) -> Flight:
        """The trial's world, checked; raises InputError where it cannot be."""
        trial = self.specification.drawn(self.trial, self.point, self.seed)
        return self.specification.flight(trial, self.architecture)


def missing_draws(specification: Specification, done: Mapping[tuple[int, str], str]) -> Iterator[Draw]:
    """Trial by trial, so that the architectures can be compared from the first row on."""
    light = replace(specification, text="")  # what travels, without its points
    for index in range(specification.trials):
        if names := [name for name in specification.architectures if (index, name) not in done]:
            point, seed = tuple(specification.points[index].tolist()), specification.seeds[index]
            yield from (Draw(light, index, point, seed, name) for name in names)
