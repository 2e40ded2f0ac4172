"""What a command shows on a terminal: tables, and progress as one moving line; plain lines into files and pipes."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from flipdiagram.grid import Grid, console

if TYPE_CHECKING:
    from rich.console import Console


def show(*parts: Grid | str | None) -> None:
    """Print tables that have rows, and lines of text."""
    for part in parts:
        if isinstance(part, str):
            print(part)
        elif part is not None and part.rows:
            console().print(part.rich())


def status(quiet: bool) -> Any:
    """A context that gives progress(text): one moving line on a terminal, else a line each on stderr."""
    if quiet:
        return nullcontext(lambda text: None)
    stderr = console(stderr=True)
    if not stderr.is_terminal:
        return nullcontext(lambda text: print(text, file=sys.stderr, flush=True))
    return _Spinner(stderr)


class _Spinner:
    """Progress as one line that moves and vanishes."""

    def __init__(self, stderr: Console) -> None:
        self.status = stderr.status("")

    def __enter__(self) -> Any:
        self.status.start()
        return self.status.update

    def __exit__(self, *exception: object) -> None:
        self.status.stop()
