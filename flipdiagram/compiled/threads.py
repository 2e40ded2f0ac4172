"""A kernel over all channels, in pieces, on several threads."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.batch import Channels
from flipdiagram.compiled.kernel import Kernel
from flipdiagram.compiled.vectors import LANES

_PIECE = 10_000_000  # channel-ticks between two looks at Ctrl-C


def run_kernel(
    kernel: Kernel, given: Channels, columns: Indices, rows: int, every: int, threads: int | None
) -> tuple[Floats, Floats]:
    """Final states (n, states) and log (n, rows, width) of a kernel; see ``BatchDiagram.advance``."""
    n = given.ticks.size
    # eight channels wait for the longest of them: neighbours of like length wait least
    order = np.arange(n) if rows or (np.diff(given.ticks) >= 0).all() else np.argsort(given.ticks, kind="stable")
    ticks, start = given.ticks[order], given.start[order]
    state, parameters = (np.ascontiguousarray(array[order].T) for array in (given.state, given.parameters))
    shared = n > 1 and given.inputs.strides[0] == 0
    series = np.repeat(given.inputs[:1], LANES, axis=0) if shared else given.inputs[order]
    series = np.ascontiguousarray(series.transpose(2, 1, 0))
    columns = np.ascontiguousarray(columns, dtype=np.int64)
    log = np.full((rows, columns.size, n), np.nan)

    def run(first: int, last: int) -> None:
        addresses = [array.ctypes.data for array in (ticks, start, state, parameters, series)]
        shape = (series.shape[2], 0 if shared else 1, series.shape[1] - 1, every)
        kernel(first, last, n, *addresses, *shape, columns.ctypes.data, log.ctypes.data, columns.size, rows)

    threads = threads or available_threads()
    pieces = _pieces(ticks, threads)
    if len(pieces) == 1:
        run(*pieces[0])
    else:
        pool = ThreadPoolExecutor(threads)
        try:
            list(pool.map(run, *zip(*pieces, strict=True)))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    final = np.empty(given.state.shape)
    final[order] = state.T
    return final, log.transpose(2, 0, 1)


def _pieces(ticks: Indices, threads: int) -> list[tuple[int, int]]:
    """Ranges of channels, several for each thread: channels may differ in length, and processors in load.

    No piece but the last has an incomplete vector of channels.
    """
    work = np.cumsum(LANES * (np.maximum.reduceat(ticks, np.arange(0, ticks.size, LANES)) + 1.0))
    if threads == 1 and work[-1] <= _PIECE:
        return [(0, ticks.size)]
    number = np.floor(work / min(work[-1] / (threads * 8), _PIECE))
    ends = np.minimum((np.flatnonzero(np.diff(number, append=np.inf)) + 1) * LANES, ticks.size)
    return list(zip([0, *ends[:-1].tolist()], ends.tolist(), strict=True))


def available_threads() -> int:
    """Processors this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
