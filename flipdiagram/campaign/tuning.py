"""What is to be tuned: the section `tune` of a campaign's file, and its goal as a number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.campaign.checks import specification
from flipdiagram.campaign.distributions import Distribution, DistributionError, distribution
from flipdiagram.campaign.reading import Source, read
from flipdiagram.campaign.specification import Specification
from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, field_paths
from flipdiagram.scenario.text import unknown_field

KEYS = ("architecture", "over", "objective", "budget", "held_out", "seed")
SECTIONS = ("controller", "planner")
"""Where gains and margins stand."""
METRICS = ("position_rmse_m", "angle_rmse_rad", "acceleration_rmse_m_s2", "max_slip_m")
FAILED = 10.0
"""Counted as the error of a flip that failed: more than any that succeeds."""


@dataclass(frozen=True)
class Goal:
    """The success rate, ties broken by a quantile of an error; or that quantile alone."""

    success: bool = True
    quantile: float = 0.9
    metric: str = "position_rmse_m"

    @property
    def quantile_name(self) -> str:
        """'90 % quantile of position_rmse_m'."""
        return f"{100 * self.quantile:g} % quantile of {self.metric}"

    @property
    def text(self) -> str:
        """What is wanted, in words."""
        return "the highest success rate" if self.success else f"the least {self.quantile_name}"

    def quantile_of(self, won: Sequence[bool], errors: Sequence[float | None]) -> float | None:
        """Over all trials, a failed one beyond every other; None where it falls on failed ones."""
        pairs = zip(won, errors, strict=True)
        counted = [e if ok and e is not None and math.isfinite(e) else FAILED for ok, e in pairs]
        found = float(np.quantile(counted, self.quantile, method="higher"))
        return None if found == FAILED else found

    def score(self, won: Sequence[bool], errors: Sequence[float | None]) -> float:
        """Higher is better."""
        rate, quantile = sum(won) / len(won), self.quantile_of(won, errors)
        error = FAILED if quantile is None else quantile
        if self.success:  # less than one flip for any error
            return rate - 0.5 / len(won) * error / (error + 0.01)
        return -error if quantile is not None else -FAILED - (1 - rate)


@dataclass(frozen=True)
class Tune:
    """A checked section `tune`."""

    architecture: str
    over: Mapping[str, Distribution]
    goal: Goal
    budget: int
    """Flips of the search."""
    held_out: int
    """Trials of the verdict."""
    seed: int


def load_tuning(path: str | Path, changes: Mapping[str, Any] | None = None) -> tuple[Specification, Tune]:
    """Read and check a campaign file with its section `tune`, as `load_specification`; InputError with the line."""
    source = read(path)
    found = specification(source, Path(path).parent, changes)
    return found, tuning(source, found)


def tuning(source: Source, found: Specification) -> Tune:
    """Check the section `tune` of a campaign."""
    data = found.tune
    if not isinstance(data, Mapping):
        raise source.bad(["tune"], data, "architecture, over: {field: {distribution: [numbers]}}, budget, held_out")
    for key in data:
        if key not in KEYS:
            raise source.error(["tune", str(key)], f"tune: unknown key {key!r}; valid are {', '.join(KEYS)}")
    architecture = data.get("architecture", "pd+ff+dob")
    if architecture not in ARCHITECTURES:
        raise source.bad(["tune", "architecture"], architecture, f"one of {', '.join(ARCHITECTURES)}")
    return Tune(
        architecture,
        _over(source, found, data.get("over")),
        _goal(source, data.get("objective", "success")),
        _whole(source, data, "budget", 2 * found.trials),
        _whole(source, data, "held_out", 4),
        _whole(source, data, "seed", 0, found.seed),
    )


def _over(source: Source, found: Specification, data: Any) -> dict[str, Distribution]:
    if not isinstance(data, Mapping) or not data:
        raise source.bad(["tune", "over"], data, "'field: {distribution: [numbers]}', at least one")
    varied = {field for dimension in found.dimensions for field in dimension.fields}
    over = {}
    for key, value in data.items():
        path = ["tune", "over", str(key)]
        if key not in field_paths():
            raise source.error(path, str(unknown_field(Scenario, str(key))))
        if key.split(".")[0] not in SECTIONS:
            raise source.error(path, f"{key} cannot be chosen; valid are fields of {' and '.join(SECTIONS)}")
        if key in varied:
            raise source.error(path, f"{key} is uncertain in `vary`; valid is one of the two")
        try:
            over[key] = distribution(value)
            for end in over[key].ends():
                found.base.with_overrides({key: end})
        except (DistributionError, InputError) as error:
            raise source.error(path, f"{key}: {error}") from None
    return over


def _goal(source: Source, data: Any) -> Goal:
    if data == "success":
        return Goal()
    good = isinstance(data, Mapping) and set(data) == {"quantile", "of"} and data["of"] in METRICS
    if not good or not isinstance(data["quantile"], float) or not 0 < data["quantile"] < 1:
        valid = f"success, or {{quantile: 0.9, of: position_rmse_m}} with one of {', '.join(METRICS)}"
        raise source.bad(["tune", "objective"], data, valid)
    return Goal(False, data["quantile"], data["of"])


def _whole(source: Source, data: Mapping[str, Any], key: str, least: int, default: int | None = None) -> int:
    value = data.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= 2**32 - 1:
        raise source.bad(["tune", key], value, f"a whole number of at least {least}")
    return value
