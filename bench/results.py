"""What the benchmark measures: repeated values with their target, in sections; no measuring and no printing here."""

from __future__ import annotations

import operator
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Target:
    """A limit: the median must be `relation` ("<" or ">=") `value`, in the measurement's unit."""

    relation: str
    value: float

    def met(self, value: float) -> bool:
        """Whether a value keeps the limit."""
        return bool({"<": operator.lt, ">=": operator.ge}[self.relation](value, self.value))


@dataclass(frozen=True)
class Measurement:
    """One quantity, every repetition of it; `unit` is "s", "B" (bytes), "x" (a ratio) or "1/s" (a rate)."""

    name: str
    values: Sequence[float]
    unit: str = "s"
    target: Target | None = None
    indent: int = 0
    """Level below the measurement of which this is a part."""

    @property
    def median(self) -> float:
        """Median over the repetitions."""
        return statistics.median(self.values)

    @property
    def verdict(self) -> str | None:
        """`met` or `missed`; None without a target."""
        if self.target is None:
            return None
        return "met" if self.target.met(self.median) else "missed"

    def as_dict(self) -> dict[str, Any]:
        """Plain data for bench.json."""
        target = self.target and {"relation": self.target.relation, "value": self.target.value}
        return {
            "name": self.name,
            "unit": self.unit,
            "median": self.median,
            "min": min(self.values),
            "max": max(self.values),
            "values": list(self.values),
            "target": target,
            "verdict": self.verdict,
        }


@dataclass
class Section:
    """Measurements that belong together, and in words what was compared with what."""

    title: str
    text: str
    measurements: list[Measurement] = field(default_factory=list)
    whole: Measurement | None = None
    """Of which each measurement's share is shown."""
    checks: list[str] = field(default_factory=list)
    """What was verified about the results while measuring."""
    plot: Callable[[Path], None] | None = None
    """Draws a figure into a folder."""

    def add(
        self, name: str, values: Sequence[float], unit: str = "s", target: Target | None = None, indent: int = 0
    ) -> Measurement:
        """Append a measurement and return it."""
        self.measurements.append(Measurement(name, list(values), unit, target, indent))
        return self.measurements[-1]

    def as_dict(self) -> dict[str, Any]:
        """Plain data for bench.json."""
        return {
            "title": self.title,
            "text": self.text,
            "measurements": [m.as_dict() for m in self.measurements],
            "checks": self.checks,
        }
