"""Names of parameters, states, inputs and outputs, and the flat vectors behind them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.structure import Structure
from flipdiagram.errors import InputError


class Names:
    """An ordered map: name -> places in a flat vector, with other spellings and "name[i]" for one element."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.places: dict[str, Indices] = {}
        self.spellings: dict[str, str] = {}
        self.size = 0

    def append(self, name: str, size: int) -> Indices:
        """Give ``name`` the next ``size`` places."""
        self.places[name] = np.arange(self.size, self.size + size)
        self.size += size
        return self.places[name]

    def find(self, name: str) -> Indices:
        """The places of a name or of one of its elements; InputError lists the valid names."""
        base, element = name, None
        if self.spellings.get(name, name) not in self.places and (match := re.fullmatch(r"(.*)\[(\d+)\]", name)):
            base, element = match[1], int(match[2])
        places = self.places.get(self.spellings.get(base, base))
        if places is None or (element is not None and element >= places.size):
            valid = ", ".join(f"{n}[0..{p.size - 1}]" if p.size > 1 else n for n, p in self.places.items())
            message = f"unknown {self.kind} '{name}'; choose from {valid or 'none: there are none'}"
            raise InputError(message, field=self.kind, value=name, valid=list(self.places))
        return places if element is None else places[element : element + 1]

    def sizes(self) -> dict[str, int]:
        """Name -> size."""
        return {name: places.size for name, places in self.places.items()}

    def elements(self) -> list[str]:
        """One name per place: "dob[0]", or "dob" where the size is 1."""
        names = [""] * self.size
        for name, places in self.places.items():
            for i, place in enumerate(places):
                names[place] = f"{name}[{i}]" if places.size > 1 else name
        return names

    def split(self, values: Floats) -> dict[str, Floats]:
        """Name -> its columns of ``values`` (..., size)."""
        return {name: values[..., places] for name, places in self.places.items()}

    def spread(self, given: Mapping[str, ArrayLike], default: Floats) -> Floats:
        """Rows (1 or n, size) with the values given by name, shapes as in ``rows_of``, and elsewhere ``default``."""
        rows = {name: rows_of(self.kind, name, value, self.find(name).size) for name, value in given.items()}
        count = common_count({f"{self.kind} '{name}'": len(array) for name, array in rows.items()})
        result = np.tile(np.asarray(default, dtype=float), (count, 1))
        for name, array in rows.items():
            result[:, self.find(name)] = array
        return result


def rows_of(kind: str, name: str, value: ArrayLike, size: int) -> Floats:
    """``value`` as rows (1 or n, size): a number or (size,) for all channels, (n, size), (n,) where size is 1."""
    array = _finite(kind, name, value)
    if array.ndim == 0:
        return np.full((1, size), float(array))
    if array.ndim == 1:
        if size == 1:
            return array[:, None]
        array = array[None]
    if array.ndim != 2 or array.shape[1] != size or array.shape[0] == 0:
        valid = "a number or (channels,)" if size == 1 else f"({size},) or (channels, {size})"
        raise InputError.of(name, np.shape(value), valid, f"{kind} '{name}' has shape {np.shape(value)}")
    return array


def series_of(name: str, value: ArrayLike, size: int) -> Floats:
    """An input as (1 or n, rows, size): a series, else constant as in ``rows_of``."""
    array = _finite("input", name, value)
    if array.ndim == 2 and size == 1:
        array = array[:, :, None]
    if array.ndim == 3:
        if array.shape[2] != size or 0 in array.shape:
            problem = f"input '{name}' has shape {np.shape(value)}"
            raise InputError.of(name, np.shape(value), f"(channels, rows, {size})", problem)
        return array
    return rows_of("input", name, array, size)[:, None, :]


def common_count(counts: Mapping[str, int]) -> int:
    """The number of channels that all share, where 1 means any; InputError names two that differ."""
    several = {name: count for name, count in counts.items() if count != 1}
    if len(set(several.values())) > 1:
        listed = ", ".join(f"{name}: {count}" for name, count in several.items())
        raise InputError(f"the numbers of channels differ ({listed}); valid is one number, or 1")
    return next(iter(several.values()), 1)


def _finite(kind: str, name: str, value: ArrayLike) -> Floats:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError.of(name, value, "a number or several", f"{kind} '{name}' = {value!r}") from None
    if not np.isfinite(array).all():
        raise InputError.of(name, value, "what is finite", f"{kind} '{name}' holds nan or infinity")
    return array


