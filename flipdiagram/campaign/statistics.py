"""Rates and differences with their uncertainty: pure functions of counts."""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

LEVEL = 0.95
"""Confidence of every interval."""


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's score interval of a rate (1927); (0, 1) without trials."""
    from scipy.stats import binomtest  # a third of a second, which not every command needs

    if trials == 0:
        return 0.0, 1.0
    interval = binomtest(successes, trials).proportion_ci(LEVEL, method="wilson")
    return float(interval.low), float(interval.high)


def success_rate(successes: int, trials: int) -> dict[str, float | None]:
    """A rate with its interval, as summaries tell it; no rate without trials."""
    low, high = wilson(successes, trials)
    return {"rate": successes / trials if trials else None, "low": low, "high": high}


def paired(first: Sequence[bool], second: Sequence[bool]) -> dict[str, float]:
    """Two controllers in the same trials, as summaries tell it: their difference, its interval, McNemar's p."""
    pairs = Counter((bool(a), bool(b)) for a, b in zip(first, second, strict=True))
    counts = pairs[True, True], pairs[True, False], pairs[False, True], pairs[False, False]
    difference, low, high = paired_difference(*counts)
    entry = {"trials": sum(counts), "first_only": counts[1], "second_only": counts[2]}
    return entry | {"difference": difference, "low": low, "high": high, "p": mcnemar(*counts[1:3])}


def paired_difference(both: int, first: int, second: int, neither: int) -> tuple[float, float, float]:
    """Difference of two success rates of the same trials, first minus second, and its 95 % interval.

    Arguments: trials in which both, only the first, only the second, neither succeeded.  Newcombe's method 10
    (Statistics in Medicine 17, 1998, 2635): Wilson's intervals combined, with the correlation of the pairs.
    """
    n = both + first + second + neither
    if n == 0:
        return 0.0, -1.0, 1.0
    p1, p2 = (both + first) / n, (both + second) / n
    (l1, u1), (l2, u2) = wilson(both + first, n), wilson(both + second, n)
    product = float(both + first) * (second + neither) * (both + second) * (first + neither)
    cross = float(both * neither - first * second)
    if cross > 0:
        cross = max(cross - n / 2, 0.0)
    phi = cross / math.sqrt(product) if product else 0.0
    below = (p1 - l1) ** 2 - 2 * phi * (p1 - l1) * (u2 - p2) + (u2 - p2) ** 2
    above = (u1 - p1) ** 2 - 2 * phi * (u1 - p1) * (p2 - l2) + (p2 - l2) ** 2
    difference = p1 - p2
    return difference, difference - math.sqrt(max(below, 0.0)), difference + math.sqrt(max(above, 0.0))


def mcnemar(first: int, second: int) -> float:
    """Exact p-value that as many pairs are won by the first alone as by the second alone."""
    from scipy.stats import binomtest

    return float(binomtest(first, first + second, 0.5).pvalue) if first + second else 1.0


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjusted for having looked at all of them (Holm 1979)."""
    order = np.argsort(p_values)
    largest = np.maximum.accumulate(np.arange(len(order), 0, -1) * np.sort(p_values)).clip(max=1.0)
    return [float(largest[rank]) for rank in np.argsort(order)]
