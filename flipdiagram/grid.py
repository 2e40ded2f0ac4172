"""A table of texts that can be shown on a terminal and written as Markdown."""

from __future__ import annotations

import html
import math
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

GOOD, BAD = "yes", "no"


def verdict(holds: bool | None) -> str:
    """'yes', 'no', or 'not judged' for None."""
    return "not judged" if holds is None else GOOD if holds else BAD


def number(value: Any) -> str:
    """A value of a result as short text."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {number(item)}" for key, item in value.items())
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(number, value)) + "]"
    if type(value).__name__ in ("bool", "bool_"):  # NumPy's is no Python bool
        return GOOD if value else BAD
    return f"{value:.4g}" if isinstance(value, Real) and not isinstance(value, Integral) else str(value)


def console(stderr: bool = False) -> Console:
    """A console on stdout or stderr; rich colours terminals only, and NO_COLOR is respected."""
    from rich.console import Console

    class Pipe(Console):
        def on_broken_pipe(self) -> None:
            raise

    stream = sys.stderr if stderr else sys.stdout
    # into a file or pipe rich would fold tables at 80 columns
    return Pipe(file=stream, width=None if stream.isatty() else 160)


@dataclass(frozen=True)
class Grid:
    """Headings and rows of texts; columns whose heading is in `right` are set flush right."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""
    right: Sequence[str] = ()
    centred: Sequence[str] = ()
    whole: Sequence[str] = ()
    """Headings of columns whose texts a terminal does not fold."""
    good: Collection[str] = (GOOD, "turned over")
    bad: Collection[str] = (BAD,)
    """Texts that a terminal shows in green and in red."""

    def rich(self) -> Any:
        """The table for a terminal."""
        from rich.markup import escape
        from rich.table import Table

        table = Table(title=escape(self.title) if self.title else None, title_justify="left")
        for heading in self.headings:
            justify: Any = "right" if heading in self.right else "center" if heading in self.centred else "left"
            table.add_column(escape(heading), justify=justify, no_wrap=heading in self.whole)
        for row in self.rows:
            table.add_row(*(self._coloured(escape(cell.replace("**", "").replace("`", ""))) for cell in row))
        return table

    def _coloured(self, cell: str) -> str:
        colour = "green" if cell in self.good else "red" if cell in self.bad else ""
        return f"[{colour}]{cell}[/]" if colour else cell

    def markdown(self) -> str:
        """The table as Markdown, ending with a newline."""
        head, rule = list(self.headings), ["---:" if heading in self.right else "---" for heading in self.headings]
        head, *rows = ([cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in (head, *self.rows))
        lines = [head, rule, *rows]
        return "".join("| " + " | ".join(line) + " |\n" for line in lines)

    def html(self) -> str:
        """The table as HTML for a notebook, the title above; a long one scrolls in a box."""
        rows = "".join(f"<tr>{''.join(map(self._cell, row, self.headings))}</tr>" for row in self.rows)
        head = "".join(map(self._cell, self.headings, self.headings))
        table = f'<table><thead style="font-weight: bold"><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
        box = f'<div style="max-height: 20em; overflow: auto">{table}</div>'
        return f"<div><b>{html.escape(self.title)}</b>{box}</div>" if self.title else box

    def _cell(self, text: str, heading: str) -> str:
        plain = text.replace("**", "").replace("`", "")
        colour = "; color: #00734f" if plain in self.good else "; color: #b34700" if plain in self.bad else ""
        side = "right" if heading in self.right else "left"
        return f'<td style="text-align: {side}{colour}">{html.escape(plain)}</td>'

    def section(self) -> str:
        """Title and table as Markdown; '' without rows."""
        return ((f"{self.title}:\n\n" if self.title else "") + self.markdown()) if self.rows else ""
