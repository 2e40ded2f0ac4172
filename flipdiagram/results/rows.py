"""Rows of a summary.json as arrays over what tells them apart, for `results.summaries`."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.grid import unit_of
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.study import Summary

OMITTED = ("start_y_m", "plan", "touchdown", "replanning", "overrides")
"""Entries of a run that are coordinates, the same for all architectures, or spread out."""


def head_of(summary: Summary) -> dict[str, Any]:
    """Attributes of every result: schema, versions, scenario."""
    versions = {f"{name}_version": str(text) for name, text in summary["versions"].items()}
    return {"schema": summary["schema"], **versions, "scenario": json.dumps(summary["scenario"])}


def runs_of(summary: Summary, dims: Sequence[str], files: Iterable[Path] = ()) -> xr.Dataset:
    """The runs over the entries that tell them apart; each touch-down, and what was planned again, spread out."""
    runs = []
    for run in summary["runs"]:
        kept = {name: value for name, value in run.items() if name in dims or name not in OMITTED}
        kept |= run.get("replanning") or {}
        if "touchdown_time_s" not in run:
            landed = run.get("touchdown") or {}
            kept |= {f"touchdown_{name}": landed.get(name) for name in ("time_s", "y_m", "z_m", "theta_rad")}
        runs.append(kept)
    return table_of(runs, dims, files).assign_attrs(head_of(summary))


def table_of(rows: Sequence[Mapping[str, Any]], dims: Sequence[str], files: Iterable[Path] = ()) -> xr.Dataset:
    """Rows over the entries that tell them apart as arrays: numbers with nan, texts with '', yes and no as bool.

    A list is spread over `joint`, whose names the first recording that exists gives.
    """
    coords: dict[str, list[Any]] = {dim: list(dict.fromkeys(row[dim] for row in rows)) for dim in dims}
    shape = tuple(map(len, coords.values()))
    variables: dict[str, Any] = {}
    width = 0
    for name in dict.fromkeys(name for row in rows for name in row if name not in coords):
        values = [row[name] for row in rows if row.get(name) is not None]
        units = {"units": unit_of(name)}
        if values and isinstance(values[0], list):
            width = len(values[0])
            variables[name] = ((*dims, "joint"), np.full((*shape, width), np.nan), units)
        elif values and all(isinstance(value, bool) for value in values):
            variables[name] = (dims, np.zeros(shape, dtype=bool), {})
        elif name == "failure" or (values and all(isinstance(value, str) for value in values)):
            variables[name] = (dims, np.full(shape, "", dtype=object), {})
        else:
            variables[name] = (dims, np.full(shape, np.nan), units)
    for row in rows:
        at = tuple(labels.index(row[dim]) for dim, labels in coords.items())
        for name, (_, array, _) in variables.items():
            if row.get(name) is not None:
                array[at] = row[name]
    joints = {"joint": _joints(files, width)} if width else {}
    return xr.Dataset(variables, coords={**coords, **joints})


def _joints(files: Iterable[Path], count: int) -> list[str]:
    """Names of the joints as a recording has them, else their numbers: summary.json does not tell."""
    for file in files:
        if file.is_file():
            return [str(name) for name in load_recording(file)["joint"].values]
    return [str(k + 1) for k in range(count)]
