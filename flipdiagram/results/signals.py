"""The signals of a recording one by one: flat names such as `x_y` and `tau_S`, and the unit of each."""

import difflib
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.errors import InputError
from flipdiagram.scenario import text
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.yaml_reader import read_mapping


def components(data: xr.Dataset, signal: str | None = None) -> list[xr.DataArray]:
    """The components of one signal, or of all that depend on time, over time alone; InputError for an unknown signal.

    Each has its flat name, and in attrs its `units`, the `signal` it belongs to, its `labels` and its `place` there.
    `signal` may be a flat name ('tau_S'), which gives that component alone.
    """
    if signal is not None and signal in data.data_vars and "time" in data[signal].dims:
        return _split(data[signal])
    everything = [part for variable in data.data_vars.values() if "time" in variable.dims for part in _split(variable)]
    if signal is None:
        return everything
    named = [part for part in everything if part.name == signal]
    if not named:
        names = list(dict.fromkeys(part.attrs["signal"] for part in everything))
        near = difflib.get_close_matches(signal, [*names, *(str(part.name) for part in everything)], n=1)
        meant = f"did you mean '{near[0]}'? " if near else ""
        parts = [part.name for part in everything if part.attrs["signal"] != part.name]
        example = f", or one component such as '{parts[0]}'" if parts else ""
        message = f"unknown signal '{signal}'; {meant}valid are {', '.join(names)}{example}"
        raise InputError(message, field="signal", value=signal, valid=names)
    return named


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


def _split(variable: xr.DataArray) -> list[xr.DataArray]:
    others = [dim for dim in variable.dims if dim != "time"]
    units = str(variable.attrs.get("units", "1"))
    each = units.split(", ")
    one_for_all = not others or len(each) != variable.sizes[others[-1]]
    parts = []
    for place in np.ndindex(*(variable.sizes[dim] for dim in others)):
        part = variable.isel(dict(zip(others, place, strict=True))).astype(np.float64)
        labels = [str(part[dim].item()) if dim in part.coords else str(k) for dim, k in zip(others, place, strict=True)]
        part.attrs = {"units": units if one_for_all else each[place[-1]], "signal": str(variable.name)}
        part.attrs |= {"labels": labels, "place": place}
        parts.append(part.drop_vars(others, errors="ignore").rename("_".join([str(variable.name), *labels])))
    return parts
