"""A campaign's file as an xarray.Dataset of trials × architectures, and as CSV, Parquet and NetCDF."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.arrays import Floats
from flipdiagram.campaign.distributions import is_number
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
    architectures, names = specification["architectures"], [dimension["name"] for dimension in specification["vary"]]
    indices = np.array([row.trial for row in rows], dtype=np.int64)
    trials, first, trial = np.unique(indices, return_index=True, return_inverse=True)
    at = trial, np.array([architectures.index(row.architecture) for row in rows], dtype=np.int64)
    dims, shape = ("trial", "architecture", "joint"), (len(trials), len(architectures))
    outcome = np.full(shape, "", dtype=object)
    outcome[at] = [row.outcome for row in rows]
    joints = max((len(row.metrics["max_torque_Nm"]) for row in rows if row.metrics), default=0)

    def numbers(units: str, values: list[Any], *joints: int) -> tuple[tuple[str, ...], Floats, dict[str, str]]:
        array = np.full((*shape, *joints), np.nan)
        array[at] = np.array(values, dtype=float).reshape(len(rows), *joints)  # None becomes nan
        return dims[: array.ndim], array, {"units": units}

    metrics = [row.metrics or {"max_torque_Nm": [np.nan] * joints} for row in rows]
    return xr.Dataset(
        {
            "outcome": (dims[:2], outcome.astype(str)),
            "success": (dims[:2], outcome == SUCCESS),
            **{name: numbers(units, [row.get(name) for row in metrics]) for name, units in METRICS.items()},
            "seconds": numbers("s", [row.seconds for row in rows]),
            "attempts": numbers("1", [row.attempts for row in rows]),
            "max_torque": numbers("N m", [row["max_torque_Nm"] for row in metrics], joints),
        },
        coords={
            "trial": trials,
            "architecture": architectures,
            "seed": ("trial", np.array([rows[k].seed for k in first], dtype=np.int64)),
            **{name: ("trial", _column([rows[k].values[j] for k in first])) for j, name in enumerate(names)},
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
    return np.array(values, dtype=float) if all(map(is_number, values)) else np.array([str(value) for value in values])
