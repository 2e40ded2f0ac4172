"""The forward kinematics of Fig. 4: joint positions and velocities to those of the tool."""

from typing import Any

from flipdiagram.blocks.block import Block, convertible


@convertible()
class ToolKinematics(Block):
    """Task coordinates of the tool and their time derivatives, x(q) and v = J_t(q) qd.

    `arm` has the method `task_position_velocity(q, qd) -> (x, v)` and, for scalars other than float, `to_scalar(T)`,
    which returns an arm with the same method over T (or raises: not convertible to T).
    Inputs `q` [rad], `qd` [rad/s]: shape (n,), n = `num_joints`; outputs `x` [m, rad], `v` [m/s, rad/s]: shape (m,),
    m = `num_coordinates`.  Both are computed at once, when the first is read; so both depend on both inputs.
    """

    def __init__(self, arm: Any, num_joints: int = 6, num_coordinates: int = 6) -> None:
        self.arm, self.num_joints, self.num_coordinates = arm, num_joints, num_coordinates
        scalar_arm = arm if self.scalar is float else arm.to_scalar(self.scalar)
        self.input("q", num_joints)
        self.input("qd", num_joints)
        self.outputs(("x", "v"), num_coordinates, scalar_arm.task_position_velocity)
