"""Sections as tables: for a terminal, as Markdown, and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import Console, Group
from rich.markup import escape
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from bench.results import Measurement, Section

WIDTH = 110
HEADINGS = ("median", "min", "max", "share", "target", "verdict")
SCALES = {
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")),
    "B": ((1e6, "MB"),),
    "x": ((1.0, "×"),),
    "1/s": ((1e6, "M/s"), (1e3, "k/s"), (1.0, "/s")),
}


def quantity(value: float, unit: str, like: float | None = None) -> str:
    """A value with three digits and the unit that suits it, or the value `like`."""
    sizes = SCALES[unit]
    scale, symbol = next((s for s in sizes if abs(value if like is None else like) >= s[0]), sizes[-1])
    digits = 0 if abs(value) >= 100 * scale else 1 if abs(value) >= 10 * scale else 2
    return f"{value / scale:.{digits}f} {symbol}"


def rows(section: Section) -> Iterable[tuple[Measurement, list[str]]]:
    """Each measurement with its cells, in the order of `HEADINGS`."""
    whole = section.whole.median if section.whole else None
    for m in section.measurements:
        spread = [quantity(value, m.unit, m.median) for value in (m.median, min(m.values), max(m.values))]
        share = f"{100 * m.median / whole:.0f} %" if whole and (m is section.whole or m.indent) else ""
        target = f"{m.target.relation} {quantity(m.target.value, m.unit)}" if m.target else ""
        yield m, [*spread, share, target, m.verdict or ""]


def to_terminal(console: Console, section: Section) -> None:
    """Print a section."""
    counts = {len(m.values) for m in section.measurements}
    table = Table(show_edge=False, pad_edge=False, box=None, header_style="dim", padding=(0, 2, 0, 0))
    table.add_column(f"median of {', '.join(map(str, sorted(counts)))}", min_width=40)
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "verdict" else "right", no_wrap=True)
    for m, cells in rows(section):
        colour = {"met": "green", "missed": "bold red"}.get(m.verdict or "", "")
        verdict = Text(cells[-1], style=colour)
        name = Text("  " * m.indent + m.name, style="dim" if m.indent > 1 else "")
        table.add_row(name, *cells[:-1], verdict)
    notes = [Text(f"✓ {note}" if "NOT" not in note else f"! {note}", style="dim") for note in section.checks]
    console.rule(f"[bold]{escape(section.title)}", align="left", style="dim")
    console.print(Padding(Group(Text(section.text, style="dim"), "", table, "", *notes), (0, 0, 1, 2)))


def verdicts(sections: Iterable[Section]) -> Table:
    """All targets in one table."""
    table = Table(title="targets", title_justify="left", title_style="bold")
    for heading in ("", "measured", "target", "verdict"):
        table.add_column(heading, justify="left" if heading in ("", "verdict") else "right")
    for section in sections:
        for m, cells in rows(section):
            if m.verdict:
                colour = "green" if m.verdict == "met" else "bold red"
                table.add_row(f"{section.title}: {m.name}", cells[0], cells[-2], Text(m.verdict, style=colour))
    return table


def targets(sections: Iterable[Section]) -> list[str]:
    """All targets as the lines of one Markdown table: the one that the README shows."""
    lines = ["| | measured | target | |", "|---|--:|--:|---|"]
    for section in sections:
        for m, cells in rows(section):
            if m.verdict:
                verdict = m.verdict if m.verdict == "met" else f"**{m.verdict}**"
                lines.append(f"| {section.title}: {m.name} | {cells[0]} | {cells[-2]} | {verdict} |")
    return lines


def to_markdown(sections: Iterable[Section], machine: Mapping[str, Any]) -> str:
    """The whole report as Markdown."""
    lines = ["# Speed of flipdiagram", "", ", ".join(f"{name} {value}" for name, value in machine.items()), ""]
    sections = list(sections)
    lines += ["## Targets", "", *targets(sections), ""]
    for section in sections:
        lines += [f"## {section.title}", "", section.text, ""]
        lines += [f"| | {' | '.join(HEADINGS)} |", f"|---|{'--:|' * len(HEADINGS)}"]
        for m, cells in rows(section):
            lines.append(f"| {'&emsp;' * m.indent}{m.name} | {' | '.join(cells)} |")
        lines += ["", *(f"* {note}" for note in section.checks), ""]
    return "\n".join(lines)
