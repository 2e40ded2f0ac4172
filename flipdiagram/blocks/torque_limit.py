"""The saturation of Fig. 4: what the drives can deliver."""

from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._scalars import maximum, minimum
from flipdiagram.blocks.block import Block, convertible


def limited_torque(tau_cmd: Array, tau_max: Array) -> Array:
    """tau = min(max(tau_cmd, -tau_max), tau_max) per channel; shapes (n,), [N m]."""
    return minimum(maximum(tau_cmd, -tau_max), tau_max)  # half the time of np.clip on small arrays


@convertible()
class TorqueLimit(Block):
    """Torque limit of n channels: tau = sat(tau_cmd) between -tau_max and tau_max.

    `tau_max` [N m] >= 0, one number per channel, is a numeric parameter of the Context.
    Input `tau_cmd`, output `tau` [N m]: shape (n,).
    """

    def __init__(self, tau_max: ArrayLike) -> None:
        n = self.parameter("tau_max", tau_max)
        self.input("tau_cmd", n)
        self.output("tau", n, limited_torque)
