"""Sample times, ports and direct feed-through of the systems of a drawing, as a table."""

import sys
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from pydrake.systems.framework import Diagram, InputPort, OutputPort, PortDataType, System

from flipdiagram.drawing.graph import Names, class_of, full_name, read_graph

_KINDS = ("direct", "events", "continuous", "sampled")


@dataclass(frozen=True, order=True)
class Timing:
    """When the state of a system changes."""

    rank: int
    period: float
    """[s]; 0 where not sampled."""
    offset: float
    """Of the first sample [s]."""

    @property
    def kind(self) -> str:
        """`sampled`; `continuous` (derivatives); `events` (a state without one fixed period); `direct` (no state)."""
        return _KINDS[self.rank]

    @property
    def short(self) -> str:
        """As in a box: `1 ms`."""
        if self.kind != "sampled":
            return self.kind
        return f"{1e3 * self.period:g} ms" + (f", +{1e3 * self.offset:g} ms" if self.offset else "")

    @property
    def text(self) -> str:
        """As in a table: `every 0.001 s`."""
        if self.kind != "sampled":
            return {"events": "state set by events", "direct": "direct (no state)"}.get(self.kind, self.kind)
        return f"every {self.period:g} s" + (f", offset {self.offset:g} s" if self.offset else "")


@dataclass(frozen=True)
class Port:
    """A port's name and number of elements, None for an abstract value."""

    name: str
    size: int | None

    def __str__(self) -> str:
        return f"{self.name} ({'abstract' if self.size is None else self.size})"


@dataclass(frozen=True)
class Rate:
    """One leaf system: when it is sampled, what goes in and out, and which inputs reach which outputs at once."""

    name: str
    system_class: str
    timing: Timing
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    feedthrough: tuple[tuple[str, str], ...]


class RateTable(tuple[Rate, ...]):
    """Rows of `Rate`, with a Markdown form that notebooks show."""

    def __repr__(self) -> str:
        return f"<RateTable of {len(self)} systems; to_markdown() shows them>"

    def cells(self) -> list[list[str]]:
        """The texts of the table: its headings, then a row for each system."""
        rows = [["system", "class", "sample time", "inputs", "outputs", "direct feed-through"]]
        for row in self:
            through = ", ".join(f"{i} → {o}" for i, o in row.feedthrough) or "none"
            ports = (", ".join(map(str, side)) or "–" for side in (row.inputs, row.outputs))
            rows.append([row.name, row.system_class, row.timing.text, *ports, through])
        return rows

    def to_markdown(self) -> str:
        """The table in Markdown, a row for each system."""
        head, *rows = ("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |\n" for row in self.cells())
        return "".join([head, "|---|---|---|---|---|---|\n", *rows])

    def _repr_markdown_(self) -> str:
        return self.to_markdown()


def timing_of(system: System) -> Timing:
    """When the state of a leaf system changes.

    Drake tells Python of periodic discrete updates only: other periodic events count as `events` where they have a
    state to change, and otherwise (publishing) not at all.
    """
    unique = system.GetUniquePeriodicDiscreteUpdateAttribute()
    if unique is not None:
        return Timing(_KINDS.index("sampled"), unique.period_sec(), unique.offset_sec())
    if system.num_continuous_states() > 0:
        return Timing(_KINDS.index("continuous"), 0.0, 0.0)
    stateful = system.num_abstract_states() > 0 or system.num_discrete_state_groups() > 0
    return Timing(_KINDS.index("events" if stateful else "direct"), 0.0, 0.0)


def rates_of(
    diagram: Diagram, systems: Iterable[tuple[Names, System]], unconnected: bool, ports: Collection[str] | None = None
) -> RateTable:
    """The rows of some leaf systems of a diagram, with the ports that something is connected to or with all."""
    everything = read_graph(diagram, depth=sys.maxsize, taps=True, ports=ports)
    names = {system: full_name(path) for box in everything.boxes for path, system in box.systems}
    sources, targets = ({getattr(arrow, end) for arrow in everything.arrows} for end in ("source_port", "target_port"))
    rows = []
    for path, system in systems:
        ins = [system.get_input_port(i) for i in range(system.num_input_ports())]
        outs = [system.get_output_port(o) for o in range(system.num_output_ports())]
        if not unconnected:
            ins = [port for port in ins if f"{names[system]}.{port.get_name()}" in targets]
            outs = [port for port in outs if f"{names[system]}.{port.get_name()}" in sources]
        through = tuple(
            (i.get_name(), o.get_name())
            for o in outs
            for i in ins
            if system.HasDirectFeedthrough(int(i.get_index()), int(o.get_index()))
        )
        both = tuple(map(_port, ins)), tuple(map(_port, outs))
        rows.append(Rate(full_name(path), class_of(system), timing_of(system), *both, through))
    return RateTable(rows)


def _port(port: InputPort | OutputPort) -> Port:
    return Port(port.get_name(), port.size() if port.get_data_type() == PortDataType.kVectorValued else None)
