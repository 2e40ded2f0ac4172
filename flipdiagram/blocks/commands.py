"""Sources for experiments: the sinusoidal command of eqs. (13)-(15), and noise on a measured signal."""

from typing import Any

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels
from flipdiagram.blocks.block import Block, convertible
from flipdiagram.errors import InputError

MODULUS, MULTIPLIER = 2147483647.0, 16807.0
"""Park and Miller's minimal standard generator: every product stays below 2^53, so doubles compute it exactly."""


def next_random(state: Any) -> Any:
    """n[k+1] = 16807 n[k] mod (2^31 - 1), a whole number from 1 to 2^31 - 2, of period 2^31 - 2."""
    product = MULTIPLIER * state
    return product - MODULUS * scalar_math.floor(product / MODULUS)


def uniform_noise(state: Any, rms: Any) -> Any:
    """White noise, uniform within +-sqrt(3) rms, of a state of `next_random`."""
    return rms * np.sqrt(3.0) * (2.0 * state / MODULUS - 1.0)


def sines(omega: Array, t: Any) -> Array:
    """sin wt per channel, shape (n,), over every scalar."""
    return np.array([scalar_math.sin(w * t) for w in omega])


def cosines(omega: Array, t: Any) -> Array:
    """cos wt per channel, shape (n,), over every scalar."""
    return np.array([scalar_math.cos(w * t) for w in omega])


@convertible()
class SinusoidalCommand(Block):
    """Commands of n channels, eqs. (13)-(15): x_cmd = -A sin wt, v_cmd = -A w cos wt, a_cmd = A w^2 sin wt.

    Numeric parameters of the Context, one number per channel: `omega` w [rad/s] > 0, `amplitude` A [m].
    Outputs `x_cmd` [m], `v_cmd` [m/s], `a_cmd` [m/s^2]: shape (n,), functions of time.
    """

    def __init__(self, omega: ArrayLike, amplitude: ArrayLike = 1.0) -> None:
        n = self.parameter("omega", omega, strict=True)
        self.parameter("amplitude", amplitude, n)
        self.output("x_cmd", n, lambda t, omega, amplitude: -amplitude * sines(omega, t))
        self.output("v_cmd", n, lambda t, omega, amplitude: -amplitude * omega * cosines(omega, t))
        self.output("a_cmd", n, lambda t, omega, amplitude: amplitude * omega * omega * sines(omega, t))


@convertible()
class SinusoidalNoise(Block):
    """Noise of n channels as a sinusoid, A sin wt (section III-B of the paper, Fig. 10).

    Numeric parameters of the Context, one number per channel: `omega` w [rad/s] > 0, `amplitude` A.
    Output `noise`: shape (n,), in the unit of the amplitude, [m/s] for a velocity.
    """

    def __init__(self, omega: ArrayLike, amplitude: ArrayLike = 1.0) -> None:
        n = self.parameter("omega", omega, strict=True)
        self.parameter("amplitude", amplitude, n)
        self.output("noise", n, lambda t, omega, amplitude: amplitude * sines(omega, t))


@convertible()
class BroadbandNoise(Block):
    """White noise of n channels, uniform within +-sqrt(3) rms, a new number each `period` [s].

    The generator (`next_random`) is arithmetic on its state, exact in doubles: the same numbers in Drake's
    Simulator, in a symbolic form and in compiled code.  The state is the `seed`, a whole number from 1 to
    2^31 - 2, one per channel; seeds in a ratio of small numbers give correlated channels.
    `rms` is a numeric parameter of the Context, one number per channel.
    Output `noise`: shape (n,), in the unit of rms, [m/s] for a velocity.
    """

    def __init__(self, rms: ArrayLike, period: float, seed: ArrayLike = 1) -> None:
        n = self.parameter("rms", rms)
        self.seed = channels("seed", seed, n, minimum=1.0)
        if self.seed.dtype != object and not ((self.seed < MODULUS) & (self.seed == np.floor(self.seed))).all():
            raise InputError.of("seed", self.seed.tolist(), "whole numbers from 1 to 2147483646")
        self.state("state", self.seed)
        self.update(lambda state: np.array([next_random(value) for value in state]), period)
        self.output("noise", n, uniform_noise)
