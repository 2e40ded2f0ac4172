"""What a compiled and a simulated diagram have in common: names in, a batch of channels, named results out."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.layout import Layout, common_count, series_of
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


@dataclass(frozen=True)
class Channels:
    """What n channels begin with and are driven by; of each array the first axis is the channel.

    ticks (n,): updates; start (n,): the first tick; state (n, states); parameters (n, m);
    inputs (n, rows, m): one row a tick, the last held.
    """

    ticks: Indices
    start: Indices
    state: Floats
    parameters: Floats
    inputs: Floats


class BatchDiagram(ABC):
    """A diagram that advances many channels, each with its own parameters, state, inputs and start.

    ``parameters``, ``inputs``, ``states``, ``outputs``: name -> size; ``state_names``: one per element of the state,
    "dob[0]", or "dob" where there is one; ``period`` and ``offset`` [s].
    """

    def __init__(self, layout: Layout, period: float, offset: float, inputs_used: set[int]) -> None:
        self.layout, self.period, self.offset = layout, period, offset
        self.parameters, self.inputs = layout.parameters.sizes(), layout.inputs.sizes()
        self.states, self.outputs = layout.states.sizes(), layout.outputs.sizes()
        self.state_names = layout.states.elements()
        self._inputs_used = inputs_used
        context = layout.structure.diagram.CreateDefaultContext()
        self._default_parameters = layout.read_parameters(context)
        self._default_state = layout.read_state(context)

    @property
    def default_state(self) -> dict[str, Floats]:
        """Name -> (size,), as in the diagram's default Context."""
        return self.layout.states.split(self._default_state.copy())

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
    ) -> Run:
        """Advance all channels; how many there are follows from the shapes given.

        A value is a number or (size,) for all channels, or (channels, size), short (channels,) where size is 1.
        Update k, at the time ``time(k)``, makes x[k+1] of x[k].

        Args:
            ticks: updates, an integer >= 0, one or (channels,).
            parameters: by name; those not given have their defaults.
            state: by name, likewise, or the whole state, (states,) or (channels, states).
            inputs: by name; also (channels or 1, rows, size), one row a tick, the last row held.
            start: the first tick, an integer >= 0, one or (channels,).
            log: outputs and states to record before the updates of ticks start, start + every, and so on.
            every: ticks from one record to the next.
            threads: all processors unless given; results do not depend on it.

        Raises InputError, naming what was given and what is valid.
        """
        given = self._channels(ticks, parameters, state, inputs, start)
        if not (isinstance(every, int | np.integer) and every >= 1):
            raise InputError.of("every", every, "an integer >= 1")
        if threads is not None and threads < 1:
            raise InputError.of("threads", threads, "an integer >= 1")
        named, columns = self._columns(log)
        rows = int(given.ticks.max()) // every + 1 if log else 0
        final, record = self.advance(given, columns, rows, int(every), threads)
        return Run(
            self.layout.states.split(final),
            self.layout.outputs.split(self._outputs_after(given, final)),
            {name: record[:, :, places] for name, places in named.items()},
            np.arange(rows) * every,
            final,
            given.start + given.ticks,
        )

    @abstractmethod
    def advance(
        self, given: Channels, columns: Indices, rows: int, every: int = 1, threads: int | None = None
    ) -> tuple[Floats, Floats]:
        """The states after the last update, (n, states), and the log, (n, ``rows``, width), nan where none is due.

        ``columns`` (width,) names what is recorded, of outputs and states in one row.
        """

    def _channels(
        self,
        ticks: ArrayLike,
        parameters: Mapping[str, ArrayLike] | None,
        state: Mapping[str, ArrayLike] | ArrayLike | None,
        inputs: Mapping[str, ArrayLike] | None,
        start: ArrayLike,
    ) -> Channels:
        """The arguments of ``run``, checked and spread over all channels."""
        series = self._series(inputs or {})
        values = self.layout.parameters.spread(parameters or {}, self._default_parameters)
        given = {
            "ticks": _integers("ticks", ticks),
            "start": _integers("start", start),
            "state": self._states(state),
            "parameters": values,
            "inputs": series,
        }
        n = common_count({name: len(array) for name, array in given.items()})
        return Channels(*(np.broadcast_to(array, (n, *array.shape[1:])) for array in given.values()))

    def _outputs_after(self, given: Channels, final: Floats) -> Floats:
        """All outputs (n, outputs) after the last update: those that a run of no ticks records."""
        held = given.inputs[np.arange(len(final)), np.minimum(given.ticks, given.inputs.shape[1] - 1)]
        still = Channels(np.zeros_like(given.ticks), given.start + given.ticks, final, given.parameters, held[:, None])
        size = self.layout.outputs.size
        return self.advance(still, np.arange(size), min(size, 1), 1, 1)[1].reshape(len(final), size)

    def _states(self, state: Mapping[str, ArrayLike] | ArrayLike | None) -> Floats:
        if state is None or isinstance(state, Mapping):
            return self.layout.states.spread(state or {}, self._default_state)
        array, size = np.asarray(state, dtype=float), self.layout.states.size
        rows = array[None] if array.shape == (size,) else array
        if rows.ndim != 2 or rows.shape[1] != size:
            raise InputError.of("state", array.shape, f"(channels, {size})", f"state has shape {array.shape}")
        return rows

    def _series(self, inputs: Mapping[str, ArrayLike]) -> Floats:
        """All inputs in one array (1 or n, rows, inputs)."""
        names = self.layout.inputs
        series = {name: series_of(name, value, names.find(name).size) for name, value in inputs.items()}
        known = {int(place) for name in series for place in names.find(name)}
        if missing := sorted({names.elements()[place] for place in self._inputs_used - known}):
            message = f"input '{missing[0]}' has no value; give inputs={{'{missing[0]}': ...}}"
            raise InputError(message, field="inputs", value=list(inputs), valid=list(names.places))
        count = common_count({f"input '{name}'": len(array) for name, array in series.items()})
        length = max((array.shape[1] for array in series.values()), default=1)
        result = np.zeros((count, length, names.size))
        for name, array in series.items():  # the last row of a shorter series is held
            result[:, :, names.find(name)] = array[:, np.minimum(np.arange(length), array.shape[1] - 1)]
        return result

    def _columns(self, log: Sequence[str]) -> tuple[dict[str, Indices], Indices]:
        """Columns of the record by name, and the place of each among outputs and states."""
        if isinstance(log, str):
            raise InputError.of("log", log, f"a list of names, such as ['{log}']")
        outputs, states = self.layout.outputs, self.layout.states
        signals = {name: outputs.size + places for name, places in states.places.items()} | outputs.places
        named: dict[str, Indices] = {}
        columns: list[int] = []
        for name in log:
            if name not in signals:
                valid = [*outputs.places, *states.places]
                raise InputError.of("log", name, valid, f"log: unknown output or state '{name}'")
            named[name] = np.arange(len(columns), len(columns) + signals[name].size)
            columns += signals[name].tolist()
        return named, np.array(columns, dtype=np.int64)


def _integers(name: str, value: ArrayLike) -> Indices:
    array = np.atleast_1d(np.asarray(value))
    valid = array.ndim == 1 and array.size and np.issubdtype(array.dtype, np.integer)
    if not valid or array.min() < 0 or array.max() > _LATEST:
        raise InputError.of(name, value, "an integer >= 0, one or one for each channel")
    return array.astype(np.int64)
