"""Loops of the condensed program that numba compiles: the work is less than what NumPy's and SciPy's calls cost.

Each is a plain function of arrays that it reads, or fills in place; `compiled()` gives their machine code.  Elements
one by one, as numba compiles loops ten times as fast as expressions of whole arrays.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from flipdiagram.planning.horizon import STATES, STRIDE

AXES = 3
EQUALITIES = 4
"""Rows of `condense` that are equalities: landing height, and the tool's last velocity."""


def drift_and_guess(start: Any, near: Any, first: int, dt: float, drift: Any, guess: Any) -> None:
    """Fill two decision vectors: without any acceleration, and of the motion through `near` (N + 1, 3) to its rest.

    The guess is eq. (2) backwards, v_k = 2 (x_{k+1} − x_k)/ΔT − v_{k+1}, down to interval `first`; before it drifts.
    """
    last = near.shape[0] - 1
    for k in range(last + 1):
        for c in range(AXES):
            at = STRIDE * k + c
            drift[at] = start[c] + k * dt * start[AXES + c]
            drift[at + AXES] = start[AXES + c]
            if k < last:
                drift[at + STATES] = 0.0
    for i in range(drift.size):
        guess[i] = drift[i]
    for c in range(AXES):
        v = 0.0
        guess[STRIDE * last + c] = near[last, c]
        guess[STRIDE * last + AXES + c] = v
        for k in range(last - 1, first - 1, -1):
            before = 2.0 * (near[k + 1, c] - near[k, c]) / dt - v
            at = STRIDE * k + c
            guess[at] = near[k, c]
            guess[at + AXES] = before
            guess[at + STATES] = (v - before) / dt
            v = before


def condense(
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    map_: Any,
    drift: Any,
    guess: Any,
    near: Any,
    radii: Any,
    first: int,
    released: int,
    landing: Any,
    bound: float,
    A: Any,
    low: Any,
    high: Any,
    slack: Any,
) -> int:
    """Fill low ≤ A v ≤ high and the slack of each row at the guess, for w = drift + map v; returns their number.

    In order: landing height and rest, θ (and y, z) within a radius of `near` where it is finite, Σ value·w[column] ≤
    upper.  `released` is the place of x̂(release) in w.
    """
    last, size, n = near.shape[0] - 1, map_.shape[0], map_.shape[1]
    for j in range(n):
        A[0, j] = 0.0
    high[0] = bound
    for i in range(STATES):
        high[0] -= landing[i] * drift[released + i]
        for j in range(n):
            A[0, j] += landing[i] * map_[released + i, j]
    for c in range(AXES):
        for j in range(n):
            A[1 + c, j] = map_[size - AXES + c, j]
        high[1 + c] = -drift[size - AXES + c]
    for i in range(EQUALITIES):
        low[i] = high[i]
        slack[i] = 0.0
    m = EQUALITIES
    for c in range(AXES):
        if np.isfinite(radii[c]):
            for k in range(first + 1, last + 1):
                for j in range(n):
                    A[m, j] = map_[STRIDE * k + c, j]
                centre = near[k, c] - drift[STRIDE * k + c]
                low[m] = centre - radii[c]
                high[m] = centre + radii[c]
                slack[m] = radii[c]
                m += 1
    for i in range(upper.size):
        for j in range(n):
            A[m + i, j] = 0.0
        low[m + i] = -np.inf
        high[m + i] = upper[i]
        slack[m + i] = upper[i]
    for e in range(values.size):
        r, column, value = m + rows[e], columns[e], values[e]
        high[r] -= value * drift[column]
        slack[r] -= value * guess[column]
        for j in range(n):
            A[r, j] += value * map_[column, j]
    return int(m + upper.size)


def excess(rows: Any, columns: Any, values: Any, left: Any, w: Any) -> float:
    """Largest violation of the rows Σ value·w[column] ≤ left, 0 where all hold; takes the sums from `left`."""
    for e in range(values.size):
        left[rows[e]] -= values[e] * w[columns[e]]
    worst = 0.0
    for r in range(left.size):
        worst = max(worst, -left[r])
    return worst


