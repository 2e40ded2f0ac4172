"""A loop written by hand for this one diagram and compiled by numba; with the same meters as the diagram, if asked."""

from __future__ import annotations

from math import cos, inf, sin
from typing import Any

import numba  # type: ignore[import-untyped]
import numpy as np

from bench.one_dof import Array, Numbers, Stepper

NAME, PACKAGE = "hand-written numba loop", None
_compiled: Any = numba.njit(error_model="numpy", nogil=True)


@_compiled
def _loop(m, k_p, k_v, g_dis, nominal, decay, gravity, T, omega, ticks, every, log):  # type: ignore[no-untyped-def]
    g = g_dis * nominal
    for c in range(omega.size):
        w, x, v, z = omega[c], 0.0, 0.0, 0.0
        for k in range(ticks):
            if every:
                log[c, k] = x
            s, o = sin(w * (k * T)), cos(w * (k * T))
            f = m * (k_p * (-s - x) + k_v * (-w * o - v) + w * w * s) + (z - g * v)
            z = decay * z + (1.0 - decay) * (f + g * v)
            a = (f + m * gravity) / m
            x, v = x + T * (v + 0.5 * T * a), v + T * a
        log[c, -1] = x


@_compiled
def _metered(  # type: ignore[no-untyped-def]
    m, k_p, k_v, g_dis, nominal, decay, gravity, T, omega, start, ticks, sums
):
    g = g_dis * nominal
    for c in range(omega.size):
        w, x, v, z = omega[c], 0.0, 0.0, 0.0
        sine, cosine, mean, squares, count = 0.0, 0.0, 0.0, 0.0, 0.0
        high, low, high_f, low_f = -inf, inf, -inf, inf
        for k in range(ticks):
            t = k * T
            s, o = sin(w * t), cos(w * t)
            f = m * (k_p * (-s - x) + k_v * (-w * o - v) + w * w * s) + (z - g * v)
            if t >= start:
                sine += x * s
                cosine += x * o
                mean += x
                high, low = max(high, x), min(low, x)
                high_f, low_f = max(high_f, f), min(low_f, f)
                squares += (x + s) * (x + s)
                count += 1.0
            z = decay * z + (1.0 - decay) * (f + g * v)
            a = (f + m * gravity) / m
            x, v = x + T * (v + 0.5 * T * a), v + T * a
        sums[c, :5] = x, v, z, sine, cosine
        sums[c, 5:10] = mean, high, low, high_f, low_f
        sums[c, 10:] = squares, count


def _arguments(numbers: Numbers) -> tuple[float, ...]:
    s = numbers.settings
    return s.mass, s.k_p, s.k_v, s.g_dis, numbers.nominal, numbers.decay, numbers.gravity, s.step


def prepare(numbers: Numbers, omega: Array, ticks: int, log: bool) -> Stepper:
    """Compiled at the first call, which is made here."""
    out = np.zeros((omega.size, ticks + 1 if log else 1))
    _loop(*_arguments(numbers), omega, 1, log, out)

    def run() -> Array:
        _loop(*_arguments(numbers), omega, ticks, log, out)
        return out

    return run


def prepare_metered(numbers: Numbers, omega: Array, ticks: int) -> Any:
    """A function that runs the loop with meters: states and sums, shape (n, 12)."""
    out = np.zeros((omega.size, 12))
    _metered(*_arguments(numbers), omega, 0.0, 1, out)

    def run() -> Array:
        _metered(*_arguments(numbers), omega, 0.0, ticks, out)
        return out

    return run
