"""Two results side by side: what differs in signals, metrics, scenario, verdicts and numbers."""

import html
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import xarray as xr
from matplotlib.axes import Axes

from flipdiagram.errors import InputError
from flipdiagram.figures.style import STYLES
from flipdiagram.grid import BAD, GOOD, Grid, number
from flipdiagram.results import plots
from flipdiagram.results.differences import Change
from flipdiagram.results.signals import components

SECOND = {"color": "#CC79A7", "linestyle": "--", "zorder": 2.7}
"""The line of the second recording where both are of one architecture."""
MOST = 60
"""Rows of a Markdown table; the attributes of `Comparison` have all."""


@dataclass(frozen=True)
class SignalDifference:
    """b − a of one component on the times that both have: largest with its time [s], and RMS, in `unit`."""

    name: str
    signal: str
    unit: str
    largest: float
    rms: float
    time: float
    one_sided: int
    """Samples at which one is nan and the other is not; they count in neither number."""


@dataclass(frozen=True, repr=False)
class Comparison:
    """What `compare` found; one line in a terminal, tables in a notebook."""

    names: tuple[str, str]
    kind: str
    """'recording', or the study of two summaries, or 'motion' for two plans."""
    same_grid: bool | None = None
    """Whether both recordings have the same times; None for anything else."""
    signals: tuple[SignalDifference, ...] = ()
    metrics: tuple[Change, ...] = ()
    """All metrics of two recordings, equal or not."""
    scenario: tuple[Change, ...] = ()
    """Scenario fields that differ."""
    verdicts: tuple[Change, ...] = ()
    """Verdicts and texts of two summaries that differ."""
    numbers: tuple[Change, ...] = ()
    """Numbers of two summaries that differ; of a list of numbers the one that differs most."""
    notes: tuple[str, ...] = ()
    recordings: tuple[xr.Dataset, xr.Dataset] | None = None

    @property
    def same(self) -> bool:
        """Whether nothing differs."""
        changed = self._differing or any(not change.same for change in self.metrics)
        differs = changed or self.scenario or self.verdicts or self.numbers or self.notes
        return self.same_grid is not False and not differs

    @property
    def _differing(self) -> list[SignalDifference]:
        return [part for part in self.signals if part.largest or part.one_sided]

    def to_markdown(self) -> str:
        """The comparison as Markdown, ending with a newline."""
        a, b = _told_apart(self.names)
        text = [f"**{self.kind}: {a} and {b}**" + (": no difference" if self.same else "")]
        if self.same_grid is not None:
            text.append("Same times: " + (GOOD if self.same_grid else f"{BAD}, compared where both have a sample"))
        text += self.notes
        text += [grid.title + "\n\n" + grid.markdown() for grid in self.grids(a, b)]
        return "\n\n".join(part.rstrip("\n") for part in text) + "\n"

    def grids(self, a: str = "a", b: str = "b") -> list[Grid]:
        """The tables of the comparison that have rows, for a terminal; a and b are the headings."""
        by_signal = itertools.groupby(self._differing, key=lambda part: (part.signal, part.unit))
        worst = [max(parts, key=lambda part: (part.largest, part.one_sided)) for _, parts in by_signal]
        signals = [
            [f"`{p.signal}`", f"`{p.name}`", p.unit, *map(number, (p.largest, p.rms, p.time)), str(p.one_sided or "–")]
            for p in worst
        ]
        headings = ["signal", "most in", "unit", "largest difference", "RMS", "at [s]", "nan in one only"]
        title = f"Signals that differ ({len(self._differing)} components)"
        grids = [Grid(headings, signals, title, headings[3:])]
        for title, rows in (
            ("Metrics", self.metrics),
            ("Scenario fields that differ", self.scenario),
            ("Verdicts that differ", self.verdicts),
            ("Numbers that differ", self.numbers),
        ):
            cells = [[f"`{row.name}`", row.unit, number(row.a), number(row.b), row.difference] for row in rows]
            first = f"the first {MOST} of " if len(cells) > MOST else ""
            grids.append(Grid(["", "unit", a, b, "difference"], cells[:MOST], f"{title} ({first}{len(cells)})"))
        return [grid for grid in grids if grid.rows]

    def plot(
        self, signal: str = "x", ax: Axes | Sequence[Axes] | None = None, *, difference: bool = False
    ) -> Axes | Sequence[Axes]:
        """A signal of both recordings over time, a panel a component; or, where asked, the difference b − a.

        Returns the Axes, a list where there are several.  InputError for anything but two recordings, and for a
        signal that one of them does not have.
        """
        if self.recordings is None:
            message = f"two results of kind '{self.kind}' have no signals; valid are recordings"
            raise InputError(message, field="signal", value=signal, valid="recordings")
        views = [plots.view(data, None) for data in self.recordings]
        parts, others = (components(data, signal) for data in views)
        names = [", ".join(str(part.name) for part in of_one) for of_one in (parts, others)]
        if names[0] != names[1]:
            message = f"'{signal}' is {names[0]} and {names[1]}; valid is equal"
            raise InputError(message, field="signal", value=signal, valid="equal")
        # the name of an architecture says more than that of a file, where it tells the two apart
        lines = [plots.line_of(data) for data in self.recordings]
        labels = (lines[0]["label"], lines[1]["label"])
        if self.recordings[0].attrs["architecture"] == self.recordings[1].attrs["architecture"]:
            labels = self.names
            lines[1] |= SECOND
        labels = _told_apart(labels)
        counterparts = {part.name: part for part in others}

        def draw(panel: Axes, part: xr.DataArray) -> None:
            other = counterparts[part.name]
            if difference:
                one, other = at_common_times(part, other)
                style = STYLES["command"].line()
                panel.plot(one["time"], other - one, label=f"{labels[1]} − {labels[0]}", **style)
                panel.set_ylabel("Δ " + panel.get_ylabel())
                return
            for values, label, line in zip((part, other), labels, lines, strict=True):
                panel.plot(values["time"], values, **line | {"label": label})

        return plots.draw_components(parts, ax, draw)

    def __repr__(self) -> str:
        counts = {
            "signal component": len(self._differing),
            "metric": sum(not change.same for change in self.metrics),
            "scenario field": len(self.scenario),
            "verdict": len(self.verdicts),
            "number": len(self.numbers),
        }
        found = [f"{count} {what}{'s' * (count > 1)}" for what, count in counts.items() if count]
        found += ["times"] if self.same_grid is False else []
        a, b = _told_apart(self.names)
        alone = "; ".join(self.notes) or "no difference"
        verdict = f" differ in {', '.join(found)}" if found else f": {alone}"
        return f"Comparison({self.kind}, {a} and {b}{verdict})"

    def _repr_html_(self) -> str:
        tables = "".join(grid.html() for grid in self.grids(*_told_apart(self.names)))
        notes = "".join(f"<p>{html.escape(note.replace('`', ''))}</p>" for note in self.notes)
        return f"<p>{html.escape(repr(self))}</p>{notes}{tables}"


def at_common_times(one: xr.DataArray, other: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Both at the times [s] that are the same to a nanosecond."""
    a, b = (part.assign_coords(time=part["time"].values.round(9)) for part in (one, other))
    return xr.align(a, b, join="inner")


def _told_apart(names: tuple[str, str]) -> tuple[str, str]:
    return (f"{names[0]} (a)", f"{names[1]} (b)") if names[0] == names[1] else names
