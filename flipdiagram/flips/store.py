"""Where finished flips are kept: one SQLite file, each entry committed as it comes."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flipdiagram.errors import InputError

VERSION = 1
SCHEMA = """
CREATE TABLE IF NOT EXISTS plans (key TEXT PRIMARY KEY, plan TEXT, error TEXT);
CREATE TABLE IF NOT EXISTS flips (
    key TEXT PRIMARY KEY, architecture TEXT NOT NULL, scenario TEXT NOT NULL, outcome TEXT NOT NULL, seconds REAL
);
"""
PATIENCE = 30.0
"""Seconds to wait for another process that writes the same file."""


class Store:
    """Plans and outcomes by key.  Use it in a `with` block.

    Raises InputError, naming the file, where it is damaged, of a newer version, locked, or the disk is full.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._errors():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._database = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
            try:
                self._open_patiently()
            except BaseException:
                self._database.close()
                raise

    def _open_patiently(self) -> None:
        # SQLite's own timeout does not cover the change to WAL, which two processes may begin at once
        until = time.monotonic() + PATIENCE
        while True:
            try:
                return self._open()
            except sqlite3.OperationalError as error:
                if "locked" not in str(error) or time.monotonic() > until:
                    raise
                time.sleep(0.02)

    def _open(self) -> None:
        (version,) = self._database.execute("PRAGMA user_version").fetchone()
        if version > VERSION:
            raise InputError(
                f"'{self.path}' is of version {version}, newer than this program; valid is at most {VERSION}"
            )
        # a writer that is killed leaves the last committed entry, and readers do not wait for it
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.executescript(SCHEMA)
        self._database.execute(f"PRAGMA user_version = {VERSION}")

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *exception: object) -> None:
        self._database.close()

    def plan(self, key: str) -> tuple[str | None, str | None] | None:
        """(plan as JSON, None) or (None, why there is none); None where it is not known."""
        with self._errors():
            return self._database.execute("SELECT plan, error FROM plans WHERE key = ?", (key,)).fetchone()

    def put_plan(self, key: str, plan: str | None, error: str | None) -> None:
        """Keep a plan or the reason why there is none."""
        with self._errors():
            self._database.execute("INSERT OR REPLACE INTO plans VALUES (?, ?, ?)", (key, plan, error))

    def outcome(self, key: str) -> str | None:
        """The outcome as JSON; None where it is not known."""
        with self._errors():
            row = self._database.execute("SELECT outcome FROM flips WHERE key = ?", (key,)).fetchone()
        return None if row is None else row[0]

    def put_outcome(self, key: str, architecture: str, scenario: str, outcome: str, seconds: float) -> None:
        """Keep the outcome of a flip."""
        row = (key, architecture, scenario, outcome, seconds)
        with self._errors():
            self._database.execute("INSERT OR REPLACE INTO flips VALUES (?, ?, ?, ?, ?)", row)

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            message = f"'{self.path}' cannot be used: {error}; valid is a writable file of this program, or none"
            raise InputError(message) from None
