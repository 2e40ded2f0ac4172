"""A Diagram without its levels: its leaves, where each input comes from, and the one period they share."""

import re
from dataclasses import dataclass
from typing import Any

from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, PortDataType, System

from flipdiagram.errors import InputError, NotCompilable, first_line

Source = tuple[int | None, int]
"""(leaf, output port), or (None, input port of the whole diagram)."""


@dataclass(frozen=True)
class Leaf:
    """A leaf system, its path in the diagram ("controller::pd"), and the source of each of its input ports."""

    name: str
    system: Any
    sources: tuple[Source | None, ...]

    @property
    def label(self) -> str:
        """The name with the type, for messages."""
        return f"'{self.name}' ({type(self.system).__name__})"

    def converted(self, scalar: str) -> Any:
        """The system over "symbolic" or "AutoDiffXd"; NotCompilable, which names it, where it has no such form."""
        convert = self.system.ToSymbolicMaybe if scalar == "symbolic" else self.system.ToAutoDiffXdMaybe
        problem = f"block {self.label} does not convert to {scalar}"
        try:
            system = convert()
        except Exception as error:  # raised by the conversion of a block written in Python
            raise NotCompilable(f"{problem}: {first_line(error)}") from error
        if system is None:
            raise NotCompilable(f"{problem}; valid are blocks of Drake's that do, and TemplateSystems of your own")
        return system


@dataclass(frozen=True)
class Port:
    """A vector port of the whole diagram; ``source`` is the leaf output behind an output."""

    name: str
    index: int
    size: int
    source: Source | None = None


@dataclass(frozen=True)
class Structure:
    """All leaves of a diagram in its own order, and its exported vector ports."""

    diagram: Any
    leaves: tuple[Leaf, ...]
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]


def flatten(diagram: Any) -> Structure:
    """The structure of a Diagram (or of a single leaf) over float; raises InputError for anything else."""
    if not isinstance(diagram, System):
        problem = f"{type(diagram).__name__} is no System"
        raise InputError.of("diagram", diagram, "a Drake Diagram over float", problem)
    blocks: list[tuple[str, Any, list[Any]]] = []
    alive: list[Any] = [diagram]  # identities are compared, so every object met stays alive until the end

    def visit(system: Any, path: str, bindings: list[Any]) -> None:
        if not isinstance(system, Diagram):
            blocks.append((path or readable_name(system, 0), system, bindings))
            return
        wires = {(id(s), int(i)): (o, int(j)) for (s, i), (o, j) in system.connection_map().items()}
        for exported in range(system.num_input_ports()):
            for target, index in system.GetInputPortLocators(InputPortIndex(exported)):
                wires[id(target), int(index)] = bindings[exported]
        for position, part in enumerate(system.GetSystems()):
            alive.append(part)
            name = readable_name(part, position)
            ports = [wires.get((id(part), i)) for i in range(part.num_input_ports())]
            visit(part, f"{path}::{name}" if path else name, ports)

    visit(diagram, "", [(None, i) for i in range(diagram.num_input_ports())])
    places = {id(system): place for place, (_, system, _) in enumerate(blocks)}

    def resolve(system: Any, port: int) -> Source:
        while isinstance(system, Diagram):
            system, index = system.get_output_port_locator(OutputPortIndex(port))
            port = int(index)
        return (None if system is None else places[id(system)]), port

    leaves = tuple(
        Leaf(name, system, tuple(None if b is None else resolve(*b) for b in bindings))
        for name, system, bindings in blocks
    )
    inputs = [diagram.get_input_port(i) for i in range(diagram.num_input_ports())]
    outputs = [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
    return Structure(
        diagram,
        leaves,
        tuple(Port(p.get_name(), i, p.size()) for i, p in enumerate(inputs) if is_vector(p)),
        tuple(Port(p.get_name(), i, p.size(), resolve(diagram, i)) for i, p in enumerate(outputs) if is_vector(p)),
    )


def is_vector(port: Any) -> bool:
    """Whether a port carries a vector, not an abstract value."""
    return bool(port.get_data_type() == PortDataType.kVectorValued)


def readable_name(system: Any, position: int) -> str:
    """A system's name; "Adder@3" for one left unnamed, whose automatic name is an address in memory."""
    name = system.get_name()
    return f"{type(system).__name__}@{position}" if not name or re.search(r"@[0-9a-f]{8,}$", name) else name


def timings(leaf: Leaf) -> list[tuple[float, float]]:
    """The (period, offset) [s] pairs of a leaf's periodic discrete updates."""
    unique = leaf.system.GetUniquePeriodicDiscreteUpdateAttribute()
    if unique is not None:
        return [(unique.period_sec(), unique.offset_sec())]
    try:  # no other public way to tell none from several
        leaf.system.EvalUniquePeriodicDiscreteUpdate(leaf.system.CreateDefaultContext())
    except RuntimeError as error:
        pairs = re.findall(r"\(([-+.\de]+),([-+.\de]+)\)", str(error))
        return [(float(period), float(offset)) for offset, period in pairs]
    return []


def common_timing(structure: Structure) -> tuple[float, float]:
    """The (period, offset) [s] of all discrete updates; NotCompilable where there is none, or more than one."""
    users: dict[tuple[float, float], list[str]] = {}
    for leaf in structure.leaves:
        for timing in timings(leaf):
            users.setdefault(timing, []).append(leaf.name)
    if not users:
        raise NotCompilable("no block has a periodic discrete update; valid is a diagram of sampled blocks")
    if len(users) > 1:
        listed = "; ".join(
            f"{period:g} s" + (f" from {offset:g} s" if offset else "") + f": {', '.join(names)}"
            for (period, offset), names in sorted(users.items())
        )
        raise NotCompilable(f"the blocks have several periods ({listed}); valid is one period with one offset")
    return next(iter(users))


def check_states(structure: Structure) -> None:
    """NotCompilable, naming the block, where a state is continuous or abstract."""
    for leaf in structure.leaves:
        for kind in ("continuous", "abstract"):
            if getattr(leaf.system, f"num_{kind}_states")():
                raise NotCompilable(f"block {leaf.label} has {kind} state; valid is discrete vector state")
