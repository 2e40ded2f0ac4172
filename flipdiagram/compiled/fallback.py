"""The same interface on Drake's Simulator: any diagram, one channel after another."""

import sys
from typing import Any, NoReturn

import numpy as np
from pydrake.systems.analysis import Simulator

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.batch import BatchDiagram, Channels
from flipdiagram.compiled.layout import Layout
from flipdiagram.compiled.structure import common_timing
from flipdiagram.errors import InputError, NotCompilable


class SimulatedDiagram(BatchDiagram):
    """Runs a diagram that has no compiled form; slow, and ``threads`` is of no use to it.

    ``period`` [s], the tick, has to be given where the discrete updates share none; offset 0 then. A continuous state
    is the last state group of its block. Abstract state starts at its default in every run.
    """

    def __init__(self, layout: Layout, period: float | None = None) -> None:
        if period is not None and not 0.0 < period < np.inf:
            raise InputError.of("period", period, "finite and > 0, in seconds")
        try:
            timing = common_timing(layout.structure) if period is None else (period, 0.0)
        except NotCompilable as error:
            raise InputError(f"{error}; or give the period of a tick to Drake's Simulator") from None
        super().__init__(layout, *timing, set())

    def linearize(self, *_: Any, **__: Any) -> NoReturn:
        """Only a compiled diagram knows its derivatives."""
        raise NotCompilable("a simulated diagram cannot be linearised exactly; compile it")

    def advance(
        self, given: Channels, columns: Indices, rows: int, every: int = 1, threads: int | None = None
    ) -> tuple[Floats, Floats]:
        """See ``BatchDiagram.advance``."""
        final, log = given.state.copy(), np.full((len(given.state), rows, columns.size), np.nan)
        watched = sys.stderr.isatty()
        for c in range(given.ticks.size):
            if watched:
                sys.stderr.write(f"\rDrake's Simulator: channel {c + 1} of {given.ticks.size} ")
                sys.stderr.flush()
            self._advance_one(given, c, columns, every, final[c], log[c])
        if watched:
            sys.stderr.write("\r\x1b[K")
        return final, log

    def _advance_one(self, given: Channels, c: int, columns: Indices, every: int, state: Floats, log: Floats) -> None:
        diagram, start, length = self.layout.structure.diagram, given.start[c], int(given.ticks[c])
        series = given.inputs[c]
        simulator, context = Simulator(diagram), diagram.CreateDefaultContext()
        self.layout.write(context, given.parameters[c], state)
        context.SetTime(float(self.time(start)))
        self._fix(context, series[0])
        simulator.reset_context(context)
        simulator.Initialize()
        # stops: where an input changes or a row is recorded; the Simulator ends a step before its update
        stops = {length, *range(1, min(len(series), length + 1)), *(range(0, length + 1, every) if len(log) else ())}
        for k in sorted(stops):
            if k:  # even without time passing AdvanceTo would do the updates that are due at the start
                simulator.AdvanceTo(float(self.time(start + k)))
            if 0 < k < len(series):
                self._fix(context, series[k])
            if k % every == 0 and k // every < len(log):
                outputs = np.empty(self.layout.outputs.size)
                if (columns < outputs.size).any():  # they cost time
                    for port in self.layout.structure.outputs:
                        places = self.layout.outputs.places[port.name]
                        outputs[places] = diagram.get_output_port(port.index).Eval(context)
                log[k // every] = np.append(outputs, self.layout.read_state(context))[columns]
        state[:] = self.layout.read_state(context)

    def _fix(self, context: Any, row: Floats) -> None:
        for port in self.layout.structure.inputs:
            value = row[self.layout.inputs.places[port.name]]
            self.layout.structure.diagram.get_input_port(port.index).FixValue(context, value)
