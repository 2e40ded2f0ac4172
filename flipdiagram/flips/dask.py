"""The Dask engine: the same calls on the workers of an existing scheduler (extra `cluster`)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from flipdiagram.errors import InputError
from flipdiagram.flips.engine import Engine
from flipdiagram.flips.flips import SOURCES
from flipdiagram.flips.provenance import code_version

CONNECT_TIMEOUT = 10.0
"""Seconds to wait for the scheduler."""


@contextmanager
def cluster(address: str) -> Iterator[Engine]:
    """The workers of the scheduler at an address; InputError where there is none, or with other code."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            f"--scheduler = '{address}' needs Dask, which is not installed;"
            " install it with: pip install 'flipdiagram[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"--scheduler = '{address}' cannot be reached: {_first_line(error)};"
            " valid is the address that `dask scheduler` prints, such as tcp://127.0.0.1:8786"
        ) from None
    # a failed call is repeated by us, who count; Dask moves those of a lost worker on its own account
    executor = client.get_executor(pure=False, retries=0)
    try:
        _check_versions(client, address)
        name = f"Dask at {address}, {_threads(client)} threads"
        yield Engine(executor, lambda: _threads(client), name, lambda: client.status == "running")
    finally:
        with suppress(Exception):  # the scheduler may be gone already
            executor.shutdown(wait=False)
        with suppress(Exception):
            client.close(timeout=CONNECT_TIMEOUT)


def _threads(client: Any) -> int:
    return sum(client.nthreads().values()) if client.status == "running" else 0


def _check_versions(client: Any, address: str) -> None:
    try:
        found = client.run(code_version, SOURCES)
    except Exception as error:  # a worker raises what it likes: no such module, another Python
        raise InputError(
            f"--scheduler = '{address}': a worker cannot run this program: {_first_line(error)};"
            " valid are workers with the same flipdiagram installed"
        ) from None
    other = [worker for worker, version in found.items() if version != code_version(SOURCES)]
    if other:
        raise InputError(
            f"--scheduler = '{address}': {', '.join(other)} has other code or versions than this process;"
            " valid are workers with the same flipdiagram, Drake and Python"
        )


def _first_line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
