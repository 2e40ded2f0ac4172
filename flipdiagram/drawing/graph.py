"""What a drawing shows: the boxes and arrows of a Drake Diagram, down to a depth, in an order of its own."""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from pydrake.systems.framework import Diagram, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder, VectorLogSink

from flipdiagram.errors import InputError

_ADDRESS = re.compile(r"@[0-9a-f]{6,}")
_GENERIC = re.compile(r"(?:u|y|sum|in|out|input|output|data)_?\d*")
"""Names that Drake's own systems give their ports, which say nothing of the signal."""

Names = tuple[str, ...]


@dataclass(frozen=True)
class Box:
    """What a drawing shows as one: a leaf system, a closed sub-diagram or group, or a port of the whole diagram."""

    path: Names
    """Names from the outermost open sub-diagram to the box itself."""
    kind: str
    """`box`, `sum` (a Drake Adder), `closed` (a sub-diagram or group not opened), `input` or `output`."""
    systems: tuple[tuple[Names, System], ...]
    """The leaf systems that it stands for, with their full paths."""

    @property
    def name(self) -> str:
        """The last name of the path; of a port of the diagram that port's own."""
        return self.path[-1].removesuffix(f" ({self.kind})")


@dataclass(frozen=True)
class Arrow:
    """One connection between two boxes, of a signal from port to port."""

    source: Names
    target: Names
    signal: str
    """Name of the signal after its ports; empty where they have none of their own (Drake's u0, y0, sum)."""
    source_port: str
    """Full name of the output port, such as `robot/joint_state.y0`."""
    target_port: str


@dataclass(frozen=True)
class Graph:
    """Boxes in the order in which the diagram was built, and arrows in the order of their targets."""

    boxes: tuple[Box, ...]
    arrows: tuple[Arrow, ...]
    open_paths: tuple[Names, ...]
    """Sub-diagrams and groups that are drawn open, outermost first."""
    diagram: Diagram
    ports: Collection[str] | None = None
    """Names of the diagram's ports that were read; None: all."""


@dataclass(frozen=True)
class _End:
    """A port of a box; `names` of it from the outermost open sub-diagram that exports it to the box's own."""

    path: Names
    names: tuple[str, ...]
    port: str


def read_graph(
    diagram: Diagram,
    *,
    depth: int = 0,
    groups: Mapping[str, Collection[str]] | None = None,
    taps: bool = False,
    ports: Collection[str] | None = None,
) -> Graph:
    """Boxes and arrows of a diagram; see `flipdiagram.drawing.draw` for the arguments and the errors.

    ports: names of the diagram's ports that are read, None for all.
    """
    if isinstance(depth, bool) or not isinstance(depth, int) or depth < 0:
        raise InputError.of("depth", depth, "a whole number >= 0")
    return _Reader(diagram, depth, groups or {}, taps, ports).read()


def full_name(path: Names) -> str:
    """A path as one name, which Graphviz keeps as it is."""
    return "/".join(path).replace("\\", "∖").replace("\n", " ")


def class_of(system: System) -> str:
    """Name of a system's class without its scalar type."""
    return re.sub(r"_?𝓣.*", "", type(system).__name__)


def leaves(path: Names, system: System) -> Iterator[tuple[Names, System]]:
    """The leaf systems of a system with their paths, in the order in which they were added."""
    if not isinstance(system, Diagram):
        yield path, system
        return
    for name, inner in named_systems(system):
        yield from leaves((*path, name), inner)


def named_systems(diagram: Diagram) -> list[tuple[str, System]]:
    """Systems of a diagram and their names; one that has none, for which Drake takes its address, goes by its class."""
    systems = list(diagram.GetSystems())
    taken = {system.get_name() for system in systems}
    named = []
    for system in systems:
        name = system.get_name()
        if not name or _ADDRESS.search(name):
            stem = name = class_of(system)
            count = 1
            while name in taken:
                count += 1
                name = f"{stem}_{count}"
            taken.add(name)
        named.append((name, system))
    return named


