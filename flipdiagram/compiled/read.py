"""Reads what each block computes, block by block, through its symbolic form, and joins the blocks in one graph."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from pydrake.symbolic import Expression, Variable

from flipdiagram.compiled.graph import Graph, Translator, Unprintable
from flipdiagram.compiled.layout import Layout
from flipdiagram.compiled.structure import Leaf, check_states, common_timing, is_vector, timings
from flipdiagram.errors import NotCompilable, first_line

Signal = tuple[int, int, int]
"""(leaf, output port, element)."""


@dataclass(frozen=True)
class Program:
    """One tick of a diagram: the nodes of the next state and of the outputs, flat, in the order of the layout."""

    graph: Graph
    period: float
    offset: float
    update: tuple[int, ...]
    outputs: tuple[int, ...]

    def inputs_used(self) -> set[int]:
        """Places of the inputs that the update or an output reads."""
        nodes = (self.graph.nodes[i] for i in self.graph.needed((*self.update, *self.outputs)))
        return {node[1] for node in nodes if node[0] == "input"}


@dataclass
class _SymbolicLeaf:
    """A leaf over Expression with a variable in the place of every number."""

    leaf: Leaf
    system: Any
    context: Any
    variables: dict[int, tuple[Any, ...]] = field(default_factory=dict)
    outputs: dict[int, list[Any]] = field(default_factory=dict)

    def symbols(self, size: int, *key: Any) -> Any:
        """New variables, remembered as (*key, element)."""
        variables = [Variable(f"{key[0]}{i}") for i in range(size)]
        self.variables.update({variable.get_id(): (*key, i) for i, variable in enumerate(variables)})
        return np.array([Expression(variable) for variable in variables])

    def keys(self, expression: Any) -> Iterator[tuple[Any, ...]]:
        """What the free variables of an expression stand for."""
        return (self.variables[variable.get_id()] for variable in expression.GetVariables())


def read_program(layout: Layout) -> Program:
    """The program of a diagram; NotCompilable names the block that has no symbolic or no printed form."""
    check_states(layout.structure)
    period, offset = common_timing(layout.structure)
    # Drake's Expression keeps pointers in the payload of a NaN; NumPy reports the flags its comparisons leave
    with np.errstate(invalid="ignore"):
        return _Reader(layout).program(period, offset)


class _Reader:
    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._leaves = [_symbolic(leaf) for leaf in layout.structure.leaves]
        self._graph = Graph()
        self._signals: dict[Signal, int] = {}
        self._translators = [Translator(self._graph, partial(self._node, at)) for at in range(len(self._leaves))]

    def program(self, period: float, offset: float) -> Program:
        updates = [self._update(at) for at in range(len(self._leaves))]
        exported = [port.source for port in self._layout.structure.outputs]
        roots = [(at, expression) for at, update in enumerate(updates) for group in update for expression in group]
        self._join(roots, [(s[0], s[1]) for s in exported if s is not None and s[0] is not None])
        places = [self._translate(at, expression, "its update") for at, expression in roots]
        outputs: list[int] = []
        for port in self._layout.structure.outputs:
            assert port.source is not None
            outputs += [self._signal(port.source, i) for i in range(port.size)]
        return Program(self._graph, period, offset, tuple(places), tuple(outputs))

    def _update(self, at: int) -> list[list[Any]]:
        """The next value of each state group of a leaf; a state that no event updates keeps its value."""
        part = self._leaves[at]
        groups = range(part.context.num_discrete_state_groups())
        if not timings(part.leaf):
            return [list(part.context.get_discrete_state(g).CopyToVector()) for g in groups]
        try:
            values = part.system.EvalUniquePeriodicDiscreteUpdate(part.context)
        except Exception as error:  # whatever a block's Python raises when it meets an Expression
            raise NotCompilable(
                f"the update of block {part.leaf.label} cannot be evaluated symbolically: {first_line(error)}"
            ) from error
        return [list(values.get_vector(g).CopyToVector()) for g in groups]

    def _output(self, at: int, port: int) -> list[Any]:
        part = self._leaves[at]
        if port not in part.outputs:
            output = part.system.get_output_port(port)
            try:
                if not is_vector(output):
                    raise TypeError("it is abstract-valued")
                part.outputs[port] = list(output.Eval(part.context))
            except Exception as error:  # as above
                raise NotCompilable(
                    f"output '{output.get_name()}' of block {part.leaf.label} cannot be evaluated symbolically:"
                    f" {first_line(error)}"
                ) from error
        return part.outputs[port]

    def _join(self, roots: list[tuple[int, Any]], exported: list[tuple[Any, int]]) -> None:
        """Translate every signal that roots and exported ports depend on, sources first."""
        waiting = [signal for at, expression in roots for signal in self._inputs(at, expression)]
        waiting += [(at, port, i) for at, port in exported for i in range(len(self._output(at, port)))]
        sources: dict[Signal, list[Signal]] = {}
        while waiting:
            signal = waiting.pop()
            if signal not in sources:
                at, port, element = signal
                sources[signal] = self._inputs(at, self._output(at, port)[element])
                waiting.extend(sources[signal])
        for at, port, element in TopologicalSorter(sources).static_order():
            name = self._leaves[at].system.get_output_port(port).get_name()
            place = self._translate(at, self._leaves[at].outputs[port][element], f"its output '{name}'")
            self._signals[at, port, element] = place

    def _inputs(self, at: int, expression: Any) -> list[Signal]:
        """The signals of other leaves that an expression of a leaf reads."""
        signals = []
        for kind, *rest in self._leaves[at].keys(expression):
            source = self._leaves[at].leaf.sources[rest[0]] if kind == "u" else None
            if source is not None and source[0] is not None:
                signals.append((source[0], source[1], rest[1]))
        return signals

    def _translate(self, at: int, expression: Any, where: str) -> int:
        try:
            return self._translators[at].expression(expression)
        except (Unprintable, RecursionError) as error:
            reason = "is nested too deeply" if isinstance(error, RecursionError) else f"holds {error}"
            message = f"block {self._leaves[at].leaf.label} has no printed form: {where} {reason}"
            raise NotCompilable(message) from None

    def _node(self, at: int, variable: int) -> int:
        kind, *rest = self._leaves[at].variables[variable]
        if kind == "t":
            return self._graph.add("time")
        if kind == "u":
            source = self._leaves[at].leaf.sources[rest[0]]
            assert source is not None
            return self._signal(source, rest[1])
        places = self._layout.state_places if kind == "x" else self._layout.parameter_places
        return self._graph.add("state" if kind == "x" else "parameter", int(places[at][rest[0]][rest[1]]))

    def _signal(self, source: tuple[int | None, int], element: int) -> int:
        if source[0] is not None:
            return self._signals[source[0], source[1], element]
        name = self._layout.structure.diagram.get_input_port(source[1]).get_name()
        return self._graph.add("input", int(self._layout.inputs.places[name][element]))


def _symbolic(leaf: Leaf) -> _SymbolicLeaf:
    system = leaf.converted("symbolic")
    context = system.CreateDefaultContext()
    part = _SymbolicLeaf(leaf, system, context)
    # the order of creation is the order in which Drake sorts the terms of a sum: x before u, as in A x + B u
    context.SetTime(part.symbols(1, "t")[0])
    for g in range(context.num_discrete_state_groups()):
        context.SetDiscreteState(g, part.symbols(context.get_discrete_state(g).size(), "x", g))
    for i, source in enumerate(leaf.sources):
        port = system.get_input_port(i)
        if source is not None and is_vector(port):
            port.FixValue(context, part.symbols(port.size(), "u", i))
    for g in range(context.num_numeric_parameter_groups()):
        group = context.get_mutable_numeric_parameter(g)
        group.SetFromVector(part.symbols(group.size(), "p", g))
    return part
