"""A campaign's file as an xarray.Dataset of trials × architectures, and as CSV, Parquet and NetCDF."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.campaign.specification import numeric
from flipdiagram.errors import InputError
from flipdiagram.files import atomic_path
from flipdiagram.flips.outcome import NOT_PHYSICS, SUCCESS
from flipdiagram.flips.store import Row
from flipdiagram.flips.store_file import open_to_read

METRICS = {
    "position_rmse_m": "m",
    "angle_rmse_rad": "rad",
    "acceleration_rmse_m_s2": "m/s^2",
    "max_slip_m": "m",
    "max_lift_off_m": "m",
    "velocity_delay_s": "s",
    "endpoint_vibration_m_s": "m/s",
    "release_time_s": "s",
    "release_angle_rad": "rad",
    "saturated_s": "s",
    "torque_use": "1",
}
"""Metrics of a flip that become variables, with their units; torque_use: largest torque of any joint over its limit."""
FORMATS = (".csv", ".parquet", ".nc")


def load_dataset(path: str | Path) -> xr.Dataset:
    """What a campaign's file holds so far; a flip that is missing has outcome '' and nan.

    Coordinates: trial, architecture; of each trial the seed and each varied parameter by its name.
    """
    with open_to_read(path) as results:
        specification, rows, digest = results.specification(), list(results.rows()), results.meta()["digest"]
    return to_dataset(specification, rows).assign_attrs(digest=digest)


def to_dataset(specification: dict[str, Any], rows: list[Row]) -> xr.Dataset:
    """The rows of a campaign by trial and architecture; only trials of which there is a row."""
    indices = sorted({row.trial for row in rows})
    architectures = list(specification["architectures"])
    place = {index: k for k, index in enumerate(indices)}
    shape = (len(indices), len(architectures))
    both = ("trial", "architecture")

    joints = max((len(row.metrics["max_torque_Nm"]) for row in rows if row.metrics), default=0)
    numbers = {name: np.full(shape, np.nan) for name in (*METRICS, "seconds", "attempts")}
    torque = np.full((*shape, joints), np.nan)
    outcome = np.full(shape, "", dtype=object)
    seeds = np.zeros(len(indices), dtype=np.int64)
    values: list[list[Any]] = [[None] * len(indices) for _ in specification["vary"]]
    for row in rows:
        at = place[row.trial], architectures.index(row.architecture)
        outcome[at], seeds[at[0]] = row.outcome, row.seed
        numbers["seconds"][at], numbers["attempts"][at] = row.seconds, row.attempts
        for column, value in zip(values, row.values, strict=True):
            column[at[0]] = value
        if row.metrics is not None:
            for name in METRICS:
                numbers[name][at] = np.nan if row.metrics.get(name) is None else row.metrics[name]
            torque[at] = row.metrics["max_torque_Nm"]
    names = [dimension["name"] for dimension in specification["vary"]]
    parameters = {name: ("trial", _column(column)) for name, column in zip(names, values, strict=True)}
    units = METRICS | {"seconds": "s", "attempts": "1"}
    data = {name: (both, array, {"units": units[name]}) for name, array in numbers.items()}
    return xr.Dataset(
        {
            "outcome": (both, outcome.astype(str)),
            "success": (both, outcome == SUCCESS),
            **data,
            "max_torque": ((*both, "joint"), torque, {"units": "N m"}),
        },
        coords={
            "trial": np.array(indices, dtype=np.int64),
            "architecture": architectures,
            "seed": ("trial", seeds),
            **parameters,
        },
        attrs={
            "parameters": json.dumps(names),
            "specification": json.dumps(specification, sort_keys=True),
            "sampler": specification["sampler"],
            "trials": specification["trials"],
        },
    )


def parameters_of(data: xr.Dataset) -> list[str]:
    """Names of the varied parameters, in the order of the file."""
    return list(json.loads(data.attrs["parameters"]))


def counted(part: xr.Dataset) -> np.ndarray:
    """Which trials of an architecture say something about its controller, shape (trial,)."""
    outcome = part["outcome"].values
    return ~np.isin(outcome, ["", *NOT_PHYSICS])


def export(path: str | Path, target: str | Path) -> Path:
    """Write a campaign's file as .csv or .parquet, one row a flip, or as .nc; returns the path written.

    Raises InputError for another ending, or where Parquet needs a package that is not installed.
    """
    target = Path(target)
    if target.suffix not in FORMATS:
        raise InputError.of("--export", str(target), f"a name that ends with {', '.join(FORMATS)}")
    data = load_dataset(path)
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


def _flat(data: xr.Dataset) -> Any:
    """A pandas.DataFrame, one row a flip that has ended; joint torques as columns."""
    torque = data["max_torque"]
    columns = {f"max_torque_{k + 1}_Nm": torque.isel(joint=k) for k in range(torque.sizes["joint"])}
    frame = data.drop_vars("max_torque").assign(columns).to_dataframe().reset_index()
    return frame[frame["outcome"] != ""]


def _column(values: list[Any]) -> np.ndarray:
    return np.array(values, dtype=float) if numeric(values) else np.array([str(value) for value in values])
