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

from flipdiagram.errors import InputError
from flipdiagram.files import check_file
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
            empty = _check(path, meta, resume)
            database = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
            stack.callback(database.close)
            # a writer that is killed leaves every committed row, and readers do not wait for it
            database.execute("PRAGMA journal_mode = WAL")
            stack.callback(_make_one_file, database)
            database.execute("PRAGMA synchronous = FULL")
            if empty:
                with database:
                    _create(database, meta)
        yield Store(path, database)


@contextmanager
def open_to_read(path: str | Path) -> Iterator[Store]:
    """The file of a campaign, also while it runs."""
    path = check_file(path, "", "the campaign.sqlite of a campaign")
    with _reading(path) as database:
        _check_version(path, database)
        store = Store(path, database)
        if store.specification is None:
            raise refusal(store.path, "holds flips, but not of a campaign", "a campaign.sqlite")
        yield store


@contextmanager
def _reading(path: Path) -> Iterator[sqlite3.Connection]:
    """A database that nothing here can change."""
    with errors(path), ExitStack() as stack:
        _check_kinds(path)
        database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", timeout=PATIENCE, uri=True)
        stack.callback(database.close)
        yield database


def _check(path: Path, meta: Mapping[str, str], resume: bool) -> bool:
    """InputError unless the file is one to go on with; whether there is none, or an empty one."""
    if not os.path.lexists(path):
        return True
    if check_file(path, "", "a file of this program, or none").stat().st_size == 0:
        return True
    with _reading(path) as database:
        if database.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
            return True
        _check_version(path, database)
        store = Store(path, database)
        if store.meta().get("digest") != meta["digest"]:
            raise refusal(path, "holds another campaign", "the same specification, or another --out")
        done = store.done()  # each row is checked
        if not resume:
            problem = f"holds {len(done)} of {meta['rows']} flips of this campaign"
            raise refusal(path, problem, "--resume to go on, or another --out")
    return False


def is_running(path: Path) -> bool:
    """Whether a process writes the file now."""
    try:
        if not _lock_path(path).is_file():
            return False
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


def _check_kinds(path: Path) -> None:
    """SQLite would wait for a pipe beside the file, and make a new database of some files that are none."""
    for beside in ("-wal", "-shm", "-journal"):
        if os.path.lexists(name := f"{path}{beside}"):
            check_file(name, "", "a file that SQLite wrote, or none")
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
    (others,) = database.execute("SELECT count(*) FROM sqlite_master WHERE type IN ('view', 'trigger')").fetchone()
    if application != APPLICATION or others:
        raise refusal(path, "is a database, but not of a campaign or study", "a file of this program")
    if version > VERSION:
        raise refusal(path, f"is of version {version}, newer than this program", f"at most {VERSION}")


def _lock_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.lock")


@contextmanager
def _sole_writer(path: Path) -> Iterator[None]:
    """The kernel drops the lock with the process, however it ends; its file stays, save beside one that is refused."""
    name = _lock_path(path)
    if there := os.path.lexists(name):
        check_file(name, "", "the lock of a run, or none")
    with open(name, "a+", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not os.path.samestat(os.fstat(lock.fileno()), os.stat(name)):
                raise FileNotFoundError  # another process has just taken it away
        except (BlockingIOError, FileNotFoundError):
            lock.seek(0)
            holder = lock.read(200).strip() or "another process"
            raise refusal(path, f"is written by {holder} now", "to wait for it, or another --out") from None
        lock.seek(0)
        lock.truncate()
        lock.write(f"process {os.getpid()} on {platform.node()}")
        lock.flush()
        try:
            yield
        except InputError:
            if not there:
                name.unlink(missing_ok=True)
            raise
