"""A folder of results holds those of one run, whenever and however that ends.

Beside them stands `.flipdiagram/`: in it `summary.files`, the list of what the last run wrote, and while another one
runs `writing`, to which `files.atomic_path` adds every file of it, and `before/`, where the older files are meanwhile.
"""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from flipdiagram.errors import InputError
from flipdiagram.files import OWN, WRITING, atomic_path, sole_use

BEFORE, GONE = "before", "gone"


@contextmanager
def renewed(path: str | os.PathLike[str], summary: str) -> Iterator[None]:
    """Let a run write into a folder, alone, so that at no time files of two runs stand there, also after kill -9.

    What the run before wrote is set aside, and removed if this one has written anything when it ends; else it comes
    back.  Other people's files stay, and so do stores of flips, in which each says of which scenario it is.

    Args:
        path: the folder; made where there is none.
        summary: name of the run's summary.  Runs with different ones, a campaign and its tuner, live side by side.

    Raises InputError where another run has the folder, or results stand there of which no list tells the files.
    """
    folder = Path(path)
    own = folder / OWN
    listed, before = own / f"{Path(summary).stem}.files", own / BEFORE
    with sole_use(folder):
        names = _names(listed) | _names(own / WRITING)
        if (folder / summary).is_file() and summary not in names:
            problem = f"--out = '{folder}' holds results of an older flipdiagram, which kept no list of its files"
            raise InputError.of("--out", folder, "another folder, or this one without its results", problem)
        try:
            killed = before.is_dir()  # then in it are the files of one run, and in the folder those of another
            before.mkdir(parents=True, exist_ok=True)
            _move(sorted(names, key=lambda name: name != summary), folder, before)
            (own / WRITING).write_bytes(b"")
        except OSError as error:
            raise InputError(f"cannot write '{own}': {error.strerror or error}") from error
        try:
            yield
        finally:
            with suppress(OSError):  # a full disk: the next run finds it as after kill -9
                _settle(folder, own, listed, killed)


def _settle(folder: Path, own: Path, listed: Path, killed: bool) -> None:
    before, written = own / BEFORE, _names(own / WRITING)
    if written:
        shutil.rmtree(own / GONE, ignore_errors=True)
        os.replace(before, own / GONE)  # from here on what stands there is whole
        os.replace(own / WRITING, listed)
        shutil.rmtree(own / GONE, ignore_errors=True)
        return
    (own / WRITING).unlink()
    if not killed:
        # the summary last: it tells that the others are there
        _move(sorted(_names(listed), key=lambda name: name == listed.with_suffix(".json").name), before, folder)
        before.rmdir()
    with suppress(OSError):  # not empty
        own.rmdir()


def bring_back(folder: Path, name: str) -> None:
    """Put a file back that the run before wrote, and that is right in this one too."""
    with atomic_path(folder / name) as temporary:
        os.replace(set_aside(folder, name), temporary)


def set_aside(folder: Path, name: str) -> Path:
    """Where a file of the run before is while another one runs, if there was one."""
    return folder / OWN / BEFORE / name


def _names(file: Path) -> set[str]:
    """What a list names; a file of somebody else's, above or outside the folder, never."""
    try:
        names = file.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return set()
    return {name for name in names if name and not Path(name).is_absolute() and ".." not in Path(name).parts}


def _move(names: list[str], source: Path, target: Path) -> None:
    for name in names:
        if (source / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(source / name, target / name)
            if (source / name).parent != source:
                with suppress(OSError):  # not empty yet
                    (source / name).parent.rmdir()
