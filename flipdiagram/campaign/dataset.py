"""A campaign's file as an xarray.Dataset of trials × architectures, and as CSV, Parquet and NetCDF."""

import json
import re
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pandas as pd  # type: ignore[import-untyped]  # pandas-stubs may be missing
import xarray as xr

from flipdiagram.campaign.distributions import is_number
from flipdiagram.errors import InputError
from flipdiagram.files import atomic_path
from flipdiagram.flips.outcome import NOT_PHYSICS, SUCCESS
from flipdiagram.flips.row import Row
from flipdiagram.flips.store_file import open_to_read
from flipdiagram.grid import unit_of
from flipdiagram.simulation.metrics import FlipMetrics

METRICS = {name: unit_of(name) for name, kind in get_type_hints(FlipMetrics).items() if kind is float}
METRICS |= {"torque_use": "1"}
"""Metrics of a flip that become variables, with their units; torque_use: largest torque of any joint over its limit."""
CIRCUMSTANCES = {"seconds": "s", "attempts": "1"}
TORQUE = "max_torque_{}_Nm"
"""Column of a joint's torque in a table."""
KEYS = ["trial", "architecture"]
FORMATS = (".csv", ".parquet", ".nc")


def load_dataset(path: str | Path, lost: list[str] | None = None) -> xr.Dataset:
    """What a campaign's file holds so far; a flip that is missing has outcome '' and nan.

    Coordinates: trial, architecture; of each trial the seed and each varied parameter by its name.
    lost: takes what is wrong with each damaged flip, which is left out; None: InputError at the first.
    """
    with open_to_read(path) as results:
        specification, digest = results.specification or {}, results.meta()["digest"]
        rows = list(results.rows() if lost is None else results.sound_rows(lost))
    return to_dataset(specification, rows).assign_attrs(digest=digest)


def to_dataset(specification: dict[str, Any], rows: list[Row]) -> xr.Dataset:
    """The rows of a campaign by trial and architecture; only trials of which there is a row."""
    names = [dimension["name"] for dimension in specification["vary"]]
    joints = max((len(row.metrics["max_torque_Nm"]) for row in rows if row.metrics), default=0)
    torques = [TORQUE.format(k + 1) for k in range(joints)]
    entries = []
    for row in rows:
        metrics = row.metrics or {}
        of_joints = zip(torques, metrics.get("max_torque_Nm", ()), strict=False)
        entries.append({**metrics, **vars(row), **dict(of_joints), **dict(zip(names, row.values, strict=True))})
    table = pd.DataFrame(entries, columns=[*KEYS, "outcome", "seed", *METRICS, *CIRCUMSTANCES, *torques, *names])
    attributes = {
        "parameters": json.dumps(names),
        "specification": json.dumps(specification, sort_keys=True),
        "sampler": specification["sampler"],
        "trials": specification["trials"],
    }
    return _by_trial(table, specification["architectures"]).assign_attrs(attributes)


def read_table(file: Path) -> xr.Dataset:
    """What `export` wrote as .csv or .parquet; KeyError where a column of a campaign is missing."""
    table = pd.read_csv(file) if file.suffix == ".csv" else pd.read_parquet(file)
    if absent := {*KEYS, "outcome", "success", "seed"} - set(table.columns):
        raise KeyError(f"the columns {', '.join(sorted(absent))} of a campaign")
    return _by_trial(table.drop(columns="success"), list(dict.fromkeys(table["architecture"])))


def _by_trial(table: pd.DataFrame, architectures: list[str]) -> xr.Dataset:
    """A table with a row a flip, spread over trial and architecture; what is no number of a flip is of its trial."""
    data = table.astype({"trial": np.int64}).set_index(KEYS).to_xarray().reindex(architecture=architectures)
    outcome = data["outcome"].fillna("").astype(str)
    numbers = {name: unit for name, unit in (METRICS | CIRCUMSTANCES).items() if name in data}
    torques = [name for name in table.columns if re.fullmatch(TORQUE.format(r"\d+"), name)]
    joints = np.array([data[name].values for name in torques], dtype=float).reshape(len(torques), *outcome.shape)
    first = table.drop_duplicates("trial").set_index("trial").loc[data["trial"].values]
    parameters = first.columns.difference([*KEYS, "outcome", "seed", *numbers, *torques], sort=False)
    return xr.Dataset(
        {
            "outcome": outcome,
            "success": outcome == SUCCESS,
            **{name: data[name].astype(float).assign_attrs(units=unit) for name, unit in numbers.items()},
            "max_torque": ((*KEYS, "joint"), np.moveaxis(joints, 0, -1), {"units": "N m"}),
        },
        coords={
            "seed": ("trial", first["seed"].astype(np.int64)),
            **{name: ("trial", _column(first[name].tolist())) for name in parameters},
        },
    )


def parameters_of(data: xr.Dataset) -> list[str]:
    """Names of the varied parameters, in the order of the file."""
    return list(json.loads(data.attrs["parameters"]))


def counted(part: xr.Dataset) -> np.ndarray:
    """Which trials of an architecture say something about its controller, shape (trial,)."""
    outcome = part["outcome"].values
    return ~np.isin(outcome, ["", *NOT_PHYSICS])


def export(path: str | Path, target: str | Path, lost: list[str] | None = None) -> Path:
    """Write a campaign's file as .csv or .parquet, one row a flip, or as .nc; returns the path written.

    lost: of a damaged file what is sound is written, as `load_dataset` does it.

    Raises InputError for another ending, or where Parquet needs a package that is not installed.
    """
    target = Path(target)
    if target.suffix not in FORMATS:
        raise InputError.of("--export", str(target), f"a name that ends with {', '.join(FORMATS)}")
    data = load_dataset(path, lost)
    with atomic_path(target) as temporary:
        if target.suffix == ".nc":
            # NetCDF 3 has neither booleans nor 64-bit whole numbers
            small = {name: data[name].astype(np.int32) for name in ("trial", "seed", "success")}
            data.assign_coords(trial=small["trial"], seed=small["seed"]).assign(success=small["success"]).to_netcdf(
                temporary, engine="scipy"
            )
            return target
        frame = _flat(data)
        try:
            (frame.to_csv if target.suffix == ".csv" else frame.to_parquet)(temporary, index=False)
        except ImportError:
            valid = "pip install pyarrow, or export .csv"
            text = f"--export = '{target}' needs pyarrow, which is not installed; install it with: {valid}"
            raise InputError(text, field="--export", value=str(target), valid=valid) from None
    return target


def _flat(data: xr.Dataset) -> pd.DataFrame:
    """One row a flip that has ended; joint torques as columns."""
    torque = data["max_torque"]
    columns = {TORQUE.format(k + 1): torque.isel(joint=k) for k in range(torque.sizes["joint"])}
    frame = data.drop_vars("max_torque").assign(columns).to_dataframe().reset_index()
    return frame[frame["outcome"] != ""]


def _column(values: list[Any]) -> np.ndarray:
    return np.array(values, dtype=float) if all(map(is_number, values)) else np.array([str(value) for value in values])