class _Reader:
    """One reading of a diagram: which path each system has, and which of the paths are shown."""

    def __init__(
        self,
        diagram: Diagram,
        depth: int,
        groups: Mapping[str, Collection[str]],
        taps: bool,
        ports: Collection[str] | None,
    ) -> None:
        self._diagram, self._depth, self._taps, self._ports = diagram, depth, taps, ports
        inputs = [diagram.get_input_port(i) for i in range(diagram.num_input_ports())]
        outputs = [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
        self._inputs = [port for port in inputs if ports is None or port.get_name() in ports]
        self._outputs = [port for port in outputs if ports is None or port.get_name() in ports]
        self._group_of = _group_of(diagram, groups)
        self._paths: dict[System, Names] = {}
        self._boxes: dict[Names, Box] = {}
        self._open: list[Names] = []
        self._arrows: list[Arrow] = []

    def read(self) -> Graph:
        self._add_boxes(self._diagram, ())
        for port in self._inputs:
            targets = self._targets(port)
            if targets:
                source = self._add_terminal(port.get_name(), "input")
                for target in targets:
                    self._add_arrow(_End(source, (), port.get_name()), target)
        self._connect(self._diagram)
        closed_loop = not self._inputs
        carried = {arrow.source_port for arrow in self._arrows}
        for port in self._outputs:
            end = self._source(port)
            if end is None or (closed_loop and not self._taps and end.port in carried):
                continue
            self._add_arrow(end, _End(self._add_terminal(port.get_name(), "output"), (), port.get_name()))
        return Graph(tuple(self._boxes.values()), tuple(self._arrows), tuple(self._open), self._diagram, self._ports)

    def _add_boxes(self, diagram: Diagram, above: Names) -> None:
        for name, system in named_systems(diagram):
            looks_on = isinstance(system, VectorLogSink) or getattr(system, "only_looks_on", False)
            if looks_on and not self._taps:
                continue
            group = self._group_of.get(name) if diagram is self._diagram else None
            outer = above if group is None else (*above, group)
            path = self._paths[system] = (*outer, name)
            if group is not None and len(outer) > self._depth:
                self._add_closed(outer, leaves(path, system))
                continue
            if group is not None and outer not in self._open:
                self._open.append(outer)
            if not isinstance(system, Diagram):
                kind = "sum" if isinstance(system, Adder) else "box"
                self._boxes[path] = Box(path, kind, ((path, system),))
            elif len(path) > self._depth:
                self._add_closed(path, leaves(path, system))
            else:
                self._open.append(path)
                self._add_boxes(system, path)

    def _add_closed(self, path: Names, inside: Iterator[tuple[Names, System]]) -> None:
        before = self._boxes[path].systems if path in self._boxes else ()
        self._boxes[path] = Box(path, "closed", (*before, *inside))

    def _add_terminal(self, name: str, kind: str) -> Names:
        path: Names = (name,)
        while path in self._boxes or path in self._open:
            path = (f"{path[0]} ({kind})",)
        self._boxes[path] = Box(path, kind, ())
        return path

    def _connect(self, diagram: Diagram) -> None:
        order = {system: i for i, system in enumerate(diagram.GetSystems())}
        wires = sorted(diagram.connection_map().items(), key=lambda wire: (order[wire[0][0]], int(wire[0][1])))
        for (target, i), (source, o) in wires:
            start = self._source(source.get_output_port(o))
            for end in self._targets(target.get_input_port(i)):
                if start is not None:
                    self._add_arrow(start, end)
        for inner in diagram.GetSystems():
            if isinstance(inner, Diagram) and self._paths.get(inner) in self._open:
                self._connect(inner)

    def _source(self, port: OutputPort) -> _End | None:
        """The drawn box that an output port belongs to; None where it is not drawn."""
        system, name = port.get_system(), port.get_name()
        if system is self._diagram or self._paths.get(system) in self._open:
            inner, index = system.get_output_port_locator(port.get_index())
            end = self._source(inner.get_output_port(index))
            return end and _End(end.path, (name, *end.names), end.port)
        path = self._visible(system)
        return None if path is None else _End(path, (name,), self._full_name(system, name))

    def _targets(self, port: InputPort) -> list[_End]:
        """The drawn boxes that an input port leads to."""
        system, name = port.get_system(), port.get_name()
        if system is self._diagram or self._paths.get(system) in self._open:
            order = {inside: i for i, inside in enumerate(system.GetSystems())}  # Drake's is that of their addresses
            locators = sorted(system.GetInputPortLocators(port.get_index()), key=lambda at: (order[at[0]], int(at[1])))
            inner = [inside.get_input_port(i) for inside, i in locators]
            return [_End(end.path, (name, *end.names), end.port) for inside in inner for end in self._targets(inside)]
        path = self._visible(system)
        return [] if path is None else [_End(path, (name,), self._full_name(system, name))]

    def _full_name(self, system: System, port: str) -> str:
        return f"{full_name(self._paths[system])}.{port}"

    def _visible(self, system: System) -> Names | None:
        path = self._paths.get(system)
        while path and path not in self._boxes:
            path = path[:-1]
        return path or None

    def _add_arrow(self, start: _End, end: _End) -> None:
        closed = self._boxes[start.path].kind == "closed"
        if closed and start.path == end.path and start.path[0] in self._group_of.values():
            return
        signal = ""
        if start.names and end.names:
            signal = next((name for name in (*start.names, *end.names) if not _GENERIC.fullmatch(name)), "")
        self._arrows.append(Arrow(start.path, end.path, signal, start.port, end.port))


def _group_of(diagram: Diagram, groups: Mapping[str, Collection[str]]) -> dict[str, str]:
    """Name of the group by name of the system.  Raises InputError for names that do not fit the diagram."""
    names = [name for name, _ in named_systems(diagram)]
    group_of: dict[str, str] = {}
    for group, members in groups.items():
        for name in members:
            if name not in names:
                raise InputError.of("groups", name, names, f"group '{group}' names system '{name}'")
            if name in group_of:
                message = f"system '{name}' is in groups '{group_of[name]}' and '{group}'; one is valid"
                raise InputError(message, field="groups", value=name)
            group_of[name] = group
    for group in groups:
        if group in names and group_of.get(group) != group:
            message = f"group '{group}' has the name of a system outside it; choose another name"
            raise InputError(message, field="groups", value=group)
    return group_of
