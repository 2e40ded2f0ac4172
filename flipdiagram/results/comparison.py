"""Two results side by side: what differs in signals, metrics, scenario, verdicts and numbers."""

import html
import itertools
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flipdiagram.errors import InputError
from flipdiagram.figures.style import STYLES
from flipdiagram.grid import BAD, GOOD, Grid, number
from flipdiagram.planning.plan import Plan
from flipdiagram.results import plots
from flipdiagram.results.differences import Change, changes, comparable, leaves
from flipdiagram.results.opening import Source, read
from flipdiagram.results.signals import components, field_unit, flat, scenario_fields
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.recording_files import check_recording

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
                one, other = _at_common_times(part, other)
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
        found += ["notes"] if self.notes and not found else []
        a, b = _told_apart(self.names)
        verdict = f" differ in {', '.join(found)}" if found else ": no difference"
        return f"Comparison({self.kind}, {a} and {b}{verdict})"

    def _repr_html_(self) -> str:
        tables = "".join(grid.html() for grid in self.grids(*_told_apart(self.names)))
        notes = "".join(f"<p>{html.escape(note.replace('`', ''))}</p>" for note in self.notes)
        return f"<p>{html.escape(repr(self))}</p>{notes}{tables}"


Comparable = xr.Dataset | Plan | str | os.PathLike[str]


def compare(a: Comparable, b: Comparable) -> Comparison:
    """Two recordings (Datasets or paths), two plans, or two summaries of one study (paths), side by side.

    Recordings: same times or not, largest and RMS difference of every signal on the times that both have, metrics
    of both, scenario fields that differ.  Summaries and plans: verdicts and numbers that differ, but for how long
    things took.  Raises InputError as `open_result`, and where the two are not of one kind.
    """
    (one, first), (other, second) = _source(a, "a"), _source(b, "b")
    if one.kind != other.kind:
        message = f"cannot compare a result of kind '{one.kind}' with '{other.kind}'; valid are two of one"
        raise InputError(message, field="b", value=other.kind, valid=one.kind)
    names = (first, second)
    if one.data is not None and other.data is not None:
        if one.kind != "recording":
            valid = "recordings, plans, and summary.json of a study"
            message = f"cannot compare {one.kind}; valid are {valid}"
            raise InputError(message, field="a", value=one.kind, valid=valid)
        return _recordings(one.data, other.data, names)
    contents = [dict(source.plan.summary() if source.plan else source.summary or {}) for source in (one, other)]
    scenarios = [flat(content.pop("scenario", {})) for content in contents]
    first_leaves, second_leaves, notes = comparable(leaves(contents[0]), leaves(contents[1]), names)
    differing = [change for change in changes(first_leaves, second_leaves) if not change.same]
    return Comparison(
        names,
        one.kind,
        scenario=_fields(*scenarios),
        verdicts=tuple(change for change in differing if not change.numeric),
        numbers=tuple(change for change in differing if change.numeric),
        notes=tuple(notes),
    )


def _source(value: Comparable, name: str) -> tuple[Source, str]:
    """What is compared, and what it is called."""
    if isinstance(value, xr.Dataset):
        return Source(Path(), "recording", check_recording(value)), str(value.attrs["architecture"])
    if isinstance(value, Plan):
        return Source(Path(), "motion", plan=value), name
    if not isinstance(value, str | os.PathLike):
        kind, valid = type(value).__name__, "recordings, plans, and the path of a summary.json"
        raise InputError(f"{name} is a {kind}; valid are {valid}", field=name, value=value, valid=valid)
    source = read(value)
    return source, source.path.stem if source.data is not None else str(value)


def _recordings(one: xr.Dataset, other: xr.Dataset, names: tuple[str, str]) -> Comparison:
    parts, others = ({part.name: part for part in components(check_recording(data))} for data in (one, other))
    alone = [k for k in parts if k not in others], [k for k in others if k not in parts]
    notes = [f"Only in {names[k]}: " + ", ".join(f"`{part}`" for part in alone[k]) for k in (0, 1) if alone[k]]
    architectures = one.attrs["architecture"], other.attrs["architecture"]
    if architectures[0] != architectures[1]:
        notes.append(f"Architectures: `{architectures[0]}` and `{architectures[1]}`")
    signals, nothing = [], not _at_common_times(one["time"], other["time"])[0].size
    for name in () if nothing else [name for name in parts if name in others]:
        units = [of_one[name].attrs["units"] for of_one in (parts, others)]
        if units[0] != units[1]:
            notes.append(f"`{name}` is in {units[0]} and in {units[1]}: not compared")
        else:
            signals.append(_signal_difference(*_at_common_times(parts[name], others[name])))
    if nothing:
        notes.append("No time in common: signals not compared")
    known = [fields for fields in map(scenario_fields, (one, other)) if fields is not None]
    if len(known) == 1:
        notes.append("Only one of them keeps its scenario: not compared")
    return Comparison(
        names,
        "recording",
        np.array_equal(one["time"].values, other["time"].values),
        tuple(signals),
        changes(_measured(one), _measured(other)),
        _fields(*known) if len(known) == 2 else (),
        notes=tuple(notes),
        recordings=(one, other),
    )


def _at_common_times(one: xr.DataArray, other: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Both at the times [s] that are the same to a nanosecond."""
    a, b = (part.assign_coords(time=part["time"].values.round(9)) for part in (one, other))
    return xr.align(a, b, join="inner")


def _signal_difference(one: xr.DataArray, other: xr.DataArray) -> SignalDifference:
    """How one component differs between two recordings at the same times."""
    apart = abs(other - one)
    apart = apart[np.isfinite(apart.values)]
    largest, rms, at = 0.0, 0.0, float("nan")
    if apart.size:
        largest, rms, at = float(apart.max()), float(np.sqrt((apart**2).mean())), float(apart.idxmax())
    one_sided = int((one.isnull() != other.isnull()).sum())
    return SignalDifference(str(one.name), one.attrs["signal"], one.attrs["units"], largest, rms, at, one_sided)


def _measured(data: xr.Dataset) -> dict[str, Any]:
    """Metrics by name, the torque of each joint by the joint's."""
    metrics = measure(data).as_dict()
    torques = zip(data["joint"].values, metrics.pop("max_torque_Nm"), strict=True)
    return leaves(metrics) | {f"max_torque_Nm[{joint}]": torque for joint, torque in torques}


def _fields(a: dict[str, Any], b: dict[str, Any]) -> tuple[Change, ...]:
    names, missing = dict.fromkeys([*a, *b]), "no such field"
    rows = (Change(name, field_unit(name), a.get(name, missing), b.get(name, missing)) for name in names)
    return tuple(row for row in rows if not row.same)


def _told_apart(names: tuple[str, str]) -> tuple[str, str]:
    return (f"{names[0]} (a)", f"{names[1]} (b)") if names[0] == names[1] else names
