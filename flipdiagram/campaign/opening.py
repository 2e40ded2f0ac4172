"""The file of a campaign: begun or gone on with by one process at a time, read by any; never one of something else."""

from __future__ import annotations

import fcntl
import os
import platform
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from flipdiagram.campaign.results import SCHEMA, Results, errors, to_json, transaction
from flipdiagram.campaign.specification import Specification
from flipdiagram.errors import InputError

VERSION = 1
APPLICATION = 0x666C6970  # "flip", in the header of the file
PATIENCE = 30.0
"""Seconds to wait for a reader that holds the file."""


@contextmanager
def begun(path: Path, specification: Specification, meta: Mapping[str, str], resume: bool) -> Iterator[Results]:
    """A new file for a campaign, or, to resume, the one begun; no other process may write it meanwhile."""
    with ExitStack() as stack:
        with errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            stack.enter_context(_sole_writer(path))
            fresh = not path.exists() or path.stat().st_size == 0
            if not fresh:
                _check_header(path)
            database = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
            stack.callback(database.close)
            results = Results(path, database)
            empty = database.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
            if not empty:
                _check_version(path, database)
                _check_whole(path, database)
                _check_same(results, specification, resume)
            # a writer that is killed leaves every committed row, and readers do not wait for it
            database.execute("PRAGMA journal_mode = WAL")
            stack.callback(_make_one_file, database)
            database.execute("PRAGMA synchronous = FULL")
            if empty:
                with transaction(database):
                    _create(database, specification, meta)
        yield results


@contextmanager
def opened(path: str | Path) -> Iterator[Results]:
    """The file of a campaign, to read, also while it runs."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"'{path}' is no file; valid is the campaign.sqlite of a campaign")
    with errors(path), ExitStack() as stack:
        _check_header(path)
        database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", timeout=PATIENCE, uri=True)
        stack.callback(database.close)
        _check_version(path, database)
        yield Results(path, database)


def is_running(path: Path) -> bool:
    """Whether a process writes the file of a campaign now."""
    try:
        with open(_lock_path(path), "rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return False
    except BlockingIOError:
        return True
    except OSError:
        return False


def _make_one_file(database: sqlite3.Connection) -> None:
    """Without a log beside it a file can be copied, and read where nothing can be written."""
    with suppress(sqlite3.Error):  # somebody reads it: the log stays, and is part of the file
        database.execute("PRAGMA busy_timeout = 500")
        database.execute("PRAGMA journal_mode = DELETE")


def _create(database: sqlite3.Connection, specification: Specification, meta: Mapping[str, str]) -> None:
    for statement in SCHEMA.split(";"):
        database.execute(statement)
    entries = {
        "specification": to_json(specification.as_dict()),
        "digest": specification.digest,
        "text": specification.text,
        "rows": str(specification.rows),
        **meta,
    }
    database.executemany("INSERT INTO meta VALUES (?, ?)", entries.items())
    database.execute(f"PRAGMA application_id = {APPLICATION}")
    database.execute(f"PRAGMA user_version = {VERSION}")


def _check_same(results: Results, specification: Specification, resume: bool) -> None:
    meta = results.meta()
    held = f"'{results.path}' holds"
    if meta.get("digest") != specification.digest:
        raise InputError(f"{held} another campaign; valid is the same specification, or another --out")
    if not resume:
        rows = len(results.done())
        held = f"{held} {rows} of {specification.rows} flips of this campaign"
        raise InputError(f"{held}; valid is --resume to go on, or another --out")


def _check_header(path: Path) -> None:
    # SQLite itself would make a new database of some files that are none
    with open(path, "rb") as file:
        if file.read(16) != b"SQLite format 3\0":
            raise sqlite3.DatabaseError("file is not a database")


def _check_version(path: Path, database: sqlite3.Connection) -> None:
    (application,) = database.execute("PRAGMA application_id").fetchone()
    (version,) = database.execute("PRAGMA user_version").fetchone()
    if application != APPLICATION:
        raise InputError(f"'{path}' is a database, but not of a campaign; valid is a campaign.sqlite")
    if version > VERSION:
        raise InputError(f"'{path}' is of version {version}, newer than this program; valid is at most {VERSION}")


def _check_whole(path: Path, database: sqlite3.Connection) -> None:
    (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
    if verdict != "ok":
        raise sqlite3.DatabaseError(f"it is damaged: {' '.join(verdict.split())}")


def _lock_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.lock")


@contextmanager
def _sole_writer(path: Path) -> Iterator[None]:
    """The kernel drops the lock with the process, however it ends; the file that carries it stays."""
    lock: IO[str]
    with open(_lock_path(path), "a+", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            holder = lock.read().strip() or "another process"
            raise InputError(
                f"'{path}' is written by {holder} now; valid is to wait for it, or another --out"
            ) from None
        lock.seek(0)
        lock.truncate()
        lock.write(f"process {os.getpid()} on {platform.node()}")
        lock.flush()
        yield
