"""The driver: plans each motion once, flies every trial that is missing, and keeps each as it ends."""

from __future__ import annotations

import asyncio
import queue
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Protocol

from flipdiagram.errors import SimulationError
from flipdiagram.flips.children import TrialError, TrialTimeoutError, in_child
from flipdiagram.flips.engine import Engine
from flipdiagram.flips.flips import Outcome
from flipdiagram.flips.work import Flight, Landed, Planned, Work, fly_trial, plan_trial, provenance
from flipdiagram.scenario.scenario import Scenario

WORK = Work(plan_trial, fly_trial)
ATTEMPTS = 5
"""How often a trial is tried whose worker is lost; then it is `crashed`."""
AHEAD = 2
"""Calls handed to the engine per call that runs: none idles, and few are lost or held in memory."""
PARKED = 8
"""Trials that may wait for plans, per call handed out: one plan may be shared by all of a million."""
COMMITTED = 100
"""Trials without a motion that are kept at once."""
LOOK = 5.0
"""Seconds between two looks at the width of the engine."""
LOST = (Exception, asyncio.CancelledError)
"""What a call raises that says nothing about its trial: a worker lost, and whatever else an engine knows."""


@dataclass
class Job:
    """One flip that is wanted: `name` comes back with the result."""

    name: Any
    truth: Scenario
    believed: Scenario
    architecture: str
    seed: int
    attempts: int = 0
    plan_key: str = field(init=False)

    def __post_init__(self) -> None:
        self.plan_key = self.flight("").plan_key

    def flight(self, plan: str) -> Flight:
        """What travels to a worker."""
        return Flight(self.truth, self.believed, self.architecture, self.seed, plan)


class Keeper(Protocol):
    """Where plans and results are kept."""

    def plan(self, key: str) -> Planned | None:
        """A plan, or why there is none; None where it is not known."""

    def put_plan(self, key: str, plan: str | None, error: str | None) -> None:
        """Keep a plan or the reason why there is none."""

    def keep(self, ended: list[tuple[Job, Landed]]) -> None:
        """Keep flips that have ended."""


def fly_all(jobs: Iterable[Job], engine: Engine, keeper: Keeper, timeout: float, work: Work = WORK) -> None:
    """Fly the jobs on an engine; whatever becomes of one is handed to `keeper`, in the order in which they end.

    timeout: seconds after which a plan or a flip is given up.  Raises SimulationError where the engine is gone.
    """
    _Driver(iter(jobs), engine, keeper, timeout, work).run()


