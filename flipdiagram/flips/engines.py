"""Where trials run: the cores of this machine, or a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

from flipdiagram.errors import InputError
from flipdiagram.flips.children import close_children, kill_children
from flipdiagram.flips.engine import Engine


@contextmanager
def engine(jobs: int | None = None, scheduler: str | None = None) -> Iterator[Engine]:
    """The cores of this machine, `jobs` of them, or the cluster of a Dask scheduler, 'tcp://127.0.0.1:8786'.

    Listens nowhere: processes are children on socket pairs, the scheduler is connected to.  Raises InputError
    where the cluster cannot be used.
    """
    if scheduler is not None:
        from flipdiagram.flips.dask import cluster

        with cluster(scheduler) as found:
            yield found
        return
    count = jobs or cores()
    if count < 1:
        raise InputError(f"jobs = {jobs} is not valid; valid is a whole number above 0")
    threads = ThreadPoolExecutor(count, thread_name_prefix="campaign")
    try:
        yield Engine(threads, lambda: count, f"{count} process{'es' if count > 1 else ''}")
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        kill_children()
        threads.shutdown(wait=True)
        close_children()


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
