"""What the controller sees of the joints: quantised positions, and velocities derived from them."""

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels
from flipdiagram.blocks._scalars import choose, over_floats
from flipdiagram.blocks.block import Block, convertible


def _quantised_floats(q: Array, resolution: Array) -> Array:
    on = resolution > 0.0
    step = np.where(on, resolution, 1.0)
    return np.where(on, step * np.floor(q / step + 0.5), q)


@over_floats(_quantised_floats)
def quantised(q: Array, resolution: Array) -> Array:
    """The multiple of `resolution` next to q, halves upwards; q itself where the resolution is 0.

    Shapes (n,), [rad] or [m]. The derivative with respect to q is 0 where the resolution is not.
    """
    if q.dtype != object:
        return _quantised_floats(q, resolution)
    rounded = []
    for position, size in zip(q, resolution, strict=True):
        step = choose(size > 0.0, size, type(size)(1.0))  # no division by zero in the branch not taken
        rounded.append(choose(size > 0.0, step * scalar_math.floor(position / step + 0.5), position))
    return np.array(rounded, dtype=object)


def next_filter_state(z: Array, g_v: Array, period: float, q: Array) -> Array:
    """z[k+1] = e^(-g_v T) z[k] + (1 - e^(-g_v T)) q[k], T the `period` [s]; shapes (n,).

    The low-pass g_v/(s+g_v), exact for q held over T.
    """
    decay = np.exp(-g_v * period)
    return decay * z + (1.0 - decay) * q


def filtered_velocity(z: Array, g_v: Array, period: float, q: Array) -> Array:
    """v[k] = G_v (q[k] - z[k]) [rad/s], G_v = (1 - e^(-g_v T))/T; shapes (n,), g_v [rad/s], T the `period` [s].

    G_v in the place of g_v makes the velocity of a ramp exact for any T; for g_v T -> oo it is the backward difference.
    """
    return (1.0 - np.exp(-g_v * period)) / period * (q - z)


@convertible()
class Encoder(Block):
    """Encoder of n joints: q rounded to a multiple of `resolution` (0: not rounded), see `quantised`.

    `resolution` [rad] >= 0, one number per joint, is a numeric parameter of the Context.
    Input `q`, output `q_measured` [rad]: shape (n,).
    """

    def __init__(self, resolution: ArrayLike) -> None:
        n = self.parameter("resolution", resolution)
        self.input("q", n)
        self.output("q_measured", n, quantised)


@convertible()
class PseudoDerivative(Block):
    """Velocity of n joints from their positions: v = g_v s/(s+g_v) q, sampled.

    `g_v` [rad/s] >= 0, one number per joint, is a numeric parameter of the Context; `period` and `offset` in [s]; of a
    ramp it gives the exact velocity.  The state z, low-passed q, starts at `initial` [rad]: a
    start at another q shows as the velocity G_v (q(0) - initial).
    Input `q` [rad], which feeds through, output `v` [rad/s]: shape (n,).
    """

    def __init__(self, g_v: ArrayLike, period: float, offset: float = 0.0, initial: ArrayLike = 0.0) -> None:
        n = self.parameter("g_v", g_v)
        self.input("q", n)
        self.initial = channels("initial", initial, n, minimum=-np.inf)
        self.state("z", self.initial)
        self.update(next_filter_state, period, offset)
        self.output("v", n, filtered_velocity)
