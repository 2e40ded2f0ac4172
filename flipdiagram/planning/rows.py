"""Linear inequality rows Σ value·w[column] ≤ upper: what constraints become at a trajectory.

A constraint asks that margin(w) ≥ 0.  At the decision vector w̄ of the trajectory, with the slope there,
    margin(w) ≈ margin(w̄) + slope · (w − w̄) ≥ 0   ⇔   −slope · w ≤ margin(w̄) − slope · w̄.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from flipdiagram.arrays import Floats, Indices
from flipdiagram.robot.jit import compiled


class Part(NamedTuple):
    """Some constraints at a trajectory: which group each belongs to, margins (m,), slopes and where they stand (e,)."""

    groups: tuple[tuple[str, int], ...]
    """Names, and how many rows in turn belong to each."""
    rows: Indices
    columns: Indices
    slope: Floats
    margin: Floats


def part(group: str, columns: Indices, slope: Floats, margin: Floats) -> Part:
    """m constraints of one group, each on as many variables: columns and slope (variables, m), margin (m,)."""
    count = margin.size
    rows = np.tile(np.arange(count), len(columns))
    return Part(((group, count),), rows, columns.ravel(), slope.ravel(), margin)


@dataclass(frozen=True)
class Rows:
    """Rows Σ values·w[columns] ≤ upper (m,); `rows`, `columns`, `values` (e,) are the entries, zeros among them."""

    rows: Indices
    columns: Indices
    values: Floats
    upper: Floats
    slack: Floats
    """What is left of each row at the trajectory (m,); negative: violated there."""
    groups: tuple[tuple[str, int], ...]
    """Names of the constraints that the rows stand for, and how many rows in turn belong to each."""

    @classmethod
    def about(cls, w: Floats, parts: Sequence[Part]) -> "Rows":
        """Constraints linearised about the trajectory whose decision vector is w."""
        first = np.cumsum([0, *(each.margin.size for each in parts)]).tolist()
        rows = np.concatenate([each.rows + k for each, k in zip(parts, first, strict=False)])
        columns = np.concatenate([each.columns for each in parts])
        slope = np.concatenate([each.slope for each in parts])
        margin = np.concatenate([each.margin for each in parts])
        upper: Floats = margin - np.bincount(rows, slope * w[columns], margin.size)
        return cls(rows, columns, -slope, upper, margin, tuple(group for each in parts for group in each.groups))

    @property
    def count(self) -> int:
        """Number of rows m."""
        return int(self.upper.size)

    def matrix(self, size: int) -> sp.csc_matrix:
        """A (m, size) with A w ≤ upper."""
        return sp.csc_matrix((self.values, (self.rows, self.columns)), shape=(self.count, size))

    def names(self) -> list[str]:
        """The group of every row, in order."""
        return [name for name, count in self.groups for _ in range(count)]

    def left(self, w: Floats) -> Floats:
        """What is left of each row at w (m,), negative where it is violated."""
        return self.upper - np.bincount(self.rows, self.values * w[self.columns], self.count)

    def excess(self, w: Floats) -> float:
        """Largest violation of a row at w, 0 where all hold."""
        return float(np.max(-self.left(w), initial=0.0))


Law = Callable[[Any, Any, Any, Any], None]
"""Fills margin (m,) and slope (variables, m) of constraints from their variables x (variables, m) and numbers p."""


@dataclass(frozen=True)
class Constraint:
    """m constraints of one kind: on the variables w[columns], columns (variables, m), with numbers p (…, m)."""

    group: str
    law: Law
    columns: Indices
    p: Floats

    @classmethod
    def of(cls, group: str, law: Law, columns: Sequence[Any], *p: Any) -> "Constraint":
        """From columns and numbers that broadcast against each other."""
        shape = np.broadcast_shapes(*map(np.shape, columns), *map(np.shape, p))
        full = [[np.broadcast_to(value, shape).ravel() for value in values] for values in (columns, p)]
        return cls(group, law, np.array(full[0], dtype=np.int64), np.array(full[1], dtype=np.float64))


class Linearisation:
    """Constraints that are linearised together again and again: laws are evaluated once each, over all that obey them.

    native: by machine code.
    """

    def __init__(self, constraints: Iterable[Constraint], native: bool = False) -> None:
        by_law: dict[Law, list[Constraint]] = {}
        for constraint in constraints:
            by_law.setdefault(constraint.law, []).append(constraint)
        self._native, self._blocks = native, list[tuple[Law, Floats, Indices]]()
        rows, columns, self._count = list[Indices](), list[Indices](), 0
        for law, alike in by_law.items():
            at = np.hstack([constraint.columns for constraint in alike])
            self._blocks.append((law, np.hstack([constraint.p for constraint in alike]), at))
            rows.append(np.tile(self._count + np.arange(at.shape[1]), len(at)))
            columns.append(at.ravel())
            self._count += at.shape[1]
        self._rows, self._columns = np.concatenate(rows), np.concatenate(columns)
        self._groups = tuple((c.group, c.columns.shape[1]) for alike in by_law.values() for c in alike)

    def at(self, w: Floats) -> Part:
        """Margins and slopes at the trajectory whose decision vector is w."""
        margin, slope, m, e = np.empty(self._count), np.empty(self._columns.size), 0, 0
        for law, p, columns in self._blocks:
            x, count = w[columns], columns.shape[1]
            of, by = margin[m : m + count], slope[e : e + columns.size].reshape(columns.shape)
            if self._native:
                compiled(law)(x, p, of, by)
            else:
                law(x[:, None], p[:, None], of[None], by[:, None])
            m, e = m + count, e + columns.size
        return Part(self._groups, self._rows, self._columns, slope, margin)
