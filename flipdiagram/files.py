"""Files that a user names: of which kind and size they may be.  Files that a run writes: whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import json
import math
import os
import platform
import re
import reprlib
import stat
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flipdiagram.errors import InputError

if TYPE_CHECKING:  # the command line imports this module before it knows whether it needs them
    from pydantic import BaseModel

TEXT_BYTES = 1_000_000
"""What a text that somebody wrote may have: scenario, campaign, model."""
RESULT_BYTES = 1_000_000_000
"""What a file of results may have that is read into memory."""
KINDS = (
    (stat.S_ISDIR, "Is a directory"),
    (stat.S_ISFIFO, "Is a pipe (FIFO)"),
    (stat.S_ISSOCK, "Is a socket"),
    (stat.S_ISCHR, "Is a device"),
    (stat.S_ISBLK, "Is a device"),
)
LEFT = re.compile(r"\..*-([0-9a-f]{8})-([0-9]{1,10})-[0-9a-f]{8}(\.[^.]*)?", re.DOTALL)
"""Names of temporary files: machine, process."""
OWN, WRITING = ".flipdiagram", "writing"
"""In a folder of results: what is known of their files, and in it the list that a run adds to; see `folders`."""
_short = reprlib.Repr()
_short.maxstring = 120

try:
    __version__ = version("flipdiagram")
except PackageNotFoundError:  # run from a checkout that was never installed
    __version__ = "0+unknown"


def cache_folder() -> Path:
    """Where machine code is kept: FLIPDIAGRAM_CACHE_DIR, else flipdiagram/ in the user's cache folder."""
    if chosen := os.environ.get("FLIPDIAGRAM_CACHE_DIR"):
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base) / "flipdiagram"


def check_file(path: str | os.PathLike[str], what: str, valid: str, most: int | None = None) -> Path:
    """The path of a regular file of at most `most` bytes, which a library may open by its name.

    Nothing is opened here: a pipe would wait for ever, a device never end.

    Args:
        path: as the user named it.
        what: words before the name in an error, such as 'scenario file' or 'arm.file ='.
        valid: what would be valid, in words.
        most: bytes that it may have; None: any number.

    Raises InputError, one line, where it is no such file or cannot be read.
    """
    try:
        found = os.stat(path)
        reason = next((text for is_kind, text in KINDS if is_kind(found.st_mode)), None)
        if reason is None and most is not None and found.st_size > most:
            reason = _too_large(found.st_size, most)
        if reason is None and not os.access(path, os.R_OK):
            reason = os.strerror(errno.EACCES)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name, or a name that is no text
        reason = getattr(error, "strerror", None) or str(error)
    if reason is not None:
        raise unreadable(path, what, valid, reason)
    return Path(path)


