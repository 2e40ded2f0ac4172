"""Two results side by side: what differs in signals, metrics, scenario, verdicts and numbers."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flipdiagram.errors import InputError
from flipdiagram.figures.style import NAMES, STYLES
from flipdiagram.grid import BAD, GOOD, Grid, number
from flipdiagram.planning.plan import Plan
from flipdiagram.results import plots
from flipdiagram.results.differences import (
    Change,
    SignalDifference,
    changes,
    common_samples,
    comparable,
    leaves,
    signal_difference,
)
from flipdiagram.results.opening import Source, read
from flipdiagram.results.signals import check_recording, components, field_unit, flat, scenario_fields
from flipdiagram.simulation.metrics import measure

SECOND = "#CC79A7"
"""The colour of the second recording where both are of one architecture."""
MOST = 60
"""Rows of a Markdown table; the attributes of `Comparison` have all."""


@dataclass(frozen=True)
class Comparison:
    """What `compare` found; shows itself as Markdown in a notebook."""

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
        differ = any(part.largest or part.one_sided for part in self.signals)
        changed = any(not change.same for change in self.metrics)
        return self.same_grid is not False and not (
            differ or changed or self.scenario or self.verdicts or self.numbers or self.notes
        )

    def to_markdown(self) -> str:
        """The comparison as Markdown, ending with a newline."""
        a, b = self.names
        if self.names[0] == self.names[1]:
            a, b = f"{a} (a)", f"{b} (b)"
        text = [f"**{self.kind}: {a} and {b}**" + (": no difference" if self.same else "")]
        if self.same_grid is not None:
            text.append("Same times: " + (GOOD if self.same_grid else f"{BAD}, compared where both have a sample"))
        text += self.notes
        text += [grid.title + "\n\n" + grid.markdown() if grid.title else grid.markdown() for grid in self.grids(a, b)]
        return "\n\n".join(part.rstrip("\n") for part in text) + "\n"

    def grids(self, a: str = "a", b: str = "b") -> list[Grid]:
        """The tables of the comparison that have rows, for a terminal; a and b are the headings."""
        differing = [part for part in self.signals if part.largest or part.one_sided]
        worst: dict[tuple[str, str], SignalDifference] = {}
        for part in differing:
            key = part.signal, part.unit
            worst[key] = max(
                worst.get(key, part), part, key=lambda difference: (difference.largest, difference.one_sided)
            )
        signals = [
            [f"`{p.signal}`", f"`{p.name}`", p.unit, *map(number, (p.largest, p.rms, p.time)), str(p.one_sided or "–")]
            for p in worst.values()
        ]
        headings = ["signal", "most in", "unit", "largest difference", "RMS", "at [s]", "nan in one only"]
        title = f"Signals that differ ({len(differing)} components)"
        grids = [Grid(headings, signals, title, headings[3:])]
        for title, rows in (
            ("Metrics", self.metrics),
            ("Scenario fields that differ", self.scenario),
            ("Verdicts that differ", self.verdicts),
            ("Numbers that differ", self.numbers),
        ):
            cells = [[f"`{row.name}`", row.unit, number(row.a), number(row.b), row.difference] for row in rows]
            grids.append(Grid(["", "unit", a, b, "difference"], cells[:MOST], _title(title, len(cells))))
        return [grid for grid in grids if grid.rows]

    def plot(
        self, signal: str = "x", ax: Axes | Sequence[Axes] | None = None, *, difference: bool = False
    ) -> Axes | Sequence[Axes]:
        """A signal of both recordings over time, a panel a component; or, where asked, the difference b − a.

        Returns the Axes, a list where there are several.  InputError for anything but two recordings, and for a
        signal that one of them does not have.
        """
        if self.recordings is None:
            raise InputError(f"two results of kind '{self.kind}' have no signals; valid are recordings")
        one, other = self.recordings
        parts = components(one, signal)
        other_names = [part.name for part in components(other, signal)]
        if [part.name for part in parts] != other_names:
            raise InputError(
                f"'{signal}' is {', '.join(p.name for p in parts)} and {', '.join(other_names)}; valid is equal"
            )
        panels, own = plots.panels_for(parts, ax)
        twins = one.attrs["architecture"] == other.attrs["architecture"]
        lines = [plots.style_for(one).line(), plots.style_for(other).line()]
        if twins:
            lines[1] |= {"color": SECOND, "linestyle": "--", "zorder": 2.7}
        # the name of an architecture says more than that of a file, where it tells the two apart
        own_names = [str(data.attrs["architecture"]) for data in self.recordings]
        labels = self.names if twins else (NAMES.get(own_names[0], own_names[0]), NAMES.get(own_names[1], own_names[1]))
        if labels[0] == labels[1]:
            labels = (f"{labels[0]} (a)", f"{labels[1]} (b)")
        for panel, part in zip(panels, parts, strict=True):
            if difference:
                first, second = (plots.view(data, None) for data in self.recordings)
                here, there = common_samples(first, second)
                values = part.values(second)[there] - part.values(first)[here]
                label = f"{labels[1]} − {labels[0]}"
                panel.plot(first["time"].values[here], values, label=label, **STYLES["command"].line())
                panel.set_ylabel("Δ " + plots.label_of(part))
            else:
                for data, label, line in zip(self.recordings, labels, lines, strict=True):
                    shown_data = plots.view(data, None)
                    panel.plot(shown_data["time"], part.values(shown_data), label=label, **line)
                panel.set_ylabel(plots.label_of(part))
        plots.finish_panels(panels, own)
        return panels[0] if len(parts) == 1 and not isinstance(ax, Sequence) else panels

    def _repr_markdown_(self) -> str:
        return self.to_markdown()


Comparable = xr.Dataset | Plan | str | os.PathLike[str]


def compare(a: Comparable, b: Comparable) -> Comparison:
    """Two recordings (Datasets or paths), two plans, or two summaries of one study (paths), side by side.

    Recordings: same times or not, largest and RMS difference of every signal on the times that both have, metrics
    of both, scenario fields that differ.  Summaries and plans: verdicts and numbers that differ, but for how long
    things took.  Raises InputError as `open_result`, and where the two are not of one kind.
    """
    (one, first), (other, second) = _source(a, "a"), _source(b, "b")
    if one.kind != other.kind:
        raise InputError(f"cannot compare a result of kind '{one.kind}' with '{other.kind}'; valid are two of one")
    names = (first, second)
    if one.data is not None and other.data is not None:
        if one.kind != "recording":
            raise InputError(f"cannot compare {one.kind}; valid are recordings, plans, and summary.json of a study")
        return _recordings(one.data, other.data, names)
    contents = [
        source.plan.summary() if source.plan is not None else dict(source.summary or {}) for source in (one, other)
    ]
    scenarios = [flat(content.pop("scenario", {})) for content in contents]
    first_leaves, second_leaves, notes = comparable(leaves(contents[0]), leaves(contents[1]), names)
    differing = changes(first_leaves, second_leaves)
    return Comparison(
        names,
        one.kind,
        scenario=_fields(*scenarios),
        verdicts=tuple(change for change in differing if not change.numeric),
        numbers=tuple(change for change in differing if change.numeric),
        notes=tuple(notes),
    )


def _recordings(one: xr.Dataset, other: xr.Dataset, names: tuple[str, str]) -> Comparison:
    check_recording(one)
    check_recording(other)
    first_parts, second_parts = ({part.name: part for part in components(data)} for data in (one, other))
    where = common_samples(one, other)
    alone = [k for k in first_parts if k not in second_parts], [k for k in second_parts if k not in first_parts]
    notes = [f"Only in {names[k]}: " + ", ".join(f"`{part}`" for part in alone[k]) for k in (0, 1) if alone[k]]
    architectures = one.attrs["architecture"], other.attrs["architecture"]
    if architectures[0] != architectures[1]:
        notes.append(f"Architectures: `{architectures[0]}` and `{architectures[1]}`")
    signals = []
    if len(where[0]):
        time = one["time"].values[where[0]]
        for name in (name for name in first_parts if name in second_parts):
            if first_parts[name].unit != second_parts[name].unit:
                notes.append(f"`{name}` is in {first_parts[name].unit} and in {second_parts[name].unit}: not compared")
                continue
            x, y = first_parts[name].values(one)[where[0]], second_parts[name].values(other)[where[1]]
            signals.append(signal_difference(first_parts[name], x, y, time))
    else:
        notes.append("No time in common: signals not compared")
    fields = [scenario_fields(data) for data in (one, other)]
    same_grid = np.array_equal(one["time"].values, other["time"].values)
    known = [part for part in fields if part is not None]
    if len(known) == 1:
        notes.append("Only one of them keeps its scenario: not compared")
    return Comparison(
        names,
        "recording",
        same_grid,
        tuple(signals),
        changes(_measured(one), _measured(other), all_of_them=True),
        _fields(*known) if len(known) == 2 else (),
        notes=tuple(notes),
        recordings=(one, other),
    )


def _measured(data: xr.Dataset) -> dict[str, Any]:
    """Metrics by name, the torque of each joint by the joint's."""
    metrics = measure(data).as_dict()
    torques = zip(data["joint"].values, metrics.pop("max_torque_Nm"), strict=True)
    return leaves(metrics) | {f"max_torque_Nm[{joint}]": torque for joint, torque in torques}


def _fields(a: dict[str, Any], b: dict[str, Any]) -> tuple[Change, ...]:
    names = list(dict.fromkeys([*a, *b]))
    missing = "no such field"
    rows = (Change(name, field_unit(name), a.get(name, missing), b.get(name, missing)) for name in names)
    return tuple(row for row in rows if not row.same)


def _source(value: Comparable, name: str) -> tuple[Source, str]:
    if isinstance(value, xr.Dataset):
        if "time" not in value.sizes:
            raise InputError(f"{name} is no recording; valid are recordings, and the path of a summary.json")
        check_recording(value)
        return Source(Path(), "recording", value), str(value.attrs["architecture"])
    if isinstance(value, Plan):
        return Source(Path(), "motion", plan=value), name
    if not isinstance(value, str | os.PathLike):
        kind = type(value).__name__
        raise InputError(f"{name} is a {kind}; valid are recordings, plans, and the path of a summary.json")
    source = read(value)
    return source, source.path.stem if source.data is not None else str(value)


def _title(title: str, count: int) -> str:
    return f"{title} ({count})" if count <= MOST else f"{title} (the first {MOST} of {count})"
