"""A table of texts that can be shown on a terminal and written as Markdown."""

from __future__ import annotations

import html
import math
import re
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

GOOD, BAD = "yes", "no"
UNITS = ("m/s2", "rad/s2", "m/s", "rad/s", "N m", "rad", "m", "s", "N", "kg")
"""Units that end the name of a number, such as `_rad_s2`; longest first.  J in `cost_J` is the paper's cost."""


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


def unit_of(name: str) -> str:
    """Unit of an entry of summary.json by the end of its name ('position_rmse_m'); '1' where it says none."""
    return next((unit for unit in UNITS if name.endswith(_ending(unit))), "1")


def _ending(unit: str) -> str:
    return "_" + unit.replace(" ", "").replace("/", "_")


def labelled(name: str, value: Any) -> tuple[str, str]:
    """An entry of summary.json in words: ('release_time_s', 0.4) as ('release time', '0.4 s')."""
    unit, text = unit_of(name), number(value)
    if unit == "1" or text == "–":
        return name.removesuffix(_ending(unit)).replace("_", " "), text
    return name.removesuffix(_ending(unit)).replace("_", " "), f"{text} {unit.replace('2', '²')}"


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
    keys: int = 1
    """Leading columns that tell the rows apart: they stand in each of the tables into which a terminal parts it."""

    def rich(self) -> Any:
        """The table for a terminal: where its columns do not fit side by side, some stand in tables below the first."""
        return _Fitted(self)

    def _folds(self, column: int) -> bool:
        """Whether the texts of a column are sentences."""
        heading, cells = self.headings[column], [row[column] for row in self.rows]
        named = heading in (*self.right, *self.centred, *self.whole)
        return not named and any(len(cell) > LEAST for cell in cells)

    def _coloured(self, cell: str, markup: str) -> str:
        colour = "green" if cell in self.good else "red" if cell in self.bad else ""
        return f"[{colour}]{markup}[/]" if colour else markup

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
        plain = _plain(text)
        colour = "; color: #00734f" if plain in self.good else "; color: #b34700" if plain in self.bad else ""
        side = "right" if heading in self.right else "left"
        return f'<td style="text-align: {side}{colour}">{html.escape(plain)}</td>'

    def records(self) -> list[dict[str, str]]:
        """Its rows as {heading: text}, for JSON."""
        names = [_plain(heading.replace("\n", " ")) for heading in self.headings]
        return [dict(zip(names, map(_plain, row), strict=True)) for row in self.rows]

    def section(self) -> str:
        """Title and table as Markdown; '' without rows."""
        return ((f"{self.title}:\n\n" if self.title else "") + self.markdown()) if self.rows else ""


LEAST, LONGEST = 22, 30
"""Characters to which a column of sentences may be narrowed, one of numbers or names never is; and of a word that stays
whole in it, if it is no key."""
_WORD = re.compile(r"\[[^\]]*\]\S*|[^\s\d]*\d\S* (?:N m|[mr]ad/s²?|[kcm]?m/s²?|[cm]?m|m?s|rad|N|k?g|%|°)(?!\w)\S*|\S+")
EDGE = 3
"""Characters that a column costs beside its text; one more closes the table."""


@dataclass(frozen=True)
class _Column:
    """A column on a terminal: its texts, and the widths between which it may be set."""

    heading: str
    cells: list[str]
    folds: bool
    key: bool

    @property
    def least(self) -> int:
        """Width below which a word, a number or a unit would be broken."""
        heading = max(map(len, _tokens(self.heading)), default=0)
        if not self.folds:
            return max(heading, self._cells)
        words = max((len(word) for cell in self.cells for word in _tokens(cell)), default=0)
        return max(heading, words if self.key else min(words, LONGEST), min(LEAST, self._cells))

    @property
    def most(self) -> int:
        """Width at which nothing is folded."""
        return max(self._cells, *map(len, self.heading.split("\n")))

    @property
    def _cells(self) -> int:
        return max((len(line) for cell in self.cells for line in cell.split("\n")), default=0)


class _Fitted:
    """A grid as rich prints it: widths are ours, as rich would break numbers."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid

    def __rich_console__(self, console: Console, options: Any) -> Any:
        from rich.markup import escape
        from rich.table import Table

        grid = self._grid
        if grid.title:
            yield f"[italic]{escape(_wrapped(grid.title, options.max_width))}[/]"
        columns = [
            _Column(_plain(heading), [_plain(row[k]) for row in grid.rows], grid._folds(k), k < grid.keys)
            for k, heading in enumerate(grid.headings)
        ]
        for chosen in _parts(columns, grid.keys, options.max_width):
            table = Table()
            widths = _widths(columns, chosen, options.max_width)
            for k, width in widths.items():
                name = grid.headings[k]
                justify: Any = "right" if name in grid.right else "center" if name in grid.centred else "left"
                heading = escape(_wrapped(columns[k].heading, width))
                table.add_column(heading, justify=justify, width=width, overflow="fold")
            for k in range(len(grid.rows)):
                texts = {c: columns[c].cells[k] for c in chosen}
                table.add_row(*(grid._coloured(text, escape(_wrapped(text, widths[c]))) for c, text in texts.items()))
            yield table


def _parts(columns: Sequence[_Column], keys: int, width: int) -> list[list[int]]:
    """Columns that stand side by side, the leading ones in each part, in their order."""
    head = list(range(min(keys, len(columns))))
    parts, room = [list(head)], 0
    for k in range(len(head), len(columns)):
        room = width - 1 - sum(columns[c].least + EDGE for c in parts[-1])
        if columns[k].least + EDGE > room and len(parts[-1]) > len(head):
            parts.append(list(head))
        parts[-1].append(k)
    return parts


def _widths(columns: Sequence[_Column], chosen: Sequence[int], width: int) -> dict[int, int]:
    """The width of each of the chosen columns: the least, and what is left over by what each could use."""
    widths = {k: columns[k].least for k in chosen}
    spare = width - 1 - sum(widths.values()) - EDGE * len(chosen)
    wanted = {k: columns[k].most - columns[k].least for k in chosen}
    for done, k in enumerate(sorted(chosen, key=wanted.__getitem__)):
        more = min(wanted[k], max(spare, 0) // (len(chosen) - done))
        widths[k] += more
        spare -= more
    return widths


def _plain(text: str) -> str:
    """Without the marks of Markdown."""
    return text.replace("**", "").replace("`", "")


def _tokens(text: str) -> list[str]:
    """Its words; a unit in brackets is one, and so is a number with its unit."""
    return [word[0] for word in _WORD.finditer(text)]


def _wrapped(text: str, width: int) -> str:
    """In lines of at most a width, as they stand where they fit."""
    if max(map(len, text.split("\n"))) <= width:
        return text
    lines = [""]
    for token in _tokens(text):
        if lines[-1] and len(lines[-1]) + 1 + len(token) > width:
            lines.append(token)
        else:
            lines[-1] = f"{lines[-1]} {token}".strip()
    return "\n".join(lines)
