"""Torque ripple of a drive: its torque wavers with the angle of the motor."""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks.block import Block, convertible


def rippled_torque(tau: Array, q: Array, amplitude: Array, cycles: Array) -> Array:
    """tau_drive = tau + amplitude sin(cycles q) [N m], shapes (n,); q [rad].

    The ripple is the slope of a potential, amplitude cos(cycles q) / cycles: over a whole turn it does no work.
    """
    return tau + amplitude * np.sin(cycles * q)


@convertible()
class TorqueRipple(Block):
    """Torque ripple of n drives: tau_drive = tau + amplitude sin(cycles q).

    `amplitude` [N m] >= 0 and `cycles` [1] >= 0, periods per turn of the joint, one number per joint, are numeric
    parameters of the Context.
    Inputs `tau` [N m], `q` [rad], which feed through, output `tau_drive` [N m]: shape (n,).
    """

    def __init__(self, amplitude: ArrayLike, cycles: ArrayLike) -> None:
        n = self.parameter("amplitude", amplitude)
        self.parameter("cycles", cycles, n)
        self.input("tau", n)
        self.input("q", n)
        self.output("tau_drive", n, rippled_torque)
