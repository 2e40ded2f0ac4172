"""A campaign as it is asked for: base scenario, what varies and how, trials, architectures; numbered, reproducible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from flipdiagram.arrays import Floats
from flipdiagram.campaign import sampling
from flipdiagram.campaign.distributions import Distribution
from flipdiagram.flips.child_process import MEMORY, Limits
from flipdiagram.flips.flight import Flight
from flipdiagram.flips.flip import PLAN_SECTIONS
from flipdiagram.flips.store import digest_of
from flipdiagram.scenario.scenario import Scenario, field_paths, value_of

UNKNOWN_SECTIONS = ("arm", "tool", "object", "table")
"""Things of the world: planner and controller go by the base scenario's unless the campaign says they are known."""
SEEDS = tuple(path for path in field_paths() if path.startswith("sensors.") and path.endswith("_seed"))
"""Fields set to the trial's seed, unless `vary` sets them: each trial has noise of its own, for all architectures."""


@dataclass(frozen=True)
class Dimension:
    """One number that varies: it sets fields of the scenario, or scales them."""

    name: str
    """As in the file; 'arm.link_inertia_scales[2]' for an element of a list."""
    fields: tuple[str, ...]
    distribution: Distribution
    scale: bool = False
    element: int | None = None

    def as_dict(self) -> dict[str, Any]:
        """As it is written."""
        inner = self.distribution.as_dict()
        return {"name": self.name, "fields": list(self.fields), "vary": {"scale": inner} if self.scale else inner}


@dataclass(frozen=True)
class Trial:
    """One draw, the same for every architecture."""

    index: int
    seed: int
    values: tuple[Any, ...]
    """Of the dimensions, in their order."""
    overrides: dict[str, Any]
    """Fields of the scenario by path."""


@dataclass(frozen=True)
class Specification:
    """A checked campaign; `checks.specification` reads and checks one."""

    base: Scenario
    dimensions: tuple[Dimension, ...]
    sampler: str
    seed: int
    trials: int
    architectures: tuple[str, ...]
    timeout: float
    """Seconds after which a flip, or the planning of one, is given up."""
    memory: float = MEMORY
    """GB of a process above which it is given up."""
    known: tuple[str, ...] = ()
    """Fields of the world whose drawn value planner and controller know."""
    limit_hours: float = 12.0
    text: str = ""
    """The file, as it was read."""
    name: str = "campaign.yaml"
    """What it is called in errors."""

    @property
    def limits(self) -> Limits:
        """What a flip may take."""
        return Limits(self.timeout, self.memory)

    @cached_property
    def points(self) -> Floats:
        """Where in the unit cube each trial lies, shape (trials, dimensions)."""
        if self.sampler == "grid":
            return sampling.grid([len(d.distribution.values or ()) for d in self.dimensions])
        return sampling.points(self.sampler, self.trials, len(self.dimensions), self.seed)

    @cached_property
    def seeds(self) -> list[int]:
        """One for each trial."""
        return sampling.seeds(self.seed, self.trials)

    def trial(self, index: int) -> Trial:
        """A trial by its number."""
        return self.drawn(index, self.points[index].tolist(), self.seeds[index])

    def drawn(self, index: int, point: Sequence[float], seed: int) -> Trial:
        """A trial by its number, where it lies in the unit cube, and its seed."""
        values = [d.distribution.value(u) for d, u in zip(self.dimensions, point, strict=True)]
        return self._trial(index, seed, values, self.dimensions)

    def trial_with(self, dimensions: Sequence[Dimension], values: Sequence[Any]) -> Trial:
        """The trial with these dimensions at these values, and all else as in the base."""
        return self._trial(0, self.seeds[0], values, dimensions)

    def at_ends(self) -> list[tuple[Dimension, Trial]]:
        """Trials with one dimension at a border and the others as in the base, to be tried before anything runs."""
        seed = self.seeds[0]
        return [(d, self._trial(0, seed, [value], [d])) for d in self.dimensions for value in d.distribution.ends()]

    def _trial(self, index: int, seed: int, values: Sequence[Any], dimensions: Sequence[Dimension]) -> Trial:
        overrides: dict[str, Any] = {}
        for dimension, value in zip(dimensions, values, strict=True):
            for field in dimension.fields:
                overrides[field] = _setting(self.base, overrides, field, dimension, value)
        overrides |= {path: seed for path in SEEDS if path not in overrides}
        return Trial(index, seed, tuple(values), overrides)

    def truth(self, trial: Trial) -> Scenario:
        """The scenario in which the trial happens; raises InputError where it cannot be."""
        return self.base.with_overrides(trial.overrides)

    def believed(self, trial: Trial) -> Scenario:
        """The scenario that planner and controller go by: without what they do not know."""
        return self.base.with_overrides({path: v for path, v in trial.overrides.items() if not self.unknown(path)})

    def flight(self, trial: Trial, architecture: str) -> Flight:
        """A trial under one of the architectures."""
        truth, believed = self.truth(trial), self.believed(trial)
        return Flight(trial.index, truth, believed, architecture, trial.seed, trial.values, trial.overrides)

    def unknown(self, path: str) -> bool:
        """Whether planner and controller do not know a field's drawn value."""
        return path.split(".")[0] in UNKNOWN_SECTIONS and path not in self.known

    @cached_property
    def planned(self) -> tuple[int, ...]:
        """Numbers of the dimensions on which the plan depends; where there are none, one plan serves all trials."""
        return tuple(k for k, dimension in enumerate(self.dimensions) if any(map(self._is_planned, dimension.fields)))

    def _is_planned(self, field: str) -> bool:
        return field.split(".")[0] in PLAN_SECTIONS and not self.unknown(field)

    @property
    def rows(self) -> int:
        """Flips in all."""
        return self.trials * len(self.architectures)

    def as_dict(self) -> dict[str, Any]:
        """All that decides the results, as plain data."""
        return {
            "base": self.base.model_dump(mode="json", exclude={"one_dof", "frequency"}),
            "vary": [dimension.as_dict() for dimension in self.dimensions],
            "known": sorted(self.known),
            "sampler": self.sampler,
            "seed": self.seed,
            "trials": self.trials,
            "architectures": list(self.architectures),
            "timeout": self.timeout,
        } | ({"memory": self.memory} if self.memory != MEMORY else {})

    @cached_property
    def digest(self) -> str:
        """Name of the campaign: changes with anything that changes a result, not with comments or order of keys."""
        return digest_of(self.as_dict())


def _setting(base: Scenario, overrides: Mapping[str, Any], field: str, dimension: Dimension, value: Any) -> Any:
    if not dimension.scale:
        return value
    given = value_of(base, field)
    if dimension.element is None:
        return float(f"{given * value:.12g}")
    elements = list(overrides.get(field, elements_of(base, field)))
    elements[dimension.element] = float(f"{elements[dimension.element] * value:.12g}")
    return tuple(elements)


def elements_of(base: Scenario, field: str) -> tuple[float, ...]:
    """The elements of a list field; of an empty list of factors, 1 for each joint of the MH3F."""
    given = value_of(base, field)
    if given is None and field in ("arm.link_inertia_scales", "arm.reflected_inertia_scales") and not base.arm.file:
        return (1.0,) * 6
    return tuple(given) if isinstance(given, tuple) else ()
