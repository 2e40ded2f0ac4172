"""What a compiled and a simulated diagram have in common: names in, a batch of channels, named results out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.layout import Layout, common_count, rows_of, series_of
from flipdiagram.errors import InputError

_LATEST = 2**53  # beyond, tick numbers are no longer exact floats


@dataclass(frozen=True)
class Run:
    """What became of n channels.

    ``state``, ``outputs``: name -> (n, size) after the last update; the outputs at the time and with the input then.
    ``final``: all states, (n, states); ``ticks``: the tick reached, (n,). Both start a run that goes on from here.
    ``log``: name -> (n, rows, size) recorded at ``log_ticks`` (rows,) after the start; nan where a channel had ended.
    """

    state: dict[str, Floats]
    outputs: dict[str, Floats]
    log: dict[str, Floats]
    log_ticks: Indices
    final: Floats
    ticks: Indices


class BatchDiagram(ABC):
    """A diagram that advances many channels, each with its own parameters, state, inputs and start."""

    def __init__(self, layout: Layout, period: float, offset: float, inputs_used: set[int]) -> None:
        self.layout = layout
        self.period = period
        self.offset = offset
        self._inputs_used = inputs_used
        context = layout.structure.diagram.CreateDefaultContext()
        self._default_parameters = layout.read_parameters(context)
        self._default_state = layout.read_state(context)

    @property
    def parameters(self) -> dict[str, int]:
        """Name -> size of the numeric parameters."""
        return self.layout.parameters.sizes()

    @property
    def inputs(self) -> dict[str, int]:
        """Name -> size of the exported inputs."""
        return self.layout.inputs.sizes()

    @property
    def states(self) -> dict[str, int]:
        """Name -> size of the states."""
        return self.layout.states.sizes()

    @property
    def outputs(self) -> dict[str, int]:
        """Name -> size of the exported outputs."""
        return self.layout.outputs.sizes()

    @property
    def state_names(self) -> list[str]:
        """One name per element of the state: "dob[0]", or "dob" where there is one."""
        return self.layout.states.elements()

    @property
    def state_size(self) -> int:
        """Number of state elements."""
        return self.layout.states.size

    @property
    def default_parameters(self) -> dict[str, Floats]:
        """Name -> (size,), as in the diagram's default Context."""
        return self.layout.parameters.split(self._default_parameters.copy())

    @property
    def default_state(self) -> dict[str, Floats]:
        """Name -> (size,), as in the diagram's default Context."""
        return self.layout.states.split(self._default_state.copy())

    def parameters_from(self, context: Any) -> dict[str, Floats]:
        """Name -> (size,) of a Context of the diagram, for instance one set up with the blocks' own setters."""
        return self.layout.parameters.split(self.layout.read_parameters(context))

    def state_from(self, context: Any) -> Floats:
        """All states, (states,), of a Context of the diagram."""
        return self.layout.read_state(context)

    def time(self, tick: ArrayLike) -> Floats:
        """The time [s] of a tick: offset + tick * period, as Drake computes it."""
        return np.asarray(self.offset + np.asarray(tick, dtype=np.int64) * self.period)

    def run(
        self,
        ticks: ArrayLike,
        *,
        parameters: Mapping[str, ArrayLike] | None = None,
        state: Mapping[str, ArrayLike] | ArrayLike | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        start: ArrayLike = 0,
        log: Sequence[str] = (),
        every: int = 1,
        threads: int | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Run:
        """Advance all channels by ``ticks`` updates; how many channels there are follows from the shapes given.

        A value is a number or (size,) for all channels, or (channels, size), short (channels,) where size is 1.
        ``ticks``, ``start``: integers >= 0, one or (channels,); update k, at the time ``time(k)``, makes x[k+1] of
        x[k]. ``parameters``, ``state`` (or the whole state, (states,) or (channels, states)): those not given have
        their defaults. ``inputs``: also (channels or 1, rows, size), one row a tick, the last row held.
        ``log``: outputs and states to record before the updates of ticks start, start + every, and so on.
        ``threads``: all processors unless given; results do not depend on it. ``progress`` is told the part done.
        Raises InputError, naming what was given and what is valid.
        """
        for name in inputs or {}:
            self.layout.inputs.find(name)
        series = self._series(inputs or {})
        values = self.layout.parameters.spread(parameters or {}, self._default_parameters)
        states = self._states(state)
        length, first = _integers("ticks", ticks), _integers("start", start)
        given = {
            "parameters": values.shape[0],
            "state": states.shape[0],
            "ticks": length.size,
            "start": first.size,
            "inputs": series.shape[0],
        }
        count = common_count(given)
        if not (isinstance(every, int | np.integer) and every >= 1):
            raise InputError(f"every = {every!r}; it must be an integer >= 1")
        if threads is not None and threads < 1:
            raise InputError(f"threads = {threads}; it must be >= 1")
        length, first = (np.ascontiguousarray(np.broadcast_to(a, (count,))) for a in (length, first))
        final = np.array(np.broadcast_to(states, (count, states.shape[1])), order="C")
        values = np.broadcast_to(values, (count, values.shape[1]))
        series = np.broadcast_to(series, (count, *series.shape[1:]))

        chosen, column = self._columns(log)
        rows = int(length.max()) // every + 1 if log else 0
        record = np.full((count, rows, column.size), np.nan)
        self._advance(length, first, final, values, series, int(every), column, record, threads, progress)
        reached = first + length
        # the outputs then: a run of no ticks, which records its start
        size = self.layout.outputs.size
        last = np.full((count, 1, size), np.nan)
        if size:
            rest = np.minimum(length, series.shape[1] - 1)
            tail = series[:, -1:] if series.shape[1] == 1 else series[np.arange(count), rest][:, None]
            none = np.zeros(count, dtype=np.int64)
            self._advance(none, reached, final.copy(), values, tail, 1, np.arange(size), last, 1, None)
        return Run(
            self.layout.states.split(final),
            self.layout.outputs.split(last[:, 0]),
            {name: record[:, :, places] for name, places in chosen.items()},
            np.arange(rows) * every,
            final,
            reached,
        )

    @abstractmethod
    def _advance(
        self,
        ticks: Indices,
        start: Indices,
        state: Floats,
        parameters: Floats,
        series: Floats,
        every: int,
        column: Indices,
        log: Floats,
        threads: int | None,
        progress: Callable[[float], None] | None,
    ) -> None:
        """Advance ``state`` in place and fill ``log`` with the outputs and states, in one row, that ``column`` names.

        The other arguments are those of the kernel (``print_source``).
        """

    def _states(self, state: Mapping[str, ArrayLike] | ArrayLike | None) -> Floats:
        if state is None or isinstance(state, Mapping):
            return self.layout.states.spread(state or {}, self._default_state)
        array = np.asarray(state, dtype=float)
        if array.ndim == 1 and array.size == self.state_size:
            array = array[None]
        if array.ndim != 2 or array.shape[1] != self.state_size:
            raise InputError(f"state has shape {array.shape}; valid is (channels, {self.state_size})")
        return array

    def _series(self, inputs: Mapping[str, ArrayLike]) -> Floats:
        """All inputs in one array (1 or n, rows, inputs)."""
        names = self.layout.inputs
        found = [(names.find(name), series_of(name, v, names.find(name).size)) for name, v in inputs.items()]
        known = {int(place) for places, _ in found for place in places}
        if missing := sorted({names.elements()[place] for place in self._inputs_used - known}):
            raise InputError(f"input '{missing[0]}' has no value; give inputs={{'{missing[0]}': ...}}")
        count = common_count({f"input '{n}'": a.shape[0] for n, (_, a) in zip(inputs, found, strict=True)})
        length = max((a.shape[1] for _, a in found), default=1)
        result = np.zeros((count, length, names.size))
        for places, array in found:
            # the last row of a shorter series is held
            result[:, :, places] = array[:, np.minimum(np.arange(length), array.shape[1] - 1)]
        return result

    def _columns(self, log: Sequence[str]) -> tuple[dict[str, Indices], Indices]:
        """Columns of the record by name, and the place of each among outputs and states."""
        if isinstance(log, str):
            raise InputError(f"log = '{log}'; valid is a list of names, such as ['{log}']")
        outputs, states = self.layout.outputs, self.layout.states
        chosen: dict[str, Indices] = {}
        picked: list[int] = []
        for name in log:
            if name in outputs.places:
                places = outputs.places[name]
            elif name in states.places:
                places = outputs.size + states.places[name]
            else:
                valid = ", ".join([*outputs.places, *states.places])
                raise InputError(f"log: unknown output or state '{name}'; choose from {valid}")
            chosen[name] = np.arange(len(picked), len(picked) + places.size)
            picked += places.tolist()
        return chosen, np.array(picked, dtype=np.int64)

    def operating_point(
        self,
        parameters: Mapping[str, ArrayLike] | None,
        state: Mapping[str, ArrayLike] | ArrayLike | None,
        inputs: Mapping[str, ArrayLike] | None,
    ) -> tuple[Floats, Floats, Floats]:
        """Flat parameters, state and inputs of one channel; inputs not given are 0."""
        names = self.layout.inputs
        point = np.zeros(names.size)
        for name, value in (inputs or {}).items():
            point[names.find(name)] = _single(rows_of("input", name, value, names.find(name).size))
        values = self.layout.parameters.spread(parameters or {}, self._default_parameters)
        return _single(values), _single(self._states(state)), point


def _single(rows: Floats) -> Floats:
    if rows.shape[0] != 1:
        raise InputError(f"an operating point is of one channel; {rows.shape[0]} were given")
    return np.asarray(rows[0])


def _integers(name: str, value: ArrayLike) -> Indices:
    array = np.atleast_1d(np.asarray(value))
    valid = array.ndim == 1 and array.size and np.issubdtype(array.dtype, np.integer)
    if not valid or array.min() < 0 or array.max() > _LATEST:
        raise InputError(f"{name} = {value!r}; valid are integers >= 0, one or one for each channel")
    return array.astype(np.int64)
