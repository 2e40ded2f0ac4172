"""Processes that make calls: children of this process, each owned by a thread, or the workers of a Dask cluster."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed, wait
from contextlib import suppress
from typing import Any, Self, TypeVar

from flipdiagram.errors import InputError, SimulationError, first_line
from flipdiagram.flips.batches import Answer, Batch, each_in_child
from flipdiagram.flips.child_process import Limits, TrialError, WorkerLostError, close_children, in_child, kill_children
from flipdiagram.flips.flip import SOURCES, code_version

CONNECT_TIMEOUT = 10.0
"""Seconds to wait for the scheduler of a cluster."""
BATCH_SECONDS = (5.0, 60.0)
"""How long a batch on a cluster takes at least and at most: so much work is lost with its worker."""
BATCHES_A_SECOND = 30
"""That a scheduler and a driver see from all workers: at 2 to 8 ms each they have time to spare."""
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

    def submit(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], limits: Limits | None = None
    ) -> Future[Any]:
        """A call to be made as soon as a worker is free; limits: what it may take once it has begun."""
        return self._begin(in_child, function, arguments, limits)

    def submit_batch(self, batch: Batch) -> Future[list[Answer]]:
        """Calls to be made one after another by one worker; the answers as of `each_in_child`."""
        return self._begin(each_in_child, batch)

    def batch_seconds(self, width: int) -> float:
        """How long a batch should take.  Here 0, so it holds one call: handing it to a thread costs nothing."""
        return 0.0

    def _begin(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        call = self._executor.submit(function, *arguments)
        self._calls.add(call)
        call.add_done_callback(self._calls.discard)
        return call

    def results(
        self, function: Callable[..., Result], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Result]]:
        """Begin the tasks; (index of a task, its result) in the order in which they end; raises what a task raises."""
        futures = {self.submit(function, task): index for index, task in enumerate(tasks)}
        return self._in_order_of_end(futures)

    def _in_order_of_end(self, futures: dict[Future[Any], int]) -> Iterator[tuple[int, Any]]:
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except TrialError as error:
            raise error.error or error from None
        except WorkerLostError:
            raise SimulationError("a worker process ended unexpectedly (out of memory?)") from None


class DaskWorkers(Workers):
    """The workers of the scheduler at an address; InputError where there is none, or with other code."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            valid = "pip install 'flipdiagram[cluster]'"
            raise _refusal(address, f"needs Dask, which is not installed; install it with: {valid}", valid) from None
        try:
            self._client: Any = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            valid = "the address that `dask scheduler` prints, such as tcp://127.0.0.1:8786"
            raise _refusal(address, f"cannot be reached: {first_line(error)}; valid is {valid}", valid) from None
        # a failed call is repeated by us, who count; Dask moves those of a lost worker on its own account
        self._calls = set()
        self._executor = self._client.get_executor(pure=False, retries=0)
        try:
            self._check_versions(address)
        except BaseException:
            self.__exit__()
            raise
        self.name = f"Dask at {address}, {self.width()} threads"

    def __exit__(self, *exception: object) -> None:
        with suppress(Exception):  # the scheduler may be gone already
            self._executor.shutdown(wait=False)
        with suppress(Exception):
            self._client.close(timeout=CONNECT_TIMEOUT)

    def width(self) -> int:
        """Threads of all workers that are there now."""
        return sum(self._client.nthreads().values()) if self.alive() else 0

    def batch_seconds(self, width: int) -> float:
        """As of a cluster of so many."""
        return batch_seconds(width)

    def alive(self) -> bool:
        """Whether the scheduler is there."""
        return bool(self._client.status == "running")

    def _check_versions(self, address: str) -> None:
        valid = "workers with the same flipdiagram, Drake and Python"
        try:
            by_worker = self._client.run(code_version, SOURCES)
        except Exception as error:  # a worker raises what it likes: no such module, another Python
            text = f"a worker cannot run this program: {first_line(error)}; valid are {valid}"
            raise _refusal(address, text, valid) from None
        if other := [worker for worker, version in by_worker.items() if version != code_version(SOURCES)]:
            text = f"{', '.join(other)} has other code or versions than this process; valid are {valid}"
            raise _refusal(address, text, valid)


def batch_seconds(width: int) -> float:
    """How long a batch should take on a cluster: the more workers, the longer; all end `BATCHES_A_SECOND` together."""
    least, most = BATCH_SECONDS
    return min(max(width / BATCHES_A_SECOND, least), most)


def _refusal(address: str, problem: str, valid: str) -> InputError:
    return InputError(f"--scheduler = '{address}' {problem}", field="--scheduler", value=address, valid=valid)


def workers_of(jobs: int | None, scheduler: str | None) -> Workers:
    """Children of this process, or the cluster of a Dask scheduler, 'tcp://127.0.0.1:8786'; InputError if unusable."""
    return Workers(jobs) if scheduler is None else DaskWorkers(scheduler)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
