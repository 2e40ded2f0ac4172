"""Recordings as files: NetCDF with the verdict beside the signals; what a recording must be to be read as one."""

import struct
from pathlib import Path

import numpy as np
import xarray as xr

from flipdiagram.errors import InputError
from flipdiagram.files import RESULT_BYTES, atomic_path, check_file, unreadable
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.simulation.placement import PlaceMetrics
from flipdiagram.simulation.recording import AXIS, KINDS, PLACE, POSE, SIGNALS, Recording, kind_of

NEEDED = ("x", "x_cmd", "v", "v_cmd", "a", "a_cmd", "q", "qd", "tau", "block_pose", "tool_pose", "contact_force")
"""What every recording holds."""
WHOLE = ("time", "block_pose", "tool_pose", "contact_force")
"""Signals of which no sample may be missing: of them what happened is known."""
OF_A_PLACEMENT = (("slide", "slide_cmd"), ("target_y_m",))
"""Signals and numbers that one of kind 'place' holds beside these."""
ATTRIBUTES = ("release_time_s", "end_time_s", "start_y_m", "friction_angle_rad")
"""Numbers that stand beside the signals."""
LABELS = {"axis": AXIS, "pose": POSE, "direction": ["x", "y", "z"]}
LARGEST = 1e15
"""Beyond every number of a recording, in SI."""
PERIODS = (1e-6, 1.0)
"""Shortest and longest time between two samples [s]."""
VALID = "a NetCDF file that flipdiagram wrote"
BROKEN = (OSError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, MemoryError, struct.error)
"""What SciPy and xarray raise for bytes that are no NetCDF, or that end too early."""


def save_recording(data: Recording, measured: FlipMetrics | PlaceMetrics, path: Path, key: str = "") -> None:
    """Write a recording whole or not at all; key: what `recording_key` shall find in it."""
    judged = data.assign_attrs(success=int(measured.success), failure=measured.failure or "", key=key)
    with atomic_path(path) as temporary:
        judged.to_netcdf(temporary, engine="scipy")


def recording_key(path: str | Path) -> str | None:
    """The key that a recording was saved with; None where there is no file that can be read."""
    try:
        return str(open_netcdf(path).attrs.get("key", ""))
    except InputError:
        return None


def load_recording(path: str | Path) -> Recording:
    """Read a recording, whole, and close the file; InputError where it is none."""
    return check_recording(open_netcdf(path), f"'{path}'")


def open_netcdf(path: str | Path) -> xr.Dataset:
    """Any Dataset that flipdiagram wrote, whole, numbers as they stand there; InputError where it cannot be read."""
    file = check_file(path, "", VALID, RESULT_BYTES)
    try:
        with xr.open_dataset(file, engine="scipy", decode_times=False) as data:
            return data.load()
    except BROKEN as error:
        damage = f"it is damaged, no NetCDF 3, or cut off ({' '.join(str(error).split())[:160]})"
        raise unreadable(file, "", VALID, getattr(error, "strerror", None) or damage) from None


def check_recording(data: xr.Dataset, name: str = "this Dataset") -> xr.Dataset:
    """The Dataset, if it is a recording: signals of `SIGNALS` over their dimensions, equal steps of time, attributes.

    name: what errors call it.  InputError that names what is missing or what is wrong.
    """
    kind = kind_of(data)
    if kind not in KINDS:
        raise _wrong(name, f"is of kind {kind[:40]!r}, not {' or '.join(KINDS)}", kind)
    signals, numbers = OF_A_PLACEMENT if kind == PLACE else ((), ())
    missing = [f"signal '{signal}'" for signal in (*NEEDED, *signals) if signal not in data.data_vars]
    missing += [f"attribute '{key}'" for key in ("architecture", *ATTRIBUTES, *numbers) if key not in data.attrs]
    if data.sizes.get("time", 0) < 2:
        missing.append("two samples on 'time'")
    if missing:
        raise _wrong(name, "lacks " + ", ".join(missing[:3]) + (", …" if len(missing) > 3 else ""), missing)
    for key in (*ATTRIBUTES, *numbers):
        value = np.asarray(data.attrs[key])
        if value.ndim or value.dtype.kind not in "fiu" or not abs(float(value)) <= LARGEST:
            raise _wrong(name, f"has {key} = {str(value)[:40]!r}, no number", key)
    for dim, labels in LABELS.items():
        if dim in data.dims and [str(label) for label in data[dim].values] != labels:
            raise _wrong(name, f"has other labels of '{dim}' than {', '.join(labels)}", dim)
    for dim in {"joint", "pair"} & set(data.dims):
        if dim not in data.coords or len(set(data[dim].values.tolist())) < data.sizes[dim]:
            raise _wrong(name, f"has no names of each '{dim}'", dim)
    for signal in ("time", *(signal for signal in SIGNALS if signal in data.data_vars)):
        _check_signal(data, signal, name)
    steps = np.diff(data["time"].values)
    if not (PERIODS[0] <= steps[0] <= PERIODS[1] and np.allclose(steps, steps[0], rtol=1e-3, atol=0)):
        raise _wrong(name, f"has no equal steps of time of {PERIODS[0]:g} to {PERIODS[1]:g} s", "time")
    return data


def _check_signal(data: xr.Dataset, signal: str, name: str) -> None:
    dims, units = (("time",), "s") if signal == "time" else SIGNALS[signal]
    variable = data[signal]
    if variable.dims != dims:
        given, wanted = (", ".join(map(str, of)) for of in (variable.dims, dims))
        raise _wrong(name, f"has '{signal}' over ({given}), not ({wanted})", signal)
    if variable.dtype.kind not in "fiu":
        raise _wrong(name, f"has '{signal}' as {variable.dtype}, no numbers", signal)
    if variable.attrs.get("units", units) != units:
        raise _wrong(name, f"has '{signal}' in {str(variable.attrs['units'])[:40]!r}, not {units}", signal)
    most = float(np.nanmax(np.abs(variable.values), initial=0.0))
    if not most <= LARGEST or (signal in WHOLE and np.isnan(variable.values).any()):
        raise _wrong(name, f"has '{signal}' with a number beyond {LARGEST:g}, or none", signal)
    if "pose" in dims and not (np.linalg.norm(variable.values[:, :4], axis=1) > 0.5).all():
        raise _wrong(name, f"has '{signal}' with a quaternion that is none", signal)


def _wrong(name: str, problem: str, value: object) -> InputError:
    valid = "what `flipdiagram flip` records"
    return InputError.of("recording", value, valid, f"{name} is no recording: it {problem}")
