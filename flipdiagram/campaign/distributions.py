"""What a field may be: a distribution as the inverse of its cumulative probability, or a list of values."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from scipy.special import ndtr, ndtri

from flipdiagram.errors import InputError

DIGITS = 9
"""Significant digits of a drawn number: it reads back from any text, and is the same on every machine."""
KINDS = {
    "uniform": "[low, high] with low < high",
    "loguniform": "[low, high] with 0 < low < high",
    "normal": "[mean, standard deviation above 0]",
    "integers": "[low, high], whole numbers with low < high",
    "choice": "a list of at least one value, each once",
    "grid": "a list of at least one value, each once",
}
"""Name in the file → what it takes."""
TAIL = 1e-12
"""Probability beyond which a normal distribution is not followed: 7 standard deviations."""


@dataclass(frozen=True)
class Distribution:
    """One kind of `KINDS` with its numbers or values; clip: values beyond are set to the nearer bound."""

    kind: str
    numbers: tuple[Any, ...]
    clip: tuple[float, float] | None = None

    @property
    def values(self) -> tuple[Any, ...] | None:
        """All values of a discrete one, else None."""
        if self.kind == "integers":
            return tuple(range(self.numbers[0], self.numbers[1] + 1))
        return self.numbers if self.kind in ("choice", "grid") else None

    def value(self, u: float) -> Any:
        """The value below which a share u in [0, 1) of all lies."""
        if (values := self.values) is not None:
            return values[min(int(u * len(values)), len(values) - 1)]
        first, second = self.numbers
        if self.kind == "uniform":
            x = first + u * (second - first)
        elif self.kind == "loguniform":
            x = math.exp(math.log(first) + u * (math.log(second) - math.log(first)))
        else:
            x = first + second * float(ndtri(min(max(u, TAIL), 1 - TAIL)))
        if self.clip is not None:
            x = min(max(x, self.clip[0]), self.clip[1])
        return float(f"{x:.{DIGITS}g}")

    def position(self, value: Any) -> float | None:
        """The share u of which `value` is the value; None where it cannot be drawn."""
        if (values := self.values) is not None:
            return (values.index(value) + 0.5) / len(values) if value in values else None
        if not is_number(value) or (self.kind == "loguniform" and value <= 0):
            return None
        first, second = self.numbers
        if self.kind == "normal":
            return float(ndtr((value - first) / second))
        scale: Callable[[float], float] = math.log if self.kind == "loguniform" else float
        u = (scale(value) - scale(first)) / (scale(second) - scale(first))
        return u if 0 <= u <= 1 else None

    def ends(self) -> tuple[Any, ...]:
        """The values at the borders, to be tried before anything runs; none of an unbounded one."""
        if (values := self.values) is not None:
            return values
        if self.kind == "normal":
            return self.clip or ()
        return tuple(float(f"{x:.{DIGITS}g}") for x in (self.clip or self.numbers))

    def as_dict(self) -> dict[str, Any]:
        """As it is written."""
        return {self.kind: list(self.numbers)} | ({"clip": list(self.clip)} if self.clip else {})


def distribution(data: Any) -> Distribution:
    """From what stands in a file, {'uniform': [0, 1]}; raises InputError."""
    if not isinstance(data, Mapping) or not data:
        raise InputError(f"valid is one of {', '.join(f'{{{kind}: …}}' for kind in KINDS)}")
    for name in data:
        if name not in (*KINDS, "clip"):
            raise InputError(f"'{name}' is no distribution; valid are {', '.join(KINDS)} and clip")
    kinds = [name for name in data if name != "clip"]
    if len(kinds) != 1:
        raise InputError(f"one distribution is needed; valid are {', '.join(KINDS)}")
    kind, values = kinds[0], data[kinds[0]]
    if not isinstance(values, Sequence) or isinstance(values, str) or not values or not _fits(kind, values):
        raise InputError(f"{kind} is not valid; valid is {KINDS[kind]}")
    if "clip" not in data:
        return Distribution(kind, tuple(tuple(value) if isinstance(value, list) else value for value in values))
    clip = data["clip"]
    if kind in ("choice", "grid"):
        raise InputError(f"clip does not go with {kind}; valid is a list of the values wanted")
    if kind == "integers" or not isinstance(clip, list) or len(clip) != 2 or not _fits("uniform", clip):
        raise InputError(f"clip of {kind} is not valid; valid is [low, high] with low < high, not for integers")
    return Distribution(kind, tuple(values), (float(clip[0]), float(clip[1])))


def _fits(kind: str, values: Sequence[Any]) -> bool:
    """Whether numbers or values are what a kind takes."""
    if kind in ("choice", "grid"):
        return not any(isinstance(value, Mapping) for value in values) and len(set(map(repr, values))) == len(values)
    if len(values) != 2 or not all(map(is_number, values)):
        return False
    first, second = values
    return {
        "uniform": first < second,
        "loguniform": 0 < first < second,
        "normal": second > 0,
        "integers": isinstance(first, int) and isinstance(second, int) and first < second,
    }[kind]


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
