"""Random noise of a sensor: white, drawn once a period, the same whenever it is drawn again."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd
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
    write_parameter,
)
from flipdiagram.errors import InputError

PAGE = 256
"""Ticks drawn at a time: to begin a generator takes longer than to draw this many numbers."""


def white_noise(seed: int, stream: int, tick: int, n: int) -> Array:
    """w[k] of n channels, independent standard normal numbers, shape (n,), [1]; k the ``tick`` >= 0.

    A channel's number depends on ``seed`` >= 0, ``stream`` >= 0, the channel and the tick alone: neither on the other
    channels nor on what was drawn before.
    """
    return _page(seed, stream, tick // PAGE, n)[tick % PAGE]


@lru_cache(maxsize=32)
def _page(seed: int, stream: int, page: int, n: int) -> Array:
    drawn = [
        np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stream, channel, page))).standard_normal(PAGE)
        for channel in range(n)
    ]
    found = np.array(drawn).T
    found.flags.writeable = False  # it is shared by all who ask
    return found


# no Expression: a draw is no function of the tick that a formula could state
@TemplateSystem.define("SensorNoise_", T_list=[float, AutoDiffXd], T_pairs=[(float, AutoDiffXd), (AutoDiffXd, float)])
def SensorNoise_(T: Any) -> type:
    """``SensorNoise`` over the scalar T: float or AutoDiffXd."""

    class Impl(LeafSystem_[T]):
        """Sensor noise of n channels: y[k] = u + deviation w[k], w white and standard normal, see ``white_noise``.

        ``deviation`` [unit of u] >= 0, one number per channel, is a numeric parameter of the Context; ``seed`` >= 0,
        ``stream`` >= 0 tells apart sensors with one seed; ``period`` and ``offset`` in [s].  The state counts the
        ticks: w changes at offset + k period and is held between, so all who read at a tick read the same.  Input
        ``u``, which feeds through, output ``y``: shape (n,).  Raises InputError for a bad number.
        """

        def _construct(
            self,
            deviation: ArrayLike,
            seed: int,
            period: float,
            offset: float = 0.0,
            stream: int = 0,
            converter: Any = None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.deviation = channels("deviation", deviation)
            self.seed, self.stream = _whole("seed", seed), _whole("stream", stream)
            self.period, self.offset = sampling(period, offset)
            n = self.deviation.size
            self._deviation, deviation_ticket = declare_parameter(self, T, self.deviation)
            self._u = self.DeclareVectorInputPort("u", n)
            state = self.DeclareDiscreteState(1)
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, self.offset, self._update)
            prerequisites = {self._u.ticket(), self.discrete_state_ticket(state), deviation_ticket}
            self.DeclareVectorOutputPort("y", n, self._calc_y, prerequisites)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(
                self, other.deviation, other.seed, other.period, other.offset, other.stream, converter=converter
            )

        def set_deviation(self, context: ScalarContext, deviation: ArrayLike) -> None:
            """Sets the standard deviation, shape (n,) or one number for all channels, in ``context``."""
            write_parameter(context, self._deviation, channels("deviation", deviation, self.deviation.size))

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            discrete_values.set_value(context.get_discrete_state_vector().CopyToVector() + 1.0)

        def _calc_y(self, context: ScalarContext, output: ScalarVector) -> None:
            deviation = context.get_numeric_parameter(self._deviation).CopyToVector()
            ticks = context.get_discrete_state_vector()[0]
            tick = int(ticks.value() if T is AutoDiffXd else ticks)
            w = white_noise(self.seed, self.stream, tick, deviation.size)
            output.set_value(self._u.Eval(context) + deviation * w)

    return Impl


def _whole(name: str, value: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"{name} = {value!r} is not valid; valid is a whole number of at least 0")
    return int(value)


SensorNoise = SensorNoise_[None]
