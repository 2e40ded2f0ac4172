"""A delay of whole periods, as buses and sensors have it."""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels, whole
from flipdiagram.blocks.block import Block, convertible


def shifted(stored: Array, u: Array) -> Array:
    """The last inputs with u (n,) as the youngest and without the oldest; shape (n · periods,) as `stored`."""
    return np.concatenate((stored[u.size :], u))


def oldest(stored: Array, num_channels: int) -> Array:
    """The first of the last inputs, shape (num_channels,)."""
    return stored[:num_channels]


@convertible()
class Delay(Block):
    """y[k] = u[k - periods], for n channels; `periods` >= 1, `period` and `offset` in [s].

    Unlike Drake's DiscreteTimeDelay it samples with an offset, as our other sampled boxes do.  The state holds the
    last inputs, oldest first; at the start all are `initial`, one number per channel or one for all.
    Input `u`, which does not feed through, output `y`: shape (n,) [any unit].
    """

    def __init__(
        self, num_channels: int, periods: int, period: float, offset: float = 0.0, initial: ArrayLike = 0.0
    ) -> None:
        self.num_channels, self.periods = num_channels, whole("periods", periods, 1)
        self.input("u", num_channels)
        self.initial = channels("initial", initial, num_channels, minimum=-np.inf)
        self.state("stored", np.tile(self.initial, periods))
        self.update(shifted, period, offset)
        self.output("y", num_channels, oldest)
