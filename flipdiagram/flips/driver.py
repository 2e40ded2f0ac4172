"""The driver of all flips: plans each motion once, flies every trial that is missing, and keeps each as it ends.

What becomes of a trial whose process hangs, crashes or is killed:

* It takes more time or memory than it may: its process is killed, and `timeout` or `memory` is its outcome.
* It raises an exception: that is a bug, `crashed` is its outcome, and the exception stands in its row.
* Its process is lost in the middle, killed or out of memory: that says nothing about the trial.  It is tried again in a
  new process, `ATTEMPTS` times in all; then it is `crashed` too.
* Its batch is lost, with a worker of a cluster: nobody knows at which trial.  Each is tried again, alone from then on,
  so that only its own losses count.

Whichever it is, the other trials go on, and what has ended is in the file already.
"""

import queue
import time
from asyncio import CancelledError
from collections import deque
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, NamedTuple

from flipdiagram.errors import InputError, SimulationError, first_line
from flipdiagram.flips.batches import Answer, Batch, Pace
from flipdiagram.flips.child_process import Limits, TrialError, TrialLimitError
from flipdiagram.flips.flight import Landed, Work, provenance
from flipdiagram.flips.order import Order, fly_order, plan_order, row_of
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.row import ATTEMPTED, CODE, PackedRow
from flipdiagram.flips.store import PackedPlan, Store
from flipdiagram.flips.workers import Workers

ATTEMPTS = 5
"""How often a trial is tried whose worker is lost; then it is `crashed`."""
AHEAD = 2
"""Batches handed to the workers per batch that runs: none idles, and few are lost or held in memory."""
PARKED = 4
"""Trials that may wait for plans, per call handed out: one plan may be shared by all of a million."""
COMMITTED = 500
"""Trials that are kept at once, where more have ended or have no motion."""
REMEMBERED = 500
"""Plans at hand; the others are in the file."""
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


def fly_all(orders: Iterable[Order], count: int, flying: Flying) -> None:
    """Fly the orders, `count` in all; whatever becomes of one is a row of the store, in the order in which they end.

    Raises SimulationError where the workers are gone or fly other code.
    """
    _Driver(orders, count, flying).run()


@dataclass
class _Call:
    """A plan or a flip that is to be had."""

    order: Order
    plan: bytes = b""
    """That a flip follows."""
    attempts: int = 0
    """That have ended, be it with the loss of its worker."""


class _Line:
    """Calls of one kind that nobody has been given yet."""

    def __init__(self, what: str) -> None:
        self.what, self.pace = what, Pace()
        self.waiting: deque[_Call] = deque()
        self.alone: deque[_Call] = deque()
        """Those whose worker was lost: what comes next shall be their own doing, and no harm to others."""

    def batch(self, size: int) -> list[_Call]:
        """The next ones."""
        if self.alone:
            return [self.alone.popleft()]
        return [self.waiting.popleft() for _ in range(min(size, len(self.waiting)))]


