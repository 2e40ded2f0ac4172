"""The compiled diagram against Drake: the same steps, from the states that Drake's Simulator goes through."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator

from flipdiagram.arrays import Floats
from flipdiagram.compiled.batch import BatchDiagram
from flipdiagram.compiled.errors import NotCompilable
from flipdiagram.compiled.fallback import read_outputs

TOLERANCE = 1e-10  # relative
_OUTPUT_ROWS = 20  # ticks at which outputs are compared too


def check(compiled: BatchDiagram, ticks: int) -> None:
    """Compare ``ticks`` updates one by one, so that no difference grows; NotCompilable where one is not equal.

    Start and inputs are the defaults moved at random (always the same way): a diagram at rest shows nothing.
    """
    rng = np.random.default_rng(0)
    state = compiled.state_from(compiled.layout.structure.diagram.CreateDefaultContext())
    inputs = 0.1 * rng.standard_normal(compiled.layout.inputs.size)
    try:
        before, after, outputs = _drake(compiled, state + 0.1 * rng.standard_normal(state.size), inputs, ticks)
    except Exception:  # a block may refuse an arbitrary state
        before, after, outputs = _drake(compiled, state, 0.0 * inputs, ticks)
    given = {name: inputs[places] for name, places in compiled.layout.inputs.places.items()}
    start = np.arange(ticks)
    run = compiled.run(1, state=before, inputs=given, start=start, threads=1)
    _compare("state", compiled.state_names, before, run.final, after)
    if compiled.outputs:
        rows = slice(0, len(outputs))
        still = compiled.run(0, state=before[rows], inputs=given, start=start[rows], threads=1)
        flat = np.concatenate(list(still.outputs.values()), axis=1)
        _compare("output", compiled.layout.outputs.elements(), np.zeros_like(outputs), flat, outputs)


def _drake(compiled: BatchDiagram, state: Floats, inputs: Floats, ticks: int) -> tuple[Floats, Floats, Floats]:
    """States before and after each tick in Drake's Simulator, and outputs before the first ticks."""
    layout, diagram = compiled.layout, compiled.layout.structure.diagram
    flat = np.empty(layout.parameters.size)
    for name, value in compiled.default_parameters.items():
        flat[layout.parameters.places[name]] = value

    def context_at(tick: int, at: Floats) -> Any:
        context = diagram.CreateDefaultContext()
        layout.write(context, flat, at)
        context.SetTime(float(compiled.time(tick)))
        for port in layout.structure.inputs:
            diagram.get_input_port(port.index).FixValue(context, inputs[layout.inputs.places[port.name]])
        return context

    simulator = Simulator(diagram, context_at(0, state))
    context = simulator.get_context()
    simulator.Initialize()
    states = np.empty((ticks + 1, state.size))
    states[0] = layout.read_state(context)
    for k in range(ticks):
        simulator.AdvanceTo(compiled.offset + (k + 0.5) * compiled.period)
        states[k + 1] = layout.read_state(context)
    rows = min(ticks, _OUTPUT_ROWS)
    outputs = np.array([read_outputs(layout, context_at(k, states[k])) for k in range(rows)])
    return states[:-1], states[1:], outputs.reshape(rows, layout.outputs.size)


def _compare(kind: str, names: list[str], before: Floats, ours: Floats, drakes: Floats) -> None:
    with np.errstate(invalid="ignore"):  # inf - inf, where a diagram diverges
        scale = np.maximum.reduce([np.abs(before), np.abs(ours), np.abs(drakes)])
        finite = np.where(np.isfinite(scale), scale, 0.0)  # where one state is nan the others are compared all the same
        floor = 1e-4 * TOLERANCE * finite.max(axis=1, initial=0.0, keepdims=True)
        equal = np.isclose(ours, drakes, rtol=0.0, atol=0.0, equal_nan=True)
        equal |= np.abs(ours - drakes) <= TOLERANCE * scale + floor
        equal |= ~np.isfinite(drakes) & ~np.isfinite(ours)
    if not equal.all():
        tick, place = np.argwhere(~equal)[0]
        raise NotCompilable(
            f"the compiled {kind} '{names[place]}' at tick {tick} is {ours[tick, place]!r}, Drake's Simulator says"
            f" {drakes[tick, place]!r}; a block may have per-step or unrestricted updates, or compute other than with"
            " its inputs, state, time and numeric parameters"
        )
