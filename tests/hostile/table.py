"""A row of the tables of hostile input: what is asked of the command line, in which folder, and how it must end.

Every `test_<kind>.py` beside this file has a list CASES and one test, which calls `check` for each of them.
"""

import faulthandler
import signal
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from patience import loaded

from flipdiagram.cli.main import main

SECONDS = 60
"""That a command may take on a free machine; most take less than one."""


class HungError(BaseException):
    """The command did not end; no `except Exception` on the way catches this."""


@dataclass(frozen=True)
class Case:
    """One row.

    Args:
        name: of the test.
        words: the command line.
        code: the exit code that is expected.
        says: words that stand in the one line on stderr.
        files: {relative name: text, bytes, or a function that makes the file at the path it is given}.
    """

    name: str
    words: list[str]
    code: int
    says: tuple[str, ...] = ()
    files: Mapping[str, str | bytes | Callable[[Path], object]] = field(default_factory=dict)

    def __str__(self):
        return self.name


def make(files, folder):
    """Create the files of a case in a folder."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if callable(content):
            content(path)
        else:
            path.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def patience(seconds):
    """HungError after so long; the process ends where native code does not even let that happen."""

    def give_up(*_):
        raise HungError(f"no end after {seconds:g} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    faulthandler.dump_traceback_later(3 * seconds, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def run(words):
    """Exit code of a command in this process, which ends or raises HungError."""
    with patience(loaded(SECONDS)):
        return main([str(word) for word in words])


def left_in(folder):
    """Names of all that is in a folder, at any depth."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def check(case, tmp_path, monkeypatch, capfd):
    """The command ends with its code; where that is an error: one line on stderr with its words, and no new file."""
    monkeypatch.chdir(tmp_path)
    make(case.files, tmp_path)
    before = left_in(tmp_path)
    code = run(case.words)
    out, err = capfd.readouterr()
    assert code == case.code, err or out
    assert "Traceback" not in out + err
    for words in case.says:
        assert words in err, err
    after = left_in(tmp_path) - before
    assert not [name for name in after if Path(name).name.startswith(".")], "a temporary file is left"
    if code != 0:
        assert err.count("\n") == 1 and err.startswith("flipdiagram: "), err
        assert not after
