"""A table of texts that can be shown on a terminal and written as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

GOOD, BAD = "yes", "no"


def verdict(holds: bool | None) -> str:
    """'yes', 'no', or 'not judged' for None."""
    return "not judged" if holds is None else GOOD if holds else BAD


@dataclass(frozen=True)
class Grid:
    """Headings and rows of texts; columns whose heading is in `right` are set flush right."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""
    right: Sequence[str] = ()

    def rich(self) -> Any:
        """The table for a terminal; a cell that says yes or no, or 'turned over', is coloured."""
        from rich.markup import escape
        from rich.table import Table

        table = Table(title=escape(self.title) if self.title else None, title_justify="left")
        for heading in self.headings:
            table.add_column(heading, justify="right" if heading in self.right else "left")
        for row in self.rows:
            table.add_row(*(_coloured(escape(cell.replace("**", "").replace("`", ""))) for cell in row))
        return table

    def markdown(self) -> str:
        """The table as Markdown, ending with a newline."""
        lines = [list(self.headings), ["---:" if heading in self.right else "---" for heading in self.headings]]
        lines += [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in self.rows]
        return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _coloured(cell: str) -> str:
    if cell in (GOOD, "turned over"):
        return f"[green]{cell}[/]"
    return f"[red]{cell}[/]" if cell == BAD else cell
