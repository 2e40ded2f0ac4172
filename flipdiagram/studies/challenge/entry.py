"""What enters the challenge: one Python file with a control function, a Drake System, a planner, or all of it."""

import hashlib
import importlib.util
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from functools import lru_cache
from io import TextIOBase
from pathlib import Path
from typing import Any

from flipdiagram.errors import EntryError, FlipdiagramError, InputError, SimulationError, first_line
from flipdiagram.files import read_text
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario

LAWS = ("control", "controller", "plan")
"""Functions of a file by which it enters."""
TEXTS = ("NAME", "AUTHOR", "REFERENCE")
OWN = ("planner", "controller")
"""Sections of the scenario that an entry may set; the others are the world's."""


@dataclass(frozen=True)
class Entry:
    """A file that has been read and run once; what travels to the workers is its path and its digest."""

    path: Path
    digest: str
    """Of its text: results of another text are other results."""
    name: str
    author: str
    reference: str
    architecture: str
    """Which of the paper's controllers flies, where the file has none of its own."""
    settings: Mapping[str, Any]
    """Fields of planner and controller by path."""
    kinds: tuple[str, ...]
    """Those of `LAWS` that it has."""
    laws: Mapping[str, Callable[..., Any]] = field(repr=False, compare=False, default_factory=dict)
    """The functions themselves, and `reset`."""


def load_entry(path: str | Path) -> Entry:
    """Run a file and read what it enters with; raises InputError in one line, with the file's line where it has one."""
    path = Path(path).absolute()
    text = read_text(path, "entry", "a Python file")
    return _loaded(path, hashlib.sha256(text.encode()).hexdigest())


@lru_cache(maxsize=4)
def _loaded(path: Path, digest: str) -> Entry:
    spec = importlib.util.spec_from_file_location(f"flipdiagram_entry_{digest[:16]}", path)
    if spec is None or spec.loader is None:
        raise InputError.of("entry", str(path), "a file whose name ends with .py", f"'{path.name}' is no Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        with watched(path):
            spec.loader.exec_module(module)
    except EntryError as error:
        raise InputError(f"entry {error}", field="entry", value=str(path)) from None
    laws = {name: law for name in (*LAWS, "reset") if callable(law := getattr(module, name, None))}
    known = {name: getattr(module, name, "") for name in TEXTS}
    entry = Entry(
        path,
        digest,
        str(known["NAME"] or path.stem),
        str(known["AUTHOR"]),
        str(known["REFERENCE"]),
        getattr(module, "ARCHITECTURE", "pd+ff+dob"),
        getattr(module, "SETTINGS", {}),
        tuple(name for name in LAWS if name in laws),
        laws,
    )
    return _checked(entry, hasattr(module, "ARCHITECTURE"))


def _checked(entry: Entry, chosen: bool) -> Entry:
    """The entry; chosen: whether it names an architecture."""

    def refusal(problem: str, valid: str, value: Any = None) -> InputError:
        return InputError.of("entry", value, valid, f"entry '{entry.path.name}' {problem}")

    if {"control", "controller"} <= set(entry.kinds):
        raise refusal("has both control and controller", "one of them")
    if entry.architecture not in ARCHITECTURES:
        raise refusal(f"has ARCHITECTURE = {entry.architecture!r}", f"one of {', '.join(ARCHITECTURES)}")
    if not (entry.kinds or entry.settings or chosen):
        valid = (
            "a function control, controller or plan, an ARCHITECTURE or SETTINGS; see flipdiagram challenge --template"
        )
        raise refusal("enters with nothing", valid)
    if not isinstance(entry.settings, Mapping):
        raise refusal(f"has SETTINGS = {entry.settings!r}", "a dict such as {'controller.k_p': 350}")
    for path in entry.settings:
        if str(path).split(".")[0] not in OWN:
            raise refusal(f"sets {path!r}", "fields of planner and controller; the others are the world's", path)
    try:
        Scenario().with_overrides(entry.settings)
    except InputError as error:
        raise refusal(f"has SETTINGS that cannot be: {error}", "fields of planner and controller") from None
    return entry


class _Refusing(TextIOBase):
    """What stands for stdout while an entry runs: the results of a command go there, so nothing else may."""

    def write(self, text: str) -> int:
        raise EntryError(f"writes to stdout: {text.strip()[:60]!r}; valid is stderr")


@contextmanager
def watched(path: Path) -> Iterator[None]:
    """While it lasts writing to stdout is refused, and what the file at `path` raises becomes an EntryError."""
    try:
        with redirect_stdout(_Refusing()):
            yield
    except Exception as error:  # whatever a stranger's code raises
        problem = _problem(error)
        line = _line_in(path, problem)
        ours = isinstance(problem, EntryError)
        if line is None and isinstance(error, FlipdiagramError) and not ours:
            raise  # about something else than the entry
        where = f"'{path.name}'" + (f", line {line}" if line else "")
        said = " ".join(str(problem).split()) if ours else f"{type(problem).__name__}: {first_line(problem)}"
        colon = " " if ours and line else ": "
        raise EntryError(f"{where}{colon}{said}") from None


def _problem(error: BaseException) -> BaseException:
    """What was raised: a simulation that breaks off tells it in its own words."""
    return error.__context__ if isinstance(error, SimulationError) and error.__context__ is not None else error


def _line_in(path: Path, error: BaseException) -> int | None:
    """The line of the file that raised, the innermost one."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return error.lineno
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return lines[-1] if lines else None
