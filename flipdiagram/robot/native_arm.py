"""The arm's kinematics and gravity by compiled loops, for what asks for them every millisecond."""

from functools import partial
from typing import Any

import numpy as np

from flipdiagram.arrays import Array, Floats
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.serial_chain import SerialChain, serial_chain


class NativeArm(ArmModel):
    """An ArmModel with compiled kinematics and gravity, equal to rounding; plant and Context are those of `arm`.

    In the place of `task_kinematics`, `task_position_velocity` and `gravity_torque` stand the compiled functions
    themselves, with the chain as their first argument: so they can become part of larger machine code.
    """

    def __init__(self, arm: ArmModel, chain: SerialChain) -> None:
        from flipdiagram.robot import chain as kinematics  # these import numba
        from flipdiagram.robot import dynamics

        vars(self).update(
            vars(arm),
            task_kinematics=partial(kinematics.task_kinematics, chain),
            task_position_velocity=partial(kinematics.task_position_velocity, chain),
            gravity_torque=partial(dynamics.gravity_torque, chain),
        )
        self._arm, self._tool_along = arm, partial(kinematics.tool_along, chain)

    def to_scalar(self, scalar: Any) -> ArmModel:
        """As of the arm itself: machine code knows floats only."""
        return self._arm.to_scalar(scalar)

    def tool_motion(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """As of ArmModel."""
        x, v, end = self._tool_along(np.ascontiguousarray(q), np.ascontiguousarray(qd))
        R, X_CT = end[:, :3], self.handles.control_point.CalcPose(self._context, self._tool).inverse()
        position = end[:, 3] + R @ X_CT.translation()
        return x, v, np.hstack([quaternions(R @ X_CT.rotation().matrix()), position])


def quaternions(R: Floats) -> Floats:
    """Quaternions (K, 4), w first and not negative, of rotation matrices (K, 3, 3)."""
    diagonal = np.einsum("kii->ki", R)
    # 4 q q', of which each row is a multiple of q: the one with the largest diagonal is the most exact
    products = np.empty((len(R), 4, 4))
    products[:, 0, 0] = 1 + diagonal.sum(axis=1)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[:, i + 1, i + 1] = 1 + diagonal[:, i] - diagonal[:, j] - diagonal[:, k]
        products[:, 0, i + 1] = products[:, i + 1, 0] = R[:, k, j] - R[:, j, k]
        products[:, j + 1, i + 1] = products[:, i + 1, j + 1] = R[:, j, i] + R[:, i, j]
    best = np.argmax(np.einsum("kii->ki", products), axis=1)
    rows = products[np.arange(len(R)), best]
    return rows / (np.linalg.norm(rows, axis=1) * np.where(rows[:, 0] < 0, -1.0, 1.0))[:, None]


def native_arm(arm: ArmModel) -> ArmModel:
    """The arm with kinematics and gravity compiled, itself where it is no chain of revolute joints."""
    chain = serial_chain(arm)
    return NativeArm(arm, chain) if chain else arm
