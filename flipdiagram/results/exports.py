"""What `flipdiagram campaign --export` wrote, back as the Dataset that it was written from."""

import re
from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]  # pandas-stubs may be missing
import xarray as xr

from flipdiagram.campaign.dataset import METRICS

CAMPAIGN = "campaign data"
"""The flips of a campaign over (trial, architecture), from its file or an exported one."""
TORQUE = r"max_torque_(\d+)_Nm"


def read_table(file: Path) -> xr.Dataset:
    """The Dataset of a .csv or .parquet with one row a flip; KeyError where a column of a campaign is missing."""
    table = pd.read_csv(file) if file.suffix == ".csv" else pd.read_parquet(file)
    if absent := {"trial", "architecture", "outcome", "success", "seed"} - set(table.columns):
        raise KeyError(f"the columns {', '.join(sorted(absent))} of a campaign")
    names = list(dict.fromkeys(table["architecture"]))
    data = table.set_index(["trial", "architecture"]).to_xarray().sel(architecture=names)
    data["outcome"] = data["outcome"].fillna("").astype(str)
    torques = [str(name) for name in data.data_vars if re.fullmatch(TORQUE, str(name))]
    if torques:
        data = data.assign(max_torque=data[torques].to_dataarray("joint").drop_vars("joint")).drop_vars(torques)
        data["max_torque"] = data["max_torque"].transpose("trial", "architecture", "joint").assign_attrs(units="N m")
    units = METRICS | {"seconds": "s", "attempts": "1"}
    by_trial = [str(name) for name in data.data_vars if name not in (*units, "outcome", "success", "max_torque")]
    first = table.drop_duplicates("trial").set_index("trial")
    coords = {name: ("trial", first[name].loc[data["trial"].values].values) for name in by_trial}
    data = data.drop_vars(by_trial).assign_coords(coords)
    for name in units.keys() & data.data_vars.keys():
        data[name].attrs["units"] = units[name]
    return with_truth_values(data)


def with_truth_values(data: xr.Dataset) -> xr.Dataset:
    """Success as yes and no: NetCDF 3 knows numbers only; a flip that is missing has not succeeded."""
    return data.assign(success=data["success"].fillna(0).astype(np.bool_))
