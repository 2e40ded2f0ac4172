"""What is kept of flips, of a campaign's as of a study's: one row each in SQLite, committed when it ends."""

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from flipdiagram.errors import InputError
from flipdiagram.flips.outcome import Outcome

SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE plans (key TEXT PRIMARY KEY, plan BLOB, error TEXT);
CREATE TABLE trials (
    trial NOT NULL, architecture TEXT NOT NULL, outcome TEXT NOT NULL, failure TEXT, seed INTEGER NOT NULL,
    scenario_hash TEXT NOT NULL, overrides TEXT NOT NULL, "values" TEXT NOT NULL, metrics TEXT, plan TEXT,
    code TEXT NOT NULL, versions TEXT NOT NULL, seconds REAL NOT NULL, host TEXT NOT NULL, attempts INTEGER NOT NULL,
    finished REAL NOT NULL, PRIMARY KEY (trial, architecture)
) WITHOUT ROWID;
"""

PackedRow = tuple[Any, ...]
"""A row as SQLite takes it, in the order of `COLUMNS`."""
PackedPlan = tuple[bytes | None, str | None]
"""(plan as compressed JSON, None) or (None, why there is none)."""


@dataclass(frozen=True)
class Row:
    """One flip that has ended; the mappings are plain data.

    Seconds, host, attempts and finished tell how it came about, as the plan's `solve_time_s` does; the others do not
    depend on workers, their number or their order.
    """

    trial: int | str
    """Its number in a campaign; the key of its question in a study."""
    architecture: str
    outcome: str
    """One of `outcome.MODES`."""
    failure: str | None
    seed: int
    scenario_hash: str
    overrides: Mapping[str, Any]
    values: Sequence[Any]
    """Of the dimensions, in their order."""
    metrics: Mapping[str, Any] | None
    plan: Mapping[str, Any] | None
    """The plan's summary."""
    code: str
    versions: Mapping[str, str]
    seconds: float
    host: str
    attempts: int
    finished: float
    """Seconds since 1970, by the clock of the host."""

    def packed(self) -> PackedRow:
        """As it stands in the file, to be put there: made by the worker that has the row."""
        return tuple(_packed(name, getattr(self, name)) for name in COLUMNS)


def _packed(name: str, value: Any) -> Any:
    return to_json(value) if name in _JSON and value is not None else value


COLUMNS = tuple(field.name for field in fields(Row))
_JSON = ("overrides", "values", "metrics", "plan", "versions")
_NAMES = ", ".join(f'"{name}"' for name in COLUMNS)
_PLACES = ", ".join("?" * len(COLUMNS))
CODE, ATTEMPTED = COLUMNS.index("code"), COLUMNS.index("attempts")
"""Where they stand in a packed row."""


class Store:
    """The rows and plans in a file that `store_file.open_to_write` or `store_file.open_to_read` has opened.

    Raises InputError, naming the file, where it is damaged, locked, or the disk is full.
    """

    def __init__(self, path: Path, database: sqlite3.Connection) -> None:
        self.path = path
        self._database = database

    def meta(self) -> dict[str, str]:
        """Specification, its digest, versions, and when it was begun."""
        return dict(self._all("SELECT key, value FROM meta"))

    def specification(self) -> dict[str, Any]:
        """What decides the results, as `Specification.as_dict` gave it."""
        return json.loads(self.meta()["specification"])

    def done(self) -> dict[tuple[Any, str], str]:
        """(trial, architecture) → hash of its scenario, of all rows."""
        return {(t, a): h for t, a, h in self._all("SELECT trial, architecture, scenario_hash FROM trials")}

    def counts(self) -> list[tuple[str, str, int]]:
        """(architecture, outcome, number of rows)."""
        return self._all("SELECT architecture, outcome, count(*) FROM trials GROUP BY architecture, outcome")

    def pace(self, last: int = 200) -> tuple[int, float, float]:
        """Of the last rows: how many, over which time [s], and when the last one ended [s since 1970]."""
        query = "SELECT count(*), max(finished) - min(finished), max(finished) FROM"
        rows = self._all(f"{query} (SELECT finished FROM trials ORDER BY finished DESC LIMIT ?)", (last,))
        count, seconds, latest = rows[0]
        return count, seconds or 0.0, latest or 0.0

    def rows(self) -> Iterator[Row]:
        """All rows by trial, then architecture."""
        yield from map(_row, self._each(f"SELECT {_NAMES} FROM trials ORDER BY trial, architecture"))

    def outcome(self, trial: int | str, architecture: str) -> Outcome | None:
        """What became of a flip; None where it is not known."""
        query = f"SELECT {_NAMES} FROM trials WHERE trial = ? AND architecture = ?"
        for row in map(_row, self._all(query, (trial, architecture))):
            return Outcome.from_row(row.metrics, row.failure, row.plan)
        return None

    def plan(self, key: str) -> PackedPlan | None:
        """What is kept under a key; None where nothing is."""
        for plan, error in self._all("SELECT plan, error FROM plans WHERE key = ?", (key,)):
            return plan, error
        return None

    def put_plans(self, plans: Mapping[str, PackedPlan]) -> None:
        """Keep plans, or the reasons why there are none, by their keys; what is there stays."""
        self._insert("INSERT OR IGNORE INTO plans VALUES (?, ?, ?)", [(key, *packed) for key, packed in plans.items()])

    def put(self, rows: Sequence[PackedRow]) -> None:
        """Keep rows, on the disk when this returns."""
        self._insert(f"INSERT INTO trials ({_NAMES}) VALUES ({_PLACES})", rows)

    def _insert(self, query: str, values: Sequence[tuple[Any, ...]]) -> None:
        with errors(self.path), self._database:  # all or nothing, and on the disk when it ends
            self._database.execute("BEGIN IMMEDIATE")
            self._database.executemany(query, values)

    def forget(self, trial: int | str, architecture: str) -> None:
        """Take out a row, of a flip that is flown again."""
        self._all("DELETE FROM trials WHERE trial = ? AND architecture = ?", (trial, architecture))

    def _all(self, query: str, values: tuple[Any, ...] = ()) -> list[Any]:
        return list(self._each(query, values))

    def _each(self, query: str, values: tuple[Any, ...] = ()) -> Iterator[Any]:
        with errors(self.path):
            yield from self._database.execute(query, values)


def _row(values: tuple[Any, ...]) -> Row:
    data = dict(zip(COLUMNS, values, strict=True))
    return Row(**data | {name: None if data[name] is None else json.loads(data[name]) for name in _JSON})


@contextmanager
def errors(path: Path) -> Iterator[None]:
    """What SQLite and the file system say, as an InputError that names the file."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise refusal(path, f"cannot be used: {reason}", "a writable file of this program, or none") from None


def refusal(path: Path, problem: str, valid: str) -> InputError:
    """The error of a file."""
    return InputError(f"'{path}' {problem}; valid is {valid}", field="file", value=str(path), valid=valid)


def to_json(data: Any) -> str:
    """Text that is the same for the same data."""
    return json.dumps(data, sort_keys=True, ensure_ascii=False)
