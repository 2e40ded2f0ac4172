"""The driver of all flips: plans each motion once, flies every trial that is missing, and keeps each as it ends.

What becomes of a trial whose process hangs, crashes or is killed:

* It takes more time or memory than it may: its process is killed, and `timeout` or `memory` is its outcome.
* It raises an exception: that is a bug, `crashed` is its outcome, and the exception stands in its row.
* Its process is lost in the middle, killed or out of memory: that says nothing about the trial.  It is tried again in a
  new process, `ATTEMPTS` times in all; then it is `crashed` too.

Whichever it is, the other trials go on, and what has ended is in the file already.
"""

import queue
import time
from asyncio import CancelledError
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, NamedTuple

from flipdiagram.errors import InputError, SimulationError, first_line
from flipdiagram.files import plain
from flipdiagram.flips.child_process import Limits, TrialError, TrialLimitError
from flipdiagram.flips.flight import Flight, Landed, Planned, Work, provenance
from flipdiagram.flips.flip import scenario_digest
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.store import Row, Store
from flipdiagram.flips.workers import Workers

ATTEMPTS = 5
"""How often a trial is tried whose worker is lost; then it is `crashed`."""
AHEAD = 2
"""Calls handed to the workers per call that runs: none idles, and few are lost or held in memory."""
PARKED = 8
"""Trials that may wait for plans, per call handed out: one plan may be shared by all of a million."""
COMMITTED = 100
"""Trials that are kept at once, where more have ended or have no motion."""
LOOK = 5.0
"""Seconds between two looks at how many workers there are."""


@dataclass(frozen=True)
class Flying:
    """How flights are flown, and where they are kept."""

    workers: Workers
    store: Store
    work: Work
    limits: Limits
    """What a plan or a flip may take before it is given up."""
    tick: Callable[[], object] = lambda: None
    """Called for each flip that has been kept."""
    any_code: bool = False
    """Whether flips are kept that other code has flown than this process runs."""


def fly_all(flights: Iterable[Flight], flying: Flying) -> None:
    """Fly the flights; whatever becomes of one is a row of the store, in the order in which they end.

    Raises SimulationError where the workers are gone or fly other code.
    """
    _Driver(iter(flights), flying).run()


