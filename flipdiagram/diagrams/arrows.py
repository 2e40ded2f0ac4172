"""The arrows of a figure, each written on a line by its signal and the boxes at its ends."""

from collections.abc import Collection, Mapping
from functools import partial

from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder, PassThrough

from flipdiagram.diagrams.replacement import misfit

OUTSIDE = None
"""In the place of a box: the signal comes from outside the figure."""


class Arrows:
    """Draws a figure into a DiagramBuilder: `arrow("a_ref", pd, inverse_jacobian)`.

    An arrow leads from the output port of its signal's name to the input port of that name; at a sum (`sum`) from its
    one output, or to its next free input.  A box of the user's own need not take every arrow to it: `complete` gives
    it those signals of the figure that it takes instead.

    Args:
        builder: where the boxes are.
        inputs: what comes from outside, by signal: the port it comes from, or the size of the input port that the
            diagram then gets for it.
        own: boxes of the user's own.
        outputs: signals of the boxes, for those of the user's own.
    """

    def __init__(
        self,
        builder: DiagramBuilder,
        inputs: Mapping[str, OutputPort | int],
        own: Collection[System] = (),
        outputs: Mapping[str, OutputPort] | None = None,
    ) -> None:
        self._builder, self._inputs, self._own = builder, inputs, own
        self._sources: dict[str, OutputPort | int] = {**inputs, **(outputs or {})}
        self._exported: set[str] = set()
        self._misfit = partial(misfit, argument="replace: " if own else "")

    def add(self, name: str, box: System) -> System:
        """Put a further box into the figure."""
        return self._builder.AddNamedSystem(name, box)

    def sum(self, name: str, terms: int, size: int) -> Adder:
        """A circle of the figure, which adds up the arrows that lead to it."""
        return self.add(name, Adder(terms, size))

    def __call__(self, signal: str, source: System | None, target: System, port: str = "") -> None:
        """Draw the arrow of a signal; `port`: the input port it leads to, where that has another name."""
        if source is OUTSIDE:
            start = self._sources[signal]
        elif isinstance(source, Adder):
            start = self._sources[signal] = source.get_output_port()
        else:
            start = source.GetOutputPort(signal)
        if isinstance(target, Adder):
            ends = [target.get_input_port(i) for i in range(target.num_input_ports())]
            self._connect(signal, start, next(end for end in ends if not self._builder.IsConnectedOrExported(end)))
            return
        self._sources.setdefault(port or signal, start)
        if target not in self._own or target.HasInputPort(port or signal):
            self._connect(signal, start, target.GetInputPort(port or signal))

    def has(self, signal: str) -> bool:
        """Whether the figure has a signal."""
        return signal in self._sources

    def source(self, signal: str) -> OutputPort:
        """The port from which a signal of the figure comes that a box makes."""
        start = self._sources[signal]
        assert not isinstance(start, int)
        return start

    def complete(self) -> None:
        """Connect the other inputs of the user's own boxes, by the names of the figure's signals.

        An input of the diagram that nothing takes ends in a box `unused_<signal>`: it is there all the same.
        """
        for box in self._own:
            self.feed(box)
        for signal in self._inputs:
            self.unused(signal)

    def feed(self, box: System) -> None:
        """Connect the inputs of a box that nothing leads to yet, by the names of the figure's signals."""
        for i in range(box.num_input_ports()):
            end = box.get_input_port(i)
            if not self._builder.IsConnectedOrExported(end):
                signal = end.get_name()
                if signal not in self._sources:
                    raise self._misfit(box.get_name(), f"input port '{signal}', which is absent here", self._sources)
                self._connect(signal, self._sources[signal], end)

    def unused(self, signal: str) -> None:
        """End a signal from outside in a box `unused_<signal>`, if it is an input of the diagram that nothing takes."""
        size = self._inputs[signal]
        if isinstance(size, int) and signal not in self._exported:
            self._connect(signal, size, self.add(f"unused_{signal}", PassThrough(size)).get_input_port())

    def _connect(self, signal: str, start: OutputPort | int, end: InputPort) -> None:
        size = start if isinstance(start, int) else start.size()
        if size != end.size():
            name, has = end.get_system().get_name(), f"input port '{end.get_name()}' has size {end.size()}"
            raise self._misfit(name, has, f"{size}")
        if not isinstance(start, int):
            self._builder.Connect(start, end)
        elif signal in self._exported:
            self._builder.ConnectInput(signal, end)
        else:
            self._builder.ExportInput(end, signal)
            self._exported.add(signal)
