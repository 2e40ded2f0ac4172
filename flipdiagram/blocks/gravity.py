"""Gravity compensation, a box that the paper's controllers lack: it leaves gravity to the disturbance observer."""

from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.blocks._parameters import ScalarContext, ScalarVector, channels, declare_parameter, write_parameter


@TemplateSystem.define("GravityCompensation_")
def GravityCompensation_(T: Any) -> type:
    """``GravityCompensation`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Torque that holds a fraction of the arm's gravity: tau_gravity = fraction · gravity_torque(q).

        ``arm`` has the method ``gravity_torque(q)`` and, for other scalars than float, ``to_scalar(T)``;
        ``fraction`` >= 0, one number per joint or one for all, is a numeric parameter of the Context.
        Input ``q`` (n,) [rad], which feeds through, output ``tau_gravity`` (n,) [N m].
        """

        def _construct(self, arm: Any, fraction: Any, num_joints: int = 6, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.arm, self.num_joints = arm, num_joints
            self.fraction = channels("fraction", fraction, num_joints)
            self._scalar_arm = arm if T is float else arm.to_scalar(T)
            self._fraction, ticket = declare_parameter(self, T, self.fraction)
            self._q = self.DeclareVectorInputPort("q", num_joints)
            self.DeclareVectorOutputPort("tau_gravity", num_joints, self._calc, {self._q.ticket(), ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.arm, other.fraction, other.num_joints, converter=converter)

        def set_fraction(self, context: ScalarContext, fraction: Any) -> None:
            """Sets the fraction, shape (n,) or one number for all joints, in ``context``."""
            write_parameter(context, self._fraction, channels("fraction", fraction, self.num_joints))

        def _calc(self, context: ScalarContext, output: ScalarVector) -> None:
            fraction = context.get_numeric_parameter(self._fraction).CopyToVector()
            output.set_value(np.asarray(fraction) * self._scalar_arm.gravity_torque(self._q.Eval(context)))

    return Impl


GravityCompensation = GravityCompensation_[None]
