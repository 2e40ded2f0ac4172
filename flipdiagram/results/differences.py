"""Nested results as named leaves, and which of them differ."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flipdiagram.grid import number, unit_of

SKIPPED = frozenset(
    "schema versions scenario code recording real_time_factor solve_time_s seconds channel_steps_per_s program_times"
    " stored".split()
)
"""Entries that say how, where and how fast something ran, not what came out."""
KEYS = "id figure group name variant architecture start_y_m g_dis_rad_s friction omega_rad_s kind".split()
"""What tells the entries of a list apart."""
FEW = 8
"""Entries that a note names."""
AXES = re.compile(r"\.([xy]\.values(\[\d+\])?|omega_rad_s|g_dis_rad_s)$")
"""Leaves that say over what the numbers beside them stand."""
Leaves = Mapping[str, Any]


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
        return _are_numbers((self.a, self.b))

    @property
    def difference(self) -> str:
        """b − a, for numbers with the relative difference."""
        if self.same:
            return "–"
        if not (_is_number(self.a) and _is_number(self.b)):
            return "differs"
        text = f"{self.b - self.a:+.3g}"
        return text + (f" ({100 * (self.b / self.a - 1):+.3g} %)" if self.a else "")


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


def comparable(a: Leaves, b: Leaves, names: tuple[str, str]) -> tuple[Leaves, Leaves, list[str]]:
    """The leaves of both without entries of lists that cannot be compared, and a note on each of those.

    Left out is what only one of them has (a run, a map, a claim), and what stands over other axes.
    """
    notes, left_out = [], {""}  # leaves of no list stay
    heads = [dict.fromkeys(map(_head, of_one)) for of_one in (a, b)]
    for name, own, foreign in ((names[0], *heads), (names[1], *reversed(heads))):
        if alone := [head for head in own if head not in foreign and head]:
            more = f", and {len(alone) - FEW} more" if len(alone) > FEW else ""
            notes.append(f"Only in {name}: " + ", ".join(f"`{head}`" for head in alone[:FEW]) + more)
            left_out.update(alone)
    moved = dict.fromkeys(_head(name) for name in [*a, *b] if AXES.search(name) and a.get(name) != b.get(name))
    if over_other_axes := [head for head in moved if head not in left_out]:
        notes.append("Over other axes, not compared: " + ", ".join(f"`{head}`" for head in over_other_axes))
        left_out.update(over_other_axes)
    left_out.remove("")
    one, other = ({name: value for name, value in of.items() if _head(name) not in left_out} for of in (a, b))
    return one, other, notes


def changes(a: Leaves, b: Leaves) -> tuple[Change, ...]:
    """Every leaf of both, equal or not; of lists of numbers the place that differs most."""
    return tuple(_change(name, a.get(name), b.get(name)) for name in dict.fromkeys([*a, *b]))


def _change(name: str, x: Any, y: Any) -> Change:
    if not (isinstance(x, list | tuple) and isinstance(y, list | tuple)):
        numeric = _is_number(x if x is not None else y)
        return Change(name, unit_of(re.sub(r"(\[[^]]*\])+$", "", name)) if numeric else "", x, y)
    if len(x) != len(y):
        return Change(f"{name}: how many", "", len(x), len(y))
    if not x or list(x) == list(y):
        return Change(name, unit_of(name), number(x), number(y))
    one, other = (np.array(values, dtype=float) for values in (x, y))  # None becomes nan
    apart = np.where(np.isnan(one) != np.isnan(other), np.inf, np.nan_to_num(np.abs(one - other)))
    k = int(np.argmax(apart))
    return Change(f"{name}[{k}]", unit_of(name), x[k], y[k])


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
