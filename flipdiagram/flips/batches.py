"""Many calls at once: what a task of a cluster carries, so that its scheduler has little to do; and how many.

A task costs a scheduler and a driver some milliseconds whatever it holds.  Each call in it still has a child process,
limits and an outcome of its own.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from flipdiagram.flips.child_process import Limits, TrialError, TrialLimitError, WorkerLostError, in_child

MOST = 256
"""Calls in a batch at most: so many rows wait to be kept at once."""
SHARES = 3
"""Of what is left a worker gets one of so many shares: the batches shrink towards the end, and no worker idles long."""
RECENT = 10
"""Batches whose calls tell how long the next ones take."""


@dataclass(frozen=True)
class Batch:
    """Calls of one function, to be made one after another.

    One object and no list: Dask looks into lists for what it knows.
    """

    function: Callable[..., Any]
    tasks: Sequence[tuple[Any, ...]]
    """Arguments of each call."""
    limits: Limits
    """What each may take."""


class Answer(NamedTuple):
    """What a call returned, or the error with which it ended; and how long it took [s]."""

    value: Any
    error: BaseException | None
    seconds: float


def each_in_child(batch: Batch) -> list[Answer]:
    """Make the calls in the child of this thread.

    A child that is lost ends the batch: the answers are then fewer than the tasks, the last one is a WorkerLostError.
    So workers that are being ended do not begin all the others.
    """
    answers: list[Answer] = []
    for task in batch.tasks:
        begin = time.monotonic()
        value, error = None, None
        try:
            value = in_child(batch.function, task, batch.limits)
        except (TrialLimitError, TrialError, WorkerLostError) as raised:
            error = raised
        answers.append(Answer(value, error, time.monotonic() - begin))
        if isinstance(error, WorkerLostError):
            break
    return answers


def batch_size(seconds: float, each: float, last: int, left: int, width: int) -> int:
    """Calls that the next batch carries, from 1 to `MOST`.

    Args:
        seconds: how long a batch should take [s].
        each: how long a call takes, going by the last ones [s].
        last: calls in the batch before; the next has at most twice as many, as the first calls may have been quick.
        left: calls that nobody has been given yet.
        width: workers that share them.
    """
    fitting = seconds / each if each > 0 else math.inf
    return max(1, int(min(fitting, 2 * last, math.ceil(left / (SHARES * width)), MOST)))


class Pace:
    """How long calls of one kind have taken of late, and so how many go into a batch."""

    def __init__(self) -> None:
        self._recent: deque[tuple[int, float]] = deque(maxlen=RECENT)
        """Calls and seconds of each batch."""

    def add(self, answers: Sequence[Answer]) -> None:
        """A batch has ended."""
        self._recent.append((len(answers), sum(answer.seconds for answer in answers)))

    def size(self, seconds: float, left: int, width: int) -> int:
        """As `batch_size`; 1 as long as nothing is known."""
        if not self._recent:
            return 1
        counts, times = zip(*self._recent, strict=True)
        return batch_size(seconds, sum(times) / sum(counts), max(counts), left, width)
