"""Recordings as tables: pandas, CSV and Parquet, with the unit of every column."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]  # pandas-stubs may be missing
import xarray as xr

from flipdiagram.errors import InputError
from flipdiagram.files import atomic_path
from flipdiagram.results.signals import components

PARQUET = "pip install 'flipdiagram[parquet]'"


def to_frame(data: xr.Dataset) -> pd.DataFrame:
    """One row a sample, index time [s], one column a component (`x_y`, `tau_S`).

    attrs["units"] holds the unit of each column and of time; the recording's own attributes stand beside it.
    """
    parts = components(data)
    index = pd.Index(data["time"].values, name="time")
    frame = pd.DataFrame({part.name: part.values(data) for part in parts}, index=index)
    frame.attrs = {str(name): _plain(value) for name, value in data.attrs.items()}
    frame.attrs["units"] = {"time": "s"} | {part.name: part.unit for part in parts}
    return frame


def to_csv(data: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write CSV, whole or not at all: a header 'time [s],x_y [m],…', then a row a sample; nan is an empty cell.

    Numbers have as many digits as it takes to read them back exactly.  InputError where it cannot write.
    """
    frame = to_frame(data)
    units = frame.attrs["units"]
    headings = [f"{name} [{units[name]}]" for name in frame.columns]
    with atomic_path(path) as temporary:
        frame.to_csv(temporary, header=headings, index_label="time [s]", lineterminator="\n")
    return Path(path)


def to_parquet(data: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write Parquet, whole or not at all; `pandas.read_parquet` gives `to_frame` back, units included.

    Each column's field metadata has its 'units' too, for readers other than pandas.  InputError where it cannot
    write, or where pyarrow is not installed.
    """
    try:
        import pyarrow as pa  # type: ignore[import-untyped]  # has no type information
        from pyarrow import parquet
    except ImportError:
        raise InputError(f"Parquet needs pyarrow, which is not installed; install it with: {PARQUET}") from None
    frame = to_frame(data)
    units = frame.attrs["units"]
    table = pa.Table.from_pandas(frame).select(["time", *frame.columns])  # else the index comes last
    fields = [table.schema.field(name).with_metadata({"units": units[name]}) for name in table.column_names]
    # where pandas looks for the attributes of a frame
    metadata = {**table.schema.metadata, b"PANDAS_ATTRS": json.dumps(frame.attrs).encode()}
    with atomic_path(path) as temporary:
        parquet.write_table(table.cast(pa.schema(fields, metadata=metadata)), temporary)
    return Path(path)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value