class _Driver:
    def __init__(self, orders: Iterable[Order], count: int, flying: Flying) -> None:
        self._orders, self._left, self._flying = iter(orders), count, flying
        self._workers, self._store = flying.workers, flying.store
        self._flips, self._plans = _Line(""), _Line("planning ")
        self._parked: dict[Hashable, tuple[str, list[Order]]] = {}
        """Key and orders of each motion that is being planned."""
        self._known: dict[Hashable, PackedPlan] = {}
        """Plans by their motions."""
        self._given_up: dict[Hashable, str] = {}
        """Motions whose planning timed out or crashed, with the reason."""
        self._under_way: dict[Future[list[Answer]], tuple[_Line, list[_Call]]] = {}
        self._ended: queue.SimpleQueue[Future[list[Answer]]] = queue.SimpleQueue()
        self._landed: list[PackedRow] = []
        """Not yet kept."""
        self._width, self._looked = 1, float("-inf")

    def run(self) -> None:
        while True:
            while len(self._under_way) < self._window() and self._hand_out():
                pass
            if not self._under_way:
                break
            future = self._ended.get()
            self._land(future, *self._under_way.pop(future))
            if self._ended.empty() or len(self._landed) > COMMITTED:
                self._keep()
        self._keep()

    def _window(self) -> int:
        if time.monotonic() - self._looked > LOOK:
            self._width, self._looked = max(self._workers.width(), 1), time.monotonic()
        return AHEAD * self._width

    def _hand_out(self) -> bool:
        """Give the workers one more batch; False where there is none now."""
        flips, plans = self._size(self._flips), self._size(self._plans)
        self._take_in(flips, plans)
        full = self._flips.alone or len(self._flips.waiting) >= flips
        if self._plans.alone or (self._plans.waiting and not full):
            self._submit(self._plans, plans, plan_order, self._flying.work.plan)
        elif self._flips.alone or self._flips.waiting:
            self._submit(self._flips, flips, fly_order, self._flying.work.fly)
        else:
            return False
        return True

    def _size(self, line: _Line) -> int:
        seconds = self._workers.batch_seconds(self._width)
        return line.pace.size(seconds, self._left + len(line.waiting), self._width)

    def _take_in(self, flips: int, plans: int) -> None:
        """Take orders until a batch of flips or of plans is full, or enough of them wait for plans."""
        parked = sum(len(orders) for _, orders in self._parked.values())
        most = PARKED * self._window() * flips
        while len(self._flips.waiting) < flips and len(self._plans.waiting) < plans and parked <= most:
            if len(self._landed) > COMMITTED:
                self._keep()
            if (order := next(self._orders, None)) is None:
                self._left = 0
                return
            self._left -= 1
            parked += self._taken(order)

    def _taken(self, order: Order) -> bool:
        """Put an order where it belongs; whether it waits for its plan."""
        motion = order.motion
        if motion in self._parked:
            self._parked[motion][1].append(order)
            return True
        if motion in self._given_up:
            self._fail(order, self._given_up[motion])
            return False
        if (planned := self._known.get(motion)) is None:
            key = order.flight().plan_key
            if (planned := self._store.plan(key)) is None:
                self._parked[motion] = key, [order]
                self._plans.waiting.append(_Call(order))
                return True
            self._remember(motion, planned)
        self._planned([order], planned)
        return False

    def _remember(self, motion: Hashable, planned: PackedPlan) -> None:
        if len(self._known) >= REMEMBERED:
            del self._known[next(iter(self._known))]
        self._known[motion] = planned

    def _planned(self, orders: list[Order], planned: PackedPlan) -> None:
        plan, error = planned
        for order in orders:
            if plan is None:
                self._fail(order, f"no plan: {error}")
            else:
                self._flips.waiting.append(_Call(order, plan))

    def _submit(self, line: _Line, size: int, function: Callable[..., Any], work: Callable[..., Any]) -> None:
        calls = line.batch(size)
        tasks = [(work, call.order, call.plan) if call.plan else (work, call.order) for call in calls]
        try:
            future = self._workers.submit_batch(Batch(function, tasks, self._flying.limits))
        except Exception as error:  # each kind of workers has its own
            raise _gone(self._workers, error) from None
        self._under_way[future] = line, calls
        future.add_done_callback(self._ended.put)

    def _land(self, future: Future[list[Answer]], line: _Line, calls: list[_Call]) -> None:
        """What has become of a batch."""
        try:
            answers = future.result()
            line.pace.add(answers)
        except (Exception, CancelledError) as error:  # each kind of workers has its own
            if not self._workers.alive():
                raise _gone(self._workers, error) from None
            if len(calls) > 1:  # lost, and nobody knows at which
                line.alone.extend(calls)
                return
            answers = [Answer(None, error, 0.0)]
        values = []
        for call, answer in zip(calls, answers, strict=False):
            call.attempts += 1
            value, failure, again = _ended(answer, call.attempts, line.what)
            if again:
                line.alone.append(call)
            elif failure is None:
                values.append((call, value))
            elif line is self._plans:
                self._given_up[call.order.motion] = failure
                for order in self._parked.pop(call.order.motion)[1]:
                    self._fail(order, failure)
            else:
                self._fail(call.order, failure, call.attempts)
        line.waiting.extendleft(reversed(calls[len(answers) :]))  # not begun
        (self._land_plans if line is self._plans else self._land_flips)(values)

    def _land_plans(self, plans: list[tuple[_Call, PackedPlan]]) -> None:
        motions = [call.order.motion for call, _ in plans]
        parked = [self._parked.pop(motion) for motion in motions]
        self._store.put_plans({key: planned for (key, _), (_, planned) in zip(parked, plans, strict=True)})
        for motion, (_, orders), (_, planned) in zip(motions, parked, plans, strict=True):
            self._remember(motion, planned)
            self._planned(orders, planned)

    def _land_flips(self, rows: list[tuple[_Call, PackedRow]]) -> None:
        for call, row in rows:
            again = call.attempts > 1
            self._landed.append((*row[:ATTEMPTED], call.attempts, *row[ATTEMPTED + 1 :]) if again else row)

    def _fail(self, order: Order, failure: str, attempts: int = 1) -> None:
        landed = Landed(Outcome(None, failure), 0.0, *provenance())
        self._landed.append(row_of(order.flight(), landed, attempts).packed())

    def _keep(self) -> None:
        if not self._landed:
            return
        code = provenance()[0]
        same = [row for row in self._landed if self._flying.any_code or row[CODE] == code]
        self._store.put(same)
        for _ in same:
            self._flying.tick()
        if len(same) < len(self._landed):  # a worker that has just started reads the files as they are now
            raise SimulationError(
                "the program was changed while it flies, or a worker has another one; what has ended is kept,"
                " campaign --resume --any-version goes on with the new one"
            )
        self._landed = []


class _Ended(NamedTuple):
    """How a call ended: with a value, with a failure that is the trial's outcome, or so that it is tried again."""

    value: Any = None
    failure: str | None = None
    again: bool = False


def _ended(answer: Answer, attempts: int, what: str) -> _Ended:
    """How a call ended that was tried so often; what: "planning ", or nothing."""
    error = answer.error
    if error is None:
        return _Ended(answer.value)
    if isinstance(error, TrialLimitError):
        return _Ended(failure=f"{error.kind}: {what}{error}")
    if isinstance(error, TrialError):
        if what and isinstance(error.error, InputError):
            raise error.error from None
        return _Ended(failure=f"crashed: {what and 'planning: '}{error}")
    if attempts < ATTEMPTS:
        return _Ended(again=True)
    return _Ended(failure=f"crashed: {what}lost its worker {ATTEMPTS} times: {first_line(error)}")


def _gone(workers: Workers, error: BaseException) -> SimulationError:
    return SimulationError(f"{workers.name} is gone: {first_line(error)}; what has ended is kept, --resume goes on")