class _Driver:
    def __init__(self, flights: Iterator[Flight], flying: Flying) -> None:
        self._flights, self._flying = flights, flying
        self._workers, self._store = flying.workers, flying.store
        self._ready: deque[tuple[Flight, str]] = deque()
        """Flights with their plans."""
        self._waiting: dict[str, list[Flight]] = {}
        """Flights by the motion that is being planned for them."""
        self._attempts: dict[str, int] = {}
        """Of planning a motion."""
        self._given_up: dict[str, str] = {}
        """Motions whose planning timed out or crashed, with the reason."""
        self._under_way: dict[Future[Any], Callable[[Future[Any]], None]] = {}
        """What to do with the result of each call."""
        self._ended: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
        self._landed: list[tuple[Flight, Landed]] = []
        """Not yet kept."""
        self._width, self._looked = 1, float("-inf")

    def run(self) -> None:
        while True:
            while len(self._under_way) < self._window() and self._hand_out():
                pass
            if not self._under_way:
                break
            future = self._ended.get()
            self._under_way.pop(future)(future)
            if self._ended.empty() or len(self._landed) > COMMITTED:
                self._keep()
        self._keep()

    def _window(self) -> int:
        if time.monotonic() - self._looked > LOOK:
            self._width, self._looked = max(self._workers.width(), 1), time.monotonic()
        return AHEAD * self._width

    def _hand_out(self) -> bool:
        """Give the workers one more call; False where there is none now."""
        while not self._ready:
            if sum(map(len, self._waiting.values())) > PARKED * self._window():
                return False
            if len(self._landed) > COMMITTED:
                self._keep()
            flight = next(self._flights, None)
            if flight is None:
                return False
            key = flight.plan_key
            if key in self._waiting:
                self._waiting[key].append(flight)
            elif key in self._given_up:
                self._fail(flight, self._given_up[key])
            elif (planned := self._store.plan(key)) is None:
                self._waiting[key] = [flight]
                self._plan(key, flight)
                return True
            else:
                self._planned([flight], planned)
        self._fly(*self._ready.popleft())
        return True

    def _planned(self, flights: list[Flight], planned: Planned) -> None:
        plan, error = planned
        for flight in flights:
            if plan is None:
                self._fail(flight, f"no plan: {error}")
            else:
                self._ready.append((flight, plan))

    def _plan(self, key: str, flight: Flight) -> None:
        self._attempts[key] = self._attempts.get(key, 0) + 1

        def landed(future: Future[Any]) -> None:
            planned, failure, again = _ended(future, self._attempts[key], self._workers, planning=True)
            if again:
                self._plan(key, flight)
            elif failure is not None:
                self._given_up[key] = failure
                for waiting in self._waiting.pop(key):
                    self._fail(waiting, failure)
            else:
                self._store.put_plan(key, *planned)
                self._planned(self._waiting.pop(key), planned)

        self._submit(self._flying.work.plan, (flight.believed,), landed)

    def _fly(self, flight: Flight, plan: str) -> None:
        flight.attempts += 1

        def landed(future: Future[Any]) -> None:
            result, failure, again = _ended(future, flight.attempts, self._workers)
            if again:
                self._ready.appendleft((flight, plan))
            elif failure is not None:
                self._fail(flight, failure)
            else:
                self._landed.append((flight, result))

        self._submit(self._flying.work.fly, (flight, plan), landed)

    def _submit(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], landed: Callable[[Future[Any]], None]
    ) -> None:
        try:
            future = self._workers.submit(function, arguments, self._flying.limits)
        except Exception as error:  # each kind of workers has its own
            raise _gone(self._workers, error) from None
        self._under_way[future] = landed
        future.add_done_callback(self._ended.put)

    def _fail(self, flight: Flight, failure: str) -> None:
        self._landed.append((flight, Landed(Outcome(None, failure), 0.0, *provenance())))

    def _keep(self) -> None:
        if not self._landed:
            return
        code = provenance()[0]
        same = [pair for pair in self._landed if self._flying.any_code or pair[1].code == code]
        self._store.put([row_of(flight, landed) for flight, landed in same])
        for _ in same:
            self._flying.tick()
        if len(same) < len(self._landed):  # a worker that has just started reads the files as they are now
            raise SimulationError(
                "the program was changed while it flies, or a worker has another one; what has ended is kept,"
                " campaign --resume --any-version goes on with the new one"
            )
        self._landed = []


def row_of(flight: Flight, landed: Landed) -> Row:
    """A flip that has ended as a row of the store."""
    outcome = landed.outcome
    measured = outcome.metrics and outcome.metrics.as_dict() | {"torque_use": outcome.torque_use}
    return Row(
        trial=flight.trial,
        architecture=flight.architecture,
        outcome=outcome.mode,
        failure=outcome.failure,
        seed=flight.seed,
        scenario_hash=scenario_digest(flight.truth),
        overrides=plain(flight.overrides),
        values=plain(flight.values),
        metrics=plain(measured),
        plan=plain(outcome.plan),
        code=landed.code,
        versions=landed.versions,
        seconds=landed.seconds,
        host=landed.host,
        attempts=flight.attempts,
        finished=time.time(),
    )


class _Ended(NamedTuple):
    """How a call ended: with a value, with a failure that is the trial's outcome, or so that it is tried again."""

    value: Any = None
    failure: str | None = None
    again: bool = False


def _ended(future: Future[Any], attempts: int, workers: Workers, planning: bool = False) -> _Ended:
    """How a call ended that was tried so often; SimulationError where nobody is left to try it again."""
    what = "planning " if planning else ""
    try:
        return _Ended(future.result())
    except TrialLimitError as error:
        return _Ended(failure=f"{error.kind}: {what}{error}")
    except TrialError as error:
        if planning and isinstance(error.error, InputError):
            raise error.error from None
        return _Ended(failure=f"crashed: {'planning: ' if planning else ''}{error}")
    except (Exception, CancelledError) as error:  # each kind of workers has its own
        if not workers.alive():
            raise _gone(workers, error) from None
        if attempts < ATTEMPTS:
            return _Ended(again=True)
        return _Ended(failure=f"crashed: {what}lost its worker {ATTEMPTS} times: {first_line(error)}")


def _gone(workers: Workers, error: BaseException) -> SimulationError:
    return SimulationError(f"{workers.name} is gone: {first_line(error)}; what has ended is kept, --resume goes on")