@dataclass(frozen=True)
class Layout:
    """Where each numeric parameter group and state group of each leaf stands in the flat vectors.

    ``parameter_places[leaf][group]`` and ``state_places[leaf][group]`` are places; a leaf's continuous state,
    where it has one, is its last state group.
    """

    structure: Structure
    parameters: Names
    states: Names
    inputs: Names
    outputs: Names
    parameter_places: tuple[tuple[Indices, ...], ...]
    state_places: tuple[tuple[Indices, ...], ...]

    def read_parameters(self, context: Any) -> Floats:
        """The flat parameter vector of a context of the whole diagram (of tied ones, the first)."""
        vector = np.empty(self.parameters.size)
        for part, owned, _ in reversed(self._parts(context)):
            for g, places in reversed(list(enumerate(owned))):
                vector[places] = part.get_numeric_parameter(g).CopyToVector()
        return vector

    def read_state(self, context: Any) -> Floats:
        """The flat state vector of a context of the whole diagram."""
        vector = np.empty(self.states.size)
        for part, _, held in self._parts(context):
            discrete = part.num_discrete_state_groups()
            for g, places in enumerate(held):
                value = part.get_discrete_state(g) if g < discrete else part.get_continuous_state_vector()
                vector[places] = value.CopyToVector()
        return vector

    def write(self, context: Any, parameters: Floats, state: Floats) -> None:
        """Set flat parameters and state in a context of the whole diagram."""
        for part, owned, held in self._parts(context):
            for g, places in enumerate(owned):
                part.get_mutable_numeric_parameter(g).SetFromVector(parameters[places])
            for g, places in enumerate(held):
                if g < part.num_discrete_state_groups():
                    part.SetDiscreteState(g, state[places])
                else:
                    part.SetContinuousState(state[places])

    def _parts(self, context: Any) -> list[tuple[Any, tuple[Indices, ...], tuple[Indices, ...]]]:
        """The context of each leaf, with the places of its parameter and state groups."""
        contexts = (leaf.system.GetMyContextFromRoot(context) for leaf in self.structure.leaves)
        return list(zip(contexts, self.parameter_places, self.state_places, strict=True))


def lay_out(structure: Structure, tie: Mapping[str, Sequence[str]] | None = None) -> Layout:
    """Name everything; ``tie`` replaces several parameters by one of the caller's."""
    parameters, states = Names("parameter"), Names("state")
    owned: list[tuple[Indices, ...]] = []
    held: list[tuple[Indices, ...]] = []
    for leaf in structure.leaves:
        context = leaf.system.CreateDefaultContext()
        sizes = [context.get_numeric_parameter(g).size() for g in range(context.num_numeric_parameter_groups())]
        readable = getattr(leaf.system, "numeric_parameter_names", ())
        places = []
        for g, size in enumerate(sizes):
            name = f"{leaf.name}.{readable[g] if g < len(readable) else g}"
            parameters.spellings[f"{leaf.name}.{g}"] = name
            places.append(parameters.append(name, size))
        owned.append(tuple(places))
        groups = [context.get_discrete_state(g).size() for g in range(context.num_discrete_state_groups())]
        if context.num_continuous_states():
            groups.append(context.num_continuous_states())
        names = [leaf.name] if len(groups) == 1 else [f"{leaf.name}.{g}" for g in range(len(groups))]
        held.append(tuple(states.append(name, size) for name, size in zip(names, groups, strict=True)))
    inputs, outputs = Names("input"), Names("output")
    for names_of, ports in ((inputs, structure.inputs), (outputs, structure.outputs)):
        for port in ports:
            names_of.append(port.name, port.size)
    if tie:
        parameters, owned = _tied(parameters, owned, tie)
    return Layout(structure, parameters, states, inputs, outputs, tuple(owned), tuple(held))


def _tied(
    names: Names, owned: list[tuple[Indices, ...]], tie: Mapping[str, Sequence[str]]
) -> tuple[Names, list[tuple[Indices, ...]]]:
    """Names and places with each tie in one place."""
    representative = np.arange(names.size)
    tied: set[int] = set()
    for new, members in tie.items():
        if new in names.places or new in names.spellings:
            raise InputError(f"tie: '{new}' is the name of a parameter already; choose another", field="tie", value=new)
        places_of = {member: names.find(member) for member in members}
        if len({places.size for places in places_of.values()}) != 1:
            sizes = ", ".join(f"{member}: {places.size}" for member, places in places_of.items())
            raise InputError.of("tie", sizes, "one size", f"tie: '{new}' joins parameters of different sizes ({sizes})")
        for member, places in places_of.items():
            if tied.intersection(places.tolist()):
                raise InputError.of("tie", member, "one name for each", f"tie: '{member}' of '{new}' is tied already")
            tied.update(places.tolist())
            representative[places] = names.find(members[0])
    kept, place = np.unique(representative, return_inverse=True)
    result = Names(names.kind)
    result.size = int(kept.size)
    result.places = {new: place[names.find(members[0])] for new, members in tie.items()}
    result.places |= {n: place[places] for n, places in names.places.items() if not tied.issuperset(places.tolist())}
    result.spellings = {k: v for k, v in names.spellings.items() if v in result.places}
    return result, [tuple(place[places] for places in groups) for groups in owned]
