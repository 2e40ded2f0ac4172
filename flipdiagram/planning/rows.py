"""Linear inequality rows A w ≤ b, collected in batches and named by the constraint they come from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats, Indices


class Rows:
    """Collects rows Σ value·w[column] ≤ upper; each row belongs to a named group, the constraint it stands for."""

    def __init__(self) -> None:
        self._rows: list[Indices] = []
        self._columns: list[Indices] = []
        self._values: list[Floats] = []
        self._upper: list[Floats] = []
        self._groups: list[tuple[str, int]] = []
        self.count = 0

    def add(self, group: str, terms: Sequence[tuple[ArrayLike, ArrayLike]], upper: ArrayLike) -> None:
        """Add a batch: terms are (columns, values) pairs that broadcast against `upper`, one row per element."""
        shape = np.broadcast_shapes(np.shape(upper), *(np.shape(c) for c, _ in terms), *(np.shape(v) for _, v in terms))
        size = int(np.prod(shape))
        every_column = np.empty((len(terms), *shape), dtype=np.int64)
        every_value = np.empty((len(terms), *shape))
        for i, (columns, values) in enumerate(terms):
            every_column[i] = columns
            every_value[i] = values
        self._rows.append(np.tile(self.count + np.arange(size), len(terms)))
        self._columns.append(every_column.ravel())
        self._values.append(every_value.ravel())
        self._upper.append(np.broadcast_to(np.asarray(upper, dtype=float), shape).ravel())
        self._groups.append((group, size))
        self.count += size

    def entries(self) -> tuple[Indices, Indices, Floats, Floats]:
        """Row, column and value of every entry of A, those of one place to be added up, and b (count,)."""
        if not self._rows:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
        rows, columns = np.concatenate(self._rows), np.concatenate(self._columns)
        return rows, columns, np.concatenate(self._values), np.concatenate(self._upper)

    def matrix(self, columns: int) -> tuple[sp.csc_matrix, Floats]:
        """A (count, columns) and b (count,)."""
        rows, column, values, upper = self.entries()
        return sp.csc_matrix((values, (rows, column)), shape=(self.count, columns)), upper

    def groups(self) -> list[str]:
        """The group of every row, in order."""
        return [name for name, size in self._groups for _ in range(size)]


class FilledRows(Rows):
    """Rows that were written into arrays by compiled loops; they belong to no group."""

    def __init__(self, rows: Indices, columns: Indices, values: Floats, upper: Floats) -> None:
        super().__init__()
        self._entries = (rows, columns, values, upper)
        self.count = upper.size

    def entries(self) -> tuple[Indices, Indices, Floats, Floats]:
        """As `Rows.entries`."""
        return self._entries


class Buffer:
    """Arrays to which compiled loops append rows: `arrays` = rows, columns, values, upper, and how many of either."""

    def __init__(self, rows: int, entries: int) -> None:
        self._counts = np.zeros(2, dtype=np.int64)
        places, values = np.empty((2, entries), dtype=np.int64), np.empty(entries)
        self.arrays = (places[0], places[1], values, np.empty(rows), self._counts)

    def start(self) -> None:
        """Forget what is there."""
        self._counts[:] = 0

    def finish(self) -> FilledRows:
        """A copy of what is there."""
        rows, columns, values, upper, (count, entries) = self.arrays
        return FilledRows(
            rows[:entries].copy(), columns[:entries].copy(), values[:entries].copy(), upper[:count].copy()
        )
