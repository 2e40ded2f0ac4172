"""The same interface on Drake's Simulator: any diagram, one channel after another."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np
from pydrake.systems.analysis import Simulator

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.batch import BatchDiagram, Channels
from flipdiagram.compiled.errors import NotCompilable
from flipdiagram.compiled.layout import Layout
from flipdiagram.compiled.structure import common_timing
from flipdiagram.errors import InputError


class SimulatedDiagram(BatchDiagram):
    """Runs a diagram that has no compiled form; slow, and ``threads`` is of no use to it.

    ``period`` [s], the tick, has to be given where the discrete updates share none; offset 0 then. A continuous state
    is the last state group of its block. Abstract state starts at its default in every run.
    """

    def __init__(self, layout: Layout, period: float | None = None) -> None:
        if period is None:
            try:
                period, offset = common_timing(layout.structure)
            except NotCompilable as error:
                raise InputError(f"{error}; or give the period of a tick to Drake's Simulator") from None
        elif not (np.isfinite(period) and period > 0.0):
            raise InputError.of("period", period, "finite and > 0, in seconds")
        else:
            offset = 0.0
        super().__init__(layout, period, offset, set())

    def linearize(self, *_: Any, **__: Any) -> NoReturn:
        """Only a compiled diagram knows its derivatives."""
        raise NotCompilable("a simulated diagram cannot be linearised exactly; compile it")

    def advance(
        self, given: Channels, columns: Indices, rows: int, every: int = 1, threads: int | None = None
    ) -> tuple[Floats, Floats]:
        """See ``BatchDiagram.advance``."""
        final, log = given.state.copy(), np.full((len(given.state), rows, columns.size), np.nan)
        for c in range(given.ticks.size):
            self._advance_one(given, c, columns, every, final[c], log[c])
        return final, log

    def _advance_one(self, given: Channels, c: int, columns: Indices, every: int, state: Floats, log: Floats) -> None:
        diagram, start, length, series = (
            self.layout.structure.diagram,
            given.start[c],
            int(given.ticks[c]),
            given.inputs[c],
        )
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
                asked = (columns < self.layout.outputs.size).any()  # outputs cost time
                outputs = read_outputs(self.layout, context) if asked else np.empty(self.layout.outputs.size)
                log[k // every] = np.append(outputs, self.layout.read_state(context))[columns]
        state[:] = self.layout.read_state(context)

    def _fix(self, context: Any, row: Floats) -> None:
        for port in self.layout.structure.inputs:
            value = row[self.layout.inputs.places[port.name]]
            self.layout.structure.diagram.get_input_port(port.index).FixValue(context, value)


def read_outputs(layout: Layout, context: Any) -> Floats:
    """All exported outputs, flat, of a context of the diagram."""
    ports = [layout.structure.diagram.get_output_port(port.index) for port in layout.structure.outputs]
    return np.concatenate([port.Eval(context) for port in ports]) if ports else np.zeros(0)
