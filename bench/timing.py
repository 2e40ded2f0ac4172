"""Clocks: repetitions of alternatives in turn, and the time that functions take without those they call."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch


def timed(function: Callable[[], Any], clock: Callable[[], float] = time.perf_counter) -> tuple[float, Any]:
    """Time [s] of one call, wall time unless another clock is given, and its result."""
    begin = clock()
    result = function()
    return clock() - begin, result


def in_turn(alternatives: Mapping[str, Callable[[], float]], repetitions: int) -> dict[str, list[float]]:
    """Call the alternatives A B C A B C …, so that a busy machine slows all alike; each returns what it measured."""
    values: dict[str, list[float]] = {name: [] for name in alternatives}
    for _ in range(repetitions):
        for name, measure in alternatives.items():
            values[name].append(measure())
    return values


def ratios(a: list[float], b: list[float]) -> list[float]:
    """a/b, each repetition of the one with that of the other which came next to it."""
    return [x / y for x, y in zip(a, b, strict=True)]


class SelfTimes:
    """Time of wrapped functions by name, each without the wrapped functions called inside it."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.seconds: dict[str, float] = {}
        self._clock, self._inside = clock, list[float]()

    def wrap(self, function: Callable[..., Any], name: Callable[[], str]) -> Callable[..., Any]:
        """The function with a clock; `name` is asked at each call, as a system gets its name after its callbacks."""
        clock, inside, seconds = self._clock, self._inside, self.seconds

        def with_clock(*arguments: Any, **options: Any) -> Any:
            begin = clock()
            inside.append(0.0)
            try:
                return function(*arguments, **options)
            finally:
                elapsed = clock() - begin
                own = elapsed - inside.pop()
                if inside:
                    inside[-1] += elapsed
                key = name()
                seconds[key] = seconds.get(key, 0.0) + own

        return with_clock

    def take(self) -> dict[str, float]:
        """The seconds by name since the last `take`; starts again from zero."""
        seconds = dict(self.seconds)
        self.seconds.clear()
        return seconds

    @contextmanager
    def of_method(self, owner: Any, method: str, name: str) -> Iterator[None]:
        """Put the clock on a method of a class or a function of a module while the context lasts."""
        with patch.object(owner, method, self.wrap(getattr(owner, method), lambda: name)):
            yield
