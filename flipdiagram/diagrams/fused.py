"""A diagram of Blocks as one box: the same laws, called one after another without Drake's ports between them."""

import inspect
import operator
from collections.abc import Callable, Collection
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, Diagram, LeafSystem, System, ValueProducer
from pydrake.systems.primitives import Adder, Gain, PassThrough

from flipdiagram.arrays import Floats
from flipdiagram.blocks.block import Law
from flipdiagram.diagrams.machine_code import machine_code


class NotFusible(Exception):
    """A system of the diagram is none whose law is known, or it has a sample time of its own."""


class Step(NamedTuple):
    """One law: where in the list of values its arguments stand, and where its value goes."""

    law: Callable[..., Any] | int
    """Or which one to take of an argument that is several."""
    arguments: tuple[int, ...]
    result: int


class Program:
    """The laws of a diagram, in an order in which each finds its arguments.

    Values stand in one list: inputs, states in the order of `boxes`, parameters that may change, then what is constant
    and results.

    Attributes: steps; values, the list with what is constant filled in; boxes, those with a state; tuned, box and name
    of the parameters that may change; given, the parts of one vector that inputs, states and they are; results, where
    the values of the output ports and then the next states of the boxes stand.
    """

    def __init__(self, diagram: Diagram, tuned: Collection[str] = ()) -> None:
        """tuned: names of parameters that may change, of whatever box."""
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
        self.tuned = [
            (box, name)
            for box in diagram.GetSystems()
            for name in getattr(box, "numeric_parameter_names", ())
            if name in tuned
        ]
        for box, name in self.tuned:
            self._places["parameter", box.get_name(), name] = self._place(None)
        sizes = [self.context_of(box).num_total_states() for box in self.boxes]
        sizes += [getattr(box, name).size for box, name in self.tuned]
        self.given = slices([port.size() for port in inputs] + sizes)
        outputs = [diagram.get_output_port(i).get_index() for i in range(diagram.num_output_ports())]
        self.results = [self._output(box, int(k)) for box, k in map(diagram.get_output_port_locator, outputs)]
        self.results += [self._next_state(box) for box in self.boxes]

    def context_of(self, box: System) -> Context:
        """The default Context of a box."""
        return box.GetMyContextFromRoot(self._context)

    def run(self, given: Floats) -> Floats:
        """The results of inputs and states, one after another as they are."""
        values = self.values.copy()
        values[: len(self.given)] = [given[part] for part in self.given]
        for law, arguments, result in self.steps:
            terms = [values[k] for k in arguments]
            values[result] = terms[0][law] if isinstance(law, int) else law(*terms)
        return np.concatenate([values[k] for k in self.results])

    def _place(self, value: Any) -> int:
        self.values.append(value)
        return len(self.values) - 1

    def _step(self, law: Callable[..., Any] | int, *arguments: int) -> int:
        place = self._place(None)
        self.steps.append(Step(law, arguments, place))
        return place

    def _output(self, system: Any, index: int) -> int:
        """Where the value of an output port stands; its steps are added where they are not there yet."""
        key = "output", system.get_name(), index
        if key in self._places:
            return self._places[key]
        if isinstance(system, PassThrough):
            place = self._input(system, 0)
        elif isinstance(system, Adder):
            place = self._input(system, 0)
            for i in range(1, system.num_input_ports()):
                place = self._step(operator.add, place, self._input(system, i))
        elif isinstance(system, Gain):
            place = self._step(operator.mul, self._place(_gain(system)), self._input(system, 0))
        elif laws := getattr(system, "laws", None):
            law, which = laws[system.get_output_port(index).get_name()]
            place = self._law(system, law)
            place = place if which is None else self._step(which, place)
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
                law, *[self._argument(box, name) for name in inspect.signature(law).parameters]
            )
        return self._places[key]

    def _argument(self, box: Any, name: str) -> int:
        if box.HasInputPort(name):
            return self._input(box, int(box.GetInputPort(name).get_index()))
        if name == box.state_name:
            return self._places["state", box.get_name()]
        if name == "t":
            raise NotFusible(box.get_name())
        if name in box.laws:
            return self._law(box, box.laws[name][0])
        if ("parameter", box.get_name(), name) in self._places:
            return self._places["parameter", box.get_name(), name]
        if name in box.numeric_parameter_names:
            return self._place(box.value_in(self.context_of(box), name))
        return self._place(getattr(box, name))

    def _next_state(self, box: Any) -> int:
        if getattr(box, "next_state", None) is None:
            raise NotFusible(box.get_name())
        return self._law(box, box.next_state)


