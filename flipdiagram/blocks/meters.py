"""Instruments as blocks: their sums are discrete state, so that measuring needs no log.

Every meter counts the samples at t >= ``start_time``.  To measure one window after another, reset its state.
"""

from typing import Any

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._parameters import (
    ScalarContext,
    ScalarDiscreteValues,
    ScalarVector,
    channels,
    declare_parameter,
    sampling,
)
from flipdiagram.blocks._scalars import choose, larger, smaller


def whole_periods(omega: float, period: float, shortest: int, longest: int | None = None) -> tuple[int, float]:
    """A window in samples that is as nearly a whole number of periods 2 pi/omega as its length allows.

    Returns (N, rest): N in [shortest, longest] samples of ``period`` [s], and what is left over or missing, as a
    fraction of a period, in [-0.5, 0.5]; the first N whose rest is below 1e-3, else the best.
    ``longest``: by default 64 periods beyond ``shortest``, and at most 4096 samples beyond one period.
    """
    per_period = 2 * np.pi / (omega * period)
    first = max(1.0, np.ceil(shortest / per_period))
    count = 64 if longest is None else max(1, int(longest / per_period - first + 1))
    if longest is None:
        count = max(1, min(count, int(4096 / per_period) + 1))
    periods = first + np.arange(count)
    samples = np.maximum(np.rint(periods * per_period), 1)
    rest = samples / per_period - periods
    good = np.nonzero(np.abs(rest) < 1e-3)[0]
    best = int(good[0]) if good.size else int(np.argmin(np.abs(rest)))
    return int(samples[best]), float(rest[best])


