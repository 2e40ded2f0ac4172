"""What trials run on: a `concurrent.futures.Executor` whose threads call `in_child`."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass


@dataclass(frozen=True)
class Engine:
    """An executor, and how many calls it makes at a time."""

    executor: Executor
    width: Callable[[], int]
    """Asked now and then: the workers of a cluster come and go."""
    name: str
    alive: Callable[[], bool] = lambda: True
    """Whether it can still be used."""