def distances(
    A: Any,
    low: Any,
    high: Any,
    slack: Any,
    equalities: int,
    touching: float,
    tolerance: float,
    norm: Any,
    distance: Any,
    kind: Any,
    scratch: Any,
) -> int:
    """Fill |row|, slack/|row| (twice), and the kind of each row: 5 equality, 1 nearer than `touching`, else 0.

    Equalities are nearest; rows of zeros, and slacks that are no numbers, are farthest.  Returns how many touch, or −1
    where a row of zeros does not hold.
    """
    touched, impossible = 0, False
    for r in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += A[r, j] * A[r, j]
        norm[r] = np.sqrt(total)
        if total == 0.0 and (low[r] > tolerance or high[r] < -tolerance):
            impossible = True
        known = total > 0.0 and slack[r] == slack[r]
        distance[r] = slack[r] / norm[r] if known else np.inf
        kind[r] = 0
        if r < equalities:
            distance[r] = -np.inf
            kind[r] = 5
        elif distance[r] < touching:
            kind[r] = 1
            touched += 1
        scratch[r] = distance[r]
    return -1 if impossible else touched


def choose(distance: Any, norm: Any, farthest: float, chosen: Any) -> None:
    """Fill which rows are as near as `farthest` [√cost] or nearer, those of zeros left out."""
    for r in range(distance.size):
        chosen[r] = norm[r] > 0.0 and distance[r] <= farthest


def kth(values: Any, k: int) -> float:
    """The value that sorting would put at place k (Hoare's selection); rearranges the values."""
    low, high = 0, values.size - 1
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    return values[k]  # type: ignore[no-any-return]


def pick(A: Any, low: Any, high: Any, kind: Any, use: Any, part: Any, lower: Any, upper: Any, kinds: Any) -> None:
    """Fill part, lower, upper, kinds with the rows `use` of the others."""
    for i in range(use.size):
        r = use[i]
        lower[i] = low[r]
        upper[i] = high[r]
        kinds[i] = kind[r]
        for j in range(A.shape[1]):
            part[i, j] = A[r, j]


def working_set(multipliers: Any, equalities: int, kind: Any) -> None:
    """Fill the kind of each inequality: 1 held at its upper bound, 3 at its lower one, else 0."""
    for r in range(equalities, kind.size):
        kind[r] = 1 if multipliers[r] > 0.0 else (3 if multipliers[r] < 0.0 else 0)


def add_violated(A: Any, v: Any, low: Any, high: Any, norm: Any, tolerance: float, chosen: Any) -> int:
    """Choose all rows farther beyond their bounds than the tolerance, as well; returns how many are new."""
    new = 0
    for r in range(A.shape[0]):
        if not chosen[r] and norm[r] > 0.0:
            value = 0.0
            for j in range(A.shape[1]):
                value += A[r, j] * v[j]
            if max(value - high[r], low[r] - value) > tolerance * norm[r]:
                chosen[r] = True
                new += 1
    return new


@cache
def compiled() -> Any:
    """The functions of this module as machine code; kept beside the source, or in numba's cache folder."""
    import numba  # half a second: only where it is used

    b, i, f = numba.types.boolean, numba.types.int64, numba.types.float64
    flags, places, kinds, vector, matrix = b[::1], i[::1], numba.types.int32[::1], f[::1], f[:, ::1]
    entries = (places, places, vector, vector)
    signatures: dict[Any, Any] = {
        drift_and_guess: numba.void(vector, matrix, i, f, vector, vector),
        condense: i(*entries, matrix, vector, vector, matrix, vector, i, i, vector, f, matrix, vector, vector, vector),
        excess: f(*entries, vector),
        distances: i(matrix, vector, vector, vector, i, f, f, vector, vector, kinds, vector),
        kth: f(vector, i),
        choose: numba.void(vector, vector, f, flags),
        pick: numba.void(matrix, vector, vector, kinds, places, matrix, vector, vector, kinds),
        working_set: numba.void(vector, i, kinds),
        add_violated: i(matrix, vector, vector, vector, vector, f, flags),
    }
    sums = {"reassoc", "contract"}  # else a sum over a row is not vectorised
    made = {}
    for function, signature in signatures.items():
        try:
            made[function.__name__] = numba.njit(signature, cache=True, fastmath=sums)(function)
        except RuntimeError:  # there is no folder to keep it in
            made[function.__name__] = numba.njit(signature, fastmath=sums)(function)
    return SimpleNamespace(**made)