class Fused(LeafSystem):
    """What a diagram of Blocks computes: its input and output ports by name, its states, its sample time.

    Equal to the diagram to the bit; with `native`, and where its laws can be compiled, to rounding (see
    `machine_code`).  Parameters are those of its default Context but for the `tuned` ones, which are parameters of its
    own; all outputs are computed at once, so each depends on every input.  Raises NotFusible where a system is neither
    a Block with laws of vectors nor an Adder, Gain or PassThrough of Drake's, and where sample times differ.
    """

    def __init__(self, diagram: Diagram, native: bool = False, tuned: Collection[str] = ()) -> None:
        """tuned: names of the parameters that may change in a Context, of whatever box."""
        super().__init__()
        program = self._program = Program(diagram, tuned)
        compiled = machine_code(program) if native else None
        self.is_native, self.compute = compiled is not None, compiled or program.run
        for i in range(diagram.num_input_ports()):
            port = diagram.get_input_port(i)
            self.DeclareVectorInputPort(port.get_name(), port.size())
        self._inputs = [self.get_input_port(i).Eval for i in range(self.num_input_ports())]
        states = [program.context_of(box).get_discrete_state_vector().CopyToVector() for box in program.boxes]
        producer = ValueProducer(lambda: Value[object](), lambda context, value: value.set_value(self._run(context)))
        for box, name in program.tuned:
            self.DeclareNumericParameter(BasicVector(getattr(box, name)))
        tickets = {self.all_input_ports_ticket(), self.xd_ticket(), self.all_parameters_ticket()}
        everything = self.DeclareCacheEntry("values", producer, tickets)
        self._values = everything.Eval
        ports = [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
        parts = slices([port.size() for port in ports])
        self._following = slice(parts[-1].stop if parts else 0, None)
        self._has_state = bool(states)
        if states:
            timing = {(box.period, box.offset) for box in program.boxes}
            if len(timing) > 1:
                raise NotFusible(", ".join(box.get_name() for box in program.boxes))
            self.DeclareDiscreteState(np.concatenate(states))
            self.DeclarePeriodicDiscreteUpdateEvent(*timing.pop(), self._update)
        for port, part in zip(ports, parts, strict=True):
            self.DeclareVectorOutputPort(
                port.get_name(),
                port.size(),
                lambda context, output, part=part: output.set_value(self._values(context)[part]),
                {everything.ticket()},
            )

    def given(self, context: Context) -> Floats:
        """Inputs and states, one after another, as `compute` takes them."""
        parts = [read(context) for read in self._inputs]
        if self._has_state:
            parts.append(context.get_discrete_state_vector().value())
        parts += [context.get_numeric_parameter(k).value() for k in range(len(self._program.tuned))]
        return np.concatenate(parts)

    def put_state(self, context: Context, box: str, values: Floats) -> None:
        """Set what the state of a box of the diagram was, in a Context of its own; nothing where the box has none."""
        state, first = context.get_mutable_discrete_state_vector(), 0
        for one in self._program.boxes:
            size = self._program.context_of(one).num_total_states()
            if one.get_name() == box:
                state.get_mutable_value()[first : first + size] = values
            first += size

    def tune(self, context: Context, value: float) -> None:
        """Set all parameters that may change, in a Context of its own."""
        for k, (box, name) in enumerate(self._program.tuned):
            context.get_mutable_numeric_parameter(k).SetFromVector(np.full(getattr(box, name).size, value))

    def _run(self, context: Context) -> Floats:
        given = self.given(context)
        try:
            return self.compute(given)
        except np.linalg.LinAlgError:  # of machine code; the law itself says what it means
            return self._program.run(given)

    def _update(self, context: Context, state: Any) -> None:
        state.set_value(self._values(context)[self._following])


def slices(sizes: list[int]) -> list[slice]:
    """The parts of a vector that consists of vectors of these sizes."""
    return [slice(a, b) for a, b in pairwise([0, *np.cumsum(sizes, dtype=int).tolist()])]


def _gain(system: Gain) -> Floats:
    """What a Gain multiplies by, which it does not tell."""
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, np.ones(system.get_input_port().size()))
    return system.get_output_port().Eval(context)
