"""A diagram of Blocks as one box: the same laws, called one after another without Drake's ports between them."""

import inspect
from collections.abc import Callable
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, Diagram, LeafSystem, System, ValueProducer
from pydrake.systems.primitives import Adder, Gain

from flipdiagram.arrays import Array, Floats
from flipdiagram.blocks.block import Law


class NotFusible(Exception):
    """A system of the diagram is none whose law is known, or it has a sample time of its own."""


class Step(NamedTuple):
    """One law: where in the list of values its arguments stand, and where its value goes."""

    law: Callable[..., Any]
    arguments: tuple[int, ...]
    result: int


class Program:
    """The laws of a diagram, in an order in which each finds its arguments.

    Values stand in one list: inputs, states in the order of `boxes`, then parameters and results.

    Attributes: steps; values, the list with what is constant filled in; boxes, those with a state; outputs and
    following, where the values of the output ports and the next states of the boxes stand.
    """

    def __init__(self, diagram: Diagram) -> None:
        self._context = diagram.CreateDefaultContext()
        self._wires = {(end.get_name(), int(i)): start for (end, i), start in diagram.connection_map().items()}
        self.steps: list[Step] = []
        inputs = [diagram.get_input_port(i) for i in range(diagram.num_input_ports())]
        self.values: list[Any] = [None] * len(inputs)
        self._places: dict[Any, int] = {
            ("input", end.get_name(), int(k)): i
            for i, port in enumerate(inputs)
            for end, k in diagram.GetInputPortLocators(port.get_index())
        }
        self.boxes = [box for box in diagram.GetSystems() if self.context_of(box).num_total_states()]
        for box in self.boxes:
            self._places["state", box.get_name()] = self._place(None)
        outputs = [diagram.get_output_port(i).get_index() for i in range(diagram.num_output_ports())]
        self.outputs = [self._output(box, int(k)) for box, k in map(diagram.get_output_port_locator, outputs)]
        self.following = [self._next_state(box) for box in self.boxes]

    def context_of(self, box: System) -> Context:
        """The default Context of a box."""
        return box.GetMyContextFromRoot(self._context)

    def run(self, inputs: list[Floats], states: list[Floats]) -> list[Any]:
        """All values."""
        values = self.values.copy()
        values[: len(inputs) + len(states)] = inputs + states
        for law, arguments, result in self.steps:
            values[result] = law(*[values[k] for k in arguments])
        return values

    def _place(self, value: Any) -> int:
        self.values.append(value)
        return len(self.values) - 1

    def _step(self, law: Callable[..., Any], arguments: list[int]) -> int:
        place = self._place(None)
        self.steps.append(Step(law, tuple(arguments), place))
        return place

    def _output(self, system: Any, index: int) -> int:
        """Where the value of an output port stands; its steps are added where they are not there yet."""
        key = "output", system.get_name(), index
        if key in self._places:
            return self._places[key]
        if isinstance(system, Adder):
            place = self._step(_sum, [self._input(system, i) for i in range(system.num_input_ports())])
        elif isinstance(system, Gain):
            place = self._step(np.multiply, [self._place(_gain(system)), self._input(system, 0)])
        elif laws := getattr(system, "laws", None):
            law, which = laws[system.get_output_port(index).get_name()]
            place = self._law(system, law)
            place = place if which is None else self._step(itemgetter(which), [place])
        else:
            raise NotFusible(system.get_name())
        self._places[key] = place
        return place

    def _input(self, system: System, index: int) -> int:
        key = "input", system.get_name(), index
        if key not in self._places:
            source, port = self._wires[system.get_name(), index]
            self._places[key] = self._output(source, int(port))
        return self._places[key]

    def _law(self, box: Any, law: Law) -> int:
        """Where the value of a Block's law stands; a law of several outputs runs once."""
        key = "law", box.get_name(), law
        if key not in self._places:
            self._places[key] = self._step(
                law, [self._argument(box, name) for name in inspect.signature(law).parameters]
            )
        return self._places[key]

    def _argument(self, box: Any, name: str) -> int:
        if box.HasInputPort(name):
            return self._input(box, int(box.GetInputPort(name).get_index()))
        if name == box.state_name:
            return self._places["state", box.get_name()]
        if name == "t":
            raise NotFusible(box.get_name())
        if name in box.numeric_parameter_names:
            return self._place(box.value_in(self.context_of(box), name))
        return self._place(getattr(box, name))

    def _next_state(self, box: Any) -> int:
        if getattr(box, "next_state", None) is None:
            raise NotFusible(box.get_name())
        return self._law(box, box.next_state)


class Fused(LeafSystem):
    """What a diagram of Blocks computes: its input and output ports by name, its states, its sample time.

    Equal to the diagram to the bit.  Parameters are those of its default Context; all outputs are computed at once, so
    each depends on every input.  Raises NotFusible where a system is neither a Block with laws of vectors nor an Adder
    or Gain of Drake's, and where sample times differ.
    """

    def __init__(self, diagram: Diagram) -> None:
        super().__init__()
        program = self._program = Program(diagram)
        for i in range(diagram.num_input_ports()):
            port = diagram.get_input_port(i)
            self.DeclareVectorInputPort(port.get_name(), port.size())
        self._inputs = [self.get_input_port(i) for i in range(self.num_input_ports())]
        states = [program.context_of(box).get_discrete_state_vector().CopyToVector() for box in program.boxes]
        self._splits = [
            slice(end - len(w), end) for w, end in zip(states, np.cumsum([len(w) for w in states]), strict=True)
        ]
        producer = ValueProducer(lambda: Value[object](), lambda context, value: value.set_value(self._run(context)))
        self._all = self.DeclareCacheEntry("values", producer, {self.all_input_ports_ticket(), self.xd_ticket()})
        if states:
            timing = {(box.period, box.offset) for box in program.boxes}
            if len(timing) > 1:
                raise NotFusible(", ".join(box.get_name() for box in program.boxes))
            self.DeclareDiscreteState(np.concatenate(states))
            self.DeclarePeriodicDiscreteUpdateEvent(*timing.pop(), self._update)
        for i, place in enumerate(program.outputs):
            port = diagram.get_output_port(i)
            self.DeclareVectorOutputPort(
                port.get_name(),
                port.size(),
                lambda context, output, place=place: output.set_value(self._all.Eval(context)[place]),
                {self._all.ticket()},
            )

    def _run(self, context: Context) -> list[Any]:
        state = context.get_discrete_state_vector().CopyToVector() if self._splits else ()
        return self._program.run([port.Eval(context) for port in self._inputs], [state[k] for k in self._splits])

    def _update(self, context: Context, state: Any) -> None:
        values = self._all.Eval(context)
        state.set_value(np.concatenate([values[k] for k in self._program.following]))


def _sum(*terms: Array) -> Array:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def _gain(system: Gain) -> Floats:
    """What a Gain multiplies by, which it does not tell."""
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, np.ones(system.get_input_port().size()))
    return system.get_output_port().Eval(context)
