"""A kernel over all channels, in pieces, on several threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.compiled.kernel import Kernel

_PIECE = 10_000_000  # channel-ticks between two looks at Ctrl-C and at the progress


def advance(
    kernel: Kernel,
    ticks: Indices,
    start: Indices,
    state: Floats,
    parameters: Floats,
    series: Floats,
    every: int,
    signals: int,
    column: Indices,
    log: Floats,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    lanes: int = 1,
) -> None:
    """Run a kernel on arrays; the arguments are described in ``print_source``.

    ``lanes``: channels that the kernel advances together, from the first of a piece on.

    ``parameters`` (n, m) and ``series`` (n, rows, m) may repeat one channel with a stride of 0; all else is contiguous.
    """
    column = np.ascontiguousarray(column, dtype=np.int64)
    signal = np.empty((ticks.size, signals if log.shape[1] else 0))
    owners = (ticks, start, state, column, log)
    assert all(array.flags.c_contiguous for array in owners)
    assert parameters[:1].flags.c_contiguous and series[:1].flags.c_contiguous
    size = 8  # bytes of an element
    arguments = (
        ticks.ctypes.data,
        start.ctypes.data,
        state.ctypes.data,
        state.shape[1],
        parameters.ctypes.data,
        parameters.strides[0] // size,
        series.ctypes.data,
        series.strides[0] // size,
        series.shape[2],
        series.shape[1] - 1,
        every,
        signal.ctypes.data,
        signals,
        column.ctypes.data,
        log.ctypes.data,
        log.shape[1],
        log.shape[2],
    )
    count = threads or available_threads()
    pieces = _pieces(ticks, count, lanes)
    if len(pieces) == 1:
        kernel(*pieces[0], *arguments)
        if progress:
            progress(1.0)
        return
    total = _work(ticks)
    pool = ThreadPoolExecutor(count)
    try:
        futures = {pool.submit(kernel, *piece, *arguments): piece for piece in pieces}
        waiting, done = set(futures), 0.0
        while waiting:
            finished, waiting = wait(waiting, timeout=0.1 if progress else None, return_when=FIRST_EXCEPTION)
            for future in finished:
                future.result()
                done += _work(ticks[slice(*futures[future])])
            if progress and finished:
                progress(done / total)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _work(ticks: Indices) -> float:
    return float(ticks.sum()) + ticks.size


def _pieces(ticks: Indices, threads: int, lanes: int) -> list[tuple[int, int]]:
    """Ranges of channels, several for each thread: channels may differ in length, and processors in load.

    Where channels advance together no piece but the last has an incomplete group of them.
    """
    if threads == 1 and _work(ticks) <= _PIECE:
        return [(0, ticks.size)]
    groups = np.add.reduceat(ticks + 1.0, np.arange(0, ticks.size, lanes))
    aim = min(_work(ticks) / (threads * 8), _PIECE)
    work = np.floor(np.cumsum(groups) / aim)
    ends = np.minimum((np.flatnonzero(np.diff(work, append=np.inf)) + 1) * lanes, ticks.size)
    return list(zip([0, *ends[:-1].tolist()], ends.tolist(), strict=True))


def available_threads() -> int:
    """Processors this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
