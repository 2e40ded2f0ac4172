"""The box J_t^-1 of Fig. 4: from an acceleration of the tool to accelerations of the joints."""

from typing import Any

import numpy as np
import pydrake.math as scalar_math
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._parameters import ScalarContext, ScalarVector, channels
from flipdiagram.errors import InputError, SimulationError


def joint_acceleration(jacobian: Array, bias: Array, a_ref: Array, inner: Array | None = None) -> Array:
    """qdd_ref = J_t^-1 (a_ref - Jdot_t qd), shape (n,); for n > m by the pseudo-inverse J^+ = J^T (J J^T)^-1.

    ``inner`` (n,) [rad/s^2], for n > m: the acceleration wanted beside the task's; what of it moves the tool is left
    out, qdd_ref = inner + J^+ (a_ref - Jdot_t qd - J inner).
    ``jacobian`` J_t (m, n), ``bias`` Jdot_t qd (m,), ``a_ref`` (m,) [m/s^2, rad/s^2].
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


@TemplateSystem.define("InverseJacobian_")
def InverseJacobian_(T: Any) -> type:
    """``InverseJacobian`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Inverse of the task Jacobian: qdd_ref = J_t^-1 (a_ref - Jdot_t qd) (Fig. 4 of the paper).

        ``arm`` has the method ``task_kinematics(q, qd) -> (x, v, J, bias)`` and, for other scalars than
        float, ``to_scalar(T)``, which returns an arm with the same method over T (or raises).
        Inputs ``a_ref`` (m,) [m/s^2, rad/s^2], ``q`` (n,) [rad], ``qd`` (n,) [rad/s], output ``qdd_ref`` (n,)
        [rad/s^2], m = ``num_coordinates``, n = ``num_joints``, n >= m.  With n > m the motion that does not move the
        tool is damped, -``inner_damping`` qd, in [1/s].
        """

        def _construct(
            self,
            arm: Any,
            num_joints: int = 6,
            num_coordinates: int = 6,
            inner_damping: float = 0.0,
            converter: Any = None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            if num_joints < num_coordinates:
                raise InputError(
                    f"num_joints = {num_joints}; {num_coordinates} coordinates need at least as many joints"
                )
            self.arm, self.num_joints, self.num_coordinates = arm, num_joints, num_coordinates
            self.inner_damping = float(channels("inner_damping", inner_damping, 1)[0])
            self._scalar_arm = arm if T is float else arm.to_scalar(T)
            self._a_ref = self.DeclareVectorInputPort("a_ref", num_coordinates)
            self._q = self.DeclareVectorInputPort("q", num_joints)
            self._qd = self.DeclareVectorInputPort("qd", num_joints)
            inputs = {self._a_ref.ticket(), self._q.ticket(), self._qd.ticket()}
            self.DeclareVectorOutputPort("qdd_ref", num_joints, self._calc_qdd_ref, inputs)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(
                self, other.arm, other.num_joints, other.num_coordinates, other.inner_damping, converter=converter
            )

        def _calc_qdd_ref(self, context: ScalarContext, output: ScalarVector) -> None:
            qd = self._qd.Eval(context)
            _, _, jacobian, bias = self._scalar_arm.task_kinematics(self._q.Eval(context), qd)
            redundant = self.num_joints > self.num_coordinates
            inner = -self.inner_damping * qd if redundant else None
            output.set_value(joint_acceleration(jacobian, bias, self._a_ref.Eval(context), inner))

    return Impl


InverseJacobian = InverseJacobian_[None]
