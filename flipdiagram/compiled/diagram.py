"""``compile_diagram``: a Drake Diagram as a native loop over many channels."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.batch import BatchDiagram, Channels
from flipdiagram.compiled.check import check as check_against_drake
from flipdiagram.compiled.fallback import SimulatedDiagram
from flipdiagram.compiled.kernel import load_kernel
from flipdiagram.compiled.layout import Layout, lay_out
from flipdiagram.compiled.linear import Linearization, linearize
from flipdiagram.compiled.printer import kernel_source
from flipdiagram.compiled.read import Program, read_program
from flipdiagram.compiled.structure import flatten
from flipdiagram.compiled.threads import run_kernel
from flipdiagram.errors import InputError, NotCompilable


class CompiledDiagram(BatchDiagram):
    """A diagram as machine code; made by ``compile_diagram``.

    ``source`` is the text it was compiled from, in LLVM's language; ``from_cache`` whether that had been done before.
    """

    def __init__(self, layout: Layout, program: Program, exact: bool) -> None:
        super().__init__(layout, program.period, program.offset, program.inputs_used())
        self.program, self.exact = program, exact
        self.source = kernel_source(program, exact)
        self._kernel, self.from_cache = load_kernel(self.source)

    def linearize(
        self,
        state: Mapping[str, ArrayLike] | ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        tick: int = 0,
    ) -> Linearization:
        """A, B, C, D about a point of one channel, exact to rounding; inputs not given are 0.

        The derivative of the branch taken, for choices (min, max, if-then-else); 0 for floor, ceil and abs at 0.
        """
        given = self._channels(0, parameters, state, dict.fromkeys(self.inputs, 0.0) | dict(inputs or {}), 0)
        if given.ticks.size != 1:
            raise InputError(f"an operating point is of one channel; {given.ticks.size} were given")
        point = given.parameters[0], given.state[0], given.inputs[0, 0]
        return linearize(self.program, self.layout, *point, int(tick))

    def advance(
        self, given: Channels, columns: Indices, rows: int, every: int = 1, threads: int | None = None
    ) -> tuple[Floats, Floats]:
        """See ``BatchDiagram.advance``."""
        return run_kernel(self._kernel, given, columns, rows, every, threads)


class SlowWarning(UserWarning):
    """A diagram has no compiled form, and is run without."""


def compile_diagram(
    diagram: Any,
    *,
    tie: Mapping[str, Sequence[str]] | None = None,
    fallback: bool = False,
    period: float | None = None,
    check: int = 200,
    exact: bool = False,
) -> CompiledDiagram | SimulatedDiagram:
    """Compile any Drake Diagram whose blocks convert to symbolic and share one period.

    >>> from pydrake.systems.framework import DiagramBuilder
    >>> from pydrake.systems.primitives import Gain, LinearSystem
    >>> builder = DiagramBuilder()
    >>> plant = builder.AddNamedSystem("plant", LinearSystem([[1.0]], [[0.5]], [[1.0]], [[0.0]], 0.1))
    >>> gain = builder.AddNamedSystem("gain", Gain(-0.5, 1))
    >>> _ = builder.Connect(plant.get_output_port(), gain.get_input_port())
    >>> _ = builder.Connect(gain.get_output_port(), plant.get_input_port())
    >>> _ = builder.ExportOutput(plant.get_output_port(), "y")
    >>> compiled = compile_diagram(builder.Build())
    >>> run = compiled.run(2, state={"plant": [1.0, 2.0, 3.0]}, log=["y"])  # three channels, two ticks
    >>> run.state["plant"].T
    array([[0.5625, 1.125 , 1.6875]])
    >>> run.log["y"][0].T
    array([[1.    , 0.75  , 0.5625]])
    >>> compiled.linearize().poles().real
    array([0.75])

    Each channel has its own state, numeric parameters and inputs; time, random parameters and trigonometry are no
    obstacle. A parameter is called by block and group, ``"pd.0"`` (in a sub-diagram ``"controller::pd.0"``), or, if the
    block has an attribute ``numeric_parameter_names``, by name: ``"pd.k_p"``. Inputs and outputs are those exported.

    Eight channels advance at once, on the processor's vectors. Every operation rounds as Drake's does, and in its
    order, but for sin, cos, exp and tanh of what changes from tick to tick: they are our own, within 2.5 units in the
    last place of the true value, where the C library's, which Drake uses, would be called channel by channel.

    Args:
        diagram: a Diagram, or a single System, over float.
        tie: names of your own for parameters that are always equal, such as {"omega": ["command.0", "meter.1"]}; what
            is computed from them is then computed once.
        fallback: a diagram that has no compiled form is run by Drake's Simulator, one channel at a time; a SlowWarning
            says so and why, a line on a terminal's stderr how far it is.
        period: tick of the fallback [s] where its blocks share none.
        check: updates, each from the state of Drake's Simulator, to compare with it before the diagram is handed over,
            to 1e-10 of the larger number, or 1e-14 of the largest state or output; 0: none.
        exact: sin, cos, exp and tanh of the C library: every number as in Drake, to the bit (but x³, of which Drake
            takes pow); a loop full of sines takes some four times as long.

    Raises NotCompilable (an InputError), which names the block and the reason: no symbolic form, continuous or
    abstract state, several periods, an expression without printed form, or a result other than Drake's.
    """
    layout = lay_out(flatten(diagram), tie)
    try:
        compiled = CompiledDiagram(layout, read_program(layout), exact)
        if check:
            check_against_drake(compiled, check)
        return compiled
    except NotCompilable as reason:
        if not fallback:
            raise
        simulated = SimulatedDiagram(layout, period)
        warnings.warn(f"{reason}; Drake's Simulator runs it, thousands of times slower", SlowWarning, stacklevel=2)
        return simulated
