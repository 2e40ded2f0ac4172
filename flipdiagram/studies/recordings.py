"""Recordings as files: NetCDF with the verdict beside the signals."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from flipdiagram.files import atomic_path
from flipdiagram.metrics import FlipMetrics
from flipdiagram.recording import Recording


def save_recording(data: Recording, measured: FlipMetrics, path: Path) -> None:
    """Write a recording whole or not at all."""
    judged = data.assign_attrs(success=int(measured.success), failure=measured.failure or "")
    with atomic_path(path) as temporary:
        judged.to_netcdf(temporary, engine="scipy")


def load_recording(path: str | Path) -> Recording:
    """Read a recording, whole, and close the file."""
    with xr.open_dataset(path, engine="scipy") as data:
        return data.load()
