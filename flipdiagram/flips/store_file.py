"""The file of stored flips: written by one process at a time, read by any, whole after kill -9.

Version 1 was of campaigns alone, and is read; flips of studies stood in a file of another kind, which is refused.
"""

import fcntl
import os
import platform
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from flipdiagram.flips.store import SCHEMA, Store, errors, refusal

VERSION = 2
APPLICATION = 0x666C6970  # "flip", in the header of the file
PATIENCE = 30.0
"""Seconds to wait for a reader that holds the file."""


@contextmanager
def open_to_write(path: Path, meta: Mapping[str, str], resume: bool = True) -> Iterator[Store]:
    """A new file, or, to resume, the one begun; no other process may write it meanwhile.

    meta: kept in a new file; its `digest`, the name of what the file is for, must be that of one begun.
    """
    with ExitStack() as stack:
        with errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            stack.enter_context(_sole_writer(path))
            if path.exists() and path.stat().st_size > 0:
                _check_header(path)
            database = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
            stack.callback(database.close)
            store = Store(path, database)
            empty = database.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
            if not empty:
                _check_version(path, database)
                _check_whole(database)
                _check_same(store, meta, resume)
            # a writer that is killed leaves every committed row, and readers do not wait for it
            database.execute("PRAGMA journal_mode = WAL")
            stack.callback(_make_one_file, database)
            database.execute("PRAGMA synchronous = FULL")
            if empty:
                with database:
                    _create(database, meta)
        yield store


@contextmanager
def open_to_read(path: str | Path) -> Iterator[Store]:
    """The file of a campaign, also while it runs."""
    path = Path(path)
    if not path.is_file():
        raise refusal(path, "is no file", "the campaign.sqlite of a campaign")
    with errors(path), ExitStack() as stack:
        _check_header(path)
        database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", timeout=PATIENCE, uri=True)
        stack.callback(database.close)
        _check_version(path, database)
        store = Store(path, database)
        if "specification" not in store.meta():
            raise refusal(path, "holds flips, but not of a campaign", "a campaign.sqlite")
        yield store


def is_running(path: Path) -> bool:
    """Whether a process writes the file now."""
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


def _create(database: sqlite3.Connection, meta: Mapping[str, str]) -> None:
    database.execute("BEGIN IMMEDIATE")
    for statement in SCHEMA.split(";"):
        database.execute(statement)
    database.executemany("INSERT INTO meta VALUES (?, ?)", meta.items())
    database.execute(f"PRAGMA application_id = {APPLICATION}")
    database.execute(f"PRAGMA user_version = {VERSION}")


def _check_same(store: Store, meta: Mapping[str, str], resume: bool) -> None:
    if store.meta().get("digest") != meta["digest"]:
        raise refusal(store.path, "holds another campaign", "the same specification, or another --out")
    if not resume:
        problem = f"holds {len(store.done())} of {meta['rows']} flips of this campaign"
        raise refusal(store.path, problem, "--resume to go on, or another --out")


def _check_header(path: Path) -> None:
    # SQLite itself would make a new database of some files that are none
    with open(path, "rb") as file:
        if file.read(16) != b"SQLite format 3\0":
            raise sqlite3.DatabaseError("file is not a database")


def _check_version(path: Path, database: sqlite3.Connection) -> None:
    (application,) = database.execute("PRAGMA application_id").fetchone()
    (version,) = database.execute("PRAGMA user_version").fetchone()
    (flips,) = database.execute("SELECT count(*) FROM sqlite_master WHERE name = 'flips'").fetchone()
    if application == 0 and version == 1 and flips:
        problem = "is of version 1, written by a flipdiagram in which studies kept their flips in another way"
        raise refusal(path, problem, f"version {VERSION}: remove it, or another --out, as its flips are flown again")
    if application != APPLICATION:
        raise refusal(path, "is a database, but not of a campaign or study", "a file of this program")
    if version > VERSION:
        raise refusal(path, f"is of version {version}, newer than this program", f"at most {VERSION}")


def _check_whole(database: sqlite3.Connection) -> None:
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
            raise refusal(path, f"is written by {holder} now", "to wait for it, or another --out") from None
        lock.seek(0)
        lock.truncate()
        lock.write(f"process {os.getpid()} on {platform.node()}")
        lock.flush()
        yield
