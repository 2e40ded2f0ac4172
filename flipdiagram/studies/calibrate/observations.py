"""What the paper prints of its robot, and the same of a simulated world: numbers, verdicts, signs, and their distance.

A world is flown under each architecture from the first start and under FF+DOB from every start, in stages: the paper's
numbers were measured in flips that FF+DOB and DOB turned over, so a world in which they do not explains none of them,
and the other flips are spared.  Its numbers are judged by the functions that judge the claims E1–E8, so a sign here is
a claim there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.flips.outcome import Outcome
from flipdiagram.simulation.verdict import SLIDES
from flipdiagram.studies.experiment.claims import BOTH, DOB, FF, JOINT_2, PD, claims_of, run_entry

Flown = Mapping[tuple[str, float], Outcome]
"""What became of the flips of a world by (architecture, start [m])."""


@dataclass(frozen=True)
class Quantity:
    """A number of the paper: its unit, and the relative error within which one of ours counts as the same."""

    name: str
    paper: float
    unit: str
    tolerance: float


QUANTITIES = (
    Quantity("position RMSE, mean over the starts", 1.10, "cm", 0.15),
    Quantity("position RMSE, last start", 1.18, "cm", 0.15),
    Quantity("acceleration RMSE, FF+DOB", 4.65, "m/s²", 0.15),
    Quantity("acceleration RMSE, DOB", 4.81, "m/s²", 0.15),
    Quantity("torque of joint 2, FF+DOB", 205.0, "N m", 0.30),
    Quantity("torque of joint 2, DOB", 224.0, "N m", 0.30),
)
"""Section IV-B of the paper; the tolerances are those within which a reproduction is aimed at."""
VERDICTS = ("PD slides off", "FF slides off")
"""What E1 says of those without observer: by sliding, without a strike before."""
SIGNS = ("E2", "E3", "E4", "E5", "E7")
"""Claims of which of two numbers is the larger."""
CLAIMS = tuple(f"E{k}" for k in range(1, 9))
DATA = (*(quantity.name for quantity in QUANTITIES), *VERDICTS, *SIGNS)
"""Everything that a calibration takes from the paper, by name."""


@dataclass(frozen=True)
class Observation:
    """A world as the paper would have printed it: numbers (6,), whether each verdict, sign and claim holds."""

    numbers: Floats
    verdicts: tuple[bool, ...]
    claims: tuple[bool, ...]

    @property
    def signs(self) -> tuple[bool, ...]:
        """Of the claims, those of `SIGNS`."""
        return tuple(self.claims[CLAIMS.index(name)] for name in SIGNS)

    @property
    def holds(self) -> tuple[bool, ...]:
        """Verdicts, then signs."""
        return self.verdicts + self.signs

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        numbers = [None if np.isnan(value) else float(value) for value in self.numbers]
        return {"numbers": numbers, "verdicts": list(self.verdicts), "claims": list(self.claims)}


PAPER = Observation(np.array([quantity.paper for quantity in QUANTITIES]), (True,) * 2, (True,) * 8)
NOTHING = Observation(np.full(len(QUANTITIES), np.nan), (False,) * 2, (False,) * 8)
"""Of a world that cannot be, or in which a controller with observer loses the block: nan was not measured."""


def stages(starts: Sequence[float]) -> list[list[tuple[str, float]]]:
    """(architecture, start [m]) of the flips that an observation takes; the next ones only where all so far succeed."""
    first = starts[0]
    return [[(BOTH, first)], [(DOB, first)], [(PD, first), (FF, first), *((BOTH, y) for y in starts[1:])]]


def observe(flown: Flown, starts: Sequence[float]) -> Observation:
    """A world's flips as the paper would have printed them."""
    claims = claims_of([run_entry(y, name, outcome) for (name, y), outcome in flown.items()])
    position = [position_of(flown[BOTH, y]) for y in starts]
    numbers = [np.mean(position), position[-1]]
    numbers += [_metric(flown[name, starts[0]], "acceleration_rmse_meas_m_s2") for name in (BOTH, DOB)]
    numbers += [_metric(flown[name, starts[0]], "max_torque_cmd_Nm") for name in (BOTH, DOB)]
    slid = tuple(flown[name, starts[0]].mode in SLIDES for name in (PD, FF))
    return Observation(np.array(numbers), slid, tuple(claim["holds"] is True for claim in claims))


def position_of(outcome: Outcome) -> float:
    """Measured position RMSE of a flip [cm]; nan where nothing was measured."""
    return _metric(outcome, "position_rmse_meas_m", 100.0)


def _metric(outcome: Outcome, name: str, factor: float = 1.0) -> float:
    if outcome.metrics is None:
        return float("nan")
    value = getattr(outcome.metrics, name)
    return factor * float(value[JOINT_2] if isinstance(value, list) else value)


def deviations(world: Observation, data: Observation = PAPER) -> Floats:
    """ln(ours / the data's) over the tolerance, one for each of `QUANTITIES`; nan where there is none."""
    tolerance = np.array([quantity.tolerance for quantity in QUANTITIES])
    with np.errstate(divide="ignore", invalid="ignore"):
        deviation = np.log(world.numbers / data.numbers) / tolerance
    return np.where(np.isfinite(deviation), deviation, np.nan)


def distance(world: Observation, data: Observation = PAPER, without: Sequence[str] = ()) -> float:
    """√(Σ deviation² + number of verdicts and signs that differ); infinite where a number that counts is missing.

    A sign that differs counts as much as a number that is off by its tolerance.  without: names of `DATA` held out.
    """
    counts = np.array([name not in without for name in DATA])
    numbers, others = counts[: len(QUANTITIES)], counts[len(QUANTITIES) :]
    squares = deviations(world, data)[numbers] ** 2
    differ = np.not_equal(world.holds, data.holds)[others].sum()
    total = float(np.sqrt(squares.sum() + differ))
    return total if np.isfinite(total) else float("inf")


def agreements(world: Observation) -> np.ndarray:
    """Whether each of `DATA` is as the paper has it, numbers within their tolerance; shape (len(DATA),)."""
    with np.errstate(invalid="ignore"):
        close = np.abs(world.numbers / PAPER.numbers - 1) <= [quantity.tolerance for quantity in QUANTITIES]
    return np.concatenate([close, world.holds])
