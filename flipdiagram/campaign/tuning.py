"""What is to be tuned: the section `tune` of a campaign's file, and its goal as a number."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from pydantic import Field

from flipdiagram.campaign.checks import specification
from flipdiagram.campaign.distributions import Distribution, distribution
from flipdiagram.campaign.specification import Specification
from flipdiagram.campaign.specification_file import MOST_TRIALS, VARY, Seed, Source, read
from flipdiagram.scenario.scenario import ARCHITECTURES, Architecture, Scenario, field_paths
from flipdiagram.scenario.text import Section, unknown_field

SECTIONS = ("controller", "planner", "tool")
"""Where stands what one may choose: gains, margins, the blade."""
Metric = Literal["position_rmse_m", "angle_rmse_rad", "acceleration_rmse_m_s2", "max_slip_m"]
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
        quantile = float(np.quantile(counted, self.quantile, method="higher"))
        return None if quantile == FAILED else quantile

    def score(self, won: Sequence[bool], errors: Sequence[float | None]) -> float:
        """Higher is better."""
        rate, quantile = sum(won) / len(won), self.quantile_of(won, errors)
        error = FAILED if quantile is None else quantile
        if self.success:  # less than one flip for any error
            return rate - 0.5 / len(won) * error / (error + 0.01)
        return -error if quantile is not None else -FAILED - (1 - rate)


class Quantile(Section):
    """A quantile of an error, to be made small."""

    quantile: float = Field(gt=0, lt=1)
    of: Metric


class TuneSection(Section):
    """The section `tune`; the description of a field says what is valid."""

    architecture: Architecture = Field("pd+ff+dob", description=f"one of {', '.join(ARCHITECTURES)}")
    over: dict[str, Any] = Field(min_length=1, description=VARY)
    """Distributions by the field, once `tuning` has checked them."""
    objective: Literal["success"] | Quantile = Field(
        "success",
        description=f"success, or {{quantile: 0.9, of: position_rmse_m}} with one of {', '.join(get_args(Metric))}",
    )
    budget: int = Field(ge=1, le=MOST_TRIALS, description="a whole number of at least twice the trials")
    """Flips of the search."""
    held_out: int = Field(ge=4, le=MOST_TRIALS, description=f"a whole number from 4 to {MOST_TRIALS}")
    """Trials of the verdict."""
    seed: Seed = 0

    @property
    def goal(self) -> Goal:
        """The objective as a number."""
        return Goal() if isinstance(self.objective, str) else Goal(False, self.objective.quantile, self.objective.of)


def load_tuning(path: str | Path, changes: Mapping[str, Any] | None = None) -> tuple[Specification, TuneSection]:
    """Read and check a campaign file with its section `tune`, as `load_specification`; InputError with the line."""
    source = read(path)
    campaign = specification(source, Path(path).parent, changes)
    return campaign, tuning(source, campaign)


def tuning(source: Source, campaign: Specification) -> TuneSection:
    """Check the section `tune` of a campaign."""
    data = source.data.get("tune")
    if not isinstance(data, Mapping):
        raise source.bad(["tune"], data, "architecture, over: {field: {distribution: [numbers]}}, budget, held_out")
    section = source.validated(TuneSection, data, ("tune",))
    if section.budget < 2 * campaign.trials:
        raise source.bad(["tune", "budget"], section.budget, f"a whole number of at least {2 * campaign.trials}")
    seed = section.seed if "seed" in section.model_fields_set else campaign.seed
    return section.model_copy(update={"over": _over(source, campaign, section.over), "seed": seed})


def _over(source: Source, campaign: Specification, data: Mapping[str, Any]) -> dict[str, Distribution]:
    varied = {field for dimension in campaign.dimensions for field in dimension.fields}
    over = {}
    for key, value in data.items():
        path = ("tune", "over", key)
        if key not in field_paths():
            raise source.error(path, str(unknown_field(Scenario, key)))
        if key.split(".")[0] not in SECTIONS:
            raise source.error(path, f"{key} cannot be chosen; valid are fields of {', '.join(SECTIONS)}")
        if key in varied:
            raise source.error(path, f"{key} is uncertain in `vary`; valid is one of the two")
        with source.located(path, f"{key}: "):
            over[key] = distribution(value)
            for end in over[key].ends():
                campaign.base.with_overrides({key: end})
    return over
