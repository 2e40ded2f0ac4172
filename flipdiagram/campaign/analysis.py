"""What a campaign says: success rates and their differences, failures, what matters, maps, quantiles."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.campaign.dataset import counted, parameters_of
from flipdiagram.campaign.sensitivity import TARGETS, chance, groups_of, sensitivities, sobol, strengths
from flipdiagram.campaign.statistics import holm, paired, success_rate
from flipdiagram.flips.outcome import MODES
from flipdiagram.simulation.events import SATURATED

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
MEASURED = ("position_rmse_m", "angle_rmse_rad", "acceleration_rmse_m_s2", "torque_use", "max_slip_m")
"""Metrics of which quantiles are given, over all flips that flew, whether they succeeded or not."""
PER_CELL = 8
"""Trials that a cell of a map should have on average."""
MOST_CELLS = 8


def analyse(data: xr.Dataset) -> dict[str, Any]:
    """All of it as plain data, the body of summary.json; of a campaign that runs, what is there so far."""
    names = [str(name) for name in data["architecture"].values]
    sensitivity = {name: {target: sensitivities(data, name, target) for target in TARGETS} for name in names}
    return {
        "trials": int(data.attrs["trials"]),
        "flips": int((data["outcome"] != "").sum()),
        "sampler": data.attrs["sampler"],
        "parameters": parameters_of(data),
        "architectures": {name: _architecture(data.sel(architecture=name)) for name in names},
        "pairs": _pairs(data, names),
        "sensitivity": sensitivity,
        "chance": chance(int(data.sizes["trial"])),
        "sobol": {name: indices for name in names if (indices := sobol(data, name)) is not None},
        "map": _success_map(data, names, sensitivity),
    }


def _architecture(part: xr.Dataset) -> dict[str, Any]:
    among = counted(part)
    won, n = int(part["success"].values[among].sum()), int(among.sum())
    outcomes = part["outcome"].values
    torque = part["torque_use"].values
    flew = np.isfinite(torque)
    return {
        "flips": int((outcomes != "").sum()),
        "counted": n,
        "successes": won,
        **success_rate(won, n),
        "modes": {mode: int((outcomes == mode).sum()) for mode in MODES if (outcomes == mode).any()},
        "saturated": float((torque[flew] >= SATURATED).mean()) if flew.any() else None,
        "quantiles": {name: _quantiles(part[name].values) for name in MEASURED},
    }


def _quantiles(values: np.ndarray) -> dict[str, float] | None:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return None
    return {f"{q:g}": float(x) for q, x in zip(QUANTILES, np.quantile(finite, QUANTILES), strict=True)}


def _pairs(data: xr.Dataset, names: list[str]) -> list[dict[str, Any]]:
    """Every two architectures over the trials that count for both."""
    pairs: list[dict[str, Any]] = []
    for one, other in itertools.combinations(names[::-1], 2):
        a, b = data.sel(architecture=one), data.sel(architecture=other)
        among = counted(a) & counted(b)
        compared = paired(a["success"].values[among], b["success"].values[among])
        pairs.append({"first": one, "second": other, **compared})
    adjusted = holm([pair["p"] for pair in pairs])
    return [pair | {"p_holm": p} for pair, p in zip(pairs, adjusted, strict=True)]


def _success_map(data: xr.Dataset, names: list[str], sensitivity: Mapping[str, Any]) -> dict[str, Any] | None:
    """Success over the two parameters that matter most; None with fewer than two."""
    total = strengths(sensitivity, ["success"])
    parameters = sorted(total, key=lambda parameter: -total[parameter])[:2]
    if len(parameters) < 2 or not data.sizes["trial"]:
        return None
    cells = int(np.clip(np.sqrt(data.sizes["trial"] / PER_CELL), 2, MOST_CELLS))
    x, y = (_axis(data[name].values, cells) for name in parameters)
    bins = [np.arange(len(axis["values"]) + 1) for axis in (y, x)]
    counts: dict[str, Any] = {}
    for name in names:
        part = data.sel(architecture=name)
        among = counted(part)
        for key, which in (("trials", among), ("successes", among & part["success"].values)):
            cells, *_ = np.histogram2d(y["index"][which], x["index"][which], bins)
            counts.setdefault(name, {})[key] = cells.astype(int).tolist()
    x, y = ({"parameter": name} | axis for name, axis in zip(parameters, (x, y), strict=True))
    del x["index"], y["index"]
    return {"x": x, "y": y, "architectures": counts}


def _axis(values: np.ndarray, cells: int) -> dict[str, Any]:
    """The cell of each trial, and what the cells are: single values where there are few, else ranges."""
    distinct = np.unique(values)
    if values.dtype.kind != "f":
        return {"index": groups_of(values), "values": [str(value) for value in distinct], "edges": None}
    if len(distinct) <= max(cells, MOST_CELLS):
        return {"index": np.searchsorted(distinct, values), "values": distinct.tolist(), "edges": None}
    edges = np.unique(np.quantile(values, np.linspace(0, 1, cells + 1)))
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    middle = 0.5 * (edges[:-1] + edges[1:])
    return {"index": index, "values": middle.tolist(), "edges": edges.tolist()}
