"""summary.json of each study as xarray Datasets, with units: the `read` of its record."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.planning.plan import Plan
from flipdiagram.results.rows import head_of, runs_of, table_of
from flipdiagram.studies.study import Summary


def plan(summary: Summary, folder: Path) -> Plan:
    """The Plan that stands beside the summary."""
    return Plan.load(folder / "plan.json")


def turnover(summary: Summary, folder: Path) -> xr.Dataset:
    """The runs over (architecture, joint); the plan's numbers as attributes `plan_…`."""
    files = (folder / str(run.get("recording")) for run in summary["runs"])
    data = runs_of(summary, ["architecture"], files)
    numbers = {f"plan_{name}": v for name, v in summary["plan"].items() if isinstance(v, int | float | str)}
    return data.assign_attrs(numbers)


def place(summary: Summary, folder: Path) -> xr.Dataset:
    """The runs over `architecture`; the plan's numbers as attributes `plan_…`, and where the object should lie."""
    return turnover(summary, folder).assign_attrs(target_y_m=summary["target_y_m"])


def experiment(summary: Summary, folder: Path) -> xr.Dataset:
    """The runs over (architecture, start_y, joint), and the claims E1–E8 over `claim`."""
    from flipdiagram.studies.experiment.run import recording_name  # brings half of Drake, as no other study does

    files = (folder / recording_name(run["start_y_m"], run["architecture"]) for run in summary["runs"])
    data = runs_of(summary, ["architecture", "start_y_m"], files).rename(start_y_m="start_y")
    data["start_y"].attrs["units"] = "m"
    judged = claims(summary["claims"]).rename({name: f"claim_{name}" for name in ("holds", "text", "measured")})
    return xr.merge([data, judged], join="outer", compat="no_conflicts").assign_attrs(data.attrs)


def replanning(summary: Summary, folder: Path) -> xr.Dataset:
    """The runs over (case, way, architecture, joint); of random worlds `world_turned_over` and rate with interval."""
    data, kept = runs_of(summary, ["case", "way", "architecture"]), ("turned_over", "rate", "low", "high")
    dims = ["way", "architecture"]
    rows = [{name: entry[name] for name in (*dims, *kept)} for entry in summary["worlds"]["entries"]]
    worlds = table_of(rows, dims).rename({name: f"world_{name}" for name in kept}) if rows else xr.Dataset()
    return xr.merge([data, worlds], join="outer", compat="no_conflicts").assign_attrs(data.attrs)


