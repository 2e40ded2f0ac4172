"""Whether a response that misses the criterion of steadiness repeats at all, and after how many periods.

The period of a command is a whole number of ticks only by chance: from one period to the next the samples move by a
part of a tick.  A force that jumps where v crosses 0 feels it, as held friction of either sign then begins up to one
tick earlier or later, and windows of a loop that has long settled differ.  So the channel is driven once more at the
nearest frequency whose window of N ticks is m whole periods, ω' = 2π m/(N T).  There the sampled loop is driven
periodically, and its readings tell what it does: repeat, repeat only every p-th window, settle, or none of these.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Complex, Floats
from flipdiagram.studies.frequency.sweep import Windows, apart, decisive

Verdict = Literal["periodic", "subharmonic", "settling", "not periodic"]
MOST_WINDOWS = 24
"""Windows looked at before a response is called other than periodic."""
LARGEST_ORDER = 8
"""Largest number of windows after which a subharmonic is looked for; a third of MOST_WINDOWS."""
SHRINKS = 0.5
"""Differences of successive windows that fall to this part from the first third to the last are settling."""


def whole_frequency(omega: ArrayLike, ticks: ArrayLike, period: float) -> tuple[Floats, np.ndarray]:
    """(ω', m): the frequency next to ω [rad/s] of which a window of N `ticks` is m whole periods; T = `period` [s]."""
    n = np.asarray(ticks, dtype=float)
    m = np.maximum(np.rint(np.asarray(omega, dtype=float) * n * period / (2 * np.pi)), 1.0)
    return 2 * np.pi * m / (n * period), m.astype(int)


def repetitions(
    loop: Any,
    omega: ArrayLike,
    ticks: ArrayLike,
    parameters: Mapping[str, ArrayLike],
    settling: ArrayLike,
    *,
    tolerance: float,
    name: str = "loop",
) -> tuple[list[dict[str, Any]], int]:
    """Judge channels that `sweep.measure` found unsteady: an entry for each, and the channel-steps used.

    verdict: "periodic", every window reads the same; "subharmonic", only every p-th does; "settling", the windows still
    approach each other; "not periodic", none of these within MOST_WINDOWS.  judged_at_omega_rad_s: the frequency
    driven; repeats_after_periods: of the command, None where readings do not repeat; windows: looked at, or for
    "settling" the number after which they will agree, judged from their decay; spread_there: relative difference left
    between windows that should be equal.

    ticks (n,): samples of the windows they were measured in; the other arguments as for `sweep.Windows`.
    Raises SimulationError where a loop diverges.
    """
    whole, m = whole_frequency(omega, ticks, loop.period)
    windows = Windows(loop, whole, parameters, settling, ticks=ticks, name=name)
    readings: list[list[Complex]] = [[] for _ in whole]
    active = np.arange(len(whole))
    for _ in range(MOST_WINDOWS):
        if not active.size:
            break
        for i, reading in zip(active, decisive(windows.next(active)).T, strict=True):
            readings[i].append(reading)
        active = np.array([i for i in active if judge(readings[i], tolerance)[0] != "periodic"], dtype=int)
    verdicts = []
    for k, series in enumerate(readings):
        verdict, order, count, spread = judge(series, tolerance)
        entry: dict[str, Any] = {"verdict": verdict, "judged_at_omega_rad_s": float(whole[k])}
        entry |= {"repeats_after_periods": order * int(m[k]) if order else None}
        verdicts.append(entry | {"windows": count, "spread_there": spread})
    return verdicts, windows.steps


def judge(series: Sequence[Complex], tolerance: float) -> tuple[Verdict, int | None, int, float]:
    """(verdict, p, windows, spread) of successive readings, each of shape (q,); see `repetitions`.

    Readings repeat after p windows where those p apart differ by at most the tolerance, relatively, p times in a row
    and at least twice.  A p above 1 counts only where successive windows do not approach each other as well, for they
    may do so from alternating sides.
    """
    values = np.array(series)
    count = len(values)

    def differences(p: int) -> Floats:
        return np.asarray(np.max(apart(values[p:], values[:-p]), axis=1))

    def repeats(p: int) -> bool:
        return count >= p + max(p, 2) and bool((differences(p)[-max(p, 2) :] <= tolerance).all())

    if repeats(1):
        return "periodic", 1, count, float(differences(1)[-1])
    if count < 3:
        return "not periodic", None, count, math.inf
    steps, third = differences(1), max(1, (count - 1) // 3)
    first, middle, last = (float(part.max()) for part in (steps[:third], steps[-2 * third : -third], steps[-third:]))
    if last <= SHRINKS * first and last < middle:
        more = math.log(last / tolerance) / math.log(middle / last) * third
        return "settling", None, count + max(1, math.ceil(more)), last
    for p in range(2, LARGEST_ORDER + 1):
        if repeats(p):
            return "subharmonic", p, count, float(differences(p)[-1])
    return "not periodic", None, count, last
