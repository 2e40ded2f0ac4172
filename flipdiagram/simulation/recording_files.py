"""Recordings as files: NetCDF with the verdict beside the signals."""

from pathlib import Path

import xarray as xr

from flipdiagram.files import atomic_path
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.simulation.recording import Recording


def save_recording(data: Recording, measured: FlipMetrics, path: Path, key: str = "") -> None:
    """Write a recording whole or not at all; key: what `recording_key` shall find in it."""
    judged = data.assign_attrs(success=int(measured.success), failure=measured.failure or "", key=key)
    with atomic_path(path) as temporary:
        judged.to_netcdf(temporary, engine="scipy")


def recording_key(path: str | Path) -> str | None:
    """The key that a recording was saved with; None where there is no file that can be read."""
    try:
        with xr.open_dataset(path, engine="scipy") as data:
            return str(data.attrs.get("key", ""))
    except (OSError, ValueError, TypeError, LookupError):  # SciPy stumbles over a damaged file in many ways
        return None


def load_recording(path: str | Path) -> Recording:
    """Read a recording, whole, and close the file."""
    with xr.open_dataset(path, engine="scipy") as data:
        return data.load()
