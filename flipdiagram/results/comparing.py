"""`compare`: what two results of one kind differ in."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.campaign.analysis import analyse
from flipdiagram.errors import InputError
from flipdiagram.planning.plan import Plan
from flipdiagram.results.comparison import Comparison, SignalDifference, at_common_times
from flipdiagram.results.differences import Change, changes, comparable, leaves
from flipdiagram.results.opening import CAMPAIGN, Source, kind_of, read
from flipdiagram.results.signals import components, field_unit, flat, scenario_fields
from flipdiagram.simulation.placement import measure_by_kind
from flipdiagram.simulation.recording_files import check_recording
from flipdiagram.simulation.simulate import Run
from flipdiagram.studies.frequency.response import FrequencyResponse
from flipdiagram.studies.place.run import Placement

Comparable = xr.Dataset | Plan | Run | Placement | FrequencyResponse | str | os.PathLike[str]


def compare(a: Comparable, b: Comparable) -> Comparison:
    """Two results of one kind side by side: as objects, as Datasets, or as the paths of files and folders.

    Flips and placements (a Run, a Placement, a recording): same times or not, largest and RMS difference of every
    signal on the times that both have, metrics of both, scenario fields that differ.  Campaigns: what their analyses
    say, rates and their intervals among it.  Frequency data and responses: the numbers that differ.  Plans, and
    summaries of one study: verdicts and numbers that differ, but for how long things took.

    Raises InputError as `open_result`, and where the two are not of one kind.
    """
    (one, first), (other, second) = _source(a, "a"), _source(b, "b")
    if one.kind != other.kind:
        message = f"cannot compare a result of kind '{one.kind}' with '{other.kind}'; valid are two of one"
        raise InputError(message, field="b", value=other.kind, valid=one.kind)
    names = (first, second)
    if one.kind == "recording" and one.data is not None and other.data is not None:
        return _recordings(one.data, other.data, names)
    contents = [_contents(source) for source in (one, other)]
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


def _contents(source: Source) -> dict[str, Any]:
    """What a result that is no recording says, as nested plain data."""
    if source.plan is not None:
        return source.plan.summary()
    if source.data is None:
        return dict(source.summary or {})
    if source.kind == CAMPAIGN and "parameters" in source.data.attrs:
        scenario = json.loads(source.data.attrs["specification"]).get("base", {})
        return analyse(source.data) | {"scenario": scenario}
    data = source.data.reset_coords()
    return {
        str(name): variable.values.ravel().tolist() for name, variable in data.items() if variable.dtype.kind in "biuf"
    } | {str(name): axis.values.tolist() for name, axis in data.indexes.items() if axis.dtype.kind in "biuf"}


def _source(value: Comparable, name: str) -> tuple[Source, str]:
    """What is compared, and what it is called."""
    if isinstance(value, FrequencyResponse):
        return Source(Path(), "frequency response", value.to_dataset()), value.name
    if isinstance(value, Run | Placement):
        value = value.recording
    if isinstance(value, xr.Dataset):
        if (kind := kind_of(value)) in (None, "recording"):
            return Source(Path(), "recording", check_recording(value)), str(value.attrs["architecture"])
        return Source(Path(), str(kind), value), name
    if isinstance(value, Plan):
        return Source(Path(), "motion", plan=value), name
    if not isinstance(value, str | os.PathLike):
        kind, valid = type(value).__name__, "runs, recordings, campaigns, responses, plans, and paths of results"
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
    signals, nothing = [], not at_common_times(one["time"], other["time"])[0].size
    for name in () if nothing else [name for name in parts if name in others]:
        units = [of_one[name].attrs["units"] for of_one in (parts, others)]
        if units[0] != units[1]:
            notes.append(f"`{name}` is in {units[0]} and in {units[1]}: not compared")
        else:
            signals.append(_signal_difference(*at_common_times(parts[name], others[name])))
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
    metrics = measure_by_kind(data).as_dict()
    if (torques := metrics.pop("max_torque_Nm", None)) is None:  # of a placement
        return leaves(metrics)
    by_joint = zip(data["joint"].values, torques, strict=True)
    return leaves(metrics) | {f"max_torque_Nm[{joint}]": torque for joint, torque in by_joint}


def _fields(a: dict[str, Any], b: dict[str, Any]) -> tuple[Change, ...]:
    names, missing = dict.fromkeys([*a, *b]), "no such field"
    rows = (Change(name, field_unit(name), a.get(name, missing), b.get(name, missing)) for name in names)
    return tuple(row for row in rows if not row.same)
