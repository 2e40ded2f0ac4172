"""The box J_t^-1 of Fig. 4: from an acceleration of the tool to accelerations of the joints."""

from typing import Any

import numpy as np
import pydrake.math as scalar_math

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels, whole
from flipdiagram.blocks.block import Block, convertible
from flipdiagram.errors import SimulationError


def joint_acceleration(jacobian: Array, bias: Array, a_ref: Array, inner: Array | None = None) -> Array:
    """qdd_ref = J_t^-1 (a_ref - Jdot_t qd), shape (n,); for n > m by the pseudo-inverse J^+ = J^T (J J^T)^-1.

    `inner` (n,) [rad/s^2], for n > m: the acceleration wanted beside the task's; what of it moves the tool is left
    out, qdd_ref = inner + J^+ (a_ref - Jdot_t qd - J inner).
    `jacobian` J_t (m, n), `bias` Jdot_t qd (m,), `a_ref` (m,) [m/s^2, rad/s^2].
    Floats raise SimulationError where J_t is exactly singular; symbolic matrices cannot be inverted
    beyond 4 x 4 (RuntimeError of Drake).
    """
    coordinates, joints = jacobian.shape
    demand = a_ref - bias
    if inner is not None and joints > coordinates:
        demand = demand - jacobian.dot(inner)
    square = jacobian if joints == coordinates else jacobian.dot(jacobian.T)
    if square.dtype == object:
        solution = scalar_math.inv(square).dot(demand)
    else:
        try:
            solution = np.linalg.solve(square, demand)
        except np.linalg.LinAlgError:
            raise SimulationError(
                f"the arm is at a singularity: its task Jacobian has rank {np.linalg.matrix_rank(jacobian)}, "
                f"valid is {coordinates}"
            ) from None
    if joints == coordinates:
        return solution
    least = jacobian.T.dot(solution)
    return least if inner is None else inner + least


@convertible()
class InverseJacobian(Block):
    """Inverse of the task Jacobian: qdd_ref = J_t^-1 (a_ref - Jdot_t qd) (Fig. 4 of the paper).

    `arm` has the method `task_kinematics(q, qd) -> (x, v, J, bias)` and, for other scalars than float, `to_scalar(T)`,
    which returns an arm with the same method over T (or raises).
    Inputs `a_ref` (m,) [m/s^2, rad/s^2], `q` (n,) [rad], `qd` (n,) [rad/s], output `qdd_ref` (n,) [rad/s^2],
    m = `num_coordinates`, n = `num_joints`, n >= m.  With n > m the motion that does not move the tool is damped,
    -`inner_damping` qd, in [1/s].
    """

    def __init__(self, arm: Any, num_joints: int = 6, num_coordinates: int = 6, inner_damping: float = 0.0) -> None:
        self.num_coordinates = num_coordinates
        self.arm, self.num_joints = arm, whole("num_joints", num_joints, num_coordinates)
        self.inner_damping = float(channels("inner_damping", inner_damping, 1)[0])
        self._scalar_arm = arm if self.scalar is float else arm.to_scalar(self.scalar)
        self.input("a_ref", num_coordinates)
        self.input("q", num_joints)
        self.input("qd", num_joints)
        self.output("qdd_ref", num_joints, self._acceleration)

    def _acceleration(self, a_ref: Array, q: Array, qd: Array) -> Array:
        _, _, jacobian, bias = self._scalar_arm.task_kinematics(q, qd)
        inner = -self.inner_damping * qd if self.num_joints > self.num_coordinates else None
        return joint_acceleration(jacobian, bias, a_ref, inner)
