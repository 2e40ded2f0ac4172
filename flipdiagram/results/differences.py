"""Nested results as named leaves, and which of them differ."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.grid import number
from flipdiagram.results.signals import Component, unit_of

SKIPPED = {
    "schema",
    "versions",
    "scenario",
    "code",
    "recording",
    "real_time_factor",
    "solve_time_s",
    "seconds",
    "channel_steps_per_s",
    "program_times",
    "stored",
}
"""Entries that say how, where and how fast something ran, not what came out."""
KEYS = (
    "id",
    "figure",
    "group",
    "name",
    "variant",
    "architecture",
    "start_y_m",
    "g_dis_rad_s",
    "friction",
    "omega_rad_s",
    "kind",
)
"""What tells the entries of a list apart."""

FEW = 8
"""Entries that a note names."""
AXES = re.compile(r"\.([xy]\.values(\[\d+\])?|omega_rad_s|g_dis_rad_s)$")
"""Leaves that say over what the numbers beside them stand."""


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
        return text + (f" ({100 * (self.b / self.a - 1):+.3g} %)" if self.a else "")


@dataclass(frozen=True)
class SignalDifference:
    """b − a of one component on the times that both have: largest with its time [s], and RMS, in `unit`."""

    name: str
    signal: str
    unit: str
    largest: float
    rms: float
    time: float
    one_sided: int
    """Samples at which one is nan and the other is not; they count in neither number."""


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


def comparable(
    a: Mapping[str, Any], b: Mapping[str, Any], names: tuple[str, str]
) -> tuple[dict[str, Any], dict[str, Any], list[str]]:
    """The leaves of both without entries of lists that cannot be compared, and a note on each of those.

    Left out is what only one of them has (a run, a map, a claim), and what stands over other axes.
    """
    notes = []
    heads = [{_head(name): None for name in leaf} for leaf in (a, b)]
    out: set[str] = set()
    for name, own, foreign in ((names[0], *heads), (names[1], *reversed(heads))):
        alone = [head for head in own if head not in foreign and head]
        out |= set(alone)
        if alone:
            more = f", and {len(alone) - FEW} more" if len(alone) > FEW else ""
            notes.append(f"Only in {name}: " + ", ".join(f"`{head}`" for head in alone[:FEW]) + more)
    moved = {_head(n): None for n in [*a, *b] if AXES.search(n) and _head(n) not in out and a.get(n) != b.get(n)}
    if any(moved):
        notes.append("Over other axes, not compared: " + ", ".join(f"`{head}`" for head in moved if head))
    out |= {head for head in moved if head}
    one, other = ({name: value for name, value in leaf.items() if _head(name) not in out} for leaf in (a, b))
    return one, other, notes


def changes(a: Mapping[str, Any], b: Mapping[str, Any], all_of_them: bool = False) -> tuple[Change, ...]:
    """The leaves that differ, or all; of lists of numbers the place that differs most."""
    pairs = []
    for name in dict.fromkeys([*a, *b]):
        x, y = a.get(name), b.get(name)
        unit = unit_of(re.sub(r"(\[[^]]*\])+$", "", name)) if _is_number(x if x is not None else y) else ""
        if isinstance(x, Sequence) and isinstance(y, Sequence) and not isinstance(x, str) and not isinstance(y, str):
            pairs.append(_of_lists(name, unit_of(name), list(x), list(y)))
        else:
            pairs.append(Change(name, unit, x, y))
    return tuple(change for change in pairs if all_of_them or not change.same)


def signal_difference(part: Component, x: np.ndarray, y: np.ndarray, time: np.ndarray) -> SignalDifference:
    """How one component differs between samples x and y at the same times [s]."""
    both = np.isfinite(x) & np.isfinite(y)
    one_sided = int(np.sum(np.isnan(x) != np.isnan(y)))
    if not both.any():
        return SignalDifference(part.name, part.signal, part.unit, 0.0, 0.0, float("nan"), one_sided)
    apart = np.abs(np.where(both, y, 0.0) - np.where(both, x, 0.0))
    k = int(np.argmax(apart))
    rms = float(np.sqrt(np.mean(apart[both] ** 2)))
    return SignalDifference(part.name, part.signal, part.unit, float(apart[k]), rms, float(time[k]), one_sided)


def common_samples(one: xr.Dataset, other: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the samples at the same time to a nanosecond, in both."""
    a, b = (np.round(1e9 * data["time"].values).astype(np.int64) for data in (one, other))
    _, here, there = np.intersect1d(a, b, return_indices=True)
    return here, there


def _of_lists(name: str, unit: str, x: list[Any], y: list[Any]) -> Change:
    if len(x) != len(y):
        return Change(f"{name}: how many", "", len(x), len(y))
    if not x or x == y:
        return Change(name, unit, number(x), number(y))
    one, other = (np.array([np.nan if v is None else v for v in values], dtype=float) for values in (x, y))
    gone = np.isnan(one) != np.isnan(other)
    apart = np.where(gone, np.inf, np.nan_to_num(np.abs(one - other)))
    k = int(np.argmax(apart))
    return Change(f"{name}[{k}]", unit, x[k], y[k])


def _head(name: str) -> str:
    """The entry of a list that a leaf belongs to, 'runs[pd]'; '' where it belongs to none."""
    return name[: name.index("]") + 1] if "]" in name else ""


def _key(item: Any, index: int) -> str:
    if not isinstance(item, Mapping):
        return str(index)
    values = [number(item[key]) for key in KEYS if key in item and not isinstance(item[key], list | dict)]
    return ", ".join(text for text in values if text != "–") or str(index)


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(value is None or _is_number(value) for value in values)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
