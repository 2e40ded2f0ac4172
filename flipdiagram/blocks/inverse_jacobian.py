"""The box J_t^-1 of Fig. 4: from an acceleration of the tool to accelerations of the joints."""

from typing import Any

import numpy as np
import pydrake.math as scalar_math

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels, whole
from flipdiagram.blocks._scalars import over_floats
from flipdiagram.blocks.block import Block, convertible
from flipdiagram.errors import SimulationError


def eliminated(A: Array, b: Array) -> Array:
    """x with A x = b of floats, by Gauss with pivots: what machine code has in the place of LAPACK, whose call takes
    numba ten seconds to compile.  LinAlgError where A is singular.
    """
    n, U, x = len(b), A.copy(), b.copy()
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(U[i, k]) > abs(U[pivot, k]):
                pivot = i
        if U[pivot, k] == 0.0:
            raise np.linalg.LinAlgError("singular")
        for j in range(n):
            U[k, j], U[pivot, j] = U[pivot, j], U[k, j]
        x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, n):
            factor = U[i, k] / U[k, k]
            for j in range(k, n):
                U[i, j] -= factor * U[k, j]
            x[i] -= factor * x[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= U[k, j] * x[j]
        x[k] /= U[k, k]
    return x


@over_floats(eliminated)
def solution(A: Array, b: Array) -> Array:
    """x with A x = b, shapes (m, m), (m,).

    Floats raise SimulationError where A is exactly singular; symbolic matrices cannot be inverted beyond 4 x 4
    (RuntimeError of Drake).
    """
    if A.dtype == object or b.dtype == object:
        inverse: Array = scalar_math.inv(A) if A.dtype == object else np.linalg.inv(A)
        return inverse.dot(b)
    try:
        return np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        raise SimulationError(
            f"the arm is at a singularity: its task Jacobian has rank {np.linalg.matrix_rank(A)}, valid is {len(A)}"
        ) from None


def joint_acceleration(jacobian: Array, bias: Array, a_ref: Array, inner: Array | None = None) -> Array:
    """qdd_ref = J_t^-1 (a_ref - Jdot_t qd), shape (n,); for n > m by the pseudo-inverse J^+ = J^T (J J^T)^-1.

    `inner` (n,) [rad/s^2], for n > m: the acceleration wanted beside the task's; what of it moves the tool is left
    out, qdd_ref = inner + J^+ (a_ref - Jdot_t qd - J inner).
    `jacobian` J_t (m, n), `bias` Jdot_t qd (m,), `a_ref` (m,) [m/s^2, rad/s^2]; errors as of `solution`.
    """
    coordinates, joints = jacobian.shape
    demand = a_ref - bias
    if joints == coordinates:
        return solution(jacobian, demand)
    if inner is not None:
        demand = demand - jacobian.dot(inner)
    least = jacobian.T.dot(solution(jacobian.dot(jacobian.T), demand))
    return least if inner is None else inner + least


def reference_acceleration(
    kinematics: tuple[Array, Array, Array, Array], a_ref: Array, qd: Array, inner_damping: float
) -> Array:
    """qdd_ref (n,) of `joint_acceleration`, the inner motion damped; kinematics: x, v, J, bias."""
    _, _, jacobian, bias = kinematics
    return joint_acceleration(jacobian, bias, a_ref, -inner_damping * qd)


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
        scalar_arm = arm if self.scalar is float else arm.to_scalar(self.scalar)
        self.input("a_ref", num_coordinates)
        self.input("q", num_joints)
        self.input("qd", num_joints)
        self.intermediate("kinematics", scalar_arm.task_kinematics)
        self.output("qdd_ref", num_joints, reference_acceleration)
