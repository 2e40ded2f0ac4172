"""Processes that make calls: children of this process, each owned by a thread, or the workers of a Dask cluster."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed, wait
from typing import Any, Self, TypeVar

from flipdiagram.errors import InputError, SimulationError
from flipdiagram.flips.child_process import TrialError, WorkerLostError, close_children, in_child, kill_children

Result = TypeVar("Result")


class Workers:
    """Children of this process, by default one a core.  Leaving the `with` block ends them at once, whatever they do.

    Drake's diagrams do not pickle and its Python blocks hold the interpreter's lock: scenarios travel to processes.
    Nothing listens.
    """

    def __init__(self, jobs: int | None = None) -> None:
        count = cores() if jobs is None else jobs
        if count < 1:
            raise InputError.of("jobs", jobs, "a whole number above 0")
        self._count = count
        self._executor: Executor = ThreadPoolExecutor(count, thread_name_prefix="flips")
        self._calls: set[Future[Any]] = set()
        """Those that have not ended."""
        self.name = f"{count} process{'es' if count > 1 else ''}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._executor.shutdown(wait=False, cancel_futures=True)
        kill_children()
        while wait(list(self._calls), 0.05).not_done:  # a thread may just have started another child
            kill_children()
        self._executor.shutdown(wait=True)
        close_children()

    def width(self) -> int:
        """How many calls are made at a time; asked now and then, as the workers of a cluster come and go."""
        return self._count

    def alive(self) -> bool:
        """Whether they can still be used."""
        return True

    def submit(self, function: Callable[..., Any], arguments: tuple[Any, ...], timeout: float | None) -> Future[Any]:
        """A call to be made as soon as a worker is free; timeout [s] once it has begun."""
        call = self._executor.submit(in_child, function, arguments, timeout)
        self._calls.add(call)
        call.add_done_callback(self._calls.discard)
        return call

    def results(
        self, function: Callable[..., Result], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Result]]:
        """Begin the tasks; (index of a task, its result) in the order in which they end; raises what a task raises."""
        futures = {self.submit(function, task, None): index for index, task in enumerate(tasks)}
        return self._in_order_of_end(futures)

    def _in_order_of_end(self, futures: dict[Future[Any], int]) -> Iterator[tuple[int, Any]]:
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except TrialError as error:
            raise error.error or error from None
        except WorkerLostError:
            raise SimulationError("a worker process ended unexpectedly (out of memory?)") from None


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