def pancake(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """The 'runs' over (architecture, thickness, friction, youngs_modulus, joint); where there is a second engine,
    'second_engine' over the same four: whether each engine says turned over, and MuJoCo's numbers less Drake's."""
    axes = {"thickness_m": "m", "friction": "1", "youngs_modulus_Pa": "Pa"}
    dims, parts = ["architecture", *axes], {}
    parts["runs"] = runs_of(summary, dims, (folder / str(run.get("recording")) for run in summary["runs"]))
    if rows := summary["second_engine"]:
        told = [
            {dim: row[dim] for dim in dims}
            | {engine: row[engine]["success"] for engine in ("drake", "mujoco")}
            | {f"difference_{name}": value for name, value in row["difference"].items()}
            for row in rows
        ]
        parts["second_engine"] = table_of(told, dims).assign_attrs(head_of(summary))
    for data in parts.values():
        for axis, unit in axes.items():
            data[axis].attrs["units"] = unit
    if (energy := parts["runs"].get("largest_deformation_energy_J")) is not None:
        energy.attrs["units"] = "J"
    return parts


def engines(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """'agreement' by architecture: flips, those with equal verdicts, share and interval; 'parameters' by name."""
    kept = ("counted", "equal", "rate", "low", "high")
    rows = [{"architecture": k, **{name: e[name] for name in kept}} for k, e in summary["architectures"].items()]
    parts = {"agreement": table_of(rows, ["architecture"])}
    if summary["parameters"]:
        parts["parameters"] = table_of([dict(row) for row in summary["parameters"]], ["name"])
    return {name: data.assign_attrs(head_of(summary)) for name, data in parts.items()}


def calibrate(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """'predictions' of the paper's numbers by name, quantiles of prior and posterior; 'scenarios', the same numbers of
    the scenarios flown beside them; 'claims', shares of worlds; the posterior's 'draws' by unknown in the unit cube of
    the priors, with their weights."""
    rows, named = [], []
    for entry in summary["predictions"]:
        row = {"name": entry["name"], "paper": entry["paper"]}
        for kind in ("prior", "posterior"):
            row |= dict(zip((f"{kind}_low", f"{kind}_median", f"{kind}_high"), entry[kind] or (None,) * 3, strict=True))
        rows.append(row)
        named += [{"name": entry["name"], "scenario": k, "value": v} for k, v in entry["scenarios"].items()]
    shares = [{k: row[k] for k in ("id", "prior", "posterior")} for row in summary["claim_shares"]]
    draws, names = summary["draws"], [entry["name"] for entry in summary["unknowns"]]
    parts = {
        "predictions": table_of(rows, ["name"]),
        "scenarios": table_of(named, ["name", "scenario"]),
        "claims": table_of(shares, ["id"]),
        "draws": xr.Dataset(
            {"u": (("draw", "unknown"), np.array(draws["u"]).reshape(-1, len(names)), {"units": "1"})},
            coords={"unknown": names, "weight": ("draw", np.array(draws["weight"]), {"units": "1"})},
        ),
    }
    return {name: data.assign_attrs(head_of(summary)) for name, data in parts.items()}


def inverse(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """'stages' by controller: worlds flown, and those that went as E1 tells."""
    rows = [{name: stage[name] for name in ("architecture", "flown", "went")} for stage in summary["stages"]]
    return {"stages": table_of(rows, ["architecture"]).assign_attrs(head_of(summary), found=summary["found"])}


def challenge(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """'scores' of one entry, or of all of a leaderboard, by (entry, kind, suite, engine): counts, rate, medians."""
    scores = [(entry["entry"]["name"], row) for entry in summary.get("entries", [summary]) for row in entry["scores"]]
    rows = [{"entry": name, **{key: value for key, value in row.items() if key != "modes"}} for name, row in scores]
    return {"scores": table_of(rows, ["entry", "kind", "suite", "engine"]).assign_attrs(head_of(summary))}


def campaign(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """Rates, intervals and counts of how flips ended by architecture; 'pairs' of architectures; 'quantiles' of errors.

    The single flips are in campaign.sqlite.
    """
    entries = summary["architectures"]
    rates = [{"architecture": name, **_counted(entry)} for name, entry in entries.items()]
    parts = {"rates": table_of(rates, ["architecture"])}
    if pairs := summary["pairs"]:
        parts["pairs"] = table_of([{"pair": f"{pair['first']} - {pair['second']}", **pair} for pair in pairs], ["pair"])
    quantiles = [
        {"architecture": name, "level": float(level), metric: value}
        for name, entry in entries.items()
        for metric, values in entry["quantiles"].items()
        for level, value in (values or {}).items()
    ]
    if quantiles:
        parts["quantiles"] = table_of(quantiles, ["architecture", "level"]).reindex(architecture=list(entries))
    return {name: data.assign_attrs(head_of(summary)) for name, data in parts.items()}


def tuning(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """'rates' over (trials: search and held_out, gains: default and tuned); 'gains' over (field, gains)."""
    rates: list[dict[str, Any]] = []
    gains: list[dict[str, Any]] = []
    for side in ("default", "tuned"):
        rates += [{"trials": part, "gains": side, **_counted(summary[part][side])} for part in ("search", "held_out")]
        gains += [{"field": field, "gains": side, "value": entry[side]} for field, entry in summary["gains"].items()]
    difference = {f"held_out_{name}": value for name, value in summary["held_out"]["difference"].items()}
    return {
        "rates": table_of(rates, ["trials", "gains"]).assign_attrs(head_of(summary) | difference),
        "gains": table_of(gains, ["field", "gains"]).assign_attrs(head_of(summary)),
    }


def _counted(entry: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of an entry, and how many flips ended how as `flips_…`."""
    modes = {f"flips_{mode.replace(' ', '_')}": count for mode, count in entry["modes"].items()}
    return {name: value for name, value in entry.items() if name not in ("modes", "quantiles")} | modes


def borders(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """Each map over (architecture, its y, its x), by name; the table of solvers and estimates as 'variations'."""
    parts = {a_map["name"]: _map(a_map).assign_attrs(head_of(summary)) for a_map in summary["maps"]}
    if rows := summary["variations"]:
        runs = [{"architecture": k, "variation": row["name"], **run} for row in rows for k, run in row["runs"].items()]
        data = table_of(runs, ["architecture", "variation"])
        groups = ("variation", [row["group"] for row in rows])
        parts["variations"] = data.assign_coords(group=groups).assign_attrs(head_of(summary))
    return parts


def frequency(summary: Summary, folder: Path) -> dict[str, xr.Dataset]:
    """The curves of each figure over (curve, omega), the torques of '9' over (architecture, omega, g_dis), 'claims'."""
    parts = {}
    for figure in dict.fromkeys(curve["figure"] for curve in summary["curves"]):
        curves = [curve for curve in summary["curves"] if curve["figure"] == figure]
        parts[figure] = _curves(curves).assign_attrs({**head_of(summary), "figure": figure})
    torques = [
        {"architecture": row["architecture"], "omega": row["omega_rad_s"], "g_dis": g}
        | {"max_torque_N": torque, "theory_N": exact}
        for row in summary["torque"]
        for g, torque, exact in zip(row["g_dis_rad_s"], row["max_torque_N"], row["theory"], strict=True)
    ]
    if torques:
        data = _in_rad_s(table_of(torques, ["architecture", "omega", "g_dis"]))
        parts["9"] = data.assign_attrs({**head_of(summary), "figure": "9"})
    parts["claims"] = claims(summary["claims"]).assign_attrs(head_of(summary))
    return parts


def report(summary: Summary, folder: Path) -> xr.Dataset:
    """Every claim of the report over `claim`."""
    return claims(summary["claims"]).assign_attrs(head_of(summary))


def claims(rows: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    """Whether each claim holds: 1, 0, or nan where it was not judged; its text, and what was measured."""
    holds = [np.nan if row["holds"] is None else float(row["holds"]) for row in rows]
    texts = [str(row.get("claim", row.get("text", ""))) for row in rows]
    measured = [row["measured"] if isinstance(row["measured"], str) else json.dumps(row["measured"]) for row in rows]
    note = {"units": "1", "note": "1 holds, 0 does not, nan not judged"}
    return xr.Dataset(
        {"holds": ("claim", holds, note), "text": ("claim", texts), "measured": ("claim", measured)},
        coords={"claim": [row["id"] for row in rows]},
    )


def _map(a_map: Mapping[str, Any]) -> xr.Dataset:
    (x, x_values, x_unit), (y, y_values, y_unit) = _axis(a_map["x"]), _axis(a_map["y"])
    cells = [
        {"architecture": name, y: y_value, x: x_value} | {key: table[j][i] for key, table in tables.items()}
        for name, tables in a_map["architectures"].items()
        for j, y_value in enumerate(y_values)
        for i, x_value in enumerate(x_values)
    ]
    data = table_of(cells, ["architecture", y, x])
    data[x].attrs.update(units=x_unit, long_name=a_map["x"]["label"])
    data[y].attrs.update(units=y_unit, long_name=a_map["y"]["label"])
    return data.assign_attrs(title=a_map["title"], question=a_map["question"])


def _axis(axis: Mapping[str, Any]) -> tuple[str, list[Any], str]:
    """Name, values and unit of an axis of a map; where a value is a word ('lab'), all are texts."""
    match = re.fullmatch(r"(.*?) *\[(.+)\]", axis["label"])
    name, unit = (match[1], match[2]) if match else (axis["label"], "1")
    values = list(axis["values"])
    if any(isinstance(value, str) for value in values):
        values = [value if isinstance(value, str) else f"{value:g}" for value in values]
    return re.sub(r"\W+", "_", name).strip("_"), values, unit


def _curves(curves: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    omega = curves[0]["omega_rad_s"]
    if any(curve["omega_rad_s"] != omega for curve in curves):
        raise ValueError("the curves of one figure have different frequencies")
    unit = {"units": curves[0].get("unit", "1")}
    keys = [key for key in ("value", "theory", "fundamental") if any(curve.get(key) for curve in curves)]
    nothing = [np.nan] * len(omega)
    variables = {
        key: (("curve", "omega"), np.array([curve.get(key) or nothing for curve in curves], dtype=float), unit)
        for key in keys
    }
    cutoffs = [np.nan if curve["g_dis_rad_s"] is None else curve["g_dis_rad_s"] for curve in curves]
    coords = {
        "omega": omega,
        "architecture": ("curve", [curve["architecture"] for curve in curves]),
        "g_dis": ("curve", cutoffs),
        "friction": ("curve", [bool(curve["friction"]) for curve in curves]),
    }
    return _in_rad_s(xr.Dataset(variables, coords=coords))


def _in_rad_s(data: xr.Dataset) -> xr.Dataset:
    for name in ("omega", "g_dis"):
        data[name].attrs["units"] = "rad/s"
    return data
