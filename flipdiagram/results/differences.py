"""Nested results as named leaves, and which of them differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flipdiagram.results.signals import number, unit_of

SKIPPED = {
    "schema", "versions", "scenario", "code", "recording", "real_time_factor", "solve_time_s", "seconds",
    "channel_steps_per_s", "program_times", "stored",
}  # fmt: skip
"""Entries that say how, where and how fast something ran, not what came out."""
KEYS = (
    "id", "figure", "group", "name", "variant", "architecture", "start_y_m", "g_dis_rad_s", "friction", "omega_rad_s",
    "kind",
)  # fmt: skip
"""What tells the entries of a list apart."""


@dataclass(frozen=True)
class Change:
    """One entry of two results; a and b are numbers, texts, truth values, or None where there is none."""

    name: str
    unit: str
    a: Any
    b: Any

    @property
    def same(self) -> bool:
        """Whether both are equal; two nan are."""
        return bool(self.a == self.b) or (_is_number(self.a) and math.isnan(self.a) and self.b != self.b)

    @property
    def numeric(self) -> bool:
        """Whether it is a number on both sides, or on one with nothing on the other."""
        return all(value is None or _is_number(value) for value in (self.a, self.b))

    @property
    def difference(self) -> str:
        """b − a, for numbers with the relative difference."""
        if self.same:
            return "–"
        if not (_is_number(self.a) and _is_number(self.b)):
            return "differs"
        text = f"{self.b - self.a:+.3g}"
        return text + (f" ({100 * (self.b / self.a - 1):+.2g} %)" if self.a else "")


def leaves(value: Any, name: str = "") -> dict[str, Any]:
    """Leaves by path, 'runs[pd].success'; a list of numbers is one leaf, an entry of a list is named by its keys."""
    if isinstance(value, Mapping):
        below = {f"{name}.{key}" if name else str(key): item for key, item in value.items() if key not in SKIPPED}
    elif isinstance(value, list | tuple) and not _are_numbers(value):
        labels = [_key(item, k) for k, item in enumerate(value)]
        if len(set(labels)) < len(labels):
            labels = [f"{label}, {k}" for k, label in enumerate(labels)]
        below = {f"{name}[{label}]": item for label, item in zip(labels, value, strict=True)}
    else:
        return {name: value}
    return {path: leaf for key, item in below.items() for path, leaf in leaves(item, key).items()}


def changes(a: Mapping[str, Any], b: Mapping[str, Any], all_of_them: bool = False) -> tuple[Change, ...]:
    """The leaves that differ, or all; of lists of numbers the place that differs most."""
    found = []
    for name in dict.fromkeys([*a, *b]):
        x, y = a.get(name), b.get(name)
        unit = unit_of(name.split("[")[-2] if name.endswith("]") and "[" in name else name)
        if isinstance(x, Sequence) and isinstance(y, Sequence) and not isinstance(x, str) and not isinstance(y, str):
            found.append(_of_lists(name, unit, list(x), list(y)))
        else:
            found.append(Change(name, unit, x, y))
    return tuple(change for change in found if all_of_them or not change.same)


def _of_lists(name: str, unit: str, x: list[Any], y: list[Any]) -> Change:
    if len(x) != len(y):
        return Change(f"{name}: how many", "1", len(x), len(y))
    if not x or x == y:
        return Change(name, unit, number(x), number(y))
    one, other = (np.array([np.nan if v is None else v for v in values], dtype=float) for values in (x, y))
    gone = np.isnan(one) != np.isnan(other)
    apart = np.where(gone, np.inf, np.nan_to_num(np.abs(one - other)))
    k = int(np.argmax(apart))
    return Change(f"{name}[{k}]", unit, x[k], y[k])


def _key(item: Any, index: int) -> str:
    if not isinstance(item, Mapping):
        return str(index)
    found = [number(item[key]) for key in KEYS if key in item and not isinstance(item[key], list | dict)]
    return ", ".join(text for text in found if text != "–") or str(index)


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(value is None or _is_number(value) for value in values)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
