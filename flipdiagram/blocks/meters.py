"""Instruments as blocks: their sums are discrete state, so that measuring needs no log.

Every meter counts the samples at t >= `start_time`.  To measure one window after another, reset its state.  Drawings
leave out what has `only_looks_on`.
"""

from typing import Any

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._scalars import choose
from flipdiagram.blocks.block import Block, convertible


def whole_periods(omega: float, period: float, shortest: int) -> int:
    """A window of N >= `shortest` samples that is as nearly a whole number of periods 2 pi/omega as its length allows.

    A sample lasts `period` [s].  The first N that misses a whole number by less than 1e-3 periods, else the best, up
    to 64 periods beyond `shortest`, and at most 4096 samples beyond one period.
    """
    per_period = 2 * np.pi / (omega * period)
    first = max(1.0, np.ceil(shortest / per_period))
    periods = first + np.arange(min(64, int(4096 / per_period) + 1))
    samples = np.maximum(np.rint(periods * per_period), 1)
    rest = np.abs(samples / per_period - periods)
    good = np.flatnonzero(rest < 1e-3)
    return int(samples[good[0] if good.size else np.argmin(rest)])


def fundamental(sums: ArrayLike, omega: ArrayLike, period: float, start: ArrayLike, ticks: ArrayLike) -> Array:
    """Phasor Y = S + j C of the fit y = mean + S sin wt + C cos wt, from a lock-in's sums.

    Solves the normal equations of the least-squares fit of mean, sine and cosine to N = `ticks` samples from tick
    `start` on, whose matrix is known in closed form; so a constant and a pure sinusoid are separated exactly also
    where N is not a whole number of periods.  `sums` (..., 3) = sums of y sin wt, y cos wt and y; omega [rad/s],
    period [s].  Returns Y, complex, shape (...).
    """
    b = np.asarray(sums, dtype=float)
    w, first, n = np.broadcast_arrays(np.asarray(omega, dtype=float), start, ticks)

    def geometric(angle: Any) -> Any:
        """Sum of e^(j angle k) over the samples k = first ... first + n - 1."""
        return np.exp(1j * angle * (first + (n - 1) / 2)) * np.sin(n * angle / 2) / np.sin(angle / 2)

    one, two = geometric(w * period), geometric(2 * w * period)
    s, c, cc, ss, sc = one.imag, one.real, (n + two.real) / 2, (n - two.real) / 2, two.imag / 2
    rows = [[ss, sc, s], [sc, cc, c], [s, c, n.astype(float)]]
    matrix = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    solution = np.linalg.solve(matrix, b[..., None])[..., 0]
    return solution[..., 0] + 1j * solution[..., 1]


def lock_in_sums(sums: Array, y: Array, omega: Array, t: Any, start_time: Array) -> Array:
    """The sums (3 n,) after a sample at t [s]: of y sin wt, then y cos wt, then y, each of n channels."""
    added = []
    for wave in (scalar_math.sin, scalar_math.cos, lambda angle: type(angle)(1.0)):
        for i in range(len(y)):
            added.append(choose(t >= start_time[i], y[i] * wave(omega[i] * t), 0.0 * y[i]))
    return sums + np.array(added)


def next_peaks(peaks: Array, y: Array, t: Any, start_time: Array) -> Array:
    """Largest, then smallest samples (2 n,) after a sample y (n,) at t [s]."""
    n = len(y)
    picks = [scalar_math.max] * n + [scalar_math.min] * n
    after = [choose(t >= start_time[i % n], pick(peaks[i], y[i % n]), peaks[i]) for i, pick in enumerate(picks)]
    return np.array(after)


def next_squares(squares: Array, y: Array, reference: Array, t: Any, start_time: Array) -> Array:
    """Sums of squared errors, then counts of samples (2 n,), after a sample y, reference (n,) at t [s]."""
    errors = y - reference
    added = [choose(t >= start, error * error, 0.0 * error) for error, start in zip(errors, start_time, strict=True)]
    added += [choose(t >= start, type(start)(1.0), type(start)(0.0)) for start in start_time]
    return squares + np.array(added)


def root_mean_square(squares: Array) -> Array:
    """sqrt(sum / count) per channel (n,), 0 before the first sample, of sums and counts (2 n,)."""
    n, one = len(squares) // 2, type(squares[0])(1.0)
    means = [scalar_math.max(squares[i], 0.0 * one) / scalar_math.max(squares[n + i], one) for i in range(n)]
    return np.array([scalar_math.sqrt(mean) for mean in means])


@convertible()
class LockIn(Block):
    """Lock-in amplifier of n channels: running sums of y sin wt, y cos wt and y, each `period` [s].

    `fundamental` turns them into amplitude and phase.  Numeric parameters of the Context, one number per channel:
    `omega` w [rad/s] > 0, `start_time` [s] >= 0.
    Input `y`, shape (n,); output `sums`, shape (3 n,): all of y sin wt, then y cos wt, then y [unit of y].
    """

    only_looks_on = True

    def __init__(self, omega: ArrayLike, period: float, start_time: ArrayLike = 0.0) -> None:
        n = self.parameter("omega", omega, strict=True)
        self.parameter("start_time", start_time, n)
        self.input("y", n)
        state = self.state("sums", 3 * n)
        self.update(lock_in_sums, period)
        self.DeclareStateOutputPort("sums", state)


@convertible()
class Peak(Block):
    """Peak meter of n channels: largest and smallest sample, each `period` [s].

    `start_time` [s] >= 0, one number per channel, is a numeric parameter of the Context.
    Input `y`, shape (n,); output `peaks`, shape (2 n,): all maxima, then all minima [unit of y]; -inf and inf before
    the first sample.
    """

    only_looks_on = True

    def __init__(self, num_channels: int, period: float, start_time: ArrayLike = 0.0) -> None:
        self.num_channels, n = num_channels, num_channels
        self.parameter("start_time", start_time, n)
        self.input("y", n)
        state = self.state("peaks", [-np.inf] * n + [np.inf] * n)
        self.update(next_peaks, period)
        self.DeclareStateOutputPort("peaks", state)


@convertible()
class RootMeanSquare(Block):
    """Root of the mean squared error of n channels, sqrt(mean (y - reference)^2), each `period` [s].

    `start_time` [s] >= 0, one number per channel, is a numeric parameter of the Context.
    Inputs `y` and `reference`, output `rms`, 0 before the first sample: shape (n,) [unit of y].
    """

    only_looks_on = True

    def __init__(self, num_channels: int, period: float, start_time: ArrayLike = 0.0) -> None:
        self.num_channels = num_channels
        self.parameter("start_time", start_time, num_channels)
        self.input("y", num_channels)
        self.input("reference", num_channels)
        self.state("squares", 2 * num_channels)
        self.update(next_squares, period)
        self.output("rms", num_channels, root_mean_square)
