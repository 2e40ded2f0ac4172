"""What a file of results holds, as a table: for `flipdiagram info FILE`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.grid import Grid, labelled, number
from flipdiagram.planning.plan import SCHEMA as PLAN_SCHEMA
from flipdiagram.planning.plan import Plan
from flipdiagram.results.opening import BROKEN, CAMPAIGN, AnyPath, Source, damaged, read
from flipdiagram.results.signals import components, flat, scenario_fields
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.simulation.placement import PlaceMetrics, measure_by_kind
from flipdiagram.simulation.recording import kind_of
from flipdiagram.studies.registry import STUDIES
from flipdiagram.studies.study import Study

Rows = list[tuple[str, str]]


def info(path: AnyPath) -> Grid:
    """What a file or folder holds: kind, versions, verdicts, signals or claims, and changed scenario fields.

    Reads every file that `open_result` reads; raises InputError as it does, and for a replay.html.
    """
    source = read(path)
    rows: Rows = [("file", str(source.path)), ("kind", source.kind)]
    if source.kind == "recording" and source.data is not None:
        rows += _recording(source.data)
    elif source.data is not None:
        try:
            rows += (_flips(source.data) if source.kind == CAMPAIGN else []) + _variables(source.data)
        except BROKEN as error:
            raise damaged(source.path, error) from error
    elif source.plan is not None:
        rows += [("schema", PLAN_SCHEMA), *_plan(source.plan)]
    else:
        rows += _summary(source, STUDIES[source.kind])
    return Grid(["", source.path.name], rows)


STUDY_OF = {"flip": "turnover", "place": "place"}
"""Whose words a recording is judged in, by its kind."""


def _recording(data: xr.Dataset) -> Rows:
    time, measured, end = data["time"].values, measure_by_kind(data), float(data.attrs["end_time_s"])
    what, success = STUDIES[STUDY_OF[kind_of(data)]].success
    rows = [
        ("architecture", str(data.attrs["architecture"])),
        (what, success if measured.success else f"not {success}: {measured.failure}"),
        ("start", f"y = {data.attrs['start_y_m']:g} m"),
        ("duration", f"{time[-1] - time[0]:.4g} s, {time[0]:.4g} to {time[-1]:.4g} s, motion 0 to {end:.4g} s"),
        ("sampling", f"{len(time)} samples, every {1e3 * (time[1] - time[0]):.4g} ms"),
        *(_placed(measured) if isinstance(measured, PlaceMetrics) else _flown(measured, data)),
        ("position RMSE", f"{100 * measured.position_rmse_m:.3g} cm"),
    ]
    rows += [("engine", str(data.attrs["engine"]))] if "engine" in data.attrs else []
    fields = scenario_fields(data)
    rows += _changed(fields) if fields is not None else [("scenario", "not kept in this file")]
    return rows + _variables(data)


def _flown(measured: FlipMetrics, data: xr.Dataset) -> Rows:
    landed, planned = measured.touchdown, float(data.attrs["release_time_s"])
    landing = f"{landed.time_s:.3f} s at y = {landed.y_m:.4f} m, θ = {landed.theta_rad:.2f} rad" if landed else "none"
    angle = f"θ = {measured.release_angle_rad:.2f} rad"
    release = f"{measured.release_time_s:.3f} s at {angle}, planned {planned:.3f} s"
    return [("release", release), ("touch-down", landing)]


def _placed(measured: PlaceMetrics) -> Rows:
    landing, strike = "none", "never"
    if measured.touchdown_time_s is not None:
        landing = f"{measured.touchdown_time_s:.3f} s with {measured.touchdown_speed_m_s:.2f} m/s"
    if measured.strike_time_s is not None:
        force, duration = measured.strike_force_N, 1000 * measured.strike_duration_s
        strike = f"{force:.0f} N, {duration:.0f} ms, from {measured.strike_time_s:.3f} s"
    rest = f"{100 * measured.distance_m:.2g} cm from the target, tilted by {measured.tilt_rad:.2g} rad"
    slid = f"{1000 * measured.slid_m:.3g} mm, planned {1000 * measured.planned_slide_m:.3g} mm"
    return [("touch-down", landing), ("lies", rest), ("slid on the blade", slid), ("blade on the table", strike)]


def _flips(data: xr.Dataset) -> Rows:
    """How the flips of a campaign ended, by architecture."""
    rows: Rows = []
    for name in data["architecture"].values:
        modes = Counter(str(mode) for mode in data["outcome"].sel(architecture=name).values if mode)
        rows.append((f"flips, {name}", f"{modes.total()}: {number(dict(modes.most_common())) or 'none'}"))
    return rows


def _variables(data: xr.Dataset) -> Rows:
    """A row a signal: dimensions, units, range; a range for each component where the units differ."""
    rows: Rows = []
    for name, variable in data.data_vars.items():
        dims = " × ".join(f"{dim} {size}" for dim, size in variable.sizes.items()) or "one value"
        units = str(variable.attrs.get("units", "1"))
        if variable.dtype.kind not in "fiu":
            text = f"{variable.dtype}"
        elif "," in units and "time" in variable.dims:
            parts = components(data, str(name))
            text = ", ".join(f"{' '.join(p.attrs['labels'])} {_range(p.values, p.attrs['units'])}" for p in parts)
        else:
            text = _range(variable.values, units)
        rows.append((f"signal {name}", f"{dims}; {text}"))
    return rows


def _plan(plan: Plan) -> Rows:
    samples = f"{plan.n_contact} contact, {plan.n_flight} flight, {plan.n_brake} brake, {plan.sampling_time:g} s each"
    skipped = ("samples", "sampling_time_s")
    entries = [labelled(name, value) for name, value in plan.summary().items() if name not in skipped]
    return [("duration", f"{plan.duration:g} s"), ("samples", samples), *entries]


def _summary(source: Source, study: Study) -> Rows:
    content = source.summary or {}
    if source.kind != "plan":
        source.result()  # names what is damaged
    versions, fields = content.get("versions"), content.get("scenario")
    rows: Rows = [("schema", study.schema)]
    if isinstance(versions, Mapping):
        rows.append(("versions", ", ".join(f"{name} {text}" for name, text in versions.items())))
    if content.get("quick"):
        rows.append(("quick", "a quick run, not the numbers to quote"))
    try:
        for name, rows_of in ROWS.items():
            if content.get(name):
                rows += rows_of(content[name])
        rows += _runs(content.get("runs", []), *study.success)
        rows += _rates(content) if source.kind in ("campaign", "tuning") else []
        rows += _agreement(content) if source.kind == "engines" else []
    except BROKEN as error:
        raise damaged(source.path, error) from error
    return rows + (_changed(flat(fields)) if isinstance(fields, Mapping) else [])


def _runs(runs: Sequence[Mapping[str, Any]], what: str, success: str) -> Rows:
    rows: Rows = []
    for name in dict.fromkeys(str(run["architecture"]) for run in runs):
        of_name = [run for run in runs if run["architecture"] == name]
        won = sum(bool(run["success"]) for run in of_name)
        text = f"{won} of {len(of_name)} {success}" if len(of_name) > 1 else success if won else f"not {success}"
        reasons = dict.fromkeys(str(run["failure"]) for run in of_name if run.get("failure"))
        first = next(iter(reasons), "")
        more = f", and {len(reasons) - 1} more" if len(reasons) > 1 else ""
        rows.append((f"{what}, {name}", f"{text}: {first}{more}" if first else text))
    return rows


def _agreement(content: Mapping[str, Any]) -> Rows:
    """How often the engines say the same, by architecture."""
    engines = " and ".join(content["engines"])
    return [
        (f"{engines}, {name}", f"the same verdict in {entry['equal']} of {entry['counted']} flips")
        for name, entry in content["architectures"].items()
    ]


def _rates(content: Mapping[str, Any]) -> Rows:
    """Success rates with their 95 % intervals: of a campaign by architecture, of the tuner by gains."""
    entries = content.get("architectures") or {
        f"{content['architecture']}, {side} gains, held out": content["held_out"][side] for side in ("default", "tuned")
    }
    rows: Rows = []
    for name, entry in entries.items():
        text = "no flip that counts"
        if entry["rate"] is not None:
            rate, low, high = (f"{100 * entry[part]:.1f}" for part in ("rate", "low", "high"))
            text = f"turned over in {rate} % ({low}–{high} %): {number(entry['modes'])}"
        rows.append((f"block, {name}", text))
    return rows


def _claims(claims: Sequence[Mapping[str, Any]]) -> Rows:
    rows = [("claims", f"{sum(bool(claim['holds']) for claim in claims)} of {len(claims)} hold")]
    for what, verdict in (("claims that do not hold", False), ("claims not judged", None)):
        if ids := [claim["id"] for claim in claims if claim["holds"] is verdict]:
            rows.append((what, ", ".join(ids)))
    return rows


def _maps(maps: Sequence[Mapping[str, Any]]) -> Rows:
    rows: Rows = []
    for a_map in maps:
        cells = len(a_map["x"]["values"]) * len(a_map["y"]["values"])
        won = ", ".join(f"{name} {sum(map(sum, of['success']))}" for name, of in a_map["architectures"].items())
        rows.append((f"map {a_map['name']}", f"{cells} cells, turned over: {won}"))
    return rows


def _variations(variations: Sequence[Mapping[str, Any]]) -> Rows:
    fragile = sum(bool(row["fragile"]) for row in variations)
    return [("variations", f"{len(variations)}, a verdict differs in {fragile}")]


def _engines(rows: Sequence[Mapping[str, Any]]) -> Rows:
    agree = sum(row["drake"]["success"] == row["mujoco"]["success"] for row in rows)
    return [("second engine", f"MuJoCo gives the same verdict in {agree} of {len(rows)} runs")]


def _predictions(rows: Sequence[Mapping[str, Any]]) -> Rows:
    return [
        (row["name"], f"{number(row['paper'])} {row['unit']}; posterior {' … '.join(map(number, row['posterior']))}")
        for row in rows
    ]


def _stages(stages: Sequence[Mapping[str, Any]]) -> Rows:
    return [
        (f"worlds, {stage['architecture']}", f"{stage['went']} of {stage['flown']} {' or '.join(stage['wanted'])}")
        for stage in stages
    ]


def _scores(scores: Sequence[Mapping[str, Any]]) -> Rows:
    return [
        (f"{row['suite']}, {row['kind']}, {row['engine']}", f"{row['turned_over']} of {row['flips']} blocks over")
        for row in scores
    ]


def _entries(entries: Sequence[Mapping[str, Any]]) -> Rows:
    return [("entries", ", ".join(entry["entry"]["name"] for entry in entries))]


def _curves(curves: Sequence[Mapping[str, Any]]) -> Rows:
    names = ", ".join(dict.fromkeys(str(curve["figure"]) for curve in curves))
    omega = np.array(curves[0]["omega_rad_s"])
    return [("curves", f"{len(curves)}, figures {names}; ω {_range(omega, 'rad/s')}, {len(omega)} frequencies")]


def _planned(plan: Mapping[str, Any]) -> Rows:
    names = ("cost_J", "release_time_s", "release_angle_rad", "touchdown_time_s", "touchdown_angle_rad", "solver")
    rows = [labelled(name, plan[name]) for name in names if name in plan]
    return [(f"plan, {name}", text) for name, text in rows]


ROWS: Mapping[str, Any] = {
    "plan": _planned,
    "claims": _claims,
    "second_engine": _engines,
    "maps": _maps,
    "variations": _variations,
    "curves": _curves,
    "predictions": _predictions,
    "stages": _stages,
    "scores": _scores,
    "entries": _entries,
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


def _range(values: np.ndarray, unit: str) -> str:
    known, text = values[np.isfinite(values)], "no number"
    if known.size:
        low, high = known.min(), known.max()
        text = f"{low:.4g}" if low == high else f"{low:.4g} … {high:.4g}"
    return f"{text} {'[1]' if unit == '1' else unit}"
