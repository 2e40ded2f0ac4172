"""The signals of a recording one by one: flat names such as `x_y` and `tau_S`, and the unit of each."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError
from flipdiagram.scenario import text
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.yaml_reader import read_mapping

NEEDED = ("x", "x_cmd", "v", "v_cmd", "a", "a_cmd", "q", "qd", "tau", "block_pose", "tool_pose", "contact_force")
"""What every recording holds; see `flipdiagram.simulation.recording`."""
ATTRIBUTES = ("architecture", "release_time_s", "end_time_s")
UNITS = ("m/s2", "rad/s2", "m/s", "rad/s", "N m", "rad", "m", "s", "J", "N", "kg")
"""Units that end a name in summary.json, such as `_rad_s2`; longest first."""


@dataclass(frozen=True)
class Component:
    """One scalar signal: flat name, the signal it belongs to, its labels and place beside time, its unit."""

    name: str
    signal: str
    labels: tuple[str, ...]
    place: tuple[int, ...]
    unit: str

    def values(self, data: xr.Dataset) -> Floats:
        """The samples, shape (time,)."""
        others = [dim for dim in data[self.signal].dims if dim != "time"]
        samples = data[self.signal].isel(dict(zip(others, self.place, strict=True)))
        return np.asarray(samples.values, dtype=np.float64)


def check_recording(data: xr.Dataset) -> xr.Dataset:
    """The Dataset, if it is a recording with at least one sample; else InputError that names what is missing."""
    missing = [f"signal '{name}'" for name in NEEDED if name not in data.data_vars]
    missing += [f"attribute '{name}'" for name in ATTRIBUTES if name not in data.attrs]
    if data.sizes.get("time", 0) < 2:
        missing.append("two samples on 'time'")
    if missing:
        what, valid = ", ".join(missing[:3]) + (", …" if len(missing) > 3 else ""), "what `flipdiagram flip` records"
        message = f"this Dataset is no recording: it lacks {what}; valid is {valid}"
        raise InputError(message, field="recording", value=missing, valid=valid)
    return data


def components(data: xr.Dataset, signal: str | None = None) -> list[Component]:
    """The components of one signal, or of all that depend on time; InputError for an unknown signal.

    `signal` may be a flat name ('tau_S'), which gives that component alone.
    """
    if signal is not None and signal in data.data_vars and "time" in data[signal].dims:
        return _split(data, signal)
    everything = [part for name in data.data_vars if "time" in data[name].dims for part in _split(data, str(name))]
    if signal is None:
        return everything
    named = [part for part in everything if part.name == signal]
    if not named:
        names = list(dict.fromkeys(part.signal for part in everything))
        near = difflib.get_close_matches(signal, [*names, *(part.name for part in everything)], n=1)
        meant = f"did you mean '{near[0]}'? " if near else ""
        parts = [part.name for part in everything if part.signal != part.name]
        example = f", or one component such as '{parts[0]}'" if parts else ""
        message = f"unknown signal '{signal}'; {meant}valid are {', '.join(names)}{example}"
        raise InputError(message, field="signal", value=signal, valid=names)
    return named


def unit_of(name: str) -> str:
    """Unit of an entry of summary.json by the end of its name ('position_rmse_m'); '1' where it says none."""
    return next((unit for unit in UNITS if name.endswith("_" + unit.replace(" ", "").replace("/", "_"))), "1")


def pretty(unit: str) -> str:
    """A unit as figures write it: m/s2 becomes m/s²."""
    return unit.replace("2", "²")


def field_unit(path: str) -> str:
    """Unit of a scenario field; '' where the field has none or is unknown."""
    field = text.fields_of(Scenario).get(path)
    return text.unit_of(field) if field else ""


def flat(nested: Mapping[str, Any]) -> dict[str, Any]:
    """Scenario fields by path, {'controller.k_p': 350.0}; tuples as lists, as files hold them."""
    return {
        f"{section}.{name}": list(value) if isinstance(value, tuple) else value
        for section, fields in nested.items()
        if isinstance(fields, Mapping)
        for name, value in fields.items()
    }


def scenario_fields(data: xr.Dataset) -> dict[str, Any] | None:
    """Scenario fields of a recording by path; None where it keeps none.  InputError where they are no YAML."""
    yaml = data.attrs.get("scenario")
    return flat(read_mapping(str(yaml), "scenario of the recording")[0]) if yaml else None


def _split(data: xr.Dataset, signal: str) -> list[Component]:
    variable = data[signal]
    others = [str(dim) for dim in variable.dims if dim != "time"]
    labels = [
        [str(label) for label in data[dim].values] if dim in data.coords else [str(k) for k in range(data.sizes[dim])]
        for dim in others
    ]
    units = str(variable.attrs.get("units", "1"))
    each = units.split(", ")
    one_for_all = not others or len(each) != data.sizes[others[-1]]
    components = []
    for place in np.ndindex(*(data.sizes[dim] for dim in others)):
        names = tuple(of_dim[index] for of_dim, index in zip(labels, place, strict=True))
        unit = units if one_for_all else each[place[-1]]
        components.append(Component("_".join([signal, *names]), signal, names, place, unit))
    return components
