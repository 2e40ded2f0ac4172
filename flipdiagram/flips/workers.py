"""Work spread over processes: results as they come, workers ended at once on Ctrl-C or an error."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from flipdiagram.errors import SimulationError

Result = TypeVar("Result")


class Workers:
    """A pool of fresh processes.  Leaving the `with` block through an exception terminates them without waiting.

    Drake's diagrams do not pickle and its Python blocks hold the interpreter's lock: scenarios travel to processes.
    """

    def __init__(self, jobs: int | None = None) -> None:
        self._pool = ProcessPoolExecutor(
            jobs or os.cpu_count(), multiprocessing.get_context("spawn"), initializer=_begin
        )

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        if kind is None:
            self._pool.shutdown()
            return
        self._pool.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()

    def warm_up(self, function: Callable[[], object], jobs: int) -> None:
        """Start `jobs` processes and have each call a function, such as one that imports what the work needs."""
        for _ in range(jobs):
            self._pool.submit(function)

    def results(
        self, function: Callable[..., Result], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Result]]:
        """(index of the task, its result) in the order in which they end; raises what a task raises."""
        futures = {self._pool.submit(function, *task): index for index, task in enumerate(tasks)}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool:
            raise SimulationError("a worker process ended unexpectedly (out of memory?)") from None


def _begin() -> None:
    # Ctrl-C reaches the whole process group; the parent decides what becomes of the workers
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    # a parent that is killed cannot tell its workers
    parent.join()
    os._exit(1)