def read_file(path: str | os.PathLike[str], what: str, valid: str, most: int = TEXT_BYTES) -> bytes:
    """The bytes of a file that `check_file` accepts; arguments and errors are its."""
    try:
        # it may have become a pipe meanwhile, and some files of the system have no size and no end
        with open(os.open(check_file(path, what, valid, most), os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise unreadable(path, what, valid, error.strerror or str(error)) from None
    if len(content) > most:
        raise unreadable(path, what, valid, _too_large(len(content), most))
    return content


def read_text(path: str | os.PathLike[str], what: str, valid: str, most: int = TEXT_BYTES) -> str:
    """The text of a file in UTF-8, line ends as newlines; arguments and errors are those of `check_file`."""
    try:
        text = read_file(path, what, valid, most).decode()
    except UnicodeDecodeError:
        raise unreadable(path, what, valid, "not UTF-8 text") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def unreadable(path: str | os.PathLike[str], what: str, valid: str, reason: str) -> InputError:
    """The error of a file that is not read: 'scenario file 'a.yaml' cannot be read: Is a directory; valid is …'."""
    problem = f"{what} {_short.repr(os.fspath(path))}".strip() + f" cannot be read: {reason}"
    return InputError.of(what.removesuffix(" ="), os.fspath(path), valid, problem)


def _too_large(size: int, most: int) -> str:
    return f"It has {size:,} bytes or more, at most {most:,} are read"


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path to write to, beside `path`; renamed to `path` on success, removed on any failure.

    Keeps the suffix, which Matplotlib and xarray read. Makes the folder. InputError where it cannot write.
    """
    target = Path(path)
    temporary = target.parent / f".{target.stem}-{_here()}-{os.getpid()}-{os.urandom(4).hex()}{target.suffix}"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _clean_once(target.parent.absolute())
        yield temporary
        _list(target.absolute())
        os.replace(temporary, target)
    except OSError as error:
        raise InputError(f"cannot write '{target}': {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # never made, or renamed
            temporary.unlink()


def _list(target: Path) -> None:
    """Add a file to the list of the run that writes into its folder or the one above, before it stands there."""
    for folder in target.parents[:2]:
        if (folder / OWN).is_dir():
            with suppress(FileNotFoundError):  # no run
                handle = os.open(folder / OWN / WRITING, os.O_WRONLY | os.O_APPEND)
                try:
                    os.write(handle, f"{target.relative_to(folder).as_posix()}\n".encode())
                finally:
                    os.close(handle)
            return


def remove_left(folder: Path) -> None:
    """Remove the temporary files that processes of this machine left in a folder when they were killed."""
    with suppress(OSError):
        for name in os.listdir(folder):
            found = LEFT.fullmatch(name)
            if found and found[1] == _here() and not _is_alive(int(found[2])):
                with suppress(OSError):
                    (folder / name).unlink()


_clean_once = cache(remove_left)


@cache
def _here() -> str:
    """The machine and its space of process ids, of which each container has its own."""
    space = ""
    with suppress(OSError):
        space = os.readlink("/proc/self/ns/pid")
    return f"{zlib.crc32(f'{platform.node()} {space}'.encode()):08x}"


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        # one that ended and that nobody asked for its exit code is dead too
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] not in "ZX"
    except ProcessLookupError:
        return False
    except (OSError, OverflowError, ValueError, IndexError):  # another user's, no number of a process, no /proc
        return True


def write_atomically(path: str | os.PathLike[str], content: str | bytes) -> Path:
    """Write a whole file, text in UTF-8; returns its path."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
    return Path(path)


def write_summary(path: str | os.PathLike[str], study: str, scenario: BaseModel, body: Mapping[str, Any]) -> Path:
    """Write `summary.json`: schema, versions and scenario first, then the entries of `body`.

    NumPy arrays and numbers become lists and numbers; nan and infinity, unknown to JSON, become null.
    """
    head = {"schema": f"flipdiagram/{study}/1", "versions": versions(), "scenario": scenario.model_dump(mode="json")}
    twice = head.keys() & body.keys()
    if twice:
        raise ValueError(f"{', '.join(sorted(twice))} stands in the head of a summary already")
    content = plain({**head, **body})
    return write_atomically(path, json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def versions() -> dict[str, str]:
    """Versions of what a result depends on, by name."""
    return {"flipdiagram": __version__, "drake": version("drake"), "python": platform.python_version()}


def check_output_directory(path: str | os.PathLike[str]) -> Path:
    """The folder as a Path if files can be written there, else InputError; leaves nothing behind."""
    folder = Path(path)
    try:
        # trying beats asking: access() says yes to root even on read-only file systems
        with _folder(folder), tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        problem = f"--out = '{folder}' cannot be written: {getattr(error, 'strerror', None) or error}"
        raise InputError.of("--out", folder, "a writable folder", problem) from None
    return folder


@contextmanager
def sole_use(path: str | os.PathLike[str]) -> Iterator[None]:
    """Keep a folder for one run until the `with` block ends, however it ends: two at once would leave files of both.

    Makes the folder; what it made and the run left empty goes again. InputError where another run has the folder.
    """
    folder = Path(path)
    with _folder(folder):
        handle = os.open(folder, os.O_RDONLY)
        try:
            try:  # the system lets go of the lock when the handle is closed or the process ends
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                valid = "another folder, or this one once it has ended"
                raise InputError.of("--out", folder, valid, f"--out = '{folder}' is in use by another run") from None
            except OSError:
                pass  # a file system without locks
            yield
        finally:
            os.close(handle)


@contextmanager
def _folder(folder: Path) -> Iterator[None]:
    """Make a folder; what was made, and is empty when the `with` block ends, goes again."""
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for parent in made:
            with suppress(OSError):  # not empty, or never made
                parent.rmdir()


def plain(value: Any) -> Any:
    """As JSON gives it back: lists and numbers of Python, null for what is no finite number."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # arrays and numbers of NumPy
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
