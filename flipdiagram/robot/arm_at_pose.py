"""The arm about one pose: kinematics, inertia and gravity linear in the joint angles, so that every scalar serves."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array, Floats
from flipdiagram.robot.arm import ArmModel

STEP = 1e-6
"""Of central differences [rad]."""


class ArmAtPose(ArmModel):
    """An arm whose Jacobian J and M are those at q0, x = x(q0) + J (q - q0), without Jdot qd; gravity to first order.

    What blocks ask of an arm, over float, AutoDiffXd and Expression alike: Drake inverts no symbolic 6 x 6 matrix, and
    J is one of numbers here.  Limits and names are those of `arm`.
    """

    def __init__(self, arm: ArmModel, q0: Floats) -> None:
        self.__dict__.update(arm.__dict__)
        self.q0 = np.array(q0, dtype=float)
        self._x0, _, self._J, _ = arm.task_kinematics(q0, np.zeros(arm.n_joints))
        self._M, self._gravity = arm.mass_matrix(q0), arm.gravity_torque(q0)
        self._slope = slope(arm.gravity_torque, self.q0)

    def to_scalar(self, scalar: Any) -> "ArmAtPose":
        """Itself: its numbers go with every scalar."""
        return self

    def task_position(self, q: ArrayLike) -> Array:
        """See `ArmModel`."""
        x: Array = self._x0 + self._J.dot(self._joints("q", q) - self.q0)
        return x

    def task_position_velocity(self, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
        """See `ArmModel`."""
        return self.task_position(q), self._J.dot(self._joints("qd", qd))

    def task_kinematics(self, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """See `ArmModel`; the bias is 0."""
        return (*self.task_position_velocity(q, qd), self._J, np.zeros(len(self._x0)))

    def mass_matrix(self, q: ArrayLike) -> Array:
        """See `ArmModel`."""
        return self._M

    def gravity_torque(self, q: ArrayLike) -> Array:
        """See `ArmModel`."""
        torque: Array = self._gravity + self._slope.dot(self._joints("q", q) - self.q0)
        return torque


def slope(function: Any, at: Floats) -> Floats:
    """Jacobian (m, n) of a function (n,) -> (m,) by central differences."""
    ends = [(function(at + step) - function(at - step)) / (2 * STEP) for step in STEP * np.eye(len(at))]
    return np.array(ends, dtype=float).T
