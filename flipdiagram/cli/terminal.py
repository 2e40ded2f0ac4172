"""What a command shows on a terminal: tables, and progress as one moving line; plain lines into files and pipes."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from flipdiagram.grid import Grid, console


def show(*parts: Grid | str | None) -> None:
    """Print tables that have rows, and lines of text."""
    for part in parts:
        if isinstance(part, str):
            print(part)
        elif part is not None and part.rows:
            console().print(part.rich())


@contextmanager
def status(quiet: bool) -> Iterator[Callable[[str], Any]]:
    """A context that gives progress(text): one moving line on a terminal, else a line each on stderr."""
    stderr = None if quiet else console(stderr=True)
    if stderr is None:
        yield lambda text: None
    elif not stderr.is_terminal:
        yield lambda text: print(text, file=sys.stderr, flush=True)
    else:
        with stderr.status("") as line:
            yield line.update
