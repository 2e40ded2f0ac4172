"""What becomes of a trial whose process hangs, crashes or is killed.

* It takes longer than it may: its process is killed, and `timeout` is its outcome.
* It raises an exception: that is a bug, `crashed` is its outcome, and the exception stands in its row.
* Its process is lost in the middle, killed or out of memory: that says nothing about the trial.  It is tried again in a
  new process, up to `ATTEMPTS` times; then it is `crashed` too.

Whichever it is, the other trials go on, and what has ended is in the file already.
"""

from asyncio import CancelledError
from concurrent.futures import Future
from typing import Any, NamedTuple

from flipdiagram.errors import InputError, SimulationError, first_line
from flipdiagram.flips.child_process import TrialError, TrialTimeoutError
from flipdiagram.flips.workers import Workers

ATTEMPTS = 5
"""How often a trial is tried whose worker is lost; then it is `crashed`."""


class Ended(NamedTuple):
    """How a call ended: with a value, with a failure that is the trial's outcome, or so that it is tried again."""

    value: Any = None
    failure: str | None = None
    again: bool = False


def ended(future: Future[Any], attempts: int, workers: Workers, planning: bool = False) -> Ended:
    """How a call ended that was tried so often; SimulationError where nobody is left to try it again."""
    what = "planning " if planning else ""
    try:
        return Ended(future.result())
    except TrialTimeoutError as error:
        return Ended(failure=f"timeout: {what}{error}")
    except TrialError as error:
        if planning and isinstance(error.error, InputError):
            raise error.error from None
        return Ended(failure=f"crashed: {'planning: ' if planning else ''}{error}")
    except (Exception, CancelledError) as error:  # each kind of workers has its own
        if not workers.alive():
            raise gone(workers, error) from None
        if attempts < ATTEMPTS:
            return Ended(again=True)
        return Ended(failure=f"crashed: {what}lost its worker {ATTEMPTS} times: {first_line(error)}")


def gone(workers: Workers, error: BaseException) -> SimulationError:
    """The error of workers that can no longer be used."""
    return SimulationError(f"{workers.name} is gone: {first_line(error)}; what has ended is kept, --resume goes on")
