"""What a file of results holds, as a table: for `flipdiagram info FILE`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.errors import InputError
from flipdiagram.grid import Grid
from flipdiagram.planning.plan import Plan
from flipdiagram.results.opening import AnyPath, Source, open_result, read
from flipdiagram.results.signals import check_recording, components, flat, number, scenario_fields
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.metrics import measure

Rows = list[tuple[str, str]]


def info(path: AnyPath) -> Grid:
    """What a file or folder holds: kind, versions, verdicts, signals or claims, and changed scenario fields.

    Reads every file that `open_result` reads; raises InputError as it does, and for a replay.html.
    """
    source = read(path)
    rows: Rows = [("file", str(source.path)), ("kind", source.kind)]
    if source.schema != source.kind:
        rows.append(("schema", source.schema))
    if source.kind == "recording" and source.data is not None:
        rows += _recording(source.data)
    elif source.data is not None:
        rows += _variables(source.data)
    elif source.plan is not None:
        rows += _plan(source.plan)
    else:
        rows += _summary(source)
    return Grid(["", source.path.name], rows)


def _recording(data: xr.Dataset) -> Rows:
    check_recording(data)
    time, found = data["time"].values, measure(data)
    landed = found.touchdown
    rows = [
        ("architecture", str(data.attrs["architecture"])),
        ("block", "turned over" if found.success else f"not turned over: {found.failure}"),
        ("start", f"y = {found.start_y_m:g} m"),
        (
            "duration",
            f"{time[-1] - time[0]:.4g} s, {time[0]:.4g} to {time[-1]:.4g} s, motion 0 to "
            f"{float(data.attrs['end_time_s']):.4g} s",
        ),
        ("sampling", f"{len(time)} samples, every {1e3 * (time[1] - time[0]):.4g} ms"),
        (
            "release",
            f"{found.release_time_s:.3f} s at θ = {found.release_angle_rad:.2f} rad, planned "
            f"{float(data.attrs['release_time_s']):.3f} s",
        ),
        (
            "touch-down",
            f"{landed.time_s:.3f} s at y = {landed.y_m:.4f} m, θ = {landed.theta_rad:.2f} rad" if landed else "none",
        ),
        ("position RMSE", f"{100 * found.position_rmse_m:.3g} cm"),
    ]
    fields = scenario_fields(data)
    rows += _changed(fields) if fields is not None else [("scenario", "not kept in this file")]
    return rows + _variables(data)


def _variables(data: xr.Dataset) -> Rows:
    """A row a signal: dimensions, units, range; a range for each component where the units differ."""
    rows: Rows = []
    for name, variable in data.data_vars.items():
        dims = " × ".join(f"{dim} {size}" for dim, size in variable.sizes.items()) or "one value"
        units = str(variable.attrs.get("units", "1"))
        text = f"{dims}; "
        if variable.dtype.kind not in "fiu":
            text += f"{variable.dtype}"
        elif "," in units and "time" in variable.dims:
            parts = components(data, str(name))
            text += ", ".join(f"{' '.join(p.labels)} {_range(p.values(data))} {_unit(p.unit)}" for p in parts)
        else:
            text += f"{_range(variable.values)} {_unit(units)}"
        rows.append((f"signal {name}", text))
    return rows


def _plan(plan: Plan) -> Rows:
    samples = f"{plan.n_contact} contact, {plan.n_flight} flight, {plan.n_brake} brake, {plan.sampling_time:g} s each"
    skipped = ("samples", "sampling_time_s")
    entries = [(name, number(value)) for name, value in plan.summary().items() if name not in skipped]
    return [("duration", f"{plan.duration:g} s"), ("samples", samples), *entries]


def _summary(source: Source) -> Rows:
    content = source.summary or {}
    if source.kind != "plan":
        open_result(source.path)  # names what is damaged
    versions, fields = content.get("versions"), content.get("scenario")
    rows: Rows = []
    if isinstance(versions, Mapping):
        rows.append(("versions", ", ".join(f"{name} {text}" for name, text in versions.items())))
    if content.get("quick"):
        rows.append(("quick", "a quick run, not the numbers to quote"))
    try:
        rows += [row for name, read_rows in ROWS.items() if content.get(name) for row in read_rows(content[name])]
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"'{source.path}' is damaged: {error}; valid is a file that flipdiagram wrote") from error
    return rows + (_changed(flat(fields)) if isinstance(fields, Mapping) else [])


def _runs(runs: Sequence[Mapping[str, Any]]) -> Rows:
    rows: Rows = []
    for name in dict.fromkeys(str(run["architecture"]) for run in runs):
        mine = [run for run in runs if run["architecture"] == name]
        won = sum(bool(run["success"]) for run in mine)
        text = "turned over" if won else "not turned over"
        if len(mine) > 1:
            text = f"{won} of {len(mine)} turned over"
        reasons = dict.fromkeys(str(run["failure"]) for run in mine if run.get("failure"))
        first = next(iter(reasons), "")
        more = f", and {len(reasons) - 1} more" if len(reasons) > 1 else ""
        rows.append((f"block, {name}", f"{text}: {first}{more}" if first else text))
    return rows


def _claims(claims: Sequence[Mapping[str, Any]]) -> Rows:
    hold = [claim["id"] for claim in claims if claim["holds"]]
    broken = [claim["id"] for claim in claims if claim["holds"] is False]
    open_ones = [claim["id"] for claim in claims if claim["holds"] is None]
    rows = [("claims", f"{len(hold)} of {len(claims)} hold")]
    rows += [("claims that do not hold", ", ".join(broken))] if broken else []
    return rows + ([("claims not judged", ", ".join(open_ones))] if open_ones else [])


def _maps(maps: Sequence[Mapping[str, Any]]) -> Rows:
    rows: Rows = []
    for drawn in maps:
        cells = len(drawn["x"]["values"]) * len(drawn["y"]["values"])
        won = ", ".join(f"{name} {sum(map(sum, of['success']))}" for name, of in drawn["architectures"].items())
        rows.append((f"map {drawn['name']}", f"{cells} cells, turned over: {won}"))
    return rows


def _variations(variations: Sequence[Mapping[str, Any]]) -> Rows:
    fragile = sum(bool(row["fragile"]) for row in variations)
    return [("variations", f"{len(variations)}, a verdict differs in {fragile}")]


def _engines(engines: Mapping[str, Any]) -> Rows:
    agree = sum(row["drake"]["success"] == row["mujoco"]["success"] for row in engines["runs"])
    return [("second engine", f"MuJoCo gives the same verdict in {agree} of {len(engines['runs'])} runs")]


def _curves(curves: Sequence[Mapping[str, Any]]) -> Rows:
    names = ", ".join(dict.fromkeys(str(curve["figure"]) for curve in curves))
    omega = curves[0]["omega_rad_s"]
    return [("curves", f"{len(curves)}, figures {names}; ω {_range(np.array(omega))} rad/s, {len(omega)} frequencies")]


def _planned(plan: Mapping[str, Any]) -> Rows:
    names = ("cost_J", "release_time_s", "release_angle_rad", "touchdown_time_s", "touchdown_angle_rad", "solver")
    return [(f"plan {name}", number(plan[name])) for name in names if name in plan]


ROWS: Mapping[str, Any] = {
    "plan": _planned,
    "runs": _runs,
    "claims": _claims,
    "second_engine": _engines,
    "maps": _maps,
    "variations": _variations,
    "curves": _curves,
}
"""Rows of an entry of summary.json."""


def _changed(fields: Mapping[str, Any]) -> Rows:
    """Scenario fields that differ from the defaults of this version."""
    defaults = flat(Scenario().model_dump(mode="json"))
    changed = [(name, value) for name, value in fields.items() if defaults.get(name, "absent") != value]
    if not changed:
        return [("scenario", "the defaults")]
    unknown = "no field of this version"
    return [
        (f"scenario {name}", f"{number(value)} (default {number(defaults.get(name, unknown))})")
        for name, value in changed
    ]


def _unit(unit: str) -> str:
    return "[1]" if unit == "1" else unit


def _range(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    if not known.size:
        return "no number"
    low, high = float(known.min()), float(known.max())
    return f"{low:.4g}" if low == high else f"{low:.4g} … {high:.4g}"
