"""The box FF of Fig. 4: acceleration feed-forward from the planner."""

from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks.block import Block, convertible


def feedforward_acceleration(k_ff: Array, a_cmd: Array) -> Array:
    """a_ff = k_ff a_cmd per channel; the paper's feed-forward has k_ff = 1. Shapes (n,)."""
    return k_ff * a_cmd


@convertible()
class AccelerationFeedforward(Block):
    """Acceleration feed-forward of n channels: a_ff = k_ff a_cmd (section II-C of the paper).

    `k_ff` [-], one number per channel, is a numeric parameter of the Context, 1 unless given.
    Input `a_cmd`, output `a_ff`: shape (n,) [m/s^2 or rad/s^2].
    """

    def __init__(self, num_channels: int, k_ff: ArrayLike = 1.0) -> None:
        self.num_channels = num_channels
        self.parameter("k_ff", k_ff, num_channels)
        self.input("a_cmd", num_channels)
        self.output("a_ff", num_channels, feedforward_acceleration)
