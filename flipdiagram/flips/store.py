"""What is kept of flips, of a campaign's as of a study's: one row each in SQLite, committed when it ends."""

import hashlib
import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

from flipdiagram.errors import InputError
from flipdiagram.flips.outcome import MODES, Outcome
from flipdiagram.flips.row import COLUMNS, LATEST, Campaign, PackedRow, Row, damaged, read_row

STRICT = "STRICT" if sqlite3.sqlite_version_info >= (3, 37) else ""  # RHEL 9 has 3.34
SCHEMA = f"""
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) {STRICT};
CREATE TABLE plans (key TEXT PRIMARY KEY, plan BLOB, error TEXT) {STRICT};
CREATE TABLE trials (
    trial ANY NOT NULL, architecture TEXT NOT NULL, outcome TEXT NOT NULL, failure TEXT, seed INTEGER NOT NULL,
    scenario_hash TEXT NOT NULL, overrides TEXT NOT NULL, "values" TEXT NOT NULL, metrics TEXT, plan TEXT,
    code TEXT NOT NULL, versions TEXT NOT NULL, seconds REAL NOT NULL, host TEXT NOT NULL, attempts INTEGER NOT NULL,
    finished REAL NOT NULL, PRIMARY KEY (trial, architecture)
) WITHOUT ROWID{STRICT and ", STRICT"};
"""

PackedPlan = tuple[bytes | None, str | None]
"""(plan as compressed JSON, None) or (None, why there is none)."""


_NAMES = ", ".join(f'"{name}"' for name in COLUMNS)
_PLACES = ", ".join("?" * len(COLUMNS))


class Store:
    """The rows and plans in a file that `store_file.open_to_write` or `store_file.open_to_read` has opened.

    Raises InputError, naming the file, where it is damaged, locked, or the disk is full.
    """

    def __init__(self, path: Path, database: sqlite3.Connection) -> None:
        self.path = path
        self._database = database

    def meta(self) -> dict[str, str]:
        """Specification, its digest, versions, and when it was begun."""
        meta = self._all("SELECT key, value FROM meta")
        for key, value in meta:
            if not (isinstance(key, str) and isinstance(value, str)):
                raise damaged(self.path, f"table meta, row {key!r}, column value", value, "a text")
        return dict(meta)

    @cached_property
    def specification(self) -> dict[str, Any] | None:
        """What decides the results, as `Specification.as_dict` gave it; None where the file is not of a campaign."""
        meta = self.meta()
        if "specification" not in meta:
            return None
        try:
            data = json.loads(meta["specification"])
        except (ValueError, RecursionError):
            data = None
        if not isinstance(data, dict) or digest_of(data) != meta.get("digest"):
            place = "table meta, row 'specification', column value"
            raise damaged(self.path, place, meta["specification"], "the one whose digest the file keeps")
        return data

    @cached_property
    def campaign(self) -> Campaign | None:
        """What its rows can be; None where the file is not of a campaign."""
        if (of := self.specification) is None:
            return None
        return Campaign(of["trials"], of["architectures"], len(of["vary"]))

    def done(self) -> dict[tuple[Any, str], str]:
        """(trial, architecture) → hash of its scenario, of all rows."""
        return {(row.trial, row.architecture): row.scenario_hash for row in self.rows()}

    def counts(self) -> list[tuple[str, str, int]]:
        """(architecture, outcome, number of rows)."""
        counts = self._all("SELECT architecture, outcome, count(*) FROM trials GROUP BY architecture, outcome")
        for architecture, outcome, _ in counts:
            if self.campaign and architecture not in self.campaign.architectures:
                names = self.campaign.architectures
                raise damaged(self.path, "table trials, column architecture", architecture, names)
            if outcome not in MODES:
                raise damaged(self.path, "table trials, column outcome", outcome, MODES)
        return counts

    def pace(self, last: int = 200) -> tuple[int, float, float]:
        """Of the last rows: how many, over which time [s], and when the last one ended [s since 1970]."""
        query = "SELECT finished FROM trials ORDER BY finished DESC LIMIT ?"
        times = [time for (time,) in self._all(query, (last,))]
        for time in times:
            if not (isinstance(time, float) and 0 <= time <= LATEST):
                raise damaged(self.path, "table trials, column finished", time, f"a number from 0 to {LATEST:g}")
        return len(times), times[0] - times[-1] if times else 0.0, times[0] if times else 0.0

    def check_whole(self) -> None:
        """InputError where SQLite finds the file damaged."""
        ((verdict, *_),) = self._all("PRAGMA quick_check(1)")
        if verdict != "ok":
            valid = "a whole file; `flipdiagram campaign --export FILE TO --salvage` takes what is sound"
            raise refusal(self.path, f"is damaged: {' '.join(str(verdict).split())}", valid)

    def rows(self) -> Iterator[Row]:
        """All rows by trial, then architecture."""
        self.check_whole()
        before = None
        for cells in self._each(f"SELECT {_NAMES} FROM trials ORDER BY trial, architecture"):
            row = read_row(self.path, cells, self.campaign)
            if before == (row.trial, row.architecture):
                raise damaged(self.path, "table trials, columns trial and architecture", before, "one row for each")
            before = row.trial, row.architecture
            yield row

    def sound_rows(self, lost: list[str]) -> Iterator[Row]:
        """Those of a damaged file of a campaign that can be read and are as they should be; what the others say."""
        if self.campaign is None:
            return
        for trial in range(self.campaign.trials):
            for name in self.campaign.architectures:  # each by its key: one that cannot be read does not end the list
                try:
                    yield from (read_row(self.path, cells, self.campaign) for cells in self._cells(trial, name))
                except InputError as error:
                    lost.append(str(error))

    def outcome(self, trial: int | str, architecture: str) -> Outcome | None:
        """What became of a flip; None where it is not known."""
        for cells in self._cells(trial, architecture):
            row = read_row(self.path, cells)
            try:
                return Outcome.from_row(row.metrics, row.failure, row.plan)
            except TypeError:
                place = f"table trials, row {trial!r}, column metrics"
                raise damaged(self.path, place, row.metrics, "what this version measures") from None
        return None

    def plan(self, key: str) -> PackedPlan | None:
        """What is kept under a key; None where nothing is."""
        for plan, error in self._all("SELECT plan, error FROM plans WHERE key = ?", (key,)):
            try:
                kept = error if plan is None else zlib.decompress(plan).decode()
            except (TypeError, ValueError, zlib.error):
                kept = None
            if not isinstance(kept, str):
                place = f"table plans, row {key[:12]!r}, column {'error' if plan is None else 'plan'}"
                raise damaged(self.path, place, error if plan is None else plan, "what a planner wrote")
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

    def _cells(self, trial: int | str, architecture: str) -> list[PackedRow]:
        query = f"SELECT {_NAMES} FROM trials WHERE trial = ? AND architecture = ?"
        return self._all(query, (trial, architecture))

    def _all(self, query: str, values: tuple[Any, ...] = ()) -> list[Any]:
        return list(self._each(query, values))

    def _each(self, query: str, values: tuple[Any, ...] = ()) -> Iterator[Any]:
        with errors(self.path):
            yield from self._database.execute(query, values)


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


def digest_of(specification: Mapping[str, Any]) -> str:
    """Name of what a file is for: changes with anything in it, not with the order of keys."""
    return hashlib.sha256(json.dumps(specification, sort_keys=True).encode()).hexdigest()
