"""What a command shows on a terminal: tables, and progress as one moving line; plain lines into files and pipes."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


def console(stderr: bool = False) -> Console:
    """A console on stdout or stderr; rich colours terminals only, and NO_COLOR is respected."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    # into a file or pipe rich would fold tables at 80 columns
    return Console(file=stream, width=None if stream.isatty() else 160)


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


def summary_table(title: str, summary: dict[str, Any]) -> Any:
    """A table of names and values."""
    from rich.table import Table

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return ", ".join(f"{name} {text(item)}" for name, item in value.items())
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    table = Table(title, "value")
    for name, value in summary.items():
        table.add_row(name, text(value))
    return table