def fundamental(sums: ArrayLike, omega: ArrayLike, period: float, start: ArrayLike, ticks: ArrayLike) -> Array:
    """Phasor Y = S + j C of the fit y = mean + S sin wt + C cos wt, from a lock-in's sums.

    Solves the normal equations of the least-squares fit of mean, sine and cosine to N = ``ticks`` samples from tick
    ``start`` on, whose matrix is known in closed form; so a constant and a pure sinusoid are separated exactly also
    where N is not a whole number of periods.  ``sums`` (..., 3) = sums of y sin wt, y cos wt and y; omega [rad/s],
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


def _started(context: ScalarContext, start_time: Any) -> Any:
    return context.get_time() >= start_time


@TemplateSystem.define("LockIn_")
def LockIn_(T: Any) -> type:
    """``LockIn`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Lock-in amplifier of n channels: running sums of y sin wt, y cos wt and y, each ``period`` [s].

        ``fundamental`` turns them into amplitude and phase.  Numeric parameters of the Context, one number per
        channel: ``omega`` w [rad/s] > 0, ``start_time`` [s] >= 0.
        Input ``y``, shape (n,); output ``sums``, shape (3 n,): all of y sin wt, then y cos wt, then y [unit of y].
        """

        numeric_parameter_names = ("omega", "start_time")

        def _construct(
            self, omega: ArrayLike, period: float, start_time: ArrayLike = 0.0, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.omega = channels("omega", omega, strict=True)
            n = self.omega.size
            self.start_time = channels("start_time", start_time, n)
            self.period, _ = sampling(period, 0.0)
            self._omega, _ = declare_parameter(self, T, self.omega)
            self._start_time, _ = declare_parameter(self, T, self.start_time)
            self._y = self.DeclareVectorInputPort("y", n)
            state = self.DeclareDiscreteState(3 * n)
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, 0.0, self._update)
            self.DeclareStateOutputPort("sums", state)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.omega, other.period, other.start_time, converter=converter)

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            omega = context.get_numeric_parameter(self._omega).CopyToVector()
            start_time = context.get_numeric_parameter(self._start_time).CopyToVector()
            y = self._y.Eval(context)
            added = []
            for wave in (scalar_math.sin, scalar_math.cos, lambda angle: type(angle)(1.0)):
                for i in range(len(y)):
                    term = y[i] * wave(omega[i] * context.get_time())
                    added.append(choose(_started(context, start_time[i]), term, 0.0 * y[i]))
            sums = context.get_discrete_state_vector().CopyToVector()
            discrete_values.set_value(sums + np.array(added))

    return Impl


@TemplateSystem.define("Peak_")
def Peak_(T: Any) -> type:
    """``Peak`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Peak meter of n channels: largest and smallest sample, each ``period`` [s].

        ``start_time`` [s] >= 0, one number per channel, is a numeric parameter of the Context.
        Input ``y``, shape (n,); output ``peaks``, shape (2 n,): all maxima, then all minima [unit of y]; -inf and
        inf before the first sample.
        """

        numeric_parameter_names = ("start_time",)

        def _construct(
            self, num_channels: int, period: float, start_time: ArrayLike = 0.0, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            n = num_channels
            self.start_time = channels("start_time", start_time, n)
            self.period, _ = sampling(period, 0.0)
            self._start_time, _ = declare_parameter(self, T, self.start_time)
            self._y = self.DeclareVectorInputPort("y", n)
            state = self.DeclareDiscreteState(np.array([T(-np.inf)] * n + [T(np.inf)] * n))
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, 0.0, self._update)
            self.DeclareStateOutputPort("peaks", state)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.start_time.size, other.period, other.start_time, converter=converter)

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            start_time = context.get_numeric_parameter(self._start_time).CopyToVector()
            y, peaks = self._y.Eval(context), context.get_discrete_state_vector().CopyToVector()
            after: list[Any] = []
            n = len(y)
            for i, pick in [(i, larger) for i in range(n)] + [(i, smaller) for i in range(n)]:
                old = peaks[len(after)]
                after.append(choose(_started(context, start_time[i]), pick(old, y[i]), old))
            discrete_values.set_value(np.array(after))

    return Impl


@TemplateSystem.define("RootMeanSquare_")
def RootMeanSquare_(T: Any) -> type:
    """``RootMeanSquare`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Root of the mean squared error of n channels, sqrt(mean (y - reference)^2), each ``period`` [s].

        ``start_time`` [s] >= 0, one number per channel, is a numeric parameter of the Context.
        Inputs ``y`` and ``reference``, output ``rms``, 0 before the first sample: shape (n,) [unit of y].
        """

        numeric_parameter_names = ("start_time",)

        def _construct(
            self, num_channels: int, period: float, start_time: ArrayLike = 0.0, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            n = num_channels
            self.start_time = channels("start_time", start_time, n)
            self.period, _ = sampling(period, 0.0)
            self._start_time, _ = declare_parameter(self, T, self.start_time)
            self._y, self._reference = (self.DeclareVectorInputPort(name, n) for name in ("y", "reference"))
            state = self.DeclareDiscreteState(2 * n)
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, 0.0, self._update)
            self.DeclareVectorOutputPort("rms", n, self._calc_rms, {self.discrete_state_ticket(state)})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.start_time.size, other.period, other.start_time, converter=converter)

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            start_time = context.get_numeric_parameter(self._start_time).CopyToVector()
            error = self._y.Eval(context) - self._reference.Eval(context)
            state, n = context.get_discrete_state_vector().CopyToVector(), len(error)
            squares, counts = [], []
            for i in range(n):
                started = _started(context, start_time[i])
                squares.append(state[i] + choose(started, error[i] * error[i], 0.0 * error[i]))
                counts.append(state[n + i] + choose(started, type(error[i])(1.0), type(error[i])(0.0)))
            discrete_values.set_value(np.array([*squares, *counts]))

        def _calc_rms(self, context: ScalarContext, output: ScalarVector) -> None:
            state, n = context.get_discrete_state_vector().CopyToVector(), self.start_time.size
            one = type(state[0])(1.0)
            means = [larger(state[i], 0.0 * one) / larger(state[n + i], one) for i in range(n)]
            output.set_value(np.array([scalar_math.sqrt(mean) for mean in means]))

    return Impl


LockIn = LockIn_[None]
Peak = Peak_[None]
RootMeanSquare = RootMeanSquare_[None]
