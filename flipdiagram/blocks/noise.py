"""Random noise of a sensor: white, drawn once a period, the same whenever it is drawn again."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import whole
from flipdiagram.blocks.block import Block, convertible

PAGE = 256
"""Ticks drawn at a time: to begin a generator takes longer than to draw this many numbers."""


def white_noise(seed: int, stream: int, tick: int, n: int) -> Array:
    """w[k] of n channels, independent standard normal numbers, shape (n,), [1]; k the `tick` >= 0.

    A channel's number depends on `seed` >= 0, `stream` >= 0, the channel and the tick alone: neither on the other
    channels nor on what was drawn before.
    """
    return _page(seed, stream, tick // PAGE, n)[tick % PAGE]


@lru_cache(maxsize=32)
def _page(seed: int, stream: int, page: int, n: int) -> Array:
    keys = [np.random.SeedSequence(seed, spawn_key=(stream, channel, page)) for channel in range(n)]
    noise = np.array([np.random.default_rng(key).standard_normal(PAGE) for key in keys]).T
    noise.flags.writeable = False  # it is shared by all who ask
    return noise


@convertible(float, AutoDiffXd)
class SensorNoise(Block):
    """Sensor noise of n channels: y[k] = u + deviation w[k], w white and standard normal, see `white_noise`.

    `deviation` [unit of u] >= 0, one number per channel, is a numeric parameter of the Context; `seed` >= 0,
    `stream` >= 0 tells apart sensors with one seed; `period` and `offset` in [s].  The state counts the ticks: w
    changes at offset + k period and is held between, so all who read at a tick read the same.
    Input `u`, which feeds through, output `y`: shape (n,).  Not converted to Expression: a draw is no function of the
    tick that a formula could state.
    """

    def __init__(self, deviation: ArrayLike, seed: int, period: float, offset: float = 0.0, stream: int = 0) -> None:
        self.seed, self.stream = whole("seed", seed), whole("stream", stream)
        n = self.parameter("deviation", deviation)
        self.input("u", n)
        self.state("ticks", 1)
        self.update(lambda ticks: ticks + 1.0, period, offset)
        self.output("y", n, self._noisy)

    def _noisy(self, u: Array, deviation: Array, ticks: Array) -> Array:
        tick = int(ticks[0] if self.scalar is float else ticks[0].value())
        return u + deviation * white_noise(self.seed, self.stream, tick, deviation.size)
