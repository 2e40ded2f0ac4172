"""The box PD of Fig. 4: position and velocity feedback that asks for an acceleration."""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks.block import Block, convertible


def feedback_acceleration(k_p: Array, k_v: Array, x_cmd: Array, v_cmd: Array, x: Array, v: Array) -> Array:
    """a_ref = K_p (x_cmd - x) + K_v (v_cmd - v) with diagonal gains; shapes (n,), k_p [1/s^2], k_v [1/s]."""
    return k_p * (x_cmd - x) + k_v * (v_cmd - v)


@convertible()
class ProportionalDerivative(Block):
    """PD feedback of n channels: a_ref = K_p (x_cmd - x) + K_v (v_cmd - v) (Fig. 4 of the paper).

    `k_p` [1/s^2] and `k_v` [1/s], one number per channel, are numeric parameters of the Context; a single number
    stands for all channels of the other gain.
    Inputs `x_cmd`, `x` [m or rad] and `v_cmd`, `v` [m/s or rad/s], output `a_ref` [m/s^2 or rad/s^2]: shape (n,).
    """

    def __init__(self, k_p: ArrayLike, k_v: ArrayLike) -> None:
        n = max(np.size(k_p), np.size(k_v))
        self.parameter("k_p", k_p, n)
        self.parameter("k_v", k_v, n)
        for name in ("x_cmd", "v_cmd", "x", "v"):
            self.input(name, n)
        self.output("a_ref", n, feedback_acceleration)
