"""Which nodes of a program are computed once per channel, once per tick, and only where outputs are asked for."""

from __future__ import annotations

from typing import Literal

from flipdiagram.compiled.graph import ATOMS
from flipdiagram.compiled.read import Program

Section = Literal["channel", "tick", "row"]


class Sections:
    """All nodes that a program needs, operands first, each in one section.

    "channel": depends on parameters alone; "tick": the next state needs it; "row": only an output does.
    """

    def __init__(self, program: Program) -> None:
        self._nodes = program.graph.nodes
        graph, update, outputs = program.graph, set(program.update), set(program.outputs)
        self.order = sorted(graph.needed(update | outputs))
        self._in_tick = graph.needed(update)
        self.fixed: set[int] = set()
        for i in self.order:
            operands = graph.operands(i)
            if self._nodes[i][0] in ("constant", "parameter") or (operands and self.fixed.issuperset(operands)):
                self.fixed.add(i)

    def of(self, i: int) -> Section:
        """The section of a node."""
        return "channel" if i in self.fixed else "tick" if i in self._in_tick else "row"

    def members(self, section: Section) -> list[int]:
        """The nodes of a section that are computed, in order."""
        return [i for i in self.order if self.of(i) == section and self._nodes[i][0] not in ATOMS]

    def used(self, kind: str) -> list[int]:
        """Places of the states, inputs or parameters that are read."""
        return sorted(self._nodes[i][1] for i in self.order if self._nodes[i][0] == kind)

    def has_time(self) -> bool:
        """Whether time is read."""
        return any(self._nodes[i] == ("time",) for i in self.order)
