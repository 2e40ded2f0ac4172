"""The same calls on the workers of an existing Dask scheduler (extra `cluster`)."""

from contextlib import suppress
from typing import Any

from flipdiagram.errors import InputError, first_line
from flipdiagram.flips.flip import SOURCES, code_version
from flipdiagram.flips.workers import Workers

CONNECT_TIMEOUT = 10.0
"""Seconds to wait for the scheduler."""


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


def _refusal(address: str, problem: str, valid: str) -> InputError:
    return InputError(f"--scheduler = '{address}' {problem}", field="--scheduler", value=address, valid=valid)


def workers_of(jobs: int | None, scheduler: str | None) -> Workers:
    """Children of this process, or the cluster of a Dask scheduler, 'tcp://127.0.0.1:8786'; InputError if unusable."""
    return Workers(jobs) if scheduler is None else DaskWorkers(scheduler)
