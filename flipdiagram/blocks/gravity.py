"""Gravity compensation, a box that the paper's controllers lack: it leaves gravity to the disturbance observer."""

from typing import Any

from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks.block import Block, convertible


def compensating_torque(fraction: Array, gravity: Array) -> Array:
    """tau_gravity = fraction * gravity [N m]; shapes (n,)."""
    return fraction * gravity


@convertible()
class GravityCompensation(Block):
    """Torque that holds a fraction of the arm's gravity: tau_gravity = fraction * gravity_torque(q).

    `arm` has the method `gravity_torque(q)` and, for other scalars than float, `to_scalar(T)`; `fraction` >= 0 [-],
    one number per joint or one for all, is a numeric parameter of the Context.
    Input `q` (n,) [rad], which feeds through, output `tau_gravity` (n,) [N m].
    """

    def __init__(self, arm: Any, fraction: ArrayLike, num_joints: int = 6) -> None:
        self.arm, self.num_joints = arm, num_joints
        scalar_arm = arm if self.scalar is float else arm.to_scalar(self.scalar)
        self.parameter("fraction", fraction, num_joints)
        self.input("q", num_joints)
        self.intermediate("gravity", scalar_arm.gravity_torque)
        self.output("tau_gravity", num_joints, compensating_torque)