class _Driver:
    def __init__(self, jobs: Iterator[Job], engine: Engine, keeper: Keeper, timeout: float, work: Work) -> None:
        self._jobs, self._engine, self._keeper, self._timeout, self._work = jobs, engine, keeper, timeout, work
        self._ready: deque[tuple[Job, str]] = deque()
        self._waiting: dict[str, list[Job]] = {}
        """Jobs by the motion that is being planned for them."""
        self._attempts: dict[str, int] = {}
        self._recent: dict[str, str] = {}
        """The last plans used, so that a shared one is not read again for every flip."""
        self._given_up: dict[str, str] = {}
        """Motions whose planning timed out or crashed, with the reason."""
        self._under_way: dict[Future[Any], Callable[[Future[Any]], None]] = {}
        self._ended: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
        self._landed: list[tuple[Job, Landed]] = []
        self._width, self._looked = 1, float("-inf")

    def run(self) -> None:
        more = True
        while True:
            while more and len(self._under_way) < self._window():
                more = self._hand_out()
            if not self._under_way:
                break
            for future in self._some_ended():
                self._under_way.pop(future)(future)
            self._commit()
            more = True
        self._commit()

    def _window(self) -> int:
        if time.monotonic() - self._looked > LOOK:
            self._width, self._looked = max(self._engine.width(), 1), time.monotonic()
        return AHEAD * self._width

    def _some_ended(self) -> list[Future[Any]]:
        found = [self._ended.get()]
        while not self._ended.empty():
            found.append(self._ended.get())
        return found

    def _commit(self) -> None:
        if self._landed:
            self._keeper.keep(self._landed)
            self._landed = []

    def _hand_out(self) -> bool:
        """Give the engine one more call; False where there is none now."""
        while not self._ready:
            if sum(map(len, self._waiting.values())) > PARKED * self._window():
                return False
            if len(self._landed) > COMMITTED:
                self._commit()
            job = next(self._jobs, None)
            if job is None:
                return False
            if job.plan_key in self._waiting:
                self._waiting[job.plan_key].append(job)
            elif job.plan_key in self._given_up:
                self._end(job, self._given_up[job.plan_key])
            elif (plan := self._known(job.plan_key)) is None:
                self._waiting[job.plan_key] = [job]
                self._plan(job)
                return True
            else:
                self._planned([job], plan)
        self._fly(*self._ready.popleft())
        return True

    def _known(self, key: str) -> Planned | None:
        if key in self._recent:
            return self._recent[key], None
        found = self._keeper.plan(key)
        if found is not None and found[0] is not None:
            if len(self._recent) > 16:
                self._recent.clear()
            self._recent[key] = found[0]
        return found

    def _planned(self, jobs: list[Job], found: Planned) -> None:
        plan, error = found
        for job in jobs:
            if plan is None:
                self._end(job, f"no plan: {error}")
            else:
                self._ready.append((job, plan))

    def _plan(self, job: Job) -> None:
        key = job.plan_key

        def ended(future: Future[Any]) -> None:
            try:
                found = future.result()
            except TrialTimeoutError as error:
                return self._give_up(key, f"timeout: planning {error}")
            except TrialError as error:
                return self._give_up(key, f"crashed: planning: {error}")
            except LOST as error:
                self._check_alive(error)
                self._attempts[key] = self._attempts.get(key, 0) + 1
                if self._attempts[key] < ATTEMPTS:
                    return self._plan(job)
                return self._give_up(key, f"crashed: planning lost its worker {ATTEMPTS} times: {_line(error)}")
            self._keeper.put_plan(key, *found)
            self._planned(self._waiting.pop(key), found)

        self._submit(self._work.plan, (job.believed,), ended)

    def _give_up(self, key: str, failure: str) -> None:
        self._given_up[key] = failure
        for job in self._waiting.pop(key):
            self._end(job, failure)

    def _fly(self, job: Job, plan: str) -> None:
        job.attempts += 1

        def ended(future: Future[Any]) -> None:
            try:
                self._landed.append((job, future.result()))
            except TrialTimeoutError as error:
                self._end(job, f"timeout: {error}")
            except TrialError as error:
                self._end(job, f"crashed: {error}")
            except LOST as error:
                self._check_alive(error)
                if job.attempts < ATTEMPTS:
                    self._ready.appendleft((job, plan))
                else:
                    self._end(job, f"crashed: lost its worker {ATTEMPTS} times: {_line(error)}")

        self._submit(self._work.fly, (job.flight(plan),), ended)

    def _submit(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], ended: Callable[[Future[Any]], None]
    ) -> None:
        try:
            future = self._engine.executor.submit(in_child, function, arguments, self._timeout)
        except Exception as error:  # each engine has its own
            raise _gone(self._engine, error) from None
        self._under_way[future] = ended
        future.add_done_callback(self._ended.put)

    def _check_alive(self, error: BaseException) -> None:
        if not self._engine.alive():
            raise _gone(self._engine, error) from None

    def _end(self, job: Job, failure: str) -> None:
        self._landed.append((job, Landed(Outcome(None, failure), None, 0.0, *provenance())))


def _gone(engine: Engine, error: BaseException) -> SimulationError:
    return SimulationError(f"{engine.name} is gone: {_line(error)}; what has ended is kept, --resume goes on")


def _line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
