"""The compiled diagram against Drake: the same steps, from the states that Drake's Simulator goes through."""

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.batch import BatchDiagram, Channels
from flipdiagram.compiled.fallback import SimulatedDiagram
from flipdiagram.errors import InputError, NotCompilable

TOLERANCE = 1e-10  # relative
_OUTPUT_ROWS = 20  # ticks at which outputs are compared too: they cost Drake time


def check(compiled: BatchDiagram, ticks: int) -> None:
    """Compare ``ticks`` updates one by one, so that no difference grows; NotCompilable where one is not equal.

    Start and inputs are the defaults moved at random (always the same way): a diagram at rest shows nothing.
    """
    if ticks < 0:
        raise InputError.of("check", ticks, "an integer >= 0")
    layout, drake, rng = compiled.layout, SimulatedDiagram(compiled.layout), np.random.default_rng(0)
    context = layout.structure.diagram.CreateDefaultContext()
    parameters, state = layout.read_parameters(context)[None], layout.read_state(context)[None]
    inputs, moved = 0.1 * rng.standard_normal((1, 1, layout.inputs.size)), 0.1 * rng.standard_normal(state.shape)
    size, width = layout.outputs.size, layout.outputs.size + state.size

    def simulated(length: int, columns: Indices) -> Floats:
        given = Channels(np.array([length]), np.array([0]), state, parameters, inputs)
        return drake.advance(given, columns, length + 1)[1][0]

    state, at_rest = state + moved, state
    try:
        states = simulated(ticks, np.arange(size, width))
    except Exception:  # a block may refuse an arbitrary state
        state, inputs = at_rest, 0.0 * inputs
        states = simulated(ticks, np.arange(size, width))
    outputs = simulated(min(ticks, _OUTPUT_ROWS) - 1, np.arange(size))
    shared = (np.broadcast_to(array, (ticks, *array.shape[1:])) for array in (parameters, inputs))
    each = Channels(np.ones(ticks, np.int64), np.arange(ticks), states[:-1], *shared)
    final, row = compiled.advance(each, np.arange(size), 1, threads=1)
    _compare("state", compiled.state_names, states[:-1], final, states[1:])
    _compare("output", layout.outputs.elements(), np.zeros_like(outputs), row[: len(outputs), 0], outputs)


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
